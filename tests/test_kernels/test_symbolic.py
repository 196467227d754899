"""F and H of the Kalman filters, derived by SymPy from their models and error definitions.

Each is derived once, from products of quaternions, the turn of a constant rate and the rotation of
vectors; then compared with what the kernel writes at random states.
"""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import scalar_first

from strapdown.attitude import RobustEskf
from strapdown.kernels import indirect_ekf, mekf, two_stage
from strapdown.kernels import memory as m
from strapdown.kernels import quest_ekf_covariance as quest_c
from strapdown.kernels import quest_ekf_layout as quest_k
from strapdown.kernels import quest_ekf_update as quest_u
from strapdown.kernels import robust_eskf_covariance as robust_c
from strapdown.kernels import robust_eskf_layout as robust_k
from strapdown.kernels import robust_eskf_update as robust_u

sp = pytest.importorskip("sympy")

DT = sp.Symbol("dt", positive=True)
QS = sp.Matrix(sp.symbols("q_w q_x q_y q_z"))
PHI = sp.Matrix(sp.symbols("phi_x phi_y phi_z"))  # turn of the interval
OMEGA = sp.Matrix(sp.symbols("w_x w_y w_z"))
DTHETA = sp.Matrix(sp.symbols("dtheta_x dtheta_y dtheta_z"))
DB = sp.Matrix(sp.symbols("db_x db_y db_z"))
V = sp.Matrix(sp.symbols("v_x v_y v_z"))  # a direction in n
RANDOM = range(5)


# --- algebra ------------------------------------------------------------------------------


def mul(a, b):
    vec = a[0] * b[1:, 0] + b[0] * a[1:, 0] + sp.Matrix(a[1:]).cross(sp.Matrix(b[1:]))
    return sp.Matrix([a[0] * b[0] - sp.Matrix(a[1:]).dot(sp.Matrix(b[1:])), *vec])


def conj(q):
    return sp.Matrix([q[0], *(-q[1:, 0])])


def turn(phi):
    """Quaternion of a rotation vector, closed form."""
    angle = sp.sqrt(phi.dot(phi))
    return sp.Matrix([sp.cos(angle / 2), *(sp.sin(angle / 2) / angle * phi)])


def small(phi):
    """The same to first order, which is all that a derivative at zero needs."""
    return sp.Matrix([1, *(phi / 2)])


def rotate(q, v):
    """Vector in n of one in b, for a quaternion of any length."""
    return sp.Matrix(mul(mul(q, sp.Matrix([0, *v])), conj(q))[1:])


def zero(*names):
    return {s: 0 for vector in names for s in vector}


def numeric(expression, *symbols):
    """NumPy function of the symbols, flattened."""
    return sp.lambdify([s for v in symbols for s in (v if isinstance(v, sp.Matrix) else [v])],
                       expression, "numpy", cse=True)  # fmt: skip


def close(got, want, **tolerance):
    np.testing.assert_allclose(got, np.array(want, dtype=float), **{"atol": 1e-14, **tolerance})


def attitude(seed):
    return scalar_first(Rotation.random(random_state=np.random.default_rng(seed)))


def draw(seed, size, n=3):
    return size * np.random.default_rng(100 + seed).standard_normal(n)


def direction(seed):
    v = draw(seed, 1.0)
    return v / np.linalg.norm(v)


# --- error states ------------------------------------------------------------------------


@cache
def body_error_transition():
    """(dtheta_b, dbg) after an interval: q_true = q dtheta_b, b_true = b + dbg.

    The estimate turns by phi, the truth by ``phi - dbg dt``.
    """
    # exp(-phi) exp(phi - dbg dt): the part of it that is linear in dbg, at dbg = 0
    truth = mul(small(DTHETA), turn(PHI - DB * DT))
    error = 2 * sp.Matrix(mul(conj(turn(PHI)), truth)[1:])
    J = error.jacobian([*DTHETA, *DB]).subs(zero(DTHETA, DB))
    return numeric(J, PHI, DT)


@cache
def body_error_to_first_order():
    """The same to first order in the length of the interval, the turn being ``omega dt``."""
    truth = mul(small(DTHETA), small((OMEGA - DB) * DT))
    error = 2 * sp.Matrix(mul(conj(small(OMEGA * DT)), truth)[1:])
    J = error.jacobian([*DTHETA, *DB]).subs(zero(DTHETA, DB))
    J = J.subs(DT, 0) + DT * J.diff(DT).subs(DT, 0)
    return numeric(J, OMEGA, DT)


@cache
def vector_rows():
    """A vector of n seen in b, by the body's attitude error: 3x3."""
    q = mul(QS, small(DTHETA))
    seen = rotate(conj(q), V)
    return numeric(seen.jacobian(DTHETA).subs(zero(DTHETA)), QS, V)


def by_blocks(w, a, b):
    return np.hstack((w[a : a + 9].reshape(3, 3), w[b : b + 9].reshape(3, 3)))


# --- multiplicative and indirect EKF --------------------------------------------------------


@pytest.mark.parametrize("seed", RANDOM)
def test_transition_of_the_mekf(seed):
    phi, dt = draw(seed, 0.03), 0.02
    w = np.zeros(mekf.W_SIZE)
    mekf.transition(w, *phi, dt)
    want = np.array(body_error_transition()(*phi, dt))
    close(by_blocks(w, mekf.W_A, mekf.W_B)[:, :3], want[:, :3])
    # the right Jacobian is of second order: |phi|^3 / 24 is left out
    close(by_blocks(w, mekf.W_A, mekf.W_B), want, atol=1.1 * dt * np.linalg.norm(phi) ** 3 / 24)


@pytest.mark.parametrize("size", [0.01, 0.5, 3.0])
@pytest.mark.parametrize("seed", RANDOM)
def test_exact_transition_of_the_indirect_ekf(seed, size):
    phi, dt, w = draw(seed, size), 0.02, np.zeros(indirect_ekf.W_SIZE)
    f2, f3, _, _ = indirect_ekf.coefficients(phi @ phi)
    indirect_ekf.transition_exact(w, *phi, dt, f2, f3)
    want = body_error_transition()(*phi, dt)
    close(by_blocks(w, mekf.W_A, mekf.W_B), want)


@pytest.mark.parametrize("seed", RANDOM)
def test_truncated_transition_of_the_indirect_ekf(seed):
    omega, dt, w = draw(seed, 1.0), 0.02, np.zeros(indirect_ekf.W_SIZE)
    indirect_ekf.transition_truncated(w, *(omega * dt), dt)
    close(by_blocks(w, mekf.W_A, mekf.W_B), body_error_to_first_order()(*omega, dt))


def rows_written(enter, count, states, cell):
    """Rows of H, read from what unit innovations do to an error state that is sure by 1e-9.

    With P = 1e-9 I and R = 1 the gain is 1e-9 of the row, and one scalar hardly moves the next.
    """
    tiny, rows = 1e-9, []
    for i in range(count):
        P, w = tiny * np.eye(states), np.zeros(200)
        enter(P, w, np.eye(count)[i])
        rows.append(w[cell : cell + states] / tiny)
    return np.array(rows)


@pytest.mark.parametrize("seed", RANDOM)
def test_directions_and_vectors_of_both(seed):
    q, v = attitude(seed), direction(seed)
    seen = np.array(numeric(rotate(conj(QS), V), QS, V)(*q, *v)).ravel()
    want = np.hstack((vector_rows()(*q, *v), np.zeros((3, 3))))

    def of_mekf(P, w, e):
        mekf.update_direction(P, w, *seen, *(seen + e), 1.0, np.inf)

    def of_indirect(P, w, e):
        indirect_ekf.update_vector(P, w, m.D_MAG, *seen, *(seen + e), 1.0, np.inf)

    for enter in (of_mekf, of_indirect):
        # each scalar changes P by its 1e-9th part; 1 + 1e-9 less 1 has seven digits
        close(rows_written(enter, 3, 6, mekf.W_DX), want, atol=1e-7)


@pytest.mark.parametrize("seed", RANDOM)
def test_heading_of_the_mekf(seed):
    """How far the field, seen with the estimate, is off north; its unit is the unit field."""
    q, v = attitude(seed), direction(seed)
    truth = mul(QS, small(DTHETA))
    level = rotate(QS, rotate(conj(truth), V))
    angle = sp.atan2(level[1], level[0])
    row = angle.diff(DTHETA).subs(zero(DTHETA))
    across = np.hypot(v[0], v[1])
    north = np.array([across, 0.0, v[2]])  # the reference of this dip
    # that angle is of the field seen less the predicted; the update takes its negative
    want = -across * np.array(numeric(row, QS, V)(*q, *north), dtype=float).ravel()
    to_b = Rotation.from_quat(q[[1, 2, 3, 0]]).inv()

    def enter(P, w, e):
        mekf.update_heading(
            P, w, e[0] / across, *to_b.apply([0, 0, 1]), *to_b.apply(north), 1.0, np.inf
        )

    got = rows_written(enter, 1, 6, mekf.W_DX)[0]
    close(got, np.r_[want, np.zeros(3)], atol=1e-7)


def test_star_tracker_of_the_indirect_ekf():
    """``dq = q^-1 q_star``: its vector part, of a star that is the truth."""
    q_star = mul(QS, small(DTHETA))
    part = sp.Matrix(mul(conj(QS), q_star)[1:])
    J = part.jacobian(DTHETA).subs(zero(DTHETA))
    want = numeric(J, QS)(*attitude(1))
    x = np.zeros(indirect_ekf.X_SIZE)
    x[m.Q : m.Q + 4] = attitude(1)
    h = 1e-3  # of a rotation whose scalar part is close to one
    for i, e in enumerate(np.eye(3)):
        star = scalar_first(
            Rotation.from_quat(x[m.Q : m.Q + 4][[1, 2, 3, 0]]) * Rotation.from_rotvec(2 * h * e)
        )
        P, w = 1e-9 * np.eye(6), np.zeros(indirect_ekf.W_SIZE)
        indirect_ekf.update_star(x, P, w, *star, 1.0, np.inf)
        got = w[mekf.W_DX : mekf.W_DX + 6] / (1e-9 * np.sin(h))
        close(got, np.r_[np.array(want, dtype=float)[i], np.zeros(3)], atol=1e-7)


# --- two stages, and rates with quaternion ----------------------------------------------------


@pytest.mark.parametrize("seed", RANDOM)
def test_both_models_of_the_two_stage_filter(seed):
    """Up and magnetic north of east-north-up, in b: sums of squares, for any length of q."""
    q = attitude(seed)
    for model, v in (
        (lambda w: two_stage.gravity_model(w, *q), [0, 0, 1]),
        (lambda w: two_stage.field_model(w, *q, 1.0), [0, 1, 0]),
    ):
        h = rotate(conj(QS), sp.Matrix(v))
        w = np.zeros(two_stage.W_SIZE)
        model(w)
        close(w[two_stage.W_Z : two_stage.W_Z + 3], np.ravel(numeric(h, QS)(*q)))
        H = w[two_stage.W_H : two_stage.W_H + 12].reshape(3, 4)
        close(H, numeric(h.jacobian(QS), QS)(*q))


@pytest.mark.parametrize("seed", RANDOM)
def test_turn_of_the_quaternion(seed):
    """Of the two-stage filter and of rates with quaternion: exact, and as both are printed."""
    phi = draw(seed, 0.5)
    e = scalar_first(Rotation.from_rotvec(phi))
    exact = numeric(mul(QS, turn(PHI)).jacobian(QS), PHI)(*phi)
    printed = (QS + mul(QS, sp.Matrix([0, *OMEGA])) / 2 * DT).jacobian(QS)
    printed = numeric(printed, OMEGA, DT)(*phi, 1.0)
    for A, write, at in (
        (two_stage.W_A, two_stage.transition, two_stage.W_SIZE),
        (quest_k.W_A, quest_c.turn_matrix, quest_k.W_SIZE),
    ):
        w = np.zeros(at)
        write(w, *e)
        close(w[A : A + 16].reshape(4, 4), exact)
        write(w, 1.0, *(0.5 * phi))
        close(w[A : A + 16].reshape(4, 4), printed)


@pytest.mark.parametrize("size", [0.05, 0.8])
@pytest.mark.parametrize("seed", RANDOM)
def test_quaternion_by_rate(seed, size):
    q, omega, dt = attitude(seed), draw(seed, size / 0.1), 0.1
    J = mul(QS, turn(OMEGA * DT)).jacobian(OMEGA)
    after = np.ravel(numeric(mul(QS, turn(OMEGA * DT)), QS, OMEGA, DT)(*q, *omega, dt))
    w = np.zeros(quest_k.W_SIZE)
    quest_c.rate_matrix(w, *after, *(omega * dt), dt)
    got = w[quest_k.W_B : quest_k.W_B + 12].reshape(4, 3)
    # below 0.1 rad a series, which leaves out |phi|^4 / 720 of dt / 2
    close(got, numeric(J, QS, OMEGA, DT)(*q, *omega, dt), atol=dt * 1e-7)
    printed = (QS + mul(QS, sp.Matrix([0, *OMEGA])) / 2 * DT).jacobian(OMEGA)
    quest_c.rate_matrix(w, *q, 0.0, 0.0, 0.0, dt)
    close(got, numeric(printed, QS, DT)(*q, dt))  # a view of the scratch


def memory_of_quest(q, dip=np.nan, declination=0.0):
    x, p = np.zeros(quest_k.X_SIZE), np.zeros(quest_k.P_SIZE)
    x[m.Q : m.Q + 4] = x[quest_k.Q_P : quest_k.Q_P + 4] = q
    p[m.P_COS_D], p[m.P_SIN_D] = np.cos(declination), np.sin(declination)
    p[quest_k.P_GATE], p[quest_k.P_SIN_DIP] = np.inf, np.sin(dip)
    return x, p


@cache
def quaternion_rows():
    """Components of a vector of n, seen in b by the truth and turned back by the estimate.

    As the source has it, the matrix is divided by the norm squared: nothing comes of a length.
    """
    dq = sp.Matrix(sp.symbols("dq_w dq_x dq_y dq_z"))
    q = QS + dq
    level = rotate(QS, rotate(conj(q), V)) / q.dot(q)
    return numeric(level.jacobian(dq).subs(zero(dq)), QS, V)


@pytest.mark.parametrize("declination", [0.0, 0.4])
@pytest.mark.parametrize("seed", RANDOM)
def test_vectors_of_rates_and_quaternion(seed, declination):
    """Down to magnetic north and east, the field to the east and in dip."""
    q, dip = attitude(seed), 0.9
    x, p = memory_of_quest(q, dip, declination)
    magnetic = Rotation.from_euler("Z", declination).as_matrix()
    north, east, down = magnetic.T
    field = np.cos(dip) * north + np.sin(dip) * down
    across = np.cos(dip) * down - np.sin(dip) * north
    of_down = np.array(quaternion_rows()(*q, *down), dtype=float)
    of_field = np.array(quaternion_rows()(*q, *field), dtype=float)

    def tilt(P, w, e):
        quest_u.update_down(x, P, p, w, *e, 1.0, 1.0)

    def magnetic_field(P, w, e):
        c, d = np.cos(dip), np.sin(dip)
        quest_u.update_field(x, P, p, w, c - d * e[1], e[0], d + c * e[1], c, d, 1.0)

    got = rows_written(tilt, 2, 7, quest_k.W_DX)
    close(got[:, 3:], np.array([north, east]) @ of_down, atol=1e-7)
    assert not got[:, :3].any()
    got = rows_written(magnetic_field, 2, 7, quest_k.W_DX)
    close(got[:, 3:], np.array([east, across]) @ of_field, atol=1e-7)


@pytest.mark.parametrize("seed", RANDOM)
def test_quest_measures_the_quaternion_along_the_sphere(seed):
    """H is the identity: the turn from the estimate to the quaternion found is ``2 dq q^-1``."""
    q = attitude(seed)
    x, p = memory_of_quest(q)
    dq = sp.Matrix(sp.symbols("dq_w dq_x dq_y dq_z"))
    turned = 2 * sp.Matrix(mul(QS + dq, conj(QS))[1:])
    J = np.array(numeric(turned.jacobian(dq), QS)(*q), dtype=float)
    for u in np.eye(3):

        def enter(P, w, e, u=u):
            quest_u.update_turn(x, P, p, w, *u, e[0], 1.0)

        close(rows_written(enter, 1, 7, quest_k.W_DX)[0, 3:], u @ J, atol=1e-7)


@pytest.mark.parametrize("i", range(3))
def test_gyroscope_measures_the_rates(i):
    def enter(P, w, e):
        quest_u.update_rate(P, w, i, e[0], 1.0)

    close(rows_written(enter, 1, 7, quest_k.W_DX)[0], np.eye(7)[i], atol=1e-7)


# --- robust error-state filter --------------------------------------------------------------


@cache
def robust_model():
    """(phi_n, dv_n, dbg, dba, dM) after a short interval, to first order in its length.

    q_true = phi_n q; the rate is ``(I + M)(w - b)``, the velocity gains ``C (f - b_a) + g``.
    """
    phi, dv = sp.Matrix(sp.symbols("p_n p_e p_d")), sp.Matrix(sp.symbols("dv_n dv_e dv_d"))
    dba, dm = sp.Matrix(sp.symbols("a_x a_y a_z")), sp.Matrix(3, 3, sp.symbols("m_:9"))
    errors = [*phi, *dv, *DB, *dba, *dm]
    truth = mul(mul(small(phi), QS), small((sp.eye(3) + dm) * (OMEGA - DB) * DT))
    after = mul(QS, small(OMEGA * DT))
    phi_after = 2 * sp.Matrix(mul(truth, conj(after))[1:])
    gained = (rotate(mul(small(phi), QS), V - dba) - rotate(QS, V)) * DT
    J = sp.Matrix([*phi_after, *(dv + gained)]).jacobian(errors)
    J = J.subs({e: 0 for e in errors})
    return numeric(J.subs(DT, 0), QS), numeric(J.diff(DT).subs(DT, 0), QS, OMEGA, V)


@pytest.mark.parametrize("seed", RANDOM)
def test_transition_of_the_robust_filter(seed):
    q, omega, force, dt = attitude(seed), draw(seed, 1.0), draw(seed + 50, 5.0), 0.1
    at_start, by_time = robust_model()
    close(at_start(*q), np.eye(6, 21))
    c_nb = Rotation.from_quat(q[[1, 2, 3, 0]]).as_matrix()
    sums = np.r_[(dt * c_nb).ravel(), omega * dt, c_nb @ force * dt, dt]
    phi = np.eye(robust_c.N)
    for i in range(robust_c.N):
        robust_c.transpose_on_row(phi, i, sums, 0)
    rate = (phi[:6, :21] - np.eye(6, 21)) / dt
    close(rate, by_time(*q, *omega, *force), atol=1e-13)
    close(phi[6:], np.eye(robust_c.N)[6:])


@pytest.mark.parametrize("seed", RANDOM)
def test_rows_of_the_robust_filter(seed):
    """Velocity, bias at rest, and the heading of the field with the magnetometer's delay.

    The field's heading also falls with tilt, by the tangent of the dip. That column is left out on
    purpose: a disturbed field says nothing about tilt.
    """
    rng = np.random.default_rng(seed)
    flt = RobustEskf(mag_delay_std=0.01)
    (x, P), p, w = flt._memory(), flt._params(), np.zeros(robust_k.W_SIZE)
    field, turning, delay = rng.standard_normal(3) * 2e-5, rng.standard_normal(2) * 1e-5, 0.02
    x[robust_k.ATT], x[robust_k.DELAY] = 1.0, delay
    x[robust_k.OPEN : robust_k.OPEN + robust_c.INTERVAL] = np.r_[
        0.1 * np.eye(3).ravel(), np.zeros(3), np.zeros(3), 0.1
    ]
    x[robust_k.FIELD : robust_k.FIELD + 6] = np.r_[field, turning, 1.0]
    x[robust_k.QUIET] = 1e9  # at rest
    robust_u.close_interval(x, P, p, w)
    entered = w[robust_k.R_MEASURED :][: robust_k.MEASURED * int(w[robust_k.R_COUNT])]
    entered = entered.reshape(-1, robust_k.MEASURED)[:, :2]
    plain = [*range(robust_c.VEL, robust_c.VEL + 3), *range(robust_c.EBG, robust_c.EBG + 3)]
    np.testing.assert_array_equal(entered[:6], np.c_[plain, np.zeros(6)])
    phi, lag = sp.Matrix(sp.symbols("p_n p_e p_d")), sp.Symbol("lag")
    mn, me, md, tn, te, d0 = sp.symbols("mn me md tn te d0")
    # What was measured stood back by the delay; with the true delay and attitude it is north.
    seen = sp.Matrix([mn - (d0 + lag) * tn, me - (d0 + lag) * te, md])
    true = rotate(small(phi), seen)
    # the heading error that would explain what is left, by an error of each kind
    off = sp.atan2(true[1], true[0])
    J = sp.Matrix([off]).jacobian([*phi, lag]).subs({**zero(phi), lag: 0})
    J = np.ravel(numeric(J, sp.Matrix([mn, me, md, tn, te, d0]))(*field, *turning, delay))
    # z = -atan2(seen): zero of the truth is z less the rows times the errors
    assert entered[6, 0] == robust_c.PHI + 2
    close(J[2], 1.0, atol=1e-12)
    close(entered[6, 1], J[3], rtol=1e-10)
    assert abs(J[0]) + abs(J[1]) > 0.0
