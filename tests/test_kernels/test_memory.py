"""What all filters share: judging a sample, aligning, integrating turning rates."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth import hand
from truth.kernel_step import NO_MAG, feed, quat, rotation, scalar_first, start

from strapdown.attitude import GyroIntegration, Madgwick, Mahony, Mekf
from strapdown.kernels import memory as m
from strapdown.kernels import status as s

G = 9.80665
DOWN_ACC = [0.0, 0.0, -G]
TURNED = Rotation.from_euler("ZYX", [2.1, -0.4, 2.6])  # beyond 90 deg of roll and yaw


def coning(t, half_cone=0.5, rate=7.0):
    """Attitude and rate in b of an axis that runs around a cone, in closed form."""
    t = np.asarray(t, dtype=float)
    zero = np.zeros_like(t)
    c, s_ = np.cos(half_cone / 2) + zero, np.sin(half_cone / 2)
    q = np.stack((c, s_ * np.cos(rate * t), s_ * np.sin(rate * t), zero), axis=-1)
    dq = rate * np.stack((zero, -s_ * np.sin(rate * t), s_ * np.cos(rate * t), zero), axis=-1)
    # omega_b = 2 q* dq, vector part written out
    w, v, dw, dv = q[..., :1], q[..., 1:], dq[..., :1], dq[..., 1:]
    return q, 2.0 * (w * dv - dw * v - np.cross(v, dv))


def mean_rate(t, dt):
    """Mean of the rate over (t - dt, t], Gauss's rule of five points."""
    nodes, weights = np.polynomial.legendre.leggauss(5)
    at = t[:, None] - dt / 2 + dt / 2 * nodes
    return np.einsum("k,nki->ni", weights / 2, coning(at)[1])


def integrated(gyr, dt, q0):
    flt = GyroIntegration()
    x, P = start(flt, q0)
    for k, rate in enumerate(gyr):
        feed(flt, x, P, (k + 1) * dt, rate, np.full(3, np.inf))
    return quat(x)


def test_constant_rate_is_integrated_exactly():
    rate = np.array([0.7, -1.1, 2.3])
    got = integrated(np.tile(rate, (200, 1)), 0.02, scalar_first(TURNED))
    want = TURNED * Rotation.from_rotvec(4.0 * rate)
    # 200 products of unit quaternions: round-off of about 200 eps
    assert (rotation(got) * want.inv()).magnitude() < 1e-13
    assert abs(np.linalg.norm(got) - 1.0) < 1e-15


def test_error_of_integrated_mean_rates_falls_with_the_square_of_the_interval():
    q0, end = coning([0.0])[0][0], coning([1.0])[0][0]
    errors = []
    for n in (50, 100, 200):
        t = np.arange(1, n + 1) / n
        got = integrated(mean_rate(t, 1.0 / n), 1.0 / n, q0)
        errors.append((rotation(got) * rotation(end).inv()).magnitude())
    assert errors[0] > 1e-4  # else nothing turned
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 4.0, rtol=0.1)


def test_missing_samples_are_bridged_with_the_mean_of_the_rates_around_them():
    """A rate that grows linearly about one axis: the mean of its ends is exact."""
    flt = GyroIntegration()
    x, P = start(flt, [1.0, 0.0, 0.0, 0.0])
    dt, times = 0.01, [*range(1, 50), 58, 59, 60]
    for k in times:
        before = dt * (k - 0.5)  # the gyro gives the mean over its own interval of 10 ms
        feed(flt, x, P, dt * k, [0.0, 0.0, 2.0 * before], np.full(3, np.inf))
    # Rate 2 t. Over the nine intervals to sample 58 the kernel takes rate w_58 for one and the
    # mean of w_49 and w_58 for eight; the exact mean over those eight is that of the intervals
    # 50..57, whose centre is half an interval before: 2 * 0.005 * 0.08 rad too much at most.
    angle = rotation(quat(x)).as_rotvec()[2]
    assert angle == pytest.approx(0.36, abs=1e-3)
    held = 0.36 + 0.08 * 2.0 * 0.045  # what holding the last rate would give
    assert abs(angle - held) > 5e-3


def test_first_sample_aligns_roll_and_pitch_with_heading_zero():
    for r_nb in (TURNED, Rotation.from_euler("ZYX", [0, 0, np.pi]), Rotation.identity()):
        flt = GyroIntegration()
        state = flt.init()
        x, P = state.x, state.P
        feed(flt, x, P, 0.0, np.zeros(3), r_nb.inv().apply(DOWN_ACC))
        yaw = r_nb.as_euler("ZYX")[0]
        want = Rotation.from_euler("Z", -yaw) * r_nb
        assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-14
        assert x[m.ALIGNED] == m.TILT


@pytest.mark.parametrize("declination", [0.0, 0.3, -2.0])
def test_first_field_sets_the_heading_and_declination_turns_it(declination):
    flt = GyroIntegration(declination=declination)
    state = flt.init()
    x, P = state.x, state.P
    r_mb = TURNED  # b to magnetic north
    acc, mag = r_mb.inv().apply(DOWN_ACC), r_mb.inv().apply(hand.FIELD_N)
    feed(flt, x, P, 0.0, np.zeros(3), acc, mag)
    want = Rotation.from_euler("Z", declination) * r_mb
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-14
    assert x[m.ALIGNED] == m.FULL


def test_no_turning_is_lost_at_the_first_field_sample():
    """Between two samples the box turns by 60 deg about all axes; then the field comes."""
    flt = GyroIntegration()
    state = flt.init()
    x, P = state.x, state.P
    rate, dt = np.array([4.0, -6.0, 8.0]), 0.1
    feed(flt, x, P, 0.0, rate, TURNED.inv().apply(DOWN_ACC))
    now = TURNED * Rotation.from_rotvec(rate * dt)
    feed(flt, x, P, dt, rate, np.full(3, np.inf), now.inv().apply(hand.FIELD_N))
    assert (rotation(quat(x)) * now.inv()).magnitude() < 1e-13


@pytest.mark.parametrize("flt", [Madgwick(beta=0.5), Mahony(kp=2.0), Mekf(acc_noise=0.1)])
def test_first_field_sample_aligns_and_propagates_but_corrects_nothing(flt):
    """The accelerometer says something else at that sample, and the bias is that of the state."""
    state = flt.init()
    x, P = state.x, state.P
    rate, dt, offset = np.array([4.0, -6.0, 8.0]), 0.1, np.array([0.5, -0.2, 0.1])
    feed(flt, x, P, 0.0, rate, TURNED.inv().apply(DOWN_ACC))
    x[m.BG : m.BG + 3] = offset
    now = TURNED * Rotation.from_rotvec((rate - offset) * dt)
    feed(flt, x, P, dt, rate, [3.0, 2.0, -9.0], now.inv().apply(hand.FIELD_N))
    assert (rotation(quat(x)) * now.inv()).magnitude() < 1e-13
    assert np.array_equal(x[m.BG : m.BG + 3], offset)
    # tilt keeps its own deviation; 0.1 s of an unknown bias adds 0.1 deg to 5 deg in square
    assert not P.size or x[m.STD_ATT] == pytest.approx(flt.std_tilt, rel=4e-4)


@pytest.mark.parametrize("flt", [Madgwick(), Mahony(), Mekf()])
def test_skipped_samples_change_nothing_but_the_status(flt):
    x, P = start(flt, scalar_first(TURNED))
    before, P_before = x.copy(), P.copy()
    feed(flt, x, P, 0.1, [0.0, np.nan, 0.0], DOWN_ACC)
    assert int(x[m.STATUS]) == s.GYR_INVALID
    x[m.STATUS] = before[m.STATUS]
    assert np.array_equal(x, before)
    assert np.array_equal(P, P_before)


def test_cells_of_the_memory_lie_side_by_side():
    cells = [
        (m.T, 1), (m.STATUS, 1), (m.Q, 4), (m.BG, 3), (m.STD_ATT, 3), (m.STD_BG, 3), (m.LLA, 3),
        (m.V, 3), (m.STD_POS, 3), (m.STD_V, 3), (m.BA, 3), (m.STD_BA, 3), (m.Q_VB, 4),
        (m.OMEGA, 3), (m.DT, 1), (m.ALIGNED, 1), (m.MAG, 4), (m.STAR, 5), (m.GNSS, 15),
        (m.BARO, 2), (m.SPEED, 2), (m.AIRSPEED, 2), (m.T_FIELD, 1),
        (m.FIELD, 2), (m.FIELD_NEW, 2), (m.FIELD_HELD, 1), (m.FIELD_WAIT, 1), (m.AHEAD, 1),
        (m.STUCK, 1), (m.ONSETS, 2), (m.HEAD, 0),
    ]  # fmt: skip
    end = 0
    for first, count in cells:
        assert first == end
        end += count
    common = [
        m.P_MAX_GAP, m.P_USE_MAG, m.P_COS_D, m.P_SIN_D, m.P_GYR_RANGE, m.P_ACC_RANGE,
        m.P_REALIGN, m.P_REJECT, m.P_HEAD,
    ]  # fmt: skip
    assert common == list(range(len(common)))
    assert [m.D_ACC, m.D_MAG, m.W_HEAD] == [0, 7, 14]


@pytest.mark.parametrize("flt", [Madgwick(), Mahony(), Mekf()])
def test_parameters_of_a_filter_lie_side_by_side_after_the_common_ones(flt):
    kernel = flt._kernel()
    own = {v for n, v in vars(kernel).items() if n.startswith("P_") and v >= m.P_HEAD}
    names = {"P_HEAD", "P_SIZE"} & set(vars(kernel))
    assert len(names) == 2
    assert {m.P_HEAD, kernel.P_SIZE} <= own <= set(range(m.P_HEAD, kernel.P_SIZE + 1))
    assert len(flt._params()) == kernel.P_SIZE


def test_vertical_field_sets_no_heading():
    flt = GyroIntegration()
    state = flt.init()
    feed(flt, state.x, state.P, 0.0, np.zeros(3), DOWN_ACC, [0.0, 0.0, 5e-5])
    assert state.x[m.ALIGNED] == m.TILT
    assert np.array_equal(quat(state.x), [1.0, 0.0, 0.0, 0.0])


def test_after_a_gap_attitude_levels_the_short_way_and_keeps_its_heading():
    flt = GyroIntegration(max_gap=0.5)
    x, P = start(flt, scalar_first(TURNED))
    tilted = Rotation.from_rotvec([0.3, -0.2, 0.0]) * TURNED  # no turn about down
    feed(flt, x, P, 0.6, [9.0, 9.0, 9.0], tilted.inv().apply(DOWN_ACC))
    assert int(x[m.STATUS]) == s.GAP
    assert (rotation(quat(x)) * tilted.inv()).magnitude() < 1e-13


def test_after_a_gap_the_next_field_sets_the_heading_again():
    flt = GyroIntegration(max_gap=0.5)
    state = flt.init()
    x, P = state.x, state.P
    feed(flt, x, P, 0.0, np.zeros(3), DOWN_ACC, hand.FIELD_N)
    feed(flt, x, P, 0.6, np.zeros(3), DOWN_ACC)
    assert x[m.ALIGNED] == m.TILT
    turned = Rotation.from_euler("Z", 1.0)
    feed(flt, x, P, 0.7, np.zeros(3), DOWN_ACC, turned.inv().apply(hand.FIELD_N))
    assert (rotation(quat(x)) * turned.inv()).magnitude() < 1e-14


@pytest.mark.parametrize(
    ("gyr", "acc", "mag", "bit"),
    [
        ([np.nan, 0, 0], DOWN_ACC, NO_MAG, s.GYR_INVALID),
        ([0, 1.01e4, 0], DOWN_ACC, NO_MAG, s.GYR_INVALID),
        ([0, 0, np.inf], DOWN_ACC, NO_MAG, s.GYR_INVALID),
        ([0, 0, 0], [0, np.nan, -G], NO_MAG, s.ACC_INVALID),
        ([0, 0, 0], [0, 0, 0], NO_MAG, s.ACC_INVALID),
        ([0, 0, 0], [0, 0, 1.01e5], NO_MAG, s.ACC_INVALID),
        ([0, 0, 0], DOWN_ACC, [np.nan, 2e-5, 0], s.MAG_INVALID),
        ([0, 0, 0], DOWN_ACC, [0, 0, 0], s.MAG_INVALID),
        ([0, 0, 0], DOWN_ACC, [0, 0, 101.0], s.MAG_INVALID),
        ([0, 0, -2.0], DOWN_ACC, NO_MAG, s.SATURATED),
        ([2.0, 0, 0], DOWN_ACC, NO_MAG, s.SATURATED),
        ([0, 2.0, 0], DOWN_ACC, NO_MAG, s.SATURATED),
        ([0, 0, 0], [20.0, 0, -G], NO_MAG, s.SATURATED),
        ([0, 0, 0], [0, -20.0, -G], NO_MAG, s.SATURATED),
        ([0, 0, 0], [0, 0, -20.0], NO_MAG, s.SATURATED),
        ([1.9, -1.9, 1.9], [1.0, -2.0, -19.0], [2e-5, 0, 0], 0),
    ],
)
def test_bad_samples_raise_their_flag(gyr, acc, mag, bit):
    flt = GyroIntegration(gyr_range=2.0, acc_range=20.0)
    x, P = start(flt, [1.0, 0.0, 0.0, 0.0])
    feed(flt, x, P, 0.1, gyr, acc, mag)
    assert int(x[m.STATUS]) == bit


def test_skipped_rate_is_bridged_by_the_next_and_the_field_waits():
    flt = GyroIntegration()
    state = flt.init()
    x, P = state.x, state.P
    feed(flt, x, P, 0.0, np.zeros(3), DOWN_ACC)
    feed(flt, x, P, 0.1, [0, 0, np.nan], DOWN_ACC, hand.FIELD_N)
    assert x[m.T] == 0.0
    assert x[m.ALIGNED] == m.TILT
    feed(flt, x, P, 0.2, [0.0, 0.0, 1.0], DOWN_ACC)
    assert x[m.ALIGNED] == m.FULL
    np.testing.assert_allclose(rotation(quat(x)).as_rotvec(), 0.0, atol=1e-15)


def test_time_that_does_not_increase_changes_no_attitude():
    flt = GyroIntegration()
    x, P = start(flt, scalar_first(TURNED))
    feed(flt, x, P, 0.0, [1.0, 1.0, 1.0], DOWN_ACC)
    assert int(x[m.STATUS]) == s.GYR_INVALID
    assert np.array_equal(quat(x), scalar_first(TURNED))


def test_jitter_of_the_interval_does_not_pass_for_missing_samples():
    """Each rate covers its own interval, however long: the sum of rate times interval counts."""
    rng = np.random.default_rng(5)
    dt = 0.01 * rng.uniform(0.6, 1.4, 300)
    rates = rng.standard_normal(300)
    flt = GyroIntegration()
    x, P = start(flt, [1.0, 0.0, 0.0, 0.0])
    for t, rate in zip(np.cumsum(dt), rates, strict=True):
        feed(flt, x, P, t, [0.0, rate, 0.0], np.full(3, np.inf))
    angle = rotation(quat(x)).as_rotvec()[1]
    assert angle == pytest.approx(np.sum(dt * rates), abs=1e-13)


def test_events_enter_the_inbox_that_they_name():
    x = np.zeros(m.HEAD)
    events = np.array(
        [[0.5, m.BARO, 1, 9e4, 7.0], [0.9, m.SPEED, 1, 3.0, 7.0], [2, m.STAR, 1, 1, 1]]
    )
    assert m.load_events(x, 1.0, 0, events) == 2
    assert x[m.BARO : m.BARO + 2].tolist() == [1.0, 9e4]
    assert x[m.SPEED : m.SPEED + 2].tolist() == [1.0, 3.0]
    assert np.count_nonzero(x) == 4


def test_field_loaded_is_the_latest_up_to_the_time():
    x = np.zeros(m.HEAD)
    t_mag, mag = np.array([0.1, 0.2, 0.3]), np.arange(9.0).reshape(3, 3) + 1.0
    assert m.load(x, 0.2, 0, t_mag, mag) == 2
    assert x[m.MAG : m.MAG + 4].tolist() == [1.0, 4.0, 5.0, 6.0]
    assert m.load(x, 0.25, 2, t_mag, mag) == 2


@pytest.mark.parametrize("flt", [GyroIntegration(), Madgwick(), Mahony(), Mekf()])
@pytest.mark.parametrize("shapes", [(2, 3, 0), (3, 2, 3), (3, 3, 2), (3, 3, 4)])
def test_vectors_of_another_length_are_refused_unused(flt, shapes):
    x, P = start(flt, scalar_first(TURNED))
    before = x.copy()
    kernel = flt._kernel()
    vectors = [np.ones(max(n, 3))[:n].copy() for n in shapes]
    assert not kernel.update(x, P, flt._params(), np.zeros(kernel.W_SIZE), 1.0, *vectors)
    assert np.array_equal(x, before)


def test_outcome_says_what_became_of_a_measurement():
    """Absent, looked at by nobody, bad: the filters that use a sample overwrite the second."""
    flt = GyroIntegration()
    x, P = start(flt, [1.0, 0.0, 0.0, 0.0])
    cases = (
        (np.full(3, np.inf), NO_MAG, s.NOT_MEASURED, s.NOT_MEASURED),
        (DOWN_ACC, hand.FIELD_N, s.NOT_MEASURED, s.NOT_MEASURED),
        ([0.0, np.nan, 0.0], [0.0, 0.0, 0.0], s.REJECTED_INVALID, s.REJECTED_INVALID),
    )
    for i, (acc, mag, of_acc, of_mag) in enumerate(cases):
        w = feed(flt, x, P, 0.1 * (i + 1), np.zeros(3), acc, mag)
        assert (w[m.D_ACC + 6], w[m.D_MAG + 6]) == (of_acc, of_mag)
        bits = s.ACC_INVALID | s.MAG_INVALID if of_acc == s.REJECTED_INVALID else 0
        assert int(x[m.STATUS]) == bits
    assert np.isnan(w[m.D_ACC : m.D_ACC + 6]).all()
    assert np.isnan(w[m.D_MAG : m.D_MAG + 6]).all()


@pytest.mark.parametrize("rows", [0, 3])
def test_outputs_are_the_first_cells_of_the_memory_and_of_the_scratch(rows):
    x, w = np.arange(float(m.HEAD)), 100.0 + np.arange(float(m.W_HEAD))
    out, diag = np.zeros((3, 5)), np.zeros((rows, m.W_HEAD))
    m.store(x, w, 1, out, diag)
    assert np.array_equal(out[1], x[m.STATUS : m.STATUS + 5])
    assert not out[[0, 2]].any()
    if rows:
        assert np.array_equal(diag[1], w)
        assert not diag[[0, 2]].any()


def test_predicted_field_has_the_measured_dip_and_the_heading_of_the_reference():
    q = scalar_first(TURNED)
    field = np.array([0.2, -0.5, 0.7])
    d = 0.4
    got = TURNED.apply(m.field_in_body(*q, *field, np.cos(d), np.sin(d)))
    h = TURNED.apply(field)
    want = [np.hypot(*h[:2]) * np.cos(d), np.hypot(*h[:2]) * np.sin(d), h[2]]
    np.testing.assert_allclose(got, want, atol=1e-15)
