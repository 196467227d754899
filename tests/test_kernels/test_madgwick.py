"""The Madgwick kernel against the thesis's printed gradient and against SciPy's steepest descent.

Equation numbers are those of the thesis, section 4.2, as cited in the kernel.
"""

import numpy as np
import pytest
import sympy as sp
from scipy.spatial.transform import Rotation
from truth.kernel_step import bias, feed, quat, rotation, scalar_first, start, unit
from truth.rotations import hamilton, random_quats

from strapdown.attitude import Madgwick
from strapdown.kernels import memory as m

DT = 0.02


def objective(q, d, s):
    """(29), its misprint corrected."""
    q1, q2, q3, q4 = q
    dx, dy, dz = d
    return np.array(
        [
            2 * dx * (0.5 - q3**2 - q4**2) + 2 * dy * (q1 * q4 + q2 * q3)
            + 2 * dz * (q2 * q4 - q1 * q3),
            2 * dx * (q2 * q3 - q1 * q4) + 2 * dy * (0.5 - q2**2 - q4**2)
            + 2 * dz * (q1 * q2 + q3 * q4),
            2 * dx * (q1 * q3 + q2 * q4) + 2 * dy * (q3 * q4 - q1 * q2)
            + 2 * dz * (0.5 - q2**2 - q3**2),
        ]
    ) - s  # fmt: skip


def jacobian(q, d):
    """(30), the three by four matrix as printed."""
    q1, q2, q3, q4 = q
    dx, dy, dz = 2 * np.asarray(d)
    return np.array(
        [
            [dy * q4 - dz * q3, dy * q3 + dz * q4,
             -2 * dx * q3 + dy * q2 - dz * q1, -2 * dx * q4 + dy * q1 + dz * q2],
            [-dx * q4 + dz * q2, dx * q3 - 2 * dy * q2 + dz * q1,
             dx * q2 + dz * q4, -dx * q1 - 2 * dy * q4 + dz * q3],
            [dx * q3 - dy * q2, dx * q4 - dy * q1 - 2 * dz * q2,
             dx * q1 + dy * q4 - 2 * dz * q3, dx * q2 + dy * q3],
        ]
    )  # fmt: skip


def reference_field(q, mag):
    """(49): the measured field turned to n, its horizontal part to the north."""
    h = hamilton(hamilton(q, [0.0, *unit(mag)]), q * [1, -1, -1, -1])[1:]
    return np.array([np.hypot(h[0], h[1]), 0.0, h[2]])


def direction(q, acc, mag=None):
    """(35), (36), (28), (48): the unit gradient, without its part along q."""
    down = -unit(acc)
    grad = jacobian(q, [0, 0, 1]).T @ objective(q, [0, 0, 1], down)
    if mag is not None:
        b = reference_field(q, mag)
        grad = grad + jacobian(q, b).T @ objective(q, b, unit(mag))
    return unit(grad - (grad @ q) * q)


def cases():
    rng = np.random.default_rng(1)
    for q in random_quats(20, seed=2):
        yield q, 9.0 * unit(rng.standard_normal(3)), 5e-5 * unit(rng.standard_normal(3))


def test_printed_jacobian_is_the_derivative_of_the_printed_objective():
    for q, _, d in cases():
        d = unit(d)
        h = 1e-6
        numeric = [
            (objective(q + h * e, d, 0.0) - objective(q - h * e, d, 0.0)) / (2 * h)
            for e in np.eye(4)
        ]
        np.testing.assert_allclose(jacobian(q, d), np.transpose(numeric), atol=1e-9)


@pytest.mark.parametrize("with_mag", [False, True])
def test_correction_is_the_normalised_gradient_of_the_thesis_along_rotations(with_mag):
    flt = Madgwick(beta=0.3)
    for q, acc, mag in cases():
        x, P = start(flt, q)
        feed(flt, x, P, DT, np.zeros(3), acc, mag if with_mag else np.empty(0))
        q_eps = direction(q, acc, mag if with_mag else None)
        # (46), (47) as a turn: of unit length by itself
        want = np.cos(0.3 * DT) * q - np.sin(0.3 * DT) * q_eps
        np.testing.assert_allclose(quat(x), want, rtol=0, atol=1e-14)


def test_correction_is_steepest_descent_among_rotations():
    """Central differences over SciPy's rotations; nothing of the quaternion algebra enters."""
    flt = Madgwick(beta=1.0)
    for q, acc, mag in cases():
        x, P = start(flt, q)
        feed(flt, x, P, DT, np.zeros(3), acc, mag)
        turned = (rotation(q).inv() * rotation(quat(x))).as_rotvec()
        b = reference_field(q, mag)

        def cost(r, q=q, acc=acc, mag=mag, b=b):
            r_nb = rotation(q) * Rotation.from_rotvec(r)
            off_g = r_nb.inv().apply([0, 0, 1]) + unit(acc)
            off_b = r_nb.inv().apply(b) - unit(mag)
            return 0.5 * (off_g @ off_g + off_b @ off_b)

        h = 1e-5
        grad = np.array([(cost(h * e) - cost(-h * e)) / (2 * h) for e in np.eye(3)])
        np.testing.assert_allclose(turned, -2.0 * DT * unit(grad), atol=1e-8)


def test_fusion_before_the_simplification_follows_equations_37_to_42():
    """Twin: the weighted mean of both quaternions as printed, taken along rotations.

    Weighted means of steps and of rotations differ in the square of the step.
    """
    alpha, beta, zeta, dt = 3.0, 0.2, 0.05, 1e-4
    flt = Madgwick(beta=beta, zeta=zeta, alpha=alpha)
    b0 = np.array([0.02, -0.01, 0.03])
    for k, (q, acc, mag) in enumerate(cases()):
        rate = np.array([0.5, -0.8, 1.3]) * 0.1 ** (k % 3)
        x, P = start(flt, q, b0)
        feed(flt, x, P, dt, rate, acc, mag)
        q_eps = direction(q, acc, mag)
        w_b = b0 + zeta * 2.0 * hamilton(q * [1, -1, -1, -1], q_eps)[1:] * dt  # (50), (51)
        q_dot = 0.5 * hamilton(q, [0.0, *(rate - w_b)])  # (25), (52)
        mu = alpha * np.linalg.norm(q_dot) * dt  # (38)
        q_grad = q - mu * q_eps  # (37)
        weight = beta / (mu / dt + beta)  # (42)
        want = unit(weight * q_grad + (1.0 - weight) * (q + q_dot * dt))  # (39)
        step = quat(x) - q
        # a step s of at most 1e-4 and its arc differ by s^2 / 3 of it
        np.testing.assert_allclose(step, want - q, rtol=0, atol=1e-8 * np.linalg.norm(step))
        np.testing.assert_allclose(bias(x), w_b, atol=1e-16)


def test_large_alpha_is_the_simplified_filter_and_the_way_there_is_of_first_order():
    """(44): the step that alpha leaves out is ``2 beta / (alpha |w|)`` of all."""
    rate = np.array([0.5, -0.8, 1.3])
    for q, acc, mag in cases():
        ends = {}
        for alpha in (np.inf, 1e3, 2e3, 1e14):
            flt = Madgwick(beta=0.2, alpha=alpha)
            x, P = start(flt, q)
            feed(flt, x, P, DT, rate, acc, mag)
            ends[alpha] = rotation(quat(x))
        off = [(ends[np.inf].inv() * ends[a]).magnitude() for a in (1e3, 2e3, 1e14)]
        assert off[0] / off[1] == pytest.approx(2.0, rel=1e-3)
        assert off[2] < 1e-15


def test_weighted_filter_stands_still_without_a_rate_and_integrates_without_vectors():
    """(38) makes no step where nothing turns, and with nothing to weigh (40) holds."""
    q = random_quats(1, seed=5)[0]
    flt = Madgwick(beta=0.2, alpha=2.0)
    x, P = start(flt, q)
    feed(flt, x, P, DT, np.zeros(3), [1.0, 2.0, -9.0], [2e-5, 1e-5, 3e-5])
    np.testing.assert_allclose(quat(x), q, rtol=0, atol=1e-15)
    rate = np.array([0.5, -0.8, 1.3])
    feed(flt, x, P, 2 * DT, rate, np.full(3, np.inf))
    want = rotation(q) * Rotation.from_rotvec(rate * DT)
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-15


@pytest.mark.parametrize("declination", [None, -0.3])
def test_preset_field_takes_the_place_of_the_measured_dip(declination):
    """Without (49): the reference stands still, and its error turns roll and pitch as well."""
    flt = Madgwick(beta=0.3, dip=1.1, declination=declination)
    d = declination or 0.0
    b = np.array([np.cos(1.1) * np.cos(d), np.cos(1.1) * np.sin(d), np.sin(1.1)])
    for q, acc, mag in cases():
        x, P = start(flt, q)
        w = feed(flt, x, P, DT, np.zeros(3), acc, mag)
        grad = jacobian(q, [0, 0, 1]).T @ objective(q, [0, 0, 1], -unit(acc))
        grad = grad + jacobian(q, b).T @ objective(q, b, unit(mag))
        q_eps = unit(grad - (grad @ q) * q)
        want = np.cos(0.3 * DT) * q - np.sin(0.3 * DT) * q_eps
        np.testing.assert_allclose(quat(x), want, rtol=0, atol=1e-14)
        seen = unit(mag) - rotation(q).inv().apply(b)
        np.testing.assert_allclose(w[m.D_MAG : m.D_MAG + 3], seen, atol=1e-15)


def test_printed_gradient_agrees_with_a_symbolic_derivation():
    """SymPy differentiates ``q* o d o q - s`` itself; on unit quaternions (30) is the same."""
    q = sp.symbols("q1:5")
    d = sp.symbols("dx dy dz")

    def product(a, b):
        return [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]

    turned = product(product([q[0], -q[1], -q[2], -q[3]], [0, *d]), q)[1:]
    exact = sp.lambdify((q, d), sp.Matrix(turned).jacobian(q))
    for quat_, _, mag in cases():
        b = unit(mag)
        # (29) uses |q| = 1, so both derivatives agree along rotations only
        across = np.eye(4) - np.outer(quat_, quat_)
        np.testing.assert_allclose(
            np.array(exact(quat_, b), dtype=float) @ across,
            jacobian(quat_, b) @ across,
            atol=1e-14,
        )


def test_gyro_bias_follows_equations_50_to_52():
    beta, zeta = 0.2, 0.05
    flt = Madgwick(beta=beta, zeta=zeta)
    rate = np.array([0.5, -0.8, 1.3])
    for q, acc, mag in cases():
        b0 = np.array([0.02, -0.01, 0.03])
        x, P = start(flt, q, b0)
        feed(flt, x, P, DT, rate, acc, mag)
        q_eps = direction(q, acc, mag)
        w_eps = 2.0 * hamilton(q * [1, -1, -1, -1], q_eps)  # (50)
        assert abs(w_eps[0]) < 1e-14
        w_b = b0 + zeta * w_eps[1:] * DT  # (51)
        w_c = rate - w_b  # (52)
        want = rotation(q) * Rotation.from_rotvec((w_c - beta * w_eps[1:]) * DT)
        np.testing.assert_allclose(bias(x), w_b, atol=1e-16)
        assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-14


def test_beta_and_zeta_follow_from_the_gyro_error():
    flt = Madgwick.from_gyro_error(0.0873, 0.004, use_mag=False)
    assert flt.beta == pytest.approx(0.07560, abs=5e-6)  # (43): sqrt(3/4) times 0.0873
    assert flt.zeta == pytest.approx(0.004 * np.sqrt(3) / 2, rel=1e-15)
    assert not flt.use_mag


def test_constant_bias_is_found():
    """At rest; the bias ends in the chatter of the normalised gradient: zeta dt times some."""
    flt = Madgwick(beta=0.1, zeta=0.01)
    r_nb = Rotation.from_euler("ZYX", [0.0, 0.3, -0.5])
    acc, mag = r_nb.inv().apply([0, 0, -9.8]), r_nb.inv().apply([2e-5, 0, 4e-5])
    x, P = start(flt, scalar_first(r_nb))
    for k in range(1, 3001):
        feed(flt, x, P, k * DT, [0.02, -0.03, 0.01], acc, mag)
    np.testing.assert_allclose(bias(x), [0.02, -0.03, 0.01], atol=2e-3)


def test_at_the_solution_and_without_vectors_it_only_integrates():
    flt = Madgwick(beta=0.5, zeta=0.1)
    rate = np.array([0.5, -0.8, 1.3])
    r_nb = Rotation.from_euler("ZYX", [1.0, 0.3, -0.5])
    want = r_nb * Rotation.from_rotvec(rate * DT)
    for acc, mag in (
        (np.full(3, np.nan), np.empty(0)),
        (np.full(3, np.inf), np.array([2e-5, 1e-5, 3e-5])),  # the field waits
    ):
        x, P = start(flt, scalar_first(r_nb))
        feed(flt, x, P, DT, rate, acc, mag)
        assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-15
        assert np.array_equal(bias(x), np.zeros(3))
        assert x[m.MAG] == float(len(mag) > 0)
    x, P = start(flt, [1.0, 0.0, 0.0, 0.0])
    feed(flt, x, P, DT, np.zeros(3), [0.0, 0.0, -9.8])
    assert np.array_equal(quat(x), [1.0, 0.0, 0.0, 0.0])


def test_waiting_field_joins_the_next_accelerometer_sample():
    """A slower accelerometer whose samples never meet those of the field."""
    flt = Madgwick(beta=0.5)
    x, P = start(flt, scalar_first(Rotation.from_euler("Z", 0.5)))
    for k in range(1, 401):
        odd = k % 2 == 1
        acc = np.full(3, np.inf) if odd else [0.0, 0.0, -9.8]
        feed(flt, x, P, k * DT, np.zeros(3), acc, [2e-5, 0, 4e-5] if odd else np.empty(0))
    # 0.5 rad at 2 beta = 1 rad/s at every second sample; then it chatters by 2 beta dt
    assert rotation(quat(x)).magnitude() < 2.5 * DT


def test_diagnostics_are_measured_less_predicted_directions():
    flt = Madgwick()
    for q, acc, mag in cases():
        x, P = start(flt, q)
        w = feed(flt, x, P, DT, np.zeros(3), acc, mag)
        down = rotation(q).inv().apply([0, 0, 1])
        np.testing.assert_allclose(w[m.D_ACC : m.D_ACC + 3], -unit(acc) - down, atol=1e-15)
        field = rotation(q).inv().apply(reference_field(q, mag))
        np.testing.assert_allclose(w[m.D_MAG : m.D_MAG + 3], unit(mag) - field, atol=1e-15)
        assert np.isnan(w[m.D_ACC + 3 : m.D_ACC + 6]).all()
        assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == 1
