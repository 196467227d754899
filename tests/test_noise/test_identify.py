"""Identification: right numbers, right uncertainty, and silence where nothing shows."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter
from truth.noise import at_rest, power_law

from strapdown.errors import InputError
from strapdown.noise import Status, allan_deviation, identify, read_off
from strapdown.noise.coefficients import Coefficients, coefficient_unit, line
from strapdown.noise.identify import octaves
from strapdown.units import DPS

# Thesis A, table 5.3, gyroscope x: (deg/s)/sqrt(Hz), deg/s, (deg/s) sqrt(Hz).
GYR_X = dict(N=7.867e-3 * DPS, B=1.241e-3 * DPS, K=1.111e-4 * DPS)


def inside(c, truth):
    return c.low <= truth <= c.high


@pytest.fixture(scope="module")
def hour():
    """One hour at 100 Hz with all three noises, the slow ones ten times those of the MPU-6050."""
    rng = np.random.default_rng(2)
    return identify(at_rest(rng, 360_000, 100.0, N=0.01, B=0.01, K=1e-3, bias=1.0), 100.0)


def test_three_noises_are_told_apart(hour):
    assert hour.N.value == pytest.approx(0.01, rel=0.01)
    for c, truth in ((hour.N, 0.01), (hour.B, 0.01), (hour.K, 1e-3)):
        assert c.status is Status.OBSERVED
        assert inside(c, truth), c
        assert 0.0 < c.std < 0.3 * truth


def test_what_is_not_there_is_not_observable(hour):
    for c in (hour.Q, hour.R):
        assert c.status is Status.NOT_OBSERVABLE
        assert np.isnan(c.value)
        assert np.isfinite(c.high)
        assert "does not show" in c.remark


def test_model_curve_lies_on_the_measured_one(hour):
    rng = np.random.default_rng(2)
    y = at_rest(rng, 360_000, 100.0, N=0.01, B=0.01, K=1e-3, bias=1.0)
    curve = allan_deviation(y, 100.0)
    sure = curve.edf > 200
    off = np.log(hour.deviation(curve.tau) / curve.dev)[sure] * np.sqrt(2.0 * curve.edf[sure])
    assert np.abs(off).max() < 4.0


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e6])
def test_unit_of_the_samples_does_not_matter(scale):
    y = at_rest(np.random.default_rng(6), 50_000, 10.0, N=1.0, B=0.3, K=0.05)
    one, other = identify(y, 10.0), identify(scale * y, 10.0)
    for a, b in zip(one, other, strict=True):
        assert a.status is b.status
        # An iteration stops at 1e-5 of the model, an interval's end at 2e-3.
        assert b.value == pytest.approx(scale * a.value, rel=1e-3, nan_ok=True)
        assert b.high == pytest.approx(scale * a.high, rel=1e-2)


def test_time_unit_scales_each_coefficient_by_its_power():
    y = at_rest(np.random.default_rng(6), 50_000, 10.0, N=1.0, B=0.3, K=0.05)
    slow, fast = identify(y, 10.0), identify(y, 1000.0)
    assert fast.N.value == pytest.approx(slow.N.value / 10.0, rel=1e-9)
    assert fast.B.value == pytest.approx(slow.B.value, rel=1e-9)
    assert fast.K.value == pytest.approx(slow.K.value * 10.0, rel=1e-9)


def test_walk_of_the_mpu6050_cannot_be_seen_in_two_minutes_and_is_not_given():
    y = at_rest(np.random.default_rng(9), 12_000, 100.0, **GYR_X)
    found = identify(y, 100.0)
    assert inside(found.N, GYR_X["N"])
    for c, truth in ((found.B, GYR_X["B"]), (found.K, GYR_X["K"])):
        assert c.status is Status.NOT_OBSERVABLE
        assert np.isnan(c.value)
        assert truth < c.high < 100.0 * truth
        assert "120 s" in c.remark


def test_ramp_is_found_with_its_sign_and_spoils_nothing_else():
    rng = np.random.default_rng(4)
    y = at_rest(rng, 360_000, 100.0, N=0.01, B=2e-3, R=-2e-5)
    found = identify(y, 100.0)
    assert found.R.status is Status.OBSERVED
    assert found.R.value == pytest.approx(-2e-5, abs=3.0 * found.R.std)
    assert found.R.low < -2e-5 < found.R.high
    assert found.K.status is Status.NOT_OBSERVABLE
    assert inside(found.N, 0.01)


def test_quantised_angle_is_quantisation_not_white():
    y = at_rest(np.random.default_rng(3), 100_000, 50.0, Q=2e-4, N=1e-3)
    found = identify(y, 50.0)
    assert found.Q.status is Status.OBSERVED
    assert inside(found.Q, 2e-4)
    assert inside(found.N, 1e-3)


@pytest.mark.parametrize("n", [12_000, 150_000, 1_440_000])
def test_slope_of_minus_035_is_not_called_a_random_walk(n):
    # S ~ f**-0.3 gives an Allan deviation of slope -0.35, as accelerometers often do.
    y = power_law(np.random.default_rng(7), n, 100.0, 1e-6, -0.3)
    found = identify(y, 100.0)
    for c in (found.N, found.B):
        assert c.status is not Status.OBSERVED
    if found.N.status is Status.DOUBTFUL:
        assert "does not have the slope -0.5 of random walk: the nearest is -0.3" in found.N.remark


@pytest.mark.parametrize("seed", range(6))
def test_slope_that_misses_is_said_even_where_the_record_is_too_short_to_tell(seed):
    y = power_law(np.random.default_rng(seed), 3000, 100.0, 1e-6, -0.3)
    found = identify(y, 100.0)
    assert found.N.status is not Status.OBSERVED or "slope" in found.N.remark


def test_white_noise_has_nothing_to_explain():
    found = identify(np.random.default_rng(1).standard_normal(30_000), 100.0)
    assert found.N.value == pytest.approx(0.1, rel=0.02)
    assert found.N.remark == ""
    assert [c.status for c in (found.B, found.K, found.R)] == [Status.NOT_OBSERVABLE] * 3


def test_low_pass_filter_is_stepped_over():
    rng = np.random.default_rng(5)
    y = lfilter(*butter(2, 0.2), at_rest(rng, 360_000, 100.0, N=0.01, K=2e-4))
    found = identify(y[1000:], 100.0)
    assert 0.05 < found.tau_min < 1.0  # the filter's corner is at 10 Hz
    assert found.N.value == pytest.approx(0.01, rel=0.05)
    assert found.N.status is Status.OBSERVED


def test_longer_records_are_surer():
    y = at_rest(np.random.default_rng(8), 400_000, 10.0, N=0.1, B=0.05, K=0.005)
    short, long = identify(y[:50_000], 10.0), identify(y, 10.0)
    for symbol in "NBK":
        assert long[symbol].std < short[symbol].std


@pytest.mark.parametrize("n", [256, 257, 400, 1000, 2049])
def test_short_records_give_n_and_stay_silent_of_the_rest(n):
    found = identify(np.random.default_rng(n).standard_normal(n), 10.0)
    assert found.N.value == pytest.approx(1.0 / np.sqrt(10.0), abs=3.0 * found.N.std)
    assert found.K.status is Status.NOT_OBSERVABLE


def test_octaves_halve_down_to_one():
    assert octaves(1000).tolist() == [1, 2, 5, 10, 20, 41, 83, 166, 333]


# --- read-off -----------------------------------------------------------------------------


def test_read_off_formulas_on_pure_noises():
    rng = np.random.default_rng(11)
    for symbol, level in (("N", 0.02), ("K", 0.02), ("Q", 0.02)):
        y = at_rest(rng, 200_000, 10.0, **{symbol: level})
        found = read_off(allan_deviation(y, 10.0))
        assert found[symbol].value == pytest.approx(level, rel=0.05)
        for other in set("QNK") - {symbol}:
            assert found[other].status is Status.NOT_OBSERVABLE
            assert "no stretch of slope" in found[other].remark


def test_read_off_of_a_ramp():
    y = 0.01 * np.arange(20_000) / 10.0
    y = y + 1e-6 * np.random.default_rng(1).standard_normal(20_000)
    assert read_off(allan_deviation(y, 10.0)).R.value == pytest.approx(0.01, rel=1e-3)


def test_read_off_overstates_the_instability_between_other_noises():
    # At the floor of table 5.3's gyroscope x the three terms are about equal:
    # sigma^2 = N^2/tau + 0.441 B^2 + K^2 tau/3 at tau = sqrt(3) N/K.
    N, B, K = GYR_X["N"], GYR_X["B"], GYR_X["K"]
    floor = np.sqrt(2.0 * N * K / np.sqrt(3.0) + 0.4413 * B**2)
    expected = floor / 0.6643
    assert expected > 1.4 * B
    y = at_rest(np.random.default_rng(20), 1_440_000, 100.0, **GYR_X)
    found = read_off(allan_deviation(y, 100.0)).B
    assert found.status is Status.OBSERVED
    assert found.value == pytest.approx(expected, abs=4.0 * found.std)


def test_read_off_of_white_noise_has_no_floor():
    found = read_off(allan_deviation(np.random.default_rng(0).standard_normal(50_000), 100.0))
    assert found.B.status is Status.NOT_OBSERVABLE
    assert "no flat part" in found.B.remark


@pytest.mark.parametrize("kind", ["mdev", "hdev", "ohdev"])
def test_read_off_refuses_curves_of_other_levels(kind):
    curve = allan_deviation(np.random.default_rng(0).standard_normal(500), 1.0, kind=kind)
    with pytest.raises(ValueError, match="`curve` must be of kind adev, oadev or totdev"):
        read_off(curve)


# --- the parts ------------------------------------------------------------------------------


def test_lines_are_read_where_the_formulas_say():
    for symbol, tau in (("Q", np.sqrt(3.0)), ("N", 1.0), ("K", 3.0), ("R", np.sqrt(2.0))):
        assert line(symbol, 0.3, tau) == pytest.approx(0.3)
    assert line("B", 0.3, [1.0, 9.0]) == pytest.approx(0.6643 * 0.3, rel=1e-4)


@pytest.mark.parametrize(
    ("symbol", "unit"),
    [
        ("Q", "m/s^2*s"),
        ("N", "m/s^2/sqrt(Hz)"),
        ("B", "m/s^2"),
        ("K", "m/s^2*sqrt(Hz)"),
        ("R", "m/s^2/s"),
    ],
)
def test_units_of_coefficients(symbol, unit):
    assert coefficient_unit(symbol, "m/s^2") == unit


def test_coefficients_are_found_by_symbol(hour):
    assert isinstance(hour, Coefficients)
    assert [c.symbol for c in hour] == ["Q", "N", "B", "K", "R"]
    assert hour["N"] is hour.N
    with pytest.raises(KeyError):
        hour["fs"]


# --- bad input --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("y", "message"),
    [
        (np.random.default_rng(0).standard_normal(255), "at least 256 samples .* got 255"),
        (np.full(1000, 0.25), r"`gyr x` must vary, got 0.25 in all 1000 samples"),
        (
            np.clip(np.random.default_rng(0).standard_normal(5000), -9.0, 1.0),
            r"`gyr x` must not be clipped, got \d+ of 5000 samples at its highest value 1",
        ),
        (
            np.clip(np.random.default_rng(0).standard_normal(5000), -1.5, 9.0),
            r"`gyr x` must not be clipped, got \d+ of 5000 samples at its lowest value -1.5",
        ),
    ],
)
def test_channels_that_cannot_be_characterised_are_refused(y, message):
    with pytest.raises(InputError, match=message):
        identify(y, 100.0, name="gyr x")


def test_not_a_number_is_refused_with_its_row():
    y = np.random.default_rng(0).standard_normal(500)
    y[77] = np.nan
    with pytest.raises(ValueError, match="`gyr x` must be finite, got nan in row 77"):
        identify(y, 100.0, name="gyr x")


def test_coarse_resolution_is_not_clipping():
    y = np.round(np.random.default_rng(0).standard_normal(50_000) / 0.9) * 0.9
    assert identify(y, 100.0).N.value == pytest.approx(0.1 * np.sqrt(1 + 0.81 / 12), rel=0.02)
