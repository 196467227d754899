"""Where the robust error-state filter keeps what: parameters, memory, scratch and records."""

from strapdown.kernels.memory import HEAD, P_HEAD, W_HEAD
from strapdown.kernels.robust_eskf_covariance import INTERVAL, N

# --- p -----------------------------------------------------------------------------------
P_GYR_NOISE = P_HEAD
P_GYR_RATE_NOISE = P_HEAD + 1
P_GYR_BIAS_WALK = P_HEAD + 2
P_GYR_BIAS_STD = P_HEAD + 3
P_GYR_SCALE_STD = P_HEAD + 4
P_ACC_NOISE = P_HEAD + 5
P_ACC_BIAS_STD = P_HEAD + 6
P_VELOCITY_STD = P_HEAD + 7
P_VELOCITY_TIME = P_HEAD + 8
P_MAG_STD = P_HEAD + 9
P_MAG_TIME = P_HEAD + 10
P_MAG_WALK = P_HEAD + 11
P_MAG_DELAY_STD = P_HEAD + 12
P_TAILS = P_HEAD + 13
P_REST_GYR = P_HEAD + 14
P_REST_ACC = P_HEAD + 15
P_REST_TIME = P_HEAD + 16
P_RATE_WALK = P_HEAD + 17
P_INTERVAL = P_HEAD + 18
P_LATENCY = P_HEAD + 19
P_TIMING_STD = P_HEAD + 20
P_FIELD_STD = P_HEAD + 21
P_GRAVITY = P_HEAD + 22
P_SIZE = P_HEAD + 23

# --- x -----------------------------------------------------------------------------------
ATT = HEAD  # q_nb before the latency is added: 4
MG = HEAD + 4  # scale and misalignment of the gyro: 9
DELAY = HEAD + 13  # of the magnetometer [s]
OPEN = HEAD + 14  # sums of the open interval
FIELD = OPEN + INTERVAL  # field in n (3), turning rate of the field (2), count
EXTRA = FIELD + 6  # variances that the interval adds besides the noise: angle, velocity
SINCE_MAG = EXTRA + 2  # [s]
USUAL = SINCE_MAG + 1  # usual field: horizontal, down, variance of both
GYR_MEAN = USUAL + 3  # low-passed rate and specific force
ACC_MEAN = GYR_MEAN + 3
QUIET = ACC_MEAN + 3  # how long both have been near their mean [s]
DRIFT = QUIET + 1  # low-passed velocity over its deviation: 3
FLAGS = DRIFT + 3  # status bits of the last interval
ACC_HELD = FLAGS + 1  # last specific force, for sensors slower than the gyro: 3
HAS_HELD = ACC_HELD + 3
ASTRAY = HAS_HELD + 1  # low-passed heading innovation in a field of the usual strength [rad]
LARGEST = ASTRAY + 1  # rate of largest magnitude so far, one axis [rad/s]
REPEATED = LARGEST + 1  # how often the largest component has repeated to the last bit
LAST_GYR = REPEATED + 1  # last sample: 3
STARTED = LAST_GYR + 3
LEVEL_LEFT = STARTED + 1  # how long the level is still sought [s]
LEVEL_DV = LEVEL_LEFT + 1  # specific force summed up meanwhile, n [m/s]: 3
X_SIZE = LEVEL_DV + 3

# --- w: scratch, and the record of a closed interval that the smoother reads ---------------------
ERROR = W_HEAD  # error state of the open update
SCRATCH = ERROR + N
RECORD = SCRATCH + 12 * N
R_CLOSED = RECORD  # 1 when this sample closed an interval
R_RESET = RECORD + 1  # 1 if attitude and velocity were forgotten in it, 2 if heading was
R_RESET_T = RECORD + 2  # and when
R_LEVEL_T = RECORD + 3  # and when the level was found again
R_TURN = RECORD + 4  # turn about down at that reset
R_COUNT = RECORD + 5  # measurements
R_STEP = RECORD + 6  # corrections of attitude and gyro bias
R_SUMS = R_STEP + 6
R_ROWS = R_SUMS + INTERVAL  # rows of attitude and gyro bias of P after the updates
R_MEASURED = R_ROWS + 6 * N  # each: element, h_lag, innovation, its variance, g
MEASURED = N + 4
W_SIZE = R_MEASURED + 7 * MEASURED
RECORD_SIZE = W_SIZE - RECORD
