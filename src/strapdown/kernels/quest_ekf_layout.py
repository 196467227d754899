"""Memory of the filter of limb rates and quaternion, after what all estimators share."""

from strapdown.kernels.memory import HEAD, P_HEAD, W_HEAD

# --- own states of x -------------------------------------------------------------------
RATE = HEAD  # omega_b [rad/s]: 3
Q_P = HEAD + 3  # quaternion that P belongs to: 4
T_ACC = HEAD + 7  # time of the last accelerometer update [s]
T_MAG = HEAD + 8  # time of the last field update [s]
STARTED = HEAD + 9  # 1 once tilt is known
X_SIZE = HEAD + 10

# --- own parameters ------------------------------------------------------------------------
P_GYR_NOISE = P_HEAD  # [rad/s/sqrt(Hz)]
P_ACC_NOISE = P_HEAD + 1  # [m/s^2/sqrt(Hz)]
P_MAG_NOISE = P_HEAD + 2  # [rad/sqrt(Hz)]
P_RATE_STD = P_HEAD + 3  # [rad/s]
P_RATE_TIME = P_HEAD + 4  # tau [s]
P_GRAVITY = P_HEAD + 5  # [m/s^2]
P_GATE = P_HEAD + 6  # [sigma]
P_GAP_RATE = P_HEAD + 7  # [rad/s]
P_STD_TILT = P_HEAD + 8  # [rad]
P_STD_HEADING = P_HEAD + 9  # [rad]
P_SIN_DIP = P_HEAD + 10  # of the reference field; NaN: as measured
P_VECTORS = P_HEAD + 11  # 1: accelerometer and field as vectors; 0: QUEST in front
P_EULER = P_HEAD + 12  # 1: Phi of first order and the rate of the sample before, as printed
P_SIZE = P_HEAD + 13

# --- scratch -----------------------------------------------------------------------------
W_A = W_HEAD  # quaternion by quaternion: 4x4
W_B = W_HEAD + 16  # quaternion by rate: 4x3
W_M = W_HEAD + 28  # lower rows of Phi P: 4x7
W_DX = W_HEAD + 56  # error state found so far in this update: 7
W_PH = W_HEAD + 63  # P h: 7
W_SIZE = W_HEAD + 70

MIN_SINE = 1e-3  # of the angle between field and vertical: nearer there is no heading

# Beyond this turn per sample [rad] the printed first order says nothing: the exact one is taken.
MAX_EULER = 0.5
