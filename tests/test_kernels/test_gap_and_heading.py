"""Error-state filters after gaps, late fields and disturbed ones: what is new, what is kept."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth import hand
from truth.kernel_step import feed, quat, rotation

from strapdown.attitude import IndirectEkf, Mekf
from strapdown.kernels import memory as m
from strapdown.kernels import status as s

G = 9.80665
DT = 0.01
FILTERS = [Mekf(), IndirectEkf()]
R_NB = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])


def see(flt, x, P, t, r_nb, field=True):
    """One sample at rest; returns the scratch."""
    acc = r_nb.inv().apply([0.0, 0.0, -G])
    mag = r_nb.inv().apply(hand.FIELD_N) if field else np.empty(0)
    return feed(flt, x, P, t, np.zeros(3), acc, mag)


def settled(flt):
    state = flt.init()
    x, P = state.x, state.P
    for k in range(200):
        see(flt, x, P, k * DT, R_NB)
    return x, P, 200 * DT


@pytest.mark.parametrize("flt", FILTERS, ids=lambda f: f.NAME)
def test_after_a_long_gap_tilt_is_that_of_the_sample_and_heading_that_of_the_next_field(flt):
    x, P, t = settled(flt)
    turned = Rotation.from_euler("ZYX", [-2.0, 0.7, -1.0])  # by more than a right angle
    bias = x[m.BG : m.BG + 3].copy()
    see(flt, x, P, t + 6.0, turned, field=False)
    assert int(x[m.STATUS]) & s.GAP
    down, want = (r.inv().apply([0.0, 0.0, 1.0]) for r in (rotation(quat(x)), turned))
    np.testing.assert_allclose(down, want, atol=1e-12)
    # heading is not known yet, and it says so
    assert (rotation(quat(x)) * turned.inv()).magnitude() > 1.0
    assert x[m.STD_ATT + 2] > 1.0
    assert x[m.STD_ATT] < 0.5
    see(flt, x, P, t + 6.0 + DT, turned)
    # at once, not drawn to it over many samples
    assert np.degrees((rotation(quat(x)) * turned.inv()).magnitude()) < 0.1
    assert x[m.STD_ATT + 2] == pytest.approx(flt.std_heading, rel=0.02)
    np.testing.assert_array_equal(x[m.BG : m.BG + 3], bias)


@pytest.mark.parametrize("flt", FILTERS, ids=lambda f: f.NAME)
def test_a_short_gap_only_widens(flt):
    """0.1 s at 0.5 rad/s hides less than a sample of the accelerometer is off."""
    flt = type(flt)(max_gap=0.05)
    x, P, t = settled(flt)
    before = x[m.STD_ATT : m.STD_ATT + 3].copy()
    turned = R_NB * Rotation.from_rotvec([0.02, 0.0, 0.03])
    see(flt, x, P, t + 0.1, turned, field=False)
    assert int(x[m.STATUS]) & s.GAP
    assert x[m.ALIGNED] == m.FULL
    grown = np.sqrt(x[m.STD_ATT : m.STD_ATT + 3] ** 2 - before**2)
    assert grown[2] == pytest.approx(0.5 * 0.11, rel=0.1)  # the last sample came 0.01 s earlier


@pytest.mark.parametrize("flt", FILTERS, ids=lambda f: f.NAME)
def test_a_late_first_field_sets_the_heading_and_leaves_the_tilt(flt):
    state = flt.init()
    x, P = state.x, state.P
    for k in range(500):
        see(flt, x, P, k * DT, R_NB, field=False)
    before = x[m.STD_ATT : m.STD_ATT + 3].copy()
    see(flt, x, P, 500 * DT, R_NB)
    assert np.degrees((rotation(quat(x)) * R_NB.inv()).magnitude()) < 0.1
    after = x[m.STD_ATT : m.STD_ATT + 3]
    np.testing.assert_allclose(after[:2], before[:2], rtol=0.05)
    assert after[2] == pytest.approx(flt.std_heading, rel=0.01)


@pytest.mark.parametrize("flt", FILTERS, ids=lambda f: f.NAME)
def test_a_field_after_a_disturbance_does_not_stand_for_the_time_left_out(flt):
    x, P, t = settled(flt)
    acc = R_NB.inv().apply([0.0, 0.0, -G])
    clean = see(flt, x, P, t, R_NB)[m.D_MAG + 3]
    for k in range(1, 301):  # three times the field for two seconds, the second of waiting
        field = (3.0 if k <= 200 else 1.0) * hand.FIELD_N
        w = feed(flt, x, P, t + k * DT, np.zeros(3), acc, R_NB.inv().apply(field))
        assert w[m.D_MAG + 6] == s.REJECTED_DISTURBED
    first = see(flt, x, P, t + 302 * DT, R_NB)
    assert first[m.D_MAG + 6] == s.ACCEPTED
    # a single sample's sigma, with what two seconds added to the heading's
    assert first[m.D_MAG + 3] > 0.65 * clean  # two intervals of 10 ms, so 0.71 at least
