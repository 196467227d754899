"""Reference-free calibration of accelerometer and gyroscope against tables 6.1 and 6.2."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import least_squares
from truth import triads as truth
from truth.triads import DPS, MG, TABLE_6_1, TABLE_6_2, G

from strapdown import calibration as cal
from strapdown.calibration import multi_position
from strapdown.errors import InputError


def values(record):
    return np.array([p.value for p in record.parameters])


def stds(record):
    return np.array([p.std for p in record.parameters])


def acc_means(n=39, noise=0.5 * MG, seed=0, x=TABLE_6_1):
    rng = np.random.default_rng(seed)
    true = G * truth.directions(n, seed + 1000)
    return truth.distort(true, x) + noise * rng.standard_normal((n, 3))


def gyro_table(axes, noise=0.02 * DPS, seed=0, rates=(200 * DPS, 270 * DPS)):
    """Positions at each rate of the turntable."""
    rng = np.random.default_rng(seed)
    rate = np.repeat(rates, len(axes))
    true = rate[:, np.newaxis] * np.tile(axes, (len(rates), 1))
    return truth.distort(true, TABLE_6_2) + noise * rng.standard_normal(true.shape), rate


# --- the model ---------------------------------------------------------------------------


def test_distortion_matrix_is_the_one_of_the_program():
    a = truth.directions(5)
    S = cal.distortion_matrix(TABLE_6_1)
    assert_allclose(a @ S.T + TABLE_6_1[:3], truth.distort(a, TABLE_6_1), rtol=1e-15)


def test_inverse_is_the_corrected_6_2_12():
    _, _, _, s_x, s_y, s_z, th_yz, th_zx, th_zy = TABLE_6_1
    A, B, C = 1 / (1 + s_x), 1 / (1 + s_y), 1 / (1 + s_z)
    printed = [
        [A, 0, 0],
        [th_yz * A * B, B, 0],
        [th_yz * th_zx * A * B * C - th_zy * A * C, th_zx * B * C, C],
    ]
    assert_allclose(np.linalg.inv(cal.distortion_matrix(TABLE_6_1)), printed, atol=1e-15)


def test_derivatives_equal_central_differences():
    means = np.vstack((acc_means(12), np.zeros((2, 3)) + 0.01))
    references = np.append(np.linspace(5.0, 20.0, 12), [0.0, 0.0])
    x = TABLE_6_1 + 0.02
    _, jacobian = multi_position._model(x, means, references)
    h = 1e-6
    for k in range(9):
        e = h * np.eye(9)[k]
        plus, minus = (multi_position._model(x + d, means, references)[0] for d in (e, -e))
        # Truncation h^2 and round-off 1e-15 * 20 / h.
        assert_allclose(jacobian[:, k], (plus - minus) / (2 * h), atol=1e-7)


# --- accelerometer -----------------------------------------------------------------------


def test_exact_poses_give_exact_parameters():
    record = cal.accelerometer_from_poses(acc_means(noise=0.0))
    assert_allclose(values(record), TABLE_6_1, atol=1e-12)
    assert record.residual_rms < 1e-13
    true = G * truth.directions(50, 7)
    assert_allclose(record.correct(truth.distort(true, TABLE_6_1)), true, atol=1e-12)


def test_errors_of_39_random_poses_are_those_of_the_cramer_rao_bound():
    """No estimator has smaller ones: what 39 norms do not tell, no weighting brings back."""
    limits = np.array([0.3 * MG] * 3 + [6e-4] * 6)
    rng = np.random.default_rng(1)
    errors, bounds, inside = [], [], []
    for seed in range(100):
        errors.append(values(cal.accelerometer_from_poses(acc_means(seed=seed))) - TABLE_6_1)
        true = G * truth.directions(39, seed + 1000)
        bounds.append(truth.bound(true, TABLE_6_1, 0.5 * MG))
        z = rng.multivariate_normal(np.zeros(9), bounds[-1], 200)
        inside.append((np.abs(z) < limits).all(axis=1).mean())
    # chi-square of 100 draws, per parameter: 14 % at two sigma, and of nine of them
    ratio = np.mean(np.square(errors), axis=0) / np.mean([np.diag(b) for b in bounds], axis=0)
    assert (np.sqrt(ratio) < 1.25).all()
    assert np.sqrt(ratio.mean()) == pytest.approx(1.0, abs=0.08)
    # all nine within 0.3 mg and 6e-4: in 63 % of the draws at the bound, 4.8 % its deviation
    share = (np.abs(errors) < limits).all(axis=1).mean()
    assert share == pytest.approx(np.mean(inside), abs=0.145)


def test_39_random_poses_recover_table_6_1():
    # The limits are about two standard deviations of what 39 norms can tell, so that a
    # third of all draws have one of nine parameters outside; this draw has none.
    record = cal.accelerometer_from_poses(acc_means())
    error = np.abs(values(record) - TABLE_6_1)
    assert (error[:3] < 0.3 * MG).all()
    assert (error[3:] < 6e-4).all()


def test_errors_over_many_draws_are_what_the_covariance_says():
    errors, nees = [], []
    for seed in range(100):
        record = cal.accelerometer_from_poses(acc_means(seed=seed))
        e = values(record) - TABLE_6_1
        errors.append(e)
        nees.append(e @ np.linalg.solve(record.covariance, e))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert (rms[:3] < 0.2 * MG).all()
    assert (rms[3:] < 4e-4).all()
    # 9 parameters, variance from 30 degrees of freedom: mean 9 * 30 / 28 = 9.64; its standard
    # deviation over 100 draws is 0.5.
    assert 8.2 < np.mean(nees) < 11.1


def test_24_poses_at_1e_3_noise_per_sample_leave_4e_4_of_the_norm():
    rng = np.random.default_rng(3)
    true = G * truth.directions(24, 4)
    # Each pose is the mean of 100 samples with 1e-3 m/s^2 of noise.
    noise = 1e-3 * rng.standard_normal((24, 100, 3)).mean(axis=1)
    record = cal.accelerometer_from_poses(truth.distort(true, TABLE_6_1) + noise)
    assert record.residual_rms < 4e-4
    other = G * truth.directions(500, 5)
    norm = np.linalg.norm(record.correct(truth.distort(other, TABLE_6_1)), axis=1)
    assert np.sqrt(np.mean((norm - G) ** 2)) < 4e-4


def test_result_is_the_minimum_that_scipy_finds():
    means = acc_means(noise=5 * MG)
    S = cal.distortion_matrix

    def residuals(x):
        a = np.linalg.solve(S(x), (means - x[:3]).T).T
        return (np.sum(a**2, axis=1) - G**2) / (2 * G)

    expected = least_squares(residuals, np.zeros(9), xtol=1e-14, ftol=1e-14, gtol=1e-14).x
    assert_allclose(values(cal.accelerometer_from_poses(means)), expected, atol=1e-7)


def test_convergence_is_quadratic_and_the_history_shows_it():
    record = cal.accelerometer_from_poses(acc_means())
    steps = np.abs(np.diff(record.history, axis=0)).max(axis=1)
    assert_allclose(record.history[0], 0.0)
    assert_allclose(record.history[-1], values(record))
    assert len(steps) <= 6
    # Second derivatives are of the order of one.
    assert steps[2] < steps[1] ** 2
    assert steps[3] < steps[2] ** 2


def test_thesis_variant_converges_linearly_to_the_same_estimate():
    means = acc_means()
    exact = cal.accelerometer_from_poses(means)
    thesis = cal.accelerometer_from_poses(means, variant="thesis")
    assert_allclose(values(thesis), values(exact), atol=1e-11)
    steps = np.abs(np.diff(thesis.history, axis=0)).max(axis=1)
    # Its scale derivatives are 4 s too large: errors shrink by about 0.03 per iteration.
    ratio = steps[3:6] / steps[2:5]
    assert ((ratio > 0.01) & (ratio < 0.06)).all()
    # Its program runs 50 iterations, whatever they change.
    assert len(steps) == 50


def test_thesis_variance_is_not_divided_and_its_scale_is_off_by_the_eighth_power():
    means = acc_means()
    exact = cal.accelerometer_from_poses(means)
    thesis = cal.accelerometer_from_poses(means, variant="thesis")
    ratio = np.diag(thesis.covariance) / np.diag(exact.covariance)
    s = TABLE_6_1[3:6]
    # 30 degrees of freedom; the estimate of s is within 4e-4 of the true one.
    assert_allclose(ratio[[0, 1, 2, 6, 7, 8]], 30.0, rtol=1e-6)
    assert_allclose(ratio[3:6], 30.0 / (1 + s) ** 8, rtol=8 * 1e-3)


def test_poses_on_one_side_have_a_large_sigma():
    rng = np.random.default_rng(0)
    up = truth.directions(400, 5)
    up = up[up[:, 2] > 0.8][:39]
    raw = truth.distort(G * up, TABLE_6_1) + 0.5 * MG * rng.standard_normal(up.shape)
    narrow = cal.accelerometer_from_poses(raw)
    wide = cal.accelerometer_from_poses(acc_means())
    # All poses within 37 deg of +z: bias and scale of z can hardly be told apart.
    assert narrow["b_z"].std > 20 * wide["b_z"].std
    assert narrow["s_z"].std > 20 * wide["s_z"].std
    assert (np.abs(values(narrow) - TABLE_6_1) < 4 * stds(narrow)).all()
    assert narrow.quality["largest_hole_deg"] > 120


def test_poses_about_one_axis_are_refused_naming_what_they_cannot_tell():
    angle = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    flat = G * np.column_stack((np.cos(angle), np.sin(angle), np.zeros(20)))
    with pytest.raises(
        InputError,
        match="cannot tell b_z, s_z, theta_zx and theta_zy from these data; spread the poses",
    ):
        cal.accelerometer_from_poses(flat)


def test_fewer_poses_than_unknowns_are_refused():
    with pytest.raises(InputError, match="has 9 unknowns, got 8 poses; spread the poses"):
        cal.accelerometer_from_poses(acc_means(8))


def test_as_many_poses_as_unknowns_have_no_sigma_but_that_of_a_stated_noise():
    means = acc_means(9, noise=0.0)
    record = cal.accelerometer_from_poses(means)
    assert record.dof == 0
    assert np.isnan(stds(record)).all()
    assert record.verdict is cal.Verdict.NOT_DETERMINED
    stated = cal.accelerometer_from_poses(means, std=0.5 * MG)
    assert (stds(stated) > 0).all()


def test_wrong_units_are_refused():
    with pytest.raises(InputError, match=r"scale factors near 1.*check units"):
        cal.accelerometer_from_poses(acc_means() / G)


def test_verdict_follows_the_tolerances():
    x = TABLE_6_1.copy()
    x[5] = 0.0381  # s_z: out of 3 %
    record = cal.accelerometer_from_poses(acc_means(x=x))
    assert record["s_z"].verdict is cal.Verdict.OUTSIDE
    assert record["s_x"].verdict is cal.Verdict.WITHIN
    assert record["b_x"].verdict is cal.Verdict.NO_TOLERANCE
    assert record.verdict is cal.Verdict.OUTSIDE
    loose = record.with_tolerances({"s": 0.05, "b_z": 1 * MG})
    assert loose["s_z"].verdict is cal.Verdict.WITHIN
    assert loose["b_z"].verdict is cal.Verdict.OUTSIDE
    with pytest.raises(ValueError, match=r"`tolerances` must be one of .* got 'scale'"):
        record.with_tolerances({"scale": 0.1})


# --- gyroscope ---------------------------------------------------------------------------

# Faces up and down and three tilted: nine positions of the turntable's axis in the box.
WELL_SPREAD = np.vstack(
    (np.eye(3), -np.eye(3), np.array([[1, 1, -1], [-1, 1, 1], [1, -1, 1]]) / np.sqrt(3))
)


def test_well_spread_positions_recover_table_6_2_inside_3_sigma():
    means, rates = gyro_table(WELL_SPREAD)
    record = cal.gyro_from_rate_table(means, rates)
    assert (np.abs(values(record) - TABLE_6_2) < 3 * stds(record)).all()
    assert (stds(record)[:3] < 0.05 * DPS).all()
    assert (stds(record)[3:] < 5e-4).all()
    assert record.dof == 9


def test_sigma_of_the_gyro_is_honest_over_many_draws():
    nees = []
    for seed in range(100):
        record = cal.gyro_from_rate_table(*gyro_table(WELL_SPREAD, seed=seed))
        e = values(record) - TABLE_6_2
        nees.append(e @ np.linalg.solve(record.covariance, e))
    # 9 parameters, variance from 9 degrees of freedom: F(9, 9), mean 9 * 9 / 7 = 11.6, standard
    # deviation of one draw 10.4, of the mean of 100 about 1.
    assert 8.5 < np.mean(nees) < 14.7


def test_badly_spread_positions_show_a_large_sigma():
    tilted = truth.even_directions(100)[:9]  # all within 34 deg of +z
    means, rates = gyro_table(tilted)
    good = cal.gyro_from_rate_table(*gyro_table(WELL_SPREAD))
    bad = cal.gyro_from_rate_table(means, rates)
    ratio = stds(bad) / stds(good)
    # Two rates tell bias and scale of the axis that is always turned about; not the others.
    assert (ratio[:2] > 8).all()
    assert (ratio > 1.8).all()
    assert (np.abs(values(bad) - TABLE_6_2) < 4 * stds(bad)).all()
    assert bad.quality["condition"] > 5 * good.quality["condition"]


def test_a_standing_table_helps_the_bias():
    tilted = truth.even_directions(40)[:9]
    means, rates = gyro_table(tilted)
    rest = truth.distort(np.zeros((3, 3)), TABLE_6_2)
    rest += 0.02 * DPS * np.random.default_rng(1).standard_normal((3, 3))
    without = cal.gyro_from_rate_table(means, rates)
    record = cal.gyro_from_rate_table(np.vstack((means, rest)), np.append(rates, [0, 0, 0]))
    assert record.equations == 18 + 9
    assert record["b_z"].std < 0.25 * without["b_z"].std
    assert (np.abs(values(record) - TABLE_6_2) < 4 * stds(record)).all()


def test_sign_of_the_rate_does_not_matter():
    means, rates = gyro_table(WELL_SPREAD)
    forth = cal.gyro_from_rate_table(means, rates)
    back = cal.gyro_from_rate_table(means, -rates)
    assert_allclose(values(back), values(forth), rtol=1e-12)


def test_thesis_variant_refuses_a_standing_table():
    means, rates = gyro_table(WELL_SPREAD)
    rates[0] = 0.0
    with pytest.raises(InputError, match="`rates` must not be zero in the variant 'thesis'"):
        cal.gyro_from_rate_table(means, rates, variant="thesis")


def test_unknown_variant_is_refused():
    with pytest.raises(ValueError, match="`variant` must be one of exact, thesis, got 'exakt'"):
        cal.accelerometer_from_poses(acc_means(), variant="exakt")


def test_thesis_variant_refuses_singular_normal_equations():
    flat = G * np.column_stack((np.tile(np.eye(2), (6, 1)), np.zeros(12)))
    with pytest.raises(InputError, match="singular normal equations; spread the poses"):
        cal.accelerometer_from_poses(flat, variant="thesis")
