"""Attitude from directions against SciPy, eigenvalues, closed forms and sampled noise."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown import attitude
from strapdown.attitude import Observability
from strapdown.errors import NotConverged

DEG = np.pi / 180
DOWN = np.array([0.0, 0.0, 1.0])
FIELD = np.array([21e-6, 0.0, 43e-6])  # dip 64 deg
N2 = np.stack((9.8 * DOWN, FIELD))
N4 = np.array([[0.1, -2.0, 0.5], [1.0, 1.0, 0.3], [-0.4, 0.2, 3.0], [2.0, -0.5, -1.0]])
WAHBA = {"davenport": attitude.davenport, "svd": attitude.svd, "quest": attitude.quest}
FROM_TWO = {**WAHBA, "triad": attitude.triad, "gradient": attitude.gradient_descent}
STARTS = {
    "level": (0.0, 0.0, 0.0),
    "upside down": (180.0, 0.0, 40.0),
    "upside down facing south": (180.0, 0.0, 180.0),  # half a turn about east
    "half a turn about north": (180.0, 0.0, 0.0),
    "half a turn about down": (0.0, 0.0, 180.0),
    "nose up": (20.0, 90.0, 40.0),
    "nose down": (20.0, -90.0, 40.0),
    "on its side": (90.0, 10.0, -120.0),
}


def turns(n, seed=0):
    return Rotation.random(n, random_state=seed)


def of(rpy_deg):
    return Rotation.from_euler("ZYX", np.array(rpy_deg)[[2, 1, 0]], degrees=True)


def seen(r_nb, v_n):
    """The vectors v_n (m, 3) in b of each turn, (n, m, 3)."""
    return np.stack([r_nb.inv().apply(v) for v in v_n], axis=1)


def scipys(q_nb):
    return Rotation.from_quat(np.asarray(q_nb)[..., [1, 2, 3, 0]])


def off(q_nb, r_nb):
    """Rotation vectors in n from the found attitudes to the true ones [rad]."""
    return (r_nb * scipys(q_nb).inv()).as_rotvec()


def noisy(rng, v_b, sigma):
    """Unit vectors with noise across them, sigma (m,) about either axis."""
    unit = v_b / np.linalg.norm(v_b, axis=-1, keepdims=True)
    noise = rng.standard_normal(unit.shape) * np.asarray(sigma)[:, None]
    return unit + noise - unit * np.sum(unit * noise, axis=-1, keepdims=True)


@pytest.mark.parametrize("method", FROM_TWO.values(), ids=FROM_TWO)
@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_every_attitude_is_found_from_two_perfect_directions(method, start):
    r_nb = of(start)
    found = method(r_nb.inv().apply(N2), N2)
    # closed forms: round-off over the sine of 26 deg; descent: its tolerance of 1e-6
    limit = 1e-5 if method is attitude.gradient_descent else 1e-13
    assert np.linalg.norm(off(found.q_nb, r_nb)) < limit
    assert found.status == 0
    assert found.observable
    assert found.loss < 1e-11


@pytest.mark.parametrize("method", FROM_TWO.values(), ids=FROM_TWO)
def test_random_attitudes_are_found_from_two_perfect_directions(method):
    r_nb = turns(200)
    found = method(seen(r_nb, N2), N2)
    limit = 1e-5 if method is attitude.gradient_descent else 1e-13
    assert np.linalg.norm(off(found.q_nb, r_nb), axis=1).max() < limit
    assert (found.q_nb[:, 0] >= 0).all()
    np.testing.assert_allclose(np.linalg.norm(found.q_nb, axis=1), 1.0, rtol=0, atol=1e-14)


@pytest.mark.parametrize("method", WAHBA.values(), ids=WAHBA)
def test_weighted_fit_of_noisy_directions_is_scipys(method):
    rng = np.random.default_rng(1)
    sigma = np.array([0.02, 0.1, 0.3, 0.05])
    r_nb = turns(60, seed=2)
    v_b = noisy(rng, seen(r_nb, N4), sigma)
    found = method(v_b, N4, sigma=sigma)
    unit_n = N4 / np.linalg.norm(N4, axis=1, keepdims=True)
    for k in range(60):
        unit_b = v_b[k] / np.linalg.norm(v_b[k], axis=1, keepdims=True)
        best, rssd = Rotation.align_vectors(unit_n, unit_b, weights=1 / sigma**2)
        assert np.linalg.norm(off(found.q_nb[k], best)) < 1e-9
        # SciPy's root of the weighted sum of squares
        assert found.loss[k] == pytest.approx(0.5 * rssd**2, rel=1e-9)


@pytest.mark.parametrize("ratio", [1.0, 30.0, 300.0])
def test_quest_keeps_its_digits_where_sigmas_differ(ratio):
    r_nb = turns(50, seed=3)
    v_b = noisy(np.random.default_rng(4), seen(r_nb, N2), [0.001, 0.001 * ratio])
    sigma = [0.001, 0.001 * ratio]
    one, two = attitude.quest(v_b, N2, sigma=sigma), attitude.svd(v_b, N2, sigma=sigma)
    assert (one.status == 0).all()
    # the weak axis: round-off of SVD over the smaller weight, ratio^2 eps
    apart = np.linalg.norm(off(one.q_nb, scipys(two.q_nb)), axis=1)
    assert apart.max() < 1e-14 * ratio**2 + 1e-13


def test_quest_says_that_it_cannot_tell_where_svd_still_can():
    r_nb = turns(5, seed=3)
    v_b, sigma = seen(r_nb, N2), [1e-6, 1.0]
    assert (attitude.quest(v_b, N2, sigma=sigma).status == Observability.AMBIGUOUS).all()
    assert (attitude.svd(v_b, N2, sigma=sigma).status == 0).all()


def sampled(method, r_nb, v_n, sigma, count=20000, **options):
    """Covariance of the error in n of many noisy epochs, and the one stated."""
    rng = np.random.default_rng(11)
    v_b = np.broadcast_to(r_nb.inv().apply(v_n), (count, *v_n.shape))
    found = method(noisy(rng, v_b, sigma), v_n, sigma=sigma, **options)
    assert (found.status == 0).all()
    errors = off(found.q_nb, r_nb)
    nees = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(found.covariance_n), errors)
    return np.cov(errors.T), found.covariance_n.mean(axis=0), nees, found


def agrees(sample, stated, count=20000):
    """Elements within five deviations of a sampled covariance: sqrt((P_ii P_jj + P_ij^2) / n)."""
    spread = np.sqrt((np.outer(np.diag(stated), np.diag(stated)) + stated**2) / count)
    return (np.abs(sample - stated) < 5 * spread).all()


SIGMA2 = np.array([0.004, 0.01])


@pytest.mark.parametrize("method", WAHBA.values(), ids=WAHBA)
def test_covariance_of_the_optimal_methods_is_what_noise_makes(method):
    sample, stated, nees, found = sampled(method, of((20, -35, 130)), N2, SIGMA2)
    assert agrees(sample, stated)
    assert nees.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / 20000))
    # 2 m - 3 degrees of freedom
    assert 2 * found.loss.mean() == pytest.approx(1.0, abs=5 * np.sqrt(2 / 20000))


def test_covariance_with_four_directions_and_their_loss():
    sigma = np.array([0.004, 0.01, 0.02, 0.006])
    sample, stated, _, found = sampled(attitude.quest, of((20, -35, 130)), N4, sigma)
    assert agrees(sample, stated)
    assert 2 * found.loss.mean() == pytest.approx(5.0, abs=5 * np.sqrt(10 / 20000))


@pytest.mark.parametrize("rpy", [(20, -35, 130), (180, 0, 40), (0, 90, 10)])
def test_covariance_of_triad_is_what_noise_makes(rpy):
    sample, stated, nees, _ = sampled(attitude.triad, of(rpy), N2, SIGMA2)
    assert agrees(sample, stated)
    assert nees.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / 20000))


def test_triad_is_never_better_than_the_optimum():
    pair = attitude.triad(N2, N2, sigma=SIGMA2), attitude.quest(N2, N2, sigma=SIGMA2)
    excess = pair[0].covariance_n - pair[1].covariance_n
    assert np.linalg.eigvalsh(excess).min() > -1e-16
    assert np.linalg.eigvalsh(excess).max() > 1e-7


FIVE = np.array([[1, 1, 0], [1, 1, 1]], dtype=bool)


@pytest.mark.parametrize("components", [None, FIVE], ids=["six", "five"])
def test_covariance_of_gauss_newton_is_what_noise_makes(components):
    r_nb = of((20, -35, 130))
    start = (r_nb * Rotation.from_rotvec([0.1, -0.1, 0.05])).as_quat()[[3, 0, 1, 2]]
    sample, stated, nees, _ = sampled(
        lambda b, n, **k: attitude.gauss_newton(b, n, start, tolerance=1e-8, **k),
        r_nb, N2, SIGMA2, components=components,
    )  # fmt: skip
    # the norm of q is free, which costs as much as a component: not the optimum's covariance
    assert agrees(sample, stated)
    assert nees.mean() == pytest.approx(3.0, abs=5 * np.sqrt(6 / 20000))


@pytest.mark.parametrize("method", [attitude.compass, attitude.master_slave])
def test_covariance_of_the_compass_is_what_noise_makes(method):
    r_nb, rng, count = of((20, -35, 130)), np.random.default_rng(5), 20000
    down, field = r_nb.inv().apply(DOWN), r_nb.inv().apply(FIELD)
    f = -9.80665 * (down + SIGMA2[0] * rng.standard_normal((count, 3)))
    m = field / np.linalg.norm(field) + SIGMA2[1] * rng.standard_normal((count, 3))
    found = method(f, m, sigma=SIGMA2)
    errors = off(found.q_nb, r_nb)
    assert agrees(np.cov(errors.T), found.covariance_n.mean(axis=0))


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_compass_finds_every_attitude(start):
    r_nb = of(start)
    found = attitude.compass(-9.8 * r_nb.inv().apply(DOWN), r_nb.inv().apply(FIELD))
    assert np.linalg.norm(off(found.q_nb, r_nb)) < 1e-13
    assert found.observable


def test_compass_is_triad_with_down_first():
    rng = np.random.default_rng(6)
    f, m = rng.standard_normal((2, 40, 3))
    found = attitude.compass(f, m, sigma=[0.01, 0.03], declination=0.3)
    dip_sine = np.sum(-f * m, axis=1) / np.linalg.norm(f, axis=1) / np.linalg.norm(m, axis=1)
    h = np.sqrt(1 - dip_sine**2)
    field_n = np.stack((h * np.cos(0.3), h * np.sin(0.3), dip_sine), axis=1)
    v_n = np.stack((np.broadcast_to(DOWN, field_n.shape), field_n), axis=1)
    same = attitude.triad(np.stack((-f, m), axis=1), v_n, sigma=[0.01, 0.03])
    # near-vertical fields cost digits: the least h of these is 0.1
    np.testing.assert_allclose(found.q_nb, same.q_nb, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.covariance_n, same.covariance_n, rtol=1e-9, atol=1e-18)


def test_tilt_is_the_closed_form_and_leaves_heading_open():
    r_nb = Rotation.from_euler("ZYX", [[0, -20, 170], [0, 89.9, 30], [0, 0, -60]], degrees=True)
    found = attitude.tilt(-9.8 * r_nb.inv().apply(DOWN), sigma=0.01)
    assert np.linalg.norm(off(found.q_nb, r_nb), axis=1).max() < 1e-12
    assert (found.status == Observability.HEADING_OPEN).all()
    assert not found.observable.any()
    np.testing.assert_allclose(found.covariance_n[:, :2, :2], np.tile(1e-4 * np.eye(2), (3, 1, 1)))
    assert np.isnan(found.covariance_n[:, 2]).all()
    assert np.isnan(found.covariance_n[:, :, 2]).all()


@pytest.mark.parametrize("start", STARTS.values(), ids=STARTS)
def test_master_slave_finds_every_attitude(start):
    r_nb = of(start)
    found = attitude.master_slave(-9.80665 * r_nb.inv().apply(DOWN), r_nb.inv().apply(FIELD))
    at_edge = abs(start[1]) == 90 or abs(start[0]) == 90
    # an arcsine near one takes the square root of round-off
    assert np.linalg.norm(off(found.q_nb, r_nb)) < (1e-7 if at_edge else 1e-14)
    assert bool(found.status & Observability.SINGULAR) == at_edge
    assert np.isnan(found.covariance_n).any() == at_edge


def test_master_slave_does_not_look_at_the_size_of_the_third_component():
    f = -9.80665 * of((30, 20, 40)).inv().apply(DOWN)
    m = of((30, 20, 40)).inv().apply(FIELD)
    one = attitude.master_slave(f, m)
    np.testing.assert_allclose(attitude.master_slave(f * [1, 1, 3], m).q_nb, one.q_nb)
    with np.testing.assert_raises(AssertionError):
        np.testing.assert_allclose(attitude.master_slave(f * [1, 1, -1], m).q_nb, one.q_nb)


def test_quadrant_tables_are_the_angles_of_the_components():
    """Tables 7.1 (its first sign that of g_z) and 7.2 of the source, against atan2."""
    from strapdown.attitude.determination.compass import roll_by_quadrant, yaw_by_quadrant

    angle = np.linspace(-179, 179, 359) * DEG
    y, z = np.sin(angle), np.cos(angle)
    np.testing.assert_allclose(roll_by_quadrant(np.arcsin(y), z, y), angle, atol=1e-7)
    np.testing.assert_allclose(yaw_by_quadrant(np.cos(angle), -np.sin(angle)), angle, atol=1e-14)
    assert yaw_by_quadrant(np.zeros(2), np.array([-1.0, 1.0])) / DEG == pytest.approx([90, -90])


def test_declination_turns_yaw_by_itself():
    f, m = [1.0, -2.0, -9.0], [2e-5, 1e-5, 4e-5]
    for method in (attitude.compass, attitude.master_slave):
        turn = off(method(f, m).q_nb, scipys(method(f, m, declination=0.2).q_nb))
        np.testing.assert_allclose(turn, [0, 0, 0.2], atol=1e-14)


# --- iterations -------------------------------------------------------------------------


@pytest.mark.parametrize("angle_deg", [5, 45, 90, 135, 179, 180])
def test_gradient_descent_converges_from_everywhere(angle_deg):
    r_nb = turns(40, seed=7)
    axes = np.random.default_rng(8).standard_normal((40, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    axes[:3] = np.eye(3)
    start = (Rotation.from_rotvec(angle_deg * DEG * axes) * r_nb).as_quat()[:, [3, 0, 1, 2]]
    found = attitude.gradient_descent(seen(r_nb, N2), N2, start)
    assert (found.status == 0).all()
    assert np.linalg.norm(off(found.q_nb, r_nb), axis=1).max() < 1e-5


def test_gradient_descent_ends_at_wahbas_optimum():
    r_nb = turns(40, seed=9)
    sigma = [0.05, 0.1, 0.05, 0.2]
    v_b = noisy(np.random.default_rng(10), seen(r_nb, N4), sigma)
    found, best = (f(v_b, N4, sigma=sigma) for f in (attitude.gradient_descent, attitude.svd))
    assert np.linalg.norm(off(found.q_nb, scipys(best.q_nb)), axis=1).max() < 1e-5
    np.testing.assert_allclose(found.covariance_n, best.covariance_n)


def test_gradient_is_the_printed_one():
    """(31) to (36) of the source: gravity and a field without an east component."""
    from strapdown.attitude.determination import iterated
    from strapdown.attitude.determination.result import epochs

    q1, q2, q3, q4 = q = Rotation.from_euler("ZYX", [1.0, 0.4, -2.0]).as_quat()[[3, 0, 1, 2]]
    bx, bz = 0.43, np.sqrt(1 - 0.43**2)
    data = epochs([[0.1, 0.2, 0.97], [0.5, -0.5, 0.7]], [[0, 0, 1], [bx, 0, bz]], 1.0, 1e-3)
    (ax, ay, az), (mx, my, mz) = data.b[0]
    f, J = iterated._seen_on_sphere(data, q[None])
    np.testing.assert_allclose(
        f[0].ravel(),
        [
            2 * (q2 * q4 - q1 * q3) - ax,
            2 * (q1 * q2 + q3 * q4) - ay,
            2 * (0.5 - q2**2 - q3**2) - az,
            2 * bx * (0.5 - q3**2 - q4**2) + 2 * bz * (q2 * q4 - q1 * q3) - mx,
            2 * bx * (q2 * q3 - q1 * q4) + 2 * bz * (q1 * q2 + q3 * q4) - my,
            2 * bx * (q1 * q3 + q2 * q4) + 2 * bz * (0.5 - q2**2 - q3**2) - mz,
        ],
        atol=1e-15,
    )
    np.testing.assert_allclose(
        J[0].reshape(6, 4),
        [
            [-2 * q3, 2 * q4, -2 * q1, 2 * q2],
            [2 * q2, 2 * q1, 2 * q4, 2 * q3],
            [0, -4 * q2, -4 * q3, 0],
            [-2*bz*q3, 2*bz*q4, -4*bx*q3 - 2*bz*q1, -4*bx*q4 + 2*bz*q2],
            [-2*bx*q4 + 2*bz*q2, 2*bx*q3 + 2*bz*q1, 2*bx*q2 + 2*bz*q4, -2*bx*q1 + 2*bz*q3],
            [2*bx*q3, 2*bx*q4 - 4*bz*q2, 2*bx*q1 - 4*bz*q3, 2*bx*q2],
        ],
        atol=1e-15,
    )  # fmt: skip


def test_matrix_of_gauss_newton_is_the_derivative_of_the_homogeneous_form():
    from strapdown.attitude.determination import iterated
    from strapdown.attitude.determination.result import epochs

    q = np.array([0.7, -0.4, 0.9, 0.2])  # not of unit norm: (2.6.42) is a polynomial
    data = epochs(N4, N4[::-1], 1.0, 1e-3)
    _, A = iterated._seen_homogeneous(data, q[None])
    for i in range(4):
        dq = 1e-6 * np.eye(4)[i]
        up, down = (iterated._seen_homogeneous(data, (q + s * dq)[None])[0] for s in (1, -1))
        # a quadratic: central differences are exact but for round-off
        np.testing.assert_allclose(A[..., i], (up - down) / 2e-6, atol=1e-9)
    a, b, c, d = q
    R = np.array(
        [
            [a*a + b*b - c*c - d*d, 2 * (b*c - a*d), 2 * (b*d + a*c)],
            [2 * (b*c + a*d), a*a - b*b + c*c - d*d, 2 * (c*d - a*b)],
            [2 * (b*d - a*c), 2 * (c*d + a*b), a*a - b*b - c*c + d*d],
        ]
    )  # fmt: skip
    eps, _ = iterated._seen_homogeneous(data, q[None])
    np.testing.assert_allclose(eps[0], data.n[0] @ R - data.b[0], atol=1e-15)


@pytest.mark.parametrize(
    ("angle_deg", "mean", "share"),
    [(5, 2.0, 1.0), (20, 3.0, 1.0), (45, 3.3, 0.98), (90, 4.5, 0.93)],
)
def test_gauss_newton_with_five_components_converges_as_often_as_the_sources(
    angle_deg, mean, share
):
    """300 attitudes, stop at 0.01: 2, 3, 3.2, 4.4 iterations; 90 deg off, 96 % converge.

    A few of those that stop have found one of the other solutions of the five; they are flagged.
    """
    r_nb = turns(300, seed=12)
    axes = Rotation.random(300, random_state=13).apply([1, 0, 0])
    start = (Rotation.from_rotvec(angle_deg * DEG * axes) * r_nb).as_quat()[:, [3, 0, 1, 2]]
    found = attitude.gauss_newton(seen(r_nb, N2), N2, start, components=FIVE)
    good = found.status == 0
    assert good.mean() >= share
    assert found.iterations.mean() == pytest.approx(mean, abs=0.15)
    # the last step was below 0.01; what is left is of its square over the sine of 26 deg, but
    # where the two solutions of the five components merge
    apart = np.linalg.norm(off(found.q_nb[good], r_nb[good]), axis=1)
    assert (apart < 5e-3).mean() > 0.99
    assert apart.max() < 0.2


def test_gauss_newton_from_afar_is_right_or_flagged():
    r_nb = turns(300, seed=14)
    axes = Rotation.random(300, random_state=15).apply([1, 0, 0])
    start = (Rotation.from_rotvec(135 * DEG * axes) * r_nb).as_quat()[:, [3, 0, 1, 2]]
    found = attitude.gauss_newton(seen(r_nb, N2), N2, start, components=FIVE, tolerance=1e-9)
    good = found.status == 0
    assert 0.7 < good.mean() < 0.95
    apart = np.linalg.norm(off(found.q_nb[good], r_nb[good]), axis=1)
    assert (apart < 1e-9).mean() > 0.99  # the rest: two solutions that merge
    assert apart.max() < 0.2
    assert (found.status[~good] == Observability.NOT_CONVERGED).all()
    assert np.isnan(found.q_nb[~good]).all()


def test_a_single_epoch_that_does_not_converge_raises():
    v_b = of((10, 20, 30)).inv().apply(N2)
    with pytest.raises(NotConverged, match="attitude from directions did not converge in 2 iter"):
        attitude.gradient_descent(v_b, N2, max_iterations=2)
    with pytest.raises(NotConverged, match="start nearer, or take `quest`"):
        attitude.gauss_newton(v_b, N2, [0, 1, 0, 0], max_iterations=1)


# --- degenerate geometry ------------------------------------------------------------------


@pytest.mark.parametrize("method", FROM_TWO.values(), ids=FROM_TWO)
def test_rows_without_two_directions_are_flagged_and_nan_and_leave_the_others_alone(method):
    r_nb = turns(8, seed=16)
    v_b = seen(r_nb, N2)
    clean = method(v_b, N2)
    v_b[1, 1] = 3.0 * v_b[1, 0]  # parallel
    v_b[2, 1] = -v_b[2, 0]  # anti-parallel
    v_b[3, 1] = np.nan
    v_b[4, 0] = 0.0
    v_b[5] = np.nan
    v_b[6, 1] = v_b[6, 0] * (1 + 1e-9)
    found = method(v_b, N2)
    bad = np.array([False, True, True, True, True, True, True, False])
    assert np.array_equal((found.status & Observability.ONE_DIRECTION) > 0, bad)
    assert np.array_equal((found.status & Observability.MISSING) > 0, np.isin(range(8), [3, 4, 5]))
    assert np.array_equal(np.isnan(found.q_nb).all(axis=1), bad)
    assert np.array_equal(np.isnan(found.covariance_n).all(axis=(1, 2)), bad)
    assert np.array_equal(np.isnan(found.loss), bad)
    assert np.array_equal(np.isnan(found.rpy).all(axis=1), bad)
    assert np.array_equal(found.observable, ~bad)
    np.testing.assert_array_equal(found.q_nb[~bad], clean.q_nb[~bad])


@pytest.mark.parametrize("method", FROM_TWO.values(), ids=FROM_TWO)
def test_a_single_epoch_without_two_directions_raises(method):
    with pytest.raises(ValueError, match=r"two directions at least 0.0573 deg apart, got one: .*"):
        method([[0, 0, 1], [0, 0, 2]], N2)
    with pytest.raises(ValueError, match="the turn about it is open"):
        method(N2, [[0, 0, 1], [0, 0, -3]])
    with pytest.raises(ValueError, match="the turn about it is open"):
        method([[0, 0, 1], [np.nan, 0, 2]], N2)


@pytest.mark.parametrize("method", [attitude.compass, attitude.master_slave])
def test_a_vertical_field_is_flagged(method):
    f = np.array([[0, 0, -9.8], [0, 0, -9.8], [0, 0, -9.8]])
    m = np.array([[2e-5, 0, 4e-5], [0, 0, 4e-5], [1e-9, 0, 4e-5]])
    found = method(f, m)
    assert found.status.tolist() == [0, Observability.ONE_DIRECTION, Observability.ONE_DIRECTION]
    assert np.isnan(found.q_nb[1:]).all()
    with pytest.raises(ValueError, match="the turn about it is open"):
        method(f[1], m[1])


def test_least_angle_is_a_parameter():
    v_n = np.array([[0, 0, 1.0], [0.01, 0, 1.0]])
    assert attitude.quest(v_n, v_n).observable
    with pytest.raises(ValueError, match=r"at least 1 deg apart"):
        attitude.quest(v_n, v_n, min_angle=1 * DEG)


@pytest.mark.parametrize("method", WAHBA.values(), ids=WAHBA)
def test_a_missing_vector_among_several_is_left_out_and_told(method):
    r_nb = turns(3, seed=17)
    v_b = seen(r_nb, N4)
    v_b[1, 2] = np.nan
    v_b[2, :2] = 0.0
    found = method(v_b, N4)
    assert found.status.tolist() == [0, Observability.MISSING, Observability.MISSING]
    assert found.observable.all()
    assert np.linalg.norm(off(found.q_nb, r_nb), axis=1).max() < 1e-12
    less = method(v_b[2, 2:], N4[2:])
    np.testing.assert_allclose(found.covariance_n[2], less.covariance_n, rtol=1e-12)


@pytest.mark.parametrize("method", WAHBA.values(), ids=WAHBA)
def test_a_mirror_image_fits_more_than_one_attitude(method):
    with pytest.raises(ValueError, match="such as a mirror image; check the signs of the axes"):
        method(-np.eye(3), np.eye(3))


def test_tilt_of_nothing_is_no_attitude():
    found = attitude.tilt([[0, 0, -9.8], [0, 0, 0], [np.nan, 0, 1]])
    assert np.isnan(found.q_nb).all(axis=1).tolist() == [False, True, True]
    with pytest.raises(ValueError, match=r"`acc` must be a direction, got \[0. 0. 0.\]"):
        attitude.tilt([0, 0, 0])


# --- arguments -------------------------------------------------------------------------------


@pytest.mark.parametrize("method", FROM_TWO.values(), ids=FROM_TWO)
def test_shapes_that_do_not_fit_are_refused(method):
    with pytest.raises(
        ValueError, match=r"`v_b` must have shape \(m, 3\) or \(n, m, 3\) with at le"
    ):
        method([[0, 0, 1]], [[0, 0, 1]])
    with pytest.raises(ValueError, match=r"`v_n` must have shape \(2, 3\) like `v_b`"):
        method(N2, N4)
    with pytest.raises(
        ValueError, match=r"`sigma` must be a number or have shape \(2,\) or \(1, 2\)"
    ):
        method(N2, N2, sigma=[1, 2, 3])
    with pytest.raises(ValueError, match="`sigma` must be positive and finite, got 0"):
        method(N2, N2, sigma=[1, 0])
    with pytest.raises(ValueError, match=r"`min_angle` must lie in \[1e-07, 1.5708\]"):
        method(N2, N2, min_angle=0)
    with pytest.raises(
        ValueError, match=r"`v_b` must be finite or NaN, got \[inf 0. 0.\] in row 0"
    ):
        method([[np.inf, 0, 0], [0, 0, 1]], N2)


def test_wrong_arguments_are_named():
    with pytest.raises(ValueError, match=r"`v_b` must hold 2 vectors per epoch, got 4; `quest`"):
        attitude.triad(N4, N4)
    with pytest.raises(ValueError, match=r"`acc` and `mag` must both have shape"):
        attitude.compass([0, 0, 1], [[0, 0, 1]])
    with pytest.raises(ValueError, match=r"`acc` must have shape \(3,\) or \(n, 3\)"):
        attitude.tilt(np.ones((2, 2, 3)))
    with pytest.raises(ValueError, match="`gravity` must be positive"):
        attitude.master_slave([0, 0, 1], [1, 0, 1], gravity=0.0)
    with pytest.raises(
        ValueError, match=r"`q_nb` must have shape \(4,\) or \(1, 4\), got \(3, 4\)"
    ):
        attitude.gauss_newton(N2, N2, np.tile([1.0, 0, 0, 0], (3, 1)))
    with pytest.raises(ValueError, match="`q_nb` must not be zero"):
        attitude.gradient_descent(N2, N2, [0, 0, 0, 0])
    with pytest.raises(ValueError, match=r"`components` must have shape \(2, 3\)"):
        attitude.gauss_newton(N2, N2, [1, 0, 0, 0], components=[1, 1])
    with pytest.raises(ValueError, match="`components` must leave four at least"):
        attitude.gauss_newton(N2, N2, [1, 0, 0, 0], components=[[1, 1, 0], [1, 0, 0]])
