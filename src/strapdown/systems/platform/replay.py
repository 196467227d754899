"""From a raw log to errors, as chapter 9 does it: calibrate, filter, compare with the encoders.

The log is simulated; sensors have the printed errors and noise, and are corrected by what
`calibrations` finds of them. The reference is the encoders' spline, as in the thesis, so that its
own error counts; errors against the true motion stand beside it.
"""

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.attitude import IndirectEkf
from strapdown.calibration import CalibrationRecord
from strapdown.calibration.encoder import HEDM5500_RESOLUTION, smooth_angles
from strapdown.recording import Imu, Mag, Recording
from strapdown.rotation import quat_conj, quat_from_rpy, quat_mul, rpy_from_quat, wrap_pi
from strapdown.solution import Solution
from strapdown.systems.platform import bench, calibrations
from strapdown.units import DEG, DPS, GAUSS

CONVERGED_S: Final = 50.0  # before, errors do not count (9.2.1)
REST_S: Final = 3.0  # before the hand sets in
STILL_SAMPLES: Final = 100  # of the static bias: 1 s, 9.2.1
MAG_FACTOR: Final = 20.0
# RMS of what calibration leaves of the magnetometer, table 6.4.
RESIDUAL_G: Final = (2.189e-2, 1.303e-2, 0.927e-2)


class Trial(NamedTuple):
    """A printed test.

    Attributes
    ----------
    name : str
        What the thesis calls it.
    duration : float
        Length [s].
    rms : tuple of float
        RMS of the body rates [deg/s].
    largest : tuple of float
        Largest of them [deg/s].
    moving : float
        How long the hand moves [s].
    """

    name: str
    duration: float
    rms: tuple[float, float, float]
    largest: tuple[float, float, float]
    moving: float


class Replay(NamedTuple):
    """A log with calibrated sensors and both references.

    Attributes
    ----------
    rec : Recording
        Gyroscope with its bias left in, accelerometer, magnetometer, star tracker.
    t : ndarray, shape (n,)
        Times [s].
    rpy, rates : ndarray, shape (n, 3)
        Angles and body rates of the encoders' spline [rad, rad/s].
    true_rpy, true_rates : ndarray, shape (n, 3)
        Those of the motion.
    bias : ndarray, shape (3,)
        Static bias, (7.42) [rad/s].
    residual : ndarray, shape (n, 3)
        Systematic error to add to the magnetometer [T].
    """

    rec: Recording
    t: FloatArray
    rpy: FloatArray
    rates: FloatArray
    true_rpy: FloatArray
    true_rates: FloatArray
    bias: FloatArray
    residual: FloatArray


class Errors(NamedTuple):
    """Errors of a solution at each time.

    Attributes
    ----------
    q : ndarray, shape (n, 3)
        Vector part of the error's quaternion.
    rpy : ndarray, shape (n, 3)
        Differences of the Euler angles [deg].
    rates : ndarray, shape (n, 3)
        Of the corrected rate [deg/s].
    """

    q: FloatArray
    rpy: FloatArray
    rates: FloatArray

    def rms(self, rows: slice | BoolArray) -> "Errors":
        """Return the RMS of each column over some rows."""
        return Errors(*(np.sqrt(np.mean(part[rows] ** 2, axis=0)) for part in self))


def replay(test: Trial, seed: int, number: int = 0) -> Replay:
    """Return the log of a test: moved by hand at random with its printed RMS rates.

    Parameters
    ----------
    test : Trial
        Which.
    seed : int
        Of motion and noise.
    number : int
        Tells tests of one name apart.

    Returns
    -------
    Replay
    """
    rng = np.random.default_rng([seed, number, *test.name.encode()])
    motion = bench.hand_motion(
        rng, test.rms, rest=REST_S, moving=test.moving, duration=test.duration
    )
    log = bench.record(motion, test.duration, int(rng.integers(2**31)))
    assert log.rec.imu is not None
    assert log.rec.mag is not None
    imu, found = log.rec.imu, calibration(seed)
    gyr = imu.gyr @ found["gyr"].matrix.T  # the bias is the filter's, (7.8)
    splines = [smooth_angles(imu.t, angle, HEDM5500_RESOLUTION) for angle in log.rpy.T]
    rpy = np.column_stack([spline(imu.t) for spline in splines])
    slopes = np.column_stack([spline(imu.t, 1) for spline in splines])
    return Replay(
        rec=Recording(
            imu=Imu(t=imu.t, gyr=gyr, acc=found["acc"].correct(imu.acc)),
            mag=Mag(t=log.rec.mag.t, mag=found["mag"].correct(log.rec.mag.mag)),
            star=bench.star_tracker(imu.t, log.rpy),
        ),
        t=imu.t,
        rpy=rpy,
        rates=rates_of(rpy, slopes),
        true_rpy=rpy_from_quat(log.truth.q_nb),
        true_rates=log.truth.omega_ib_b,
        bias=gyr[:STILL_SAMPLES].mean(axis=0),
        residual=residual(log.truth.q_nb, rng),
    )


@lru_cache(maxsize=2)
def calibration(seed: int) -> dict[str, CalibrationRecord]:
    """Return the calibration that `calibrations` finds with a seed."""
    return {
        "gyr": calibrations.gyroscope(seed).record,
        "acc": calibrations.posed("acc", seed).record,
        "mag": calibrations.posed("mag", seed).record,
    }


def rates_of(rpy: FloatArray, slopes: FloatArray) -> FloatArray:
    """Return body rates of Euler angles and their rates, (6.13)."""
    (roll, pitch, _), (p, q, r) = rpy.T, slopes.T
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    return np.column_stack((p - sp * r, cr * q + sr * cp * r, -sr * q + cr * cp * r))


def residual(q_nb: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a systematic error of the magnetometer with the RMS of table 6.4.

    Its shape is not printed; here it is a second harmonic of heading and tilt with random phases.

    Parameters
    ----------
    q_nb : ndarray, shape (n, 4)
        Attitudes.
    rng : numpy.random.Generator
        Draws the phases.

    Returns
    -------
    ndarray, shape (n, 3)
        [T].
    """
    roll, pitch, yaw = rpy_from_quat(q_nb).T
    phases = rng.uniform(0.0, 2.0 * np.pi, 3)
    shape = np.sin((2.0 * yaw + roll + 2.0 * pitch)[:, np.newaxis] + phases)
    size: FloatArray = np.array(RESIDUAL_G) * GAUSS / np.sqrt(np.mean(shape**2, axis=0))
    return np.asarray(shape * size)


def space(log: Replay) -> tuple[IndirectEkf, Recording]:
    """Return the filter of the space scenario, v2, and what it sees of a log."""
    bias = (float(log.bias[0]), float(log.bias[1]), float(log.bias[2]))
    flt = IndirectEkf.space(propagation="truncated", gyr_bias=bias)
    return flt, Recording(imu=log.rec.imu, star=log.rec.star)


def terrestrial(
    log: Replay, *, systematic: bool, factor: float = MAG_FACTOR
) -> tuple[IndirectEkf, Recording]:
    """Return the filter of the terrestrial scenario, v2, and what it sees of a log.

    Parameters
    ----------
    log : Replay
        The log.
    systematic : bool
        Whether the magnetometer has its systematic error.
    factor : float
        k, the multiplier of the magnetometer's deviation.

    Returns
    -------
    IndirectEkf, Recording
    """
    mag = log.rec.mag
    assert mag is not None
    if systematic:
        mag = Mag(t=mag.t, mag=mag.mag + log.residual)
    flt = IndirectEkf.terrestrial(
        propagation="truncated",
        mag_factor=factor,
        mag_reference=(float(bench.FIELD_N[0]), float(bench.FIELD_N[2])),
    )
    return flt, Recording(imu=log.rec.imu, mag=mag)


def errors(
    flt: IndirectEkf, rec: Recording, sol: Solution, rpy: FloatArray, rates: FloatArray
) -> Errors:
    """Return the errors of a solution against angles and rates.

    Parameters
    ----------
    flt : IndirectEkf
        Whose solution it is.
    rec : Recording
        What it saw.
    sol : Solution
        What it found.
    rpy, rates : ndarray, shape (n, 3)
        What is taken for true [rad, rad/s].

    Returns
    -------
    Errors
    """
    off = quat_mul(quat_conj(sol.q_nb), quat_from_rpy(rpy))
    return Errors(
        q=off[:, 1:] * np.sign(off[:, :1]),
        rpy=wrap_pi(sol.rpy - rpy) / DEG,
        rates=(flt.rate(rec, sol) - rates) / DPS,
    )
