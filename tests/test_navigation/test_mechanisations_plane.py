"""The two teaching systems in a vertical plane."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from strapdown.navigation import mechanise_plane

RADIUS, GRAVITY = 6378137.0, 9.80665


def means(t, x):
    """Means over the intervals, from values on a grid ten times finer."""
    fine = x.reshape(-1)
    inside = fine[1:].reshape(-1, 10).mean(axis=1) + (fine[:-1:10] - fine[10::10]) / 20
    return np.concatenate((fine[:1], inside))


def meridian(rate, seconds=200.0):
    """A curved climb at 500 to 770 m/s in polar coordinates, and what the sensors measure.

    z is up here: height over the circle; the body's angle to the local level swings.
    """
    t = np.arange(round(seconds * rate) * 10 + 1) / (10 * rate)
    db = 500.0 / RADIUS + 270.0 / RADIUS * t / seconds  # of the angle along the meridian
    ddb = np.full_like(t, 270.0 / RADIUS / seconds)
    z = 1000.0 + 400.0 * np.sin(0.05 * t) + 5.0 * t
    dz, ddz = 20.0 * np.cos(0.05 * t) + 5.0, -1.0 * np.sin(0.05 * t)
    r = RADIUS + z
    f_x = r * ddb + 2 * dz * db
    f_up = ddz - r * db**2 + GRAVITY
    theta, dtheta = 0.4 * np.sin(0.3 * t), 0.12 * np.cos(0.3 * t)
    return t, f_x, f_up, theta, dtheta, db, r * db, z, dz


def sensed(rate, axes):
    t, f_x, f_up, theta, dtheta, db, v_x, z, dz = meridian(rate)
    sign = 1.0 if axes == "up" else -1.0
    f_z = sign * f_up
    omega = dtheta + sign * db  # in space the level turns with it
    c, s = np.cos(theta), np.sin(theta)
    f_xb, f_zb = c * f_x - s * f_z, s * f_x + c * f_z
    row = slice(None, None, 10)
    truth = np.column_stack((theta, sign * z, v_x, sign * dz))[row]
    return t[row], means(t, omega), means(t, f_xb), means(t, f_zb), truth


def run(rate, axes, table=None):
    t, omega, f_xb, f_zb, truth = sensed(rate, axes)
    sol = mechanise_plane(
        t, omega, f_xb, f_zb, axes=table or axes, gravity=GRAVITY, radius=RADIUS,
        theta=truth[0, 0], position=(0.0, truth[0, 1]), velocity=truth[0, 2:],
    )  # fmt: skip
    return sol, np.column_stack((sol.theta, sol.z, sol.v_x, sol.v_z)) - truth


@pytest.mark.parametrize("axes", ["up", "down"])
def test_meridian_system_follows_its_flight(axes):
    _, error = run(100.0, axes)
    # the thesis's own test ended within 15 mm with either consistent table
    assert np.abs(error[:, 1]).max() < 0.015
    assert np.abs(error[:, 2:]).max() < 1e-3
    assert np.abs(error[:, 0]).max() < 1e-8


@pytest.mark.parametrize("axes", ["up", "down"])
def test_error_falls_with_the_square_of_the_interval(axes):
    coarse, fine = (np.abs(run(rate, axes)[1][-1]) for rate in (10.0, 20.0))
    assert np.log2(coarse[1] / fine[1]) == pytest.approx(2.0, abs=0.1)
    assert np.log2(coarse[2] / fine[2]) == pytest.approx(2.0, abs=0.1)


def test_the_printed_signs_lose_kilometres():
    _, error = run(50.0, "up", "printed")
    assert abs(error[-1, 1]) > 1000.0


def test_the_way_along_the_meridian_is_that_of_the_box_itself():
    sol, _ = run(200.0, "up")
    t, *_, v_x, _, _ = meridian(200.0)
    assert sol.x[-1] == pytest.approx(np.trapezoid(v_x, t), abs=0.01)


def test_inertial_plane_follows_a_free_integration():
    rate = 400.0
    t = np.arange(round(20 * rate) * 10 + 1) / (10 * rate)
    omega, f_x, f_z = 0.5 * np.cos(0.7 * t), 2 * np.sin(t), -9.0 + np.cos(2 * t)
    g = (0.3, 9.5)

    def slope(now, y):
        w, fx, fz = 0.5 * np.cos(0.7 * now), 2 * np.sin(now), -9.0 + np.cos(2 * now)
        c, s = np.cos(y[0]), np.sin(y[0])
        return [w, y[3], y[4], c * fx + s * fz + g[0], c * fz - s * fx + g[1]]

    y0 = [0.2, 10.0, -5.0, 1.0, 2.0]
    end = solve_ivp(slope, (0, t[-1]), y0, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    sol = mechanise_plane(
        t[::10], means(t, omega), means(t, f_x), means(t, f_z), system="inertial", gravity=g,
        theta=0.2, position=(10.0, -5.0), velocity=(1.0, 2.0),
    )  # fmt: skip
    found = [sol.theta[-1], sol.x[-1], sol.z[-1], sol.v_x[-1], sol.v_z[-1]]
    assert found == pytest.approx(
        end, abs=2e-3
    )  # second order: 9 m/s^2 (0.01)^2 / 24 (20 s)^2 / 2


def test_level_flight_needs_less_lift_than_rest():
    """At constant height and speed: f_z = -(g - v^2 / R), z down."""
    t = np.arange(0.0, 100.0, 0.1)
    v = 300.0
    one = np.ones_like(t)
    sol = mechanise_plane(
        t, -v / RADIUS * one, 0 * one, -(GRAVITY - v**2 / RADIUS) * one, velocity=(v, 0.0)
    )
    assert np.abs(sol.z).max() < 1e-6
    assert np.abs(sol.theta).max() < 1e-12


def test_names_are_checked():
    with pytest.raises(ValueError, match="`axes` must be one of up, down, printed, got 'north'"):
        mechanise_plane([0.0], [0.0], [0.0], [0.0], axes="north")
    with pytest.raises(ValueError, match="`system` must be one of inertial, meridian"):
        mechanise_plane([0.0], [0.0], [0.0], [0.0], system="sphere")
    with pytest.raises(ValueError, match=r"`gravity` must have shape \(2,\)"):
        mechanise_plane([0.0], [0.0], [0.0], [0.0], system="inertial")
    with pytest.raises(ValueError, match=r"`f_zb` must have shape \(1,\), got \(2,\)"):
        mechanise_plane([0.0], [0.0], [0.0], [0.0, 1.0])
