"""The kernel of thesis D's INS: closed-form motions, differences, dense matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import feed, scalar_first, start

from strapdown.kernels import memory as m
from strapdown.kernels import status as s
from strapdown.kernels import uav_ins as k
from strapdown.navigation import UavIns

G = 9.80665
A, E2 = 6378137.0, 6.69437999014e-3
PLACE = np.array([0.7, 0.25, 120.0])
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 0.6])
NO_ACC = np.full(3, np.inf)


def radii(lat, height):
    """Textbook radii of (1.2), metres per radian of latitude and longitude."""
    w = 1.0 - E2 * np.sin(lat) ** 2
    return A * (1 - E2) / w**1.5 + height, (A / np.sqrt(w) + height) * np.cos(lat)


def fix(x, t, lla, v_n=(np.nan,) * 3, std_position=(np.nan,) * 3, std_velocity=(np.nan,) * 3):
    x[m.GNSS] = 1.0
    x[m.GNSS + 1 : m.GNSS + 16 - 1] = *([t]), *lla, *v_n, *std_position, *std_velocity, np.nan


def flying(flt=None, r_nb=TURNED, v_n=(5.0, -6.0, 0.5), lla=PLACE):
    """Memory of a filter that navigates from t = 0 on."""
    flt = flt or UavIns(mag_reference=(2.4e-5, 3.9e-5))
    x, P = start(flt, scalar_first(r_nb))
    x[k.FORCE : k.FORCE + 3] = 0.0
    fix(x, 0.0, lla, v_n, (2.0, 2.0, 3.0), (0.1, 0.1, 0.2))
    k.begin(x, P, flt._params())
    x[m.GNSS] = 0.0
    return flt, x, P


def some_covariance(seed=2, scale=1.0):
    a = np.random.default_rng(seed).standard_normal((9, 9))
    return scale * (a @ a.T + 0.1 * np.eye(9))


def way(x, lla=PLACE):
    """North, east, down from a place nearby [m]."""
    r_n, r_e = radii(lla[0], lla[2])
    d = x[m.LLA : m.LLA + 3] - lla
    return np.array([d[0] * r_n, d[1] * r_e, -d[2]])


def test_radii_are_those_of_the_ellipsoid_and_longitude_stays_within_half_a_turn():
    for lat in (-1.2, 0.0, 0.4, 0.9, 1.5):
        _, x, _ = flying(lla=[lat, 3.2, 300.0])
        np.testing.assert_allclose(x[[k.R_N, k.R_E]], radii(lat, 300.0), rtol=1e-12)
        assert x[m.LLA + 1] == pytest.approx(3.2 - 2 * np.pi)
    _, x, _ = flying(lla=[0.3, -3.2, 0.0])
    assert x[m.LLA + 1] == pytest.approx(2 * np.pi - 3.2)


def test_a_thrown_body_follows_its_parabola():
    """No force: ``v + g t``, exact for any step."""
    flt, x, _ = flying(UavIns(use_mag=False))
    x[k.FORCE : k.FORCE + 3] = 0.0
    for _ in range(50):
        k.middle(x, np.zeros(k.W_SIZE), 0.02)
        k.mechanise(x, flt._params(), np.zeros(k.W_SIZE), 0.02)
    np.testing.assert_allclose(x[m.V : m.V + 3], [5.0, -6.0, 0.5 + G], rtol=1e-12)
    # a degree of longitude shrinks with latitude: 5 m of 6378 km
    np.testing.assert_allclose(way(x), [5.0, -6.0, 0.5 + G / 2], rtol=0, atol=2e-5)


def circle(dt, seconds=4.0):
    """Error of the velocity after part of a banked circle, force and rate constant in b."""
    bank, speed = 0.5, 9.0
    rate = G * np.tan(bank) / speed
    r0 = Rotation.from_euler("X", bank)
    gyr, acc = r0.inv().apply([0, 0, rate]), np.array([0, 0, -G / np.cos(bank)])
    flt, x, P = flying(UavIns(use_mag=False, acc_noise=1e6), r0, (speed, 0.0, 0.0))
    for i in range(1, round(seconds / dt) + 1):
        feed(flt, x, P, i * dt, gyr, acc)
    angle = rate * seconds
    return np.abs(x[m.V : m.V + 3] - speed * np.array([np.cos(angle), np.sin(angle), 0])).max()


def test_force_acts_in_the_middle_of_the_interval_so_that_errors_fall_with_its_square():
    off = [circle(dt) for dt in (0.08, 0.04, 0.02)]
    assert off[0] > 1e-4
    np.testing.assert_allclose(np.divide(off[:-1], off[1:]), 4.0, rtol=0.1)


def test_bias_of_the_accelerometer_is_taken_off():
    flt, x, P = flying(UavIns(use_mag=False, acc_noise=1e6), v_n=(0.0, 0.0, 0.0))
    x[m.BA : m.BA + 3] = 0.3, -0.2, 0.1
    acc = TURNED.inv().apply([0, 0, -G]) + [0.3, -0.2, 0.1]
    for i in range(1, 51):
        feed(flt, x, P, i * 0.02, np.zeros(3), acc)
    np.testing.assert_allclose(x[m.V : m.V + 3], 0.0, atol=1e-4)  # the AHRS turns a little


def test_covariance_spreads_as_the_mechanisation_does_by_central_differences():
    flt, x, P = flying()
    x[m.OMEGA : m.OMEGA + 3] = 0.5, -0.3, 0.8
    x[k.FORCE : k.FORCE + 3] = 1.0, 0.5, -9.0
    dt, h, w = 0.02, 1e-3, np.zeros(k.W_SIZE)
    k.middle(x, w, dt)

    def after(e):
        y = x.copy()
        r_n, r_e = y[k.R_N], y[k.R_E]
        y[m.LLA : m.LLA + 3] += [e[0] / r_n, e[1] / r_e, -e[2]]
        y[m.V : m.V + 3] += e[3:6]
        y[m.BA : m.BA + 3] += e[6:]
        k.mechanise(y, flt._params(), w, dt)
        d = y[m.LLA : m.LLA + 3] - x[m.LLA : m.LLA + 3]
        return np.r_[d[0] * r_n, d[1] * r_e, -d[2], y[m.V : m.V + 3], y[m.BA : m.BA + 3]]

    F = np.transpose([(after(h * e) - after(-h * e)) / (2 * h) for e in np.eye(9)])
    before = some_covariance()
    P[k.PN :, k.PN :] = before
    k.spread(P, w, dt)
    got = P[k.PN :, k.PN :]
    # round-off of a latitude is 1e-9 m, over 2 mm
    np.testing.assert_allclose(got, F @ before @ F.T, atol=2e-5)
    assert np.array_equal(got, got.T)
    assert not P[:7, 7:].any()


def test_middle_is_the_attitude_half_an_interval_ago():
    _, x, _ = flying()
    rate, dt, w = np.array([0.5, -0.3, 0.8]), 0.02, np.zeros(k.W_SIZE)
    x[m.OMEGA : m.OMEGA + 3] = rate + [0.1, 0.2, 0.3]
    x[m.BG : m.BG + 3] = 0.1, 0.2, 0.3
    k.middle(x, w, dt)
    want = (TURNED * Rotation.from_rotvec(-0.5 * dt * rate)).as_matrix()
    np.testing.assert_allclose(w[k.W_C : k.W_C + 9].reshape(3, 3), want, atol=6e-5)  # angle^2 / 2


def test_errors_of_attitude_count_as_noise_of_the_acceleration():
    """Tilt about east accelerates north by g, about north east; heading turns the force."""
    flt, x, P = flying(UavIns(tilt_time=3.0, force_noise=0.1, acc_bias_walk=0.01))
    P[:] = 0.0
    x[m.STD_ATT : m.STD_ATT + 3] = 0.01, 0.02, 0.03
    force_n = np.array([2.0, -1.0, -9.0])
    x[k.FORCE : k.FORCE + 3] = TURNED.inv().apply(force_n)
    dt, w = 0.02, np.zeros(k.W_SIZE)
    k.middle(x, w, dt)
    k.predict(x, P, flt._params(), w, dt)
    of_yaw = force_n[[1, 0, 2]] ** 2 * 0.03**2 * [1, 1, 0]
    of_tilt = G**2 * np.array([0.02, 0.01, 0.0]) ** 2
    q = 0.01 + 6.0 * (of_tilt + of_yaw)
    v = P[k.PN :, k.PN :]
    np.testing.assert_allclose(np.diag(v)[3:6], q * dt, rtol=1e-10)
    np.testing.assert_allclose(np.diag(v)[:3], q * dt**3 / 3, rtol=1e-10)
    np.testing.assert_allclose(np.diag(v[:3, 3:6]), q * dt**2 / 2, rtol=1e-10)
    np.testing.assert_allclose(np.diag(v)[6:], 1e-4 * dt, rtol=1e-10)


def test_a_fix_is_the_dense_update_of_position_velocity_and_bias():
    flt, x, P = flying(UavIns(fix_gate=np.inf))
    P[k.PN :, k.PN :] = some_covariance(5)
    before, x0 = P[k.PN :, k.PN :].copy(), x.copy()
    r_n, r_e = radii(PLACE[0], PLACE[2])
    off = np.array([1.5, -2.0, 0.7])
    late = 0.1
    lla = PLACE + [off[0] / r_n, off[1] / r_e, -off[2]]
    z = np.r_[off + late * x[m.V : m.V + 3], 0.3, -0.2, 0.4]
    fix(x, -late, lla, x[m.V : m.V + 3] + z[3:], (1.0, 2.0, 3.0), (0.2, 0.3, 0.4))
    w = np.zeros(k.W_SIZE)
    k.take_fix(x, P, flt._params(), w, 0.0)
    H, R = np.eye(6, 9), np.diag(np.square([1.0, 2.0, 3.0, 0.2, 0.3, 0.4]))
    K = before @ H.T @ np.linalg.inv(H @ before @ H.T + R)
    dx = K @ z
    np.testing.assert_allclose(way(x), dx[:3], atol=1e-5)  # round-off of a latitude, and its turn
    np.testing.assert_allclose(x[m.V : m.V + 3] - x0[m.V : m.V + 3], dx[3:6], atol=1e-6)
    np.testing.assert_allclose(x[m.BA : m.BA + 3], dx[6:], atol=1e-6)
    I_KH = np.eye(9) - K @ H
    np.testing.assert_allclose(P[k.PN :, k.PN :], I_KH @ before @ I_KH.T + K @ R @ K.T, atol=1e-12)
    assert w[k.W_FIX + 6] == w[k.W_FIX + 13] == s.ACCEPTED
    np.testing.assert_allclose(w[k.W_FIX : k.W_FIX + 2], [z[0], w[k.W_FIX + 1]], atol=1e-5)


def test_across_the_antimeridian_a_fix_is_near():
    flt, x, P = flying(lla=[0.3, np.pi - 1e-7, 0.0])
    fix(x, 0.0, [0.3, -np.pi + 1e-7, 0.0])
    k.take_fix(x, P, flt._params(), np.zeros(k.W_SIZE), 0.0)
    assert k.residual(x, 1, 0.0) == pytest.approx(0.0, abs=2.0)


def test_a_fix_beyond_the_gate_pulls_no_more_than_one_at_it():
    found = []
    for north in (100.0, 1e5):
        flt, x, P = flying()
        r_n, _ = radii(PLACE[0], PLACE[2])
        fix(x, 0.0, PLACE + [north / r_n, 0.0, 0.0], std_position=(2.0, 2.0, 3.0))
        w = np.zeros(k.W_SIZE)
        k.take_fix(x, P, flt._params(), w, 0.0)
        assert w[k.W_FIX + 6] == s.REJECTED_GATE
        assert int(x[m.STATUS]) & s.AIDING_REJECTED
        found.append(way(x)[0])
    assert 0.0 < found[1] < found[0] < 10.0


def test_navigation_begins_with_the_first_fix_after_heading_is_known():
    flt = UavIns(mag_reference=(2.4e-5, 3.9e-5))
    state = flt.init()
    x, P = state.x, state.P
    fix(x, 0.0, PLACE, (9.0, 0.0, 0.0))
    feed(flt, x, P, 0.0, np.zeros(3), [0, 0, -G])  # no heading yet
    assert np.isnan(x[m.LLA])
    feed(flt, x, P, 0.02, np.zeros(3), [0, 0, -G], [2.4e-5, 0, 3.9e-5])
    assert np.isnan(x[m.LLA])  # and no new fix
    fix(x, 0.04, PLACE, (9.0, 0.0, 0.0), (1.0, 1.0, 2.0))
    feed(flt, x, P, 0.04, np.zeros(3), [0, 0, -G], [2.4e-5, 0, 3.9e-5])
    np.testing.assert_array_equal(x[m.LLA : m.LLA + 3], PLACE)
    np.testing.assert_array_equal(x[m.V : m.V + 3], [9.0, 0.0, 0.0])
    np.testing.assert_allclose(x[m.STD_POS : m.STD_POS + 3], [1, 1, 2])
    np.testing.assert_allclose(x[m.STD_V : m.STD_V + 3], flt.std_fix_velocity)


@pytest.mark.parametrize("bad", [[np.nan, 0.2, 0.0], [2.0, 0.2, 0.0], [0.7, 0.2, 1e6]])
def test_impossible_fixes_change_nothing(bad):
    flt, x, P = flying()
    y, Q = x.copy(), P.copy()
    feed(flt, y, Q, 0.02, np.zeros(3), [0, 0, -G])
    fix(x, 0.02, bad)
    feed(flt, x, P, 0.02, np.zeros(3), [0, 0, -G])
    np.testing.assert_array_equal(x[m.LLA : m.LLA + 12], y[m.LLA : m.LLA + 12])
    np.testing.assert_array_equal(P, Q)


def test_over_a_gap_it_flies_on_and_says_how_little_it_knows():
    flt, x, P = flying(UavIns(max_gap=0.5, use_mag=False))
    feed(flt, x, P, 2.0, np.zeros(3), TURNED.inv().apply([0, 0, -G]))
    assert int(x[m.STATUS]) & s.GAP
    np.testing.assert_allclose(way(x), [10.0, -12.0, 1.0], atol=1e-4)
    np.testing.assert_array_equal(x[m.V : m.V + 3], [5.0, -6.0, 0.5])
    assert x[m.STD_V] > 2.0 * G * 0.99
    assert x[m.STD_POS] > 2.0 * G * 0.99


def test_a_skipped_rate_is_made_good_by_the_next():
    """The interval of the sample after covers both."""
    flt, x, P = flying(UavIns(use_mag=False, acc_noise=1e6), Rotation.identity(), (9.0, 0, 0))
    feed(flt, x, P, 0.02, [np.nan, 0, 0], [0, 0, -G])
    np.testing.assert_allclose(way(x), 0.0, atol=1e-9)
    feed(flt, x, P, 0.04, np.zeros(3), [0, 0, -G])
    np.testing.assert_allclose(way(x), [0.36, 0, 0], atol=1e-6)
