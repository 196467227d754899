r"""Magnetometer calibration without a reference: the field's strength does not turn.

In a constant field b the raw samples ``m = inv(A) b + h`` lie on an ellipsoid: hard iron h
shifts its centre, soft iron, scale factors and non-orthogonality deform it. The symmetric
matrix A takes it back to a sphere::

    |A (m - h)| = F

A rotation is left open, since a turned sphere is the same sphere; with soft iron that is not
symmetric, `strapdown.calibration.alignment` finds it from gravity.

An algebraic quadric fit gives the start, the least sum of squared distances from the ellipsoid
the result: the quadric alone is drawn to too small an ellipsoid by noise where a part of the
sphere is missing.
How well a part determines the whole follows from the covariance, whose variance is raised by
the correlation in time of the residuals. A fit whose hard iron or directions it does not
determine is refused, naming the coverage.

References
----------
.. [1] V. Renaudin, M. H. Afzal, G. Lachapelle, "Complete triaxis magnetometer calibration in
       the magnetic domain", J. Sensors, 2010 (model and algebraic fit).
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_samples, positive
from strapdown._types import FloatArray
from strapdown.calibration.least_squares import correlation_length, gauss_newton
from strapdown.calibration.record import (
    CalibrationRecord,
    parameters_of,
    require_poses,
    rms,
)
from strapdown.calibration.sphere import coverage, fibonacci_sphere, unit_vectors
from strapdown.errors import InputError, NotConverged
from strapdown.units import DEG, UT

NAMES = ("b_x", "b_y", "b_z", "a_xx", "a_yy", "a_zz", "a_xy", "a_xz", "a_yz")
HARD_IRON_LIMIT = 0.5 * UT  # three standard deviations along any direction
DIRECTION_LIMIT = 1.0 * DEG  # three standard deviations of the worst direction
SCALE_TOLERANCE = 0.05  # of the HMC5883L, by its datasheet
_GOOD_COVERAGE = 0.85  # a record that covers more fails for another reason
_SHELL = 0.1  # samples that scatter more, relative to the radius, lie on no shell
_WHAT = "ellipsoid fit of the magnetometer"
_ROWS, _COLUMNS = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)  # order of a_xx ... a_yz
_PROBES = fibonacci_sphere(200)


def ellipsoid(
    mag: ArrayLike,
    field: float | None = None,
    *,
    hard_iron_limit: float = HARD_IRON_LIMIT,
    direction_limit: float = DIRECTION_LIMIT,
    tolerances: Mapping[str, float] | None = None,
    **about: Any,
) -> CalibrationRecord:
    """Return hard and soft iron from samples in all orientations, in order of time.

    Parameters
    ----------
    mag : array_like, shape (n, 3)
        Raw magnetic field [T], away from moving iron; rows of NaN are left out.
    field : float, optional
        Strength of the field [T], as `strapdown.earth.magnetic_field` gives it. Without it
        A has determinant 1 and the strength comes from the samples: directions are the same.
    hard_iron_limit : float
        Largest three-sigma error of the hard iron that is accepted [T]; ``math.inf``
        accepts all.
    direction_limit : float
        Largest three-sigma error of any corrected direction that is accepted [rad].
    tolerances : mapping of str to float, optional
        By parameter or kind (``b``, ``a``); default 5 % for the diagonal of A. Off the
        diagonal the nominal value is 0.
    **about
        ``sensor_id``, ``date``, ``temp_degc`` of the record.

    Returns
    -------
    CalibrationRecord
        Matrix A and bias h. Residuals: norm of each corrected sample less the field [T].
        `quality` holds ``coverage``, ``largest_hole_deg``, ``field_ut``,
        ``hard_iron_3sigma_ut``, ``direction_3sigma_deg`` (largest of all directions),
        ``direction_3sigma_rms_deg``, ``correlation_samples``, ``iterations``.

    Raises
    ------
    InputError
        If the samples cover too little of the sphere to tell centre and shape, or lie on no
        ellipsoid.

    Notes
    -----
    Offline.
    """
    samples = as_samples("mag", mag, allow_nan=True)
    samples = samples[~np.isnan(samples).any(axis=1)]
    require_poses(len(samples), 12, _WHAT, "turn the device slowly through all orientations")
    h, A, F = _start(samples, None if field is None else positive("field", field))
    if not np.linalg.norm(np.ptp(samples, axis=0)) > 0.0:
        raise InputError(f"{_WHAT} needs samples that differ, all {len(samples)} are equal.")

    advice = _advice(samples, h, A, F)
    try:
        solution = gauss_newton(
            lambda x: _model(x, samples, F),
            np.concatenate((h, A[_ROWS, _COLUMNS])),
            np.array([F] * 3 + [1.0] * 6),
            NAMES,
            what=_WHAT,
            advice=advice,
        )
    except NotConverged:
        raise InputError(f"{_WHAT} found no ellipsoid; {advice}.") from None
    h, A = solution.x[:3], _symmetric(solution.x[3:])
    if (
        not (np.linalg.eigvalsh(A) > 0.05 * np.linalg.norm(A, 2)).all()
        or _scatter(samples, h, A, F) > _SHELL
    ):
        raise InputError(f"{_WHAT} found no ellipsoid; {_advice(samples, h, A, F)}.")

    correlation = correlation_length(solution.residuals)
    covariance = solution.covariance() * correlation
    values, history = solution.x, solution.history
    if field is None:  # the samples cannot tell strength from scale: set det A = 1
        values, covariance, history, A, F = _unit_determinant(A, F, values, covariance, history)
    hard_iron_std = math.sqrt(float(np.linalg.eigvalsh(covariance[:3, :3])[-1]))
    direction_std = _direction_std(A, F, covariance)
    spread = coverage((samples - h) @ A)
    residuals = np.linalg.norm((samples - h) @ A, axis=1) - F
    if spread.fraction > _GOOD_COVERAGE:
        advice = (
            f"the directions cover {100.0 * spread.fraction:.0f} % of the sphere, but the norm is "
            f"off by {rms(residuals) / UT:.2g} uT RMS, over {correlation:.0f} samples at a time: "
            "turn the device on the spot, away from iron and currents"
        )
    _refuse_if_loose(hard_iron_std, direction_std, hard_iron_limit, direction_limit, advice)
    before = np.linalg.norm(samples, axis=1)
    before -= F if field is not None else before.mean()
    return CalibrationRecord(
        sensor="mag",
        method="ellipsoid",
        matrix=A,
        bias=h,
        parameters=_parameters(values, covariance, tolerances),
        covariance=covariance,
        residual_rms=rms(residuals),
        residual_rms_before=rms(before),
        equations=len(samples),
        dof=solution.dof,
        residuals=residuals,
        residuals_before=before,
        history=history,
        directions=unit_vectors("corrected", (samples - h) @ A),
        reference=F,
        quality={
            "coverage": spread.fraction,
            "largest_hole_deg": math.degrees(spread.hole),
            "field_ut": F / UT,
            "hard_iron_3sigma_ut": 3.0 * hard_iron_std / UT,
            "direction_3sigma_deg": 3.0 * float(direction_std.max()) / DEG,
            "direction_3sigma_rms_deg": 3.0 * rms(direction_std) / DEG,
            "correlation_samples": correlation,
            "condition": solution.condition,
            "iterations": float(len(solution.history) - 1),
        },
        **about,
    )


def _symmetric(a: FloatArray) -> FloatArray:
    a_xx, a_yy, a_zz, a_xy, a_xz, a_yz = a
    return np.array([[a_xx, a_xy, a_xz], [a_xy, a_yy, a_yz], [a_xz, a_yz, a_zz]])


def _model(x: FloatArray, samples: FloatArray, F: float) -> tuple[FloatArray, FloatArray]:
    """Return the distances of the samples from the ellipsoid, to first order, and derivatives.

    The error of the norm over its gradient, ``(|c| - F) / |A c| * |c|`` with ``c = A (m - h)``.
    Without the gradient, or with its derivatives left out, the noise of the samples pulls the
    solution where the coverage is partial, by several times its standard deviation on one
    quarter of the sphere.
    """
    A = _symmetric(x[3:])
    d = samples - x[:3]
    c = d @ A
    norm = np.maximum(np.linalg.norm(c, axis=1, keepdims=True), 1e-30)
    u = c / norm
    w = u @ A
    gradient = np.maximum(np.linalg.norm(w, axis=1, keepdims=True), 1e-30)
    excess = (norm - F) / gradient**3
    across = w @ A
    across -= u * np.einsum("ij,ij->i", u, across)[:, np.newaxis]
    by_c = u / gradient - excess * across / norm
    by_matrix = _by_matrix(by_c, d) - excess * _by_matrix(w, u)
    return ((norm - F) / gradient)[:, 0], np.column_stack((-by_c @ A, by_matrix))


def _by_matrix(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the derivatives of ``left^T A right`` by a_xx ... a_yz, one row per sample."""
    out = left[:, _ROWS] * right[:, _COLUMNS]
    out[:, 3:] += left[:, _COLUMNS[3:]] * right[:, _ROWS[3:]]
    return out


def _start(samples: FloatArray, field: float | None) -> tuple[FloatArray, FloatArray, float]:
    """Return centre, matrix and radius of an algebraic fit: quadric, or sphere, or mean."""
    middle = samples.mean(axis=0)
    size = float(np.sqrt(np.mean(np.sum((samples - middle) ** 2, axis=1)))) or 1.0
    x, y, z = ((samples - middle) / size).T
    ones = np.ones_like(x)
    quadric = np.column_stack((x * x, y * y, z * z, 2 * x * y, 2 * x * z, 2 * y * z, x, y, z))
    q = np.linalg.lstsq(quadric, ones, rcond=None)[0]
    Q = _symmetric(q[:6])
    eigenvalues, vectors = np.linalg.eigh(Q)
    if eigenvalues[0] > 0.1 * eigenvalues[-1] > 0.0:
        centre = -0.5 * np.linalg.solve(Q, q[6:])
        # (v - c)^T Q (v - c) = 1 + c^T Q c: dividing by it gives a unit sphere
        level = 1.0 + centre @ Q @ centre
        root = (vectors * np.sqrt(eigenvalues / level)) @ vectors.T
        radius = size * float(np.linalg.det(root)) ** (-1.0 / 3.0)
        F = radius if field is None else field
        return middle + size * centre, root * (F / size), F
    linear = np.column_stack((2 * x, 2 * y, 2 * z, ones))
    s = np.linalg.lstsq(linear, x * x + y * y + z * z, rcond=None)[0]
    radius = size * math.sqrt(max(float(s[3] + s[:3] @ s[:3]), 1e-12))
    F = radius if field is None else field
    return middle + size * s[:3], np.eye(3) * (F / radius), F


def _unit_determinant(
    A: FloatArray, F: float, values: FloatArray, covariance: FloatArray, history: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Return the solution scaled to ``det A = 1``, and the field strength that it implies."""
    factor = float(np.linalg.det(A)) ** (-1.0 / 3.0)
    # d(det^-1/3 a) = det^-1/3 (da - a tr(inv(A) dA) / 3)
    weights = np.linalg.inv(A)[_ROWS, _COLUMNS] * [1.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    scale = np.eye(9)
    scale[3:, 3:] = factor * (np.eye(6) - np.outer(values[3:], weights) / 3.0)
    scaled = scale @ covariance @ scale.T
    values = np.concatenate((values[:3], factor * values[3:]))
    history = np.column_stack((history[:, :3], factor * history[:, 3:]))
    return values, 0.5 * (scaled + scaled.T), history, factor * A, factor * F


def _direction_std(A: FloatArray, F: float, covariance: FloatArray) -> FloatArray:
    """Return the standard deviation of the corrected direction over the sphere [rad]."""
    A_inv = np.linalg.inv(A)
    out = np.empty(len(_PROBES))
    for k, u in enumerate(_PROBES):
        d = A_inv @ (F * u)
        by_matrix = _by_matrix(np.eye(3), np.broadcast_to(d, (3, 3)))
        jacobian = np.hstack((-A, by_matrix)) / F
        across = jacobian - np.outer(u, u @ jacobian)
        out[k] = math.sqrt(max(float(np.trace(across @ covariance @ across.T)), 0.0))
    return out


def _scatter(samples: FloatArray, h: FloatArray, A: FloatArray, F: float) -> float:
    """Return the RMS distance from the ellipsoid as a share of its radius."""
    return rms(np.linalg.norm((samples - h) @ A, axis=1) / F - 1.0)


def _advice(samples: FloatArray, h: FloatArray, A: FloatArray, F: float) -> str:
    """Return what is covered and what to do, for messages."""
    scatter = _scatter(samples, h, A, F)
    if not scatter <= _SHELL:
        return (
            f"the samples scatter by {100.0 * scatter:.0f} % of its radius, as they do in one "
            "pose: turn the device through all orientations"
        )
    offsets = (samples - h) @ A
    spread = coverage(offsets[np.linalg.norm(offsets, axis=1) > 0.0])
    return f"{spread}: turn the device so that the field comes from there too"


def _refuse_if_loose(
    hard_iron_std: float,
    direction_std: FloatArray,
    hard_iron_limit: float,
    direction_limit: float,
    advice: str,
) -> None:
    hard_iron, direction = 3.0 * hard_iron_std, 3.0 * float(direction_std.max())
    if hard_iron <= hard_iron_limit and direction <= direction_limit:
        return
    raise InputError(
        f"{_WHAT} must know the hard iron to {hard_iron_limit / UT:g} uT and directions to "
        f"{direction_limit / DEG:g} deg (three sigma), the samples give {hard_iron / UT:.2g} uT "
        f"and {direction / DEG:.2g} deg; {advice}."
    )


def _parameters(
    values: FloatArray, covariance: FloatArray, tolerances: Mapping[str, float] | None
) -> Any:
    limits = {n: SCALE_TOLERANCE for n in NAMES[3:6]} if tolerances is None else tolerances
    scales = ("t", "t", "t", "1", "1", "1")
    return parameters_of(
        NAMES[:6], values[:6], covariance[:6, :6], scales, limits, nominal=1.0
    ) + parameters_of(NAMES[6:], values[6:], covariance[6:, 6:], ("1",) * 3, limits)
