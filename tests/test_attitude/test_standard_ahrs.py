"""The standard AHRS as a whole: consistency, what turns and headings do to it, as printed."""

import math
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from truth import sway

from strapdown.attitude import StandardAhrs
from strapdown.recording import Imu, Mag, Recording

G, DEG = 9.80665, np.pi / 180
RATE = 50.0
FIELD_N = np.array([2.4e-5, 0.0, 3.9e-5])
RUNS = 120


@cache
def consistency(jacobian):
    """NEES at the end of each run, and mean squared normalised innovations, on its own model."""
    flt = StandardAhrs(
        std_tilt=0.1, std_heading=0.1, std_gyr_bias=0.02, gyr_bias_noise=1e-4, gate=math.inf,
        heading_jacobian=jacobian, reject_disturbed=False, declination=0.0,
    )  # fmt: skip
    found, squares = [], {"acc": [], "mag": []}
    for seed in range(RUNS):
        rng = np.random.default_rng(seed)
        n, dt = 1000, 1.0 / RATE
        t = dt * np.arange(n)
        r_nb = sway.attitude(t, rng)
        bias = sway.walk(n, dt, 0.02, 1e-4, rng)
        white = rng.standard_normal((2, n, 3))
        gyr = sway.rates(r_nb, dt) + bias + flt.gyr_noise / np.sqrt(dt) * white[0]
        acc = r_nb.inv().apply([0, 0, -G]) + math.sqrt(1.962361) * white[1]
        # what it calls noise of the heading: a field that is turned about down
        off = math.sqrt(0.014924) * rng.standard_normal(n)
        field = Rotation.from_euler("Z", off[:, None]).apply(FIELD_N)
        rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=r_nb.inv().apply(field)))
        first = Rotation.from_rotvec(0.1 * rng.standard_normal(3)) * r_nb[0]
        sol, state = flt.advance(flt.init(attitude=first.as_quat()[[3, 0, 1, 2]]), rec)
        found.append(sway.nees(state, r_nb[-1], bias[-1]))
        for name, rows in sol.diagnostics.items():
            used = rows.outcome == 1
            squares[name].append((rows.innovation[used] / rows.sigma[used]) ** 2)
    return np.array(found), {name: np.concatenate(rows).ravel() for name, rows in squares.items()}


def test_mean_nees_lies_in_its_chi_square_interval():
    found, _ = consistency("levelled")
    low, high = chi2.ppf([0.005, 0.995], 6 * RUNS) / RUNS
    assert low < found.mean() < high


@pytest.mark.parametrize("sensor", ["acc", "mag"])
def test_innovations_have_the_size_that_is_stated(sensor):
    squares = consistency("levelled")[1][sensor]
    n = len(squares)
    assert n > 20_000
    low, high = chi2.ppf([0.005, 0.995], n) / n
    assert low < squares.mean() < high


def test_a_heading_whose_tilt_is_not_counted_claims_too_much():
    """The dip of 58 deg turns an error of tilt into one and a half of heading."""
    honest, _ = consistency("levelled")
    exact, _ = consistency("exact")
    assert exact.mean() > 1.5 * honest.mean()


def still(yaw, seconds, bias=(0.0, 0.0, 0.0), gyr=(0.0, 0.0, 0.0)):
    """A box that keeps its attitude, ideal sensors."""
    t = np.arange(round(seconds * RATE)) / RATE
    r_nb = Rotation.from_euler("ZYX", [yaw, 0.05, 0.1])
    rows = np.ones((len(t), 1))
    rec = Recording(
        imu=Imu(t=t, gyr=rows * np.add(bias, gyr), acc=rows * r_nb.inv().apply([0, 0, -G])),
        mag=Mag(t=t, mag=rows * r_nb.inv().apply(FIELD_N)),
    )
    return rec, r_nb


def settled(flt, yaw, limit=2.0, seconds=60.0):
    """When the error falls below the limit for good, from the printed start [s]."""
    rec, r_nb = still(yaw, seconds)
    sol, _ = flt.advance(flt.init(attitude=[1, 0, 0, 0]), rec)
    off = (Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]]) * r_nb.inv()).magnitude() / DEG
    bad = np.flatnonzero(off > limit)
    return np.inf if bad[-1] == len(off) - 1 else sol.t[bad[-1]]


@pytest.mark.parametrize("jacobian", ["levelled", "exact"])
@pytest.mark.parametrize("yaw", [0.5, 1.57, 2.4, -2.8])
def test_corrected_jacobians_find_any_heading_from_the_printed_start(jacobian, yaw):
    assert settled(StandardAhrs(heading_jacobian=jacobian), yaw) < 30.0


def test_printed_jacobian_leaves_a_heading_of_120_deg():
    """Put there, a turn drives it away from the truth that the exact one finds."""
    rec, r_nb = still(120 * DEG, 60.0)
    off = {}
    for jacobian in ("exact", "printed"):
        flt = StandardAhrs(heading_jacobian=jacobian, std_tilt=0.2, std_heading=0.2)
        first = Rotation.from_euler("Z", -5 * DEG) * r_nb
        state = flt.init(attitude=first.as_quat()[[3, 0, 1, 2]])
        sol, _ = flt.advance(state, rec.between(0.0, 5.0))
        q = Rotation.from_quat(sol.q_nb[-1, [1, 2, 3, 0]])
        off[jacobian] = (q * r_nb.inv()).magnitude() / DEG
    assert off["exact"] < 1.0
    assert off["printed"] > 5.0


def test_biases_of_the_thesis_are_found_at_rest():
    bias = (0.1, 0.25, 0.5)
    rec, _ = still(0.7, 60.0, bias)
    np.testing.assert_allclose(StandardAhrs().run(rec).gyr_bias[-1], bias, atol=1e-4)


def test_a_long_turn_pulls_roll_towards_the_apparent_vertical():
    """Coordinated: the force stays along z. In a level circle it says "no bank"."""
    t = np.arange(round(60 * RATE)) / RATE
    bank, rate = 0.4, G * np.tan(0.4) / 9.0
    yaw = rate * np.clip(t - 20.0, 0.0, None)
    roll = bank * np.clip((t - 19.0), 0.0, 1.0)
    r_nb = Rotation.from_euler("ZYX", np.stack((yaw, 0 * t, roll), axis=1))
    acc = np.outer(-G / np.cos(roll), [0, 0, 1.0])
    rec = Recording(
        imu=Imu(t=t, gyr=sway.rates(r_nb, 1 / RATE), acc=acc),
        mag=Mag(t=t, mag=r_nb.inv().apply(FIELD_N)),
    )
    sol = StandardAhrs().run(rec)
    roll_off = Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]]).as_euler("ZYX")[:, 2] - roll
    assert np.abs(roll_off[t < 18]).max() < 0.1 * DEG
    assert -bank < roll_off.min() < -2.0 * DEG


def test_defaults_are_the_variances_of_the_program():
    flt = StandardAhrs()
    assert flt.gyr_noise**2 * 0.02 / 4 == pytest.approx(1e-8)
    assert flt.gyr_bias_noise**2 * 0.02 == pytest.approx(1e-12)
    assert flt.acc_noise**2 * 25 == pytest.approx(1.962361)
    assert flt.mag_noise**2 * 10 == pytest.approx(0.014924)
    assert (flt.acc_rate, flt.mag_rate) == (25.0, 10.0)
    printed = StandardAhrs.as_printed(acc_rate=50.0)
    np.testing.assert_allclose(printed._memory()[1], 0.1 * np.eye(7))
    assert printed.gate == math.inf
    assert printed.acc_rate == 50.0


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("propagation", "euler", "`propagation` must be one of exact, printed"),
        ("heading_jacobian", "coded", "`heading_jacobian` must be one of levelled, exact"),
        ("levelling", "then", "`levelling` must be one of now, before"),
        ("acc_noise", 0.0, "`acc_noise` must be positive"),
        ("mag_rate", 0.0, "`mag_rate` must be positive"),
        ("acc_rate", -1.0, "`acc_rate` must be positive"),
        ("gyr_bias_noise", -1.0, "`gyr_bias_noise` must be non-negative"),
    ],
)
def test_parameters_out_of_range_are_refused(name, value, sentence):
    with pytest.raises(ValueError, match=sentence):
        StandardAhrs(**{name: value})
