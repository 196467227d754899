"""What all filters share: noticing a disturbed or missing field, and holding a slower rate."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth import hand
from truth.kernel_step import feed, quat, rotation, scalar_first, start

from strapdown.attitude import GyroIntegration, Mahony, Mekf
from strapdown.kernels import memory as m
from strapdown.kernels import status as s

G = 9.80665
R_NB = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])
ACC = R_NB.inv().apply([0.0, 0.0, -G])
DT = 0.1


def watched(fields_n, flt=None, dt=DT):
    """Status words of a box at rest that sees one field after another; None: no sample."""
    flt = flt or Mahony(kp=0.1, ki=0.0)
    x, P = start(flt, scalar_first(R_NB))
    words = []
    for k, field in enumerate(fields_n):
        mag = np.empty(0) if field is None else R_NB.inv().apply(field)
        feed(flt, x, P, (k + 1) * dt, np.zeros(3), ACC, mag)
        words.append(int(x[m.STATUS]))
    return np.array(words), x


def tilted(dip):
    """The field of the tests at another dip [deg]."""
    size, a = np.linalg.norm(hand.FIELD_N), np.radians(dip)
    return size * np.array([np.cos(a), 0.0, np.sin(a)])


@pytest.mark.parametrize(
    ("field", "flag"),
    [
        (1.19 * hand.FIELD_N, 0),
        (1.21 * hand.FIELD_N, s.MAG_DISTURBED),
        (0.79 * hand.FIELD_N, s.MAG_DISTURBED),
        (tilted(63.97 - 11.4), 0),  # 2 asin(0.1) = 11.48 deg about the dip of 63.97 deg
        (tilted(63.97 - 11.6), s.MAG_DISTURBED),
        (tilted(63.97 + 11.6), s.MAG_DISTURBED),
        (Rotation.from_euler("z", 0.05).apply(hand.FIELD_N), 0),  # heading is no criterion
    ],
)
def test_field_off_in_strength_or_dip_is_flagged(field, flag):
    words, _ = watched([hand.FIELD_N] * 5 + [field])
    assert not words[:5].any()
    assert words[5] == flag


def test_disturbed_field_is_not_learnt_and_must_be_as_usual_for_a_second():
    words, x = watched([hand.FIELD_N] * 10 + [2.0 * hand.FIELD_N] * 100 + [hand.FIELD_N] * 30)
    flagged = np.flatnonzero(words & s.MAG_DISTURBED)
    assert flagged.tolist() == list(range(10, 110 + 10))
    np.testing.assert_allclose(x[m.FIELD : m.FIELD + 2], hand.FIELD_N[[0, 2]], rtol=1e-12)


def test_disturbed_field_that_stays_the_same_becomes_usual_after_half_a_minute():
    words, _ = watched([hand.FIELD_N] * 10 + [2.0 * hand.FIELD_N] * 400)
    flagged = np.flatnonzero(words & s.MAG_DISTURBED)
    # 300 intervals, and the second of waiting after it
    assert flagged[0] == 10
    assert flagged[-1] == pytest.approx(10 + 300 + 10, abs=2)
    changing = [(2.0 + k // 100) * hand.FIELD_N for k in range(400)]  # never the same for 30 s
    words, _ = watched([hand.FIELD_N] * 10 + changing)
    assert (words[10:] & s.MAG_DISTURBED).all()


def test_slow_changes_of_the_field_are_followed():
    ramp = [(1.0 + 0.01 * k * DT) * hand.FIELD_N for k in range(600)]  # 60 % in a minute
    words, _ = watched(ramp)
    assert not (words & s.MAG_DISTURBED).any()


def test_field_is_missing_five_seconds_after_the_last_valid_one():
    gone = [None] * 40 + [np.full(3, np.nan)] * 40
    words, _ = watched([hand.FIELD_N] * 10 + gone + [hand.FIELD_N] * 5)
    missing = np.flatnonzero(words & s.MAG_MISSING)
    assert missing.tolist() == list(range(9 + 51, 90))


def test_a_field_that_never_came_is_not_missing():
    words, _ = watched([None] * 200)
    assert not words.any()


@pytest.mark.parametrize("reject", [True, False])
def test_rejection_is_a_parameter_and_stands_in_the_diagnostics(reject):
    flt = Mahony(kp=1.0, ki=0.0, reject_disturbed=reject)
    x, P = start(flt, scalar_first(R_NB))
    wrong = 2.0 * Rotation.from_euler("z", 0.5).apply(hand.FIELD_N)
    for k in range(30):
        field = hand.FIELD_N if k < 10 else wrong
        w = feed(flt, x, P, (k + 1) * DT, np.zeros(3), ACC, R_NB.inv().apply(field))
    turned = (rotation(quat(x)) * R_NB.inv()).magnitude()
    assert w[m.D_MAG + 6] == (s.REJECTED_DISTURBED if reject else s.ACCEPTED)
    assert (turned < 1e-12) == reject


def test_field_that_is_off_again_and_again_is_flagged_but_used():
    """As of a magnetometer with iron on the box: its field depends on the attitude."""
    flt = Mahony(kp=1e-3, ki=0.0, reject_disturbed=True)
    x, P = start(flt, scalar_first(R_NB))
    outcomes = []
    for k in range(600):  # 2 s as usual, 2 s off
        field = (1.0 if (k // 20) % 2 == 0 else 1.5) * hand.FIELD_N
        w = feed(flt, x, P, (k + 1) * DT, np.zeros(3), ACC, R_NB.inv().apply(field))
        outcomes.append((int(w[m.D_MAG + 6]), int(x[m.STATUS]) & s.MAG_DISTURBED))
    off = [k for k in range(600) if (k // 20) % 2 == 1]
    assert all(outcomes[k][1] for k in off)
    # every 4 s, forgotten with 60 s: (1 - r^n) / (1 - r), r = exp(-4 / 60), passes 8 at n = 12
    r = np.exp(-4.0 / 60.0)
    n = int(np.ceil(np.log(1.0 - 8.0 * (1.0 - r)) / np.log(r)))
    twelfth = 40 * (n - 1) + 20
    assert {outcomes[k][0] for k in off if k < twelfth} == {s.REJECTED_DISTURBED}
    assert {outcomes[k][0] for k in off if k >= twelfth} == {s.ACCEPTED}


# --- a gyroscope slower than the accelerometer -------------------------------------------


@pytest.mark.parametrize("flt", [GyroIntegration(), Mahony(kp=1e-9, ki=0.0), Mekf()])
def test_absent_rates_are_held_and_put_right_by_the_next(flt):
    """Rates at 25 Hz on an axis of 100 Hz: at each real sample as if the others were not there."""
    x, P = start(flt, scalar_first(R_NB))
    want, dt = R_NB, 0.01
    rates = np.random.default_rng(3).standard_normal((20, 3))
    rates[0] = 0.0
    for k in range(1, len(rates)):
        for part in (1, 2, 3):
            feed(flt, x, P, (4 * (k - 1) + part) * dt, np.full(3, np.inf), np.full(3, np.inf))
            held = want * Rotation.from_rotvec(part * dt * rates[k - 1])
            assert (rotation(quat(x)) * held.inv()).magnitude() < 1e-12
            assert int(x[m.STATUS]) == 0
        feed(flt, x, P, 4 * k * dt, rates[k], np.full(3, np.inf))
        # The held turn, undone and made anew, is one about another axis: order of (rate dt)^2.
        want = want * Rotation.from_rotvec(4 * dt * rates[k])
        off = (rotation(quat(x)) * want.inv()).magnitude()
        sizes = np.linalg.norm(rates[k]) * np.linalg.norm(rates[k - 1])
        assert off <= 0.5 * (4 * dt) ** 2 * sizes
        want = rotation(quat(x))


def test_a_rate_is_not_held_for_longer_than_a_gap():
    flt = GyroIntegration(max_gap=0.5)
    x, P = start(flt, scalar_first(R_NB))
    feed(flt, x, P, 1e-3, np.array([0.1, 0.2, 0.3]), ACC)
    words = []
    for k in range(1, 100):
        feed(flt, x, P, 0.01 * k, np.full(3, np.inf), ACC)
        words.append(int(x[m.STATUS]))
    invalid = np.flatnonzero(np.array(words) & s.GYR_INVALID)
    assert invalid[0] == pytest.approx(50, abs=1)
    assert len(invalid) == len(words) - invalid[0]
    feed(flt, x, P, 2.0, [0.1, 0.2, 0.3], ACC)
    assert int(x[m.STATUS]) == s.GAP


# --- a gyroscope that sticks at zero ---------------------------------------------------------


def test_zero_rates_right_after_turning_are_doubted_for_five_seconds_and_used():
    flt = GyroIntegration()
    x, P = start(flt, scalar_first(R_NB))
    rates = [[0.0, 0.0, 0.0]] * 3 + [[0.3, 0.0, 0.0]] * 5 + [[0.0, 0.0, 0.0]] * 70
    words = []
    for k, rate in enumerate(rates):
        feed(flt, x, P, (k + 1) * DT, rate, np.full(3, np.inf))
        words.append(int(x[m.STATUS]))
    flagged = np.flatnonzero(np.array(words) & s.GYR_STUCK)
    assert flagged[0] == 8
    assert len(flagged) == flagged[-1] - 7 == pytest.approx(50, abs=1)  # sum of fifty 0.1 s
    want = R_NB * Rotation.from_rotvec([5 * DT * 0.3, 0.0, 0.0])
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-13


@pytest.mark.parametrize("rate", [[0.0, 0.0, 1e-9], [0.009, 0.0, 0.0]])
def test_slow_rates_are_not_doubted(rate):
    flt = GyroIntegration()
    x, P = start(flt, scalar_first(R_NB))
    for k in range(20):
        feed(flt, x, P, (k + 1) * DT, rate if k < 10 else np.zeros(3), np.full(3, np.inf))
        assert int(x[m.STATUS]) == 0


def test_deviations_of_a_kalman_filter_grow_while_the_gyroscope_sticks():
    flt = Mekf()
    x, P = start(flt, scalar_first(R_NB))
    feed(flt, x, P, DT, [0.3, 0.0, 0.0], np.full(3, np.inf))
    before = x[m.STD_ATT + 2]
    feed(flt, x, P, 2 * DT, np.zeros(3), np.full(3, np.inf))
    assert x[m.STD_ATT + 2] ** 2 - before**2 > 0.9 * 0.5 * flt.gap_rate**2 * DT
