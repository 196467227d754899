"""Declination of a recording's place and date."""

import numpy as np
import pytest

from strapdown.attitude import declination
from strapdown.recording import Gnss, Recording, from_arrays
from strapdown.units import DEG

PLACE = {"lat_rad": 48.1374 * DEG, "lon_rad": 11.5755 * DEG, "height_m": 520.0}
EPOCH = {"epoch_utc": "2026-03-20T12:00:00Z"}


def recording(**meta):
    return from_arrays([0.0, 0.1], np.zeros((2, 3)), np.ones((2, 3)), **meta)


def test_declination_of_munich_is_four_degrees_east():
    # maps of 2026: 4.2 to 4.4 deg east
    assert declination(recording(**PLACE, **EPOCH)) / DEG == pytest.approx(4.3, abs=0.2)


def test_first_finite_fix_outranks_the_metadata():
    fixes = np.array([[np.nan] * 3, [35.0 * DEG, -117.0 * DEG, 700.0]])
    rec = Recording(gnss=Gnss(t=np.array([0.0, 1.0]), lla=fixes), meta={**PLACE, **EPOCH})
    # California: 11 to 12 deg east in the 2020s
    assert declination(rec) / DEG == pytest.approx(11.3, abs=0.7)


def test_height_may_be_missing():
    place = {key: PLACE[key] for key in ("lat_rad", "lon_rad")}
    assert declination(recording(**place, **EPOCH)) / DEG == pytest.approx(4.3, abs=0.2)


@pytest.mark.parametrize("meta", [{}, PLACE, EPOCH, {**EPOCH, "lat_rad": 0.8}])
def test_without_place_or_date_there_is_none(meta):
    assert declination(recording(**meta)) is None
