"""The MEKF kernel against differences on the manifold and the textbook's dense matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import bias, feed, quat, rotation, scalar_first, start, unit

from strapdown.attitude import Mekf
from strapdown.kernels import mekf as k
from strapdown.kernels import memory as m
from strapdown.kernels import status as s

G = 9.80665
FIELD_N = np.array([2e-5, 0.0, 3e-5])
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 2.6])


def skew(v):
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def some_covariance(seed=1, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((6, 6))
    return scale * (a @ a.T + 0.1 * np.eye(6))


def transition(phi, dt):
    """A and B as the kernel writes them."""
    w = np.zeros(k.W_SIZE)
    k.transition(w, *phi, dt)
    return w[k.W_A : k.W_A + 9].reshape(3, 3), w[k.W_B : k.W_B + 9].reshape(3, 3)


def transition_by_differences(phi, dt):
    """Derivative of the attitude error after a step with respect to the errors before it."""

    def error(dtheta, dbg):
        truth = Rotation.from_rotvec(dtheta) * Rotation.from_rotvec(phi - dbg * dt)
        return (Rotation.from_rotvec(phi).inv() * truth).as_rotvec()

    h, zero = 1e-5, np.zeros(3)
    a = [(error(h * e, zero) - error(-h * e, zero)) / (2 * h) for e in np.eye(3)]
    b = [(error(zero, h * e) - error(zero, -h * e)) / (2 * h) for e in np.eye(3)]
    return np.transpose(a), np.transpose(b)


def test_transition_agrees_with_central_differences_on_the_manifold():
    for phi in np.random.default_rng(1).uniform(-0.1, 0.1, (20, 3)):
        dt = 0.013
        (a, b), (want_a, want_b) = transition(phi, dt), transition_by_differences(phi, dt)
        np.testing.assert_allclose(a, want_a, atol=1e-9)
        # first term of J_r that is left out: |phi|^3 / 24 times dt
        left_out = dt * np.linalg.norm(phi) ** 3 / 24.0
        np.testing.assert_allclose(b, want_b, atol=1.1 * left_out + 1e-11)


def test_what_the_influence_of_the_bias_leaves_out_is_of_third_order():
    phi = np.array([0.3, -0.4, 0.5])
    off = [
        np.abs(transition(c * phi, 1.0)[1] - transition_by_differences(c * phi, 1.0)[1]).max()
        for c in (1.0, 0.5, 0.25)
    ]
    np.testing.assert_allclose(np.divide(off[:-1], off[1:]), 8.0, rtol=0.1)


def test_prediction_is_the_dense_congruence():
    P, w = some_covariance(), np.zeros(k.W_SIZE)
    k.transition(w, 0.3, -0.2, 0.5, 0.1)
    a, b = transition([0.3, -0.2, 0.5], 0.1)
    F = np.block([[a, b], [np.zeros((3, 3)), np.eye(3)]])
    want = F @ P @ F.T + np.diag([0.02] * 3 + [0.003] * 3)
    k.predict(P, w, 0.02, 0.003)
    np.testing.assert_allclose(P, want, rtol=0, atol=1e-13)
    assert np.array_equal(P, P.T)


def test_scalar_update_is_the_textbook_joseph_update():
    P, w = some_covariance(2), np.zeros(k.W_SIZE)
    h = np.array([0.3, -0.7, 0.2, 0.0, 0.0, 0.0])
    dx0 = np.random.default_rng(3).standard_normal(6)
    w[k.W_DX : k.W_DX + 6] = dx0
    innovation, r = 0.9, 0.05
    expected = h @ P @ h + r
    gain = P @ h / expected
    left = innovation - h @ dx0
    want = (np.eye(6) - np.outer(gain, h)) @ P @ (np.eye(6) - np.outer(gain, h)).T
    want += r * np.outer(gain, gain)
    got = k.update_scalar(P, w, *h[:3], innovation, r, np.inf)
    np.testing.assert_allclose(got, [left, expected, True], rtol=1e-14)
    np.testing.assert_allclose(w[k.W_DX : k.W_DX + 6], dx0 + gain * left, rtol=0, atol=1e-14)
    np.testing.assert_allclose(P, want, rtol=0, atol=1e-13)
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_innovation_beyond_the_gate_is_weighed_down_until_it_lies_on_it(sign):
    """As if the noise were so large that `gate` sigma are the innovation."""
    h = np.array([0.3, -0.7, 0.2, 0.0, 0.0, 0.0])
    P, w = some_covariance(2), np.zeros(k.W_SIZE)
    before = P.copy()
    innovation, gate = sign * 40.0, 3.0
    raised = (innovation / gate) ** 2 - h @ before @ h
    left, expected, accepted = k.update_scalar(P, w, *h[:3], innovation, 0.05, gate)
    assert not accepted
    assert left == innovation
    assert expected == pytest.approx(h @ before @ h + 0.05, rel=1e-14)
    gain = before @ h / (h @ before @ h + raised)
    want = before - np.outer(gain, h @ before)
    np.testing.assert_allclose(P, want, rtol=0, atol=1e-13)
    np.testing.assert_allclose(w[k.W_DX : k.W_DX + 6], gain * innovation, rtol=0, atol=1e-13)
    within = k.update_scalar(before.copy(), np.zeros(k.W_SIZE), *h[:3], 1.0, 0.05, gate)
    assert within[2]


def test_measurement_surer_than_round_off_leaves_a_covariance():
    """Variance 1e-25 beside a P of 10: the update's rounding is far larger than what is left."""
    P, w = 10.0 * some_covariance(2), np.zeros(k.W_SIZE)
    for h in np.random.default_rng(5).standard_normal((200, 3)):
        left, expected, accepted = k.update_scalar(P, w, *h, 0.1, 1e-25, np.inf)
        assert accepted
        assert expected >= 0.0
        assert np.isfinite(left)
        assert np.all(np.diag(P) > 0.0)
    assert np.isfinite(w).all()


def test_direction_update_is_the_textbook_update_with_differenced_rows():
    """Three scalars in turn equal one update with H from differences over SciPy's rotations."""
    d_n, r = unit([0.3, -0.5, 0.8]), 0.04

    def predicted(dtheta):
        return (TURNED * Rotation.from_rotvec(dtheta)).inv().apply(d_n)

    step = 1e-5
    H = np.zeros((3, 6))
    for j, e in enumerate(np.eye(3)):
        H[:, j] = (predicted(step * e) - predicted(-step * e)) / (2 * step)
    P, w = some_covariance(4), np.zeros(k.W_SIZE)
    measured = predicted(np.array([0.02, -0.05, 0.03])) + [0.01, 0.0, -0.02]
    innovation = measured - predicted(np.zeros(3))
    S = H @ P @ H.T + r * np.eye(3)
    gain = P @ H.T @ np.linalg.inv(S)
    want_P = (np.eye(6) - gain @ H) @ P @ (np.eye(6) - gain @ H).T + r * gain @ gain.T
    ok = k.update_direction(P, w, *predicted(np.zeros(3)), *measured, r, np.inf)
    assert ok
    np.testing.assert_allclose(w[k.W_DX : k.W_DX + 6], gain @ innovation, atol=1e-8)
    np.testing.assert_allclose(P, want_P, atol=1e-8)
    # the first scalar's innovation and its sigma stand in the diagnostics as they are
    assert w[m.D_ACC] == pytest.approx(innovation[0], rel=1e-14)
    assert w[m.D_ACC + 3] == pytest.approx(np.sqrt(S[0, 0]), rel=1e-8)
    assert w[m.D_ACC + 6] == s.ACCEPTED


def test_direction_beyond_the_gate_says_so():
    P, w = 1e-6 * np.eye(6), np.zeros(k.W_SIZE)
    assert not k.update_direction(P, w, 0.0, 0.0, 1.0, 0.0, 0.5, 0.8, 1e-4, 4.0)
    assert w[m.D_ACC + 6] == s.REJECTED_GATE


def test_reset_gives_tilt_and_heading_their_deviations_and_keeps_the_bias():
    flt = Mekf(std_tilt=0.03, std_heading=0.2)
    x, P = start(flt, scalar_first(TURNED))
    P[:] = some_covariance(5)
    bias_block = P[3:, 3:].copy()
    for aligned, heading in ((m.FULL, 0.2), (m.TILT, 0.0)):
        x[m.ALIGNED] = aligned
        k.reset_attitude(x, P, flt._params())
        to_n = TURNED.as_matrix()
        np.testing.assert_allclose(
            to_n @ P[:3, :3] @ to_n.T, np.diag([0.03**2, 0.03**2, heading**2]), atol=1e-17
        )
        assert np.array_equal(P[3:, 3:], bias_block)
        assert not P[:3, 3:].any()
        assert not P[3:, :3].any()
        assert np.array_equal(P, P.T)


def test_standard_deviations_of_attitude_are_those_about_north_east_and_down():
    x, P = start(Mekf(), scalar_first(TURNED))
    P[:] = some_covariance(6)
    k.write_std(x, P)
    to_n = TURNED.as_matrix()
    want = np.sqrt(np.diag(to_n @ P[:3, :3] @ to_n.T))
    np.testing.assert_allclose(x[m.STD_ATT : m.STD_ATT + 3], want, rtol=1e-13)
    np.testing.assert_allclose(x[m.STD_BG : m.STD_BG + 3], np.sqrt(np.diag(P)[3:]), rtol=1e-15)


def test_round_off_below_zero_gives_a_deviation_of_zero():
    x, P = start(Mekf(), [1.0, 0.0, 0.0, 0.0])
    P[2, 2] = -1e-20
    k.write_std(x, P)
    assert x[m.STD_ATT + 2] == 0.0


def dense_step(flt, q, b, P, rate, acc, mag, dt, t_acc, t_mag):
    """One step of the textbook: prediction, batch updates of both vectors, injection."""
    phi = (rate - b) * dt
    A, B = transition(phi, dt)
    F = np.block([[A, B], [np.zeros((3, 3)), np.eye(3)]])
    P = F @ P @ F.T + dt * np.diag([flt.gyr_noise**2] * 3 + [flt.gyr_bias_noise**2] * 3)
    r_nb = rotation(q) * Rotation.from_rotvec(phi)
    down = r_nb.inv().apply([0, 0, 1])
    rows = [(skew(down), -acc / flt.gravity - down, (flt.acc_noise / flt.gravity) ** 2 / t_acc)]
    rows += mag_rows(flt, r_nb, mag, t_mag)
    dx = np.zeros(6)
    for H3, innovation, r in rows:
        H = np.hstack((H3, np.zeros((len(H3), 3))))
        gain = P @ H.T @ np.linalg.inv(H @ P @ H.T + r * np.eye(len(H)))
        dx = dx + gain @ (innovation - H @ dx)
        P = (np.eye(6) - gain @ H) @ P
    return r_nb * Rotation.from_rotvec(dx[:3]), b + dx[3:], P


def heading_off(r_nb, mag):
    """Angle from the measured field's heading to north, seen with the estimated attitude."""
    h = r_nb.apply(mag)
    return -np.arctan2(h[1], h[0])


def heading_row(r_nb, field_n):
    """Derivative of `heading_off` with respect to the attitude error, by central differences."""
    step, row = 1e-5, np.zeros(3)
    for j, e in enumerate(np.eye(3)):
        plus, minus = (r_nb * Rotation.from_rotvec(c * e) for c in (step, -step))
        row[j] = heading_off(r_nb, plus.inv().apply(field_n))
        row[j] -= heading_off(r_nb, minus.inv().apply(field_n))
    return row / (2 * step)


def mag_rows(flt, r_nb, mag, t_mag):
    """The field as a measurement of heading alone, in units of the unit field."""
    h = r_nb.apply(unit(mag))
    across = np.hypot(h[0], h[1])
    row = across * heading_row(r_nb, [across, 0.0, h[2]])
    innovation = across * heading_off(r_nb, mag)
    return [(row[None, :], np.array([innovation]), flt.mag_noise**2 / t_mag)]


@pytest.mark.parametrize("field_n", [FIELD_N, [2e-5, 0.0, -6e-5], [3e-5, 0.0, 0.0]])
def test_field_row_is_the_derivative_of_the_heading_seen(field_n):
    """By differences on the manifold, at both signs of the dip."""
    field = TURNED.inv().apply(unit(field_n))
    down = TURNED.inv().apply([0, 0, 1])
    across, angle, r = unit(field_n)[0], 0.3, 0.04
    h = np.r_[across * heading_row(TURNED, field_n), 0.0, 0.0, 0.0]
    P, w = some_covariance(4), np.zeros(k.W_SIZE)
    gain = P @ h / (h @ P @ h + r)
    want = P - np.outer(gain, h @ P)
    assert k.update_heading(P, w, angle, *down, *field, r, np.inf)
    np.testing.assert_allclose(w[k.W_DX : k.W_DX + 6], gain * across * angle, atol=1e-8)
    np.testing.assert_allclose(P, want, atol=1e-8)
    assert w[m.D_MAG] == pytest.approx(across * angle, rel=1e-14)
    assert w[m.D_MAG + 6] == s.ACCEPTED


def test_field_beyond_the_gate_says_so():
    P, w = 1e-6 * np.eye(6), np.zeros(k.W_SIZE)
    assert not k.update_heading(P, w, 1.0, 0.0, 0.0, 1.0, 0.6, 0.0, 0.8, 1e-4, 4.0)
    assert w[m.D_MAG + 6] == s.REJECTED_GATE


def test_a_vertical_field_is_no_measurement():
    x, P = start(Mekf(), [1.0, 0, 0, 0])
    before = Mekf()
    y, Q = start(before, [1.0, 0, 0, 0])
    w = feed(Mekf(), x, P, 0.01, np.zeros(3), [0.3, 0, -G], [0.0, 0.0, 5e-5])
    feed(before, y, Q, 0.01, np.zeros(3), [0.3, 0, -G])
    assert np.array_equal(P, Q)
    assert np.array_equal(quat(x), quat(y))
    assert w[m.D_MAG + 6] == s.NOT_MEASURED


def test_a_heading_off_by_almost_half_a_turn_is_pulled_back_the_short_way():
    """The angle enters, not its sine, which would be small here."""
    for off in (3.0, -3.0):
        flt = Mekf(gate=np.inf, mag_noise=0.01)
        x, P = start(flt, scalar_first(Rotation.from_euler("Z", off)))
        P[:3, :3] = np.diag([1e-6, 1e-6, 1.0])
        feed(flt, x, P, 1.0, np.zeros(3), np.full(3, np.inf), FIELD_N)
        assert abs(rotation(quat(x)).as_euler("ZYX")[0]) < 0.01 * abs(off)


def test_one_sample_is_the_textbook_filter_with_dense_matrices():
    flt = Mekf(gyr_noise=0.01, gyr_bias_noise=0.002, gate=np.inf, std_gyr_bias=0.05)
    rng = np.random.default_rng(7)
    b0 = np.array([0.02, -0.01, 0.03])
    x, P = start(flt, scalar_first(TURNED), b0)
    P[:] = some_covariance(8, scale=1e-3)
    rate = np.array([0.5, -0.8, 1.3])
    acc = 1.1 * TURNED.inv().apply([0, 0, -G]) + 0.5 * rng.standard_normal(3)
    mag = TURNED.inv().apply(FIELD_N) + 3e-6 * rng.standard_normal(3)
    dt = 0.02
    want, want_b, want_P = dense_step(
        flt, scalar_first(TURNED), b0, P.copy(), rate, acc, mag, dt, dt, dt
    )
    w = feed(flt, x, P, dt, rate, acc, mag)
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-9
    np.testing.assert_allclose(bias(x), want_b, atol=1e-10)
    np.testing.assert_allclose(P, want_P, atol=1e-11)  # rows by differences
    assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == s.ACCEPTED


def test_a_slower_sensor_is_weighed_by_its_own_interval():
    flt = Mekf(gate=np.inf)
    x, P = start(flt, scalar_first(TURNED))
    acc, mag = TURNED.inv().apply([0.3, 0, -G]), TURNED.inv().apply([2e-5, 1e-6, 3e-5])
    feed(flt, x, P, 0.01, np.zeros(3), np.full(3, np.inf))
    feed(flt, x, P, 0.02, np.zeros(3), np.full(3, np.inf))
    q, b, before = quat(x), bias(x), P.copy()
    feed(flt, x, P, 0.03, np.zeros(3), acc, mag)
    want, _, want_P = dense_step(flt, q, b, before, np.zeros(3), acc, mag, 0.01, 0.03, 0.03)
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-9
    np.testing.assert_allclose(P, want_P, atol=1e-11)  # rows by differences


def test_a_sample_after_a_gap_weighs_no_more_than_the_longest_interval():
    """Attitude after 1000 s unseen rests on one sample: its deviation is that of max_gap."""
    flt = Mekf(max_gap=1.0, gate=np.inf)
    x, P = start(flt, [1.0, 0, 0, 0])
    feed(flt, x, P, 1000.0, np.zeros(3), [0, 0, -G])
    sigma = flt.acc_noise / G  # density over the root of one second
    assert int(x[m.STATUS]) == s.GAP
    assert x[m.STD_ATT] == pytest.approx(sigma, rel=0.01)
    assert x[m.STD_ATT + 2] > 3.0  # nobody has seen the heading


def test_first_sample_of_a_given_attitude_is_not_weighed_by_the_time_since_zero():
    flt = Mekf()
    state = flt.init(attitude=[1.0, 0, 0, 0])
    x, P = state.x.copy(), state.P.copy()
    feed(flt, x, P, 1e6, np.zeros(3), [5.0, 0, -G])
    assert rotation(quat(x)).magnitude() < 1e-15
    assert np.array_equal(P[:3, :3], state.P[:3, :3])


@pytest.mark.parametrize(("clipped", "gap"), [(True, False), (False, True), (False, False)])
def test_unseen_rates_widen_the_covariance(clipped, gap):
    flt = Mekf(gap_rate=0.5, gyr_range=10.0, max_gap=0.4)
    x, P = start(flt, [1.0, 0, 0, 0])
    P[:] = 0.0
    dt = 0.5 if gap else 0.1
    feed(flt, x, P, dt, [0.0, 0.0, 10.0 if clipped else 9.9], np.full(3, np.inf))
    # over a gap a constant rate is unseen, beyond the range one that stays for 0.25 s
    hidden = (0.5 * dt) ** 2 if gap else (2 * 0.25 * 0.5**2 * dt if clipped else 0.0)
    want = flt.gyr_noise**2 * dt + hidden
    np.testing.assert_allclose(np.diag(P)[:3], want, rtol=1e-12)


def test_covariance_stays_symmetric_and_positive_definite():
    flt = Mekf(acc_noise=0.01, mag_noise=0.001)  # strong updates, turning axes, 300 samples
    rng = np.random.default_rng(9)
    state = flt.init()
    x, P = state.x, state.P
    r_nb = TURNED
    for i in range(300):
        rate = 3.0 * rng.standard_normal(3)
        r_nb = r_nb * Rotation.from_rotvec(rate * 0.01)
        acc, mag = r_nb.inv().apply([0, 0, -G]), r_nb.inv().apply(FIELD_N)
        feed(flt, x, P, 0.01 * i, rate, acc, mag if i % 3 == 0 else np.empty(0))
        assert np.array_equal(P, P.T)
        assert np.linalg.eigvalsh(P)[0] > 0.0
        assert abs(np.linalg.norm(quat(x)) - 1.0) < 1e-15


def test_declination_turns_the_heading_that_it_settles_at():
    for declination in (0.0, 0.5, -1.5):
        flt = Mekf(declination=declination, mag_noise=0.01)
        state = flt.init()
        acc, mag = TURNED.inv().apply([0, 0, -G]), TURNED.inv().apply(FIELD_N)
        for i in range(50):
            feed(flt, state.x, state.P, 0.02 * i, np.zeros(3), acc, mag)
        want = Rotation.from_euler("Z", declination) * TURNED
        assert (rotation(quat(state.x)) * want.inv()).magnitude() < 1e-12
