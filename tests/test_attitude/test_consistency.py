"""Kalman filters are as sure as they should be: NEES and NIS over a hundred drawn runs each."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.matched import DIP, FIELD_N, G, Sizes, degrees_of_freedom, draw, interval

from strapdown.attitude import IndirectEkf, Mekf, QuestEkf, TwoStage
from strapdown.kernels import memory as m
from strapdown.kernels import quest_ekf_layout as quest

RUNS = 100
drawn = cache(draw)
PLAIN = Sizes()
BIASED = Sizes(gyr_bias_noise=2e-4, std_gyr_bias=0.01)


@dataclass(frozen=True)
class Case:
    """A filter, what is drawn for it, and its error state."""

    flt: Any
    sizes: Sizes
    error: Any


def in_body(state, r_nb, omega, bias):
    """Errors (dtheta_b, dbg) and their covariance."""
    estimate = Rotation.from_quat(state.q_nb[[1, 2, 3, 0]])
    return np.r_[(estimate.inv() * r_nb).as_rotvec(), bias - state.gyr_bias], state.P


def of_rates(state, r_nb, omega, bias):
    """Errors (domega_b, phi_n); the covariance of seven cells has rank six."""
    x = state.x
    estimate = Rotation.from_quat(state.q_nb[[1, 2, 3, 0]])
    phi = (r_nb * estimate.inv()).as_rotvec()
    w, v = x[quest.Q_P], x[quest.Q_P + 1 : quest.Q_P + 4]
    turns = [np.r_[-(e @ v), w * e + np.cross(e, v)] for e in np.eye(3)]  # (0, e) q
    to_six = np.block([[np.eye(3), np.zeros((3, 4))], [np.zeros((3, 3)), 2.0 * np.array(turns)]])
    e = np.r_[omega - x[quest.RATE : quest.RATE + 3], phi]
    return e, to_six @ state.P @ to_six.T


C_UN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # NED to ENU


def of_two_stages(state, r_nb, omega, bias):
    """Errors phi in east, north, up; the covariance is of the four components of q_ub."""
    estimate = Rotation.from_quat(state.q_nb[[1, 2, 3, 0]])
    q = (Rotation.from_matrix(C_UN) * estimate).as_quat()
    w, v = q[3], q[:3]
    to_phi = 2.0 * np.array([np.r_[-(e @ v), w * e + np.cross(e, v)] for e in np.eye(3)])
    return C_UN @ (r_nb * estimate.inv()).as_rotvec(), to_phi @ state.P @ to_phi.T


def named(cls, sizes, *names, **parameters):
    """A filter with the numbers of what is drawn, started as sure as it should be, no gate."""
    same = {name: getattr(sizes, name) for name in names}
    return cls(**same, gate=np.inf, reject_disturbed=False, **parameters)


COMMON = ("gyr_noise", "acc_noise", "std_tilt")
BIAS = ("gyr_bias_noise", "std_gyr_bias")
RATES = ("mag_noise", "rate_std", "rate_time")


def quest_case(**parameters):
    std = {"std_heading": PLAIN.std_tilt}
    return Case(named(QuestEkf, PLAIN, *COMMON, *RATES, **std, **parameters), PLAIN, of_rates)


def indirect_case(propagation):
    # a field of the strength drawn is measured in tesla
    field = {"mag_noise": BIASED.mag_noise * np.linalg.norm(FIELD_N), "mag_factor": 1.0}
    flt = named(
        IndirectEkf, BIASED, *COMMON, *BIAS, propagation=propagation, **field,
        mag_reference=(FIELD_N[0], FIELD_N[2]),
    )  # fmt: skip
    return Case(flt, BIASED, in_body)


# Without a field: stage two takes a levelled one for a direction free of tilt errors, which makes
# it surer than it is. With one, the filter's covariance is a tuning, and it states no deviation.
SIX_AXES = Case(
    TwoStage(
        process_noise=0.5 * PLAIN.gyr_noise,  # a turn phi moves the quaternion by phi / 2
        acc_noise=PLAIN.acc_noise / G,
        variance=0.25 * PLAIN.std_tilt**2,
        use_mag=False,
    ),
    PLAIN,
    of_two_stages,
)
CASES = {
    "quest-ekf": quest_case(),
    "quest-ekf, dip given": quest_case(dip=DIP),
    "quest-ekf, vectors": quest_case(measurements="vectors"),
    "quest-ekf, vectors, dip given": quest_case(measurements="vectors", dip=DIP),
    "mekf": Case(named(Mekf, BIASED, *COMMON, *BIAS, "mag_noise"), BIASED, in_body),
    "indirect-ekf, exact": indirect_case("exact"),
    "indirect-ekf, truncated": indirect_case("truncated"),
}


@cache
def studied(name):
    """Mean NEES at the end of the runs; sum and number of all squared innovations."""
    case = CASES.get(name, SIX_AXES)
    errors, total, number = [], 0.0, 0
    for seed in range(RUNS):
        rec, r_nb, omega, bias, start = drawn(case.sizes, seed)
        state = case.flt.init(attitude=start.as_quat()[[3, 0, 1, 2]])
        sol, state = case.flt.advance(state, rec)
        e, P = case.error(state, r_nb[-1], omega[-1], bias[-1])
        errors.append(e @ np.linalg.solve(P, e))
        more, count = degrees_of_freedom(sol)
        total, number = total + more, number + count
    return np.mean(errors), total, number


@pytest.mark.parametrize("name", CASES)
def test_errors_are_as_large_as_stated(name):
    mean, _, _ = studied(name)
    low, high = interval(6, RUNS)
    print(f"{name}: mean NEES {mean:.2f}, within {low:.2f} to {high:.2f}")
    assert low < mean < high


@pytest.mark.parametrize("name", CASES)
def test_innovations_are_as_large_as_stated(name):
    _, total, number = studied(name)
    low, high = interval(number)
    print(f"{name}: NIS {total / number:.4f}, within {low / number:.4f} to {high / number:.4f}")
    assert low < total < high


def test_first_stage_is_as_sure_as_it_should_be():
    """Three components are noted of a unit vector, which has two errors."""
    mean, total, number = studied("two-stage, six axes")
    low, high = interval(3, RUNS)
    print(f"two-stage, six axes: mean NEES {mean:.2f}, within {low:.2f} to {high:.2f}")
    assert low < mean < high
    low, high = interval(number * 2 // 3)
    print(f"NIS {1.5 * total / number:.4f}, within {1.5 * low / number:.4f}..")
    assert low < total < high


def test_given_attitude_is_as_unsure_as_the_alignment():
    """What the runs above start from."""
    for case in CASES.values():
        state = case.flt.init(attitude=[1.0, 0, 0, 0])
        assert state.x[m.ALIGNED] == m.GIVEN
