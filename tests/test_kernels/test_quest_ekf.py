"""The kernel of rates and quaternion against SciPy's Wahba solver, differences, dense matrices.

The dense twin has six errors, (domega_b, phi_n); the kernel's seven follow from
``dq = 1/2 (0, phi_n) q``.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import feed, quat, rotation, scalar_first, start, unit

from strapdown.attitude import QuestEkf
from strapdown.kernels import memory as m
from strapdown.kernels import quest_ekf as k
from strapdown.kernels import quest_ekf_covariance as c
from strapdown.kernels import quest_ekf_layout as lay
from strapdown.kernels import quest_ekf_update as u
from strapdown.kernels import status as s

G = 9.80665
DIP = 1.07
FIELD_N = 4.7e-5 * np.array([np.cos(DIP), 0.0, np.sin(DIP)])
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 2.6])
NO_ACC = np.full(3, np.inf)
VARIANTS = [
    {"measurements": measurements, "dip": dip, "integration": integration}
    for measurements in ("quest", "vectors")
    for dip in (None, DIP)
    for integration in ("corrected", "printed")
]


def mul(a, b):
    """Quaternion product as scalar and vector parts."""
    vec = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.r_[a[0] * b[0] - a[1:] @ b[1:], vec]


def tangent(q):
    """What a turn phi_n makes of q: 4x3."""
    return np.transpose([0.5 * mul(np.r_[0.0, e], q) for e in np.eye(3)])


def seven(P6, q):
    """Covariance of rates and quaternion of that of (domega_b, phi_n)."""
    T = np.block([[np.eye(3), np.zeros((3, 3))], [np.zeros((4, 3)), tangent(q)]])
    return T @ P6 @ T.T


def some_covariance(seed=1, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((6, 6))
    return scale * (a @ a.T + 0.1 * np.eye(6))


def matrices(w):
    return w[lay.W_A : lay.W_A + 16].reshape(4, 4), w[lay.W_B : lay.W_B + 12].reshape(4, 3)


def begun(flt, rate=(0.0, 0.0, 0.0), P6=None):
    """Memory as after a sample at t = 0, turned, with a rate and a covariance."""
    x, P = start(flt, scalar_first(TURNED))
    x[lay.RATE : lay.RATE + 3] = rate
    if P6 is not None:
        P[:] = seven(P6, scalar_first(TURNED))
    return x, P


# --- the model ---------------------------------------------------------------------------


def test_turn_matrix_multiplies_from_the_right():
    e = scalar_first(Rotation.from_rotvec([0.3, -0.5, 0.2]))
    w, q = np.zeros(k.W_SIZE), scalar_first(TURNED)
    c.turn_matrix(w, *e)
    A, _ = matrices(w)
    np.testing.assert_allclose(A @ q, mul(q, e), atol=1e-15)
    np.testing.assert_allclose(A @ A.T, np.eye(4), atol=1e-15)


@pytest.mark.parametrize("size", [0.0, 0.02, 0.099, 0.101, 0.7, 3.0])
def test_rate_matrix_agrees_with_central_differences(size):
    phi, dt, h, q = size * unit([0.3, -0.4, 0.5]), 0.3, 1e-5, scalar_first(TURNED)

    def after(d):
        return mul(q, scalar_first(Rotation.from_rotvec(phi + d * dt)))

    want = np.transpose([(after(h * e) - after(-h * e)) / (2 * h) for e in np.eye(3)])
    w = np.zeros(k.W_SIZE)
    c.rate_matrix(w, *after(np.zeros(3)), *phi, dt)
    # rounding of the differences is 1e-11; the series leaves out 0.1**4 / 720 of dt / 2
    np.testing.assert_allclose(matrices(w)[1], want, atol=3e-8 * dt)


def test_printed_phi_is_that_of_the_source():
    """(68) with the rows that the source leaves out; its state is (omega, q)."""
    x1, x2, x3 = 0.3, -0.8, 0.5
    x4, x5, x6, x7 = scalar_first(TURNED)
    d, tau = 0.01, 0.4
    phi = np.eye(7)
    phi[:3, :3] *= 1 - d / tau
    phi[3:] += 0.5 * d * np.array(
        [
            [-x5, -x6, -x7, 0, -x1, -x2, -x3],
            [x4, -x7, x6, x1, 0, x3, -x2],
            [x7, x4, -x5, x2, -x3, 0, x1],
            [-x6, x5, x4, x3, x2, -x1, 0],
        ]
    )  # fmt: skip
    flt = QuestEkf(integration="printed", rate_time=tau, rate_std=0.7)
    x, P = begun(flt, (x1, x2, x3), some_covariance(3))
    Q = np.diag([2 * 0.7**2 * d / tau] * 3 + [0.0] * 4)
    H, R = np.eye(7)[:3], flt.gyr_noise**2 / d * np.eye(3)
    P7 = phi @ P @ phi.T + Q
    K = P7 @ H.T @ np.linalg.inv(H @ P7 @ H.T + R)
    want = (np.eye(7) - K @ H) @ P7
    feed(flt, x, P, d, [0.1, 0.2, 0.3], NO_ACC)
    np.testing.assert_allclose(P, want, atol=1e-13)
    prior = (1 - d / tau) * np.array([x1, x2, x3])
    rate = prior + (K @ ([0.1, 0.2, 0.3] - prior))[:3]
    np.testing.assert_allclose(x[lay.RATE : lay.RATE + 3], rate, atol=1e-13)


def moved(r_nb, omega, dt, e):
    """Truth after an interval, of errors (domega, phi) before it."""
    return Rotation.from_rotvec(e[3:]) * r_nb * Rotation.from_rotvec((omega + e[:3]) * dt)


def transition(r_nb, omega, dt):
    """F of the errors by central differences on the manifold."""
    h, at = 1e-5, moved(r_nb, omega, dt, np.zeros(6))

    def after(e):
        return np.r_[e[:3], (moved(r_nb, omega, dt, e) * at.inv()).as_rotvec()]

    return np.transpose([(after(h * e) - after(-h * e)) / (2 * h) for e in np.eye(6)])


def predicted(flt, P6, omega, r_nb, rate, dt):
    """Decay, the gyroscope, the turn: dense, corrected."""
    a = np.exp(-dt / flt.rate_time)
    D = np.diag([a] * 3 + [1.0] * 3)
    P6 = D @ P6 @ D + np.diag([flt.rate_std**2 * (1 - a**2)] * 3 + [0.0] * 3)
    omega, H = a * np.asarray(omega), np.eye(6)[:3]
    K = P6 @ H.T @ np.linalg.inv(H @ P6 @ H.T + flt.gyr_noise**2 / dt * np.eye(3))
    dx = K @ (rate - omega)
    P6 = (np.eye(6) - K @ H) @ P6
    omega, r_nb = omega + dx[:3], Rotation.from_rotvec(dx[3:]) * r_nb
    F = transition(r_nb, omega, dt)
    return F @ P6 @ F.T, omega, moved(r_nb, omega, dt, np.zeros(6))


def updated(P6, omega, r_nb, H, z, R):
    H = np.hstack((np.zeros((len(H), 3)), H))
    K = P6 @ H.T @ np.linalg.inv(H @ P6 @ H.T + R)
    dx = K @ z
    I_KH = np.eye(6) - K @ H
    P6 = I_KH @ P6 @ I_KH.T + K @ R @ K.T
    return P6, omega + dx[:3], Rotation.from_rotvec(dx[3:]) * r_nb


def seen(r_nb, v_n):
    """Rows of a vector seen in b, by central differences on the manifold."""
    h = 1e-5

    def f(phi):
        return (Rotation.from_rotvec(phi) * r_nb).inv().apply(v_n)

    return np.transpose([(f(h * e) - f(-h * e)) / (2 * h) for e in np.eye(3)])


def heading_row(r_nb, field_n):
    """Derivative of the field's angle to the east by a turn of the truth, times its horizontal."""
    h, across, row = 1e-5, np.hypot(*field_n[:2]), np.zeros(3)

    def east(phi):
        seen_b = (Rotation.from_rotvec(phi) * r_nb).inv().apply(field_n)
        v = r_nb.apply(seen_b)
        return np.arctan2(v[1], v[0])

    for j, e in enumerate(np.eye(3)):
        row[j] = across * (east(h * e) - east(-h * e)) / (2 * h)
    return row


# --- one sample ----------------------------------------------------------------------------


def wahba(down_b, field_b, dip, weights):
    """SciPy's solution of Wahba's problem, in magnetic north, east, down."""
    return Rotation.align_vectors(
        [[0, 0, 1], [np.cos(dip), 0, np.sin(dip)]], [down_b, field_b], weights=weights
    )[0]


def quest_r(r_d, r_m, dip, *, dip_is_measured):
    """Covariance of QUEST's turn in magnetic north, east, down."""
    if dip_is_measured:  # the field tells its heading only
        tilt = np.diag([r_d, r_d, 0.0])
        b = np.array([np.tan(dip), 0.0, 1.0])  # with an error of tilt about north
        M = np.eye(3)
        M[2] = b
        return M @ (tilt + np.diag([0, 0, r_m / np.cos(dip) ** 2])) @ M.T
    down, m_n = np.array([0, 0, 1.0]), np.array([np.cos(dip), 0, np.sin(dip)])
    info = (np.eye(3) - np.outer(down, down)) / r_d + (np.eye(3) - np.outer(m_n, m_n)) / r_m
    return np.linalg.inv(info)


SAMPLE = dict(gyr_noise=0.05, gate=np.inf, rate_std=2.0, rate_time=0.3)


def a_sample():
    """What the sensors say 0.1 rad off the estimate, and the time that they stand for."""
    rate, dt = np.array([0.5, -0.8, 1.3]), 0.02
    off = TURNED * Rotation.from_rotvec([0.05, -0.02, 0.09])
    acc = off.inv().apply([0.3, 0.2, -1.02 * G])
    return rate, dt, acc, off.inv().apply(FIELD_N + 1e-6 * np.array([1, 2, 3]))


def assert_is(x, P, P6, omega, r_nb):
    # rows and F by differences; the mean's order of the scalars adds the update's second order
    assert (rotation(quat(x)) * r_nb.inv()).magnitude() < 1e-8
    np.testing.assert_allclose(x[lay.RATE : lay.RATE + 3], omega, atol=1e-8)
    np.testing.assert_allclose(P, seven(P6, x[lay.Q_P : lay.Q_P + 4]), atol=1e-9)
    assert np.array_equal(P, P.T)


def test_gyroscope_alone_is_the_dense_filter():
    flt = QuestEkf(**SAMPLE)
    x, P = begun(flt, (0.4, -0.3, 0.6), some_covariance(4))
    rate, dt, _, _ = a_sample()
    want = predicted(flt, some_covariance(4), (0.4, -0.3, 0.6), TURNED, rate, dt)
    feed(flt, x, P, dt, rate, NO_ACC)
    assert_is(x, P, *want)


@pytest.mark.parametrize("declination", [None, 0.3])
def test_nine_measurements_are_the_dense_update_with_vectors_in_b(declination):
    flt = QuestEkf(measurements="vectors", dip=DIP, declination=declination, **SAMPLE)
    P6 = some_covariance(8, 0.1)
    x, P = begun(flt, (0.4, -0.3, 0.6), P6)
    rate, dt, acc, mag = a_sample()
    P6, omega, r_nb = predicted(flt, P6, (0.4, -0.3, 0.6), TURNED, rate, dt)
    turn = Rotation.from_euler("Z", declination or 0.0)
    field = turn.apply(unit(FIELD_N))
    H = np.vstack((seen(r_nb, [0, 0, 1]), seen(r_nb, field)))
    z = np.r_[-acc / G - r_nb.inv().apply([0, 0, 1]), unit(mag) - r_nb.inv().apply(field)]
    r_d, r_m = (1.5 / G) ** 2 / dt, 0.25**2 / dt
    want = updated(P6, omega, r_nb, H, z, np.diag([r_d] * 3 + [r_m] * 3))
    w = feed(flt, x, P, dt, rate, acc, mag)
    assert_is(x, P, *want)
    assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == s.ACCEPTED


@pytest.mark.parametrize("declination", [None, 0.3])
@pytest.mark.parametrize("dip", [None, DIP])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_quest_is_the_dense_update_with_wahbas_solution(dip, declination, sign):
    """Of the two quaternions of an attitude the estimate may be either."""
    flt = QuestEkf(dip=dip, declination=declination, **SAMPLE)
    P6 = some_covariance(8, 0.1)
    x, P = begun(flt, (0.4, -0.3, 0.6), P6)
    for cell in (m.Q, lay.Q_P):
        x[cell : cell + 4] *= sign
    P[:] = seven(P6, quat(x))
    rate, dt, acc, mag = a_sample()
    P6, omega, r_nb = predicted(flt, P6, (0.4, -0.3, 0.6), TURNED, rate, dt)
    # an acceleration of any direction spreads that of f by 1 / (g |f|)
    r_d, r_m = 1.5**2 / (G * np.linalg.norm(acc)) / dt, 0.25**2 / dt
    turn = Rotation.from_euler("Z", declination or 0.0)
    field = turn.inv().apply(r_nb.apply(unit(mag)))
    between = np.arcsin(unit(mag) @ unit(-acc))
    found = wahba(unit(-acc), unit(mag), between if dip is None else dip, [1 / r_d, 1 / r_m])
    # where the estimate has QUEST's down, in magnetic north, east, down, and the measured field
    d = np.arcsin(field[2]) if dip is None else dip
    down = (turn.inv() * r_nb * (turn * found).inv()).apply([0, 0, 1])
    tilt = np.array([down[1], -down[0]])
    if dip is not None:  # of the quaternions' difference
        tilt = 2.0 * (turn.inv() * (turn * found) * r_nb.inv() * turn).as_quat()[:2]
    z = np.r_[tilt, np.tan(d) * tilt[0] - np.arctan2(field[1], field[0])]
    R = turn.as_matrix() @ quest_r(r_d, r_m, d, dip_is_measured=dip is None) @ turn.as_matrix().T
    want = updated(P6, omega, r_nb, np.eye(3), turn.apply(z), R)
    w = feed(flt, x, P, dt, rate, acc, mag)
    assert_is(x, P, *want)
    assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == s.ACCEPTED


@pytest.mark.parametrize("measurements", ["quest", "vectors"])
def test_field_of_measured_dip_is_a_heading(measurements):
    """No accelerometer: the field alone, as the angle of its horizontal part."""
    flt = QuestEkf(measurements=measurements, **SAMPLE)
    P6 = some_covariance(8, 0.1)
    x, P = begun(flt, P6=P6)
    rate, dt, _, mag = a_sample()
    P6, omega, r_nb = predicted(flt, P6, np.zeros(3), TURNED, rate, dt)
    v = r_nb.apply(unit(mag))
    across = np.hypot(v[0], v[1])
    row = heading_row(r_nb, [across, 0.0, v[2]])
    z = across * np.arctan2(v[1], v[0])
    R = np.array([[0.25**2 / dt]])
    want = updated(P6, omega, r_nb, row[None, :], np.array([z]), R)
    w = feed(flt, x, P, dt, rate, NO_ACC, mag)
    assert_is(x, P, *want)
    assert w[m.D_MAG] == pytest.approx(z, rel=1e-9)
    assert np.isnan(w[m.D_MAG + 1])


@pytest.mark.parametrize("dip", [None, DIP])
def test_accelerometer_alone_is_a_direction(dip):
    """Two rows, heading open."""
    flt = QuestEkf(dip=dip, **SAMPLE)
    P6 = some_covariance(8, 0.1)
    x, P = begun(flt, P6=P6)
    rate, dt, acc, _ = a_sample()
    P6, omega, r_nb = predicted(flt, P6, np.zeros(3), TURNED, rate, dt)
    v = r_nb.apply(unit(-acc))
    R = 1.5**2 / (G * np.linalg.norm(acc)) / dt * np.eye(2)
    want = updated(P6, omega, r_nb, np.eye(3)[:2], np.array([v[1], -v[0]]), R)
    w = feed(flt, x, P, dt, rate, acc)
    assert_is(x, P, *want)
    np.testing.assert_allclose(w[m.D_ACC], v[0], atol=1e-9)


# --- QUEST ------------------------------------------------------------------------------------


def test_quest_in_closed_form_solves_wahbas_problem():
    rng = np.random.default_rng(2)
    for _ in range(50):
        down, mag = (unit(v) for v in rng.standard_normal((2, 3)))
        dip, weights = rng.uniform(-1.4, 1.4), rng.uniform(0.01, 1.0, 2)
        got = u.quest(*down, *mag, np.sin(dip), *weights, 1.0, 0.0)
        want = wahba(down, mag, dip, weights)
        assert (rotation(got) * want.inv()).magnitude() < 1e-7  # of SciPy's eigenvalue
        turned = u.quest(*down, *mag, np.sin(dip), *weights, np.cos(0.4), np.sin(0.4))
        assert (rotation(turned) * (Rotation.from_euler("Z", 0.4) * want).inv()).magnitude() < 1e-7
        measured = u.quest(*down, *mag, np.nan, *weights, 1.0, 0.0)
        fits = wahba(down, mag, np.arcsin(down @ mag), [1.0, 1e-6])
        assert (rotation(measured) * fits.inv()).magnitude() < 1e-7


def test_parallel_vectors_have_no_quest_and_are_flagged():
    assert np.isnan(u.quest(0.0, 0.0, 1.0, 0.0, 5e-4, 1.0, np.nan, 1.0, 1.0, 1.0, 0.0)).all()
    for measurements in ("quest", "vectors"):
        found = []
        for mag in ([0.0, 0.0, 5e-5], np.empty(0)):
            flt = QuestEkf(measurements=measurements)
            x, P = start(flt, [1.0, 0, 0, 0])
            w = feed(flt, x, P, 0.01, np.zeros(3), [0.3, 0, -G], mag)
            found.append((x, P, w))
        assert np.array_equal(found[0][1], found[1][1])
        assert np.array_equal(quat(found[0][0]), quat(found[1][0]))
        assert int(found[0][0][m.STATUS]) & s.MAG_REJECTED
        assert found[0][2][m.D_MAG + 6] == s.REJECTED_INVALID


def test_vectors_that_contradict_each_other_leave_a_finite_quaternion():
    """Half a turn off within their plane, with the same weight: any answer is as good."""
    q = u.quest(0.0, 0.0, 1.0, 1.0, 0.0, 0.0, -1.0 + 1e-16, 1.0, 1.0, 1.0, 0.0)
    assert np.linalg.norm(q) == pytest.approx(1.0, rel=1e-12)


# --- covariance ---------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_innovation_beyond_the_gate_is_weighed_down_until_it_lies_on_it(sign):
    flt = QuestEkf(gate=3.0)
    before = some_covariance(2)
    x, P = begun(flt, P6=before)
    w = np.zeros(k.W_SIZE)
    h = np.r_[np.zeros(3), 0.3, -0.7, 0.2]
    raised = (40.0 / 3.0) ** 2 - h @ before @ h
    left, expected, accepted = u.update_turn(x, P, flt._params(), w, *h[3:], sign * 40.0, 0.05)
    assert not accepted
    assert left == sign * 40.0
    assert expected == pytest.approx(h @ before @ h + 0.05, rel=1e-13)
    gain = before @ h / (h @ before @ h + raised)
    want = seven(before - np.outer(gain, h @ before), scalar_first(TURNED))
    np.testing.assert_allclose(P, want, atol=1e-13)


def test_what_turns_the_frame_turns_the_errors_with_it():
    """Of b they are the same before and after."""
    flt = QuestEkf()
    P6 = some_covariance(5)
    x, P = begun(flt, P6=P6)
    e = Rotation.from_euler("ZYX", [1.2, 0.3, -0.5])
    x[m.Q : m.Q + 4] = scalar_first(e * TURNED)
    c.turn_frame(x, P, np.zeros(k.W_SIZE), *scalar_first(TURNED))
    M = np.block([[np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), e.as_matrix()]])
    np.testing.assert_allclose(P, seven(M @ P6 @ M.T, scalar_first(e * TURNED)), atol=1e-14)
    np.testing.assert_allclose(x[lay.Q_P : lay.Q_P + 4], quat(x), atol=1e-15)


def test_field_that_comes_late_turns_the_heading_and_the_tilt_errors_with_it():
    """Tilt is surer about one axis of the box than about the other, which stays so."""
    flt = QuestEkf(std_heading=0.2)
    x, P = start(flt, [1.0, 0, 0, 0])
    x[m.ALIGNED] = m.TILT
    P[:] = seven(np.diag([1.0, 1.0, 1.0, 0.01, 0.04, 0.0]), quat(x))
    yaw, dt = 0.8, 1e-4
    mag = Rotation.from_euler("Z", yaw).inv().apply(FIELD_N)
    feed(flt, x, P, dt, np.zeros(3), NO_ACC, mag)
    assert rotation(quat(x)).as_rotvec() == pytest.approx([0, 0, yaw], abs=1e-12)
    turn = Rotation.from_euler("Z", yaw).as_matrix()
    want = turn @ np.diag([0.01, 0.04, 0.0]) @ turn.T + np.diag([0, 0, 0.2**2])
    got = 16.0 * tangent(quat(x)).T @ P[3:, 3:] @ tangent(quat(x))
    np.testing.assert_allclose(got, want, atol=2 * flt.gyr_noise**2 * dt)


def test_a_field_left_out_is_not_weighed_by_the_time_it_was_gone():
    flt = QuestEkf()
    x, P = begun(flt)
    at_rest = TURNED.inv().apply([0, 0, -G])
    feed(flt, x, P, 0.01, np.zeros(3), at_rest, TURNED.inv().apply(FIELD_N))
    w = feed(flt, x, P, 0.02, np.zeros(3), at_rest, TURNED.inv().apply(3 * FIELD_N))
    assert w[m.D_MAG + 6] == s.REJECTED_DISTURBED
    assert x[lay.T_MAG] == x[lay.T_ACC] == 0.02


def test_resets_give_tilt_and_heading_their_deviations():
    flt = QuestEkf()
    P6, w, q = some_covariance(6), np.zeros(k.W_SIZE), scalar_first(TURNED)
    x, P = begun(flt, P6=P6)
    c.reset_heading(x, P, w, 0.2**2)
    want = P6.copy()
    want[5], want[:, 5] = 0.0, 0.0
    want[5, 5] = 0.04
    np.testing.assert_allclose(P, seven(want, q), atol=1e-14)
    assert np.array_equal(P, P.T)
    c.reset_attitude(x, P, w, 0.03**2, 0.5**2)
    want[3:], want[:, 3:] = 0.0, 0.0
    want[3:, 3:] = np.diag([0.03**2, 0.03**2, 0.5**2])
    np.testing.assert_allclose(P, seven(want, q), atol=1e-15)
    c.write_std(x, P, w)
    np.testing.assert_allclose(x[m.STD_ATT : m.STD_ATT + 3], [0.03, 0.03, 0.5], rtol=1e-12)


def test_correction_moves_along_the_sphere():
    x, _ = begun(QuestEkf())
    phi, w = np.array([0.5, -1.2, 0.8]), np.zeros(k.W_SIZE)
    w[lay.W_DX : lay.W_DX + 7] = np.r_[0.1, 0.2, 0.3, tangent(quat(x)) @ phi]
    u.inject(x, w)
    assert (rotation(quat(x)) * (Rotation.from_rotvec(phi) * TURNED).inv()).magnitude() < 1e-14
    np.testing.assert_allclose(x[lay.RATE : lay.RATE + 3], [0.1, 0.2, 0.3], atol=1e-16)
    assert not w[lay.W_DX : lay.W_DX + 7].any()


@pytest.mark.parametrize("parameters", VARIANTS, ids=str)
def test_covariance_stays_symmetric_and_along_the_sphere(parameters):
    flt = QuestEkf(acc_noise=0.01, mag_noise=0.001, gyr_noise=1e-3, **parameters)
    rng = np.random.default_rng(9)
    state = flt.init()
    x, P, r_nb = state.x, state.P, TURNED
    for i in range(200):
        rate = 3.0 * rng.standard_normal(3)
        r_nb = r_nb * Rotation.from_rotvec(rate * 0.01)
        acc, mag = r_nb.inv().apply([0, 0, -G]), r_nb.inv().apply(FIELD_N)
        feed(flt, x, P, 0.01 * i, rate, acc, mag if i % 3 == 0 else np.empty(0))
        assert np.array_equal(P, P.T)
        values = np.linalg.eigvalsh(P)
        assert values[0] > -1e-15 * values[-1]  # none along the quaternion, but for rounding
        assert values[1] > 0.0
        assert abs(np.linalg.norm(quat(x)) - 1.0) < 1e-15
    off_sphere = P[3:, 3:] @ x[lay.Q_P : lay.Q_P + 4]
    if flt.integration == "corrected":  # rounding of the covariance at the start is left
        assert np.abs(off_sphere).max() < 1e-15 * flt.std_heading**2


@pytest.mark.parametrize(("clipped", "gap"), [(True, False), (False, True), (False, False)])
def test_unseen_rates_widen_the_covariance(clipped, gap):
    flt = QuestEkf(gap_rate=0.5, gyr_range=10.0, max_gap=0.4, rate_std=1e3)
    x, P = begun(flt)
    P[3:, :] = P[:, 3:] = 0.0
    dt = 0.5 if gap else 0.1
    feed(flt, x, P, dt, [0.0, 0.0, 10.0 if clipped else 9.9], NO_ACC)
    # over a gap a constant rate is unseen, beyond the range one that stays for 0.25 s
    hidden = (0.5 * dt) ** 2 if gap else (2 * 0.25 * 0.5**2 * dt if clipped else 0.0)
    want = np.sqrt(flt.gyr_noise**2 * dt + hidden)
    # about the axis of rotation, across which J_r shrinks it; the rate's own spread is so large
    # that the gyroscope's noise is all there is
    axis = TURNED.as_matrix()[:, 2]
    row = 4.0 * tangent(quat(x)) @ axis  # tangent^T tangent is a quarter of the identity
    assert np.sqrt(row @ P[3:, 3:] @ row) == pytest.approx(want, rel=1e-6)


def test_a_sample_after_a_gap_weighs_no_more_than_the_longest_interval():
    flt = QuestEkf(max_gap=1.0, gate=np.inf)
    x, P = start(flt, [1.0, 0, 0, 0])
    feed(flt, x, P, 1000.0, np.zeros(3), [0, 0, -G])
    assert int(x[m.STATUS]) == s.GAP
    assert x[m.STD_ATT] == pytest.approx(flt.acc_noise / G, rel=0.01)
    assert x[m.STD_ATT + 2] > 3.0  # nobody has seen the heading


def test_first_sample_of_a_given_attitude_is_not_weighed_by_the_time_since_zero():
    flt = QuestEkf()
    state = flt.init(attitude=scalar_first(TURNED))
    x, P = state.x.copy(), state.P.copy()
    feed(flt, x, P, 1e6, np.zeros(3), [5.0, 0, -G])
    assert (rotation(quat(x)) * TURNED.inv()).magnitude() < 1e-15
    deviations = [flt.std_tilt, flt.std_tilt, flt.std_heading]
    np.testing.assert_allclose(x[m.STD_ATT : m.STD_ATT + 3], deviations, rtol=1e-12)


def test_printed_order_turns_with_the_rate_of_the_sample_before():
    lag = {}
    for integration in ("corrected", "printed"):
        flt = QuestEkf(integration=integration, rate_std=1e3, gyr_noise=1e-3)
        x, P = begun(flt)
        for i in range(4):  # at rest first: then the rate is known
            feed(flt, x, P, 0.01 * (i + 1), [0.0, 0.0, 1.0 * i], NO_ACC)
        lag[integration] = 0.06 - (TURNED.inv() * rotation(quat(x))).as_rotvec()[2]
    assert lag["corrected"] == pytest.approx(0.0, abs=1e-7)
    # the last sample's 0.03 rad are missing; Euler's turn is short by 0.02**3 / 12
    assert lag["printed"] == pytest.approx(0.03, abs=1e-6)


@pytest.mark.parametrize(("rate", "same"), [(4.0, False), (6.0, True)])
def test_large_turns_are_taken_exactly_by_both(rate, same):
    found = []
    for integration in ("corrected", "printed"):
        flt = QuestEkf(integration=integration)
        x, P = begun(flt, (0.0, 0.0, rate), some_covariance(3))
        feed(flt, x, P, 0.1, [0.0, 0.0, rate], NO_ACC)
        found.append((quat(x), P))
    assert np.array_equal(found[0][0], found[1][0]) == same
    assert np.array_equal(found[0][1], found[1][1]) == same
