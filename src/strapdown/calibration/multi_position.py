r"""Modified multi-position calibration: the norm is known, the orientation is not.

A triad at rest measures gravity, one on a rate table the table's rate. The magnitude of
both is known whatever the orientation, so each position gives one equation, and well-spread
positions give bias, scale factors and non-orthogonality without any levelling or angle
reading. The x axis of the corrected frame is the sensor's own x axis::

    l = S a + b,    S = [[1 + s_x,          0,       0],
                         [-theta_yz,  1 + s_y,       0],
                         [theta_zy, -theta_zx, 1 + s_z]]
    |a_i|^2 - |reference_i|^2 = 0,    a_i = inv(S) (l_i - b)

theta_yz is the rotation of the sensor's y axis about z, theta_zx and theta_zy those of its z
axis about x and y [rad].

The equations are divided by twice the reference, so that each residual is the error of the
norm in the sensor's unit, and positions at different rates count with their noise.
``variant="thesis"`` solves them as the program in [1]_ does: not divided, 50 full steps, its
derivatives by the scale factors, which are too large by ``(1 + s)^4``, and a variance
factor that is not divided by the degrees of freedom. The estimates of both agree where all
references are equal; the covariances differ.

References
----------
.. [1] A. Trecroci, PhD thesis, Universita della Calabria, 2010, sections 6.2-6.3 and the
       appendix to chapter 6. The places of theta_zx and theta_zy in S follow the program;
       (6.2.7) prints them exchanged.
.. [2] Z. F. Syed, P. Aggarwal, C. Goodall, X. Niu, N. El-Sheimy, "A new multi-position
       calibration method for MEMS inertial navigation systems", Meas. Sci. Technol. 18, 2007.
"""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from strapdown._checks import as_samples, as_series, as_vector, one_of, positive
from strapdown._types import FloatArray
from strapdown.calibration.least_squares import MAX_ITERATIONS, Solution, gauss_newton
from strapdown.calibration.record import (
    SENSOR_NAMES,
    SENSOR_UNITS,
    CalibrationRecord,
    parameters_of,
    require_poses,
    rms,
)
from strapdown.calibration.sphere import coverage, unit_vectors
from strapdown.constants import G0
from strapdown.errors import InputError

Variant = Literal["exact", "thesis"]

NAMES = ("b_x", "b_y", "b_z", "s_x", "s_y", "s_z", "theta_yz", "theta_zx", "theta_zy")
SCALE_TOLERANCE = 0.03  # of the MPU-6050's gyroscope and accelerometer, by its datasheet
_ADVICE = "spread the poses over the whole sphere, each axis up, down and tilted"


def distortion_matrix(x: ArrayLike) -> FloatArray:
    """Return S of the nine parameters, in the order of `NAMES`."""
    _, _, _, s_x, s_y, s_z, theta_yz, theta_zx, theta_zy = as_vector("x", x, 9)
    # fmt: off
    return np.array([
        [1.0 + s_x,        0.0,       0.0],
        [-theta_yz,  1.0 + s_y,       0.0],
        [ theta_zy,  -theta_zx, 1.0 + s_z],
    ])
    # fmt: on


def accelerometer_from_poses(
    means: ArrayLike,
    gravity: float = G0,
    *,
    std: float | None = None,
    variant: Variant = "exact",
    tolerances: Mapping[str, float] | None = None,
    **about: Any,
) -> CalibrationRecord:
    """Calibrate an accelerometer from its means in poses of unknown orientation.

    Parameters
    ----------
    means : array_like, shape (n, 3)
        Mean specific force of each pose at rest [m/s^2]; at least 9 poses, better 24.
    gravity : float
        Local gravity [m/s^2]. Its relative error goes into all scale factors; take it from
        `strapdown.earth.normal_gravity`.
    std : float, optional
        Standard deviation of the mean of one axis in one pose [m/s^2], such as
        ``poses.acc_std`` states. The sigmas come from it or from the residuals, whichever is
        larger; without it there must be more poses than unknowns.
    variant : {"exact", "thesis"}
        See the module.
    tolerances : mapping of str to float, optional
        By parameter or kind (``b``, ``s``, ``theta``); default 3 % for the scale factors.
    **about
        ``sensor_id``, ``date``, ``temp_degc`` of the record.

    Returns
    -------
    CalibrationRecord
        Residuals: norm of each corrected mean less gravity [m/s^2].

    Raises
    ------
    InputError
        If there are fewer poses than unknowns, or they cannot tell the unknowns apart.
    NotConverged
        If the means are far from a sphere of this radius.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> true = rng.standard_normal((39, 3))
    >>> true *= G0 / np.linalg.norm(true, axis=1, keepdims=True)
    >>> record = accelerometer_from_poses(true * 1.01 + [0.1, 0.2, -0.3])
    >>> record.bias.round(6).tolist()
    [0.1, 0.2, -0.3]
    """
    means = as_samples("means", means)
    references = np.full(len(means), positive("gravity", gravity))
    return _calibrate("acc", means, references, std, variant, tolerances, about)


def gyro_from_rate_table(
    means: ArrayLike,
    rates: ArrayLike,
    *,
    std: float | None = None,
    variant: Variant = "exact",
    tolerances: Mapping[str, float] | None = None,
    **about: Any,
) -> CalibrationRecord:
    """Calibrate a gyroscope from its means on a rate table, orientations unknown.

    Parameters
    ----------
    means : array_like, shape (n, 3)
        Mean angular rate of each position [rad/s].
    rates : array_like, shape (n,)
        Rate of the table in each position [rad/s]; its sign does not matter. Rate zero says
        that the table stands: such a row gives three equations, for the bias alone. The
        Earth's rate, 0.004 deg/s, is left out.
    std : float, optional
        Standard deviation of the mean of one axis in one position [rad/s]. The sigmas come
        from it or from the residuals, whichever is larger.
    variant : {"exact", "thesis"}
        See the module.
    tolerances : mapping of str to float, optional
        By parameter or kind (``b``, ``s``, ``theta``); default 3 % for the scale factors.
    **about
        ``sensor_id``, ``date``, ``temp_degc`` of the record.

    Returns
    -------
    CalibrationRecord
        Residuals: norm of each corrected mean less the table's rate [rad/s].

    Raises
    ------
    InputError
        If there are fewer positions than unknowns, or they cannot tell the unknowns apart.
    NotConverged
        If the means are far from spheres of these radii.
    """
    means = as_samples("means", means)
    references = np.abs(as_series("rates", rates, len(means)))
    one_of("variant", variant, ("exact", "thesis"))
    if variant == "thesis" and not references.all():
        raise InputError("`rates` must not be zero in the variant 'thesis'; leave such rows out.")
    return _calibrate("gyr", means, references, std, variant, tolerances, about)


def _calibrate(
    sensor: str,
    means: FloatArray,
    references: FloatArray,
    std: float | None,
    variant: str,
    tolerances: Mapping[str, float] | None,
    about: Mapping[str, Any],
) -> CalibrationRecord:
    one_of("variant", variant, ("exact", "thesis"))
    what = f"multi-position calibration of the {SENSOR_NAMES[sensor]}"
    turning = references > 0.0
    require_poses(int(np.count_nonzero(turning)), 6, what + " (scale factors and angles)", _ADVICE)
    equations = int(np.count_nonzero(turning)) + 3 * int(np.count_nonzero(~turning))
    require_poses(equations, len(NAMES), what, _ADVICE)

    if variant == "thesis":
        solution = _thesis_solution(means, references, what)
        covariance = solution.cofactor * (solution.residuals @ solution.residuals)
        residuals = solution.residuals / (2.0 * references)
    else:
        size = float(np.max(references))
        solution = gauss_newton(
            lambda x: _model(x, means, references),
            np.zeros(9),
            np.array([size] * 3 + [1.0] * 6),
            NAMES,
            what=what,
            advice=_ADVICE,
        )
        covariance = solution.covariance(None if std is None else positive("std", std))
        residuals = solution.residuals
    S = distortion_matrix(solution.x)
    if not ((np.diag(S) > 0.5) & (np.diag(S) < 2.0)).all():
        raise InputError(
            f"{what} must find scale factors near 1, got {np.diag(S).round(3).tolist()}; check "
            f"units and reference, or {_ADVICE}."
        )
    corrected = np.linalg.solve(S, (means - solution.x[:3]).T).T
    spread = coverage(corrected[turning])
    before = np.concatenate(
        (np.linalg.norm(means[turning], axis=1) - references[turning], *means[~turning].T)
    )
    unit = SENSOR_UNITS[sensor]
    return CalibrationRecord(
        sensor=sensor,
        method="multi-position" + (" (thesis)" if variant == "thesis" else ""),
        matrix=np.asarray(np.linalg.inv(S)),
        bias=solution.x[:3],
        parameters=parameters_of(
            NAMES,
            solution.x,
            covariance,
            (unit,) * 3 + ("1",) * 3 + ("rad",) * 3,
            {"s": SCALE_TOLERANCE} if tolerances is None else tolerances,
        ),
        covariance=covariance,
        residual_rms=rms(residuals),
        residual_rms_before=rms(before),
        equations=equations,
        dof=solution.dof,
        residuals=residuals,
        residuals_before=before,
        history=solution.history,
        directions=unit_vectors("corrected", corrected[turning]),
        reference=float(references[0]) if np.ptp(references) == 0.0 else None,
        quality={
            "coverage": spread.fraction,
            "largest_hole_deg": float(np.degrees(spread.hole)),
            "condition": solution.condition,
            "iterations": float(len(solution.history) - 1),
        },
        **about,
    )


def _model(
    x: FloatArray, means: FloatArray, references: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return residuals in the sensor's unit and their exact derivatives."""
    S_inv = np.linalg.inv(distortion_matrix(x))
    a = (means - x[:3]) @ S_inv.T
    turning = references > 0.0
    a_t, reference = a[turning], references[turning]
    residuals = (np.einsum("ij,ij->i", a_t, a_t) - reference**2) / (2.0 * reference)
    jacobian = _slopes(a_t, a_t @ S_inv) / reference[:, np.newaxis]
    if turning.all():
        return residuals, jacobian
    # A standing table: all three components of `a` are zero.
    still = a[~turning]
    rows = [_slopes(still, np.broadcast_to(axis, still.shape)) for axis in S_inv]
    return (
        np.concatenate((residuals, *still.T)),
        np.concatenate((jacobian, *rows)),
    )


def _slopes(a: FloatArray, u: FloatArray) -> FloatArray:
    """Return the derivatives of ``w . a`` by the nine parameters, ``u = inv(S)^T w``.

    From ``da = -inv(S) (db + dS a)``.
    """
    u_x, u_y, u_z = u.T
    a_x, a_y, a_z = a.T
    return np.column_stack(
        (-u_x, -u_y, -u_z, -u_x * a_x, -u_y * a_y, -u_z * a_z, u_y * a_x, u_z * a_y, -u_z * a_x)
    )


def _thesis_solution(means: FloatArray, references: FloatArray, what: str) -> Solution:
    """Return the solution of the program in [1]_: a fixed number of full steps."""
    x = np.zeros(9)
    history = [x]
    for _ in range(MAX_ITERATIONS):
        residuals, jacobian = _model(x, means, references)
        weights = 2.0 * references
        residuals, jacobian = residuals * weights, jacobian * weights[:, np.newaxis]
        jacobian[:, 3:6] *= (1.0 + x[3:6]) ** 4
        normal = jacobian.T @ jacobian
        if not np.linalg.cond(normal) < 1e20:
            raise InputError(f"{what} has singular normal equations; {_ADVICE}.")
        x = x - np.linalg.solve(normal, jacobian.T @ residuals)
        history.append(x)
    return Solution(
        x=x,
        cofactor=np.asarray(np.linalg.inv(normal)),
        residuals=residuals,
        history=np.array(history),
        condition=float(np.sqrt(np.linalg.cond(normal))),
    )
