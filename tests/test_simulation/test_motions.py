"""Motions against closed forms that were derived by hand, and against pyproj and SciPy."""

import numpy as np
import pyproj
import pytest
from scipy.spatial.transform import Rotation
from truth import ellipsoid

from strapdown.constants import OMEGA_IE
from strapdown.simulation import truth
from strapdown.simulation.motions import (
    BangBang,
    Coning,
    HandMoved,
    Poses,
    Sculling,
    Servo,
    Static,
    Turntable,
    Waypoints,
)
from strapdown.simulation.vehicles import Drive, Flight
from strapdown.units import DEG, RPM

PLACE = (-33.0 * DEG, 151.0 * DEG, 80.0)
MOTIONS = [
    Static(rpy=(0.3, -0.2, 2.0)),
    Poses(rpy=((0, 0, 0), (1.0, 0.5, 2.0), (-1.0, -0.5, 4.0)), hold=1.0, turn=1.5),
    Turntable(rest=0.5, radius=0.2, tilt=(0.4, 0.3, 0.2)),
    Servo(rest=0.5, axis="pitch"),
    HandMoved(north=((0.3, 2.1, 0.2),), east=((0.2, 1.3, 1.0),), rest=0.0, moving=20.0),
    Waypoints(points=((0, 0, 0), (3, 1, -1), (5, 5, 0), (0, 0, 0)),
              rpy=((0, 0, 0), (1, 0.2, 0), (0, 0.5, 3), (0, 0, 6))),
    BangBang(start=1.0),
    Coning(frequency=1.0, angle=0.2),
    Sculling(frequency=1.0, angle=0.2, amplitude=0.1),
    Drive(rest=0.5),
    Flight(rest=0.5),
]  # fmt: skip


def at(motion, t, place=PLACE, **options):
    return truth(motion, np.atleast_1d(t), place, m_n=(2e-5, 1e-6, -4e-5), **options)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda m: type(m).__name__)
def test_velocity_is_the_derivative_of_the_position(motion):
    h, t = 1e-3, 3.21
    around = at(motion, t + h * np.array([-2, -1, 0, 1, 2]))
    to_ecef = pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)
    lat, lon, height = around.lla.T
    x, y, z = to_ecef.transform(lon / DEG, lat / DEG, height)
    r = np.stack((x, y, z), axis=1)
    v_e = (r[0] - 8 * r[1] + 8 * r[3] - r[4]) / (12 * h)
    sp, cp, sl, cl = np.sin(lat[2]), np.cos(lat[2]), np.sin(lon[2]), np.cos(lon[2])
    C_ne = np.array([[-sp * cl, -sp * sl, cp], [-sl, cl, 0], [-cp * cl, -cp * sl, -sp]])
    # round-off of 6.4e6 m over 12 ms: 1e-9 / 1e-3
    assert C_ne @ v_e == pytest.approx(around.v_n[2], abs=3e-6)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda m: type(m).__name__)
def test_rate_is_that_of_the_attitude_beside_the_turning_earth(motion):
    h, t = 1e-4, 3.21
    around = at(motion, t + h * np.array([-1, 0, 1]))
    q = Rotation.from_quat(around.q_nb, scalar_first=True)
    omega_nb_b = (q[1].inv() * q[2]).as_rotvec() - (q[1].inv() * q[0]).as_rotvec()
    lat, _, height = around.lla[1]
    earth_n = OMEGA_IE * np.array([np.cos(lat), 0.0, -np.sin(lat)])
    north, east, _ = around.v_n[1]
    radius = 6.371e6 + height  # of a sphere: good to 0.4 %, of 2e-6 rad/s
    transport_n = np.array([east, -north, -east * np.tan(lat)]) / radius
    expected = omega_nb_b / (2 * h) + q[1].inv().apply(earth_n + transport_n)
    # third derivative of the attitude (up to 3500 rad/s^3 of a servo) times h^2 / 6
    assert around.omega_ib_b[1] == pytest.approx(expected, abs=7e-6)


@pytest.mark.parametrize("lat", [-60.0, -30.0, 0.0, 30.0, 60.0, 89.9])
def test_box_at_rest_feels_normal_gravity_and_the_turning_earth(lat):
    rpy = (0.3, -0.7, 2.1)
    still = at(Static(rpy=rpy), [0.0, 100.0], (lat * DEG, 1.0, 1500.0))
    g = float(ellipsoid.gravity(lat * DEG, 1500.0))
    q = Rotation.from_euler("ZYX", rpy[::-1])
    # the series in height is good to 0.2 um/s^2 at 1.5 km
    assert q.apply(still.f_b) == pytest.approx(np.tile([0, 0, -g], (2, 1)), abs=3e-7)
    earth = OMEGA_IE * np.array([np.cos(lat * DEG), 0.0, -np.sin(lat * DEG)])
    assert q.apply(still.omega_ib_b)[1] == pytest.approx(earth, abs=1e-19)
    assert np.array_equal(still.v_n, np.zeros((2, 3)))


@pytest.mark.parametrize(("rpm", "dps"), [(100.0 / 3.0, 200.0), (45.0, 270.0)])
def test_record_player_turns_at_200_or_270_dps_and_pulls_inwards(rpm, dps):
    motion = Turntable(rate=rpm * RPM, radius=0.1, rest=2.0, spin=2.0, turning=10.0)
    turning = at(motion, [0.0, 8.0, 9.3, 20.0])
    rate = dps * DEG
    # the transport rate of 0.47 m/s over the curved Earth is 7e-8 rad/s
    assert turning.omega_ib_b[1:3, 2] == pytest.approx(
        np.full(2, rate - OMEGA_IE * np.sin(PLACE[0])), abs=7e-8
    )
    # x looks outwards, so the force that keeps it on the circle has -x; Coriolis' part of
    # 2 * 7.3e-5 * 0.5 m/s is below 1e-4
    assert turning.f_b[1:3, 0] == pytest.approx(np.full(2, -0.1 * rate**2), abs=1e-4)
    assert turning.v_n[[0, 3]] == pytest.approx(np.zeros((2, 3)), abs=1e-15)
    # two ramps count half: 12 s at full rate
    end = Rotation.from_quat(turning.q_nb[3], scalar_first=True).as_euler("ZYX")[0]
    expected = np.angle(np.exp(1j * rate * 12.0))
    assert end == pytest.approx(expected, abs=1e-9)


def test_bang_bang_profile_peaks_at_0_3878_rad_s_and_turns_by_55_5_deg():
    box = at(BangBang(), [49.9, 52.5, 55.0, 60.0, 1e4])
    rate = box.omega_ib_b[:, 2] + OMEGA_IE * np.sin(PLACE[0])
    assert rate == pytest.approx(
        [0.0, 0.3878, 0.0, 0.0, 0.0], abs=6e-5
    )  # 0.1551 * 2.5, rounded up
    yaw = Rotation.from_quat(box.q_nb, scalar_first=True).as_euler("ZYX")[:, 0] / DEG
    assert yaw == pytest.approx([0.0, 55.5 / 2, 55.5, 55.5, 55.5], abs=0.1)


def test_servo_swings_ten_times_in_twelve_seconds():
    motion = Servo(rest=0.0)
    t = np.arange(0.0, 14.0, 0.01)
    yaw = Rotation.from_quat(at(motion, t).q_nb, scalar_first=True).as_euler("ZYX")[:, 0] / DEG
    up = np.count_nonzero((yaw[1:] > 45) & (yaw[:-1] <= 45))
    assert up == 10
    assert yaw[(t > 5.0) & (t < 6.0)] == pytest.approx(0.0, abs=1e-12)  # the pause
    assert yaw[t > 11.0] == pytest.approx(0.0, abs=1e-12)
    assert yaw.max() == pytest.approx(90.0, abs=1e-12)


def test_coning_has_the_constant_rate_of_theory():
    angle, w = 0.3, 2 * np.pi * 2.0
    box = at(Coning(angle=angle, frequency=2.0), np.linspace(0, 1, 7))
    earth = 8e-5
    assert box.omega_ib_b[:, 2] == pytest.approx(
        np.full(7, -2 * w * np.sin(angle / 2) ** 2), abs=earth
    )
    across = np.hypot(box.omega_ib_b[:, 0], box.omega_ib_b[:, 1])
    assert across == pytest.approx(np.full(7, w * np.sin(angle)), abs=earth)


def test_sculling_rectifies_to_a_constant_force():
    w, angle, amplitude = 2 * np.pi * 5.0, 0.01, 0.002
    t = np.arange(2000) / 2000 * 0.2  # one period, so the mean is exact
    box = at(Sculling(angle=angle, amplitude=amplitude, frequency=5.0), t)
    still = at(Static(), 0.0)
    gravity = still.f_b[0, 2] * (1 - angle**2 / 4)  # mean of cos(pitch)
    expected = -amplitude * w**2 * angle / 2
    # next order: angle^3; Coriolis has no mean
    assert box.f_b[:, 2].mean() - gravity == pytest.approx(expected, rel=2e-4)


def test_flight_banks_so_that_nothing_pulls_sideways():
    motion = Flight(rest=2.0, speed=15.0)
    flight = at(motion, np.arange(0.0, motion.arrival, 0.1))
    roll = Rotation.from_quat(flight.q_nb, scalar_first=True).as_euler("ZYX")[:, 2]
    assert np.abs(roll).max() > 10 * DEG
    # Coriolis at 15 m/s: 2 * 7.3e-5 * 15 = 2e-3 m/s^2; standard gravity is 0.01 m/s^2 too much
    assert np.abs(flight.f_b[:, 1]).max() < 7e-3
    # level turn: tan(roll) = v * turn rate / g
    speed = np.linalg.norm(flight.v_n, axis=1)
    k = int(np.argmax(np.abs(roll)))
    course = np.unwrap(np.arctan2(flight.v_n[k - 1 : k + 2, 1], flight.v_n[k - 1 : k + 2, 0]))
    turn = (course[2] - course[0]) / 0.2
    assert np.tan(roll[k]) == pytest.approx(speed[k] * turn / 9.797, rel=0.02)


@pytest.mark.parametrize("kind", [Drive, Flight])
def test_vehicle_moves_along_its_own_x_axis(kind):
    motion = kind(rest=2.0, points=tuple((100 * n, e, d) for n, e, d in Drive().points))
    way = at(motion, np.arange(0.0, motion.arrival + 5.0, 0.5))
    v_b = Rotation.from_quat(way.q_nb, scalar_first=True).inv().apply(way.v_n)
    # 20 km north of the place too: the path's axes are scaled as the ground is
    assert np.abs(v_b[:, 1:]).max() < 1e-12
    assert v_b[:, 0].max() > 8.0
    assert v_b[-1] == pytest.approx(np.zeros(3), abs=1e-12)


def test_drive_stops_where_it_should():
    motion = Drive(stops=(3, 5), rest=4.0)
    t = np.arange(0.0, motion.arrival + 2.0, 0.05)
    speed = np.linalg.norm(at(motion, t).v_n, axis=1)
    still = speed < 1e-9
    stops = np.count_nonzero(still[1:] & ~still[:-1])
    assert stops == 3
    assert (
        np.abs(np.diff(speed)).max() / 0.05 < 1.3 * motion.acceleration
    )  # bends take their share


def test_mount_turns_the_box_in_the_vehicle():
    rpy = (3.0 * DEG, -5.0 * DEG, 60.0 * DEG)
    mount = Rotation.from_euler("ZYX", rpy[::-1])
    q_vb = mount.as_quat(scalar_first=True)
    motion = Drive(rest=1.0)
    vehicle, box = at(motion, [0.0, 9.0, 14.0]), at(motion, [0.0, 9.0, 14.0], q_vb=q_vb)
    assert mount.apply(box.f_b) == pytest.approx(vehicle.f_b, abs=1e-13)
    assert mount.apply(box.omega_ib_b) == pytest.approx(vehicle.omega_ib_b, abs=1e-15)


def test_every_motion_works_with_its_defaults():
    for motion in MOTIONS:
        still = at(type(motion)(), np.arange(0.0, 2.0, 0.5))
        assert np.isfinite(still.f_b).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Drive(points=((0, 0, 0), (1, 0, 0))), "`points` must hold at least eight points"),
        (lambda: Drive(points=((0, 0, 0),) * 8), "`points` must differ"),
        (lambda: Drive(stops=(3, 2)), "`stops` must increase"),
        (lambda: Drive(stops=(7,)), "`stops` must be at least 1 and at most 6"),
        (lambda: Servo(axis="rol"), "the nearest name is 'roll'"),
        (lambda: Servo(move=0.7), r"`move` must lie in \[0.001, 0.5\]"),
        (lambda: HandMoved(moving=1.0), "`moving` must be at least two ramps of 2 s, got 1"),
        (lambda: HandMoved(roll=((1.0, 0.0, 0.0),)), "`period in roll` must be positive"),
        (lambda: Waypoints(times=(0.0, 1.0)), "`points` must have one row per time, got 4 and 2"),
        (lambda: Waypoints(times=(0.0, 1.0), points=((0, 0, 0),) * 2), "at least four times"),
        (lambda: Turntable(spin=0.0), "`spin` must be positive"),
        (lambda: at(Static(), 0.0, (np.pi / 2, 0.0, 0.0)), "`place` must not be a pole"),
    ],
)  # fmt: skip
def test_bad_motions_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()
