"""The attitude module on its gimbals: motion, sensors with the printed errors, encoders.

The thesis takes its frame n for inertial: the Earth does not turn here. The centre of rotation
rests, so an accelerometer there sees gravity alone (3.1, 6.4).
"""

from dataclasses import replace
from typing import Final, NamedTuple, TypeVar

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.recording import Recording, Star
from strapdown.rotation import dcm_from_quat, quat_from_rpy
from strapdown.sensors import Device, Linear, preset
from strapdown.sensors.triads import Triad
from strapdown.simulation import kinematics
from strapdown.simulation.kinematics import Motion
from strapdown.simulation.motions import HandMoved
from strapdown.truth import Truth
from strapdown.units import DEG, DPS, GAUSS

RATE_HZ: Final = 100.0
FIELD_G: Final = (0.225, 0.0, 0.418)  # N_h at Padova, (6.22)
FIELD_N: Final = np.array(FIELD_G) * GAUSS
STAR_INTERVAL: Final = 3.0  # s, 0.33 Hz
PADOVA: Final = (45.4161 * DEG, 11.8828 * DEG, 30.0)
STOP_DEG: Final = 40.0  # of roll and pitch, either way
LIMITS_DEG: Final = 35.0  # what a hand keeps away from the stops

# (6.17), (6.20), (6.23): corrected = C (measured, 1), with the offset in each sensor's own unit.
C_GYR: Final = (
    (0.9822, -0.0003, -0.0072, 0.0188),
    (-0.0021, 0.9836, 0.0143, -0.0680),
    (0.0093, 0.0039, 1.0002, 0.0028),
)
C_ACC: Final = (
    (0.9941, 0.0025, -0.0123, -0.0163),
    (0.0015, 0.9896, 0.0000, 0.0404),
    (0.0073, -0.0035, 0.9673, -0.0875),
)
C_MAG: Final = (
    (0.9875, -0.0168, -0.1961, -0.0280),
    (-0.0290, 1.0277, -0.0307, 0.0161),
    (-0.0980, -0.0001, 1.0425, -0.0170),
)
MATRICES: Final = {"gyr": (C_GYR, 1.0), "acc": (C_ACC, G0), "mag": (C_MAG, GAUSS)}


AnyTriad = TypeVar("AnyTriad", bound=Triad)


class Log(NamedTuple):
    """A log of the attitude module.

    Attributes
    ----------
    rec : Recording
        Raw sensors at one rate, and the truth as reference.
    truth : Truth
        The motion at the same times.
    rpy : ndarray, shape (n, 3)
        Roll, pitch, yaw as the encoders count them [rad].
    """

    rec: Recording
    truth: Truth
    rpy: FloatArray


def truth(motion: Motion, duration: float, rate: float = RATE_HZ) -> Truth:
    """Return a motion on gimbals in a frame n that does not turn.

    Parameters
    ----------
    motion : Motion
        About a fixed point.
    duration : float
        Length [s].
    rate : float
        Samples per second [Hz].

    Returns
    -------
    Truth
    """
    t = np.arange(round(duration * rate)) / rate
    found = kinematics.truth(motion, t, PADOVA, m_n=FIELD_N)
    return inertial(found)


def inertial(found: Truth) -> Truth:
    """Return the same attitudes over an Earth that neither turns nor moves the box."""
    from strapdown.earth import earth_rate_n

    C_bn = dcm_from_quat(found.q_nb).transpose(0, 2, 1)
    earth_b = np.einsum("kij,kj->ki", C_bn, earth_rate_n(found.lla[:, 0]))
    return replace(
        found,
        omega_ib_b=found.omega_ib_b - earth_b,
        f_b=np.einsum("kij,j->ki", C_bn, [0.0, 0.0, -G0]),
    )


def device(rate: float = RATE_HZ) -> Device:
    """Return the sensors of the module with the errors that the thesis calibrated.

    Noise, counts and delay are the presets'; all are sampled at one rate, as in 9.2.

    Parameters
    ----------
    rate : float
        Samples per second [Hz].

    Returns
    -------
    Device
    """
    chip, field = preset("mpu6050"), preset("hmc5883l")
    return Device(
        name="platform",
        gyr=_printed("gyr", chip.gyr, rate),
        acc=_printed("acc", chip.acc, rate),
        mag=_printed("mag", field.mag, rate),
    )


def _printed(sensor: str, part: AnyTriad | None, rate: float) -> AnyTriad:
    """Return a sensor with the errors that the printed matrix undoes, at one temperature."""
    assert part is not None
    return replace(
        part,
        linear=Linear.from_calibration(matrix(sensor)),
        sampling=replace(part.sampling, rate=rate),
        temp_bias=(0.0, 0.0, 0.0),
        temp_scale=(0.0, 0.0, 0.0),
    )


def matrix(sensor: str) -> FloatArray:
    """Return the printed calibration matrix, its offset in SI, shape (3, 4)."""
    printed, size = MATRICES[sensor]
    return np.array(printed) * [1.0, 1.0, 1.0, size]


def record(motion: Motion, duration: float, seed: int, sensors: Device | None = None) -> Log:
    """Return what module and encoders say of a motion.

    Parameters
    ----------
    motion : Motion
        About a fixed point.
    duration : float
        Length [s].
    seed : int
        Of the noise.
    sensors : Device, optional
        `device` by default.

    Returns
    -------
    Log
    """
    found = truth(motion, duration)
    rec = (device() if sensors is None else sensors).record(found, seed=seed)
    return Log(rec, found, encoders(found))


def encoders(found: Truth) -> FloatArray:
    """Return roll, pitch, yaw at the truth's times, rounded to counts of 0.09 deg [rad]."""
    part = preset("hedm5500").encoder
    assert part is not None
    rng = np.random.default_rng(0)  # an encoder draws nothing
    every = replace(part, incremental=False, sampling=replace(part.sampling, rate=0.0))
    return np.column_stack(
        [
            replace(every, axis=axis).apply(found, rng).angle
            for axis in ("roll", "pitch", "yaw")
        ]
    )  # fmt: skip


def star_tracker(t: FloatArray, rpy: FloatArray, interval: float = STAR_INTERVAL) -> Star:
    """Return the star tracker that the thesis makes of the encoders, 8.2.5.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times of the encoders, evenly spaced [s].
    rpy : ndarray, shape (n, 3)
        Their angles [rad].
    interval : float
        From one attitude to the next [s].

    Returns
    -------
    Star
    """
    every = max(1, round(interval / float(t[1] - t[0])))
    return Star(t=t[::every], q_nb=quat_from_rpy(rpy[::every]))


def hand_motion(
    rng: np.random.Generator,
    rms_dps: tuple[float, float, float],
    *,
    rest: float = 3.0,
    moving: float = 170.0,
    duration: float = 180.0,
) -> HandMoved:
    """Return a motion by hand whose body rates have given RMS values over a log.

    Sums of three sines of 5 to 11 s an axis; amplitudes are scaled until the RMS fits.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws periods and phases.
    rms_dps : tuple of float
        RMS of the body rates x, y, z over `duration` [deg/s].
    rest, moving, duration : float
        Rest at first, time of motion, length of the log [s].

    Returns
    -------
    HandMoved
    """
    terms = [
        [(1.0, float(rng.uniform(5.0, 11.0)), float(rng.uniform(0.0, 2.0 * np.pi)))
         for _ in range(3)]
        for _ in range(3)
    ]  # fmt: skip
    size, wanted = np.full(3, 5.0 * DEG), np.array(rms_dps) * DPS
    for _ in range(6):  # body rates follow the amplitudes nearly in proportion
        motion = _scaled(terms, size, rest, moving)
        rates = truth(motion, duration, 20.0).omega_ib_b
        size = size * wanted / np.sqrt(np.mean(rates**2, axis=0))
    return _scaled(terms, size, rest, moving)


def _scaled(
    terms: list[list[tuple[float, float, float]]], size: FloatArray, rest: float, moving: float
) -> HandMoved:
    """Return the motion with the amplitudes of each angle multiplied."""
    roll, pitch, yaw = (
        tuple((a * float(factor), period, phase) for a, period, phase in rows)
        for rows, factor in zip(terms, size, strict=True)
    )
    return HandMoved(roll=roll, pitch=pitch, yaw=yaw, rest=rest, moving=moving, ramp=2.0)
