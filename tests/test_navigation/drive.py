"""A simulated car drive in closed form: the truth of the navigation tests.

Speed and curvature are sums of smooth ramps and sines; the box, the antenna and the point
without side slip stand on one rigid body. Velocity, acceleration and rates are derivatives taken
on paper; only position and heading are integrals, by Simpson's rule on a fine grid. The Earth
is the ellipsoid with radii from their textbook formulas, gravity Somigliana's formula.
"""

from dataclasses import dataclass

import numpy as np

from strapdown.recording import Gnss, Imu, Recording

OMEGA = 7.292115e-5
A, E2 = 6378137.0, 6.69437999014e-3


def quat_z(angle):
    zero = np.zeros_like(angle)
    return np.stack((np.cos(angle / 2), zero, zero, np.sin(angle / 2)), axis=-1)


def rotation(axis, angle):
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@dataclass
class Drive:
    """Truth at the IMU samples: time, C_nb, v_n, lla of the IMU; and the recording."""

    t: np.ndarray
    C_nb: np.ndarray
    v_n: np.ndarray
    lla: np.ndarray
    antenna: np.ndarray  # lla of the antenna
    gyr_bias: np.ndarray
    acc_bias: np.ndarray
    C_vb: np.ndarray
    heading: np.ndarray
    speed: np.ndarray
    rec: Recording


def smoothstep(t, t0, t1):
    u = np.clip((t - t0) / (t1 - t0), 0.0, 1.0)
    return u * u * u * (10 - 15 * u + 6 * u * u), 30 * u * u * (1 - u) ** 2 / (t1 - t0)


def profile(t, ramps):
    """Speed and its derivative: each ramp is (from, to, change)."""
    v, a = np.zeros_like(t), np.zeros_like(t)
    for t0, t1, dv in ramps:
        s, ds = smoothstep(t, t0, t1)
        v, a = v + dv * s, a + dv * ds
    return v, a


CITY = (
    (20, 28, 9), (60, 66, -9), (75, 83, 14), (120, 126, -6), (150, 158, 8),
    (190, 200, -16), (215, 222, 11), (260, 266, 5), (290, 300, -16),
)  # fmt: skip


def simulate(
    seed=0,
    duration=300.0,
    rate=100.0,
    fix_rate=2.0,
    ramps=CITY,
    C_vb=None,
    lla0=(0.83, 0.15, 400.0),
    heading0=0.7,
    noise=1.0,
    gyr_noise=1e-4,
    acc_noise=5e-3,
    gyr_bias=(0.002, -0.006, 0.004),
    acc_bias=(0.05, -0.08, 0.1),
    gyr_scale=0.002,
    acc_scale=0.001,
    slip=0.05,
    bounce=0.1,
    arm=1.5,
    antenna_v=(0.3, 0.2, -0.4),
    slow=0.5,
    slow_time=20.0,
    white=0.025,
    stated=(0.5, 0.25),
    velocity_error=0.05,
    delay=0.0,
    vibration=1.0,
):
    """Drive a car; `noise` scales every random error, `arm` is the box ahead of the axle [m]."""
    rng = np.random.default_rng(seed)
    C_vb = np.eye(3) if C_vb is None else C_vb
    fine = 10
    n = int(duration * rate)
    h = 1.0 / (rate * fine)
    tf = np.arange(n * fine + 1) * h
    v, a = profile(tf, ramps)
    # yaw rate = v * curvature(t): turns of 30 to 80 m radius
    w1, w2, w3 = 2 * np.pi / 37.0, 2 * np.pi / 61.0, 2 * np.pi / 13.0
    k = 0.012 * np.sin(w1 * tf) + 0.012 * np.sin(w2 * tf + 1) + 0.008 * np.sin(w3 * tf + 2)
    dk = (
        0.012 * w1 * np.cos(w1 * tf)
        + 0.012 * w2 * np.cos(w2 * tf + 1)
        + 0.008 * w3 * np.cos(w3 * tf + 2)
    )
    r, dr = v * k, a * k + v * dk
    psi = heading0 + _integral(r, h)
    # side slip and bounce at the axle: a few sines of about one second, while the car moves
    uy, duy = _shake(rng, tf, slip * noise, v, a)
    uz, duz = _shake(rng, tf, bounce * noise, v, a)
    vx, vy = v, uy + arm * r
    ax, ay = a - vy * r, duy + arm * dr + v * r
    c, s = np.cos(psi), np.sin(psi)
    v_n = np.stack((c * vx - s * vy, s * vx + c * vy, uz), axis=-1)
    a_n = np.stack((c * ax - s * ay, s * ax + c * ay, duz), axis=-1)
    lat, lon, height = (np.full(len(tf), x) for x in lla0)
    # latitude changes the radii by 1e-9 per metre: two passes of integration are exact enough
    for _ in range(2):
        M, N = radii(lat)
        lat = lla0[0] + _integral(v_n[:, 0] / (M + height), h)
        height = lla0[2] - _integral(v_n[:, 2], h)
        lon = lla0[1] + _integral(v_n[:, 1] / ((N + height) * np.cos(lat)), h)
    M, N = radii(lat)
    zero = np.zeros_like(lat)
    w_ie = np.stack((OMEGA * np.cos(lat), zero, -OMEGA * np.sin(lat)), axis=-1)
    w_en = np.stack(
        (v_n[:, 1] / (N + height), -v_n[:, 0] / (M + height),
         -v_n[:, 1] * np.tan(lat) / (N + height)), axis=-1,
    )  # fmt: skip
    g = gravity(lat, height)
    f_n = a_n + np.cross(2 * w_ie + w_en, v_n)
    f_n[:, 2] -= g
    C_nv = np.zeros((len(tf), 3, 3))
    C_nv[:, 0, 0], C_nv[:, 0, 1] = c, -s
    C_nv[:, 1, 0], C_nv[:, 1, 1] = s, c
    C_nv[:, 2, 2] = 1.0
    f_v = np.einsum("kji,kj->ki", C_nv, f_n)
    w_v = np.einsum("kji,kj->ki", C_nv, w_ie + w_en)
    w_v[:, 2] += r
    at = slice(fine, None, fine)
    # errors of scale and axes; the force's act on what differs from standing still, whose own is
    # a bias
    odd = np.random.default_rng((seed, 1)).standard_normal((2, 3, 3))
    turn_b, force_b = _mean(w_v, n, fine) @ C_vb, _mean(f_v, n, fine) @ C_vb
    turn_b = turn_b + noise * gyr_scale * turn_b @ odd[0]
    force_b = force_b + noise * acc_scale * (force_b + [0.0, 0.0, 9.8] @ C_vb) @ odd[1]
    gyr = turn_b + noise * (
        np.asarray(gyr_bias) + gyr_noise * np.sqrt(rate) * rng.standard_normal((n, 3))
    )
    acc = force_b + noise * (
        np.asarray(acc_bias) + acc_noise * np.sqrt(rate) * rng.standard_normal((n, 3))
    )
    t = tf[at]
    # what a rolling wheel does to the sensors: 13 and 17 Hz, which integrate to nothing
    rolling = noise * vibration * np.tanh(v[at] / 0.2)[:, None]
    gyr += 0.005 * rolling * np.sin(2 * np.pi * 13.1 * t[:, None] + [0.0, 1.0, 2.0])
    acc += 0.2 * rolling * np.sin(2 * np.pi * 17.3 * t[:, None] + [0.0, 1.0, 2.0])
    lla = np.stack((lat, lon, height), axis=-1)
    offset = np.einsum("kij,j->ki", C_nv, np.asarray(antenna_v))
    antenna = lla + np.stack(
        (offset[:, 0] / (M + height), offset[:, 1] / ((N + height) * np.cos(lat)), -offset[:, 2]),
        axis=-1,
    )
    v_a = v_n + np.cross(np.stack((zero, zero, r), axis=-1), offset)
    # fixes
    step = round(rate * fine / fix_rate)
    rows = np.arange(step, len(tf), step)
    m = len(rows)
    e = np.exp(-1 / (fix_rate * slow_time))
    drift = np.zeros((m, 3))
    drift[0] = slow * rng.standard_normal(3)
    for i in range(1, m):
        drift[i] = e * drift[i - 1] + slow * np.sqrt(1 - e * e) * rng.standard_normal(3)
    err = noise * (drift + white * rng.standard_normal((m, 3)))
    fix = antenna[rows].copy()
    fix[:, 0] += err[:, 0] / (M + height)[rows]
    fix[:, 1] += err[:, 1] / ((N + height) * np.cos(lat))[rows]
    fix[:, 2] -= err[:, 2]
    fixes = Gnss(
        t=tf[rows] + delay,
        lla=np.stack((fix[:, 0], (fix[:, 1] + np.pi) % (2 * np.pi) - np.pi, fix[:, 2]), axis=-1),
        v_n=v_a[rows] + noise * velocity_error * rng.standard_normal((m, 3)),
        std_position_n=np.full((m, 3), stated[0]),
        std_velocity_n=np.full((m, 3), stated[1]),
    )
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), gnss=fixes)
    return Drive(
        t=t, C_nb=(C_nv @ C_vb)[at], v_n=v_n[at], lla=lla[at], antenna=antenna[at],
        gyr_bias=noise * np.asarray(gyr_bias), acc_bias=noise * np.asarray(acc_bias),
        C_vb=C_vb, heading=psi[at], speed=v[at], rec=rec,
    )  # fmt: skip


def radii(lat):
    d = 1 - E2 * np.sin(lat) ** 2
    return A * (1 - E2) / d**1.5, A / np.sqrt(d)


def gravity(lat, height):
    """Somigliana's formula and the change with height of WGS-84, to second order."""
    s2 = np.sin(lat) ** 2
    g0 = 9.7803253359 * (1 + 0.00193185265241 * s2) / np.sqrt(1 - E2 * s2)
    f, m = 1 / 298.257223563, 0.00344978650684
    return g0 * (1 - 2 / A * (1 + f + m - 2 * f * s2) * height + 3 * height**2 / A**2)


def _integral(y, h):
    """Cumulative Simpson by trapezoids with end correction: error of fourth order in h."""
    slope = np.gradient(y, h)
    steps = 0.5 * h * (y[1:] + y[:-1]) - h * h / 12 * (slope[1:] - slope[:-1])
    return np.concatenate(([0.0], np.cumsum(steps)))


def _mean(y, n, fine):
    """Mean over each sample's interval, by the trapezoidal rule."""
    inside = y[1:].reshape(n, fine, 3).mean(axis=1)
    return inside + (y[:-1:fine] - y[fine::fine]) / (2 * fine)


def _shake(rng, t, rms, v, a):
    """A random velocity of about one second's memory, that fades out as the car stops."""
    w = rng.uniform(0.4, 3.0, 6)
    phase = rng.uniform(0, 2 * np.pi, 6)
    x = np.sin(np.outer(t, w) + phase).sum(axis=1) * rms / np.sqrt(3)
    dx = (np.cos(np.outer(t, w) + phase) * w).sum(axis=1) * rms / np.sqrt(3)
    fade, slope = np.tanh(v / 2), a / 2 / np.cosh(np.minimum(v / 2, 50)) ** 2
    return x * fade, dx * fade + x * slope


def ned_error(lla, truth):
    """Estimate less truth [m], NED."""
    M, N = radii(truth[..., 0])
    d = lla - truth
    d[..., 1] = (d[..., 1] + np.pi) % (2 * np.pi) - np.pi
    return np.stack(
        (d[..., 0] * (M + truth[..., 2]),
         d[..., 1] * (N + truth[..., 2]) * np.cos(truth[..., 0]), -d[..., 2]), axis=-1,
    )  # fmt: skip


def attitude_error(q_nb, C_nb):
    """Rotation vector in n that takes the estimate to the truth [rad], small angles."""
    w, x, y, z = np.moveaxis(q_nb, -1, 0)
    C = np.stack(
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
         2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
         2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), axis=-1,
    ).reshape(*w.shape, 3, 3)  # fmt: skip
    D = C_nb @ np.swapaxes(C, -1, -2)
    return 0.5 * np.stack(
        (D[..., 2, 1] - D[..., 1, 2], D[..., 0, 2] - D[..., 2, 0], D[..., 1, 0] - D[..., 0, 1]),
        axis=-1,
    )
