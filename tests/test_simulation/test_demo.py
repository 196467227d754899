"""The demo's motion is consistent: its derivatives are those of its attitude and position."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.constants import OMEGA_IE
from strapdown.simulation import demo
from strapdown.simulation.demo import SensorErrors
from strapdown.units import DEG

LAT, _, HEIGHT = demo.PLACE


def around(t: float, h: float):
    """Truth a step before, at and after a time, in one call."""
    return demo._truth(np.array([t - h, t, t + h]), 60.0)


@pytest.fixture(scope="module")
def silent():
    """Sensors without errors."""
    zero = (0.0, 0.0, 0.0)
    return SensorErrors(
        gyr_bias=zero,
        acc_bias=zero,
        mag_bias=zero,
        gyr_density=0.0,
        acc_density=0.0,
        mag_sigma=0.0,
    )


# in rest, while the motion sets in, in the middle, while it dies away
TIMES = (1.0, 4.7, 5.9, 23.4, 41.25, 55.1, 59.0)


@pytest.mark.parametrize("t", TIMES)
def test_angular_rate_is_that_of_the_attitude_plus_the_earths(t):
    h = 1e-4
    a, at, b = (Rotation.from_quat(q, scalar_first=True) for q in around(t, h).q_nb)
    turning = (a.inv() * b).as_rotvec() / (2.0 * h)
    earth = at.inv().apply(OMEGA_IE * np.array([np.cos(LAT), 0.0, -np.sin(LAT)]))
    # central difference: h^2/6 times the third derivative (under 40 rad/s^3) is 7e-8;
    # the transport rate of 0.5 m/s is 8e-8
    assert around(t, h).omega_ib_b[1] == pytest.approx(turning + earth, abs=2e-7)


@pytest.mark.parametrize("t", TIMES)
def test_specific_force_is_acceleration_less_gravity_seen_from_the_box(t):
    h = 1e-4
    truth = around(t, h)
    acceleration = (truth.v_n[2] - truth.v_n[0]) / (2.0 * h)
    coriolis = 2.0 * np.cross(OMEGA_IE * np.array([np.cos(LAT), 0.0, -np.sin(LAT)]), truth.v_n[1])
    # normal gravity at 48.14 deg, 520 m: 9.8089 on the ellipsoid less 3.086e-6 per metre
    gravity = np.array(
        [0.0, 0.0, 9.780318 * (1 + 5.3024e-3 * np.sin(LAT) ** 2) - 3.086e-6 * HEIGHT]
    )
    f_n = Rotation.from_quat(truth.q_nb[1], scalar_first=True).apply(truth.f_b[1])
    # the textbook formula for gravity is good to 1e-4 m/s^2
    assert f_n == pytest.approx(acceleration + coriolis - gravity, abs=2e-4)


@pytest.mark.parametrize("t", TIMES)
def test_velocity_is_that_of_the_position(t):
    h = 1e-3
    truth = around(t, h)
    north = (truth.lla[2, 0] - truth.lla[0, 0]) / (2 * h) * 6.3718e6  # R_N + h at 48.14 deg
    up = (truth.lla[2, 2] - truth.lla[0, 2]) / (2 * h)
    # the radius above is good to 1e-4, the speed under 1 m/s; round-off of a height of 520 m
    assert truth.v_n[1, 0] == pytest.approx(north, abs=2e-4)
    assert truth.v_n[1, 2] == pytest.approx(-up, abs=2e-4)


def test_box_is_at_rest_at_both_ends_and_moves_in_between():
    truth = demo.truth()
    turning = np.linalg.norm(truth.omega_ib_b, axis=1)
    ends = (truth.t < demo.REST) | (truth.t > 60.0 - demo.REST)
    assert turning[ends].max() < 1.01 * OMEGA_IE
    assert turning[~ends].max() > 100 * DEG
    assert np.array_equal(truth.v_n[ends], np.zeros_like(truth.v_n[ends]))


def test_gyro_sample_covers_the_interval_that_ends_at_it(silent):
    recording, truth = demo.recording(errors=silent), demo.truth()
    q = Rotation.from_quat(truth.q_nb, scalar_first=True)
    step = (q[:-1].inv() * q[1:]).as_rotvec() * 100.0
    middle = 0.5 * (truth.omega_ib_b[:-1] + truth.omega_ib_b[1:])
    # coning within 10 ms (omega 3 rad/s, change 0.2 rad/s) and the Earth's rate: below 4e-4;
    # a rate that covered the next interval would be off by 0.2 rad/s
    assert np.abs(recording.imu.gyr[1:] - step).max() < 4e-4
    assert np.abs(recording.imu.gyr[1:] - middle).max() < 1e-3


def test_magnetometer_sees_the_field_of_the_world_magnetic_model(silent):
    recording = demo.recording(errors=silent)
    q_nb = Rotation.from_quat(recording.reference.attitude.q_nb, scalar_first=True)
    m_n = q_nb.apply(recording.mag.mag)
    # Munich: 48.8 uT, dip 64.4 deg, declination 4.3 deg east in 2026 (maps, to some tenths)
    assert np.linalg.norm(m_n, axis=1) == pytest.approx(48.8e-6, abs=0.3e-6)
    assert np.arctan2(m_n[:, 1], m_n[:, 0]) / DEG == pytest.approx(4.3, abs=0.4)


def test_same_seed_same_recording_and_noise_of_the_stated_size():
    a, b, c = demo.recording(seed=3), demo.recording(seed=3), demo.recording(seed=4)
    assert np.array_equal(a.imu.gyr, b.imu.gyr)
    assert not np.array_equal(a.imu.gyr, c.imu.gyr)
    rest = a.imu.t < demo.REST
    chip = SensorErrors()
    std = a.imu.gyr[rest].std(axis=0, ddof=1)
    # 400 samples: the standard deviation is good to 3.5 %, four sigma
    assert std == pytest.approx(np.full(3, chip.gyr_density * 10.0), rel=0.15)


def test_streams_and_metadata_are_complete():
    recording = demo.recording()
    assert {name for name, _ in recording.streams()} == {"imu", "mag"}
    assert recording.reference.heading == "true"
    assert recording.meta["epoch_utc"] == demo.EPOCH_UTC


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"duration": 3.0}, r"`duration` must be at least 12 s, got 3\."),
        ({"duration": float("nan")}, "`duration` must be positive and finite, got nan"),
        ({"rate": 0}, "`rate` must be positive and finite, got 0"),
    ],
)
def test_impossible_demos_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        demo.truth(**arguments)
