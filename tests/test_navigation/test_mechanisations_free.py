"""Mechanisations against a free integration of Newton's law; their inputs and refusals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from truth.flight import OMEGA, axes, ecef, geodetic, gravity_e

from strapdown.errors import ComputationError, DataGap, InputError, MissingStream
from strapdown.navigation import Mechanisation, SphericalEarth, Start, mechanise
from strapdown.navigation.mechanisation import means_from_points
from strapdown.recording import Imu, Mag, Recording
from strapdown.rotation import dcm_from_quat, quat_from_dcm, quat_from_rpy

FRAMES = ("ned", "ecef", "inertial", "wander")
SECONDS = 60.0


def rate(t):
    return np.stack((0.5 * np.sin(t), 0.3 * np.cos(0.7 * t), 0.4 * np.sin(0.5 * t + 1)), axis=-1)


def force(t):
    return np.stack((2 * np.sin(0.9 * t), np.cos(t), -9.6 + np.sin(1.3 * t)), axis=-1)


def cross(v):
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def central(r, radius=6.4e6, g0=9.7):
    distance = np.linalg.norm(r)
    return -g0 * (radius / distance) ** 2 * r / distance


def integrate(gravity, r0, v0, C0):
    """Position, velocity and attitude in inertial axes that were those of the Earth at zero."""
    spin = np.array((0.0, 0.0, OMEGA))

    def slope(t, y):
        r, v, C = y[:3], y[3:6], y[6:].reshape(3, 3)
        attraction = gravity(r) + np.cross(spin, np.cross(spin, r))
        return np.concatenate((v, C @ force(t) + attraction, (C @ cross(rate(t))).ravel()))

    y0 = np.concatenate((r0, v0 + np.cross(spin, r0), C0.ravel()))
    y = solve_ivp(slope, (0.0, SECONDS), y0, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    a = OMEGA * SECONDS
    C_ei = np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]])
    r = C_ei @ y[:3]
    return r, C_ei @ y[3:6] - np.cross(spin, r), C_ei @ y[6:].reshape(3, 3)


def samples(step):
    """Exact means: five-point quadrature over each interval."""
    t = np.arange(round(SECONDS / step) + 1) * step
    x, w = np.polynomial.legendre.leggauss(5)
    at = t[:-1, None] + 0.5 * step * (1 + x)
    gyr, acc = (np.einsum("j,kji->ki", 0.5 * w, f(at)) for f in (rate, force))
    return t, np.concatenate((rate(t[:1]), gyr)), np.concatenate((force(t[:1]), acc))


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("lat", [-0.9, 0.3, 1.3])
def test_on_the_ellipsoid(frame, lat):
    lla, v_n, q_nb = (lat, 2.0, 800.0), (60.0, -30.0, 2.0), quat_from_rpy([0.3, -0.2, 2.0])
    C_ne = axes(np.float64(lat), np.float64(2.0))
    r, v, C = integrate(gravity_e, ecef(*lla), C_ne.T @ v_n, C_ne.T @ dcm_from_quat(q_nb))
    start = Start(lla=lla, v_n=v_n, q_nb=q_nb)
    sol = mechanise(samples(0.005), start, frame=frame, samples=2)
    assert np.linalg.norm(ecef(*sol.lla[-1]) - r) < 1e-4
    lat2, lon2, _ = geodetic(r)
    C_ne = axes(lat2, lon2)
    assert sol.v_n[-1] == pytest.approx(C_ne @ v, abs=1e-5)
    assert np.abs(dcm_from_quat(sol.q_nb[-1]) - C_ne @ C).max() < 1e-9


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("attitude", ["quaternion", "dcm"])
def test_on_a_sphere(frame, attitude):
    earth = SphericalEarth(radius=6.4e6, gravity=9.7)
    lat, lon, h = -0.7, -2.0, 800.0
    up = np.array((np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)))
    v_n, q_nb = (60.0, -30.0, 2.0), quat_from_rpy([0.3, -0.2, 2.0])
    C_ne = axes(np.float64(lat), np.float64(lon))
    r, v, C = integrate(central, (6.4e6 + h) * up, C_ne.T @ v_n, C_ne.T @ dcm_from_quat(q_nb))
    start = Start(lla=(lat, lon, h), v_n=v_n, q_nb=q_nb)
    sol = mechanise(samples(0.005), start, frame=frame, samples=2, earth=earth, attitude=attitude)
    want = np.arctan2(r[2], np.hypot(r[0], r[1])), np.arctan2(r[1], r[0])
    assert sol.lla[-1, :2] == pytest.approx(want, abs=2e-11)  # 0.1 mm
    assert sol.lla[-1, 2] == pytest.approx(np.linalg.norm(r) - 6.4e6, abs=1e-4)
    C_ne = axes(*(np.float64(x) for x in want))
    assert sol.v_n[-1] == pytest.approx(C_ne @ v, abs=1e-5)
    assert np.abs(dcm_from_quat(sol.q_nb[-1]) - C_ne @ C).max() < 1e-9


def test_the_spherical_earth_by_name_has_the_equators_radius_and_standard_gravity():
    t, gyr, acc = samples(0.01)
    start = Start(lla=(0.5, 0.1, 10.0), q_nb=(1, 0, 0, 0))
    ends = [
        mechanise((t, gyr, acc), start, earth=earth).lla[-1]
        for earth in ("spherical", SphericalEarth(), SphericalEarth(radius=6378137.0))
    ]
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])


@pytest.mark.parametrize("gravity", ["gradient", 9.81, "spherical"])
def test_gravity_options_agree_between_frames(gravity):
    start = Start(lla=(0.5, 0.1, 3000.0), q_nb=(1, 0, 0, 0))
    ends = [
        ecef(*mechanise(samples(0.01), start, frame=frame, gravity=gravity).lla[-1])
        for frame in FRAMES
    ]
    assert np.linalg.norm(np.ptp(np.array(ends), axis=0)) < 1e-3
    normal = mechanise(samples(0.01), start).lla[-1]
    assert np.linalg.norm(ends[0] - ecef(*normal)) > 0.01  # and they do differ


def test_means_of_points_are_of_fourth_order():
    errors = []
    for step in (0.2, 0.1):
        t, gyr, _ = samples(step)
        errors.append(np.abs(means_from_points(t, rate(t)) - gyr)[5:-5].max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.5)
    with pytest.raises(ValueError, match="at least two"):
        means_from_points([0.0], [[1.0]])


# --- inputs -------------------------------------------------------------------------------------

START = Start(lla=(0.5, 0.1, 10.0), q_nb=(1, 0, 0, 0))


def test_recording_stream_and_arrays_are_the_same():
    t, gyr, acc = samples(0.05)
    imu = Imu(t=t, gyr=gyr, acc=acc)
    ends = [mechanise(rec, START).lla[-1] for rec in ((t, gyr, acc), imu, Recording(imu=imu))]
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])


def test_one_sample_gives_the_start():
    t, gyr, acc = (part[:1] for part in samples(0.05))
    sol = mechanise((t, gyr, acc), START)
    assert len(sol) == 1
    assert sol.lla[0] == pytest.approx(START.lla)


def test_input_is_left_as_it_was():
    t, gyr, acc = samples(0.05)
    copies = t.copy(), gyr.copy(), acc.copy()
    mechanise((t, gyr, acc), START, samples=3)
    for part, copy in zip((t, gyr, acc), copies, strict=True):
        assert np.array_equal(part, copy)


@pytest.mark.parametrize("samples_per_step", [1, 2])
def test_samples_with_nan_are_left_out_and_flagged(samples_per_step):
    t, gyr, acc = samples(0.05)
    rough_gyr, rough_acc = gyr.copy(), acc.copy()
    rough_acc[[0, 700]], rough_gyr[[300, 301, 1200], 1] = np.nan, np.nan
    keep = ~np.isin(np.arange(len(t)), [0, 300, 301, 700, 1200])
    sol = mechanise((t, rough_gyr, rough_acc), START, samples=samples_per_step)
    same = mechanise((t[keep], gyr[keep], acc[keep]), START, samples=samples_per_step)
    for name in ("t", "lla", "v_n", "q_nb"):
        assert np.array_equal(getattr(sol, name), getattr(same, name))
    assert not same.status.any()
    # the last sample is NaN: only a step that still waits for its second one can say so
    assert sol.status_counts() == {"GYR_INVALID": samples_per_step, "ACC_INVALID": 1}
    flagged = sol.t[sol.status > 0][:2]
    assert flagged == pytest.approx([15.1, 35.05], abs=0.051 * (samples_per_step - 1) + 1e-9)


def test_flags_wait_for_the_next_piece():
    t, gyr, acc = samples(0.05)
    acc = acc.copy()
    acc[99:101] = np.nan
    ins = Mechanisation(samples=2)
    first = ins.init(replace(START, t=0.0))
    whole, _ = ins.advance(first, (t[1:], gyr[1:], acc[1:]))
    one, state = ins.advance(first, (t[1:100], gyr[1:100], acc[1:100]))
    two, _ = ins.advance(state, (t[100:], gyr[100:], acc[100:]))
    assert np.array_equal(np.concatenate((one.status, two.status)), whole.status)
    assert whole.status_counts() == {"ACC_INVALID": 1}
    with pytest.raises(ValueError, match=r"must begin after the state, got 0\.05 after 4\.9"):
        ins.advance(state, (t[1:], gyr[1:], acc[1:]))


def test_a_gap_is_refused_with_place_and_way_out():
    t, gyr, acc = samples(0.05)
    keep = (t < 20.0) | (t > 23.0)
    with pytest.raises(DataGap, match=r"no valid samples for 3.1 s before 23.05 s, longer than"):
        mechanise((t[keep], gyr[keep], acc[keep]), START)
    mechanise((t[keep], gyr[keep], acc[keep]), START, max_gap=5.0)
    acc = np.where(keep[:, None], acc, np.nan)
    with pytest.raises(DataGap, match=r"no valid samples for 3.1 s"):
        mechanise((t, gyr, acc), START)


def test_what_holds_no_samples_is_refused():
    with pytest.raises(TypeError, match=r"must be a Recording, an Imu or a tuple.*got list"):
        mechanise([1, 2, 3], START)
    with pytest.raises(MissingStream, match="imu"):
        mechanise(Recording(mag=Mag(t=[0.0], mag=[[1e-5, 0, 0]])), START)
    with pytest.raises(InputError, match="must hold valid inertial samples"):
        mechanise(([], np.empty((0, 3)), np.empty((0, 3))), START)
    with pytest.raises(ValueError, match="equal length, got 1 and 2 and 2"):
        mechanise(([0.0], np.zeros((2, 3)), np.zeros((2, 3))), START)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"lla": (45.0, 7.0, 0.0)}, "multiply it by DEG"),
        ({"lla": (0.5, 0.1)}, r"`lla` must have shape \(3,\)"),
        ({"q_nb": (1.0, 1.0, 0.0, 0.0)}, "`q_nb` must have unit norm"),
        ({"v_n": (np.nan, 0.0, 0.0)}, "`v_n` must be finite"),
        ({"t": np.inf}, "`t` must be finite"),
    ],
)
def test_a_start_that_cannot_be_is_refused(bad, message):
    with pytest.raises(ValueError, match=message):
        replace(START, **bad)


def test_a_start_outside_the_samples_is_refused():
    with pytest.raises(ValueError, match="must lie within the samples, 0 to 60 s, got 61"):
        mechanise(samples(0.05), replace(START, t=61.0))
    with pytest.raises(ValueError, match="must have a time"):
        Mechanisation().init(START)
    state = Mechanisation().init(replace(START, t=0.0))
    assert state.t == 0.0


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"frame": "NED"}, "`frame` must be one of .*, got 'NED'; the nearest name is 'ned'"),
        ({"attitude": "quat"}, "`attitude` must be one of quaternion, dcm, euler"),
        ({"earth": "flat"}, "`earth` must be one of wgs84, spherical"),
        ({"gravity": "egm96"}, "`gravity` must be one of somigliana, gradient, spherical"),
        ({"gravity": -9.8}, "`gravity` must be non-negative"),
        ({"samples": 5}, "`samples` must be at least 1 and at most 4, got 5"),
        ({"height": "fixed"}, "`height` must be one of free, held"),
        ({"sampling": "point"}, "`sampling` must be one of mean, points"),
        ({"max_gap": 0.0}, "`max_gap` must be positive"),
        ({"heading_reference": "north"}, "`heading_reference` must be one of"),
    ],
)
def test_options_are_checked(bad, message):
    with pytest.raises(ValueError, match=message):
        Mechanisation(**bad)


def test_options_of_the_wrong_type_are_refused():
    with pytest.raises(TypeError, match="`compensate` must be True or False, got 1"):
        Mechanisation(compensate=1)
    with pytest.raises(
        TypeError, match="`earth` must be 'wgs84', 'spherical' or a SphericalEarth"
    ):
        Mechanisation(earth=6371e3)
    with pytest.raises(ValueError, match="`radius` must be positive"):
        SphericalEarth(radius=0.0)


def test_points_do_not_go_piece_by_piece():
    ins = Mechanisation(sampling="points")
    with pytest.raises(ValueError, match="over the whole recording; use `run`"):
        ins.advance(ins.init(replace(START, t=0.0)), samples(0.05))


def test_angles_refuse_gimbal_lock_with_the_way_out():
    t = np.arange(0.0, 10.0, 0.01)
    gyr, acc = np.zeros((2, len(t), 3))
    gyr[:, 1], acc[:, 2] = 0.2, -9.8
    with pytest.raises(
        ComputationError, match=r"gimbal lock .* down\) at 7\.8.* s; use attitude='q"
    ):
        mechanise((t, gyr, acc), START, attitude="euler")
    steep = quat_from_rpy([0.0, np.pi / 2, 0.0])
    with pytest.raises(ValueError, match="must not be gimbal lock"):
        mechanise((t, gyr, acc), replace(START, q_nb=steep), attitude="euler")
    # in ECEF it is the Earth's axis: level and to the north on the equator
    north = Start(lla=(0.0, 0.3, 0.0), q_nb=(1, 0, 0, 0))
    with pytest.raises(ValueError, match="the Earth's axis"):
        mechanise((t, gyr, acc), north, attitude="euler", frame="ecef")
    mechanise((t, gyr, acc), replace(START, q_nb=steep), attitude="dcm")


def test_start_of_a_solution_without_position_is_refused():
    from strapdown.solution import Solution

    sol = Solution(t=np.zeros(1), q_nb=np.eye(4)[:1], status=np.zeros(1, int), filter="x")
    with pytest.raises(ValueError, match="attitude only"):
        Start.of(sol)


def test_every_form_starts_with_the_attitude_that_is_given():
    q_nb = quat_from_rpy([0.3, -0.4, 2.5])
    t, gyr, acc = (part[:1] for part in samples(0.05))
    for frame in FRAMES:
        for attitude in ("quaternion", "dcm", "euler"):
            sol = mechanise(
                (t, gyr, acc), replace(START, q_nb=q_nb), frame=frame, attitude=attitude
            )
            assert np.abs(dcm_from_quat(sol.q_nb[0]) - dcm_from_quat(q_nb)).max() < 1e-14
            assert quat_from_dcm(dcm_from_quat(sol.q_nb[0])) == pytest.approx(
                quat_from_dcm(dcm_from_quat(q_nb)), abs=1e-14
            )


@pytest.mark.parametrize("attitude", ["quaternion", "dcm"])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_order_of_turns_matters(attitude, sign):
    """Pitch 90, yaw 90, pitch back 90 deg: a roll of 90 deg; the other way round, of -90 deg."""
    step, seconds = 0.01, 1.0
    t = np.arange(301) * step
    gyr, acc = np.zeros((2, len(t), 3))
    third = round(seconds / step)
    gyr[1 : third + 1, 1] = sign * np.pi / 2
    gyr[third + 1 : 2 * third + 1, 2] = np.pi / 2
    gyr[2 * third + 1 :, 1] = -sign * np.pi / 2
    earth = SphericalEarth(rate=0.0)
    sol = mechanise(
        (t, gyr, acc), START, attitude=attitude, earth=earth, gravity=0.0, compensate=False
    )
    rolled = dcm_from_quat(quat_from_rpy([sign * np.pi / 2, 0.0, 0.0]))
    assert np.abs(dcm_from_quat(sol.q_nb[-1]) - rolled).max() < 1e-12
    with pytest.raises(ComputationError, match="gimbal lock"):
        mechanise((t, gyr, acc), START, attitude="euler", earth=earth, gravity=0.0)
