"""The sensor of thesis B as its tables 3 to 5 describe it, at rest and turned by hand.

The tables print deg/s, m/s and uG; 0.0012 on the gyroscope's y axis gives the 10 deg in 150 s
of figure 12 only as rad/s, 1.0016 at rest is in g, and a field of 433 in mG. They are read so.

The frame of the thesis has its x axis to magnetic north and its z axis up, so that a level
sensor at rest reads +1 g on z. Where nothing else is known, this module assumes that the means
of accelerometer and magnetometer are the true gravity and field of the place, which turn with
the sensor, and that the means of the gyroscope are its biases.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.errors import MissingStream
from strapdown.kernels.quat import from_acc_mag
from strapdown.recording import Imu, Mag, Recording
from strapdown.rotation import (
    dcm_from_quat,
    quat_conj,
    quat_from_rotvec,
    quat_mul,
    rotate,
    rpy_from_quat,
)
from strapdown.sensors import Device, Linear, Noise, Sampling, preset
from strapdown.truth import Truth
from strapdown.units import MILLIGAUSS

RATE: Final = 100.0  # [Hz]
DURATION: Final = 150.0  # [s]
SAMPLES: Final = 15_000
BETA_LOW: Final = 0.07557  # figure 13
BETA_HIGH: Final = 10.0 * BETA_LOW  # figure 14, "a coefficient 10 times larger"

Triple = tuple[float, float, float]
# tables 3, 4, 5: mean and variance of each axis, in the units that they are read in
GYR_MEAN: Final[Triple] = (-5.5997e-5, 0.0012, -1.8447e-4)  # [rad/s]
GYR_VARIANCE: Final[Triple] = (1.9901e-6, 3.9908e-6, 1.2505e-6)
ACC_MEAN: Final[Triple] = (-0.0011, 5.9414e-4, 1.0016)  # [g]
ACC_VARIANCE: Final[Triple] = (5.0422e-6, 5.5640e-6, 1.4530e-5)
MAG_MEAN: Final[Triple] = (-297.0854, 203.2470, 240.8136)  # [mG]
MAG_VARIANCE: Final[Triple] = (61.9883, 67.4888, 64.7151)

# Takes components in the thesis's frame (north, west, up) to n.
Q_N_THESIS: Final = np.array([0.0, 1.0, 0.0, 0.0])


def times(duration: float = DURATION) -> FloatArray:
    """Return the sampling times of a recording [s]."""
    return np.arange(round(duration * RATE)) / RATE


def rest_pose() -> FloatArray:
    """Return q_nb at which gravity and field are the means of tables 4 and 5, shape (4,)."""
    fx, fy, fz = ACC_MEAN
    mx, my, mz = MAG_MEAN
    return np.array(from_acc_mag(fx, fy, fz, mx, my, mz))


def chip() -> Device:
    """Return the MPU-9250 with the biases and the noise of tables 3 to 5."""
    part = preset("mpu9250")
    triads: dict[str, Any] = {"gyr": part.gyr, "acc": part.acc, "mag": part.mag}
    gyr = {"linear": Linear(bias=GYR_MEAN), "sampling": Sampling(rate=RATE, average=True)}
    return replace(
        part,
        gyr=replace(triads["gyr"], noise=_white(GYR_VARIANCE, 1.0), **gyr),
        acc=replace(triads["acc"], noise=_white(ACC_VARIANCE, G0)),
        mag=replace(triads["mag"], noise=_white(MAG_VARIANCE, MILLIGAUSS)),
    )


def still(duration: float = DURATION) -> Truth:
    """Return the sensor lying still."""
    t = times(duration)
    return turning(t, np.zeros((len(t), 3)), np.zeros((len(t), 3)))


def turning(t: FloatArray, rotvec: FloatArray, omega: FloatArray) -> Truth:
    """Return a sensor turned from its rest pose without leaving its place.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times [s].
    rotvec : ndarray, shape (n, 3)
        Rotation vector from the rest pose, in the sensor's axes [rad].
    omega : ndarray, shape (n, 3)
        Its angular rate [rad/s].

    Returns
    -------
    Truth
        The rate of the Earth is left out: it is part of the gyroscope's means.
    """
    q_nb = quat_mul(rest_pose(), quat_from_rotvec(rotvec))
    f_n = rotate(rest_pose(), G0 * np.array(ACC_MEAN))
    m_n = rotate(rest_pose(), MILLIGAUSS * np.array(MAG_MEAN))
    zero = np.zeros((len(t), 3))
    return Truth(
        t=t,
        q_nb=q_nb,
        omega_ib_b=omega,
        f_b=np.einsum("kji,j->ki", dcm_from_quat(q_nb), f_n),
        lla=zero,
        v_n=zero,
        m_n=np.tile(m_n, (len(t), 1)),
    )


def record(truth: Truth, seed: int) -> Recording:
    """Return what the sensor says of a motion."""
    return chip().record(truth, seed=seed)


def streams(rec: Recording) -> tuple[Imu, Mag]:
    """Return both streams of a nine-axis recording."""
    if rec.imu is None or rec.mag is None:
        raise MissingStream("the recording must have the streams 'imu' and 'mag'.")
    return rec.imu, rec.mag


def angles(q_nb: FloatArray) -> FloatArray:
    """Return roll, pitch, yaw of the sensor in the thesis's frame [rad], shape (..., 3)."""
    return rpy_from_quat(quat_mul(quat_conj(Q_N_THESIS), q_nb))


def frame_angles(q_nb: FloatArray) -> FloatArray:
    """Return what (21) to (23) give without a conjugate: the frame's angles in the sensor."""
    return rpy_from_quat(quat_mul(quat_conj(q_nb), Q_N_THESIS))


def angles_from_rest(q_nb: FloatArray) -> FloatArray:
    """Return roll, pitch, yaw of the sensor relative to its rest pose [rad], shape (..., 3)."""
    return rpy_from_quat(quat_mul(quat_conj(rest_pose()), q_nb))


def _white(variance: Sequence[float], unit: float) -> Noise:
    """Return white noise of this variance of each sample."""
    return Noise(white=tuple(unit * (v / RATE) ** 0.5 for v in variance))
