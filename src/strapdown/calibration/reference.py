r"""Twelve parameters by linear least squares against a known input.

Model of a triad (scale factors K, misalignment T, bias S_b)::

    y = K inv(T) B + S_b        B = T inv(K) (y - S_b) = C [y; 1]

    T = [[1,    -a_yz,  a_zy],
         [a_xz,     1, -a_zx],
         [-a_xy, a_yx,     1]]

B is the true input in body axes, y the output; ``a_ij`` is the small rotation of the i-th sense
axis about the j-th body axis. The twelve elements of C, 3 x 4, are linear in the data; the
physical parameters follow from them. For a magnetometer the soft iron is part of C.

Which side carries the noise matters. The thesis regresses B on y, (6.14)-(6.16), which shrinks
the scale by the ratio of noise to signal where y is the noisier side, as it is with a
sampled MEMS sensor against encoders: ``noise_in="reference"``. The default regresses y on B and
inverts the result.

References
----------
.. [1] F. Scibona, MSc thesis, Universita di Padova, 2015, sections 6.2-6.5. T has ``-a_yz`` in
       its first row, which (6.3) prints as ``-a_yx``.
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_matrices, as_samples, as_vector, one_of, same_length
from strapdown._types import FloatArray
from strapdown.calibration.least_squares import correlation_length
from strapdown.calibration.record import (
    SENSOR_NAMES,
    SENSOR_UNITS,
    CalibrationRecord,
    parameters_of,
    rms,
)
from strapdown.calibration.sphere import unit_vectors
from strapdown.errors import InputError

NAMES = (
    "k_x", "k_y", "k_z", "b_x", "b_y", "b_z", "a_yz", "a_zy", "a_xz", "a_zx", "a_xy", "a_yx"
)  # fmt: skip
# Tolerances of the scale factors that the makers of MPU-6050 and HMC5883L state.
SCALE_TOLERANCES: Mapping[str, float] = {"gyr": 0.03, "acc": 0.03, "mag": 0.05}
_RANK_TOLERANCE = 1e-6


def against_reference(
    sensor: Literal["gyr", "acc", "mag"],
    samples: ArrayLike,
    reference: ArrayLike,
    *,
    noise_in: Literal["samples", "reference"] = "samples",
    tolerances: Mapping[str, float] | None = None,
    **about: Any,
) -> CalibrationRecord:
    """Calibrate a triad whose true input is known sample by sample.

    Parameters
    ----------
    sensor : {"gyr", "acc", "mag"}
        What is calibrated.
    samples : array_like, shape (n, 3)
        Raw output in SI; rows of NaN are left out.
    reference : array_like, shape (n, 3)
        True input in body axes at the same times, same unit: `body_rates` of encoder angles,
        `body_vectors` of gravity or field.
    noise_in : {"samples", "reference"}
        Which side carries the noise; ``"reference"`` is the thesis's regression.
    tolerances : mapping of str to float, optional
        By parameter or kind (``k``, ``b``, ``a``); default 3 % for the scale factors k of gyro
        and accelerometer, 5 % of the magnetometer.
    **about
        ``sensor_id``, ``date``, ``temp_degc`` of the record.

    Returns
    -------
    CalibrationRecord
        Residuals: corrected samples less the reference, shape (n, 3). `quality` holds their RMS
        per axis before and after, such as ``rms_before_x``.

    Raises
    ------
    InputError
        If there are fewer equations than unknowns, or the input excites too few axes.
    """
    one_of("sensor", sensor, SENSOR_UNITS)
    one_of("noise_in", noise_in, ("samples", "reference"))
    y = as_samples("samples", samples, allow_nan=True)
    B = as_samples("reference", reference, allow_nan=True)
    same_length(samples=y, reference=B)
    good = ~(np.isnan(y).any(axis=1) | np.isnan(B).any(axis=1))
    y, B = y[good], B[good]
    what = f"12-parameter calibration of the {SENSOR_NAMES[sensor]}"
    if len(y) < 4:
        raise InputError(
            f"{what} has 12 unknowns, got {len(y)} samples of 3 equations; give at least 4."
        )
    known, noisy = (B, y) if noise_in == "samples" else (y, B)
    design = np.column_stack((known, np.ones(len(known))))
    _require_excitation(design, what)
    # 3 x 4, rows are axes
    solution = np.asarray(np.linalg.lstsq(design, noisy, rcond=None)[0].T, dtype=np.float64)
    errors = noisy - design @ solution.T
    cofactor = np.linalg.inv(design.T @ design)
    dof = len(design) - 4
    variances = np.array(
        [
            (e @ e) / dof * correlation_length(e) if dof else np.nan
            for e in np.ascontiguousarray(errors.T)
        ]
    )
    linear_covariance = np.kron(np.diag(variances), cofactor)

    def physical(elements: FloatArray) -> FloatArray:
        matrix, bias = _matrix_and_bias(elements.reshape(3, 4), noise_in)
        return physical_parameters(matrix, bias)

    matrix, bias = _matrix_and_bias(solution, noise_in)
    values = physical(solution.ravel())
    jacobian = _numeric_jacobian(physical, solution.ravel())
    covariance = jacobian @ linear_covariance @ jacobian.T
    unit = SENSOR_UNITS[sensor]
    residuals = (y - bias) @ matrix.T - B
    rms_before, rms_after = (np.sqrt(np.mean(r**2, axis=0)) for r in (y - B, residuals))
    return CalibrationRecord(
        sensor=sensor,
        method="reference",
        matrix=matrix,
        bias=bias,
        parameters=parameters_of(
            NAMES,
            values,
            covariance,
            ("1",) * 3 + (unit,) * 3 + ("rad",) * 6,
            {"k": SCALE_TOLERANCES[sensor]} if tolerances is None else tolerances,
            nominal=1.0,
        ),
        covariance=0.5 * (covariance + covariance.T),
        residual_rms=rms(residuals),
        residual_rms_before=rms(y - B),
        equations=3 * len(y),
        dof=3 * dof,
        residuals=residuals,
        residuals_before=y - B,
        history=values[np.newaxis],
        directions=unit_vectors("reference", B[np.linalg.norm(B, axis=1) > 0.0]),
        quality={
            **{f"rms_before_{a}": float(v) for a, v in zip("xyz", rms_before, strict=True)},
            **{f"rms_after_{a}": float(v) for a, v in zip("xyz", rms_after, strict=True)},
        },
        **about,
    )


def physical_parameters(matrix: ArrayLike, bias: ArrayLike) -> FloatArray:
    """Return the twelve physical parameters of ``B = matrix @ (y - bias)``, as `NAMES`.

    Equations (6.11)-(6.12) with ``matrix = T inv(K)``.
    """
    b = as_matrices("matrix", matrix)
    offset = as_vector("bias", bias)
    if b.ndim != 2 or not np.diag(b).all():
        raise ValueError(
            f"`matrix` must have shape (3, 3) and no zero on its diagonal, got {b.tolist()}."
        )
    k_x, k_y, k_z = 1.0 / np.diag(b)
    return np.array(
        [
            k_x, k_y, k_z, *offset,
            -b[0, 1] * k_y, b[0, 2] * k_z,
            b[1, 0] * k_x, -b[1, 2] * k_z,
            -b[2, 0] * k_x, b[2, 1] * k_y,
        ]
    )  # fmt: skip


def correction_from_physical(parameters: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return matrix and bias of twelve physical parameters; undoes `physical_parameters`."""
    values = as_vector("parameters", parameters, 12)
    k_x, k_y, k_z, b_x, b_y, b_z, a_yz, a_zy, a_xz, a_zx, a_xy, a_yx = values
    if not values[:3].all():
        raise ValueError(f"`parameters` must have scale factors, got {values[:3]}.")
    T = np.array([[1.0, -a_yz, a_zy], [a_xz, 1.0, -a_zx], [-a_xy, a_yx, 1.0]])
    return T / [k_x, k_y, k_z], np.array([b_x, b_y, b_z])


def _matrix_and_bias(solution: FloatArray, noise_in: str) -> tuple[FloatArray, FloatArray]:
    """Return the correction from the 3 x 4 solution of either regression."""
    if noise_in == "samples":  # y = M B + b
        return np.asarray(np.linalg.inv(solution[:, :3])), solution[:, 3]
    bias = -np.linalg.solve(solution[:, :3], solution[:, 3])  # B = M y + d
    return solution[:, :3], np.asarray(bias)


def _require_excitation(design: FloatArray, what: str) -> None:
    """Refuse an input that leaves some combination of axes and bias constant."""
    scale = np.linalg.norm(design, axis=0)
    if not (scale > 0.0).all():
        axis = "xyz"[int(np.argmin(scale[:3]))]
        raise InputError(f"{what} must excite all axes, the input along {axis} is always zero.")
    _, singular, right = np.linalg.svd(design / scale, full_matrices=False)
    if singular[-1] <= _RANK_TOLERANCE * singular[0]:
        weights = np.abs(right[-1])
        blurred = [
            name
            for name, w in zip(("x", "y", "z", "bias"), weights, strict=True)
            if w > 0.3 * weights.max()
        ]
        raise InputError(
            f"{what} cannot tell {' and '.join(blurred)} apart, their input keeps a fixed ratio; "
            "move about all three axes, both ways."
        )


def _numeric_jacobian(function: Any, x: FloatArray) -> FloatArray:
    """Return the derivatives of a smooth function by central differences."""
    steps = 1e-6 * np.maximum(np.abs(x), 1e-3)
    columns = []
    for k, step in enumerate(steps):
        shift = np.zeros_like(x)
        shift[k] = step
        columns.append((function(x + shift) - function(x - shift)) / (2.0 * step))
    return np.column_stack(columns)
