"""Where everything stands in the vectors of a mechanisation.

Frames: x is the frame in which it integrates (i, e, n or the wander frame w), b the body.
"""

# --- x: all that it remembers -----------------------------------------------------------
T = 0  # time of the last sample [s]
T0 = 1  # time at which inertial and Earth axes coincided [s]
POS = 2  # inertial, ECEF: r_i, r_e [m]; NED: lat, lon, height; wander: height in the third: 3
V = 5  # inertial: velocity in inertial space; others: over ground, in axes of x [m/s]: 3
ATT = 8  # C_xb, row after row: 9; or q_xb: 4; or roll, pitch, yaw of b in x: 3
Q_EW = 17  # wander frame to ECEF: 4
G = 21  # gravity (inertial: gravitation) at the middle of the last step, in x [m/s^2]: 3
W_COR = 24  # rate of the Coriolis term there, in x [rad/s]: 3
W_EX = 27  # turn of x over the Earth there (NED, wander), in x [rad/s]: 3
R_N = 30  # radius of the meridian plus height there [m]
R_E = 31  # radius across the meridian plus height, times the cosine of latitude there [m]
HEIGHT = 32  # at which the vertical channel is held [m]
STATUS = 33
COUNT = 34  # slots that are filled
SPAN = 35  # time of the samples that wait [s]
BEFORE = 36  # time of the sample before, where slot 0 is for it [s]; zero: there is none
TH = 37  # angle increments of the slots [rad]: 4 x 3
DV = 49  # velocity increments of the slots [m/s]: 4 x 3
W_IN = 61  # rate of x in inertial space at the middle of the last step [rad/s]: 3
X_SIZE = 64

# --- p: parameters ----------------------------------------------------------------------
FRAME = 0
ATTITUDE = 1
SLOTS = 2  # samples that a step looks at, 1 to 4
HELD = 3  # 1: the vertical channel is held
A = 4  # semi-major axis [m]
E2 = 5  # first eccentricity squared
OMEGA = 6  # rate of the Earth [rad/s]
LEAST_COSINE = 7  # of latitude, below which NED is refused
G_INVERSE = 8  # 1: falls with the square of the radius; 0: by the series below
G_E = 9  # gravity at zero latitude and height [m/s^2]
G_K = 10  # Somigliana's constant
G_E2 = 11  # eccentricity squared in Somigliana's formula
G_LINEAR = 12  # fall with height [1/m]
G_LINEAR_S2 = 13  # what the sine squared of latitude takes from it [1/m]
G_SQUARE = 14  # second order [1/m^2]
FIRST = 15  # slot of the first new sample; 1: slot 0 keeps the sample before
SUM = 16  # weights of the increments in the step's sum: 4
CONING = 20  # weights of the products of samples i < j: 4 x 4
AT_START = 36  # weights that give a rate at the start, middle and end of the step: 4 each
AT_MIDDLE = 40
AT_END = 44
P_SIZE = 48

# --- w: scratch of one step ---------------------------------------------------------------
C0 = 0  # C_xb at the start: 9
C1 = 9  # at the end: 9
PHI = 18  # rotation vector of b over the step [rad]: 3
U = 21  # twice the change of velocity by specific force in its first half, in x [m/s]: 3
TURN = 24  # turn of x in inertial space over the step [rad]: 3
REST = 27  # change of velocity by gravity and Coriolis [m/s]: 3
W_SIZE = 30

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
