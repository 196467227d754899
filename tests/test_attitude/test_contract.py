"""What every attitude estimator offers, and that defaults work."""

import copy
import math
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

import strapdown
from strapdown import attitude, estimator
from strapdown.recording import Gnss, Recording, from_arrays
from strapdown.simulation import demo

ENTRIES = list(strapdown.estimators.entries())
ATTITUDE = [e for e in ENTRIES if e.gives == "attitude"]
REC = demo.recording(duration=14.0)


@pytest.fixture(params=ATTITUDE, ids=lambda e: e.name)
def entry(request):
    return request.param


def test_registry_lists_its_names_in_order():
    names = strapdown.estimators.names()
    assert list(names) == sorted(names)
    assert {"gyro", "madgwick", "mahony", "mekf"} <= set(names)
    assert [e.name for e in ENTRIES] == list(names)


def test_entry_says_what_users_want_to_know(entry):
    assert entry.name == entry.cls.NAME
    assert entry.summary.endswith(".")
    assert entry.source
    assert entry.cost
    assert isinstance(entry.smooths, bool)


def test_defaults_run(entry):
    sol = entry.cls().run(REC)
    assert len(sol) == len(REC.imu)
    assert sol.t is REC.imu.t
    assert sol.filter == entry.name
    assert sol.causal
    assert sol.meta["parameters"] == entry.cls().parameters()
    assert entry.is_compiled()


def test_creation_by_name_is_the_class(entry):
    assert strapdown.estimators.create(entry.name) == entry.cls()
    assert attitude.create(entry.name, max_gap=2.0) == entry.cls(max_gap=2.0)
    assert type(strapdown.estimators.create(entry.name)) is entry.cls


def test_estimators_are_frozen_values(entry):
    flt = entry.cls()
    before = hash(flt)
    flt.run(REC.between(0.0, 1.0))
    flt.step(flt.init(), 0.0, [0, 0, 0], [0, 0, -9.8])
    assert hash(flt) == before
    assert flt == entry.cls()
    for twin in (pickle.loads(pickle.dumps(flt)), copy.deepcopy(flt), replace(flt)):
        assert twin == flt
        assert np.array_equal(twin.run(REC).q_nb, flt.run(REC).q_nb)
    with pytest.raises(AttributeError):
        flt.max_gap = 3.0


def test_changed_parameters_take_effect_after_use(entry):
    """What is prepared once belongs to the old parameters, not to the new ones."""
    flt = entry.cls()
    flt.step(flt.init(), 0.0, [0, 0, 0], [0, 0, -9.8])
    other = replace(flt, declination=0.5)
    for each, heading in ((flt, 0.0), (other, 0.5)):
        state = each.step(each.init(), 0.0, [0, 0, 0], [0, 0, -9.8], [2e-5, 0, 4e-5])
        w, _, _, z = state.q_nb
        assert 2 * math.atan2(z, w) == pytest.approx(heading, abs=1e-12)


def test_every_parameter_is_documented(entry):
    text = "\n".join(c.__doc__ or "" for c in entry.cls.__mro__)
    for field in fields(entry.cls):
        assert field.name in text


def test_preferred_is_the_highest_rank_whose_streams_there_are():
    best = max(ATTITUDE, key=lambda e: e.rank)
    assert strapdown.estimators.preferred(REC) == best.name
    fixes = Gnss(t=[0.0], lla=[[0.8, 0.2, 500.0]])
    with_gnss = replace(REC, gnss=fixes)
    fit = [e for e in ENTRIES if set(e.needs) <= {"gnss"}]
    assert strapdown.estimators.preferred(with_gnss) == max(fit, key=lambda e: e.rank).name


def test_demo_is_followed_within_its_sensor_errors(entry):
    """Bias of 0.3 deg/s and tens of milligravity of motion: degrees, not tens of them."""
    sol = entry.cls().run(REC)
    dot = np.abs(np.sum(sol.q_nb * REC.reference.attitude.q_nb, axis=1))
    off = 2 * np.degrees(np.arccos(np.minimum(dot, 1.0)))
    assert off.max() < 12.0


def test_state_of_an_empty_run_is_the_first(entry):
    flt = entry.cls()
    empty = from_arrays(np.empty(0), np.empty((0, 3)), np.empty((0, 3)), np.empty((0, 3)))
    sol = flt.run(empty)
    assert len(sol) == 0
    assert isinstance(flt.advance(flt.init(), empty)[1], estimator.State)
    assert not Recording().imu
