"""Strapdown navigation in a vertical plane: two accelerometers and one gyroscope.

``C(theta)`` turns about y, which is z cross x: ``f_x = f_xb cos + f_zb sin``, ``f_z = -f_xb sin +
f_zb cos`` (tables 2.2.1 and 2.2.2 of [1]_). On a meridian, x is tangent to it; the frame then
turns with ``v_x / r``, and the velocity has the terms ``v_x v_z / r`` and ``v_x^2 / r``, whose
signs are those of the axis z.

References
----------
.. [1] Thesis E1, section 2.2.
"""

from math import cos, sin

from strapdown.kernels._jit import Mat, Vec, kernel

THETA = 0  # of b relative to the plane's axes [rad]
X = 1  # [m]
Z = 2  # [m]
VX = 3  # [m/s]
VZ = 4  # [m/s]
X_SIZE = 5

RADIUS = 0  # of the meridian's circle [m]; zero: a plane at rest in inertial space
RADIUS_Z = 1  # what a metre of z adds to it: 1 up, -1 down
TURN = 2  # sign of v_x / r in the rate of theta
CROSS = 3  # sign of v_x v_z / r in the rate of v_x
CENTRAL = 4  # sign of v_x^2 / r in the rate of v_z
GX = 5  # gravity along x and z [m/s^2]
GZ = 6
P_SIZE = 7


@kernel
def step(x: Vec, p: Vec, dt: float, rate: float, fx: float, fz: float) -> None:
    """Advance by one sample; the frame's terms are those of the middle of the interval."""
    turn, cross, central = 0.0, 0.0, 0.0
    c, s = cos(x[THETA]), sin(x[THETA])
    vx, vz = x[VX], x[VZ]
    for half in range(2):  # first to the middle, then from there
        if p[RADIUS] > 0.0:
            z = x[Z] + 0.5 * half * dt * 0.5 * (x[VZ] + vz)
            r = p[RADIUS] + p[RADIUS_Z] * z
            turn = p[TURN] * vx / r
            cross = p[CROSS] * vx * vz / r + p[GX]
            central = p[CENTRAL] * vx * vx / r + p[GZ]
        else:
            cross, central = p[GX], p[GZ]
        angle = 0.5 * dt * (rate + turn)
        c, s = cos(x[THETA] + angle), sin(x[THETA] + angle)
        if half == 0:
            vx = x[VX] + 0.5 * dt * (c * fx + s * fz + cross)
            vz = x[VZ] + 0.5 * dt * (c * fz - s * fx + central)
    vx = x[VX] + dt * (c * fx + s * fz + cross)
    vz = x[VZ] + dt * (c * fz - s * fx + central)
    x[THETA] += dt * (rate + turn)
    x[X] += 0.5 * dt * (x[VX] + vx)
    x[Z] += 0.5 * dt * (x[VZ] + vz)
    x[VX], x[VZ] = vx, vz


@kernel
def run(x: Vec, p: Vec, t: Vec, rate: Vec, fx: Vec, fz: Vec, out: Mat) -> None:
    """Loop of `step`; row 0 of `out` is the start, at ``t[0]``."""
    for k in range(t.shape[0]):
        if k > 0:
            step(x, p, t[k] - t[k - 1], rate[k], fx[k], fz[k])
        for i in range(X_SIZE):
            out[k, i] = x[i]
