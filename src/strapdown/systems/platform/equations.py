"""Chapter 7 and 8.1.1: transition, process noise and measurement models of the filter.

The thesis prints formulas without figures; the kernel's own are compared with matrix exponentials,
integrals and differences, and the printed misprints with what they stand for.
"""

from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.attitude import IndirectEkf
from strapdown.kernels import indirect_ekf as kernel
from strapdown.kernels.mekf import W_A, W_B
from strapdown.rotation import dcm_from_rotvec
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given
from strapdown.systems.platform import bench
from strapdown.units import DEG, DPS

DT: Final = 0.01
RATE: Final = np.array([20.0, -25.0, 24.0]) * DPS  # 40 deg/s, the largest of 8.1.1
N: Final = 8.2e-3 * DPS  # mean of table 5.3
K: Final = 1.2e-4 * DPS


def run(seed: int) -> Shown:
    """Compare the formulas with what they stand for.

    Parameters
    ----------
    seed : int
        Nothing is drawn.

    Returns
    -------
    Shown
    """
    return Shown(rows=[*_transition(), *_noise(), *_vectors(), *_start()])


# --- the formulas -------------------------------------------------------------------------


def transition(turn: FloatArray, dt: float, *, truncated: bool = False) -> FloatArray:
    """Return Phi of a turn in one step, (7.22) to (7.24) or (8.1), (8.2), as the kernel has it.

    Parameters
    ----------
    turn : ndarray, shape (3,)
        Rotation vector of the body in the step [rad].
    dt : float
        Length of the step [s].
    truncated : bool
        Whether v2 is asked for.

    Returns
    -------
    ndarray, shape (6, 6)
    """
    w = np.zeros(kernel.W_SIZE)
    x, y, z = map(float, turn)
    if truncated:
        kernel.transition_truncated(w, x, y, z, dt)
    else:
        f2, f3, _, _ = kernel.coefficients(float(turn @ turn))
        kernel.transition_exact(w, x, y, z, dt, f2, f3)
    Phi = np.eye(6)
    Phi[:3, :3] = w[W_A : W_A + 9].reshape(3, 3)
    Phi[:3, 3:] = w[W_B : W_B + 9].reshape(3, 3)
    return Phi


def noise(
    turn: FloatArray, dt: float, n: float, k: float, *, truncated: bool = False
) -> FloatArray:
    """Return Q_d, (7.26) to (7.29) corrected or (8.3) to (8.5), as the kernel has it.

    Parameters
    ----------
    turn, dt
        See `transition`.
    n, k : float
        Densities of rate noise and random walk.
    truncated : bool
        Whether v2 is asked for.

    Returns
    -------
    ndarray, shape (6, 6)
    """
    Q = np.zeros((6, 6))
    f3 = f4 = f5 = 0.0
    if not truncated:
        _, f3, f4, f5 = kernel.coefficients(float(turn @ turn))
    x, y, z = map(float, turn)
    kernel.add_noise(Q, x, y, z, dt, n * n, k * k, f3, f4, f5)
    return Q


def skew(v: FloatArray) -> FloatArray:
    """Return the matrix of the cross product with v, (3.14)."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _continuous(rate: FloatArray) -> FloatArray:
    """Return F_c of (7.16)."""
    F = np.zeros((6, 6))
    F[:3, :3], F[:3, 3:] = -skew(rate), -np.eye(3)
    return F


def _integral(rate: FloatArray, dt: float, n: float, k: float) -> FloatArray:
    """Return (7.25) by Van Loan's exponential."""
    from scipy.linalg import expm

    F, Q = _continuous(rate), np.diag([n * n] * 3 + [k * k] * 3)
    big = np.zeros((12, 12))
    big[:6, :6], big[:6, 6:], big[6:, 6:] = -F, Q, F.T
    found = expm(big * dt)
    return np.asarray(found[6:, 6:].T @ found[:6, 6:])


# --- rows ---------------------------------------------------------------------------------


def _transition() -> list[Row]:
    from scipy.linalg import expm

    rows = []
    for dt, what in ((DT, "10 ms"), (1.0, "1 s")):
        exact = transition(RATE * dt, dt)
        off = float(np.abs(exact - expm(_continuous(RATE) * dt)).max())
        rows.append(
            compared(
                f"(7.22) to (7.24), 40 deg/s over {what}: difference from exp(F_c dt)", 0.0, off,
                "", Tolerance(absolute=2e-15), "rounding",
            )
        )  # fmt: skip
    v2 = transition(RATE * DT, DT, truncated=True)
    rows.append(
        not_given(
            "(8.1), (8.2), 40 deg/s over 10 ms: difference of v2 from v1",
            float(np.abs(v2 - transition(RATE * DT, DT)).max()), "",
            "half of the square of 0.4 deg is 2.4e-5",
        )
    )  # fmt: skip
    return rows


def _noise() -> list[Row]:
    """Return Q_d against its integral, as corrected and as printed."""
    rows = []
    for dt, n, k, what in ((DT, N, K, "10 ms, table 5.3"), (0.5, 0.3, 0.7, "0.5 s, K = 0.7")):
        rate = RATE * (1.0 if dt == DT else 2.0)
        want = _integral(rate, dt, n, k)
        off = noise(rate * dt, dt, n, k) - want
        scale = np.sqrt(np.outer(np.diag(want), np.diag(want)))
        rows.append(
            compared(
                f"(7.27) to (7.29) corrected, {what}: difference from the integral (7.25)", 0.0,
                float(np.abs(off / scale).max()), "", Tolerance(absolute=1e-9),
                "relative to the variances; found to agree to 1e-9 once before",
            )
        )  # fmt: skip
    dt, n, k = 0.5, 0.3, 0.7
    rate = 2.0 * RATE
    want = _integral(rate, dt, n, k)
    printed = noise(rate * dt, dt, n, k)
    _, f3, _, _ = kernel.coefficients(float(rate @ rate) * dt * dt)
    # the term of [w x] in (7.28), whose sign is printed wrong
    printed[:3, 3:] -= 2.0 * k * k * dt**3 * f3 * skew(rate)
    rows.append(
        info(
            "(7.28) with the printed sign of [w x]: relative error of Q12, 0.5 s", None,
            float(np.abs((printed - want)[:3, 3:]).max() / np.abs(want[:3, 3:]).max()), "",
            "misprint; at 10 ms it is hidden by N",
        )
    )  # fmt: skip
    v2 = noise(RATE * DT, DT, N, K, truncated=True)
    v1 = noise(RATE * DT, DT, N, K)
    rows.append(
        not_given(
            "(8.3) to (8.5), 40 deg/s over 10 ms: largest relative difference of v2 from v1",
            float(np.abs(v2 - v1).max() / np.abs(v1[:3, 3:]).max()), "", "relative to Q12",
        )
    )  # fmt: skip
    return rows


def _vectors() -> list[Row]:
    """Return H of (7.39) against differences, for both reference vectors."""
    rows = []
    turn = np.array([0.4, -0.7, 1.1])
    field = np.array(bench.FIELD_G)
    for name, v_n in (("N_a", np.array([0.0, 0.0, -1.0])), ("N_h", field)):
        seen = dcm_from_rotvec(turn).T @ v_n
        h = 1e-6
        difference = np.column_stack(
            [
                (dcm_from_rotvec(turn) @ (dcm_from_rotvec(h * e) - dcm_from_rotvec(-h * e))).T
                @ v_n
                / (2.0 * h)
                for e in np.eye(3)
            ]
        )
        rows.append(
            compared(
                f"(7.39), H = [C_bn {name} x] against differences: largest difference", 0.0,
                float(np.abs(skew(seen) - difference).max()), "", Tolerance(absolute=1e-9),
                "central differences of 1e-6 rad lose ten digits",
            )
        )  # fmt: skip
    return rows


def _start() -> list[Row]:
    """Return the two initial covariances, (7.41) and (7.43)."""
    ground, orbit = IndirectEkf.terrestrial(), IndirectEkf.space()
    one = Tolerance(absolute=1e-12)
    return [
        compared("(7.41), terrestrial, P_0 of attitude", 1.0, ground.std_tilt**2, "", one,
                 "I6; printed as I3"),
        compared("(7.41), terrestrial, P_0 of bias", 1.0, ground.std_gyr_bias**2, "", one,
                 "I6; printed as I3"),
        not_given("(7.43), space, initial deviation of attitude", orbit.std_tilt / DEG, "deg",
                  "1e7 N² dt at 100 Hz: a reading that is 'clearly lower' than I"),
        not_given("(7.43), space, initial deviation of the bias", orbit.std_gyr_bias / DPS,
                  "deg/s", "1e5 K² dt at 100 Hz"),
        info("(7.54), correction beyond half a turn", "√(1 - dq²)", "√(1 + dq²)", "",
             "misprint: where it is used, beyond dq² = 1, the printed root is imaginary"),
    ]  # fmt: skip


PART = Part(
    name="equations",
    title="Filter: transition, process noise, measurement models",
    source="7.4 to 7.7, 8.1.1",
    run=run,
)
