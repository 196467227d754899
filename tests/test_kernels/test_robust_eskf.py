"""Kernels of the robust error-state filter against differences, NumPy and matrix inverses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.kernels import memory as m
from strapdown.kernels import robust_eskf
from strapdown.kernels import robust_eskf_covariance as c
from strapdown.kernels import robust_eskf_layout as k
from strapdown.kernels import robust_eskf_smoother as s
from strapdown.kernels.robust_eskf_update import heavy_tail

N = c.N


def transition(sums):
    """Transition matrix of an interval as the smoother's rows give it: row i of ``I Phi``."""
    phi = np.eye(N)
    for i in range(N):
        c.transpose_on_row(phi, i, sums, 0)
    return phi


def written_out(sums):
    """The same from the formulas of the module's docstring, as blocks."""
    c_dt, theta, dv, tau = sums[:9].reshape(3, 3), sums[9:12], sums[12:15], sums[15]
    phi = np.eye(N)
    phi[0:3, 6:9] = -c_dt
    phi[0:3, 12:21] = np.einsum("ij,k->ijk", c_dt, theta / tau).reshape(3, 9)
    phi[3:6, 0:3] = -np.array([[0, -dv[2], dv[1]], [dv[2], 0, -dv[0]], [-dv[1], dv[0], 0]])
    phi[3:6, 9:12] = -c_dt
    return phi


def some_sums(rng, tau=0.1):
    r_nb = Rotation.from_rotvec(rng.standard_normal(3))
    return np.concatenate(
        (
            (tau * r_nb.as_matrix()).ravel(),
            0.1 * rng.standard_normal(3),
            rng.standard_normal(3),
            [tau],
        )
    )


def some_covariance(rng):
    a = rng.standard_normal((N, N))
    return a @ a.T


def mechanise(gyr, acc, dt, q, v, bg, ba, mg, gravity):
    """Attitude and velocity after an interval, as the filter integrates them."""
    r_nb = Rotation.from_quat(q)
    sums = np.zeros(c.INTERVAL)
    for w, f in zip(gyr, acc, strict=True):
        rate = (np.eye(3) + mg) @ (w - bg)
        r_nb = r_nb * Rotation.from_rotvec(rate * dt)
        f_n = r_nb.apply(f - ba)
        v = v + (f_n + [0, 0, gravity]) * dt
        sums[:9] += dt * r_nb.as_matrix().ravel()
        sums[9:12] += dt * rate
        sums[12:15] += dt * f_n
        sums[15] += dt
    return r_nb, v, sums


def test_transition_agrees_with_differences_on_the_manifold():
    rng = np.random.default_rng(1)
    gyr, acc = 0.5 * rng.standard_normal(3) + np.zeros((10, 3)), rng.standard_normal((10, 3)) * 3
    q = Rotation.from_rotvec([0.4, -1.1, 2.0]).as_quat()
    start = dict(
        v=rng.standard_normal(3), bg=np.full(3, 0.01), ba=np.full(3, 0.1), mg=np.zeros((3, 3))
    )

    def end(d):
        turned = (Rotation.from_rotvec(d[0:3]) * Rotation.from_quat(q)).as_quat()
        r_nb, v, _ = mechanise(
            gyr, acc, 0.01, turned, start["v"] + d[3:6], start["bg"] + d[6:9],
            start["ba"] + d[9:12], start["mg"] + d[12:21].reshape(3, 3), 9.8,
        )  # fmt: skip
        return r_nb, v

    _, _, sums = mechanise(gyr, acc, 0.01, q, **start, gravity=9.8)
    h = 1e-6
    numeric = np.eye(N)
    for j in range(21):
        d = np.zeros(N)
        d[j] = h
        (r_p, v_p), (r_m, v_m) = end(d), end(-d)
        numeric[0:3, j] = (r_p * r_m.inv()).as_rotvec() / (2 * h)
        numeric[3:6, j] = (v_p - v_m) / (2 * h)
    # What the first order in the length of the interval leaves out: the velocity reacts to the
    # interval's own turning by half of |f| tau^2 = 0.06, and |w| tau = 0.06 bends theta.
    np.testing.assert_allclose(transition(sums)[:3], numeric[:3], atol=5e-3)
    np.testing.assert_allclose(transition(sums)[3:6, :3], numeric[3:6, :3], atol=1e-8)
    np.testing.assert_allclose(transition(sums)[3:6, 9:12], numeric[3:6, 9:12], atol=1e-8)
    np.testing.assert_allclose(transition(sums)[3:6, 6:9], numeric[3:6, 6:9], atol=0.06)


def test_transition_is_what_its_formula_says():
    sums = some_sums(np.random.default_rng(2))
    np.testing.assert_allclose(transition(sums), written_out(sums), rtol=0, atol=1e-15)


def test_propagation_is_the_congruence_with_the_transition():
    rng = np.random.default_rng(3)
    sums, P = some_sums(rng), some_covariance(rng)
    want = written_out(sums) @ P @ written_out(sums).T
    got = P.copy()
    c.propagate(got, sums, 0, np.zeros(12 * N), 0)
    np.testing.assert_allclose(got, want, rtol=1e-12, atol=1e-12 * np.abs(want).max())
    assert np.array_equal(got, got.T)


def test_a_sample_turns_the_attitude_by_the_corrected_rate():
    """``q exp((I + M)(gyr - b) dt)`` by SciPy, and the sums that go with it."""
    from strapdown.attitude import RobustEskf

    rng = np.random.default_rng(8)
    flt = RobustEskf()
    (x, P), p, w = flt._memory(), flt._params(), np.zeros(k.W_SIZE)
    rest = (0.0, 0.0, 0.0, 1.0, 2.0, -9.5)
    robust_eskf.step(x, P, p, w, 0.0, *rest)
    robust_eskf.step(x, P, p, w, 0.02, *rest)
    mg, bias = 0.01 * rng.standard_normal((3, 3)), 0.1 * rng.standard_normal(3)
    x[k.MG : k.MG + 9], x[m.BG : m.BG + 3] = mg.ravel(), bias
    before = Rotation.from_quat(x[k.ATT : k.ATT + 4][[1, 2, 3, 0]])
    old, gyr, acc = x.copy(), rng.standard_normal(3), 9.0 * rng.standard_normal(3)
    robust_eskf.step(x, P, p, w, 0.04, *gyr, *acc)
    turned = 0.02 * (np.eye(3) + mg) @ (gyr - bias)
    after = before * Rotation.from_rotvec(turned)
    got = Rotation.from_quat(x[k.ATT : k.ATT + 4][[1, 2, 3, 0]])
    assert (after.inv() * got).magnitude() < 1e-14
    f_n = after.apply(acc - old[m.BA : m.BA + 3])
    gained = 0.02 * (f_n + [0, 0, flt.gravity])
    np.testing.assert_allclose(x[m.V : m.V + 3] - old[m.V : m.V + 3], gained, atol=1e-14)
    sums = x[k.OPEN : k.OPEN + c.INTERVAL] - old[k.OPEN : k.OPEN + c.INTERVAL]
    want = np.concatenate((0.02 * after.as_matrix().ravel(), turned, 0.02 * f_n, [0.02]))
    np.testing.assert_allclose(sums, want, atol=1e-14)


@pytest.mark.parametrize(("i", "h_lag"), [(2, 0.7), (3, 0.0), (8, 0.0)])
def test_entering_a_scalar_is_the_joseph_update(i, h_lag):
    rng = np.random.default_rng(4)
    P = some_covariance(rng)
    h = np.zeros(N)
    h[i], h[c.LAG] = 1.0, h_lag
    r = 0.3
    gain = P @ h / (h @ P @ h + r)
    joseph = (np.eye(N) - np.outer(gain, h)) @ P @ (np.eye(N) - np.outer(gain, h)).T
    joseph += r * np.outer(gain, gain)
    g = np.zeros(N + 2)
    variance = c.enter(P, i, h_lag, r, g, 2)
    np.testing.assert_allclose(variance, r / (1.0 - h @ gain), rtol=1e-10)
    np.testing.assert_allclose(g[2:] / np.sqrt(variance), gain, rtol=1e-10, atol=1e-14)
    np.testing.assert_allclose(P, joseph, rtol=0, atol=1e-11 * np.abs(joseph).max())
    assert np.array_equal(P, P.T)


def test_forgetting_cuts_all_correlations():
    P = some_covariance(np.random.default_rng(5))
    kept = np.delete(np.delete(P.copy(), 4, 0), 4, 1)
    c.forget(P, 4, 2.5)
    assert P[4, 4] == 2.5
    assert np.count_nonzero(P[4]) == np.count_nonzero(P[:, 4]) == 1
    assert np.array_equal(np.delete(np.delete(P, 4, 0), 4, 1), kept)


def test_heading_of_the_field_falls_with_the_delay_as_its_row_says():
    """Difference quotient of atan2 of the field put back by its turning."""
    rng = np.random.default_rng(6)
    field, turn = np.array([20.0, 4.0, 40.0]), rng.standard_normal(2) * 30

    def z(delay):
        return -np.arctan2(field[1] - delay * turn[1], field[0] - delay * turn[0])

    d0 = 0.01
    mn, me = field[:2] - d0 * turn
    row = (turn[0] * me - turn[1] * mn) / (mn**2 + me**2)
    # the truth's z is zero less the heading error: z(estimate) = phi_d + row (truth - estimate)
    np.testing.assert_allclose(row, -(z(d0 + 1e-6) - z(d0 - 1e-6)) / 2e-6, rtol=1e-8)


# What a reset before an interval leaves of the error state: nothing of attitude and velocity, or
# nothing of heading.
FORGOTTEN = {
    0: np.eye(N),
    1: np.diag([0.0] * 6 + [1.0] * (N - 6)),
    2: np.diag([1.0, 1.0, 0.0] + [1.0] * (N - 3)),
}


def dense_smoother(r, count, P0, P_before):
    """Rauch, Tung and Striebel with full matrices and inverses, from the recorded intervals."""
    means, covs, pred, phis = [], [], [], []
    for n in range(count):
        P, x = P_before[n].copy(), np.zeros(N)
        for j in range(int(r[n, k.R_COUNT - k.RECORD])):
            a = k.R_MEASURED - k.RECORD + j * k.MEASURED
            h = np.zeros(N)
            h[int(r[n, a])] = 1.0
            h[c.LAG] += r[n, a + 1]
            gain = P @ h / r[n, a + 3]
            x, P = x + gain * r[n, a + 2], P - np.outer(gain, h @ P)
        means.append(x)
        covs.append(P)
        pred.append(P_before[n])
        sums = r[n, k.R_SUMS - k.RECORD : k.R_SUMS - k.RECORD + c.INTERVAL]
        phis.append(written_out(sums) @ FORGOTTEN[int(r[n, k.R_RESET - k.RECORD])])
    xs, Ps = [np.zeros(N)], [covs[-1]]
    for n in range(count - 2, -1, -1):
        gain = covs[n] @ phis[n + 1].T @ np.linalg.pinv(pred[n + 1], rcond=1e-18)
        xs.insert(0, gain @ (means[n + 1] + xs[0]))
        Ps.insert(0, covs[n] + gain @ (Ps[0] - pred[n + 1]) @ gain.T)
    return np.array(xs), np.array(Ps)


@pytest.mark.parametrize("reset", [0, 1, 2])
def test_backward_pass_agrees_with_rauch_tung_and_striebel(reset):
    """Same intervals, no adjoint: gains with inverses of full covariances."""
    rng = np.random.default_rng(7)
    count, records = 6, np.zeros((6, k.RECORD_SIZE))
    P = np.diag(rng.uniform(0.5, 2.0, N))
    P0, before = P.copy(), []
    for n in range(count):
        sums = some_sums(rng)
        if n == 3:
            records[n, k.R_RESET - k.RECORD] = reset
            P = FORGOTTEN[reset] @ P @ FORGOTTEN[reset] + np.eye(N) - FORGOTTEN[reset]
        P = written_out(sums) @ P @ written_out(sums).T + np.diag(rng.uniform(0.01, 0.1, N))
        P = 0.5 * (P + P.T)
        before.append(P.copy())
        records[n, k.R_SUMS - k.RECORD : k.R_SUMS - k.RECORD + c.INTERVAL] = sums
        error, rows = np.zeros(N), [(3, 0.0), (4, 0.0), (5, 0.0), (2, 0.4)]
        for j, (i, h_lag) in enumerate(rows):
            a = k.R_MEASURED - k.RECORD + j * k.MEASURED
            g = np.zeros(N)
            innovation = rng.standard_normal()
            variance = c.enter(P, i, h_lag, 0.5, g, 0)
            records[n, a : a + 4] = i, h_lag, innovation, variance
            records[n, a + 4 : a + 4 + N] = g
            error += g / np.sqrt(variance) * innovation
        records[n, k.R_COUNT - k.RECORD] = len(rows)
        records[n, k.R_STEP - k.RECORD : k.R_STEP - k.RECORD + 6] = error[[0, 1, 2, 6, 7, 8]]
        a = k.R_ROWS - k.RECORD
        records[n, a : a + 6 * N] = P[[0, 1, 2, 6, 7, 8]].ravel()
    correction = np.empty((count, s.CORRECTION_SIZE))
    s.backward(records, count, np.empty((N + 2, N)), np.empty(c.INTERVAL), correction)
    xs, Ps = dense_smoother(records, count, P0, before)
    pick = [0, 1, 2, 6, 7, 8]
    np.testing.assert_allclose(correction[:, s.AFTER : s.AFTER + 6], xs[:, pick], atol=1e-9)
    deviations = np.sqrt(np.diagonal(Ps, axis1=1, axis2=2)[:, pick])
    np.testing.assert_allclose(correction[:, s.STD : s.STD + 6], deviations, rtol=1e-9)
    step = records[:, k.R_STEP - k.RECORD : k.R_STEP - k.RECORD + 6]
    np.testing.assert_allclose(
        correction[:, s.BEFORE : s.BEFORE + 6], xs[:, pick] + step, atol=1e-9
    )


def test_heavy_tails_widen_outliers_only():
    """Weight of Student's t with nu degrees of freedom: (nu + 1) / (nu + ratio), at most one."""
    assert heavy_tail(4.0, 0.0) == 1.0
    assert heavy_tail(4.0, 1.0) == 1.0
    assert heavy_tail(4.0, 6.0) == 2.0


def test_memory_has_room_for_all_cells():
    cells = [k.ATT, k.MG, k.DELAY, k.OPEN, k.FIELD, k.EXTRA, k.USUAL, k.GYR_MEAN, k.STARTED]
    assert cells == sorted(cells)
    assert m.HEAD <= k.ATT
    assert max(cells) < k.X_SIZE
    assert k.R_MEASURED + 7 * k.MEASURED == k.W_SIZE
