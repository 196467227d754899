"""Where things stand in the vectors of the GNSS/INS filter.

``x`` is all that the filter remembers besides its covariance ``P``, ``p`` its parameters, ``w``
scratch with an optional tape for the smoother. The head of ``x`` holds what the filter says
(`kernels.memory`); its own estimates follow. The error state stands in the order phi_n, dv_n,
dp_n, db_g, db_a, then the optional blocks, whose first index is in ``p`` (-1 where one is off).
``dx`` is what has to be added to the estimate; the attitude error is a small rotation in n:
``q_true = exp(phi_n) q_nb``.
"""

from strapdown.kernels.memory import GNSS, HEAD, P_HEAD, W_HEAD

# --- x: estimates ----------------------------------------------------------------------
Q = HEAD  # q_nb: 4
BG = HEAD + 4  # gyro bias, b [rad/s]: 3
BA = HEAD + 7  # accelerometer bias, b [m/s^2]: 3
LLA = HEAD + 10  # latitude, longitude, height of the IMU [rad, rad, m]: 3
V = HEAD + 13  # velocity over ground, NED [m/s]: 3
SG = HEAD + 16  # gyro error per rate about down, b: 3
SA = HEAD + 19  # accelerometer scale error: 3
QVB = HEAD + 22  # mount, body to vehicle: 4
ARM_V = HEAD + 26  # IMU to the point without side slip, along the vehicle's x axis [m]
ARM_A = HEAD + 27  # IMU to the antenna, b [m]: 3
DELAY = HEAD + 30  # how much later the receiver's clock reads than the IMU's [s]
BP = HEAD + 31  # slowly varying error of the fixes' position, NED [m]: 3
SODO = HEAD + 34  # scale error of the wheel speed
BARO = HEAD + 35  # pressure height less height [m]
FIX_SV = HEAD + 36  # velocity sigma of the last fix, NED [m/s]: 3
FIX_SD = HEAD + 39  # position sigma of the last fix, NED [m]: 3
# scales of the fixes' slow errors, 4: position level, position down, velocity level, velocity down
K_SLOW = HEAD + 42
# --- x: slow quantities ----------------------------------------------------------------
ACC_N = HEAD + 46  # smoothed acceleration over ground, NED [m/s^2]: 3
RATE = HEAD + 49  # smoothed angular rate less bias, b [rad/s]: 3
# --- x: the Earth here -----------------------------------------------------------------
GRAVITY = HEAD + 52  # [m/s^2]
W_IN = HEAD + 53  # omega_in_n [rad/s]: 3
W_COR = HEAD + 56  # 2 omega_ie_n + omega_en_n [rad/s]: 3
R_N = HEAD + 59  # metres per radian of latitude
R_E = HEAD + 60  # metres per radian of longitude
# --- x: sums since the last covariance step, DT first ----------------------------------
DT = HEAD + 61  # time [s]
S_C = HEAD + 62  # sum of C_nb dt: 9
S_CW = HEAD + 71  # sum of C_nb omega_d dt: 9
S_F = HEAD + 80  # sum of f_n dt: 3
S_CF = HEAD + 83  # sum of C_nb diag(f) dt: 9
N_SUMS = 31
# --- x: rest test ----------------------------------------------------------------------
RING = HEAD + 92  # five blocks of 13 sums: count, rate 3, force 3, their squares 6: 65
RING_BLOCK = 13
BLOCK_DT = HEAD + 157  # time in the block that fills [s]
AT_REST = HEAD + 158  # 1 while the whole window is quiet
NOISE_G = HEAD + 159  # least white noise of the gyroscope so far [(rad/s)^2/Hz]; 0: none
NOISE_A = HEAD + 160  # of the accelerometer [(m/s^2)^2/Hz]
# --- x: alignment ----------------------------------------------------------------------
MODE = HEAD + 161  # 0 aligning, 1 navigating
AB = HEAD + 162  # attitude profile matrix B, rows n, columns b of now: 9
A_SQUARES = HEAD + 171  # weighted sum of |alpha|^2 + |beta|^2
A_Q = HEAD + 172  # rotation since the last fix: 4
A_F = HEAD + 176  # specific force summed in b of the last fix [m/s]: 3
A_DT = HEAD + 179  # time since that fix [s]
A_FIX = HEAD + 180  # 1 once there was a fix
A_V = HEAD + 181  # velocity of that fix, NED [m/s]: 3
A_LLA = HEAD + 184  # position of that fix: 3
A_COUNT = HEAD + 187  # number of fixes, faded
A_VAR = HEAD + 188  # variance of heading that alignment has reached [rad^2]
A_REST = HEAD + 189  # blocks of rest that the gyro bias was averaged over
# --- x: mount --------------------------------------------------------------------------
MOUNTED = HEAD + 190  # 1 once the mount is found
M_SUM = HEAD + 191  # sum of unit vectors of travel in b: 3
M_COUNT = HEAD + 194  # number of them
M_BACK = HEAD + 195  # time of travelling backwards fast [s]
# --- x: bookkeeping of fixes -----------------------------------------------------------
T_POS = HEAD + 196  # time of the last position taken [s]
T_VEL = HEAD + 197  # time of the last velocity taken [s]
FIX_SPEED = HEAD + 198  # horizontal speed of the last fix [m/s]
FIX_T = HEAD + 199  # its time [s]; NaN before the first
JUMP = HEAD + 200  # innovation of the last rejected position, NED [m]: 3
JUMPS = HEAD + 203  # rejected positions in a row that agree with each other
LAST_F = HEAD + 204  # last specific force, where the accelerometer is slower: 3
LAST_G = HEAD + 207  # last angular rate: 3
STEPS = HEAD + 210  # squares of steps of rate and force, number, time: 4
# --- x: what is learned of the receiver -----------------------------------------------------
BV = HEAD + 214  # error of the fixes' velocity that lasts, NED [m/s]: 3
K_WHITE = HEAD + 217  # scales of their white errors, as K_SLOW: 4
RHO = HEAD + 221  # correlation of one innovation with the next, averaged: 4
D_LAST = HEAD + 225  # last normalised innovations, position, velocity: 6
FIXES = HEAD + 231  # number of fixes since the filter began
BR = HEAD + 232  # drift of the slow error of their position, NED [m/s]: 3
# --- x: magnetometer ---------------------------------------------------------------------------
IRON = HEAD + 235  # iron of box and carrier, b [T]: 3
DECLINATION = HEAD + 238  # [rad]
MAG_T = HEAD + 239  # time of the last field taken [s]
X_SIZE = HEAD + 240
# --- x: the inbox of fixes, in the head -----------------------------------------------------
IN_T = GNSS + 1  # its time [s]
IN_LLA = GNSS + 2
IN_V = GNSS + 5
IN_SP = GNSS + 8  # sigma of position, NED: 3
IN_SV = GNSS + 11  # sigma of velocity, NED: 3

# --- error state ---------------------------------------------------------------------------
PHI = 0
DV = 3
DP = 6
DBG = 9
DBA = 12
CORE = 15
MAX_N = 44

# --- p: size and optional blocks -------------------------------------------------------
N = P_HEAD  # length of the error state
M = P_HEAD + 1  # 15, and 3 each with scale errors of gyroscope and accelerometer
I_MOUNT = P_HEAD + 2
I_ARM_V = P_HEAD + 3
I_ARM_A = P_HEAD + 4
I_DELAY = P_HEAD + 5
I_BP = P_HEAD + 6
I_SODO = P_HEAD + 7
I_BARO = P_HEAD + 8
# --- p: sensors ------------------------------------------------------------------------
Q_G = P_HEAD + 9  # gyro noise [(rad/s)/sqrt(Hz)]
Q_A = P_HEAD + 10  # accelerometer noise [(m/s^2)/sqrt(Hz)]
Q_BG = P_HEAD + 11  # walk of the gyro bias [(rad/s)/sqrt(s)]
Q_BA = P_HEAD + 12  # walk of the accelerometer bias [(m/s^2)/sqrt(s)]
Q_MOUNT = P_HEAD + 13  # walk of the mount [rad/sqrt(s)]
SD_BG = P_HEAD + 14  # prior sigmas
SD_BA = P_HEAD + 15
SD_SCALE_G = P_HEAD + 16
SD_SCALE_A = P_HEAD + 17
SD_MOUNT = P_HEAD + 18
SD_ARM_V = P_HEAD + 19
SD_ARM_A = P_HEAD + 20
SD_DELAY = P_HEAD + 21
ARM_V_0 = P_HEAD + 22  # prior of ARM_V [m]
# --- p: fixes --------------------------------------------------------------------------
TAU_BP = P_HEAD + 23  # time constant of the slow error of position, twice [s]
SHARE_BP = P_HEAD + 24  # slow error of position per receiver sigma
WHITE_P = P_HEAD + 25  # fast error of position per receiver sigma, to begin with
SCALE_V = P_HEAD + 26  # error of velocity per receiver sigma, to begin with
LEARN = P_HEAD + 27  # per fix
GATE = P_HEAD + 28  # of the normalised innovation squared
RECOVER = P_HEAD + 29  # time after which a rejection is overruled [s]
# --- p: vehicle and rest ---------------------------------------------------------------
CAR = P_HEAD + 30  # 1 with the non-holonomic constraint
SD_SIDE = P_HEAD + 31  # [m/s]
SD_UP = P_HEAD + 32  # [m/s]
SLIP = P_HEAD + 33  # side slip per lateral acceleration [s]
T_CON = P_HEAD + 34  # [s]
V_CON = P_HEAD + 35  # least speed of the constraint [m/s]
SD_ROLL = P_HEAD + 36  # [rad]
ZUPT = P_HEAD + 37  # 1 with standstill updates
SD_REST_V = P_HEAD + 38  # [m/s]
SD_REST_G = P_HEAD + 39  # [(rad/s) sqrt(s)]
REST_G = P_HEAD + 40  # [rad/s]
REST_A = P_HEAD + 41  # [m/s^2]
REST_T = P_HEAD + 42  # [s]
SD_SPEED = P_HEAD + 43  # of wheel speed [m/s]
SD_BARO = P_HEAD + 44  # [m]
SD_SODO = P_HEAD + 45
# --- p: timing -------------------------------------------------------------------------
TICK = P_HEAD + 46  # [s]
REALIGN_GAP = P_HEAD + 47  # [s]
SD_HEADING = P_HEAD + 48  # at which alignment ends [rad]
TAU_BV = P_HEAD + 49  # time constant of the slow error of velocity [s]
LAG = P_HEAD + 50  # error of velocity per acceleration [s]
Q_SG = P_HEAD + 51  # noise of the gyroscope per rate [sqrt(s)]
Q_SA = P_HEAD + 52  # noise of the accelerometer per acceleration [sqrt(s)]
I_SG = P_HEAD + 53
I_SA = P_HEAD + 54
# --- p: magnetometer --------------------------------------------------------------------------
I_MAG = P_HEAD + 55  # iron, declination
SD_MAG = P_HEAD + 56  # of the field across magnetic north [T]
T_MAG = P_HEAD + 57  # how long its disturbances last [s]
P_SIZE = P_HEAD + 58

# --- w: the last fix, for diagnostics -----------------------------------------------------------
D_POS = W_HEAD  # innovation of position, NED [m]: 3
D_VEL = W_HEAD + 3  # of velocity [m/s]: 3
D_SPOS = W_HEAD + 6  # sigma of the former: 3
D_SVEL = W_HEAD + 9  # of the latter: 3
D_NPOS = W_HEAD + 12  # normalised innovation squared of position
D_NVEL = W_HEAD + 13  # of velocity
D_OPOS = W_HEAD + 14  # outcome of position, a code of kernels.status
D_OVEL = W_HEAD + 15  # outcome of velocity
N_DIAG = 16
D_NEW = W_HEAD + 16  # 1 when the above are of this sample
OUT_SIZE = 39  # a row of output: 36 cells of the head from STATUS on, then ARM_A
OUT_HEAD = 36
# --- w: scratch -------------------------------------------------------------------------------
STRIDE = 44
H = W_HEAD + 20  # measurement row
PH = H + STRIDE  # P h
DX = PH + STRIDE  # gathered correction
GAIN = DX + STRIDE
S3 = GAIN + STRIDE  # small matrices
F = S3 + STRIDE  # Phi - I of the nine inertial rows, 9 x m
G = F + 200  # (Phi - I) P, 9 rows; in the smoother F^T Lam, m x n
ROWS = G + 24 * STRIDE  # the three rows of a fix
RECORD = ROWS + 3 * STRIDE  # 1 while the tape runs, 2 if it runs for the backward pass only
NEXT = RECORD + 1  # next free place on the tape
MOVED = RECORD + 2  # correction since the last mark on the tape
TAPE = MOVED + STRIDE  # the tape begins here; also the length of w without a tape

# --- records of the tape: kind, payload, length of the whole ----------------------------------
R_PREDICT = 1  # factors of BP and BR, of BV, of BR into BP, of BV into BP; F
R_SCALAR = 2  # variance, innovation, h, P h
R_RESET = 3  # first index, number: states that were given a new prior
R_START = 4  # navigation began
R_MARK = 5  # sample, correction since the last mark, P
