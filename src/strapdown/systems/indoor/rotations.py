"""Section 4.1: the printed rotation matrices and angles, and where they are misprinted."""

from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.rotation import dcm_from_quat, dcm_from_rpy, quat_from_rpy, rpy_from_quat
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given
from strapdown.units import DEG

YPR_DEG: Final = (40.0, 20.0, -30.0)
ROUNDING: Final = Tolerance(absolute=2e-15)


def run(seed: int) -> Shown:
    """Compare the printed formulas with the rotations here.

    Parameters
    ----------
    seed : int
        Of the attitudes.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng([seed, 41])
    rpy = rng.uniform(-1.4, 1.4, (500, 3))
    q = quat_from_rpy(rpy)
    lock = np.column_stack((rpy[:, 0], np.full(500, np.pi / 2.0), rpy[:, 2]))
    C_nb, C_bn = dcm_from_quat(q), dcm_from_quat(q).transpose(0, 2, 1)
    yaw, pitch, roll = YPR_DEG
    one = quat_from_rpy(np.array([roll, pitch, yaw]) * DEG)
    rows: list[Row] = [
        _same("(4.6), product of the three rotations", matrix_46(rpy), C_nb),
        _same("(4.7), gimbal lock at pitch 90 deg", matrix_47(lock), dcm_from_rpy(lock)),
        _same("(4.9), corrected to + q4² in (1, 1), scalar last", matrix_49(q, 1.0), C_bn),
        _same("(4.17), R_n^b", matrix_49(q, 1.0), C_bn),
        info(
            "(4.9) as printed, departure from a rotation",
            None,
            _departure(matrix_49(q, -1.0)),
            "",
            "misprint: - q4² in (1, 1)",
        ),
    ]  # fmt: skip
    for name, wanted, here in zip(("yaw", "pitch", "roll"), YPR_DEG, angles_410(one), strict=True):
        rows.append(
            not_given(
                f"(4.10) to (4.12), factor 2 and arc sine put right, {name} of {wanted:g} deg",
                float(here),
                "deg",
                "not the angle of the filter's quaternion but of its conjugate",
            )
        )
    conjugate = angles_410(one * [1.0, -1.0, -1.0, -1.0])
    rows.append(
        compared(
            "(4.10) to (4.12) of the conjugate: largest difference from 40/20/-30 deg", 0.0,
            float(np.abs(conjugate - YPR_DEG).max()), "deg", Tolerance(absolute=1e-12),
            "rounding of degrees",
        )
    )  # fmt: skip
    back = rpy_from_quat(one)[::-1] / DEG
    rows.append(
        compared(
            "quat2angle, as A.1.7 uses it: largest difference from 40/20/-30 deg", 0.0,
            float(np.abs(back - YPR_DEG).max()), "deg", Tolerance(absolute=1e-12),
            "rounding of degrees",
        )
    )  # fmt: skip
    return Shown(rows=rows)


def _same(item: str, printed: FloatArray, here: FloatArray) -> Row:
    return compared(
        f"{item}: largest difference", 0.0, float(np.abs(printed - here).max()), "", ROUNDING,
        "rounding of sums of products, 9 eps; 500 random attitudes",
    )  # fmt: skip


def _departure(C: FloatArray) -> float:
    return float(np.abs(C @ C.transpose(0, 2, 1) - np.eye(3)).max())


def matrix_46(rpy: FloatArray) -> FloatArray:
    """Return (4.6) as printed, shape (n, 3, 3)."""
    (sf, st, sp), (cf, ct, cp) = np.sin(rpy.T), np.cos(rpy.T)
    return _stacked(
        (cp * ct, cp * st * sf - sp * cf, cp * st * cf + sp * sf),
        (sp * ct, sp * st * sf + cp * cf, sp * st * cf - cp * sf),
        (-st, ct * sf, ct * cf),
    )


def matrix_47(rpy: FloatArray) -> FloatArray:
    """Return (4.7) as printed, of roll and yaw at a pitch of 90 deg, shape (n, 3, 3)."""
    turn = rpy[:, 0] - rpy[:, 2]
    zero, one = np.zeros(len(rpy)), np.ones(len(rpy))
    return _stacked(
        (zero, np.sin(turn), np.cos(turn)), (zero, np.cos(turn), -np.sin(turn)), (-one, zero, zero)
    )


def matrix_49(q: FloatArray, sign: float) -> FloatArray:
    """Return (4.9) of quaternions, scalar first, with this sign of q4² in (1, 1)."""
    w, x, y, z = q.T  # scalar last there: q1 q2 q3 = x y z, q4 = w
    return _stacked(
        (x * x - y * y - z * z + sign * w * w, 2 * (x * y + z * w), 2 * (x * z - y * w)),
        (2 * (y * x - z * w), -x * x + y * y - z * z + w * w, 2 * (y * z + x * w)),
        (2 * (z * x + y * w), 2 * (z * y - x * w), -x * x - y * y + z * z + w * w),
    )


def angles_410(q: FloatArray) -> FloatArray:
    """Return yaw, pitch, roll [deg] of (4.10) to (4.12), with 2 q2², 2 q4² and the arc sine."""
    q1, q2, q3, q4 = q
    return (
        np.array(
            [
                np.arctan2(2 * q2 * q3 - 2 * q1 * q4, 2 * q1 * q1 + 2 * q2 * q2 - 1),
                -np.arcsin(2 * q2 * q4 + 2 * q1 * q3),
                np.arctan2(2 * q3 * q4 - 2 * q1 * q2, 2 * q1 * q1 + 2 * q4 * q4 - 1),
            ]
        )
        / DEG
    )


def _stacked(*rows: tuple[FloatArray, ...]) -> FloatArray:
    """Return matrices, shape (n, 3, 3), from rows of elements."""
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


PART = Part(
    name="rotations",
    title="Printed rotations: (4.6) to (4.12), (4.17)",
    source="4.1",
    run=run,
)
