r"""Calibration in prescribed positions on a levelled plate: six faces, or 18 with the edges.

Six positions, each axis once up and once down, give bias and scale factor of each axis::

    b = (l_up + l_down) / 2          S = (l_up - l_down - 2 K) / (2 K)

with K the magnitude of the known input, gravity for an accelerometer; and twelve parameters by
least squares. Both need the plate level and the axes along it: whatever the case is tilted by
goes into the misalignment. The 18 positions add the twelve edges, where two axes share the
input; the norm alone is used, as in `multi_position`, so that levelling does not matter.

References
----------
.. [1] A. Trecroci, PhD thesis, Universita della Calabria, 2010, section 6.2.1. The numerator of
       S is printed as ``l_up + l_down - 2 K`` in (6.2.2).
.. [2] E.-H. Shin, N. El-Sheimy, "A new calibration method for strapdown inertial navigation
       systems", Z. Vermess. 127, 2002.
"""

import itertools
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_floats, as_samples, positive, same_shape
from strapdown._types import FloatArray, IntArray
from strapdown.calibration.multi_position import accelerometer_from_poses
from strapdown.calibration.record import CalibrationRecord
from strapdown.calibration.reference import against_reference
from strapdown.calibration.sphere import unit_vectors
from strapdown.constants import G0
from strapdown.errors import InputError
from strapdown.units import DEG

NEAR = 20.0 * DEG  # a pose further from every prescribed position belongs to none


def up_down(up: ArrayLike, down: ArrayLike, magnitude: float) -> tuple[FloatArray, FloatArray]:
    """Return bias and scale factor error of axes from their readings up and down.

    Parameters
    ----------
    up, down : array_like, same shape
        Readings with the axis along and against the known input.
    magnitude : float
        Magnitude K of the input: gravity for accelerometers, the table's rate for gyroscopes.

    Returns
    -------
    bias : ndarray
        In the unit of the readings.
    scale_error : ndarray
        S, without unit.
    """
    up, down = as_floats("up", up), as_floats("down", down)
    same_shape(up=up, down=down)
    K = positive("magnitude", magnitude)
    return 0.5 * (up + down), (up - down - 2.0 * K) / (2.0 * K)


def six_positions() -> FloatArray:
    """Return the directions of the input in the six positions, +x, -x, +y ..., shape (6, 3)."""
    return np.asarray(np.kron(np.eye(3), np.array([[1.0], [-1.0]])), dtype=np.float64)


def eighteen_positions() -> FloatArray:
    """Return the directions of the input in the 18 positions: six faces, twelve edges."""
    edges = [d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if np.count_nonzero(d) == 2]
    return np.vstack((six_positions(), np.array(edges) / np.sqrt(2.0)))


def six_position(
    means: ArrayLike,
    gravity: float = G0,
    *,
    tolerances: Mapping[str, float] | None = None,
    **about: Any,
) -> CalibrationRecord:
    """Calibrate an accelerometer from six positions on a levelled plate.

    Parameters
    ----------
    means : array_like, shape (n, 3)
        Mean specific force of each pose [m/s^2], in any order, positions repeated or not. The
        axis that points up reads plus gravity.
    gravity : float
        Local gravity [m/s^2].
    tolerances : mapping of str to float, optional
        As for `against_reference`.
    **about
        ``sensor_id``, ``date``, ``temp_degc`` of the record.

    Returns
    -------
    CalibrationRecord
        Twelve parameters; ``quality`` holds the figures of `up_down` too, such as
        ``up_down_scale_x``.

    Raises
    ------
    InputError
        If a position is missing, or a pose is more than 20 deg from all of them.
    """
    means = as_samples("means", means)
    K = positive("gravity", gravity)
    positions = six_positions()
    match = _match(means, positions, "six-position calibration")
    record = against_reference("acc", means, K * positions[match], tolerances=tolerances, **about)
    # Averages over repeats of one position.
    readings = np.array([means[match == k].mean(axis=0) for k in range(6)])
    bias, scale = up_down(np.diag(readings[0::2]), np.diag(readings[1::2]), K)
    quality = dict(record.quality)
    for axis, b, s in zip("xyz", bias, scale, strict=True):
        quality[f"up_down_bias_{axis}"] = float(b)
        quality[f"up_down_scale_{axis}"] = float(s)
    return replace(record, method="six-position", reference=K, quality=quality)


def eighteen_position(
    means: ArrayLike,
    gravity: float = G0,
    *,
    std: float | None = None,
    tolerances: Mapping[str, float] | None = None,
    **about: Any,
) -> CalibrationRecord:
    """Calibrate an accelerometer from the 18 positions, by the norm alone.

    Parameters
    ----------
    means : array_like, shape (n, 3)
        Mean specific force of each pose [m/s^2], in any order, every position at least once.
    gravity : float
        Local gravity [m/s^2].
    std, tolerances, **about
        As for `accelerometer_from_poses`.

    Returns
    -------
    CalibrationRecord

    Raises
    ------
    InputError
        If a position is missing, or a pose is more than 20 deg from all of them.
    """
    means = as_samples("means", means)
    _match(means, eighteen_positions(), "18-position calibration")
    record = accelerometer_from_poses(means, gravity, std=std, tolerances=tolerances, **about)
    return replace(record, method="18-position")


def _match(means: FloatArray, positions: FloatArray, what: str) -> IntArray:
    """Return the position of each pose; all must occur."""
    cosine = unit_vectors("means", means) @ positions.T
    match = np.asarray(np.argmax(cosine, axis=1))
    off = np.arccos(np.clip(cosine.max(axis=1), -1.0, 1.0))
    if (off > NEAR).any():
        row = int(np.argmax(off))
        raise InputError(
            f"{what} must have every pose within {NEAR / DEG:.0f} deg of a position, got "
            f"{off[row] / DEG:.0f} deg in row {row}; for poses in any orientation use "
            "`accelerometer_from_poses`."
        )
    missing = [_name(p) for k, p in enumerate(positions) if k not in match]
    if missing:
        raise InputError(
            f"{what} must have every position, missing are those with {', '.join(missing)} up."
        )
    return match


def _name(position: FloatArray) -> str:
    """Return ``+x`` or ``+x-y``: the axes that share the input."""
    return "".join(
        f"{'+' if c > 0.0 else '-'}{axis}" for c, axis in zip(position, "xyz", strict=True) if c
    )
