"""A simulated motion, integrated from its rates and forces, ends where the truth ends.

The integrator below works in the inertial frame with Runge and Kutta's classical method and
shares no code with the package: its own ellipsoid, its own gravity, its own quaternions.
"""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.simulation import kinematics, load
from strapdown.simulation.motions import HandMoved
from strapdown.units import DEG, MM

A, F, OMEGA = 6378137.0, 1 / 298.257223563, 7.292115e-5  # WGS 84
E2 = F * (2 - F)
GE, K, M = 9.7803253359, 0.00193185265241, 0.00344978650684  # Somigliana's formula


def ecef(lat, lon, h):
    n = A / math.sqrt(1 - E2 * math.sin(lat) ** 2)
    p = (n + h) * math.cos(lat)
    return [p * math.cos(lon), p * math.sin(lon), (n * (1 - E2) + h) * math.sin(lat)]


def geodetic(x, y, z):
    p, b = math.hypot(x, y), A * (1 - F)
    beta = math.atan2(z * A, p * b)
    for _ in range(2):
        lat = math.atan2(
            z + E2 / (1 - E2) * b * math.sin(beta) ** 3, p - E2 * A * math.cos(beta) ** 3
        )
        beta = math.atan2((1 - F) * math.sin(lat), math.cos(lat))
    h = p * math.cos(lat) + z * math.sin(lat) - A * math.sqrt(1 - E2 * math.sin(lat) ** 2)
    return lat, math.atan2(y, x), h


def axes(lat, lon):
    """North, east and down, seen in ECEF."""
    sp, cp, sl, cl = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return np.array([[-sp * cl, -sp * sl, cp], [-sl, cl, 0.0], [-cp * cl, -cp * sl, -sp]])


def gravitation(x, y, z):
    """Attraction alone: gravity without the centrifugal acceleration."""
    lat, lon, h = geodetic(x, y, z)
    s2 = math.sin(lat) ** 2
    g = GE * (1 + K * s2) / math.sqrt(1 - E2 * s2)
    g *= 1 - 2 * (1 + F + M - 2 * F * s2) * h / A + 3 * (h / A) ** 2
    up = g * math.cos(lat)
    return (
        -up * math.cos(lon) - OMEGA**2 * x,
        -up * math.sin(lon) - OMEGA**2 * y,
        -g * math.sin(lat),
    )


def rates(y, gyr, acc):
    """Derivative of position, velocity (inertial) and quaternion (inertial from body)."""
    _, _, _, vx, vy, vz, w, a, b, c = y
    gx, gy, gz = gravitation(y[0], y[1], y[2])
    fx, fy, fz = acc
    # v + 2 w (u x v) + 2 u x (u x v)
    tx, ty, tz = 2 * (b * fz - c * fy), 2 * (c * fx - a * fz), 2 * (a * fy - b * fx)
    ax = fx + w * tx + b * tz - c * ty + gx
    ay = fy + w * ty + c * tx - a * tz + gy
    az = fz + w * tz + a * ty - b * tx + gz
    p, q, r = gyr
    return (
        vx, vy, vz, ax, ay, az,
        -0.5 * (a * p + b * q + c * r), 0.5 * (w * p + b * r - c * q),
        0.5 * (w * q + c * p - a * r), 0.5 * (w * r + a * q - b * p),
    )  # fmt: skip


def quaternion(C):
    return Rotation.from_matrix(C).as_quat(scalar_first=True).tolist()


def matrix(w, x, y, z):
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def end_errors(truth):
    """Integrate from the first sample to the last; position [m], velocity, angle [rad]."""

    def inertial(k):
        """The truth in the inertial axes that are ECEF's at the first sample."""
        lat, lon, h = truth.lla[k]
        turn = OMEGA * (truth.t[k] - truth.t[0])
        C_ie = np.array(
            [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
        )
        r_e = np.array(ecef(lat, lon, h))
        v_e = axes(lat, lon).T @ truth.v_n[k] + np.cross([0, 0, OMEGA], r_e)
        return C_ie @ r_e, C_ie @ v_e, C_ie @ axes(lat, lon).T @ matrix(*truth.q_nb[k])

    r, v, C = inertial(0)
    y = [*r, *v, *quaternion(C)]
    gyr, acc, h = truth.omega_ib_b.tolist(), truth.f_b.tolist(), 2 * (truth.t[1] - truth.t[0])
    for k in range(0, len(gyr) - 2, 2):
        k1 = rates(y, gyr[k], acc[k])
        half = [u + 0.5 * h * d for u, d in zip(y, k1, strict=True)]
        k2 = rates(half, gyr[k + 1], acc[k + 1])
        half = [u + 0.5 * h * d for u, d in zip(y, k2, strict=True)]
        k3 = rates(half, gyr[k + 1], acc[k + 1])
        full = [u + h * d for u, d in zip(y, k3, strict=True)]
        k4 = rates(full, gyr[k + 2], acc[k + 2])
        y = [
            u + h / 6 * (a + 2 * b + 2 * c + d)
            for u, a, b, c, d in zip(y, k1, k2, k3, k4, strict=True)
        ]
    r, v, C = inertial(-1)
    off = C.T @ matrix(*(np.array(y[6:]) / np.linalg.norm(y[6:])))
    angle = 0.5 * np.linalg.norm(
        [off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]]
    )
    return np.linalg.norm(y[:3] - r), np.linalg.norm(y[3:6] - v), angle


def flight(start, stop, rate):
    scenario = load("flight")
    place = (scenario.place.lat, scenario.place.lon, scenario.place.height)
    t = start + np.arange(round((stop - start) * rate) + 1) / rate
    return kinematics.truth(scenario.motion, t, place, m_n=(2e-5, 0.0, 4e-5))


def test_flight_of_100_s_at_1_khz_returns_to_its_truth_within_a_millimetre():
    truth = flight(10.0, 110.0, 1000.0)
    assert truth.v_n[-1] @ truth.v_n[-1] > 25.0  # in the air, in motion
    position, velocity, angle = end_errors(truth)
    # what is left is round-off of positions of 6.4e6 m (1e-9 m a step, 50000 steps) and of g
    assert position < 1 * MM
    assert position < 0.02 * MM
    assert velocity < 1e-6
    assert angle < 1e-10


def test_error_of_the_integration_falls_with_the_fourth_power_of_the_step():
    # 80 s of climbing, turning and cruising; at 16 Hz the position is right to 1.5 um
    errors = np.array([end_errors(flight(30.0, 110.0, rate)) for rate in (4.0, 8.0, 16.0)])
    orders = np.log2(errors[:-1] / errors[1:])
    # position, velocity and angle; the motion is smooth enough for the method's full order
    assert orders == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize(
    ("lat", "lon"), [(-60 * DEG, 3.0), (0.0, -1.0), (45 * DEG, 0.2), (89 * DEG, 2.0)]
)
def test_turning_and_waving_returns_to_its_truth_everywhere(lat, lon):
    motion = HandMoved(
        roll=((0.9, 2.3, 0.4), (0.3, 0.9, 1.0)), pitch=((0.7, 3.1, 1.1),), yaw=((1.5, 4.7, 0.3),),
        north=((0.4, 2.1, 0.2),), east=((0.3, 1.7, 1.9),), down=((0.2, 2.6, 0.7),),
        rest=0.0, moving=100.0,
    )  # fmt: skip
    errors = []
    for rate in (100.0, 200.0):
        t = 5.0 + np.arange(round(10 * rate) + 1) / rate
        errors.append(end_errors(kinematics.truth(motion, t, (lat, lon, 800.0), m_n=(2e-5, 0, 0))))
    order = np.log2(np.array(errors[0]) / np.array(errors[1]))
    assert order == pytest.approx(4.0, abs=0.25)
    assert errors[1][0] < 0.1 * MM
