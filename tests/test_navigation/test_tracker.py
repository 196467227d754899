"""The real-time form: fixes that come late or out of order."""

import drive
import numpy as np
import pytest

from strapdown.navigation import LooselyCoupled, NavigationTracker

FLT = LooselyCoupled()
COUNT = 3400


@pytest.fixture(scope="module")
def city():
    return drive.simulate(seed=3, duration=40.0)


@pytest.fixture(scope="module")
def in_time(city):
    return FLT.run(city.rec.between(-1.0, city.t[COUNT - 1] + 1e-6))


def feed(city, arrival, history=3.0):
    """Feed samples and fixes; `arrival(j, t)` is when fix j of time t arrives."""
    g, imu = city.rec.gnss, city.rec.imu
    fixes = sorted((arrival(j, t), j) for j, t in enumerate(g.t))
    trk = NavigationTracker(FLT, history=history)
    for k in range(COUNT):
        while fixes and fixes[0][0] <= imu.t[k]:
            j = fixes.pop(0)[1]
            trk.add_gnss(g.t[j], g.lla[j], g.v_n[j], g.std_position_n[j], g.std_velocity_n[j])
        trk.update(imu.t[k], imu.gyr[k], imu.acc[k])
    return trk


def same(trk, sol):
    np.testing.assert_array_equal(trk.q_nb, sol.q_nb[-1])
    np.testing.assert_array_equal(trk.lla, sol.lla[-1])
    np.testing.assert_array_equal(trk.v_n, sol.v_n[-1])
    np.testing.assert_array_equal(trk.q_vb, sol.q_vb[-1])


def test_fixes_in_time_give_what_a_run_gives(city, in_time):
    same(feed(city, lambda j, t: t), in_time)


def test_late_fixes_give_the_same_to_the_last_bit(city, in_time):
    # the last fix still arrives before the last sample
    trk = feed(city, lambda j, t: min(t + 0.37, city.t[COUNT - 2]))
    same(trk, in_time)
    assert trk.dropped == 0


def test_fixes_out_of_order_give_the_same(city, in_time):
    delays = (0.9, 0.05, 1.4, 0.3)
    trk = feed(city, lambda j, t: min(t + delays[j % 4], city.t[COUNT - 2]))
    same(trk, in_time)


def test_what_is_later_than_the_history_is_dropped_and_counted(city, in_time):
    trk = feed(city, lambda j, t: t + (5.0 if j == 40 else 0.0), history=2.0)
    assert trk.dropped == 1
    assert np.isfinite(trk.lla).all()
    assert trk.lla.tolist() != in_time.lla[-1].tolist()


def test_its_memory_is_bounded_by_the_history(city):
    trk = feed(city, lambda j, t: t, history=2.0)
    assert len(trk._samples) < 100 * (2.0 + 2 * 0.5) + 5
    assert len(trk._snapshots) < 2.0 / 0.5 + 4


def test_the_estimator_hands_it_out(city):
    trk = FLT.tracker()
    assert isinstance(trk, NavigationTracker)
    trk.update(0.01, city.rec.imu.gyr[0], city.rec.imu.acc[0])
    assert np.isnan(trk.lla).all()
    with pytest.raises(ValueError, match="`t` must increase"):
        trk.update(0.01, city.rec.imu.gyr[1], city.rec.imu.acc[1])
    with pytest.raises(ValueError, match="`history` must"):
        NavigationTracker(FLT, history=-1.0)


def test_wheel_speed_and_pressure_enter_it_too(city):
    trk = FLT.tracker()
    for k in range(10):
        trk.add_speed(city.t[k], 0.0)
        trk.add_pressure(city.t[k], 96500.0)
        trk.update(city.t[k], city.rec.imu.gyr[k], city.rec.imu.acc[k])
    assert np.isfinite(trk.q_nb).all()


def test_a_slower_gyroscope_is_held(city):
    imu, held, absent = city.rec.imu, NavigationTracker(FLT), NavigationTracker(FLT)
    for k in range(200):
        real = k % 3 == 0
        held.update(imu.t[k], imu.gyr[k - k % 3], imu.acc[k])
        absent.update(imu.t[k], imu.gyr[k] if real else None, imu.acc[k])
    np.testing.assert_array_equal(held.state.x, absent.state.x)
