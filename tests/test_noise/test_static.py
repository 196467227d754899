"""Static statistics, zero offsets, spectrum, filter bandwidth, datasheet."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from truth.noise import at_rest

from strapdown.constants import G0
from strapdown.errors import InputError, MissingStream
from strapdown.noise import (
    Agreement,
    Figure,
    compare,
    full_statistics,
    identify,
    low_pass_study,
    power_density,
    sigma_behind_filter,
    static_statistics,
    zero_g,
    zero_rate,
)
from strapdown.recording import Imu, Mag, Recording
from strapdown.units import DPS, MILLIGAUSS, UG

# Thesis B, tables 3-5, in the units that the extraction found to be meant.
TABLE_3 = ([-5.5997e-5, 0.0012, -1.8447e-4], [1.9901e-6, 3.9908e-6, 1.2505e-6])  # rad/s
TABLE_4 = ([-0.0011, 5.9414e-4, 1.0016], [5.0422e-6, 5.5640e-6, 1.4530e-5])  # g
TABLE_5 = ([-297.0854, 203.2470, 240.8136], [61.9883, 67.4888, 64.7151])  # mG


def still(rng, n, table):
    mean, variance = (np.array(row) for row in table)
    return mean + np.sqrt(variance) * rng.standard_normal((n, 3))


@pytest.fixture(scope="module")
def kinematic():
    """150 s at 100 Hz with the means and variances of thesis B; the magnetometer at 25 Hz."""
    rng = np.random.default_rng(15)
    t = np.arange(15_000) / 100.0
    return Recording(
        imu=Imu(t=t, gyr=still(rng, t.size, TABLE_3), acc=G0 * still(rng, t.size, TABLE_4)),
        mag=Mag(t=t[::4] + 0.003, mag=MILLIGAUSS * still(rng, t.size // 4, TABLE_5)),
    )


@pytest.mark.parametrize(
    ("samples", "unit", "table"),
    [
        (lambda r: r.imu.gyr, 1.0, TABLE_3),
        (lambda r: r.imu.acc, G0, TABLE_4),
        (lambda r: r.mag.mag, MILLIGAUSS, TABLE_5),
    ],
    ids=["table 3", "table 4", "table 5"],
)
def test_tables_of_thesis_b_are_recovered(kinematic, samples, unit, table):
    found = static_statistics(samples(kinematic))
    mean, variance = (np.array(row) for row in table)
    # Means within four of their deviations, variances within four times sqrt(2/n).
    assert np.all(np.abs(found.mean / unit - mean) < 4.0 * np.sqrt(variance / found.n))
    assert_allclose(found.variance / unit**2, variance, rtol=4.0 * np.sqrt(2.0 / found.n))
    assert_allclose(found.std**2, found.variance, rtol=1e-14)
    assert_allclose(found.mean_std / unit, np.sqrt(variance / found.n), rtol=0.7)


def test_covariance_of_all_nine_channels(kinematic):
    found = full_statistics(kinematic)
    assert found.covariance.shape == (9, 9)
    assert found.n == len(kinematic.mag)
    correlation = found.covariance / np.outer(found.std, found.std)
    assert np.abs(correlation - np.eye(9)).max() < 4.5 / np.sqrt(found.n)
    # Nearest samples, not interpolated ones: their variance would be half.
    assert_allclose(found.std[:3] ** 2, TABLE_3[1], rtol=0.15)


def test_channels_that_move_together_are_seen_across_sensors():
    rng = np.random.default_rng(3)
    t = np.arange(4000) / 100.0
    shared = rng.standard_normal(4000)
    gyr, acc, mag = (rng.standard_normal((4000, 3)) for _ in range(3))
    gyr[:, 1] += 2.0 * shared
    mag[:, 2] -= 3.0 * shared
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag))
    assert full_statistics(rec).covariance[1, 8] == pytest.approx(-6.0, rel=0.1)


def test_slow_magnetometer_or_slow_imu_gives_the_same_channels(kinematic):
    fast = Recording(
        imu=Imu(t=kinematic.imu.t[::10], gyr=kinematic.imu.gyr[::10], acc=kinematic.imu.acc[::10]),
        mag=kinematic.mag,
    )
    assert full_statistics(fast).n == 1500
    assert full_statistics(Recording(imu=kinematic.imu)).covariance.shape == (6, 6)


def test_mean_is_less_sure_under_slow_noise():
    rng = np.random.default_rng(1)
    white = rng.standard_normal((8000, 1))
    slow = white + 0.02 * np.cumsum(rng.standard_normal((8000, 1)), axis=0)
    assert static_statistics(white).mean_std[0] < 3.0 / np.sqrt(8000)
    assert static_statistics(slow).mean_std[0] > 10.0 / np.sqrt(8000)


def test_rows_with_nan_are_left_out():
    y = np.random.default_rng(0).standard_normal((100, 3))
    y[7, 1] = np.nan
    assert static_statistics(y).n == 99


# --- thesis C, section 6.2 --------------------------------------------------------------


def test_zero_g_of_three_poses_gives_the_means_of_table_6_1():
    rng = np.random.default_rng(61)
    poses = [
        G0 * norm * np.eye(3)[k] * sign + 0.004 * G0 * rng.standard_normal((12_000, 3))
        for k, (norm, sign) in enumerate([(1.0096, 1.0), (1.0036, -1.0), (0.9936, 1.0)])
    ]
    found = zero_g(poses)
    assert_allclose([p.mean for p in found], [1.0096, 1.0036, 0.9936], atol=2e-4)
    assert_allclose([p.offset for p in found], [0.0096, 0.0036, -0.0064], atol=2e-4)
    assert [p.above > 0.75 for p in found] == [True, True, False]
    assert all(p.above + p.below == pytest.approx(1.0) for p in found)
    assert found[0].maximum > 1.02


def test_noise_across_gravity_lengthens_the_norm_by_what_is_stated():
    rng = np.random.default_rng(2)
    acc = np.array([0.0, 0.0, -G0]) + 0.05 * G0 * rng.standard_normal((100_000, 3))
    (pose,) = zero_g([acc])
    assert pose.noise_excess == pytest.approx(0.05**2, rel=0.02)
    assert pose.offset == pytest.approx(pose.noise_excess, abs=4.0 * 0.05 / np.sqrt(100_000))


def test_local_gravity_counts():
    acc = np.tile([0.0, -9.78, 0.0], (100, 1))
    (pose,) = zero_g([acc], gravity=9.78)
    assert pose.offset == pytest.approx(0.0, abs=1e-12)


def test_zero_rate_gives_the_means_and_variances_of_table_6_2():
    mean, variance = np.array([0.9055, -0.7203, 3.1291]), np.array([0.0079, 0.0091, 0.0064])
    rng = np.random.default_rng(62)
    found = zero_rate(DPS * (mean + np.sqrt(variance) * rng.standard_normal((12_000, 3))))
    assert_allclose(found.mean / DPS, mean, atol=0.005)
    assert_allclose(found.variance / DPS**2, variance, rtol=0.1)


# --- spectrum ---------------------------------------------------------------------------


def test_integral_of_the_density_is_the_variance():
    y = at_rest(np.random.default_rng(4), 200_000, 50.0, N=0.3, B=0.1)
    found = power_density(y, 50.0)
    assert np.sum(found.density) * (found.f[1] - found.f[0]) == pytest.approx(y.var(), rel=0.02)


def test_white_level_is_n_and_amplitude_is_root_two_n():
    y = at_rest(np.random.default_rng(5), 400_000, 100.0, N=7e-3)
    found = power_density(y, 100.0)
    assert found.white_level(1.0, 40.0) == pytest.approx(7e-3, rel=0.01)
    assert np.median(found.amplitude) == pytest.approx(np.sqrt(2.0) * 7e-3, rel=0.05)


def test_flicker_and_walk_have_their_densities():
    y = at_rest(np.random.default_rng(6), 400_000, 100.0, B=0.02, K=0.05)
    found = power_density(y, 100.0, segment=8192)
    f = found.f[4:40]
    expected = 2.0 * (0.02**2 / (2.0 * np.pi * f) + (0.05 / (2.0 * np.pi * f)) ** 2)
    ratio = found.density[4:40] / expected
    assert ratio.mean() == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / found.edf / 36.0) + 0.03)


def test_interval_of_the_density_covers_and_edf_is_that_of_the_average():
    y = np.random.default_rng(7).standard_normal(1_000_000)
    found = power_density(y, 1.0, segment=1000)
    inside = (found.low < 2.0) & (found.high > 2.0)
    assert inside.mean() == pytest.approx(0.95, abs=0.04)  # 500 values, neighbours correlated
    spread = (found.density / 2.0)[5:-5].std()
    assert spread == pytest.approx(np.sqrt(2.0 / found.edf), rel=0.15)


def test_spectrum_messages():
    with pytest.raises(InputError, match="at least one segment of 256 samples, got 200"):
        power_density(np.ones(200), 1.0)
    found = power_density(np.random.default_rng(0).standard_normal(2000), 1.0)
    with pytest.raises(InputError, match="the band from 3 Hz to 4 Hz must hold a frequency"):
        found.white_level(3.0, 4.0)


# --- filter bandwidth, thesis A 5.3.1 ---------------------------------------------------


def test_study_of_thesis_a_recommends_188_hz_and_rejects_what_is_under_42():
    study = low_pass_study()
    assert study.recommended_hz == 188.0
    assert study.rejected_hz == (20.0, 10.0, 5.0)


def test_errors_are_those_of_the_formulas():
    study = low_pass_study(dt=0.01)
    # (5.14) at two sigma and 42 Hz; (5.15) at the highest rate and 188 Hz.
    assert study.noise_error[1, 3] == pytest.approx(2.0 * 0.055 * DPS * 0.01)
    assert study.delay_error[-1, 1] == pytest.approx(40.0 * DPS * 1.9e-3)
    assert study.regret[study.recommended] == study.regret[~study.rejected].min()


def test_device_that_only_creeps_may_use_a_low_cut_off():
    study = low_pass_study(rates=(0.001 * DPS, 0.01 * DPS))
    assert study.recommended_hz <= 20.0
    assert 256.0 in study.rejected_hz


def test_fast_device_wants_the_widest_band():
    study = low_pass_study(rates=(40.0 * DPS, 400.0 * DPS))
    assert study.rejected_hz == (188.0, 98.0, 42.0, 20.0, 10.0, 5.0)
    assert study.recommended_hz == 256.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (dict(sigma=[1.0, 2.0]), "must have equal length, got 7 and 2"),
        (dict(cutoff_hz=[1.0], sigma=[1.0], delay=[1.0]), "at least two cut-offs, got 1"),
        (dict(delay=[1, 2, 3, 4, 5, 6, -7]), r"`delay\[6\]` must be positive"),
        (dict(rates=(2.0, 1.0)), "`rates` must increase, got 2 and 1 rad/s"),
        (dict(dt=0.0), "`dt` must be positive"),
    ],
)
def test_study_messages(arguments, message):
    with pytest.raises(ValueError, match=message):
        low_pass_study(**arguments)


# --- datasheet, thesis A tables 5.4 and 5.6 -----------------------------------------------


@pytest.fixture(scope="module")
def gyro_z():
    y = at_rest(np.random.default_rng(54), 200_000, 100.0, N=7.389e-3 * DPS)
    return identify(y, 100.0), y.std()


def test_gyro_of_thesis_a_is_in_line_once_folded_noise_is_taken_out(gyro_z):
    found, _ = gyro_z
    sheet = Figure(kind="density", value=0.005 * DPS, source="table 5.4")
    plain, folded = (compare(found, [sheet], bandwidth_hz=b)[0] for b in (None, 188.0))
    # One-sided: 0.0104; folded 3.76 times into 50 Hz: 0.0054.
    assert plain.measured / DPS == pytest.approx(np.sqrt(2.0) * 7.389e-3, rel=0.01)
    assert plain.agreement is Agreement.WORSE
    assert folded.measured / DPS == pytest.approx(0.0104 / np.sqrt(3.76), rel=0.02)
    assert folded.agreement is Agreement.IN_LINE
    assert "folded 3.76 times" in folded.remark


def test_accelerometer_of_thesis_a_is_in_line():
    y = at_rest(np.random.default_rng(56), 100_000, 100.0, N=2.426e-4 * G0)
    (row,) = compare(identify(y, 100.0), [Figure(kind="density", value=400.0 * UG)])
    assert row.agreement is Agreement.IN_LINE
    assert row.ratio == pytest.approx(np.sqrt(2.0) * 242.6 / 400.0, rel=0.02)


@pytest.mark.parametrize(
    ("std_mg", "agreement"),
    [(1.0, Agreement.BETTER), (1.35, Agreement.IN_LINE), (2.5, Agreement.WORSE)],
)
def test_magnetometer_against_a_range(gyro_z, std_mg, agreement):
    sheet = Figure(kind="rms", value=1.1 * MILLIGAUSS, upper=2.25 * MILLIGAUSS)
    (row,) = compare(gyro_z[0], [sheet], std=std_mg * MILLIGAUSS)
    assert row.agreement is agreement
    assert row.measured == std_mg * MILLIGAUSS


def test_what_was_not_seen_is_not_compared(gyro_z):
    figures = [
        Figure(kind="bias instability", value=1e-5),
        Figure(kind="rate random walk", value=1e-6),
        Figure(kind="rms", value=1e-3),
    ]
    for row in compare(gyro_z[0], figures):
        assert row.agreement is Agreement.NOT_OBSERVABLE
        assert np.isnan(row.measured)
        assert row.remark


def test_bias_instability_is_compared_at_the_floor():
    y = at_rest(np.random.default_rng(8), 100_000, 1.0, N=0.01, B=0.5)
    found = identify(y, 1.0)
    (row,) = compare(found, [Figure(kind="bias instability", value=0.3321)])
    assert row.measured == pytest.approx(0.6643 * found.B.value, rel=1e-3)
    assert row.ratio == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: Figure(kind="noise", value=1.0), ValueError, "`kind` must be one of density"),
        (lambda: Figure(kind="rms", value=-1.0), ValueError, "`value` must be positive"),
        (
            lambda: Figure(kind="rms", value=2.0, upper=1.0),
            ValueError,
            "`upper` must not be below",
        ),
        (lambda: static_statistics(np.ones(9)), ValueError, r"must have shape \(n, k\)"),
        (
            lambda: static_statistics(np.ones((9, 3))),
            InputError,
            "at least 32 complete rows, got 9",
        ),
        (lambda: full_statistics(Recording()), MissingStream, "must have the stream 'imu'"),
        (lambda: zero_g([np.zeros((50, 3))]), InputError, r"`poses\[0\]` must show gravity"),
        (lambda: zero_g([], gravity=0.0), ValueError, "`gravity` must be positive"),
    ],
)
def test_messages(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_noise_behind_a_filter_is_that_of_white_noise_through_one_pole():
    """N sqrt(pi f_c): half the density's two sides times the noise bandwidth pi/2 f_c."""
    rng = np.random.default_rng(8)
    white = 2e-4  # N
    spectrum = power_density(white * np.sqrt(200.0) * rng.standard_normal(400_000), 200.0)
    cutoffs = np.array([5.0, 20.0, 98.0, 256.0])  # the last is above half the rate: folded
    got = sigma_behind_filter(spectrum, cutoffs)
    # a band of 5 Hz has some 3000 degrees of freedom: 1.3 %; one bin of the sum: 2 %
    np.testing.assert_allclose(got, white * np.sqrt(np.pi * cutoffs), rtol=0.03)


def test_noise_behind_a_filter_adds_to_slow_noise():
    rng = np.random.default_rng(9)
    fast, slow = rng.standard_normal(200_000), 0.3 * np.sin(np.arange(200_000) * 0.05)
    both = power_density(fast + slow, 100.0)
    alone = power_density(fast, 100.0)
    f = 0.05 * 100.0 / (2.0 * np.pi)
    more = sigma_behind_filter(both, [2.0]) ** 2 - sigma_behind_filter(alone, [2.0]) ** 2
    assert more[0] == pytest.approx(0.5 * 0.09 / (1.0 + (f / 2.0) ** 2), rel=0.02)
