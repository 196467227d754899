"""Small-matrix kernels against NumPy and 40-digit arithmetic."""

import mpmath as mp
import numpy as np
import pytest
from numpy.testing import assert_array_equal
from truth import rotations as truth
from truth.compare import assert_close

from strapdown.kernels import smallmat

EPS = 2.2e-16
SIZES = [1, 3, 6, 16]


def random(*shape, seed=0):
    return np.random.default_rng([seed, *shape]).standard_normal(shape)


def covariance(n, seed=0):
    a = random(n, n, seed=seed)
    return a @ a.T + 0.1 * np.eye(n)


def joseph_truth(P, h, r):
    """Gain and Joseph's form, word for word, in 40 digits."""
    P, h, r = mp.matrix(P.tolist()), mp.matrix(h.tolist()), mp.mpf(r)
    s = (h.T * P * h)[0] + r
    k = P * h / s
    a = mp.eye(P.rows) - k * h.T
    return float(s), truth.to_float(k)[:, 0], truth.to_float(a * P * a.T + r * k * k.T)


# --- products -------------------------------------------------------------------------


@pytest.mark.parametrize(("m", "n", "k"), [(1, 1, 1), (3, 3, 3), (2, 5, 3), (16, 4, 9)])
def test_products_and_their_transposes(m, n, k):
    a, b = random(m, n), random(n, k, seed=1)
    bound = (n + m) * EPS * 30.0  # sums of up to 16 products of numbers up to about 5
    out = np.empty((m, k))
    smallmat.mul(a, b, out)
    assert_close(out, a @ b, atol=bound)
    smallmat.mul_t(a, np.ascontiguousarray(b.T), out)
    assert_close(out, a @ b, atol=bound)
    smallmat.t_mul(np.ascontiguousarray(a.T), b, out)
    assert_close(out, a @ b, atol=bound)
    x, y = np.empty(m), b[:, 0].copy()
    smallmat.mul_vec(a, y, x)
    assert_close(x, a @ y, atol=bound)
    smallmat.t_mul_vec(np.ascontiguousarray(a.T), y, x)
    assert_close(x, a @ y, atol=bound)


@pytest.mark.parametrize(("m", "n"), [(1, 1), (3, 3), (2, 6), (16, 16)])
def test_congruence_is_a_p_a_transposed_and_exactly_symmetric(m, n):
    a, P = random(m, n), covariance(n)
    out, work = np.empty((m, m)), np.empty((m, n))
    smallmat.congruence(a, P, work, out)
    expected = a @ P @ a.T
    assert_close(out, expected, atol=n * n * EPS * np.abs(expected).max())
    assert_array_equal(out, out.T)
    if m == n:
        smallmat.congruence(a, P, work, P)
        assert_array_equal(P, out)


@pytest.mark.parametrize("n", SIZES)
def test_rank_one_update_adds_alpha_v_v_transposed(n):
    P, v = covariance(n), random(n)
    expected = P - 0.3 * np.outer(v, v)
    smallmat.rank1_update(P, v, -0.3)
    assert_close(P, expected, atol=4 * EPS * np.abs(expected).max())
    assert_array_equal(P, P.T)


# --- Cholesky -------------------------------------------------------------------------


@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("in_place", [False, True])
def test_cholesky_factor_and_solution(n, in_place):
    A, b = covariance(n), random(n)
    L = A.copy() if in_place else np.full((n, n), np.nan)
    assert smallmat.cholesky(L if in_place else A, L)
    expected = np.linalg.cholesky(A)
    # backward stable: the error grows with n and with the condition number
    bound = n * EPS * np.linalg.cond(A)
    assert_close(L, expected, atol=bound)
    x = b.copy() if in_place else np.empty(n)
    smallmat.cholesky_solve(L, x if in_place else b, x)
    expected = np.linalg.solve(A, b)
    assert_close(x, expected, atol=bound * np.abs(expected).max())


@pytest.mark.parametrize(
    "A", [np.diag([1.0, -1.0]), np.array([[1.0, 2.0], [2.0, 1.0]]), np.zeros((2, 2)),
          np.diag([1.0, np.nan])]
)  # fmt: skip
def test_cholesky_says_when_there_is_no_factor(A):
    assert not smallmat.cholesky(A, np.empty((2, 2)))


# --- measurement ----------------------------------------------------------------------


@pytest.mark.parametrize("n", SIZES)
def test_update_is_josephs_form(n):
    P, h, r = covariance(n), random(n, seed=2), 0.7
    s_true, k_true, P_true = joseph_truth(P, h, r)
    ph, gain = np.empty(n), np.empty(n)
    s = smallmat.innovation(P, h, r, ph)
    assert_close(ph, P @ h, atol=n * EPS * 50.0)
    smallmat.update(P, h, r, s, ph, gain)
    bound = n * EPS * np.abs(P_true).max() * 20.0
    assert s == pytest.approx(s_true, rel=n * EPS * 4)
    assert_close(gain, k_true, atol=n * EPS * 4)
    assert_close(P, P_true, atol=bound)
    assert_array_equal(P, P.T)
    assert smallmat.cholesky(P, np.empty((n, n)))


@pytest.mark.parametrize("n", [3, 6, 16])
def test_sparse_row_gives_what_the_dense_row_gives(n):
    index, values = np.array([n - 1, 1]), np.array([-2.0, 0.5])
    h = np.zeros(n)
    h[index] = values
    P, r = covariance(n), 0.2
    s_true, k_true, P_true = joseph_truth(P, h, r)
    ph, gain = np.empty(n), np.empty(n)
    # two elements are used of the four that the arrays hold
    index, values = np.append(index, [0, 0]), np.append(values, [9.0, 9.0])
    s = smallmat.innovation_sparse(P, index, values, 2, r, ph)
    smallmat.update_sparse(P, index, values, 2, r, s, ph, gain)
    assert s == pytest.approx(s_true, rel=n * EPS * 4)
    assert_close(gain, k_true, atol=n * EPS * 4)
    assert_close(P, P_true, atol=n * EPS * np.abs(P_true).max() * 20.0)
    assert_array_equal(P, P.T)


def test_scalars_one_by_one_are_the_vector_update():
    n, m = 6, 3
    P, H, z = covariance(n), random(m, n, seed=3), random(m, seed=4)
    R = np.diag([0.1, 0.2, 0.3])
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    x_true, P_true = K @ z, (np.eye(n) - K @ H) @ P
    x, ph, gain = np.zeros(n), np.empty(n), np.empty(n)
    for i in range(m):
        residual = z[i] - H[i] @ x
        s = smallmat.innovation(P, H[i], R[i, i], ph)
        smallmat.update(P, H[i], R[i, i], s, ph, gain)
        x += gain * residual
    assert_close(x, x_true, atol=1e-13)  # eps times a condition number of some hundreds
    assert_close(P, P_true, atol=1e-13)


@pytest.mark.parametrize("eps", [1e-6, 1e-8, 1e-9])
def test_joseph_form_stays_positive_where_the_short_form_does_not(eps):
    """Two precise measurements of a nearly unknown state, after Bierman 1977."""
    rows = np.array([[1.0, eps], [1.0, 1.0]])
    P = np.eye(2) / eps**2
    short = P.copy()
    ph, gain = np.empty(2), np.empty(2)
    for h in rows:
        s = smallmat.innovation(P, h, 1.0, ph)
        smallmat.update(P, h, 1.0, s, ph, gain)
        v = short @ h
        short -= np.outer(v, v) / (h @ v + 1.0)
    information = mp.diag([mp.mpf(eps) ** 2] * 2)
    for h in rows:
        h = mp.matrix(h.tolist())
        information += h * h.T
    expected = truth.to_float(information**-1)
    # the first update leaves an error of eps_machine / eps, the second does not add to it
    assert_close(P, expected, rtol=2.0 * EPS / eps)
    assert np.linalg.eigvalsh(P).min() > 0.3
    if eps < 1e-7:
        assert np.linalg.eigvalsh(short).min() < 0.0


def test_inputs_stay_as_they_were():
    P, h, a = covariance(3), random(3), random(3, 3)
    copies = P.copy(), h.copy(), a.copy()
    smallmat.innovation(P, h, 1.0, np.empty(3))
    smallmat.congruence(a, P, np.empty((3, 3)), np.empty((3, 3)))
    smallmat.cholesky(P, np.empty((3, 3)))
    for now, before in zip((P, h, a), copies, strict=True):
        assert_array_equal(now, before)
