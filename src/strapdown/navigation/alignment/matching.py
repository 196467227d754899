"""Alignment by accelerations that box and receiver both saw, in any mount.

Between two fixes the specific force, summed in the axes that the box had at the start (alpha), has
to become the change of velocity less gravity (beta): ``beta_k = C_nb alpha_k``. The best rotation
of all pairs (Wahba's problem [1]_) is where a least-squares adjustment begins that finds the
biases of both sensors as well, as far as the motion shows them.

References
----------
.. [1] G. Wahba, "A least squares estimate of satellite attitude", SIAM Review 7(3), 1965.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude.determination import svd
from strapdown.earth import earth_rate_n, gravity_n, transport_rate_n
from strapdown.errors import InputError, NotConverged
from strapdown.navigation.alignment.result import Alignment, Fixes, Stretch, fixes, stretch
from strapdown.recording import Recording
from strapdown.rotation import (
    dcm_from_quat,
    quat_conj,
    quat_from_rotvec,
    quat_mul,
    rotate,
    rotvec_from_quat,
)
from strapdown.units import DEG, DPS

_LEAST_INTERVAL = 0.4  # between fixes: velocities of nearer ones share their error [s]
_LEAST_PAIRS = 4
_WORST_FIT = 25.0  # mean square residual, of what is expected, above which nothing is believed
_STEPS = np.repeat((1e-5, 1e-3), 3)  # of the biases, for difference quotients [rad/s], [m/s^2]
_MOST_ITERATIONS = 20
_SETTLED = 1e-2  # step in sigmas that ends the iteration


class _Pairs(NamedTuple):
    """What the receiver saw between fixes, in the axes that NED had at the first."""

    rows: list[int]  # of the fixes between which
    beta: FloatArray  # (k, 3) [m/s]
    sigma: FloatArray  # of each component, (k,) [m/s]


class _Traced(NamedTuple):
    """What the box saw, in the axes that it had at the first fix."""

    alpha: FloatArray  # (k, 3) [m/s]
    turn: FloatArray  # q_b0b at the end


def velocity_matching(
    rec: Recording,
    *,
    span: tuple[float, float] | None = None,
    velocity_std: float = 0.1,
    gyr_bias: ArrayLike = (0.0, 0.0, 0.0),
    gyr_bias_std: float = 0.5 * DPS,
    acc_bias_std: float = 0.1,
    arm_std: float = 0.5,
    max_heading_std: float = 10.0 * DEG,
) -> Alignment:
    """Align in motion, in any mount: the attitude that makes accelerations fit those of fixes.

    Gravity gives level, every change of speed or direction gives heading. The biases of both
    sensors are unknowns of the adjustment, with the sigmas that are given.

    Parameters
    ----------
    rec : Recording
        With ``imu`` and ``gnss`` with velocities.
    span : tuple of float, optional
        From when to when [s]; 10 to 60 s with some acceleration in it. The whole recording by
        default.
    velocity_std : float
        Sigma of the fixes' velocity where the receiver states none [m/s].
    gyr_bias : array_like, shape (3,)
        Bias of the gyroscope as far as it is known, such as its mean at rest [rad/s].
    gyr_bias_std, acc_bias_std : float
        Sigma of what is left of the biases in each axis [rad/s], [m/s^2].
    arm_std : float
        Sigma of each component of the arm from the box to the antenna [m]: turning, it makes
        velocities differ.
    max_heading_std : float
        Greatest heading sigma that is taken [rad].

    Returns
    -------
    Alignment
        At the last fix of the span; its ``gyr_bias`` is the one that was found.

    Raises
    ------
    InputError
        If there are fewer than five fixes, the motion leaves the heading open, or the vectors do
        not fit each other.
    NotConverged
        If the adjustment finds no end.

    Notes
    -----
    Offline. The covariance grows with the residuals where they are larger than stated.
    """
    _checks.positive("max_heading_std", max_heading_std, allow_inf=True)
    seen = fixes(rec, span, velocity_std)
    samples = stretch(rec, (float(seen.t[0]), float(seen.t[-1])))
    arm = _checks.positive("arm_std", arm_std, allow_zero=True)
    known = _checks.as_vector("gyr_bias", gyr_bias)
    rate = np.interp(seen.t, samples.t, np.linalg.norm(samples.gyr - known, axis=1))
    seen = seen._replace(std=np.hypot(seen.std, arm * rate[:, np.newaxis]))
    spin = earth_rate_n(seen.lla[0, 0])
    pairs = _pairs(seen, spin)
    if len(pairs.beta) < _LEAST_PAIRS:
        raise InputError(
            f"the span must hold at least {_LEAST_PAIRS + 1} fixes {_LEAST_INTERVAL:g} s apart, "
            f"got {len(pairs.beta) + 1}."
        )
    prior = np.concatenate((known, np.zeros(3)))
    prior_std = np.repeat(
        (
            _checks.positive("gyr_bias_std", gyr_bias_std),
            _checks.positive("acc_bias_std", acc_bias_std),
        ),
        3,
    )
    q, biases, P, fit = _adjust(seen, samples, pairs, prior, prior_std)
    elapsed = float(samples.t[-1] - seen.t[0])
    q_nn0 = quat_from_rotvec(-spin * elapsed)  # the axes of the start keep still in space
    C = dcm_from_quat(q_nn0)
    covariance_n = fit * C @ P @ C.T
    heading_std = math.sqrt(covariance_n[2, 2])
    if not heading_std <= max_heading_std:
        sideways = float(np.hypot(pairs.beta[:, 0], pairs.beta[:, 1]).max())
        raise InputError(
            f"the motion must show its heading to {max_heading_std / DEG:.3g} deg, it shows it to "
            f"{min(heading_std / DEG, 180.0):.3g} deg: its greatest change of velocity between "
            f"fixes is {sideways:.2g} m/s; take a span in which the vehicle pulls away, brakes or "
            "turns."
        )
    if not fit < _WORST_FIT:
        raise InputError(
            "the accelerations of the box must fit those of the fixes, they are "
            f"{math.sqrt(fit):.1f} times as far off as their sigmas say; check axes (swapped, "
            "mirrored), units, and the time stamps of `imu` against `gnss`."
        )
    turn = _trace(samples, seen, pairs.rows, biases).turn
    return Alignment(
        t=float(samples.t[-1]),
        q_nb=quat_mul(quat_mul(q_nn0, q), turn),
        covariance_n=covariance_n,
        gyr_bias=biases[:3],
        heading_reference="true",
        method="velocity_matching",
        span=samples.span,
    )


def _adjust(
    seen: Fixes, samples: Stretch, pairs: _Pairs, prior: FloatArray, prior_std: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return q_n0b0, biases, covariance of the attitude at the end, and the mean square residual.

    Gauss and Newton's iteration over attitude (``phi_n``) and six biases.
    """
    biases = prior.copy()
    traced = _trace(samples, seen, pairs.rows, biases)
    across = pairs.sigma / np.linalg.norm(pairs.beta, axis=1)
    q = svd(traced.alpha, pairs.beta, sigma=across, min_angle=1e-7).q_nb
    weight = 1.0 / pairs.sigma**2
    for _ in range(_MOST_ITERATIONS):
        slopes, turns = _slopes(samples, seen, pairs.rows, biases, traced)
        C = dcm_from_quat(q)
        rotated = traced.alpha @ C.T
        J = np.empty((len(rotated), 3, 9))
        J[:, :, :3] = -_cross(rotated)
        J[:, :, 3:] = np.einsum("ij,kjl->kil", C, slopes)
        off = pairs.beta - rotated
        N = np.einsum("k,kij,kil->jl", weight, J, J)
        right = np.einsum("k,kij,ki->j", weight, J, off)
        N[3:, 3:] += np.diag(prior_std**-2.0)
        N[:3, :3] += np.eye(3) / math.pi**2  # keeps a heading that nothing shows finite
        right[3:] += (prior - biases) / prior_std**2
        step = np.linalg.solve(N, right)
        q = quat_mul(quat_from_rotvec(step[:3]), q)
        biases = biases + step[3:]
        traced = _trace(samples, seen, pairs.rows, biases)
        if (np.abs(step[:3]) < _SETTLED * np.sqrt(np.diag(np.linalg.inv(N))[:3])).all():
            break
    else:
        raise NotConverged(
            "velocity matching", _MOST_ITERATIONS, float(np.abs(step[:3]).max()),
            "check axes (swapped, mirrored) and units, or take a span with more motion",
        )  # fmt: skip
    off = pairs.beta - traced.alpha @ dcm_from_quat(q).T
    fit = float(np.einsum("k,ki,ki->", weight, off, off)) / (3 * len(off) - 3)
    # the attitude of the end has the turn as well, which depends on the bias
    to_end = np.concatenate((np.eye(3), dcm_from_quat(q) @ turns), axis=1)
    return q, biases, to_end @ np.linalg.inv(N) @ to_end.T, max(1.0, fit)


def _pairs(seen: Fixes, spin: FloatArray) -> _Pairs:
    """Return the changes of velocity less gravity between fixes."""
    rows = [0]
    for k in range(1, len(seen.t)):
        if seen.t[k] - seen.t[rows[-1]] >= _LEAST_INTERVAL:
            rows.append(k)
    beta, sigma = [], []
    for i, k in pairwise(rows):
        dt = float(seen.t[k] - seen.t[i])
        middle = 0.5 * (seen.v_n[i] + seen.v_n[k])
        turn = 2.0 * earth_rate_n(seen.lla[i, 0]) + transport_rate_n(seen.lla[i], middle)
        gained = np.cross(turn, middle) - gravity_n(seen.lla[i])
        since = 0.5 * float(seen.t[i] + seen.t[k]) - float(seen.t[0])
        beta.append(
            rotate(quat_from_rotvec(spin * since), seen.v_n[k] - seen.v_n[i] + gained * dt)
        )
        sigma.append(float(np.sqrt(np.mean(seen.std[i] ** 2 + seen.std[k] ** 2))))
    return _Pairs(rows, np.reshape(beta, (-1, 3)), np.array(sigma))


def _trace(samples: Stretch, seen: Fixes, rows: list[int], biases: FloatArray) -> _Traced:
    """Return velocity gained between fixes and turn, in the axes that the box had at the first."""
    from strapdown.kernels import trace

    out = np.empty((len(samples.t), 7))
    gyr, acc = samples.gyr - biases[:3], samples.acc - biases[3:]
    trace.run(samples.t, np.ascontiguousarray(gyr), np.ascontiguousarray(acc), out)
    at = np.stack(
        [np.interp(seen.t[rows], samples.t, out[:, 4 + axis]) for axis in range(3)], axis=-1
    )
    return _Traced(np.diff(at, axis=0), out[-1, :4])


def _slopes(
    samples: Stretch, seen: Fixes, rows: list[int], biases: FloatArray, here: _Traced
) -> tuple[FloatArray, FloatArray]:
    """Return how alpha, (k, 3, 6), and the turn from the start, (3, 6), go with the biases."""
    alpha, turn = np.empty((*here.alpha.shape, 6)), np.empty((3, 6))
    for i in range(6):
        shifted = biases.copy()
        shifted[i] += _STEPS[i]
        there = _trace(samples, seen, rows, shifted)
        alpha[:, :, i] = (there.alpha - here.alpha) / _STEPS[i]
        turn[:, i] = rotvec_from_quat(quat_mul(there.turn, quat_conj(here.turn))) / _STEPS[i]
    return alpha, turn


def _cross(v: FloatArray) -> FloatArray:
    """Return the matrices of the cross products with vectors, (k, 3, 3)."""
    x, y, z = v.T
    zero = np.zeros_like(x)
    return np.stack((zero, -z, y, z, zero, -x, -y, x, zero), axis=-1).reshape(-1, 3, 3)
