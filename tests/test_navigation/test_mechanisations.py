"""Mechanisations against flights in closed form, and against each other."""

from functools import cache

import numpy as np
import pytest
from truth.flight import Flight, ecef, position_error

from strapdown.errors import ComputationError
from strapdown.navigation import Mechanisation, Start, mechanise
from strapdown.rotation import dcm_from_quat, quat_from_dcm

MM = 1e-3
FRAMES = ("ned", "ecef", "inertial", "wander")
OVER_POLES = ("ecef", "inertial", "wander")


@cache
def flown(lat, lon, heading, seconds, rate, speed=250.0, swing=1.0):
    """A flight, its times and its samples."""
    flight = Flight(lat, lon, 1000.0, heading, speed, swing)
    t = np.arange(round(seconds * rate) + 1) / rate
    return flight, t, flight.samples(t)


def start_of(flight, t):
    lla, v_n, C_nb = flight.state(t)
    return Start(t=t, lla=lla, v_n=v_n, q_nb=quat_from_dcm(C_nb))


def errors(sol, flight, row=-1):
    """Distance [m], velocity [m/s] and attitude [rad] off the truth."""
    lla, v_n, C_nb = flight.state(sol.t[row])
    D = dcm_from_quat(sol.q_nb[row]).T @ C_nb
    turn = 0.5 * np.array((D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]))
    assert np.trace(D) > 2.0
    return (
        position_error(sol.lla[row], lla),
        np.linalg.norm(sol.v_n[row] - v_n),
        np.linalg.norm(turn),
    )


TEN_MINUTES = (0.83, 0.15, 0.7, 600.0, 1000.0)


@pytest.mark.parametrize("samples", [1, 2, 4])
def test_ten_minutes_at_1_khz_agree_to_a_millimetre_with_the_truth_and_each_other(samples):
    flight, t, (gyr, acc) = flown(*TEN_MINUTES)
    ends = []
    for frame in FRAMES:
        sol = mechanise((t, gyr, acc), start_of(flight, 0.0), frame=frame, samples=samples)
        position, velocity, attitude = errors(sol, flight)
        # asked is a millimetre; rounding alone makes micrometres
        assert position < 0.05 * MM
        assert velocity < 0.001 * MM
        assert attitude < 1e-10  # 1e-10 rad of tilt make 0.18 mm in 600 s
        ends.append(ecef(*sol.lla[-1]))
    spread = np.ptp(np.array(ends), axis=0)
    assert np.linalg.norm(spread) < 0.05 * MM


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("attitude", ["dcm", "euler"])
def test_the_attitude_may_be_a_matrix_or_angles(frame, attitude):
    flight, t, (gyr, acc) = flown(*TEN_MINUTES)
    n = 60_000
    sol = mechanise(
        (t[:n], gyr[:n], acc[:n]),
        start_of(flight, 0.0),
        frame=frame,
        attitude=attitude,
        samples=2,
    )
    position, _, angle = errors(sol, flight)
    assert position < 0.1 * MM
    assert angle < 1e-10


@pytest.mark.parametrize(
    ("lat", "lon", "heading"),
    [
        (-1.05, -2.0, 2.5),  # southern hemisphere
        (0.0, 1.0, 0.1),  # on the equator
        (-0.002, 3.1415, 1.4),  # over the antimeridian to the east
        (0.52, -3.1414, -1.5),  # and to the west
        (1.5690, 0.4, 1.57),  # 89.9 deg north
    ],
)
@pytest.mark.parametrize("frame", FRAMES)
def test_everywhere_on_the_earth(lat, lon, heading, frame):
    flight, t, (gyr, acc) = flown(lat, lon, heading, 60.0, 200.0)
    sol = mechanise((t, gyr, acc), start_of(flight, 0.0), frame=frame, samples=2)
    for row in (0, 1, len(sol) // 2, -1):
        position, velocity, attitude = errors(sol, flight, row)
        assert position < 0.2 * MM
        assert velocity < 0.01 * MM
        assert attitude < 1e-8  # at 89.9 deg 0.1 mm of position turn north by so much
    assert np.abs(sol.lla[:, 1]).max() <= np.pi


@pytest.mark.parametrize("pole", [1, -1])
@pytest.mark.parametrize("miss", [0.0, 1.7453e-4])  # over the pole; past it at 89.99 deg
@pytest.mark.parametrize("frame", OVER_POLES)
def test_over_and_past_the_poles(pole, miss, frame):
    lat = pole * (np.pi / 2 - 0.002)
    # towards the pole; a great circle that starts 0.002 rad away misses it by sin(turn) * 0.002
    heading = (0.0 if pole > 0 else np.pi) + np.arcsin(miss / 0.002)
    flight, t, (gyr, acc) = flown(lat, 0.9, heading, 120.0, 200.0, swing=1.0)
    sol = mechanise((t, gyr, acc), start_of(flight, 0.0), frame=frame, samples=2)
    nearest = np.abs(sol.lla[:, 0]).max()
    assert np.pi / 2 - nearest == pytest.approx(miss, abs=2e-5)  # the waves are 40 m
    for row in (len(sol) // 3, len(sol) // 2, -1):
        position, _, attitude = errors(sol, flight, row)
        assert position < 0.1 * MM
        # 90 m from the pole a metre of position is 11 mrad of north, 0.01 mm are 1e-7 rad
        assert attitude < 1e-6


def test_a_start_at_the_pole_itself():
    # north at the pole is the direction that the longitude names
    flight = Flight(np.pi / 2, 0.7, 500.0, 0.4, waves=0.0)
    t = np.arange(6001) / 200.0
    gyr, acc = flight.samples(t)
    lla, _, _ = flight.state(0.0)
    C_ne_row = (
        np.array((-np.cos(0.7), -np.sin(0.7), 0.0)),
        np.array((-np.sin(0.7), np.cos(0.7), 0.0)),
    )
    C_ne = np.array((*C_ne_row, (0.0, 0.0, -1.0)))
    _, v, _ = flight.position(0.0)
    C_eb, _ = flight.attitude(0.0)
    start = Start(
        t=0.0, lla=(np.pi / 2, 0.7, lla[2]), v_n=C_ne @ v, q_nb=quat_from_dcm(C_ne @ C_eb)
    )
    for frame in OVER_POLES:
        sol = mechanise((t, gyr, acc), start, frame=frame, samples=2)
        position, velocity, _ = errors(sol, flight)
        assert position < 0.1 * MM
        assert velocity < 0.01 * MM


def test_ned_is_refused_near_a_pole_with_the_way_out():
    flight, t, (gyr, acc) = flown(np.pi / 2 - 0.002, 0.9, 0.0, 120.0, 200.0)
    with pytest.raises(
        ComputationError, match=r"came to 89\.95.* deg at .*frame='wander'.*'ecef'"
    ):
        mechanise((t, gyr, acc), start_of(flight, 0.0))
    with pytest.raises(ValueError, match=r"within 89\.95 deg .*frame='wander'"):
        mechanise((t, gyr, acc), Start(lla=(-1.5705, 0.0, 0.0), q_nb=(1, 0, 0, 0)))


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize(
    ("samples", "compensate", "order"), [(1, False, 2), (1, True, 3), (2, True, 4), (3, True, 4)]
)
def test_order_of_convergence(frame, samples, compensate, order):
    # a strong swing, so that the body's motion is what makes the error
    found = []
    for rate in (50.0, 100.0):
        flight, t, (gyr, acc) = flown(0.6, -1.0, 2.2, 12.0, rate, speed=50.0, swing=3.0)
        if samples > 1:  # exact means also for 20 ms
            flight, t, (gyr, acc) = exact(rate)
        sol = mechanise(
            (t, gyr, acc), start_of(flight, 0.0), frame=frame, samples=samples,
            compensate=compensate,
        )  # fmt: skip
        found.append(errors(sol, flight)[2])
    assert np.log2(found[0] / found[1]) == pytest.approx(order, abs=0.25)


@cache
def exact(rate):
    """The flight of the order's test, its means by quadrature over eight parts."""
    flight = Flight(0.6, -1.0, 1000.0, 2.2, 50.0, 3.0)
    fine = np.arange(round(12.0 * rate) * 8 + 1) / (8 * rate)
    gyr, acc = (
        np.concatenate((x[:1], x[1:].reshape(-1, 8, 3).mean(axis=1))) for x in flight.samples(fine)
    )
    return flight, fine[::8], (gyr, acc)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize("samples", [1, 3])
def test_pieces_give_the_same_bits_as_the_whole(frame, samples):
    flight, t, (gyr, acc) = flown(0.83, 0.15, 0.7, 20.0, 100.0)
    ins = Mechanisation(frame=frame, samples=samples)
    state = ins.init(start_of(flight, 0.0))
    rows = []
    whole, end = ins.advance(state, (t[1:], gyr[1:], acc[1:]))
    for first, last in ((1, 2), (2, 8), (8, 8), (8, 1000), (1000, len(t))):
        part, state = ins.advance(state, (t[first:last], gyr[first:last], acc[first:last]))
        rows.append(part)
    for name in ("t", "lla", "v_n", "q_nb"):
        joined = np.concatenate([getattr(part, name) for part in rows])
        assert np.array_equal(joined, getattr(whole, name))
    assert np.array_equal(state.x, end.x)


def test_one_row_at_a_time_is_the_stepwise_form():
    flight, t, (gyr, acc) = flown(0.83, 0.15, 0.7, 20.0, 100.0)
    ins = Mechanisation()
    state = ins.init(start_of(flight, 0.0))
    whole, _ = ins.advance(state, (t[1:50], gyr[1:50], acc[1:50]))
    for i in range(1, 50):
        sol, state = ins.advance(state, (t[i : i + 1], gyr[i : i + 1], acc[i : i + 1]))
        assert np.array_equal(sol.lla[0], whole.lla[i - 1])


def test_samples_left_over_make_a_last_shorter_step():
    flight, t, (gyr, acc) = flown(0.83, 0.15, 0.7, 20.0, 100.0)
    for n in (1999, 2000, 2001):
        sol = mechanise((t[:n], gyr[:n], acc[:n]), start_of(flight, 0.0), samples=4)
        assert sol.t[-1] == t[n - 1]
        assert errors(sol, flight)[0] < 1.0 * MM  # at 25 steps per second


@pytest.mark.parametrize("samples", [1, 2])
def test_irregular_intervals_are_followed(samples):
    rng = np.random.default_rng(3)
    flight = Flight(0.4, 2.0, 300.0, 1.0)
    t = np.cumsum(rng.uniform(0.004, 0.006, 4001))
    gyr, acc = flight.samples(t)
    sol = mechanise((t, gyr, acc), start_of(flight, t[0]), samples=samples)
    assert errors(sol, flight)[0] < 5.0 * MM  # weights are for equal parts: second order is left


def test_points_are_joined_by_a_spline():
    flight, t, _ = flown(0.83, 0.15, 0.7, 60.0, 200.0)
    gyr, acc = flight.imu(t)
    sol = mechanise((t, gyr, acc), start_of(flight, 0.0), samples=2, sampling="points")
    assert errors(sol, flight)[0] < 0.1 * MM
    assert not sol.causal
    plain = mechanise((t, gyr, acc), start_of(flight, 0.0), samples=2)
    assert errors(plain, flight)[0] > 0.1  # half a sample late


def test_held_height_keeps_height_in_every_frame():
    flight, t, (gyr, acc) = flown(0.83, 0.15, 0.7, 20.0, 100.0)
    acc = acc + [0.0, 0.0, 0.3]
    ends = []
    for frame in FRAMES:
        sol = mechanise((t, gyr, acc), start_of(flight, 0.0), frame=frame, height="held")
        # a chord of 2.5 m is 1e-7 m off the curve
        assert np.abs(sol.lla[:, 2] - sol.lla[0, 2]).max() < 1e-6
        assert np.abs(sol.v_n[:, 2]).max() < 1e-6
        ends.append(ecef(*sol.lla[-1]))
    assert np.linalg.norm(np.ptp(np.array(ends), axis=0)) < 1.0 * MM


def test_a_start_in_the_middle_uses_the_samples_after_it():
    flight, t, (gyr, acc) = flown(0.83, 0.15, 0.7, 20.0, 100.0)
    for begin in (7.0, 7.003):
        sol = mechanise((t, gyr, acc), start_of(flight, begin))
        assert sol.t[0] == begin
        # an interval cut short takes the mean of the whole: 3 ms times its error of rate
        assert errors(sol, flight)[0] < (1.0 * MM if begin == 7.0 else 1.0)


def test_start_of_a_solution_goes_on_from_it():
    flight, t, (gyr, acc) = flown(0.83, 0.15, 0.7, 20.0, 100.0)
    whole = mechanise((t, gyr, acc), start_of(flight, 0.0), samples=2)
    begin = Start.of(whole, 500)
    assert begin.t == 10.0
    rest = mechanise((t, gyr, acc), begin, samples=2)
    assert position_error(rest.lla[-1], whole.lla[-1]) < 1e-6


def test_solution_says_what_made_it():
    flight, t, (gyr, acc) = flown(0.83, 0.15, 0.7, 20.0, 100.0)
    sol = mechanise(
        (t, gyr, acc), start_of(flight, 0.0), frame="ecef", heading_reference="magnetic"
    )
    assert sol.filter == "mechanisation-ecef"
    assert sol.heading_reference == "magnetic"
    assert sol.meta["parameters"]["frame"] == "ecef"
    assert "_p" not in sol.meta["parameters"]
    assert sol.causal
    assert np.allclose(np.linalg.norm(sol.q_nb, axis=1), 1.0, atol=1e-14)
