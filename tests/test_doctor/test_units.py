"""Units of real logs: each confusion of one sensor's unit is found and named."""

import numpy as np
import pytest
from test_doctor.faults import spoilt

import strapdown as sd
from strapdown import doctor

DEG = np.pi / 180.0
G = 9.80665
# What was recorded, what it was taken for, and what that multiplies SI values by.
CONFUSIONS = [
    ("gyr", "dps", "rad_s", 1.0 / DEG),
    ("gyr", "rad_s", "dps", DEG),
    ("gyr", "mdps", "rad_s", 1000.0 / DEG),
    ("gyr", "mdps", "dps", 1000.0),
    ("gyr", "mrad_s", "rad_s", 1000.0),
    ("acc", "g", "m_s2", 1.0 / G),
    ("acc", "m_s2", "g", G),
    ("acc", "mg", "m_s2", 1000.0 / G),
    ("acc", "mg", "g", 1000.0),
    ("mag", "ut", "t", 1e6),
    ("mag", "gauss", "t", 1e4),
    ("mag", "mgauss", "t", 1e7),
    ("mag", "nt", "t", 1e9),
    ("mag", "mgauss", "ut", 10.0),
    ("mag", "gauss", "ut", 0.01),
    ("mag", "nt", "ut", 1000.0),
    ("mag", "ut", "mgauss", 0.1),
]
IDS = [f"{sensor}-{true}-for-{taken}" for sensor, true, taken, _ in CONFUSIONS]


def found(rec, sensor, true, factor):
    """Whether the one finding on the unit is an error that names what it is."""
    findings = doctor.examine(spoilt(rec, sensor, factor))
    units = [f for f in findings if f.check == "units" and f.stream == sensor]
    if [f.severity for f in units] != ["error"]:
        return False
    return f"--units {sensor}={true}" in units[0].advice or (
        # a factor of thousand is that of two confusions, both are offered
        factor == 1000.0 and f"--units {sensor}=" in units[0].advice
    )


@pytest.fixture(scope="module")
def slow_rotation(broad_02):
    return sd.read(broad_02)


@pytest.mark.parametrize(("sensor", "true", "taken", "factor"), CONFUSIONS, ids=IDS)
def test_confusion_is_found_in_a_trial(slow_rotation, sensor, true, taken, factor):
    assert found(slow_rotation, sensor, true, factor)


@pytest.mark.slow
def test_every_confusion_is_found_in_every_trial_and_drive(data_dir):
    logs = sorted((data_dir / "broad").glob("*.mat")) + sorted((data_dir / "drives").iterdir())
    missed, asked = [], 0
    for path in logs:
        rec = sd.read(path)
        for sensor, true, taken, factor in CONFUSIONS:
            if sensor == "mag" and rec.mag is None:
                continue
            asked += 1
            if not found(rec, sensor, true, factor):
                missed.append((path.stem, sensor, true, taken))
    print(f"{asked - len(missed)} of {asked} found, missed {missed}")
    assert not missed


@pytest.mark.slow
def test_wrong_full_scale_range_of_the_gyroscope_is_found(data_dir):
    for path in sorted((data_dir / "broad").glob("*.mat")):
        for factor in (0.5, 2.0):
            findings = doctor.examine(spoilt(sd.read(path), "gyr", factor))
            units = next(f for f in findings if f.check == "units" and f.stream == "gyr")
            assert units.severity == "error"
            assert f"must be {1.0 / factor:g} times as large" in units.sentence
