"""Where everything stands in the vectors of a mechanisation.

Frames: x is the frame in which it integrates (i, e, n or the wander frame w), b the body. The
cells stand behind those that all estimators share, so that an estimator can hold a mechanisation.
"""

from strapdown.kernels.memory import HEAD, P_HEAD, W_HEAD

# --- x: all that it remembers -----------------------------------------------------------
T = HEAD  # time of the last sample [s]
T0 = HEAD + 1  # time at which inertial and Earth axes coincided [s]
POS = HEAD + 2  # inertial, ECEF: r [m]; NED: lat, lon, height; wander: height in the third: 3
V = HEAD + 5  # inertial: velocity in inertial space; others: over ground, in axes of x [m/s]: 3
ATT = HEAD + 8  # C_xb, row after row: 9; or q_xb: 4; or roll, pitch, yaw of b in x: 3
Q_EW = HEAD + 17  # wander frame to ECEF: 4
G = HEAD + 21  # gravity (inertial: gravitation) at the middle of the last step, in x [m/s^2]: 3
W_COR = HEAD + 24  # rate of the Coriolis term there, in x [rad/s]: 3
W_EX = HEAD + 27  # turn of x over the Earth there (NED, wander), in x [rad/s]: 3
R_N = HEAD + 30  # radius of the meridian plus height there [m]
R_E = HEAD + 31  # radius across the meridian plus height, times the cosine of latitude there [m]
HEIGHT = HEAD + 32  # at which the vertical channel is held [m]
STATUS = HEAD + 33
COUNT = HEAD + 34  # slots that are filled
SPAN = HEAD + 35  # time of the samples that wait [s]
BEFORE = HEAD + 36  # time of the sample before, where slot 0 is for it [s]; zero: there is none
TH = HEAD + 37  # angle increments of the slots [rad]: 4 x 3
DV = HEAD + 49  # velocity increments of the slots [m/s]: 4 x 3
W_IN = HEAD + 61  # rate of x in inertial space at the middle of the last step [rad/s]: 3
X_SIZE = HEAD + 64

# --- p: parameters ----------------------------------------------------------------------
FRAME = P_HEAD
ATTITUDE = P_HEAD + 1
SLOTS = P_HEAD + 2  # samples that a step looks at, 1 to 4
HELD = P_HEAD + 3  # 1: the vertical channel is held
A = P_HEAD + 4  # semi-major axis [m]
E2 = P_HEAD + 5  # first eccentricity squared
OMEGA = P_HEAD + 6  # rate of the Earth [rad/s]
LEAST_COSINE = P_HEAD + 7  # of latitude, below which NED is refused
G_INVERSE = P_HEAD + 8  # 1: falls with the square of the radius; 0: by the series below
G_E = P_HEAD + 9  # gravity at zero latitude and height [m/s^2]
G_K = P_HEAD + 10  # Somigliana's constant
G_E2 = P_HEAD + 11  # eccentricity squared in Somigliana's formula
G_LINEAR = P_HEAD + 12  # fall with height [1/m]
G_LINEAR_S2 = P_HEAD + 13  # what the sine squared of latitude takes from it [1/m]
G_SQUARE = P_HEAD + 14  # second order [1/m^2]
FIRST = P_HEAD + 15  # slot of the first new sample; 1: slot 0 keeps the sample before
SUM = P_HEAD + 16  # weights of the increments in the step's sum: 4
CONING = P_HEAD + 20  # weights of the products of samples i < j: 4 x 4
AT_START = P_HEAD + 36  # weights that give a rate at the start, middle and end of the step: 4 each
AT_MIDDLE = P_HEAD + 40
AT_END = P_HEAD + 44
P_SIZE = P_HEAD + 48

# --- w: scratch of one step ---------------------------------------------------------------
C0 = W_HEAD  # C_xb at the start: 9
C1 = W_HEAD + 9  # at the end: 9
PHI = W_HEAD + 18  # rotation vector of b over the step [rad]: 3
U = W_HEAD + 21  # twice the change of velocity by specific force in its first half, in x [m/s]: 3
TURN = W_HEAD + 24  # turn of x in inertial space over the step [rad]: 3
REST = W_HEAD + 27  # change of velocity by gravity and Coriolis [m/s]: 3
OUT = W_HEAD + 30  # latitude, longitude, height, v_n, q_nb: 10
W_SIZE = W_HEAD + 40

# --- values of FRAME, ATTITUDE and STATUS -----------------------------------------------------
INERTIAL = 0
ECEF = 1
NED = 2
WANDER = 3
QUATERNION = 0
DCM = 1
EULER = 2
OK = 0
POLE = 1
GIMBAL_LOCK = 2
