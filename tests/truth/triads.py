"""Truths for calibrations: distorted triads and hand-held logs, without the package's code."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

G = 9.80665
MG = 1e-3 * G
DPS = np.pi / 180.0
UT = 1e-6

# Trecroci 2010, table 6.1 (biases in g) and table 6.2 (biases in deg/s): b, s, then theta_yz,
# theta_zx, theta_zy.
TABLE_6_1 = np.array(
    [0.012133, 0.023295, -0.03593, 0.00775, 0.008838, 0.008041, -0.00086, 0.01142, -0.00049]
) * ([G] * 3 + [1.0] * 6)
TABLE_6_2 = np.array(
    [0.3766, 0.1963, 0.6270, 0.004818, 0.004042, 0.009385, -0.00126, -0.00296, -0.00171]
) * ([DPS] * 3 + [1.0] * 6)


def distort(a, x):
    """Raw output of a triad with the nine parameters x, written out component by component."""
    b_x, b_y, b_z, s_x, s_y, s_z, th_yz, th_zx, th_zy = x
    a_x, a_y, a_z = np.asarray(a).T
    return np.column_stack(
        (
            (1 + s_x) * a_x + b_x,
            -th_yz * a_x + (1 + s_y) * a_y + b_y,
            th_zy * a_x - th_zx * a_y + (1 + s_z) * a_z + b_z,
        )
    )


def bound(true, x, std):
    """Cramer-Rao bound of the nine parameters from poses whose direction nobody knows, (9, 9).

    A pose tells its three readings; two of them go to its direction, so that of the readings'
    derivatives only what no turning of the pose can make counts.
    """
    true, x = np.asarray(true), np.asarray(x, dtype=float)
    step = 1e-6 * np.eye(9)
    slopes = [(distort(true, x + d) - distort(true, x - d)) / 2e-6 for d in step]
    matrix = distort(np.eye(3), x).T - distort(np.zeros((3, 3)), x).T
    information = np.zeros((9, 9))
    for k, a in enumerate(true):
        J = np.column_stack([s[k] for s in slopes])
        turns = matrix @ np.linalg.svd(a[np.newaxis])[2][1:].T
        J = J - turns @ np.linalg.lstsq(turns, J, rcond=None)[0]
        information += J.T @ J / std**2
    return np.linalg.inv(information)


def directions(n, seed=0):
    """Random unit vectors, uniform over the sphere."""
    v = np.random.default_rng(seed).standard_normal((n, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def even_directions(n):
    """Unit vectors on a spiral from pole to pole, nearly evenly spread."""
    z = 1.0 - (2.0 * np.arange(n) + 1.0) / n
    longitude = 2.399963229728653 * np.arange(n)
    r = np.sqrt(1.0 - z * z)
    return np.column_stack((r * np.cos(longitude), r * np.sin(longitude), z))


def hand_held_log(
    poses=30,
    duration=600.0,
    rate_hz=100.0,
    seed=0,
    acc_x=TABLE_6_1,
    tremor=0.15 * DPS,
    field_n=(20.0, 1.0, 43.0),
    mag_matrix=None,
    mag_bias=(0.0, 0.0, 0.0),
):
    """A box held still in `poses` random orientations, turned by hand in between.

    Returns t, gyr, acc, mag (in tesla), and the times of the holds, shape (poses, 2). The hand
    trembles by `tremor` RMS of angle at about 9 Hz, and moves the box by some millimetres;
    the noise is that of an MPU-6050 sampled at `rate_hz`.
    """
    rng = np.random.default_rng(seed)
    each = duration / poses
    starts = each * np.arange(poses)
    hold = each * rng.uniform(0.45, 0.65, poses)
    targets = Rotation.random(poses, random_state=seed)
    t = np.arange(round(duration * rate_hz)) / rate_hz
    # Progress from pose k to k + 1: flat while holding, smooth while turning.
    k = np.minimum((t / each).astype(int), poses - 1)
    x = np.clip((t - starts[k] - hold[k]) / (each - hold[k]), 0.0, 1.0)
    progress = k + x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
    turn = Slerp(np.arange(poses + 1), Rotation.concatenate([targets, targets[-1]]))
    knots = np.arange(0.0, duration + 1.0, 1.0 / 18.0)  # shakes at up to 9 Hz
    shake = CubicSpline(knots, tremor * rng.standard_normal((len(knots), 3)))
    sway = CubicSpline(knots[::9], 0.5 * DPS * rng.standard_normal((len(knots[::9]), 3)))
    moving = (x > 0.0) & (x < 1.0)

    def attitude(time, p):
        return turn(np.clip(p, 0, poses)) * Rotation.from_rotvec(shake(time) + sway(time))

    dt = 1e-4
    later = progress + np.gradient(progress, t) * dt
    q_nb = attitude(t, progress)
    gyr = (q_nb.inv() * attitude(t + dt, later)).as_rotvec() / dt
    push = 1.5 * np.sin(2 * np.pi * np.outer(t, [0.9, 1.3, 1.1])) * moving[:, np.newaxis]
    jitter = 2e-4 * (9.0 * 2 * np.pi) ** 2 * shake(t) / max(tremor, 1e-12) * 0.05
    f_b = q_nb.inv().apply(np.array([0.0, 0.0, -G]) + push + jitter)
    b_b = q_nb.inv().apply(field_n) * UT
    gyr = gyr + np.array([1.0, -3.9, 0.2]) * DPS + 0.08 * DPS * rng.standard_normal(gyr.shape)
    acc = distort(f_b, acc_x) + 3e-3 * G * rng.standard_normal(f_b.shape)
    mag = b_b @ np.asarray(np.eye(3) if mag_matrix is None else mag_matrix).T + mag_bias
    mag = mag + 0.13 * UT * rng.standard_normal(mag.shape)
    return t, gyr, acc, mag, np.column_stack((starts, starts + hold))
