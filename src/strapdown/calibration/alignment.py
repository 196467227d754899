r"""Turn a magnetometer into the accelerometer's axes: the dip of the field does not turn.

In any pose at rest the angle between gravity and the field is the same, so with unit vectors
f of the specific force and m of the corrected field::

    f_i . (C m_i) = sin(dip) = constant

An ellipsoid fit leaves a rotation open; poses tilted about two axes at least determine it.
The inclination of the field comes out with it.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import positive, same_length
from strapdown._types import FloatArray
from strapdown.calibration.least_squares import gauss_newton
from strapdown.calibration.record import require_poses, rms
from strapdown.calibration.sphere import unit_vectors
from strapdown.errors import InputError
from strapdown.rotation import dcm_from_rotvec
from strapdown.units import DEG

_WHAT = "alignment of the magnetometer to the accelerometer"
_ADVICE = "hold the device still in poses tilted about all axes, upside down too"
LIMIT = 1.0 * DEG  # three standard deviations of the rotation about any axis


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alignment:
    """Rotation from magnetometer to accelerometer axes.

    Attributes
    ----------
    C_am : ndarray, shape (3, 3)
        Takes components in magnetometer axes to accelerometer axes.
    inclination : float
        Inclination of the field, positive below the horizon [rad].
    covariance : ndarray, shape (4, 4)
        Of the small rotation, resolved in accelerometer axes [rad], and of the sine of the
        inclination.
    residuals : ndarray, shape (n,)
        Sine of the inclination in each pose less its estimate.
    dof : int
        Poses less the four unknowns.
    history : ndarray, shape (k, 4)
        Rotation vector from the nearest axes [rad] and sine, by iteration.
    """

    C_am: FloatArray
    inclination: float
    covariance: FloatArray
    residuals: FloatArray
    dof: int
    history: FloatArray

    @property
    def std(self) -> FloatArray:
        """Standard deviation of the rotation about each accelerometer axis [rad]."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[:3]))


def align_to_accelerometer(mag: ArrayLike, acc: ArrayLike, *, limit: float = LIMIT) -> Alignment:
    """Return the rotation from magnetometer to accelerometer axes.

    Parameters
    ----------
    mag : array_like, shape (n, 3)
        Corrected magnetic field in each pose, any unit.
    acc : array_like, shape (n, 3)
        Corrected specific force in the same poses at rest, any unit.
    limit : float
        Largest three-sigma error of the rotation that is accepted [rad]; ``math.inf`` accepts
        all.

    Returns
    -------
    Alignment

    Raises
    ------
    InputError
        If there are too few poses, or they do not determine the rotation to `limit`.
    """
    m = unit_vectors("mag", mag)
    f = unit_vectors("acc", acc)
    require_poses(same_length(mag=m, acc=f), 6, _WHAT, _ADVICE)
    start = _nearest_axes(m, f)
    m = m @ start.T
    # At rest f points up, so f . m is minus the sine of the inclination.
    positive("limit", limit)
    solution = gauss_newton(
        lambda x: _model(x, m, f),
        np.append(np.zeros(3), -float(np.mean(np.einsum("ij,ij->i", f, m)))),
        np.ones(4),
        ("rotation about x", "rotation about y", "rotation about z", "inclination"),
        what=_WHAT,
        advice=_ADVICE,
    )
    to_small_rotation = np.eye(4)
    to_small_rotation[:3, :3] = _left_jacobian(solution.x[:3])
    covariance = to_small_rotation @ solution.covariance() @ to_small_rotation.T
    worst = 3.0 * math.sqrt(float(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
    if not worst <= limit:
        raise InputError(
            f"{_WHAT} must be known to {limit / DEG:g} deg (three sigma), the poses give "
            f"{worst / DEG:.2g} deg with residuals of {rms(solution.residuals) / DEG:.2g} deg; "
            f"{_ADVICE}."
        )
    return Alignment(
        C_am=dcm_from_rotvec(solution.x[:3]) @ start,
        inclination=math.asin(max(-1.0, min(1.0, float(solution.x[3])))),
        covariance=covariance,
        residuals=solution.residuals,
        dof=solution.dof,
        history=solution.history,
    )


def _model(x: FloatArray, m: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return residuals and derivatives; x is a rotation vector and the sine of the dip."""
    turned = m @ dcm_from_rotvec(x[:3]).T
    residuals = -np.einsum("ij,ij->i", f, turned) - x[3]
    # d(f . exp(d) c) = f . (d x c) = d . (c x f)
    by_rotation = -np.cross(turned, f) @ _left_jacobian(x[:3])
    return residuals, np.column_stack((by_rotation, -np.ones(len(f))))


def _left_jacobian(rotvec: FloatArray) -> FloatArray:
    """Return J with ``exp(r + dr) = exp(J dr) exp(r)`` to first order in dr."""
    angle = float(np.linalg.norm(rotvec))
    x, y, z = rotvec
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-4:
        return np.asarray(np.eye(3) + 0.5 * cross)
    a = (1.0 - math.cos(angle)) / angle**2
    b = (angle - math.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + a * cross + b * (cross @ cross))


def _nearest_axes(m: FloatArray, f: FloatArray) -> FloatArray:
    """Return the one of the 24 turns of a cube under which the dip varies least."""
    best, least = np.eye(3), math.inf
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = np.zeros((3, 3))
            turn[range(3), order] = signs
            if np.linalg.det(turn) < 0.0:
                continue
            spread = float(np.var(np.einsum("ij,ij->i", f, m @ turn.T)))
            if spread < least:
                best, least = turn, spread
    return best
