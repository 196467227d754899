"""Alignment functions: attitude, covariance and refusals, at rest and in motion."""

import drive
import numpy as np
import pytest

import strapdown as sd
from strapdown.errors import DataGap, InputError, MissingStream, NotConverged
from strapdown.navigation import alignment, mechanise
from strapdown.recording import Gnss, Imu, Mag, Recording
from strapdown.rotation import (
    dcm_from_quat,
    interpolate,
    quat_from_dcm,
    quat_from_rpy,
    rpy_from_quat,
)
from strapdown.units import DEG, DEG_PER_HR, UT

OMEGA = 7.292115e-5
LAT = -0.7
GRAVITY = drive.gravity(LAT, 0.0)
RPY = np.array([0.3, -0.4, 2.5])
FIELD_N = np.array([20.0, 3.0, -45.0]) * UT


def still(
    rpy=RPY, lat=LAT, seconds=60.0, *, gyr_bias=(0, 0, 0), acc_bias=(0, 0, 0), mag_bias=(0, 0, 0),
    gyr_noise=1e-6, acc_noise=1e-3, seed=0,
):  # fmt: skip
    """A box at rest, 100 Hz."""
    rng = np.random.default_rng(seed)
    C = dcm_from_quat(quat_from_rpy(rpy))
    t = np.arange(round(seconds * 100)) / 100.0
    earth = OMEGA * np.array([np.cos(lat), 0.0, -np.sin(lat)])
    force = np.array([0.0, 0.0, -drive.gravity(lat, 0.0)])
    gyr = earth @ C + gyr_bias + gyr_noise * rng.standard_normal((len(t), 3))
    acc = force @ C + acc_bias + acc_noise * rng.standard_normal((len(t), 3))
    field = FIELD_N @ C + mag_bias + 1e-8 * rng.standard_normal((len(t) // 5, 3))
    return Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t[::5], mag=field))


def error_n(q_nb, rpy=RPY):
    return drive.attitude_error(np.asarray(q_nb), dcm_from_quat(quat_from_rpy(rpy)))


NAVIGATION_GRADE = {"gyr_bias_std": 0.01 * DEG_PER_HR, "acc_bias_std": 1e-4}
AT_REST = {
    "level": lambda rec, **more: alignment.level(rec, heading=RPY[2], **more),
    "magnetic": lambda rec, **more: alignment.magnetic(
        rec, declination=np.arctan2(3.0, 20.0), **more
    ),
    "gyrocompass": lambda rec, **more: alignment.gyrocompass(
        rec, LAT, **{**NAVIGATION_GRADE, **more}
    ),
    "analytic": lambda rec, **more: alignment.analytic(rec, LAT, **{**NAVIGATION_GRADE, **more}),
}


@pytest.mark.parametrize("method", AT_REST)
@pytest.mark.parametrize("rpy", [(0.3, -0.4, 2.5), (3.0, 0.1, -3.1), (-1.5, 1.4, 0.0)])
def test_perfect_sensors_give_the_attitude(method, rpy):
    rec = still(rpy, gyr_noise=1e-9, acc_noise=1e-6)
    found = {
        **AT_REST,
        "level": lambda rec: alignment.level(rec, heading=rpy[2]),
    }[method](rec)
    # noise of the rate over the Earth's, 1e-9 / sqrt(6000) / 5.6e-5; that of the field likewise
    assert np.abs(error_n(found.q_nb, rpy)).max() < 2e-6 + (6e-5 if method == "magnetic" else 0)
    assert found.method == method
    assert found.span == (0.0, 59.99)
    assert found.t == 59.99
    assert found.heading_reference == "true"


def test_gyrocompass_and_triad_are_the_same():
    rec = still(gyr_bias=(1e-8, -2e-8, 3e-8), acc_bias=(1e-3, 2e-3, -1e-3))
    one, two = (AT_REST[name](rec) for name in ("gyrocompass", "analytic"))
    assert np.abs(dcm_from_quat(one.q_nb) - dcm_from_quat(two.q_nb)).max() < 1e-12
    assert np.array_equal(one.covariance_n, two.covariance_n)


def test_heading_without_any_source_is_unknown_and_says_so():
    found = alignment.level(still())
    assert found.heading_reference == "arbitrary"
    assert found.std_n[2] / DEG == pytest.approx(103.9, abs=0.1)  # uniform over the circle
    assert found.rpy[2] == pytest.approx(0.0)
    assert found.rpy[:2] == pytest.approx(RPY[:2], abs=1e-4)


def test_magnetic_heading_without_declination_is_magnetic():
    found = alignment.magnetic(still())
    assert found.heading_reference == "magnetic"
    assert found.rpy[2] == pytest.approx(RPY[2] - np.arctan2(3.0, 20.0), abs=1e-4)


@pytest.mark.parametrize("method", AT_REST)
def test_covariance_is_that_of_repeated_alignments(method):
    """Biases drawn anew each time: the errors' covariance is the one that is stated."""
    rng = np.random.default_rng(7)
    acc_std, gyr_std, mag_std = 5e-3, 0.1 * DEG_PER_HR, 0.3 * UT
    errors, stated = [], None
    for _ in range(400):
        rec = still(
            seconds=2.0,
            gyr_noise=1e-8,
            acc_noise=1e-5,
            acc_bias=acc_std * rng.standard_normal(3),
            gyr_bias=gyr_std * rng.standard_normal(3),
            mag_bias=mag_std * rng.standard_normal(3),
        )
        more = {"acc_bias_std": acc_std}
        if method == "magnetic":
            more |= {"field_std": mag_std, "declination_std": 0.0}
        elif method != "level":
            more |= {"gyr_bias_std": gyr_std}
        found = AT_REST[method](rec, **more)
        errors.append(error_n(found.q_nb))
        stated = found.covariance_n
    errors = np.array(errors)
    if method == "level":
        errors, stated = errors[:, :2], stated[:2, :2]
    n, d = errors.shape
    # mean square in units of the stated covariance is chi-square over n: 5 sigma of it
    nees = np.einsum("ki,ij,kj->k", errors, np.linalg.inv(stated), errors).mean()
    assert nees == pytest.approx(d, abs=5 * np.sqrt(2 * d / n))
    sigma = np.sqrt(np.diag(stated))
    correlation = (errors.T @ errors / n) / np.outer(sigma, sigma)
    assert correlation == pytest.approx(stated / np.outer(sigma, sigma), abs=0.25)


def test_heading_sigma_is_gyro_bias_over_the_horizontal_earth_rate():
    for lat in (-1.0, 0.0, 0.8):
        want = 0.05 * DEG_PER_HR / (15.041067 * DEG_PER_HR * np.cos(lat))
        assert alignment.heading_std(0.05 * DEG_PER_HR, lat) == pytest.approx(want, rel=1e-6)
    assert alignment.heading_std(1.0, 0.0) == pytest.approx(np.pi / np.sqrt(3.0))
    found = alignment.gyrocompass(
        still(gyr_noise=1e-9), LAT, gyr_bias_std=0.05 * DEG_PER_HR, acc_bias_std=0.0
    )
    assert found.std_n[2] == pytest.approx(0.05 / 15.041 / np.cos(LAT), rel=1e-3)


def test_noise_counts_in_the_heading_sigma():
    quiet, loud = (
        alignment.gyrocompass(still(gyr_noise=noise), LAT, **NAVIGATION_GRADE).std_n[2]
        for noise in (1e-8, 2e-5)
    )
    assert loud == pytest.approx(2e-5 / np.sqrt(6000) / (OMEGA * np.cos(LAT)), rel=0.1)
    assert quiet < 0.3 * loud


@pytest.mark.parametrize("method", ["gyrocompass", "analytic"])
def test_a_cheap_gyroscope_is_refused_with_the_way_out(method):
    rec = still(gyr_noise=1e-3, gyr_bias=(2e-3, 0, 0))
    with pytest.raises(
        InputError, match=r"good to 1 deg/h for a heading sigma of 5 deg .* take `magnetic`"
    ):
        AT_REST[method](rec, gyr_bias_std=500 * DEG_PER_HR)
    found = AT_REST[method](rec, gyr_bias_std=500 * DEG_PER_HR, max_heading_std=np.inf)
    assert found.std_n[2] / DEG > 100.0


def test_a_bias_beyond_what_is_stated_is_seen():
    rec = still(gyr_bias=(0.3 * DEG, 0, 0))
    with pytest.raises(
        InputError, match=r"must be the Earth's, 15\.04 deg/h, .* got 10\d\d deg/h"
    ):
        alignment.gyrocompass(rec, LAT, **NAVIGATION_GRADE)


def test_gyro_bias_is_the_mean_rate_less_the_earths():
    bias = np.array([3e-8, -2e-8, 5e-8])
    found = alignment.gyrocompass(still(gyr_noise=1e-9, gyr_bias=bias), LAT, **NAVIGATION_GRADE)
    C = dcm_from_quat(found.q_nb)
    # along north and down it is found; along east it is in the heading
    assert (C @ found.gyr_bias)[[0, 2]] == pytest.approx((C @ bias)[[0, 2]], abs=1e-10)
    assert abs((C @ found.gyr_bias)[1]) < 1e-10
    assert alignment.level(still()).gyr_bias == pytest.approx(
        still().imu.gyr.mean(axis=0), abs=1e-12
    )


# --- rest and its refusals ----------------------------------------------------------------------


def with_motion(begin=40.0, end=45.0):
    rec = still()
    t = rec.imu.t
    inside = (t > begin) & (t < end)
    gyr = rec.imu.gyr + np.where(inside, np.sin(5 * t), 0.0)[:, None] * [0.5, 0.3, -0.2]
    return Recording(imu=Imu(t=t, gyr=gyr, acc=rec.imu.acc), mag=rec.mag)


@pytest.mark.parametrize("method", AT_REST)
def test_a_span_with_motion_is_refused_with_its_time(method):
    rec = with_motion()
    with pytest.raises(
        InputError,
        match=r"moves from 39\.\d* to 45\.\d* s; it rests from 0\.00 to 39\.\d* s: give that",
    ):
        AT_REST[method](rec)
    assert AT_REST[method](rec, span=(0.0, 39.0)).span == (0.0, 39.0)
    with pytest.raises(InputError, match="never rests there: align with `velocity_matching`"):
        AT_REST[method](rec, span=(41.0, 44.0))


@pytest.mark.parametrize("method", AT_REST)
def test_a_span_without_samples_is_refused(method):
    rec = still()
    with pytest.raises(DataGap, match="at least three valid samples from 100 to 200 s, got 0"):
        AT_REST[method](rec, span=(100.0, 200.0))
    with pytest.raises(ValueError, match="`span` must end after it starts, got 5 to 5 s"):
        AT_REST[method](rec, span=(5.0, 5.0))
    with pytest.raises(ValueError, match=r"at least one window of 0\.5 s long .* got 0\.1 s"):
        AT_REST[method](rec, span=(5.0, 5.1))
    with pytest.raises(MissingStream, match="imu"):
        AT_REST[method](Recording(mag=rec.mag))


def test_samples_that_are_missing_are_left_out():
    rec = still()
    acc = rec.imu.acc.copy()
    acc[::50] = np.nan
    found = alignment.level(Recording(imu=Imu(t=rec.imu.t, gyr=rec.imu.gyr, acc=acc)))
    assert found.rpy[:2] == pytest.approx(RPY[:2], abs=1e-4)


def test_a_force_that_is_not_gravity_is_refused():
    rec = still()
    in_g = Recording(imu=Imu(t=rec.imu.t, gyr=rec.imu.gyr, acc=rec.imu.acc / 9.80665))
    with pytest.raises(InputError, match=r"got 0\.9995; .* looks like g: multiply"):
        alignment.level(in_g)
    half = Recording(imu=Imu(t=rec.imu.t, gyr=rec.imu.gyr, acc=rec.imu.acc / 2))
    with pytest.raises(InputError, match=r"got 4\.901; check the units"):
        alignment.level(half)


def test_a_vertical_field_gives_no_heading():
    rec = still(rpy=(0.0, 0.0, 0.0))
    up = np.tile([0.5 * UT, 0.0, 50 * UT], (len(rec.mag), 1))
    rec = Recording(imu=rec.imu, mag=Mag(t=rec.mag.t, mag=up))
    with pytest.raises(InputError, match=r"within 0\.57 deg of the vertical; .*`gyrocompass`"):
        alignment.magnetic(rec)
    late = Recording(imu=rec.imu, mag=rec.mag.shifted(100.0))
    with pytest.raises(InputError, match=r"mag must hold a valid sample from 0 to 59\.99 s"):
        alignment.magnetic(late)


def test_an_alignment_starts_a_mechanisation():
    rec = still(gyr_noise=0.0, acc_noise=0.0)
    found = alignment.gyrocompass(rec, LAT, span=(0.0, 30.0), **NAVIGATION_GRADE)
    sol = mechanise(rec, found.start((LAT, 0.5, 0.0)))
    assert sol.t[0] == 30.0
    assert np.abs(sol.v_n[-1]).max() < 1e-6


# --- in motion ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def driven():
    """A drive, the box turned in the car by an odd angle."""
    C_vb = drive.rotation((1, 2, -1), 2.4)
    return drive.simulate(seed=3, C_vb=C_vb, gyr_bias=(0, 0, 0), acc_bias=(0, 0, 0))


# sensors whose biases are known well, the antenna above the box
GOOD = {"gyr_bias_std": 0.02 * DEG, "acc_bias_std": 0.02, "arm_std": 0.3}


def truth_at(d, t):
    return d.C_nb[int(np.argmin(np.abs(d.t - t)))]


@pytest.mark.parametrize("span", [(18.0, 40.0), (58.0, 95.0), (120.0, 165.0)])
def test_velocity_matching_finds_any_mount(driven, span):
    found = alignment.velocity_matching(driven.rec, span=span, **GOOD)
    error = drive.attitude_error(found.q_nb, truth_at(driven, found.t))
    assert np.abs(error[:2]).max() < 0.5 * DEG
    assert abs(error[2]) < 3.0 * DEG
    assert (np.abs(error) < 4.0 * found.std_n).all()
    assert found.std_n[2] < 5.0 * DEG


def test_velocity_matching_of_perfect_data_is_exact():
    d = drive.simulate(
        seed=1, noise=0.0, C_vb=drive.rotation((3, -1, 1), 1.9), antenna_v=(0, 0, 0)
    )
    found = alignment.velocity_matching(d.rec, span=(58.0, 95.0), velocity_std=0.01)
    error = drive.attitude_error(found.q_nb, truth_at(d, found.t))
    # means over 10 ms taken as constant, and fixes interpolated between samples
    assert np.abs(error).max() < 0.02 * DEG


def test_velocity_matching_knows_the_turning_earth():
    """A minute of the Earth's rate is 0.25 deg: left out it would be in the attitude."""
    lat = 1.2
    d = drive.simulate(
        seed=1, noise=0.0, antenna_v=(0, 0, 0), lla0=(lat, 0.2, 0.0), duration=200.0
    )
    found = alignment.velocity_matching(d.rec, span=(58.0, 165.0), velocity_std=0.01)
    error = drive.attitude_error(found.q_nb, truth_at(d, found.t))
    assert np.abs(error).max() < 0.03 * DEG


def test_heading_at_the_end_has_what_the_bias_turned_since_the_acceleration():
    """Pulling away for 8 s shows heading; in the 50 s after it a bias of 0.1 deg/s turns 5 deg."""
    t = np.arange(6001) / 100.0
    speed = 2.5 * np.minimum(t, 8.0)
    C = dcm_from_quat(quat_from_rpy([0.0, 0.0, 0.6]))
    v_n = speed[:, None] * C[:, 0]
    spin = OMEGA * np.array([np.cos(0.8), 0.0, -np.sin(0.8)])
    f_n = np.where(t < 8.0, 2.5, 0.0)[:, None] * C[:, 0] + np.cross(2 * spin, v_n)
    f_n[:, 2] -= drive.gravity(0.8, 0.0)
    fixes = Gnss(
        t=t[::50], lla=np.tile([0.8, 0.1, 0.0], (121, 1)), v_n=v_n[::50],
        std_velocity_n=np.full((121, 3), 0.05),
    )  # fmt: skip
    rec = Recording(imu=Imu(t=t, gyr=np.tile(spin @ C, (len(t), 1)), acc=f_n @ C), gnss=fixes)
    found = alignment.velocity_matching(
        rec, gyr_bias_std=0.1 * DEG, acc_bias_std=0.001, arm_std=0.0, max_heading_std=1.0
    )
    assert found.std_n[2] == pytest.approx(0.1 * DEG * 56.0, rel=0.1)
    assert np.abs(drive.attitude_error(found.q_nb, C)).max() < 0.1 * DEG


def test_biases_are_found_with_the_attitude():
    bias = np.array([0.004, -0.006, 0.008])  # 0.2 to 0.5 deg/s: 15 deg in half a minute
    d = drive.simulate(
        seed=4, C_vb=drive.rotation((1, 2, -1), 2.4), gyr_bias=bias, acc_bias=(0.05, -0.08, 0.1),
        vibration=0.3, duration=200.0,
    )  # fmt: skip
    found = alignment.velocity_matching(d.rec, span=(58.0, 165.0))
    assert found.gyr_bias == pytest.approx(bias, abs=5e-4)
    error = drive.attitude_error(found.q_nb, truth_at(d, found.t))
    assert (np.abs(error) < 4.0 * found.std_n).all()
    assert np.abs(error).max() < 3.0 * DEG


def test_covariance_of_velocity_matching_is_honest():
    """Biases as large as their sigmas, fixes as good as the receiver says."""
    rng, nees = np.random.default_rng(8), []
    for seed in range(16):
        d = drive.simulate(
            seed=seed, duration=100.0, vibration=0.3, antenna_v=(0, 0, 0),
            gyr_bias=0.3 * DEG * rng.standard_normal(3), acc_bias=0.05 * rng.standard_normal(3),
            velocity_error=0.1, stated=(0.5, 0.1), C_vb=drive.rotation((1, 2, -1), 2.4),
        )  # fmt: skip
        found = alignment.velocity_matching(
            d.rec, span=(58.0, 95.0), gyr_bias_std=0.3 * DEG, acc_bias_std=0.05, arm_std=0.0,
            max_heading_std=1.0,
        )  # fmt: skip
        error = drive.attitude_error(found.q_nb, truth_at(d, found.t))
        nees.append(error @ np.linalg.solve(found.covariance_n, error))
    # mean of 16 chi-squares of three degrees: 99.9 % of them lie below 5.4, and above 1.4; the
    # noise of two neighbouring changes of velocity is one fix's, of opposite sign: truth is less
    assert 0.5 < np.mean(nees) < 5.4


def test_motion_that_leaves_heading_open_is_refused(driven):
    with pytest.raises(
        InputError, match=r"shows it to .* deg: .* take a span in which the vehicle"
    ):
        alignment.velocity_matching(driven.rec, span=(2.0, 17.0))
    with pytest.raises(InputError, match=r"at least 5 fixes 0\.4 s apart, got 2"):
        alignment.velocity_matching(driven.rec, span=(60.0, 60.6))
    with pytest.raises(InputError, match="at least two fixes with velocity, got 0"):
        alignment.velocity_matching(driven.rec, span=(500.0, 600.0))
    without = Gnss(t=driven.rec.gnss.t, lla=driven.rec.gnss.lla)
    with pytest.raises(InputError, match=r"must have velocities .*'loosely-coupled'"):
        alignment.velocity_matching(Recording(imu=driven.rec.imu, gnss=without))
    with pytest.raises(MissingStream, match="gnss"):
        alignment.velocity_matching(Recording(imu=driven.rec.imu))


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, -1, 1), (1, 1, -1)])
def test_mirrored_axes_do_not_fit(driven, mirror):
    imu, fixes = driven.rec.imu, driven.rec.gnss
    gnss = Gnss(t=fixes.t, lla=fixes.lla, v_n=fixes.v_n)  # the receiver's sigmas hide it
    rec = Recording(imu=Imu(t=imu.t, gyr=imu.gyr, acc=imu.acc * mirror), gnss=gnss)
    with pytest.raises((InputError, NotConverged), match="check axes"):
        alignment.velocity_matching(rec, span=(58.0, 95.0), **GOOD)
    alignment.velocity_matching(Recording(imu=imu, gnss=gnss), span=(58.0, 95.0), **GOOD)


def straight(speed=20.0, heading=1.1, pitch=0.05, q_vb=None, slowing=0.5):
    """Ten seconds straight ahead, slowing down."""
    t = np.arange(1001) / 100.0
    C_nv = dcm_from_quat(quat_from_rpy([0.02, pitch, heading]))
    C_vb = np.eye(3) if q_vb is None else dcm_from_quat(q_vb)
    ahead = C_nv[:, 0]
    v_n = (speed - slowing * t)[:, None] * ahead
    f_n = -slowing * ahead - np.array([0.0, 0.0, drive.gravity(0.8, 0.0)])
    w = OMEGA * np.array([np.cos(0.8), 0.0, -np.sin(0.8)])
    f_n = f_n + np.cross(2 * w, v_n)
    C_nb = C_nv @ C_vb
    gnss = Gnss(
        t=t[::50], lla=np.tile([0.8, 0.1, 0.0], (21, 1)), v_n=v_n[::50],
        std_velocity_n=np.full((21, 3), 0.05),
    )  # fmt: skip
    imu = Imu(t=t, gyr=np.tile(w @ C_nb, (len(t), 1)), acc=f_n @ C_nb)
    return Recording(imu=imu, gnss=gnss), C_nb


@pytest.mark.parametrize("mount", [(0.0, 0.0, 0.0), (0.5, -0.3, 2.8), (3.1, 0.1, -1.0)])
def test_course_on_a_straight_stretch(mount):
    q_vb = quat_from_rpy(mount)
    rec, C_nb = straight(q_vb=q_vb)
    found = alignment.course(rec, span=(2.0, 6.0), q_vb=q_vb)
    error = drive.attitude_error(found.q_nb, C_nb)
    assert np.abs(error).max() < 1e-4  # the transport rate of a road that bends with the Earth
    assert found.t == 4.0
    # 0.5 deg of side slip; 20 mm/s^2 of bias and 18 of the fixes' noise over gravity
    assert found.std_n[2] == pytest.approx(0.5 * DEG, rel=0.05)
    assert found.std_n[0] == pytest.approx(np.hypot(0.02, 0.05 * np.sqrt(2) / 4) / 9.81, rel=0.02)


def test_course_wants_speed_and_a_straight_way(driven):
    rec, _ = straight(speed=4.0)
    with pytest.raises(
        InputError, match=r"at least 3 m/s .* goes 1\.00 m/s at 6 s; take a faster"
    ):
        alignment.course(rec, span=(0.0, 6.0))
    with pytest.raises(
        InputError, match=r"turns by .* deg; take a straighter .*velocity_matching"
    ):
        alignment.course(driven.rec, span=(90.0, 100.0))


def test_heading_of_a_course_is_that_of_the_vehicle():
    q_vb = quat_from_dcm(dcm_from_quat(quat_from_rpy([0.0, 0.0, np.pi / 2])))
    rec, _ = straight(q_vb=q_vb, heading=-3.0)
    found = alignment.course(rec, span=(2.0, 6.0), q_vb=q_vb)
    yaw_b = rpy_from_quat(found.q_nb)[2]  # the box looks to the right of the vehicle
    assert np.cos(yaw_b - (-3.0 + np.pi / 2)) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("begin", [20.3, 60.3, 100.3])
def test_velocity_matching_on_a_real_drive_is_within_its_sigmas(parking_lot, begin):
    """A MEMS unit in a car going in figures of eight, nothing known of it."""
    rec = sd.read(parking_lot)
    found = alignment.velocity_matching(rec, span=(begin, begin + 30.0))
    reference = rec.reference.attitude
    truth = interpolate(np.array([found.t]), reference.t, reference.q_nb)[0]
    error = drive.attitude_error(found.q_nb, dcm_from_quat(truth))
    assert (np.abs(error) < 4.0 * found.std_n).all()
    assert np.abs(error[:2]).max() < 6.0 * DEG
