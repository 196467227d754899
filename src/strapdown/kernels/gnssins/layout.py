"""Where things stand in the vectors of thesis E's system; `kernels.memory` has the heads.

``P`` holds two covariances that share nothing: of quaternion and gyro bias, 7x7, and from row
`PV` on that of the position filter, 9x9 or 12x12, in the order position, velocity, acceleration,
accelerometer bias, all in n.
"""

from strapdown.kernels.memory import HEAD, P_HEAD, W_HEAD

# --- x: control unit -------------------------------------------------------------------
MODE = HEAD  # ALIGNMENT, GPS_OFF or GPS_ON
AGE = HEAD + 1  # since alignment began [s]
SINCE_TRG = HEAD + 2  # since the attitude filter ran [s]
CRONO = HEAD + 3  # since the last reset [s]
QUIET = HEAD + 4  # how long motion has been uniform [s]
REFUSED = HEAD + 5  # how long measured attitudes have been rejected [s]
MEAN_G = HEAD + 6  # smoothed rate [rad/s]: 3
MEAN_F = HEAD + 9  # smoothed specific force [m/s^2]: 3
MAG_AGE = HEAD + 12  # since the last field sample [s]
REF_H = HEAD + 13  # reference field: horizontal part [T], zero before it is known
REF_D = HEAD + 14  # part down [T]
# --- x: inbox of the temperature, and the last fix ----------------------------------------
TEMP = HEAD + 15  # ever measured?, [degC]: 2
FIX_AGE = HEAD + 17  # since the last fix [s]
U = HEAD + 18  # speed of the last fix [m/s]
U_DOT = HEAD + 19  # its change since the fix before [m/s^2]
COURSE = HEAD + 20  # of the last fix, NaN while it stands [rad]
FIX_T = HEAD + 21  # time of the last fix [s]
FIX_LLA = HEAD + 22  # [rad, rad, m]: 3
FIX_V = HEAD + 25  # [m/s]: 3
# --- x: navigation -----------------------------------------------------------------------
NAVIGATING = HEAD + 28
R_N = HEAD + 29  # metres per radian of latitude
R_E = HEAD + 30  # metres per radian of longitude
GRAVITY = HEAD + 31  # [m/s^2]
ACC_ERROR = HEAD + 32  # acceleration error that the position filter has found, n [m/s^2]: 3
SINCE_PV = HEAD + 35  # since its covariance was propagated [s]
FIX_REFUSED = HEAD + 36  # how long fixes have been rejected [s]
Q_KEPT = HEAD + 37  # attitude while the head of x says the identity: kept?, q_nb: 5
LAST_F = HEAD + 42  # last specific force, compensated [m/s^2]: 3
SINCE_FIX = HEAD + 45  # since the last fix that counted [s]
SLOW_F = HEAD + 46  # the force smoothed for as long as motion must be uniform [m/s^2]: 3
X_SIZE = HEAD + 49

ALIGNMENT = 0.0
GPS_OFF = 1.0
GPS_ON = 2.0

# --- p: compensation --------------------------------------------------------------------
P_GYR = P_HEAD  # S^-1, offset, change with temperature: 9 + 3 + 3
P_ACC = P_HEAD + 15
# --- p: attitude filter, three values for ALIGNMENT, GPS_OFF, GPS_ON ---------------------
P_GYR_VAR = P_HEAD + 30  # Gyrcov [(rad/s)^2/Hz]
P_BIAS_VAR = P_HEAD + 33  # RWncov [(rad/s)^2/s]
P_QUAT_VAR = P_HEAD + 36  # QuatCOV
P_KA = P_HEAD + 39  # [1/(m/s^2)]
P_BASE = P_HEAD + 42  # baseR
P_ROOT = P_HEAD + 45  # 1: the exponent of (7.7.8) is a root
P_PERIOD = P_HEAD + 46  # [s]
P_AT_TRIGGER = P_HEAD + 47  # 1: covariance is propagated when the filter runs, as printed
P_LAW = P_HEAD + 48  # normalisation in F_q: 2, of (2.8.4), as printed; 1, of (7.2.2)
P_EULER = P_HEAD + 49  # 0: exact turn; 2 or 1: first order with that normalisation
P_VAR_Q = P_HEAD + 50  # P_0 of each component of the quaternion
P_VAR_B = P_HEAD + 51  # [(rad/s)^2]
P_GAP_RATE = P_HEAD + 52  # [rad/s]
# --- p: measured attitude ---------------------------------------------------------------
P_METHOD = P_HEAD + 53  # AUTO, MASTER_SLAVE or GAUSS_NEWTON
P_USE_Z = P_HEAD + 54  # 1: Gauss-Newton uses g_z
P_STOP = P_HEAD + 55
P_TABLES = P_HEAD + 56  # 1: roll by arcsine and table 7.1
P_C_VB = P_HEAD + 57  # mount, row after row: 9
# --- p: control unit -------------------------------------------------------------------
P_TKF = P_HEAD + 66  # [s]
P_NULL = P_HEAD + 67  # 1: the whole bias is withheld, not its corrections alone
P_ALIGN_TIME = P_HEAD + 68  # [s]
P_QUIET_TIME = P_HEAD + 69  # [s]
P_QUIET_GYR = P_HEAD + 70  # [rad/s]
P_QUIET_ACC = P_HEAD + 71  # [m/s^2]
P_RESET_EVERY = P_HEAD + 72  # [s]
P_LIMIT = P_HEAD + 73  # [rad]
P_RECOVER = P_HEAD + 74  # [s]
P_TIMEOUT = P_HEAD + 75  # [s]
P_MIN_SPEED = P_HEAD + 76  # [m/s]
P_GRAVITY = P_HEAD + 77  # [m/s^2]
# --- p: position filter -----------------------------------------------------------------
P_STATES = P_HEAD + 78  # 0: attitude only; 9 or 12
P_PRINTED = P_HEAD + 79  # 1: T and Q as printed
P_Q_V = P_HEAD + 80  # densities [m^2/s^3], [m^2/s^5], [m^2/s^5]; printed: of x and v, a, b
P_Q_A = P_HEAD + 81
P_Q_B = P_HEAD + 82
P_R_P = P_HEAD + 83  # [m^2]
P_R_V = P_HEAD + 84  # [m^2/s^2]
P_RECEIVER = P_HEAD + 85  # 1: the receiver's own sigmas, where it states them
P_0_A = P_HEAD + 86  # P_0 of acceleration and bias [m^2/s^4]
P_0_B = P_HEAD + 87
P_0_X = P_HEAD + 88  # P_0 of position and velocity; zero: that of the fix
P_IN_BODY = P_HEAD + 89  # 1: the bias goes to the accelerometer, turned to b
P_GATE = P_HEAD + 90  # squared [sigma^2]
P_FIX_PERIOD = P_HEAD + 91  # [s]
P_SIZE = P_HEAD + 92

AUTO = 0.0
MASTER_SLAVE = 1.0
GAUSS_NEWTON = 2.0

# --- scratch -----------------------------------------------------------------------------
PV = 7  # first row of the position filter in P
W_A = W_HEAD  # transition of q: 4x4
W_B = W_HEAD + 16  # influence of the bias on q: 4x3
W_M = W_HEAD + 28  # A P_qq + B P_bq: 4x4
W_N = W_HEAD + 44  # A P_qb + B P_bb: 4x3
W_F = W_HEAD + 56  # F_q: 4x4
W_D = W_HEAD + 72  # D_q: 4x3
W_T = W_HEAD + 84  # terms of a series, twice: 4x4
W_H = W_HEAD + 116  # row of H: 4
W_PH = W_HEAD + 120  # P h: 12
W_DX = W_HEAD + 132  # error state found so far: 12
W_S = W_HEAD + 144  # normal equations: 4x5
W_NEW = W_HEAD + 164  # whether there is a row for the diagnostics: attitude, fix
# Row of the attitude filter: residual 3, sigma 3, outcome, mode, reset?, Gauss-Newton?, R
W_ROW = W_HEAD + 166
N_ROW = 11
# Row of a fix: innovation 3, sigma 3, outcome, of position and then of velocity.
W_FIX = W_HEAD + 177
N_FIX = 14
W_SIZE = W_HEAD + 191
