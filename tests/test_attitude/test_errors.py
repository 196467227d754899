"""Each sentence with which estimators refuse something."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import strapdown
from strapdown import attitude, estimator
from strapdown.errors import MissingStream
from strapdown.recording import Imu, Mag, Recording, from_arrays

ZERO, DOWN = np.zeros(3), np.array([0.0, 0.0, -9.8])
REC = from_arrays(
    np.arange(5) / 10.0, np.zeros((5, 3)), np.tile(DOWN, (5, 1)), np.tile([2e-5, 0, 4e-5], (5, 1))
)
CLASSES = (
    attitude.GyroIntegration, attitude.Madgwick, attitude.Mahony, attitude.Mekf,
    attitude.RobustEskf,
)  # fmt: skip


@pytest.fixture(params=CLASSES, ids=lambda c: c.NAME)
def flt(request):
    return request.param()


@pytest.mark.parametrize("t", [0.2, 0.1, -math.inf, math.inf, math.nan])
def test_time_must_increase(flt, t):
    state = flt.step(flt.init(), 0.2, ZERO, DOWN)
    sentence = rf"`t` must increase, got {t} after 0\.2\."
    with pytest.raises(ValueError, match=sentence):
        flt.step(state, t, ZERO, DOWN)
    trk = flt.tracker(state)
    with pytest.raises(ValueError, match=sentence):
        trk.update(t, ZERO, DOWN)
    assert np.array_equal(trk.state.x, state.x, equal_nan=True)


WRONG = {
    "two components": np.zeros(2),
    "four components": np.zeros(4),
    "a row": np.zeros((1, 3)),
    "a column": np.zeros((3, 1)),
    "a number": 1.0,
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
@pytest.mark.parametrize("name", ["gyr", "acc", "mag"])
def test_vectors_must_have_three_components(flt, name, wrong):
    sample = {"gyr": ZERO, "acc": DOWN, "mag": DOWN} | {name: wrong}
    with pytest.raises(ValueError, match=r"must have shape \(3,\), got .*\("):
        flt.step(flt.init(), 0.0, **sample)
    trk = flt.tracker()
    with pytest.raises(ValueError, match=r"must have shape \(3,\), got .*\("):
        trk.update(0.0, **sample)
    trk.update(0.0, ZERO, DOWN)  # and nothing has happened to it
    assert np.array_equal(trk.state.x, flt.step(flt.init(), 0.0, ZERO, DOWN).x, equal_nan=True)


@pytest.mark.parametrize("name", ["gyr", "acc", "mag"])
def test_vectors_must_hold_numbers(flt, name):
    sample = {"gyr": ZERO, "acc": DOWN, "mag": DOWN} | {name: ["a", "b", "c"]}
    with pytest.raises(TypeError, match=f"`{name}` must hold real numbers"):
        flt.step(flt.init(), 0.0, **sample)
    with pytest.raises(TypeError, match=f"`{name}` must hold real numbers"):
        flt.tracker().update(0.0, **sample)


def test_aiding_must_be_a_known_stream(flt):
    with pytest.raises(ValueError, match=r"`aiding` must be one of star, .*'gnns'; the nearest"):
        flt.step(flt.init(), 0.0, ZERO, DOWN, gnns=[1.0])
    with pytest.raises(ValueError, match=r"`star` must have shape \(4,\), got \(3,\)"):
        flt.step(flt.init(), 0.0, ZERO, DOWN, star=[1.0, 0.0, 0.0])


def test_state_must_be_its_own(flt):
    other = next(c for c in CLASSES if c.NAME != flt.NAME)()
    sentence = f"`state` must belong to {flt.NAME}, got one of {other.NAME}"
    with pytest.raises(ValueError, match=sentence):
        flt.step(other.init(), 0.0, ZERO, DOWN)
    with pytest.raises(ValueError, match=sentence):
        flt.advance(other.init(), REC)
    with pytest.raises(ValueError, match=sentence):
        flt.tracker(other.init())


def test_state_must_have_the_size_of_its_memory(flt):
    """A file of another version, or another choice of states: kernels check no index."""
    state = flt.init()
    short = state._replace(x=state.x[:-1])
    small = state._replace(P=np.zeros((1, 1)))
    for wrong in (short, small):
        with pytest.raises(ValueError, match=r"`state` must have x of shape .* and P of shape"):
            flt.step(wrong, 0.0, ZERO, DOWN)
        with pytest.raises(ValueError, match=r"`state` must have x of shape .* and P of shape"):
            flt.advance(wrong, REC)
        with pytest.raises(ValueError, match=r"`state` must have x of shape .* and P of shape"):
            flt.tracker(wrong)


def test_recording_must_begin_after_the_state(flt):
    _, state = flt.advance(flt.init(), REC)
    with pytest.raises(ValueError, match=r"`rec` must begin after the state, got 0\.0 after 0\.4"):
        flt.advance(state, REC)


def test_recording_must_have_an_imu(flt):
    mag_only = Recording(mag=REC.mag)
    with pytest.raises(MissingStream, match=r"must have the stream 'imu', it has mag"):
        flt.run(mag_only)
    with pytest.raises(MissingStream, match=r"must have the stream 'imu', it has nothing"):
        strapdown.estimators.preferred(Recording())


def test_navigation_says_which_stream_it_needs():
    for entry in strapdown.estimators.entries():
        for stream in entry.needs:
            with pytest.raises(MissingStream, match=f"must have the stream '{stream}'"):
                entry.cls().run(REC)


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ([1.0, 0, 0], r"`attitude` must have shape \(4,\), got \(3,\)"),
        ([2.0, 0, 0, 0], r"`attitude` must have unit norm within 1e-06, got norm 2"),
        ([np.nan, 0, 0, 0], r"`attitude` must be finite"),
    ],
)
def test_given_attitude_must_be_a_unit_quaternion(flt, given, sentence):
    with pytest.raises(ValueError, match=sentence):
        flt.init(attitude=given)


def test_unknown_names_offer_the_nearest():
    for create in (strapdown.estimators.create, attitude.create):
        with pytest.raises(ValueError, match=r"`filter` must be one of .*'madgwik'; .*'madgwick'"):
            create("madgwik")
        with pytest.raises(
            ValueError,
            match=r"`betta` must be a parameter of madgwick \(.*\); the nearest.*'beta'",
        ):
            create("madgwick", betta=0.1)
    with pytest.raises(ValueError, match="`filter` must be one of"):
        strapdown.estimators.entry("nothing like it")


def test_a_name_is_given_once():
    @dataclass(frozen=True, slots=True, kw_only=True)
    class Twin(attitude.Madgwick):
        """Another class under a name that is taken."""

    with pytest.raises(ValueError, match="`NAME` must be unique, got 'madgwick' twice"):
        estimator.register(source="none", cost="none")(Twin)


COMMON = [
    ("max_gap", 0.0, "positive"),
    ("max_gap", math.inf, "positive"),
    ("max_gap", math.nan, "positive"),
    ("gyr_range", -1.0, "positive"),
    ("acc_range", 0.0, "positive"),
    ("acc_range", math.nan, "positive"),
    ("declination", 3.2, r"lie in \[-3.14159, 3.14159\]"),
    ("declination", math.nan, "lie in"),
]


@pytest.mark.parametrize(("name", "value", "must"), COMMON)
def test_common_parameters_are_checked(flt, name, value, must):
    with pytest.raises(ValueError, match=f"`{name}` must .*{must}.*got"):
        type(flt)(**{name: value})


@pytest.mark.parametrize(("name", "value"), [("use_mag", 1), ("use_mag", "yes"), ("max_gap", "1")])
def test_common_parameters_have_their_types(flt, name, value):
    with pytest.raises(
        TypeError, match=f"`{name}` must be (True or False|a number), got {value!r}"
    ):
        type(flt)(**{name: value})


OWN = [
    ("madgwick", "beta", (-0.1, math.inf, math.nan), (0.0, 1.0)),
    ("madgwick", "zeta", (-0.1, math.inf), (0.0,)),
    ("mahony", "kp", (-0.1, 0.0, math.inf), (1.0,)),
    ("mahony", "ki", (-0.1, math.nan), (0.0,)),
    ("mekf", "gyr_noise", (0.0, -1.0), (1e-3,)),
    ("mekf", "gyr_bias_noise", (-1.0,), (0.0,)),
    ("mekf", "acc_noise", (0.0,), (0.1,)),
    ("mekf", "mag_noise", (0.0,), (0.1,)),
    ("mekf", "std_tilt", (0.0,), (0.1,)),
    ("mekf", "std_heading", (0.0,), (0.1,)),
    ("mekf", "std_gyr_bias", (-1.0,), (0.0,)),
    ("mekf", "gap_rate", (-1.0,), (0.0,)),
    ("mekf", "gravity", (0.0, -9.8), (9.78,)),
    ("mekf", "gate", (0.0, -1.0, math.nan), (3.0, math.inf)),
]


@pytest.mark.parametrize(("filter_name", "name", "bad", "good"), OWN)
def test_own_parameters_are_checked(filter_name, name, bad, good):
    for value in bad:
        with pytest.raises(ValueError, match=f"`{name}` must be (positive|non-negative)"):
            strapdown.estimators.create(filter_name, **{name: value})
    for value in good:
        strapdown.estimators.create(filter_name, **{name: value}).run(REC)


@pytest.mark.parametrize("alpha", [0.99, -1.0, math.nan])
def test_step_of_madgwick_must_be_at_least_what_the_gyro_turns(alpha):
    with pytest.raises(ValueError, match=r"`alpha` must lie in \[1, inf\], got"):
        attitude.Madgwick(alpha=alpha)


@pytest.mark.parametrize("dip", [1.6, -1.6, math.nan])
def test_dip_must_be_that_of_a_field(dip):
    with pytest.raises(ValueError, match=r"`dip` must lie in \[-1.5708, 1.5708\], got"):
        attitude.Madgwick(dip=dip)


def test_gyro_error_must_not_be_negative():
    with pytest.raises(ValueError, match="`gyr_error` must be non-negative"):
        attitude.Madgwick.from_gyro_error(-0.1)
    with pytest.raises(ValueError, match="`gyr_bias_drift` must be non-negative"):
        attitude.Madgwick.from_gyro_error(0.1, -0.1)


def test_mag_stream_before_the_imu_is_no_error(flt):
    early = Recording(imu=Imu(t=[1.0], gyr=[ZERO], acc=[DOWN]), mag=Mag(t=[0.0], mag=[DOWN]))
    assert len(flt.run(early)) == 1
