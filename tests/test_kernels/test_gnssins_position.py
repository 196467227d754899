"""Position filter of thesis E: F and H against the mechanisation, Q against Van Loan."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from truth.kernel_step import scalar_first

from strapdown.kernels import memory as m
from strapdown.kernels import status as s
from strapdown.kernels.gnssins import fix as k
from strapdown.kernels.gnssins import layout as lay
from strapdown.kernels.gnssins import position, step
from strapdown.navigation import Gnssins

LLA = np.array([0.69, 0.28, 250.0])
TURN = Rotation.from_euler("ZYX", [2.1, -0.4, 0.6])
DENSITIES = (0.02, 0.003, 0.0004)
I3, O3 = np.eye(3), np.zeros((3, 3))


def memory(flt):
    """Memory as while navigating at LLA, a few m/s, turned, and its scratch."""
    state = flt.init()
    x, P, p, w = state.x, state.P, flt._params(), np.zeros(lay.W_SIZE)
    x[m.T] = 100.0
    x[m.Q : m.Q + 4] = scalar_first(TURN)
    x[m.LLA : m.LLA + 3] = LLA
    x[m.V : m.V + 3] = 3.0, -5.0, 0.5
    x[lay.NAVIGATING] = 1.0
    k.earth_here(x)
    return x, P, p, w


def covariance(n, seed=2):
    a = np.random.default_rng(seed).standard_normal((n, n))
    return a @ a.T + 0.1 * np.eye(n)


def printed_t(states, dt):
    """(7.7.13) and (7.7.19), rebuilt from (7.7.16)."""
    T = np.block(
        [[I3, dt * I3, O3, O3], [O3, I3, dt * I3, dt * I3], [O3, O3, I3, I3], [O3, O3, O3, I3]]
    )
    return T[:states, :states]


def consistent_f(states):
    F = np.block([[O3, I3, O3, O3], [O3, O3, I3, I3], [O3, O3, O3, O3], [O3, O3, O3, O3]])
    return F[:states, :states]


@pytest.mark.parametrize("states", [9, 12])
@pytest.mark.parametrize("printed", [False, True])
def test_covariance_is_carried_by_the_dense_matrix(states, printed):
    dt = 1.0 if printed else 0.7
    P = np.zeros((19, 19))
    P[:7, :7] = covariance(7)
    P[7 : 7 + states, 7 : 7 + states] = covariance(states, 3)
    T = printed_t(states, dt) if printed else expm(dt * consistent_f(states))
    want = T @ P[7 : 7 + states, 7 : 7 + states] @ T.T
    position.transition(P, 7, states, dt, float(printed))
    np.testing.assert_allclose(P[7 : 7 + states, 7 : 7 + states], want, atol=1e-12)
    assert np.array_equal(P[:7, :7], covariance(7))
    assert np.array_equal(P, P.T)


@pytest.mark.parametrize("states", [9, 12])
def test_consistent_noise_is_van_loans_integral(states):
    dt, n = 1.3, states
    F = consistent_f(n)
    Q = np.diag(np.repeat([0.0, *DENSITIES], 3))[:n, :n]
    big = expm(dt * np.block([[-F, Q], [np.zeros((n, n)), F.T]]))
    want = big[n:, n:].T @ big[:n, n:]
    P = np.zeros((7 + n, 7 + n))
    position.add_noise(P, 7, n, dt, *DENSITIES, 0.0)
    np.testing.assert_allclose(P[7:, 7:], want, atol=1e-15)
    assert np.array_equal(P, P.T)


def test_printed_noise_is_the_diagonal():
    """(7.7.22) per step of 1 s."""
    P = np.zeros((19, 19))
    position.add_noise(P, 7, 12, 1.0, 4.0, 4.0, 1.5, 1.0)
    np.testing.assert_allclose(np.diag(P)[7:], [4.0] * 9 + [1.5] * 3)
    assert np.count_nonzero(P) == 12


def errors_of(x, reference):
    """Position [m], velocity and acceleration error of a memory against another one, in n."""
    d = x[m.LLA : m.LLA + 3] - reference[m.LLA : m.LLA + 3]
    metres = d * [x[lay.R_N], x[lay.R_E], -1.0]
    return np.concatenate((metres, x[m.V : m.V + 3] - reference[m.V : m.V + 3]))


@pytest.mark.parametrize("in_body", [True, False])
def test_f_is_the_derivative_of_the_mechanisation(in_body):
    """Error states moved by hand: what the integration makes of them after a second."""
    flt = Gnssins(bias_frame="body" if in_body else "local")
    force, n, dt = TURN.inv().apply([0.3, 0.2, -9.7]), 50, 0.02

    def after(i, size):
        x, _, p, w = memory(flt)
        w[lay.W_DX : lay.W_DX + 12] = size * np.eye(12)[i]
        k.feed_back(x, p, w, 12)
        x[lay.R_N : lay.GRAVITY + 1] = memory(flt)[0][lay.R_N : lay.GRAVITY + 1]
        for _ in range(n):
            step.move(x, dt, *force)
        return x

    columns = []
    for i in range(12):
        plus, minus = after(i, 1e-2), after(i, -1e-2)
        columns.append(errors_of(plus, minus) / 2e-2)
    # linear on the flat Earth; metres from radians leave 1e-9 m of round-off over 1e-2
    want = expm(n * dt * consistent_f(12))[:6]
    np.testing.assert_allclose(np.transpose(columns), want, atol=1e-6)


def test_h_is_minus_the_derivative_of_the_residual_by_the_estimate():
    flt = Gnssins()
    x, _, p, w = memory(flt)
    x[lay.FIX_LLA : lay.FIX_LLA + 3] = LLA + [1e-6, -2e-6, 3.0]
    x[lay.FIX_V : lay.FIX_V + 3] = 1.0, 2.0, 3.0

    def residuals(dx):
        y = x.copy()
        w[lay.W_DX : lay.W_DX + 12] = dx
        k.feed_back(y, p, w, 12)
        y[lay.R_N : lay.GRAVITY + 1] = x[lay.R_N : lay.GRAVITY + 1]
        return np.array([k.residual(y, i, 0.0) for i in range(6)])

    H = np.transpose([(residuals(-1e-2 * e) - residuals(1e-2 * e)) / 2e-2 for e in np.eye(12)])
    np.testing.assert_allclose(H, np.eye(6, 12), atol=1e-6)  # round-off as above


def test_residual_is_taken_at_the_time_of_the_fix():
    x, *_ = memory(Gnssins())
    late = 0.4
    x[lay.FIX_LLA : lay.FIX_LLA + 3] = x[m.LLA : m.LLA + 3] - np.array([3.0, -5.0, 0.5]) * late / [
        x[lay.R_N], x[lay.R_E], -1.0
    ]  # fmt: skip
    got = [k.residual(x, i, late) for i in range(3)]
    np.testing.assert_allclose(got, 0.0, atol=1e-8)  # where it was, it was right


def test_update_moves_towards_the_fix_as_the_dense_filter_does():
    flt = Gnssins(std_fix_position=3.0, std_fix_velocity=2.0, receiver_sigmas=False)
    x, P, p, w = memory(flt)
    x[m.GNSS + 1] = x[lay.FIX_T] = x[m.T]
    x[lay.SINCE_FIX] = 1.0
    # axes that do not mix, as in the filter
    blocks = [covariance(4, seed) for seed in (5, 6, 7)]
    for axis, block in enumerate(blocks):
        rows = 7 + axis + 3 * np.arange(4)
        P[np.ix_(rows, rows)] = block
    before, old = P[7:, 7:].copy(), x.copy()
    metres = np.array([4.0, -3.0, 2.0])
    x[lay.FIX_LLA : lay.FIX_LLA + 3] = LLA + metres / [x[lay.R_N], x[lay.R_E], -1.0]
    x[lay.FIX_V : lay.FIX_V + 3] = x[m.V : m.V + 3] + [0.5, -0.4, 0.3]
    z = np.concatenate((metres, [0.5, -0.4, 0.3]))
    H, R = np.eye(6, 12), np.diag([9.0] * 3 + [4.0] * 3)
    gain = before @ H.T @ np.linalg.inv(H @ before @ H.T + R)
    dx, L = gain @ z, np.eye(12) - gain @ H
    k.take_fix(x, P, p, w)
    np.testing.assert_allclose(P[7:, 7:], L @ before @ L.T + gain @ R @ gain.T, atol=1e-9)
    np.testing.assert_allclose(errors_of(x, old), dx[:6], atol=1e-6)
    np.testing.assert_allclose(x[lay.ACC_ERROR : lay.ACC_ERROR + 3], dx[6:9], atol=1e-7)
    np.testing.assert_allclose(x[m.BA : m.BA + 3], -TURN.inv().apply(dx[9:]), atol=1e-7)
    np.testing.assert_allclose(w[lay.W_FIX : lay.W_FIX + 3], metres, atol=1e-7)
    assert w[lay.W_FIX + 6] == w[lay.W_FIX + 13] == s.ACCEPTED
    assert np.linalg.eigvalsh(P[7:, 7:]).min() > 0.0
    k.write_std(x, P, p)
    C_nb = TURN.as_matrix()
    want = np.sqrt(np.diag(C_nb.T @ P[16:, 16:] @ C_nb))
    np.testing.assert_allclose(x[m.STD_BA : m.STD_BA + 3], want, rtol=1e-12)


def test_force_of_a_box_at_rest_moves_nothing():
    x, *_ = memory(Gnssins())
    x[m.V : m.V + 3] = 0.0
    step.move(x, 10.0, *TURN.inv().apply([0.0, 0.0, -x[lay.GRAVITY]]))
    np.testing.assert_allclose(x[m.V : m.V + 3], 0.0, atol=1e-12)  # round-off
    np.testing.assert_allclose(x[m.LLA : m.LLA + 3], LLA, atol=1e-12)


@pytest.mark.parametrize("lat", np.radians([-89.9, -60.0, 0.0, 30.0, 89.9]))
def test_radii_and_gravity_are_those_of_the_ellipsoid(lat):
    """Textbook formulas; normal gravity of WGS-84 at the equator and the poles."""
    x, *_ = memory(Gnssins())
    x[m.LLA : m.LLA + 3] = lat, 0.3, 0.0
    k.earth_here(x)
    a, b = 6378137.0, 6356752.314245
    c, sn = np.cos(lat), np.sin(lat)
    N = a * a / np.sqrt((a * c) ** 2 + (b * sn) ** 2)
    assert x[lay.R_E] == pytest.approx(N * c, rel=1e-9)
    assert x[lay.R_N] == pytest.approx(N**3 * b * b / a**4, rel=1e-9)
    g = (a * 9.7803253359 * c * c + b * 9.8321849378 * sn * sn) / np.hypot(a * c, b * sn)
    assert x[lay.GRAVITY] == pytest.approx(g, rel=1e-9)
    x[m.LLA + 2] = 1000.0
    k.earth_here(x)
    assert x[lay.GRAVITY] == pytest.approx(g - 3.086e-3, abs=1e-5)  # free air, 0.3086 mGal/m


def test_longitude_wraps_and_latitude_stops_at_the_pole():
    x, *_ = memory(Gnssins())
    x[m.LLA : m.LLA + 2] = np.pi / 2 - 1e-9, np.pi - 1e-9
    x[m.V : m.V + 3] = 100.0, 50.0, 0.0
    k.shift(x, 1.0, 0.0, 0.0, 0.0)
    assert x[m.LLA] == pytest.approx(np.pi / 2, abs=1e-15)
    assert -np.pi < x[m.LLA + 1] < -3.14
    assert k.wrapped(-np.pi) == np.pi
    assert k.wrapped(3.0) == 3.0


BAD = {
    "latitude": (1, 1.6), "longitude": (2, 7.0), "height": (3, 1e6), "nan": (1, np.nan),
    "time of the last": (0, 100.0),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_impossible_fix_is_not_used(case):
    x, *_ = memory(Gnssins())
    x[lay.FIX_T] = 100.0
    x[m.GNSS + 1 : m.GNSS + 15] = 101.0, *LLA, *[0.0] * 3, *[1.0] * 6, np.nan
    assert k.usable(x)
    at, value = BAD[case]
    x[m.GNSS + 1 + at] = value
    assert not k.usable(x)


def test_speed_its_change_and_course_come_from_two_fixes():
    flt = Gnssins(min_speed=2.0)
    x, _, p, _ = memory(flt)
    for t, v in ((101.0, (6.0, 8.0, 0.0)), (102.0, (0.0, -13.0, 0.0)), (110.0, (0.0, 1.0, 0.0))):
        x[m.GNSS + 1 : m.GNSS + 15] = t, *LLA, *v, *[1.0] * 6, np.nan
        k.take_motion(x, p)
        want = {101.0: (10.0, 0.0, np.arctan2(8, 6)), 102.0: (13.0, 3.0, -np.pi / 2)}
        if t in want:
            got = x[lay.U], x[lay.U_DOT], x[lay.COURSE]
            np.testing.assert_allclose(got, want[t], atol=1e-12)
    assert x[lay.U_DOT] == 0.0  # too long after the last one
    assert np.isinf(x[lay.COURSE])  # too slow


def test_without_a_velocity_the_displacement_gives_one():
    x, _, p, _ = memory(Gnssins())
    x[m.GNSS + 1 : m.GNSS + 15] = 101.0, *LLA, *[np.nan] * 10
    k.take_motion(x, p)
    assert np.isinf(x[lay.U])
    moved = LLA + np.array([4.0, 3.0, 0.0]) / [x[lay.R_N], x[lay.R_E], -1.0]
    x[m.GNSS + 1 : m.GNSS + 15] = 101.5, *moved, *[np.nan] * 10
    k.take_motion(x, p)
    # radii of a sphere: half a per cent
    np.testing.assert_allclose(x[lay.FIX_V : lay.FIX_V + 3], [8.0, 6.0, 0.0], rtol=5e-3)
    x[m.GNSS + 1 : m.GNSS + 15] = 102.0, *LLA, 1e30, 0.0, 0.0, *[np.nan] * 7
    k.take_motion(x, p)
    assert abs(x[lay.U]) < 100.0  # an absurd one is none
