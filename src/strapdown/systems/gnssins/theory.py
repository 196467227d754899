"""Chapters 2 and 3: the worked examples of strapdown navigation and of Kalman filters.

None is printed with a result; a formula stands beside what the package computes. Small numbers
that the thesis leaves open are chosen here.
"""

import math
from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0, WGS84_A
from strapdown.kalman.discretise import transition
from strapdown.kalman.information import Information, fuse
from strapdown.kalman.linear import predict, update
from strapdown.kalman.shaping import gauss_markov, wiener
from strapdown.kernels.gnssins.quaternion import step_first_order
from strapdown.navigation import mechanise_plane
from strapdown.rotation import quat_from_rpy, quat_mul, rpy_from_quat
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, simulated
from strapdown.units import DEG

WALKS: Final = 4000
SIGMAS: Final = 4.0
# of a variance over WALKS runs: relative sigma sqrt(2 / n)
SPREAD: Final = Tolerance(relative=SIGMAS * math.sqrt(2.0 / WALKS))
ROUNDING: Final = Tolerance(absolute=1e-9)
SPAN: Final = 200.0  # [s]


def run(seed: int) -> Shown:
    """Go through the examples.

    Parameters
    ----------
    seed : int
        Of the random walks.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    rows = [*_plane(), *_turns(), *_norm(), *_spring(), *_walks(rng), *_fusion()]
    return Shown(rows=rows)


# --- chapter 2 --------------------------------------------------------------------------


def _climb(rate: float, sign: float) -> tuple[FloatArray, ...]:
    """Return times, rate, forces and truth of a curved climb on the meridian; z up is sign 1."""
    t = np.arange(round(SPAN * rate) + 1) / rate
    middle = np.concatenate((t[:1], 0.5 * (t[1:] + t[:-1])))

    def at(s: FloatArray) -> tuple[FloatArray, ...]:
        turn = (500.0 + 270.0 * s / SPAN) / WGS84_A  # of the radius
        z = 1000.0 + 400.0 * np.sin(0.05 * s) + 5.0 * s
        dz, ddz = 20.0 * np.cos(0.05 * s) + 5.0, -np.sin(0.05 * s)
        theta = 0.4 * np.sin(0.03 * s)
        return turn, z, dz, ddz, theta, 0.012 * np.cos(0.03 * s)

    turn, z, dz, ddz, theta, dtheta = at(middle)
    r = WGS84_A + z
    f_x = r * 270.0 / SPAN / WGS84_A + 2.0 * dz * turn
    f_z = sign * (ddz - r * turn**2 + G0)
    c, s = np.cos(theta), np.sin(theta)
    omega, f_xb, f_zb = dtheta + sign * turn, c * f_x - s * f_z, s * f_x + c * f_z
    turn, z, dz, _, theta, _ = at(t)
    truth = np.column_stack((theta, sign * z, (WGS84_A + z) * turn, sign * dz))
    return t, omega, f_xb, f_zb, truth


def _height_error(sign: float, axes: Any) -> float:
    t, omega, f_xb, f_zb, truth = _climb(200.0, sign)
    sol = mechanise_plane(
        t, omega, f_xb, f_zb, axes=axes, gravity=G0, theta=float(truth[0, 0]),
        position=(0.0, truth[0, 1]), velocity=truth[0, 2:],
    )  # fmt: skip
    return float(abs(sol.z[-1] - truth[-1, 1]))


def _plane() -> list[Row]:
    """Return the rows of tables 2.2.1 and 2.2.2."""
    remark = "curved climb, 500 to 770 m/s, 200 s at 200 Hz; no figure is printed"
    still = np.zeros(3)
    rest = mechanise_plane([0.0, 1.0, 2.0], still, still, still - G0, axes="down")
    return [
        compared("table 2.2.2, z down, height error of a box at rest", 0.0,
                 float(abs(rest.z[-1])), "m", ROUNDING, "f_z = -g"),
        not_given("table 2.2.2 as corrected, z up, height error", _height_error(1.0, "up"), "m",
                  remark),
        not_given("table 2.2.2 as corrected, z down, height error", _height_error(-1.0, "down"),
                  "m", remark),
        info("table 2.2.2 as printed, height error", None, _height_error(1.0, "printed"), "m",
             "its signs mix z up and z down"),
        info("2.5, four mechanisations", "agree", "docs/mechanisations.md", "",
             "measured there, pole and Schuler period included"),
    ]  # fmt: skip


def _turns() -> list[Row]:
    """Return the rows of figure 2.6.2: the order of turns, 90 deg each."""
    p, y = quat_from_rpy([0.0, 90.0 * DEG, 0.0]), quat_from_rpy([0.0, 0.0, 90.0 * DEG])
    back = quat_from_rpy([0.0, -90.0 * DEG, 0.0])
    rows = []
    for name, first, last, printed in (
        ("pitch 90, yaw 90, pitch -90", p, back, 90.0),
        ("pitch -90, yaw 90, pitch 90", back, p, -90.0),
    ):
        # about the body's own axes, in turn
        rpy = np.degrees(rpy_from_quat(quat_mul(quat_mul(first, y), last)))
        roll = float(rpy[0]) if np.abs(rpy[1:]).max() < 1e-9 else math.nan
        rows.append(compared(f"figure 2.6.2, {name}, roll", printed, roll, "deg", ROUNDING,
                             "turns about body axes; exact"))  # fmt: skip
    rpy = np.array([20.0, -10.0, 45.0]) * DEG
    off = np.abs(rpy_from_quat(quat_from_rpy(rpy)) - rpy).max()
    rows.append(compared("(2.6.69), (2.6.71) as corrected, there and back", 0.0, float(off), "rad",
                         ROUNDING, "rounding"))  # fmt: skip
    a, b = np.array([1.0, 2.0, 3.0, 4.0]), np.array([5.0, 6.0, 7.0, 8.0])
    off = np.abs(_product(a, b) - np.array([-60.0, 12.0, 30.0, 24.0])).max()
    rows.append(compared("(2.6.24) to (2.6.29), (1, 2, 3, 4)(5, 6, 7, 8)", 0.0, float(off), "1",
                         ROUNDING, "less (-60, 12, 30, 24), worked by hand"))  # fmt: skip
    return rows


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the product of quaternions of any norm, by that of unit ones."""
    norm = float(np.linalg.norm(a) * np.linalg.norm(b))
    return np.asarray(norm * quat_mul(a / np.linalg.norm(a), b / np.linalg.norm(b)))


def _norm() -> list[Row]:
    """Return the rows of 2.8: the norm of an integrated quaternion."""
    rows = []
    for law, name in ((0.0, "without eps"), (2.0, "eps of (2.8.4)"), (1.0, "eps of (7.2.2)")):
        q = (1.0, 0.0, 0.0, 0.0)
        for _ in range(4000):  # 100 s at 40 Hz
            a, b, c, d = q
            q = step_first_order(a, b, c, d, 0.5, -0.3, 0.4, 1.0 / 40.0, law)
        rows.append(not_given(f"2.8, {name}, norm after 100 s less one",
                              math.sqrt(sum(v * v for v in q)) - 1.0, "1",
                              "first order, 0.7 rad/s, 40 Hz"))  # fmt: skip
    return rows


# --- chapter 3 --------------------------------------------------------------------------


def _spring() -> list[Row]:
    """Return the rows of the damped spring, 3.4, and of the chain of integrators, 3.6."""
    damping, spring = 0.4, 4.0
    F = np.array([[0.0, 1.0], [-spring, -damping]])
    root = complex(max(np.linalg.eigvals(F), key=lambda v: v.imag))
    tau, omega = 2.0 / damping, 0.5 * math.sqrt(4.0 * spring - damping**2)
    t = 0.7
    phi = transition(F, t)
    closed = math.exp(-t / tau) * (math.cos(omega * t) + math.sin(omega * t) / (omega * tau))
    chain = transition(np.diag(np.ones(4), 1), t)
    powers = [t**k / math.factorial(k) for k in range(5)]
    return [
        compared("(3.5.6), 1/tau of the damped spring", 1.0 / tau, -root.real, "1/s", ROUNDING,
                 "formula beside eigenvalues of F; m 1 kg, C_d 0.4, C_s 4"),
        compared("(3.5.7), its frequency", omega, root.imag, "rad/s", ROUNDING, "likewise"),
        compared("(3.6.12), its transition over 0.7 s, first element", closed, float(phi[0, 0]),
                 "1", ROUNDING, "closed form beside the matrix exponential"),
        compared("(3.6.7), chain of integrators, largest difference", 0.0,
                 float(np.abs(chain[0] - powers).max()), "1", ROUNDING,
                 "t^k / k! beside the matrix exponential"),
    ]  # fmt: skip


def _walks(rng: np.random.Generator) -> list[Row]:
    """Return the rows of 3.9: random walk and exponentially correlated noise."""
    q, steps, first = 0.04, 100, 1.0
    grown = first + (steps - 1) * q
    walk = wiener(math.sqrt(q), std=math.sqrt(first)).discrete(1.0)
    start = math.sqrt(float(walk.P0[0, 0])) * rng.standard_normal(WALKS)
    drawn = math.sqrt(float(walk.Q[0, 0])) * rng.standard_normal((steps - 1, WALKS))
    ends = start + np.sum(drawn, axis=0)
    dt, tau = 1.0, 10.0
    settled = q / (1.0 - math.exp(-2.0 * dt / tau))  # (3.9.5)
    model = gauss_markov(math.sqrt(settled), tau).discrete(dt)
    phi, noise = float(model.F[0, 0]), math.sqrt(float(model.Q[0, 0]))
    P = np.array([[0.0]])
    for _ in range(400):
        P = predict([0.0], P, model.F, model.Q).P
    x = math.sqrt(settled) * rng.standard_normal(WALKS)
    before = x.copy()
    for _ in range(round(tau / dt)):
        x = phi * x + noise * rng.standard_normal(WALKS)
    lag = float(np.mean(x * before)) / settled
    text = f"mean of {WALKS} runs; {SIGMAS:g} sigma"
    return [
        compared("(3.9.3), Wiener, var_1 + (k - 1) Q for k = 100, propagated", grown,
                 float(_grown(first, q, steps)), "1", ROUNDING, "Q 0.04, var_1 1"),
        simulated("(3.9.3), the same, simulated", grown, float(np.var(ends)), "1", SPREAD, text),
        compared("(3.9.5), Gauss-Markov, Q / (1 - exp(-2 dt / tau))", settled, float(P[0, 0]),
                 "1", ROUNDING, "settled covariance; Q 0.04, dt 1 s, tau 10 s"),
        compared("(3.9.5), Q of the model with that deviation", q, noise**2, "1", ROUNDING,
                 "exact discretisation"),
        simulated("(3.9.5), the same, simulated", settled, float(np.var(x)), "1", SPREAD, text),
        # sigma of a correlation rho over n runs: (1 + rho^2)^(1/2) / sqrt(n) where not normalised
        simulated("(3.9.6), autocovariance after N_c steps, over the variance", math.exp(-1.0),
                  lag, "1", Tolerance(absolute=SIGMAS * math.sqrt(1.14 / WALKS)), text),
    ]  # fmt: skip


def _grown(first: float, q: float, steps: int) -> float:
    """Return the variance of a random walk that the Kalman filter's prediction gives."""
    P = np.array([[first]])
    for _ in range(steps - 1):
        P = predict([0.0], P, [[1.0]], [[q]]).P
    return float(P[0, 0])


def _fusion() -> list[Row]:
    """Return the rows of 3.2: two estimates joined, and the filter's update."""
    x_a, P_a, x_b, P_b = np.array([1.0, -2.0]), np.diag([4.0, 1.0]), 3.0, 0.5
    H = np.array([[1.0, 1.0]])
    seen = Information((H.T @ [x_b / P_b]), H.T @ H / P_b)
    joined = fuse(Information.from_estimate(x_a, P_a), seen)
    by_information = np.linalg.solve(joined.Y, joined.y)
    after = update(x_a, P_a, [x_b], H, [[P_b]])
    off = float(np.abs(by_information - after.x).max())
    return [
        compared("(3.2.6), weighted mean beside the filter's update", 0.0, off, "1", ROUNDING,
                 "a sum of two states is measured: its information is singular"),
        info("3.2, argmax of sin and cos", "pi/2, 0", None, "", "said, nothing to compute"),
        info("3.11.4, extended filter with reset of the error", None, "as in ch. 7", "",
             "part `control-unit`"),
    ]  # fmt: skip


PART: Final = Part(
    name="theory",
    title="Examples of chapters 2 and 3: plane, turns, norm, spring, Wiener, Gauss-Markov",
    source="2.2, 2.6, 2.8, 3.2 to 3.9",
    run=run,
)
