"""The terms of the velocity equation, one by one."""

import numpy as np
import pytest
from truth.flight import Flight, axes

from strapdown.navigation.mechanisation import velocity_terms
from strapdown.units import DEG

OMEGA = 7.292115e-5


def test_rates_of_the_thesis_example():
    """E1: v_E = 20, v_N = 10 m/s, 45 deg: n turns by (3.136, -1.568, -3.136) urad/s."""
    v = np.array([10.0, 20.0, 0.0])
    terms = velocity_terms((45 * DEG, 0.0, 100.0), v)
    rate = np.array([3.136e-6, -1.568e-6, -3.136e-6])
    # the ellipsoid's radii differ from 6378137 m by 0.2 %
    assert terms.transport_n == pytest.approx(-np.cross(rate, v), rel=3e-3)
    spin = OMEGA * np.array([np.cos(45 * DEG), 0.0, -np.sin(45 * DEG)])
    assert terms.coriolis_n == pytest.approx(-2 * np.cross(spin, v))


@pytest.mark.parametrize("lat", [-1.2, -0.3, 0.0, 0.8, 1.5])
def test_with_the_specific_force_they_are_the_change_of_velocity(lat):
    flight = Flight(lat, 0.4, 3000.0, 1.0)
    t = np.array([10.0 - 1e-3, 10.0, 10.0 + 1e-3])
    lla, v_n, C_nb = flight.state(t)
    _, f_b = flight.imu(t)
    found = C_nb[1] @ f_b[1] + velocity_terms(lla[1], v_n[1]).total_n
    # difference quotient: 250 m/s rounded to 6e-14, over 2 ms
    assert found == pytest.approx((v_n[2] - v_n[0]) / 2e-3, abs=2e-6)


@pytest.mark.parametrize("lat", [-1.2, 0.0, 0.8])
def test_gravity_is_attraction_and_centrifugal_acceleration(lat):
    terms = velocity_terms((lat, 0.3, 0.0), (0.0, 0.0, 0.0))
    attraction_e = axes(np.float64(lat), np.float64(0.3)).T @ terms.gravitation_n
    # of a sphere: GM / a^2 towards the centre; flattening changes it by some 1e-3
    assert np.linalg.norm(attraction_e) == pytest.approx(3.986004418e14 / 6371e3**2, rel=4e-3)
    outwards = np.linalg.norm(terms.centrifugal_n)
    assert outwards == pytest.approx(OMEGA**2 * 6378137 * np.cos(lat), rel=4e-3)
    assert terms.centrifugal_n[0] * lat <= 0.0  # towards the equator
    assert terms.centrifugal_n[2] <= 0.0  # and up
    assert np.abs(terms.coriolis_n).max() == 0.0


def test_many_places_at_once():
    lla = np.array([[0.1, 0.2, 3.0], [-0.7, 2.0, 100.0]])
    v = np.array([[10.0, 20.0, 1.0], [-5.0, 3.0, 0.0]])
    together = velocity_terms(lla, v)
    assert together.total_n.shape == (2, 3)
    assert together.total_n[1] == pytest.approx(velocity_terms(lla[1], v[1]).total_n)
