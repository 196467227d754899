"""Growth of errors: closed forms, the linear model and the mechanisations tell the same."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from truth.flight import axes, ecef, gravity_e, position_error

from strapdown.navigation import SphericalEarth, Start, error_growth, grades, mechanise
from strapdown.rotation import dcm_from_quat, quat_from_rotvec
from strapdown.units import DEG, DEG_PER_HR, DEG_PER_SQRT_HR, MG, UG

OMEGA = 7.292115e-5
HOURS = 3600.0


# --- drift formula ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cause", "metres"),
    [
        ({"acc_bias": 0.35}, 1750.0),
        ({"acc_bias": 1e-3 * 9.81}, 49.05),
        ({"gyr_bias": 0.3766 * DEG}, 10747.0),
        ({"gyr_bias": 0.015 * DEG}, 428.0),
        ({"tilt": 0.1 * DEG}, 85.6),
        ({"position": 3.0}, 3.0),
        ({"velocity": 0.2}, 20.0),
        ({"heading": 0.5 * DEG, "speed": 14.0}, 12.217),
        ({"acc_scale": 0.01, "specific_force": 2.0}, 100.0),
        ({"gyr_scale": 0.02, "heading_change": np.pi / 2, "speed": 10.0}, 31.416),
    ],
)
def test_single_terms_after_100_s(cause, metres):
    found = error_growth.drift(100.0, gravity=9.81, **cause)
    assert found.total == pytest.approx(metres, rel=2e-4)
    assert found.root_sum_square == pytest.approx(metres, rel=2e-4)


def test_car_test_of_the_thesis():
    assert error_growth.drift(30.0, acc_bias=0.5).total == pytest.approx(225.0)


def test_terms_add_up_and_keep_their_shape():
    t = np.array([0.0, 10.0, 20.0])
    found = error_growth.drift(t, acc_bias=0.1, velocity=-1.0)
    assert found.total == pytest.approx([0.0, -5.0, 0.0])
    assert found.root_sum_square[2] == pytest.approx(20.0 * np.sqrt(2.0))
    assert error_growth.drift(0.0).total.shape == ()


def test_a_cause_must_be_finite():
    with pytest.raises(ValueError, match="`acc_bias` must be finite, got nan"):
        error_growth.drift(1.0, acc_bias=float("nan"))


# --- one and two channels ---------------------------------------------------------------------


def test_the_schuler_period_is_84_4_minutes():
    assert error_growth.schuler_period() / 60.0 == pytest.approx(84.4, abs=0.05)


def test_one_channel_solves_its_differential_equation():
    cause = {"position": 5.0, "velocity": -0.3, "tilt": 2e-4, "acc_bias": 1e-3, "gyr_bias": 3e-7}
    t = np.linspace(0.0, 8000.0, 9)

    def slope(_, y):
        return [y[1], 9.7 * y[2] + 1e-3, 3e-7 - y[1] / 6.4e6]

    truth = solve_ivp(slope, (0, 8000), [5.0, -0.3, 2e-4], t_eval=t, method="DOP853", rtol=1e-12)
    found = error_growth.schuler_error(t, gravity=9.7, radius=6.4e6, **cause)
    assert found.position == pytest.approx(truth.y[0], rel=1e-8)
    assert found.velocity == pytest.approx(truth.y[1], rel=1e-7)
    assert found.tilt == pytest.approx(truth.y[2], rel=1e-7)


def test_the_drift_formula_is_the_beginning_of_it():
    t = 120.0
    for cause in ({"acc_bias": 0.01}, {"tilt": 1e-3}, {"gyr_bias": 1e-5}, {"velocity": 1.0}):
        early = error_growth.drift(t, **cause).total
        whole = error_growth.schuler_error(t, **cause).position
        assert early == pytest.approx(whole, rel=(t / 1400.0) ** 2)


def test_two_channels_turn_like_foucaults_pendulum():
    def slope(_, y):
        k = 2 * OMEGA * np.sin(-0.6)
        w2 = 9.8 / 6.37e6
        return [y[2], y[3], -w2 * y[0] - k * y[3], -w2 * y[1] + k * y[2]]

    t = np.linspace(0.0, 20000.0, 11)
    truth = solve_ivp(
        slope, (0, 20000), [30.0, -10.0, 0.2, 0.5], t_eval=t, method="DOP853", rtol=1e-12
    )
    p, v = error_growth.foucault_error(
        t, -0.6, position_n=(30.0, -10.0), velocity_n=(0.2, 0.5), gravity=9.8, radius=6.37e6
    )
    assert np.abs(np.column_stack((p, v)) - truth.y.T).max() < 1e-5
    assert error_growth.foucault_period(np.pi / 2) == pytest.approx(2 * np.pi / OMEGA)
    assert error_growth.foucault_period(0.0) == np.inf


# --- against the mechanisations --------------------------------------------------------------


def at_rest(lat, seconds, step=0.1, *, gyr_bias_n=(0, 0, 0), acc_bias_n=(0, 0, 0)):
    """Samples of a level box at rest, its axes north, east, down."""
    t = np.arange(round(seconds / step) + 1) * step
    n = len(t)
    earth = OMEGA * np.array([np.cos(lat), 0.0, -np.sin(lat)])
    C_ne = axes(np.float64(lat), np.float64(0.3))
    g = C_ne @ gravity_e(ecef(lat, 0.3, 0.0))
    return (
        t,
        np.tile(earth + np.asarray(gyr_bias_n), (n, 1)),
        np.tile(np.asarray(acc_bias_n) - g, (n, 1)),
    )


def run_with(lat, seconds, frame="wander", *, velocity_n=(0, 0, 0), phi_n=(0, 0, 0), **bias):
    """Errors of position, velocity and attitude over time, of a mechanisation at rest."""
    start = Start(
        lla=(lat, 0.3, 0.0), v_n=velocity_n, q_nb=quat_from_rotvec(-np.asarray(phi_n, float))
    )
    sol = mechanise(at_rest(lat, seconds, **bias), start, frame=frame, height="held")
    e2 = 6.69437999014e-3
    d = 1 - e2 * np.sin(lat) ** 2
    along, across = 6378137 * (1 - e2) / d**1.5, 6378137 / np.sqrt(d)
    north = (sol.lla[:, 0] - lat) * along
    east = (sol.lla[:, 1] - 0.3) * across * np.cos(lat)
    D = dcm_from_quat(sol.q_nb)
    phi = -0.5 * np.stack(
        (D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]), axis=-1
    )
    return sol.t, np.stack((north, east), axis=-1), sol.v_n, phi


@pytest.mark.parametrize("lat", [-0.6, 0.0, 0.9])
def test_perfect_sensors_at_rest_stay_where_they_are(lat):
    _, p, v, phi = run_with(lat, 2 * HOURS)
    assert np.abs(p).max() < 1e-6
    assert np.abs(v).max() < 1e-9
    assert np.abs(phi).max() < 1e-12


@pytest.mark.parametrize("frame", ["ned", "wander", "ecef"])
def test_rest_is_rest_at_two_samples_per_second_too(frame):
    """Body and frame turn as one, within a step as well: nothing is left but rounding."""
    samples = at_rest(0.6, 600.0, 0.5)
    start = Start(lla=(0.6, 0.3, 0.0), q_nb=(1, 0, 0, 0))
    sol = mechanise(samples, start, frame=frame)
    assert np.abs(sol.v_n).max() < 1e-9
    assert position_error(sol.lla[-1], sol.lla[0]) < 1e-6


@pytest.mark.parametrize("frame", ["ned", "wander", "ecef", "inertial"])
def test_velocity_error_oscillates_with_84_4_minutes(frame):
    t, p, _, _ = run_with(0.0, 2 * HOURS, frame, velocity_n=(0.05, 0, 0))
    north = p[:, 0]
    up = np.flatnonzero((north[:-1] < 0) & (north[1:] >= 0))[0]
    period = t[up] - north[up] / (north[up + 1] - north[up]) * (t[up + 1] - t[up])
    # on the equator the meridian's radius is that of its curvature, 6335 km
    assert period == pytest.approx(error_growth.schuler_period(9.7803253359, 6335439.3), rel=2e-4)
    assert period / 60.0 == pytest.approx(84.4, abs=0.5)
    assert north.max() == pytest.approx(0.05 * period / (2 * np.pi), rel=1e-3)


def test_the_plane_of_oscillation_turns_with_the_sine_of_latitude():
    lat = 50 * DEG
    t, p, _, _ = run_with(lat, 3 * HOURS, velocity_n=(0.05, 0, 0))
    # the direction of the farthest points: north, back, north again one period later
    period = error_growth.schuler_period(9.81, 6.38e6)
    first, last = (np.argmax(np.hypot(*(p * ((t > a) & (t < b))[:, None]).T)) for a, b in (
        (0.0, 0.5 * period), (period, 1.5 * period)))  # fmt: skip
    turned = np.arctan2(p[last, 1], p[last, 0]) - np.arctan2(p[first, 1], p[first, 0])
    want = OMEGA * np.sin(lat) * (t[last] - t[first])
    assert turned == pytest.approx(want, rel=0.02)  # 15 deg sin(lat) per sidereal hour
    q, _ = error_growth.foucault_error(
        t[::600], lat, velocity_n=(0.05, 0.0), gravity=9.8107, radius=6.378e6
    )
    # the ellipsoid's two radii differ by 0.3 %, which shifts the phase by 1 % after three hours
    assert np.abs(p[::600] - q).max() < 0.02 * np.abs(p).max()


CAUSES = {
    "velocity": {"velocity_n": (0.05, -0.03, 0.0)},
    "tilt": {"phi_n": (2e-5, -1e-5, 0.0)},
    "heading": {"phi_n": (0.0, 0.0, 1e-3)},
    "gyr": {"gyr_bias_n": (0.01 * DEG_PER_HR, -0.02 * DEG_PER_HR, 0.03 * DEG_PER_HR)},
    "acc": {"acc_bias_n": (20 * UG, -50 * UG, 10 * UG)},
}


@pytest.mark.parametrize("cause", CAUSES)
@pytest.mark.parametrize("lat", [-0.6, 0.9])
def test_the_linear_model_foretells_the_mechanisation_for_two_hours(cause, lat):
    t, p, v, phi = run_with(lat, 2 * HOURS, "ned", **CAUSES[cause])
    rows = slice(0, None, 6000)
    want = error_growth.stationary_error(t[rows], (lat, 0.3, 0.0), **CAUSES[cause])
    # to first order: what is left is of the size of the error times itself
    assert np.abs(p[rows] - want.position_n[:, :2]).max() < 2e-3 * np.abs(p).max()
    assert np.abs(v[rows] - want.velocity_n).max() < 2e-3 * np.abs(v).max()
    assert np.abs(phi[rows] - want.phi_n).max() < 2e-3 * np.abs(phi).max()


def test_free_height_diverges_as_foretold():
    t = np.arange(36001) / 10.0
    samples = at_rest(0.7, 3600.0)
    start = Start(lla=(0.7, 0.3, 1.0), q_nb=(1, 0, 0, 0))  # one metre too high
    sol = mechanise(samples, start, frame="ecef")
    want = error_growth.stationary_error(
        [3600.0], (0.7, 0.3, 0.0), position_n=(0, 0, -1.0), height="free"
    )
    # the model of a sphere takes 2 g / R for the gradient, 0.2 % off the ellipsoid's: exp of it
    assert sol.lla[-1, 2] == pytest.approx(-want.position_n[0, 2], rel=0.02)
    assert sol.lla[-1, 2] == pytest.approx(error_growth.unstable_growth(t[-1]), rel=0.02)


def test_the_heading_error_of_a_gyrocompass_is_east_drift_over_the_earths_rate():
    """An east gyro bias and the heading error it hides behind leave the platform at rest."""
    lat, bias = 0.8, 0.01 * DEG_PER_HR
    heading = bias / (OMEGA * np.cos(lat))
    moved = [
        np.linalg.norm(
            error_growth.stationary_error(
                [600.0], (lat, 0.0, 0.0), gyr_bias_n=(0, bias, 0), phi_n=(0, 0, phi)
            ).position_n
        )
        for phi in (heading, 0.0)
    ]
    assert moved[0] < 0.05 * moved[1]


def test_error_model_has_no_place_at_the_pole():
    with pytest.raises(ValueError, match=r"must not be near a pole.*got latitude 89\.99"):
        error_growth.stationary_error([1.0], (89.99 * DEG, 0.0, 0.0))


# --- Earth's rate --------------------------------------------------------------------------------


def test_a_platform_that_does_not_turn_in_space_turns_with_the_sky():
    """No rate measured: relative to n the box turns backwards with the Earth, 15.04 deg/h."""
    lat, hours = 0.7, 1.0
    t = np.arange(0.0, hours * HOURS + 0.5, 1.0)
    still = np.zeros((len(t), 3))
    # without gravity and force the box stays where it is in velocity: zero over ground
    earth = SphericalEarth()
    start = Start(lla=(lat, 0.0, 0.0), q_nb=(1, 0, 0, 0))
    sol = mechanise((t, still, still), start, frame="ned", earth=earth, gravity=0.0, height="held")
    turned = dcm_from_quat(sol.q_nb[-1])
    angle = np.arccos((np.trace(turned) - 1) / 2)
    axis = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0],
                     turned[1, 0] - turned[0, 1]])  # fmt: skip
    assert angle / DEG == pytest.approx(15.041, abs=1e-3)
    assert axis / np.linalg.norm(axis) == pytest.approx([-np.cos(lat), 0.0, np.sin(lat)], abs=1e-6)


# --- grades -------------------------------------------------------------------------------------


def test_grades_are_those_of_the_tables():
    nmi_per_hr = 1852.0 / 3600.0
    assert [g.cep_rate / nmi_per_hr for g in grades.INS_GRADES.values()] == pytest.approx(
        [0.1, 1.0, 10.0]
    )
    assert [g.gyr_bias / DEG_PER_HR for g in grades.INS_GRADES.values()] == pytest.approx(
        [1e-3, 1e-2, 1e-1]
    )
    assert [g.acc_bias / MG for g in grades.INS_GRADES.values()] == pytest.approx(
        [1e-4, 1e-3, 1e-2]
    )
    inertial = grades.GYRO_GRADES["inertial"]
    assert np.array(inertial.bias_stability) / DEG_PER_HR == pytest.approx([1e-4, 1e-2])
    assert np.array(inertial.bias_drift) / DEG_PER_SQRT_HR == pytest.approx([1e-4, 1e-3])
    # the table prints 10^-2 to 10^2 deg/s for it: rounded to powers of ten
    assert np.array(inertial.max_input) / DEG == pytest.approx([0.0278, 278.0], rel=1e-2)


@pytest.mark.parametrize(
    ("deg_per_hr", "name"),
    [(0.005, "inertial"), (1.0, "intermediate"), (30.0, "moderate"), (300.0, None)],
)
def test_gyro_grade(deg_per_hr, name):
    assert grades.gyro_grade(deg_per_hr * DEG_PER_HR) == name


def test_ins_grade_of_repeated_runs():
    rng = np.random.default_rng(4)
    t = np.linspace(0.0, HOURS, 13)
    speed = 0.3 * 1852.0 / HOURS  # sigma of each axis
    runs = speed * rng.standard_normal((4000, 1, 2)) * t[None, :, None]
    rate = grades.cep_rate(t, runs)
    # half of all lie within 1.1774 sigma; the median of 4000 is good to 1.6 %
    assert rate == pytest.approx(1.1774 * speed, rel=0.05)
    assert grades.ins_grade(rate) == "medium"
    assert grades.ins_grade(0.1 * rate) == "high"
    assert grades.ins_grade(40 * rate) == "low"
    with pytest.raises(ValueError, match=r"shape \(runs, 13, 2\), got \(13, 2\)"):
        grades.cep_rate(t, runs[0])
    with pytest.raises(ValueError, match="time other than zero"):
        grades.cep_rate([0.0], runs[:, :1])
