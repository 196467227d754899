"""A short 9-axis log of a box in a moving hand, with its truth in closed form.

The box rests, is turned and waved about, and rests again. Angles and position are sums of
sines under a smooth envelope, so that rates and accelerations follow by differentiation, not
by differences; the sensors then add what a cheap chip adds: bias and white noise.
"""

import math
from dataclasses import dataclass
from datetime import datetime

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.earth import (
    earth_rate_n,
    gravity_n,
    lla_from_ned,
    magnetic_field,
    transport_rate_n,
)
from strapdown.recording import AttitudeReference, Imu, Mag, Recording, Reference
from strapdown.rotation import dcm_from_quat, quat_from_rpy
from strapdown.truth import Truth
from strapdown.units import DEG, DPS, MG, UT

PLACE = (48.1374 * DEG, 11.5755 * DEG, 520.0)  # Munich
EPOCH_UTC = "2026-03-20T12:00:00Z"
_MOST = 10**8  # samples
REST = 4.0  # seconds of rest at either end
RAMP = 2.0  # seconds that the motion takes to set in

# Amplitude, period [s] and phase [rad] of each sine.
ROLL = ((50.0 * DEG, 5.3, 0.4), (15.0 * DEG, 1.7, 2.0))
PITCH = ((40.0 * DEG, 6.7, 1.1), (12.0 * DEG, 2.3, 0.3))
YAW = ((150.0 * DEG, 19.0, 0.0), (25.0 * DEG, 3.1, 1.6))
NORTH = ((0.20, 4.1, 0.2),)
EAST = ((0.25, 3.3, 1.9),)
DOWN = ((0.10, 2.6, 0.7),)
START_YAW = 35.0 * DEG


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorErrors:
    """What the simulated chip adds to the truth.

    Parameters
    ----------
    gyr_bias, acc_bias, mag_bias : tuple of float
        Constant offsets in b [rad/s], [m/s^2], [T].
    gyr_density : float
        White noise of each gyro axis [rad/s/sqrt(Hz)].
    acc_density : float
        White noise of each accelerometer axis [m/s^2/sqrt(Hz)].
    mag_sigma : float
        Standard deviation of each magnetometer sample and axis [T].
    """

    gyr_bias: tuple[float, float, float] = (0.4 * DPS, -0.3 * DPS, 0.2 * DPS)
    acc_bias: tuple[float, float, float] = (4.0 * MG, -3.0 * MG, 5.0 * MG)
    mag_bias: tuple[float, float, float] = (0.3 * UT, -0.2 * UT, 0.4 * UT)
    gyr_density: float = 0.01 * DPS
    acc_density: float = 0.3 * MG
    mag_sigma: float = 0.4 * UT


def truth(duration: float = 60.0, rate: float = 100.0) -> Truth:
    """Return the exact motion of the demo.

    Parameters
    ----------
    duration : float
        Length [s], longer than the rest at both ends.
    rate : float
        Samples per second [Hz].

    Returns
    -------
    Truth
        Consistent on the turning, curved Earth: attitude, rate, specific force, position,
        velocity and field belong to one motion.
    """
    duration, rate = _checks.positive("duration", duration), _checks.positive("rate", rate)
    shortest = 2.0 * (REST + RAMP)
    if duration < shortest:
        raise ValueError(f"`duration` must be at least {shortest:g} s, got {duration:g}.")
    samples = _checks.whole("duration * rate", round(duration * rate), 1, _MOST)
    return _truth(np.arange(samples + 1) / rate, duration)


def recording(
    duration: float = 60.0,
    rate: float = 100.0,
    *,
    seed: int = 1,
    errors: SensorErrors | None = None,
) -> Recording:
    """Return what the sensors of the demo said, with the true attitude as reference.

    Parameters
    ----------
    duration : float
        Length [s].
    rate : float
        Samples per second of all three sensors [Hz].
    seed : int
        Of the noise; the same seed gives the same recording.
    errors : SensorErrors, optional
        What the chip adds to the truth; those of a cheap one by default.

    Returns
    -------
    Recording
        The gyroscope gives the mean rate of the interval that ends at its sample, the
        others what is there at the sample.
    """
    chip = SensorErrors() if errors is None else errors
    _checks.instance("errors", chip, SensorErrors)
    seed = _checks.whole("seed", seed, 0)
    exact = truth(duration, rate)
    t, n = exact.t, len(exact.t)
    # Simpson's rule over each interval: off by 1e-9 rad/s at 100 Hz
    half = _truth(t - 0.5 / rate, duration).omega_ib_b
    start = _truth(t - 1.0 / rate, duration).omega_ib_b
    mean_rate = (start + 4.0 * half + exact.omega_ib_b) / 6.0

    gyr_rng, acc_rng, mag_rng = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)
    )
    per_sample = math.sqrt(rate)  # white noise averaged over one interval
    gyr_noise = chip.gyr_density * per_sample * gyr_rng.standard_normal((n, 3))
    acc_noise = chip.acc_density * per_sample * acc_rng.standard_normal((n, 3))
    mag_noise = chip.mag_sigma * mag_rng.standard_normal((n, 3))
    m_b = _to_body(exact.q_nb, exact.m_n)
    lat, lon, height = PLACE
    return Recording(
        imu=Imu(
            t=t,
            gyr=mean_rate + chip.gyr_bias + gyr_noise,
            acc=exact.f_b + chip.acc_bias + acc_noise,
        ),
        mag=Mag(t=t, mag=m_b + chip.mag_bias + mag_noise),
        reference=Reference(attitude=AttitudeReference(t=t, q_nb=exact.q_nb), heading="true"),
        meta={
            "name": "demo",
            "source": "simulated",
            "epoch_utc": EPOCH_UTC,
            "lat_rad": lat,
            "lon_rad": lon,
            "height_m": height,
            "seed": seed,
        },
    )


def _truth(t: FloatArray, duration: float) -> Truth:
    """Return the motion at any times; outside the duration the box rests."""
    gate = _envelope(t, duration)
    roll, pitch, yaw = (_sines(t, sines, gate) for sines in (ROLL, PITCH, YAW))
    rpy = np.stack((roll[0], pitch[0], START_YAW + yaw[0]), axis=1)
    q_nb = quat_from_rpy(rpy)

    # rates of roll, pitch, yaw to omega_nb_b, z-y-x
    sr, cr = np.sin(roll[0]), np.cos(roll[0])
    sp, cp = np.sin(pitch[0]), np.cos(pitch[0])
    omega_nb_b = np.stack(
        (
            roll[1] - sp * yaw[1],
            cr * pitch[1] + sr * cp * yaw[1],
            -sr * pitch[1] + cr * cp * yaw[1],
        ),
        axis=1,
    )

    path = [_sines(t, sines, gate) for sines in (NORTH, EAST, DOWN)]
    r_n, v_n, a_n = (np.stack([axis[order] for axis in path], axis=1) for order in range(3))
    # r_n lies in the tangent plane of PLACE; half a metre bends away from n by 4e-8 rad
    lla = lla_from_ned(r_n, PLACE)
    omega_ie_n = earth_rate_n(lla[:, 0])
    omega_en_n = transport_rate_n(lla, v_n)
    f_n = a_n + np.cross(2.0 * omega_ie_n + omega_en_n, v_n) - gravity_n(lla)
    field = magnetic_field(PLACE, datetime.fromisoformat(EPOCH_UTC))
    return Truth(
        t=t,
        q_nb=q_nb,
        omega_ib_b=omega_nb_b + _to_body(q_nb, omega_ie_n + omega_en_n),
        f_b=_to_body(q_nb, f_n),
        lla=lla,
        v_n=v_n,
        m_n=np.tile(field.field_n, (len(t), 1)),
        meta={"name": "demo", "epoch_utc": EPOCH_UTC},
    )


def _to_body(q_nb: FloatArray, v_n: FloatArray) -> FloatArray:
    """Return vectors given in n in the axes of b."""
    return np.asarray(np.einsum("kji,kj->ki", dcm_from_quat(q_nb), v_n))


def _envelope(t: FloatArray, duration: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a gate that opens after the first rest and closes before the last, twice derived.

    ``10 s^3 - 15 s^4 + 6 s^5`` from 0 to 1: rate and acceleration vanish at both ends.
    """
    opening = np.clip((t - REST) / RAMP, 0.0, 1.0)
    closing = np.clip((duration - REST - t) / RAMP, 0.0, 1.0)
    s = np.minimum(opening, closing)
    sign = np.where(opening <= closing, 1.0, -1.0)  # time runs backwards while it closes
    gate = s**3 * (10.0 + s * (6.0 * s - 15.0))
    rate = sign * 30.0 * s**2 * (1.0 - s) ** 2 / RAMP
    acceleration = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / RAMP**2
    return gate, rate, acceleration


def _sines(
    t: FloatArray,
    sines: tuple[tuple[float, float, float], ...],
    gate: tuple[FloatArray, FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return value, first and second derivative of gated sines."""
    x, dx, ddx = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
    for amplitude, period, phase in sines:
        w = 2.0 * np.pi / period
        angle = w * t + phase
        x += amplitude * np.sin(angle)
        dx += amplitude * w * np.cos(angle)
        ddx -= amplitude * w**2 * np.sin(angle)
    e, de, dde = gate
    return e * x, de * x + e * dx, dde * x + 2.0 * de * dx + e * ddx
