"""Rotations on arrays: quaternion, matrix, roll-pitch-yaw and rotation vector.

All four describe the same thing with the same two letters: ``v_n = C_nb @ v_b``, the
quaternion ``q_nb`` is ``(w, x, y, z)`` with Hamilton's product, ``rpy`` is roll, pitch, yaw of b
relative to n (turn by yaw about z, then pitch about the new y, then roll about the new x), and
the rotation vector is the axis times the angle. `strapdown.conventions` has the full table.

Every function takes any leading shape: ``(4,)`` is one quaternion, ``(n, 4)`` a series. A NaN
makes its own row NaN and leaves the others alone; infinity is refused. q and -q are the same
rotation; where a result can have either sign, ``w >= 0`` is returned.

Gimbal lock: at pitch +-90 deg only the difference (at -90 deg the sum) of yaw and roll is
defined. Roll is then zero and yaw carries all of it, so that ``quat_from_rpy`` of the result
is the same rotation again.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import (
    as_floats,
    as_matrices,
    as_quats,
    as_series,
    as_times,
    as_vectors,
    instance,
    same_shape,
)
from strapdown._types import FloatArray

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

DCM_TOLERANCE = 1e-6  # a matrix further from orthonormal is not a rounded rotation
GIMBAL_LOCK = 1e-14  # half angle [rad] from the lock that round-off alone can make
_HALF_SQRT2 = 0.5 * 2.0**0.5
_Q_ENU_NED = np.array([0.0, _HALF_SQRT2, _HALF_SQRT2, 0.0])  # 180 deg about the north-east


# --- quaternion algebra -----------------------------------------------------------------


def quat_mul(q_ab: ArrayLike, q_bc: ArrayLike) -> FloatArray:
    """Return the product ``q_ac = q_ab * q_bc``: the inner letters cancel.

    Parameters
    ----------
    q_ab, q_bc : array_like, shape (..., 4)
        Unit quaternions; the leading shapes are broadcast.

    Returns
    -------
    ndarray, shape (..., 4)
        The product, not forced to ``w >= 0``.

    Raises
    ------
    ValueError
        If a shape or a norm is wrong.
    """
    a, b = as_quats("q_ab", q_ab, allow_nan=True), as_quats("q_bc", q_bc, allow_nan=True)
    _require_broadcast("q_ab", a, "q_bc", b)
    return _mul(a, b)


def quat_conj(q_ab: ArrayLike) -> FloatArray:
    """Return the inverse rotation ``q_ba``, shape (..., 4)."""
    return as_quats("q_ab", q_ab, allow_nan=True) * (1.0, -1.0, -1.0, -1.0)


def quat_normalize(q: ArrayLike) -> FloatArray:
    """Return `q` of any norm but zero scaled to unit norm, shape (..., 4)."""
    array = as_vectors("q", q, 4, allow_nan=True)
    largest = np.abs(array).max(axis=-1, keepdims=True)
    if (largest == 0.0).any():
        raise ValueError("`q` must not be zero, got a quaternion of norm 0.")
    array = array / largest  # the square of a huge or tiny element would overflow
    return _renormalized(array)


def rotate(q_nb: ArrayLike, v_b: ArrayLike) -> FloatArray:
    """Return ``v_n = C(q_nb) v_b``.

    Parameters
    ----------
    q_nb : array_like, shape (..., 4)
        Unit quaternions.
    v_b : array_like, shape (..., 3)
        Vectors in b; the leading shapes are broadcast.

    Returns
    -------
    ndarray, shape (..., 3)
        The same vectors resolved in n. For the way back use ``rotate(quat_conj(q_nb), v_n)``.

    Examples
    --------
    A vehicle that heads east has its forward axis in the east:

    >>> import numpy as np
    >>> rotate(quat_from_rpy([0, 0, np.pi / 2]), [1, 0, 0]).round(12)
    array([0., 1., 0.])
    """
    q = as_quats("q_nb", q_nb, allow_nan=True)
    v = as_vectors("v_b", v_b, allow_nan=True)
    _require_broadcast("q_nb", q, "v_b", v)
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * np.cross(u, v)
    return np.asarray(v + w * t + np.cross(u, t))


def rotation_angle(q: ArrayLike) -> FloatArray:
    """Return the angle of the rotation, 0 to pi [rad], shape (...)."""
    array = as_quats("q", q, allow_nan=True)
    half = np.arctan2(np.linalg.norm(array[..., 1:], axis=-1), np.abs(array[..., 0]))
    return np.asarray(2.0 * half)


# --- matrix -----------------------------------------------------------------------------


def dcm_from_quat(q_nb: ArrayLike) -> FloatArray:
    """Return ``C_nb``, shape (..., 3, 3), of ``q_nb``, shape (..., 4)."""
    w, x, y, z = np.moveaxis(as_quats("q_nb", q_nb, allow_nan=True), -1, 0)
    # fmt: off
    rows = (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )
    # fmt: on
    return np.stack(rows, axis=-1).reshape(*w.shape, 3, 3)


def quat_from_dcm(C_nb: ArrayLike) -> FloatArray:
    """Return ``q_nb``, with ``w >= 0``, of the matrix ``C_nb``.

    Parameters
    ----------
    C_nb : array_like, shape (..., 3, 3)
        Rotation matrices, orthonormal within 1e-6 and with determinant +1.

    Returns
    -------
    ndarray, shape (..., 4)
        Unit quaternions. Full accuracy for every angle, 180 deg included.

    Raises
    ------
    ValueError
        If a matrix is not a rotation; `nearest_dcm` gives the nearest one.
    """
    C = as_matrices("C_nb", C_nb, allow_nan=True)
    with np.errstate(over="ignore", invalid="ignore"):  # huge entries are no rotation either
        off = np.abs(np.swapaxes(C, -1, -2) @ C - np.eye(3)).max(axis=(-1, -2), initial=0.0)
    if (off > DCM_TOLERANCE).any() or (np.isnan(off) & np.isfinite(C).all(axis=(-1, -2))).any():
        raise ValueError(
            f"`C_nb` must be orthonormal within {DCM_TOLERANCE:g}, got C^T C off by "
            f"{np.nanmax(off):.3g}; `nearest_dcm` gives the nearest rotation."
        )
    # a triple product, since np.linalg.det warns of NaN
    if (np.sum(np.cross(C[..., 0, :], C[..., 1, :]) * C[..., 2, :], axis=-1) < 0.0).any():
        raise ValueError(
            "`C_nb` must have determinant +1, got a mirror image (-1); "
            "an axis has the wrong sign or two are swapped."
        )
    c11, c12, c13, c21, c22, c23, c31, c32, c33 = np.moveaxis(C.reshape(*C.shape[:-2], 9), -1, 0)
    # 4 q q^T: the row with the largest diagonal element divides by no small number.
    # fmt: off
    outer = np.stack((
        1.0 + c11 + c22 + c33, c32 - c23, c13 - c31, c21 - c12,
        c32 - c23, 1.0 + c11 - c22 - c33, c12 + c21, c13 + c31,
        c13 - c31, c12 + c21, 1.0 - c11 + c22 - c33, c23 + c32,
        c21 - c12, c13 + c31, c23 + c32, 1.0 - c11 - c22 + c33,
    ), axis=-1).reshape(*c11.shape, 4, 4)
    # fmt: on
    largest = np.argmax(np.einsum("...ii->...i", outer), axis=-1)
    q = np.take_along_axis(outer, largest[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
    return _canonical(q / np.linalg.norm(q, axis=-1, keepdims=True))


def nearest_dcm(matrix: ArrayLike) -> FloatArray:
    """Return the rotation matrix nearest to `matrix` in the Frobenius norm.

    Parameters
    ----------
    matrix : array_like, shape (..., 3, 3)
        Finite matrices, such as rotations that carry noise or were printed with few digits.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Orthonormal, determinant +1.
    """
    u, _, vt = np.linalg.svd(as_matrices("matrix", matrix))
    u[..., :, 2] *= np.sign(np.linalg.det(u @ vt))[..., np.newaxis]
    return np.asarray(u @ vt)


# --- roll, pitch, yaw -------------------------------------------------------------------


def quat_from_rpy(rpy: ArrayLike) -> FloatArray:
    """Return ``q_nb``, shape (..., 4), of roll, pitch, yaw [rad], shape (..., 3)."""
    half = 0.5 * as_vectors("rpy", rpy, allow_nan=True)
    (cr, cp, cy), (sr, sp, sy) = np.moveaxis(np.cos(half), -1, 0), np.moveaxis(np.sin(half), -1, 0)
    return np.stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ),
        axis=-1,
    )


def rpy_from_quat(q_nb: ArrayLike) -> FloatArray:
    """Return roll, pitch, yaw of b relative to n.

    Parameters
    ----------
    q_nb : array_like, shape (..., 4)
        Unit quaternions.

    Returns
    -------
    ndarray, shape (..., 3)
        Roll in (-pi, pi], pitch in [-pi/2, pi/2], yaw in (-pi, pi] [rad]. In gimbal lock
        (pitch +-pi/2) roll is zero; the three always give the same rotation back.

    Examples
    --------
    >>> from strapdown.units import DEG
    >>> rpy_from_quat(quat_from_rpy([10 * DEG, -20 * DEG, 130 * DEG])) / DEG
    array([ 10., -20., 130.])
    """
    w, x, y, z = np.moveaxis(as_quats("q_nb", q_nb, allow_nan=True), -1, 0)
    # With half angles r, p, y:  (w - y, z + x) = (cos p - sin p) (cos, sin)(y + r) and
    # (w + y, z - x) = (cos p + sin p) (cos, sin)(y - r); each factor vanishes at one lock.
    up, down = np.hypot(w - y, z + x), np.hypot(w + y, z - x)
    half_sum, half_diff = np.arctan2(z + x, w - y), np.arctan2(z - x, w + y)
    half_sum = np.where(up < GIMBAL_LOCK, half_diff, half_sum)
    half_diff = np.where(down < GIMBAL_LOCK, half_sum, half_diff)
    pitch = np.arctan2(2.0 * (w * y - x * z), up * down)
    roll, yaw = _wrap_pi(half_sum - half_diff), _wrap_pi(half_sum + half_diff)
    return np.stack((roll, pitch, yaw), axis=-1)


# --- rotation vector --------------------------------------------------------------------


def quat_from_rotvec(rotvec: ArrayLike) -> FloatArray:
    """Return the quaternion, shape (..., 4), of a rotation vector [rad], shape (..., 3)."""
    r = as_vectors("rotvec", rotvec, allow_nan=True)
    half = 0.5 * np.hypot(np.hypot(r[..., 0], r[..., 1]), r[..., 2])[..., np.newaxis]
    return _canonical(np.concatenate((np.cos(half), 0.5 * _sin_ratio(half) * r), axis=-1))


def rotvec_from_quat(q: ArrayLike) -> FloatArray:
    """Return the rotation vector [rad], of length 0 to pi, shape (..., 3)."""
    array = _canonical(as_quats("q", q, allow_nan=True))
    sine = np.linalg.norm(array[..., 1:], axis=-1, keepdims=True)
    tiny = sine < 1e-100  # its square has underflowed; the angle is then twice the sine
    angle = 2.0 * np.arctan2(sine, array[..., :1])
    return np.asarray(array[..., 1:] * np.where(tiny, 2.0, angle / np.where(tiny, 1.0, sine)))


# --- the remaining pairs ----------------------------------------------------------------


def dcm_from_rpy(rpy: ArrayLike) -> FloatArray:
    """Return ``C_nb``, shape (..., 3, 3), of roll, pitch, yaw [rad], shape (..., 3)."""
    return dcm_from_quat(quat_from_rpy(rpy))


def rpy_from_dcm(C_nb: ArrayLike) -> FloatArray:
    """Return roll, pitch, yaw [rad], shape (..., 3), as `rpy_from_quat` does."""
    return rpy_from_quat(quat_from_dcm(C_nb))


def dcm_from_rotvec(rotvec: ArrayLike) -> FloatArray:
    """Return the matrix, shape (..., 3, 3), of a rotation vector [rad], shape (..., 3)."""
    return dcm_from_quat(quat_from_rotvec(rotvec))


def rotvec_from_dcm(C: ArrayLike) -> FloatArray:
    """Return the rotation vector [rad], shape (..., 3), of a matrix, shape (..., 3, 3)."""
    return rotvec_from_quat(quat_from_dcm(C))


def rpy_from_rotvec(rotvec: ArrayLike) -> FloatArray:
    """Return roll, pitch, yaw [rad] of a rotation vector [rad], both of shape (..., 3)."""
    return rpy_from_quat(quat_from_rotvec(rotvec))


def rotvec_from_rpy(rpy: ArrayLike) -> FloatArray:
    """Return the rotation vector [rad] of roll, pitch, yaw [rad], both of shape (..., 3)."""
    return rotvec_from_quat(quat_from_rpy(rpy))


# --- other conventions: borders only ----------------------------------------------------


def scalar_last_from_quat(q: ArrayLike) -> FloatArray:
    """Return ``(x, y, z, w)`` of ``(w, x, y, z)``: SciPy, ROS, Eigen's storage."""
    return np.roll(as_quats("q", q, allow_nan=True), -1, axis=-1)


def quat_from_scalar_last(q_xyzw: ArrayLike) -> FloatArray:
    """Return ``(w, x, y, z)`` of a Hamilton quaternion stored as ``(x, y, z, w)``."""
    return np.roll(as_quats("q_xyzw", q_xyzw, allow_nan=True), 1, axis=-1)


def jpl_from_quat(q_nb: ArrayLike) -> FloatArray:
    """Return the JPL quaternion, ``(x, y, z, w)``, that takes n to b.

    JPL's product is turned round (i j = -k) and its quaternion stands for ``C_bn``. Both
    together leave the four numbers as they are: only their order changes.
    """
    return scalar_last_from_quat(q_nb)


def quat_from_jpl(q_bn_jpl: ArrayLike) -> FloatArray:
    """Return ``q_nb`` of the JPL quaternion, ``(x, y, z, w)``, that takes n to b."""
    return quat_from_scalar_last(q_bn_jpl)


def enu_from_ned(v_ned: ArrayLike) -> FloatArray:
    """Return east, north, up of vectors given as north, east, down, shape (..., 3)."""
    return as_vectors("v_ned", v_ned, allow_nan=True)[..., [1, 0, 2]] * (1.0, 1.0, -1.0)


def ned_from_enu(v_enu: ArrayLike) -> FloatArray:
    """Return north, east, down of vectors given as east, north, up, shape (..., 3)."""
    return as_vectors("v_enu", v_enu, allow_nan=True)[..., [1, 0, 2]] * (1.0, 1.0, -1.0)


def quat_enu_from_ned(q_ned_b: ArrayLike) -> FloatArray:
    """Return the attitude relative to ENU of one relative to NED; b stays as it is."""
    return _mul(_Q_ENU_NED, as_quats("q_ned_b", q_ned_b, allow_nan=True))


def quat_ned_from_enu(q_enu_b: ArrayLike) -> FloatArray:
    """Return the attitude relative to NED of one relative to ENU; b stays as it is."""
    # the conjugate of q_enu_ned, so that there and back is the same sign again
    return _mul(-_Q_ENU_NED, as_quats("q_enu_b", q_enu_b, allow_nan=True))


def scipy_from_quat(q_nb: ArrayLike) -> "Rotation":
    """Return `scipy.spatial.transform.Rotation` of ``q_nb``, shape (4,) or (n, 4).

    Its ``apply(v_b)`` is ``v_n``.
    """
    from scipy.spatial.transform import Rotation

    q = as_quats("q_nb", q_nb)
    if q.ndim > 2:
        raise ValueError(f"`q_nb` must have shape (4,) or (n, 4) for SciPy, got {q.shape}.")
    return Rotation.from_quat(np.roll(q, -1, axis=-1))


def quat_from_scipy(rotation: "Rotation") -> FloatArray:
    """Return ``q_nb``, with ``w >= 0``, of a SciPy `Rotation` that takes b to n."""
    from scipy.spatial.transform import Rotation

    instance("rotation", rotation, Rotation)
    return _canonical(np.roll(np.asarray(rotation.as_quat(), dtype=np.float64), 1, axis=-1))


# --- between rotations ------------------------------------------------------------------


def slerp(q_a: ArrayLike, q_b: ArrayLike, fraction: ArrayLike) -> FloatArray:
    """Return the rotation part of the way from `q_a` to `q_b`, at constant rate.

    Parameters
    ----------
    q_a, q_b : array_like, shape (..., 4)
        Unit quaternions; of the two ways round the shorter is taken.
    fraction : array_like, shape (...)
        0 gives `q_a`, 1 gives the rotation `q_b`; other values extrapolate.

    Returns
    -------
    ndarray, shape (..., 4)
        Unit quaternions on the side of `q_a`.

    Examples
    --------
    >>> rotvec_from_quat(slerp([1, 0, 0, 0], quat_from_rotvec([0, 0, 0.4]), 0.25)).round(12)
    array([0. , 0. , 0.1])
    """
    a, b = as_quats("q_a", q_a, allow_nan=True), as_quats("q_b", q_b, allow_nan=True)
    _require_broadcast("q_a", a, "q_b", b)
    part = as_floats("fraction", fraction)
    if np.isinf(part).any():
        raise ValueError("`fraction` must be finite or NaN, got inf.")
    same_shape(q_a=a[..., 0], q_b=b[..., 0], fraction=part)
    step = rotvec_from_quat(_renormalized(_mul(a * (1.0, -1.0, -1.0, -1.0), b)))
    half = 0.5 * np.linalg.norm(step, axis=-1) * part
    turn = np.concatenate(
        (
            np.cos(half)[..., np.newaxis],
            (0.5 * part * _sin_ratio(half))[..., np.newaxis] * step,
        ),
        axis=-1,
    )
    return _renormalized(_mul(a, turn))


def interpolate(t: ArrayLike, t_q: ArrayLike, q: ArrayLike) -> FloatArray:
    """Return the attitude at other times, by `slerp` between neighbours.

    Parameters
    ----------
    t : array_like, shape (m,)
        Times asked for, in any order, within the span of `t_q` [s].
    t_q : array_like, shape (n,)
        Times of the quaternions, strictly increasing [s].
    q : array_like, shape (n, 4)
        Unit quaternions; a NaN row makes the times next to it NaN.

    Returns
    -------
    ndarray, shape (m, 4)
        Unit quaternions.

    Raises
    ------
    ValueError
        If a time lies outside the span.
    """
    times = as_times("t_q", t_q)
    quats = as_quats("q", q, allow_nan=True)
    if quats.shape != (times.size, 4):
        raise ValueError(f"`q` must have shape ({times.size}, 4) like `t_q`, got {quats.shape}.")
    wanted = as_series("t", t)
    if wanted.size == 0:
        return np.empty((0, 4))
    if times.size == 0 or wanted.min() < times[0] or wanted.max() > times[-1]:
        span = f"[{times[0]}, {times[-1]}]" if times.size else "an empty span"
        raise ValueError(
            f"`t` must lie in {span} of `t_q`, got {wanted.min()} to {wanted.max()}; "
            "cut it to the common span first."
        )
    after = np.searchsorted(times, wanted, side="left")
    before = np.where(times[after] == wanted, after, after - 1)
    interval = np.where(after == before, 1.0, times[after] - times[before])
    return slerp(quats[before], quats[after], (wanted - times[before]) / interval)


def mean_rotation(q: ArrayLike, weights: ArrayLike | None = None) -> FloatArray:
    """Return the rotation with the least sum of squared chordal distances to all.

    It is the eigenvector to the largest eigenvalue of ``sum(w_i q_i q_i^T)`` [1]_, so the signs
    of the quaternions do not matter.

    Parameters
    ----------
    q : array_like, shape (n, 4)
        Unit quaternions, at least one.
    weights : array_like, shape (n,), optional
        Non-negative weights, not all zero; equal by default.

    Returns
    -------
    ndarray, shape (4,)
        The mean, with ``w >= 0``.

    Raises
    ------
    ValueError
        If the input is empty, a weight negative, or the mean not unique, as of two
        rotations 180 deg apart.

    References
    ----------
    .. [1] F. L. Markley, Y. Cheng, J. L. Crassidis, Y. Oshman, "Averaging quaternions",
           J. Guidance, Control, and Dynamics 30(4), 2007.
    """
    quats = as_quats("q", q)
    if quats.ndim != 2 or len(quats) == 0:
        raise ValueError(f"`q` must have shape (n, 4) with n >= 1, got {quats.shape}.")
    w = np.ones(len(quats)) if weights is None else as_series("weights", weights, len(quats))
    if (w < 0.0).any() or not (w > 0.0).any():
        raise ValueError("`weights` must be non-negative and not all zero.")
    w = w / w.max()
    values, vectors = np.linalg.eigh((quats * w[:, np.newaxis]).T @ quats / w.sum())
    if values[3] - values[2] < 1e-12:  # eigenvalues sum to one: round-off alone is left
        raise ValueError(
            "`q` must have a unique mean, got rotations that spread evenly over 180 deg or more."
        )
    return _canonical(vectors[:, 3])


def wrap_pi(angle: ArrayLike) -> FloatArray:
    """Return `angle` [rad] brought into (-pi, pi] by whole turns, any shape."""
    array = as_floats("angle", angle)
    if np.isinf(array).any():
        raise ValueError("`angle` must be finite or NaN, got inf.")
    return _wrap_pi(array)


# --- inner parts, on checked arrays -----------------------------------------------------


def _wrap_pi(angle: FloatArray) -> FloatArray:
    rest = np.fmod(angle, 2.0 * np.pi)  # exact
    rest = np.where(rest > np.pi, rest - 2.0 * np.pi, rest)
    return np.where(rest <= -np.pi, rest + 2.0 * np.pi, rest)


def _sin_ratio(angle: FloatArray) -> FloatArray:
    """Return ``sin(angle) / angle``, one at zero."""
    zero = angle == 0.0
    return np.where(zero, 1.0, np.sin(angle) / np.where(zero, 1.0, angle))


def _mul(a: FloatArray, b: FloatArray) -> FloatArray:
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        axis=-1,
    )


def _canonical(q: FloatArray) -> FloatArray:
    return np.where(q[..., :1] < 0.0, -q, q)


def _renormalized(q: FloatArray) -> FloatArray:
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))


def _require_broadcast(name_a: str, a: FloatArray, name_b: str, b: FloatArray) -> None:
    try:
        np.broadcast_shapes(a.shape[:-1], b.shape[:-1])
    except ValueError:
        raise ValueError(
            f"`{name_a}` and `{name_b}` must have equal or broadcastable lengths, "
            f"got shapes {a.shape} and {b.shape}."
        ) from None
