"""Hard and soft iron from the shape alone, and refusal where the shape is not shown."""

import math
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from truth import triads as truth
from truth.triads import DPS, UT

from strapdown import calibration as cal
from strapdown.calibration import ellipsoid_fit
from strapdown.errors import InputError, StrapdownError

F = 48.0 * UT
HARD = np.array([23.0, -41.0, 17.0]) * UT
SOFT = np.array([[1.10, 0.06, -0.04], [0.06, 0.93, 0.05], [-0.04, 0.05, 1.02]])  # inv(A)


def raw(u, noise=0.3 * UT, seed=0):
    m = F * u @ SOFT.T + HARD
    # Another seed than that of `directions`, or the noise would lie along them.
    return m + noise * np.random.default_rng(seed + 10_000).standard_normal(m.shape)


def direction_errors(record):
    """Angle between corrected and true field over the whole sphere [deg]."""
    u = truth.even_directions(500)
    c = record.correct(F * u @ SOFT.T + HARD)
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(c, u), axis=1), np.sum(c * u, axis=1)))


def part(keep, n, seed=0):
    u = truth.directions(60 * n, seed)
    return u[keep(u)][:n]


def hemisphere(u):
    return u @ [0.48, -0.6, 0.64] > 0.0


def test_exact_samples_give_the_exact_ellipsoid():
    record = cal.ellipsoid(raw(truth.directions(50), noise=0.0), F)
    assert_allclose(record.bias, HARD, atol=1e-16)
    assert_allclose(record.matrix, np.linalg.inv(SOFT), atol=1e-11)


def test_full_coverage_finds_hard_iron_to_0_05_ut_and_directions_to_0_35_deg():
    record = cal.ellipsoid(raw(truth.directions(1000)))
    assert np.linalg.norm(record.bias - HARD) < 0.05 * UT
    assert direction_errors(record).max() < 0.35
    assert record.quality["coverage"] > 0.95
    assert record.quality["field_ut"] * UT == pytest.approx(
        F * np.linalg.det(SOFT) ** (1 / 3), rel=1e-3
    )
    assert np.linalg.det(record.matrix) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("n", [200, 1000, 5000])
def test_one_hemisphere_is_good_to_0_5_ut_and_1_deg_or_refused_with_its_coverage(n, seed):
    outcome = good_or_refused(raw(part(hemisphere, n, seed), seed=seed))
    assert outcome == "good" or n < 5000


def good_or_refused(samples):
    """Fit; a refusal must name the coverage and the way out, a result must be right."""
    refused = None
    try:
        record = cal.ellipsoid(samples)
    except StrapdownError as error:
        refused = str(error)
    if refused is not None:
        where = r"\d+ % of the sphere, with none within \d+ deg of .*: turn the device so"
        return "refused" if re.search(where, refused) else refused
    assert np.linalg.norm(record.bias - HARD) < 0.5 * UT
    assert direction_errors(record).max() < 1.0
    return "good"


CAPS = {
    "cap of 30 deg": lambda u: u[:, 2] > math.cos(30 * DPS),
    "cap of 60 deg": lambda u: u[:, 0] < -0.5,
    "level turns": lambda u: np.abs(u[:, 2]) < 0.05,
    "quarter": lambda u: (u[:, 2] > 0) & (u[:, 1] > 0),
    "one line": lambda u: (np.abs(u[:, 2]) < 0.05) & (u[:, 0] > 0.9),
}


@pytest.mark.parametrize("cap", CAPS)
@pytest.mark.parametrize("seed", range(4))
def test_small_coverage_is_refused_not_silently_wrong(cap, seed):
    samples = raw(part(CAPS[cap], 400, seed), seed=seed)
    assert good_or_refused(samples) == "refused"


def test_hole_is_named_where_it_is():
    u = part(lambda u: u[:, 1] < 0.1, 100)
    with pytest.raises(InputError, match=r"none within 8\d deg of \+y: turn the device"):
        cal.ellipsoid(raw(u))


def test_quarter_of_the_sphere_is_not_drawn_to_one_side_by_noise():
    # With the derivatives of the gradient left out, the mean error is 0.6 uT here.
    errors = []
    for seed in range(12):
        samples = raw(part(CAPS["quarter"], 3000, seed), seed=seed)
        errors.append(cal.ellipsoid(samples, F).bias - HARD)
    mean, std = np.mean(errors, axis=0), np.std(errors, axis=0, ddof=1)
    # Three standard deviations of the mean of twelve.
    assert (np.abs(mean) < 3.0 * std / math.sqrt(12) + 0.01 * UT).all()


@pytest.mark.parametrize("keep", [lambda u: u[:, 0] < 2, hemisphere], ids=["full", "half"])
def test_covariance_is_honest_over_many_draws(keep):
    nees = []
    for seed in range(60):
        record = cal.ellipsoid(
            raw(part(keep, 1000, seed), seed=seed), F, hard_iron_limit=1, direction_limit=9
        )
        x = np.concatenate((record.bias, record.matrix[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]))
        A = np.linalg.inv(SOFT)
        e = x - np.concatenate((HARD, A[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)]))
        nees.append(e @ np.linalg.solve(record.covariance, e))
    # Chi-square of 9: mean 9, standard deviation of the mean of 60 draws 0.55.
    assert 7.3 < np.mean(nees) < 10.7


def test_stated_direction_error_bounds_the_true_one():
    for seed in range(20):
        record = cal.ellipsoid(raw(truth.directions(300, seed), seed=seed))
        assert direction_errors(record).max() < record.quality["direction_3sigma_deg"]
        assert (
            np.linalg.norm(record.bias - HARD) / UT < 1.5 * record.quality["hard_iron_3sigma_ut"]
        )


def test_result_is_the_minimum_that_scipy_finds():
    samples = raw(truth.directions(200))

    def residuals(x):
        A = np.array([[x[3], x[6], x[7]], [x[6], x[4], x[8]], [x[7], x[8], x[5]]])
        c = (samples / UT - x[:3]) @ A
        norm = np.linalg.norm(c, axis=1)
        return (norm - F / UT) * norm / np.linalg.norm(c @ A, axis=1)

    start = np.concatenate((HARD / UT, [1, 1, 1, 0, 0, 0]))
    expected = least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    record = cal.ellipsoid(samples, F)
    assert_allclose(record.bias / UT, expected[:3], atol=1e-5)
    assert_allclose([p.value for p in record.parameters[3:]], expected[3:], atol=1e-7)


def test_derivatives_equal_central_differences():
    samples = raw(truth.directions(20)) / UT
    A = np.linalg.inv(SOFT)
    x = np.concatenate((HARD / UT + 1.0, A[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)] + 0.02))
    jacobian = ellipsoid_fit._model(x, samples, F / UT)[1]
    for k in range(9):
        e = 1e-5 * np.eye(9)[k]
        plus, minus = (ellipsoid_fit._model(x + d, samples, F / UT)[0] for d in (e, -e))
        assert_allclose(jacobian[:, k], (plus - minus) / 2e-5, atol=1e-6)


def test_turning_back_and_forth_slowly_is_not_counted_as_independent_samples():
    # Residuals that last for 50 samples: the sigma grows by about the root of 50.
    u = truth.even_directions(2000)
    rng = np.random.default_rng(0)
    slow = np.repeat(rng.standard_normal(40), 50)[:, np.newaxis] * u
    record = cal.ellipsoid(F * u @ SOFT.T + HARD + 0.3 * UT * slow, F)
    white = cal.ellipsoid(raw(u), F)
    ratio = record["b_x"].std / white["b_x"].std
    assert 4.0 < ratio < 10.0
    assert record.quality["correlation_samples"] > 20


def test_good_coverage_in_a_bad_field_is_refused_for_that_reason():
    u = truth.even_directions(3000)
    wave = 3.0 * UT * np.sin(np.arange(3000) / 300.0)
    with pytest.raises(InputError, match=r"norm is off by .* uT RMS.*away from iron"):
        cal.ellipsoid(raw(u) + wave[:, np.newaxis] * u)


def test_limits_can_be_lifted():
    samples = raw(part(hemisphere, 200))
    with pytest.raises(InputError, match=r"must know the hard iron to 0\.5 uT"):
        cal.ellipsoid(samples)
    record = cal.ellipsoid(samples, hard_iron_limit=math.inf, direction_limit=math.inf)
    assert record.quality["hard_iron_3sigma_ut"] > 0.5


def test_samples_with_nan_are_left_out():
    samples = raw(truth.directions(300))
    holes = np.insert(samples, [5, 100], np.nan, axis=0)
    assert_allclose(cal.ellipsoid(holes).bias, cal.ellipsoid(samples).bias, rtol=1e-12)


@pytest.mark.parametrize("n", [50, 500, 20_000])
def test_noise_in_one_pose_is_not_taken_for_a_sphere(n):
    with pytest.raises(InputError, match="of its radius, as they do in one pose: turn the device"):
        cal.ellipsoid(raw(np.tile([0.6, 0.0, -0.8], (n, 1))))


def test_few_samples_and_a_constant_channel_are_refused():
    with pytest.raises(InputError, match="12 unknowns, got 5 poses"):
        cal.ellipsoid(raw(truth.directions(5)))
    with pytest.raises(InputError, match="needs samples that differ, all 20 are equal"):
        cal.ellipsoid(np.full((20, 3), 1e-5))
    stuck = raw(truth.directions(400))
    stuck[:, 1] = 1e-5
    with pytest.raises(StrapdownError, match="turn the device"):
        cal.ellipsoid(stuck)


def test_corrected_samples_and_distorted_ones_are_inverse():
    record = cal.ellipsoid(raw(truth.directions(300)))
    u = F * truth.directions(5, 9)
    assert_allclose(record.correct(record.distort(u)), u, atol=1e-18)


# --- coverage ----------------------------------------------------------------------------


def test_coverage_of_the_whole_sphere_and_of_half():
    whole = cal.coverage(truth.even_directions(2000))
    assert whole.fraction == 1.0
    assert math.degrees(whole.hole) < 5.0
    u = truth.even_directions(4000)
    half = cal.coverage(u[u[:, 0] > 0])
    # Cells that the border cuts count as held.
    assert 0.5 <= half.fraction < 0.62
    assert math.degrees(half.hole) == pytest.approx(90.0, abs=4.0)
    assert_allclose(half.hole_direction, [-1, 0, 0], atol=0.1)


def test_coverage_refuses_zero_vectors():
    with pytest.raises(InputError, match=r"`directions` must not be zero, got .* in row 1"):
        cal.coverage([[1.0, 0, 0], [0, 0, 0]])
