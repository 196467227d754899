"""Printed formulas beside this package: sensor relations, rotations, gimbal lock, quaternions.

Formulas are typed as the thesis prints them, misprints corrected where a row says so, and
compared with the functions of `strapdown.rotation` at random arguments.
"""

import math
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.report import page
from strapdown.report.figures import Panel, Series, grid_figure
from strapdown.rotation import (
    dcm_from_quat,
    dcm_from_rotvec,
    dcm_from_rpy,
    quat_conj,
    quat_from_rotvec,
    quat_from_rpy,
    quat_mul,
    rotate,
    rpy_from_quat,
)
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info
from strapdown.units import DEG

ROUNDING: Final = Tolerance(absolute=4e-15)
ROUNDING_REMARK: Final = "largest difference over 1000 random cases; tolerance: rounding"
CASES: Final = 1000


def run(seed: int) -> Shown:
    """Compare the formulas.

    Parameters
    ----------
    seed : int
        Of the arguments.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    rows = [*_sensors(rng), *_euler(rng), *_gimbal_lock(rng), *_quaternions(rng), *_printed()]
    return Shown(rows=[*rows, *_kinematics(rng)], blocks=(_step_figure(),))


# --- sensors ----------------------------------------------------------------------------

MASS, SPRING, DAMPING = 2.0e-9, 8.0, 1.8e-4  # [kg], [N/m], [N s/m]: about 10 kHz, damping 0.7


def _step_response() -> tuple[FloatArray, FloatArray]:
    """Return time [s] and deflection [m] after a step of 1 m/s^2 of figure 2's model."""
    from scipy.signal import lti, step

    model = lti([1.0], [1.0, DAMPING / MASS, SPRING / MASS])
    t, x = step(model, T=np.linspace(0.0, 1e-3, 2001))
    return np.asarray(t), np.asarray(x)


def _sensors(rng: np.random.Generator) -> list[Row]:
    settled = float(_step_response()[1][-1])
    return [
        compared("item 12, mass, spring, damper: static gain M / K", MASS / SPRING, settled, "s^2",
                 Tolerance(relative=1e-9), "step response after 1 ms; M, K, D are chosen here"),
        compared("item 13, Coriolis force: |-2 w x v less acceleration seen in turning axes|", 0.0,
                 _coriolis(rng), "m/s^2", Tolerance(absolute=1e-6),
                 "second difference over 1 ms: the mass passes the axis at up to 1 m/s"),
        info("item 13, Hall and induction relations", "(1), V = -n A dB/dt", None, "",
             "definitions: nothing is computed"),
    ]  # fmt: skip


def _coriolis(rng: np.random.Generator) -> float:
    """Return how far (2.3) is from the motion of a free mass seen in turning axes."""
    omega, v, h = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 3), 1e-3
    seen = [dcm_from_rotvec(-omega * t) @ (v * t) for t in (-h, 0.0, h)]
    acceleration = (seen[0] - 2.0 * seen[1] + seen[2]) / h**2
    return float(np.abs(acceleration + 2.0 * np.cross(omega, v)).max())


def _step_figure() -> page.Block:
    t, x = _step_response()
    static = np.full(2, 1e9 * MASS / SPRING)
    items = [
        Series(x=1e3 * t[[0, -1]], y=static, name="M / K", color="#5b6470", dash="dot"),
        Series(x=1e3 * t, y=1e9 * x, name="deflection"),
    ]
    panel = Panel(y_label="x [nm]", items=items, x_label="time [ms]", height=200)
    return page.plot(
        grid_figure([panel]), "Figure 2: answer of mass, spring and damper to 1 m/s^2."
    )


# --- Euler angles -----------------------------------------------------------------------


def _printed_matrix(rpy: FloatArray) -> FloatArray:
    """Return (6)."""
    (c1, c2, c3), (s1, s2, s3) = np.cos(rpy), np.sin(rpy)  # roll, pitch, yaw
    # fmt: off
    return np.array([
        [c3 * c2, c3 * s2 * s1 - s3 * c1, s3 * s1 + c3 * s2 * c1],
        [s3 * c2, s3 * s2 * s1 + c3 * c1, s3 * s2 * c1 - c3 * s1],
        [-s2, c2 * s1, c2 * c1],
    ])
    # fmt: on


def _rpy(rng: np.random.Generator) -> FloatArray:
    return rng.uniform([-np.pi, -0.5 * np.pi, -np.pi], [np.pi, 0.5 * np.pi, np.pi], (CASES, 3))


def _euler(rng: np.random.Generator) -> list[Row]:
    rpy = _rpy(rng)
    off = max(float(np.abs(_printed_matrix(row) - dcm_from_rpy(row)).max()) for row in rpy)
    return [compared("(6), matrix of yaw, pitch, roll", 0.0, off, "1", ROUNDING, ROUNDING_REMARK)]


def _gimbal_lock(rng: np.random.Generator) -> list[Row]:
    """Return the rows of (7): at a pitch of 90 deg, roll and yaw are one angle."""
    rpy = _rpy(rng)
    rpy[:, 1] = 0.5 * np.pi
    phi, psi = rpy[:, 0], rpy[:, 2]
    s, c, zero = np.sin(phi - psi), np.cos(phi - psi), np.zeros(CASES)
    printed = np.array([[zero, s, c], [zero, c, -s], [zero - 1.0, zero, zero]])
    off = float(np.abs(np.moveaxis(printed, 2, 0) - dcm_from_rpy(rpy)).max())
    other = rpy + np.array([1.0, 0.0, 1.0]) * rng.uniform(-1.0, 1.0, (CASES, 1))
    same = float(np.abs(dcm_from_rpy(other) - dcm_from_rpy(rpy)).max())
    # degrees of freedom: rank of the derivative of the attitude by the three angles
    ranks = [_freedom(0.4, pitch, -0.7) for pitch in (0.3, 0.5 * math.pi)]
    return [
        compared("(7), matrix at a pitch of 90 deg", 0.0, off, "1", ROUNDING, ROUNDING_REMARK),
        compared("item 18, same phi - psi, other phi: change of the matrix", 0.0, same, "1",
                 ROUNDING, ROUNDING_REMARK),
        compared("item 18, degrees of freedom at a pitch of 17 deg", 3.0, ranks[0], "1",
                 Tolerance(), "rank of the attitude's derivative by the three angles"),
        compared("item 18, degrees of freedom at a pitch of 90 deg", 2.0, ranks[1], "1",
                 Tolerance(), "one is lost: gimbal lock"),
    ]  # fmt: skip


def _freedom(roll: float, pitch: float, yaw: float) -> float:
    at, h = np.array([roll, pitch, yaw]), 1e-5
    columns = [
        ((dcm_from_rpy(at + h * e) - dcm_from_rpy(at - h * e)) / (2.0 * h)).ravel()
        for e in np.eye(3)
    ]
    return float(np.linalg.matrix_rank(np.array(columns), tol=1e-6))


# --- quaternions ------------------------------------------------------------------------


def _printed_product(q: FloatArray, p: FloatArray) -> FloatArray:
    """Return (11)."""
    q1, q2, q3, q4 = q.T
    p1, p2, p3, p4 = p.T
    return np.stack(
        (
            q1 * p1 - q2 * p2 - q3 * p3 - q4 * p4,
            q1 * p2 + q2 * p1 + q3 * p4 - q4 * p3,
            q1 * p3 - q2 * p4 + q3 * p1 + q4 * p2,
            q1 * p4 + q2 * p3 - q3 * p2 + q4 * p1,
        ),
        axis=-1,
    )


def _printed_frames(q: FloatArray) -> FloatArray:
    """Return (20), of one quaternion."""
    q1, q2, q3, q4 = q
    # fmt: off
    return 2.0 * np.array([
        [q1 * q1 + q2 * q2 - 0.5, q2 * q3 + q1 * q4, q2 * q4 - q1 * q3],
        [q2 * q3 - q1 * q4, q1 * q1 + q3 * q3 - 0.5, q3 * q4 + q1 * q2],
        [q2 * q4 + q1 * q3, q3 * q4 - q1 * q2, q1 * q1 + q4 * q4 - 0.5],
    ])
    # fmt: on


def _units(rng: np.random.Generator) -> FloatArray:
    q = rng.standard_normal((CASES, 4))
    return np.asarray(q / np.linalg.norm(q, axis=1, keepdims=True))


def _quaternions(rng: np.random.Generator) -> list[Row]:
    q, p = _units(rng), _units(rng)
    v = rng.uniform(-1.0, 1.0, (CASES, 3))
    axis = v / np.linalg.norm(v, axis=1, keepdims=True)
    angle = rng.uniform(0.0, np.pi, (CASES, 1))
    versor = np.hstack((np.cos(0.5 * angle), axis * np.sin(0.5 * angle)))
    frames = np.array([_printed_frames(row) for row in q])
    differences = {
        "(11), product": _printed_product(q, p) - quat_mul(q, p),
        "(13), inverse of a unit quaternion": quat_mul(q, quat_conj(q)) - [1.0, 0.0, 0.0, 0.0],
        "(14), cosine and sine of half the angle": versor - quat_from_rotvec(angle * axis),
        "(15), rotation by (14) about its axis": rotate(versor, p[:, 1:])
        - np.einsum("kij,kj->ki", dcm_from_rotvec(angle * axis), p[:, 1:]),
        "proposition 3.3.3 as corrected, L_p(L_q(v)) = L_pq(v)": rotate(p, rotate(q, v))
        - rotate(quat_mul(p, q), v),
        "(20), the transpose of C(q)": np.swapaxes(frames, 1, 2) - dcm_from_quat(q),
    }
    rows = [
        compared(name, 0.0, float(np.abs(off).max()), "1", ROUNDING, ROUNDING_REMARK)
        for name, off in differences.items()
    ]
    swapped = rotate(p, rotate(q, v)) - rotate(quat_mul(q, p), v)
    rows.append(info(
        "proposition 3.3.3 with the factors exchanged, largest difference", None,
        float(np.abs(swapped).max()), "1", "why the printed order of the proof is a misprint",
    ))  # fmt: skip
    return rows


def _printed() -> list[Row]:
    """Return the rows of (21) to (23), which read the angles off the conjugate."""
    wanted = np.array([0.5, 0.4, 0.3])  # roll, pitch, yaw
    q1, q2, q3, q4 = quat_conj(quat_from_rpy(wanted))
    psi, phi = 2.0 * (q2 * q3 - q1 * q4), 2.0 * (q3 * q4 - q1 * q2)
    corrected = {
        "(21), psi": math.atan2(psi, 2.0 * q1**2 + 2.0 * q2**2 - 1.0),
        "(22), theta": -math.asin(2.0 * (q2 * q4 + q1 * q3)),
        "(23), phi": math.atan2(phi, 2.0 * q1**2 + 2.0 * q4**2 - 1.0),
    }
    misprinted = {
        "(21) as printed, psi": math.atan2(psi, 2.0 * q1**2 + q2**2 - 1.0),
        "(22) as printed, theta": -math.sin(2.0 * (q2 * q4 + q1 * q3)),
        "(23) as printed, phi": math.atan2(phi, 2.0 * q1**2 + q4**2 - 1.0),
    }
    ours = rpy_from_quat(quat_from_rpy(wanted))
    rows = [
        compared(f"{name} of the conjugate", float(true), here, "rad", Tolerance(absolute=4e-15),
                 "corrected; at roll 0.5, pitch 0.4, yaw 0.3 rad")
        for (name, here), true in zip(corrected.items(), ours[::-1], strict=True)
    ]  # fmt: skip
    rows += [
        info(name, None, here / DEG, "deg", f"misprint; true is {true / DEG:.3f} deg")
        for (name, here), true in zip(misprinted.items(), wanted[::-1], strict=True)
    ]
    return rows


def _kinematics(rng: np.random.Generator) -> list[Row]:
    """Return the rows of (24) and (77): the derivative of q by either rate."""
    h = 1e-5
    a, b = rng.uniform(-1.0, 1.0, (2, CASES, 3))

    def q(t: float) -> FloatArray:
        return quat_mul(quat_from_rotvec(a * math.sin(t)), quat_from_rotvec(b * t * t))

    t = 0.8
    derivative = (q(t + h) - q(t - h)) / (2.0 * h)
    matrix = (dcm_from_quat(q(t + h)) - dcm_from_quat(q(t - h))) / (2.0 * h)
    cross = np.einsum("kij,klj->kil", matrix, dcm_from_quat(q(t)))  # [w x] in the fixed frame
    fixed = np.stack((cross[:, 2, 1], cross[:, 0, 2], cross[:, 1, 0]), axis=1)
    zero = np.zeros((CASES, 1))
    own = np.hstack((zero, rotate(quat_conj(q(t)), fixed)))
    off = {
        "(24), dq/dt = w q / 2, w in the fixed frame": 0.5
        * _printed_product(np.hstack((zero, fixed)), q(t)),
        "(77), dq/dt = q w' / 2, w' in the sensor": 0.5 * _printed_product(q(t), own),
    }
    return [
        compared(name, 0.0, float(np.abs(value - derivative).max()), "1/s",
                 Tolerance(absolute=1e-8),
                 "differences over 20 us on 1000 curves; tolerance: their truncation")
        for name, value in off.items()
    ]  # fmt: skip


PART: Final = Part(
    name="relations",
    title="Printed formulas: sensors, rotations, gimbal lock, quaternions",
    source="2.3 to 2.5, chapter 3, appendix A; items 12, 13, 17 to 21",
    run=run,
)
