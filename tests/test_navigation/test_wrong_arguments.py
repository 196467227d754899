"""Arguments of a wrong kind, shape or size: one sentence that names the argument."""

import numpy as np
import pytest

from strapdown.navigation import Start, alignment, error_growth, mechanise
from strapdown.navigation.mechanisation import means_from_points, velocity_terms
from strapdown.report import compose, doubts
from strapdown.simulation import load

HERE = (0.8, 0.1, 100.0)


@pytest.fixture(scope="module")
def rec():
    return load("drive").record(seed=1).between(0.0, 12.0)


@pytest.mark.parametrize("bad", [np.nan, np.inf, [1.0, 2.0], "x", None, 1e300])
@pytest.mark.parametrize("name", ["position", "tilt", "acc_bias", "gyr_bias", "gravity"])
@pytest.mark.parametrize("function", [error_growth.drift, error_growth.schuler_error])
def test_causes_of_errors_are_finite_numbers(function, name, bad):
    with pytest.raises((ValueError, TypeError), match=f"`{name}` must"):
        function([1.0], **{name: bad})


@pytest.mark.parametrize("bad", [np.nan, [1.0, np.inf], ["x"], [[1.0], [1.0, 2.0]], 1e300])
@pytest.mark.parametrize(
    "function",
    [error_growth.drift, error_growth.schuler_error, error_growth.unstable_growth],
)
def test_times_are_finite(function, bad):
    with pytest.raises((ValueError, TypeError), match="`t` must"):
        function(bad)


@pytest.mark.parametrize("bad", [0.0, "x", [1.0], [1.0, 2.0, 3.0], [np.nan, 1.0], [2.0, 1.0], {}])
@pytest.mark.parametrize("name", ["level", "magnetic", "velocity_matching", "course"])
def test_a_span_is_two_increasing_times(rec, name, bad):
    with pytest.raises((ValueError, TypeError), match="`span` must"):
        getattr(alignment, name)(rec, span=bad)


@pytest.mark.parametrize("name", ["level", "magnetic", "velocity_matching", "course"])
def test_alignment_takes_a_recording(rec, name):
    with pytest.raises(TypeError, match="`rec` must be a Recording"):
        getattr(alignment, name)(rec.imu, span=(0.0, 2.0))


def test_what_decides_on_rest_and_heading_is_checked(rec):
    with pytest.raises(TypeError, match="`test` must be a RestTest, got float"):
        alignment.level(rec, test=0.1)
    with pytest.raises(TypeError, match="`max_heading_std` must"):
        alignment.velocity_matching(rec, max_heading_std="5 deg")
    with pytest.raises(ValueError, match="`max_heading_std` must be positive"):
        alignment.velocity_matching(rec, max_heading_std=-1.0)


def test_a_start_is_a_start(rec):
    with pytest.raises(TypeError, match=r"`start` must be a Start, got tuple; `Start\.of`"):
        mechanise(rec, HERE)
    with pytest.raises(TypeError, match="`sol` must be a Solution or a Truth, got Recording"):
        Start.of(rec)


@pytest.mark.parametrize("bad", [[1.0, 2.0], 3.0, "x", [np.nan, 0.0, 0.0]])
def test_places_and_velocities_are_finite_vectors(bad):
    with pytest.raises((ValueError, TypeError), match="`v_n` must"):
        velocity_terms(HERE, bad)
    with pytest.raises((ValueError, TypeError), match="`lla` must"):
        velocity_terms(bad, (1.0, 2.0, 3.0))


@pytest.mark.parametrize("bad", [[1.0, 2.0], "x", [[1.0, np.nan], [1.0, 2.0]], [[1.0, 2.0]]])
def test_points_are_rows_of_finite_values(bad):
    with pytest.raises((ValueError, TypeError), match="`values` must"):
        means_from_points([0.0, 1.0], bad)


def test_a_report_is_of_a_solution_and_a_recording(rec):
    with pytest.raises(TypeError, match="`sol` must be a Solution"):
        compose(rec, rec)
    with pytest.raises(TypeError, match="`sol` must be a Solution"):
        doubts(None)
