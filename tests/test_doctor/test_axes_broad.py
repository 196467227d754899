"""Axes of real logs: each of the 48 permutations and reflections of one sensor is named."""

import numpy as np
import pytest
from test_doctor.faults import remedy, signed_permutations, spoilt

import strapdown as sd
from strapdown import doctor

SENSORS = ("gyr", "acc", "mag")
# A rotation and a translation with breaks: gravity is hard to see in the second.
TRIALS = ("02_undisturbed_slow_rotation_B", "18_undisturbed_fast_translation_with_breaks_B")


def named(rec, sensor, S):
    """Whether the doctor names the fault, and for a field its opposite too."""
    findings = doctor.examine(spoilt(rec, sensor, S))
    axes = [f for f in findings if f.check == "axes" and f.severity != "note"]
    sign_only = np.array_equal(np.abs(S), np.eye(3)) and abs(np.trace(S)) == 3
    if sign_only and (sensor != "gyr" or S[0, 0] > 0):
        return [f.severity for f in axes] == ["ok"] and "-x,-y,-z" in axes[0].sentence
    if len(axes) != 1 or axes[0].stream != sensor or axes[0].severity != "error":
        return False
    wanted = [remedy(sensor, S)] if sensor == "gyr" else [remedy(sensor, s * S) for s in (1, -1)]
    offers = axes[0].advice.replace(".", " ").replace(";", " ").split("--axes ")[1:]
    return sorted(offer.split()[0] for offer in offers) == sorted(wanted)


@pytest.fixture(scope="module", params=TRIALS)
def trial(request, data_dir):
    return sd.read(data_dir / "broad" / f"{request.param}.mat")


@pytest.mark.parametrize("sensor", SENSORS)
def test_six_faults_of_each_sensor_are_named(trial, sensor):
    # every eighth: each of the six orders of the axes once, with other signs each time
    faults = [signed_permutations()[8 * i + j] for i, j in enumerate((7, 1, 2, 4, 3, 6))]
    assert all(named(trial, sensor, S) for S in faults)


@pytest.mark.slow
@pytest.mark.parametrize("sensor", SENSORS)
def test_all_48_faults_are_named_in_99_of_100_trials(data_dir, sensor):
    trials = sorted((data_dir / "broad").glob("*.mat"))
    missed = []
    for path in trials:
        rec = sd.read(path)
        missed += [
            (path.stem, remedy(sensor, S))
            for S in signed_permutations()
            if not named(rec, sensor, S)
        ]
    print(f"{sensor}: {48 * len(trials) - len(missed)} of {48 * len(trials)} named")
    assert len(missed) <= 0.01 * 48 * len(trials), missed
