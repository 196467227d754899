"""The multi-mode AHRS's kernel: rows stacked, modes, fixes, the field that is learned."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import feed, quat, rotation, scalar_first, start
from truth.sphere import (
    FIELD_N,
    NO_ACC,
    TURNED,
    G,
    begun,
    dense_update,
    field_rows,
    gravity_rows,
    predicted,
    same,
    seven,
    yaw_row,
)

from strapdown.attitude import MultiModeAhrs
from strapdown.kernels import memory as m
from strapdown.kernels import multi_mode_ahrs as mm
from strapdown.kernels import status as s


@pytest.mark.parametrize("mode", [1, 2])
def test_multi_mode_is_one_update_with_all_rows_stacked(mode):
    flt = MultiModeAhrs(
        declination=float(np.arctan2(FIELD_N[1], FIELD_N[0])), gate=np.inf, min_speed=1.0,
        mag_reference=(float(np.hypot(*FIELD_N[:2])), float(FIELD_N[2])), acc_rate=25.0,
    )  # fmt: skip
    b0, rate, dt = np.array([0.02, -0.01, 0.03]), np.array([0.5, -0.8, 1.3]), 0.04
    x, P = begun(flt, b0, seed=9)
    x[mm.T_MAG] = 0.0
    off = TURNED * Rotation.from_rotvec([0.05, -0.02, 0.03])
    acc, mag = off.inv().apply([0.1, 0.2, -G]), off.inv().apply(FIELD_N)
    q, b, P1 = predicted(flt, x, P, rate, dt)
    r_nb = rotation(q)
    course = r_nb.as_euler("ZYX")[0] + 0.04
    z, H = mag - r_nb.inv().apply(FIELD_N), field_rows(r_nb)
    R = [7e-5 * 1e-8] * 3  # printed, in T^2
    if mode == 1:
        x[m.GNSS] = 1.0
        x[m.GNSS + 1 : m.GNSS + 15] = np.nan
        x[m.GNSS + 1] = dt
        x[m.GNSS + 5 : m.GNSS + 7] = 9 * np.cos(course), 9 * np.sin(course)
        z, H, R = np.append(z, 0.04), np.vstack((H, yaw_row(r_nb))), [*R, 0.001]
    else:
        z = np.append(z, acc - r_nb.inv().apply([0, 0, -G]))
        H, R = np.vstack((H, gravity_rows(r_nb))), [*R, *[1.962361] * 3]
    want_r, want_b, want_P = dense_update(P1, q, b, z, H, np.diag(R))
    w = feed(flt, x, P, dt, rate, acc, mag)
    same(x, P, want_r, want_b, (want_P, q), atol=2e-8)
    used = (w[m.D_ACC + 6], w[mm.W_COURSE + 6])
    assert used == ((s.NOT_MEASURED, s.ACCEPTED) if mode == 1 else (s.ACCEPTED, s.NOT_MEASURED))
    assert x[m.GNSS] == 0.0


def fix(x, t, v_n, v_e):
    x[m.GNSS] = 1.0
    x[m.GNSS + 1 : m.GNSS + 15] = np.nan
    x[m.GNSS + 1] = t
    x[m.GNSS + 5], x[m.GNSS + 6] = v_n, v_e


def flying(**parameters):
    flt = MultiModeAhrs(mag_reference=(2.4e-5, 3.9e-5), fix_timeout=0.31, **parameters)
    x, P = start(flt, [1.0, 0, 0, 0])
    return flt, x, P


def modes(flt, x, P, fixes, n=60):
    """Which samples were corrected by the accelerometer; fixes by sample number."""
    used, outage = [], []
    for i in range(1, n + 1):
        if i in fixes:
            fix(x, i * 0.02, *fixes[i])
        w = feed(flt, x, P, i * 0.02, np.zeros(3), [0, 0, -G], [2.4e-5, 0, 3.9e-5])
        used += [i] if w[m.D_ACC + 6] != s.NOT_MEASURED else []
        outage += [i] if int(x[m.STATUS]) & s.OUTAGE else []
    return used, outage


def test_gravity_counts_from_the_loss_of_gps_to_its_return():
    """Fixes up to sample 20, lost 0.32 s later, one again at sample 45."""
    flt, x, P = flying()
    used, outage = modes(flt, x, P, {i: (9.0, 0.0) for i in [*range(4, 21, 2), *range(45, 61, 2)]})
    assert used == [2, 36, 38, 40, 42, 44]
    assert outage == list(range(36, 45))


@pytest.mark.parametrize("lost", [(np.nan, np.nan), (1.0, 1.0)])
def test_a_fix_without_a_course_switches_at_once(lost):
    flt, x, P = flying()
    used, outage = modes(flt, x, P, {2: (9.0, 0.0), 6: (9.0, 0.0), 8: lost}, 14)
    assert used == [8, 10, 12, 14]
    assert outage == list(range(8, 15))


def test_without_a_field_gravity_counts_although_there_is_gps():
    flt, x, P = flying(use_mag=False)
    used, _ = modes(flt, x, P, {i: (9.0, 0.0) for i in range(2, 41, 2)}, 40)
    assert used == list(range(2, 41, 2))


def test_a_late_course_is_compared_with_the_yaw_of_its_time():
    """Turning at 1 rad/s about a banked axis, the fix is 0.1 s old."""
    flt, x, P = flying(gate=np.inf)
    bank = Rotation.from_euler("X", 0.4)
    x[m.Q : m.Q + 4] = scalar_first(bank)
    rate = bank.inv().apply([0.0, 0.0, 1.0])
    fix(x, -0.08, 9.0 * np.cos(-0.08), 9.0 * np.sin(-0.08))
    w = feed(flt, x, P, 0.02, rate, NO_ACC)
    assert w[mm.W_COURSE] == pytest.approx(0.0, abs=1e-12)


def test_where_there_is_no_field_the_first_course_is_the_heading():
    flt = MultiModeAhrs()
    state = flt.init()
    x, P = state.x, state.P
    tilted = Rotation.from_euler("ZYX", [0.0, 0.1, -0.2])
    feed(flt, x, P, 0.0, np.zeros(3), tilted.inv().apply([0, 0, -G]))
    fix(x, 0.02, 0.0, -9.0)
    feed(flt, x, P, 0.02, np.zeros(3), NO_ACC)
    want = Rotation.from_euler("ZYX", [-np.pi / 2, 0.1, -0.2])
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-12
    assert x[m.STD_ATT + 2] == pytest.approx(flt.std_heading)


def test_reference_is_the_mean_of_the_first_fields_and_kept():
    """Of 0.19 s; meanwhile the heading of the field corrects, and gravity in spite of GPS."""
    flt = MultiModeAhrs(
        learn_time=0.19, gate=np.inf, reject_disturbed=False, gyr_noise=1e-9,
        gyr_bias_noise=(0.0, 0.0, 0.0),
    )  # fmt: skip
    x, P = start(flt, scalar_first(TURNED))
    P[:] = 1e-12 * P  # attitude does not move
    rng, fields = np.random.default_rng(1), []
    for i in range(1, 16):
        field_n = np.array([2e-5, 0.0, 4e-5]) + 1e-6 * rng.standard_normal(3)
        fields.append([np.hypot(*field_n[:2]), field_n[2]])
        fix(x, 0.04 * i, 9 * np.cos(2.1), 9 * np.sin(2.1))
        w = feed(flt, x, P, 0.04 * i, np.zeros(3), TURNED.inv().apply([0, 0, -G]),
                 TURNED.inv().apply(field_n))  # fmt: skip
        kept = min(i, 5)  # the first one starts the clock
        np.testing.assert_allclose(
            x[[mm.REF_H, mm.REF_D]], np.mean(fields[:kept], axis=0), rtol=1e-4
        )
        assert np.isnan(w[m.D_MAG + 1]) == (i < 6)  # one component, then three
        assert (w[m.D_ACC + 6] == s.ACCEPTED) == (i < 6)
    z = w[m.D_MAG : m.D_MAG + 3]
    want = TURNED.inv().apply(field_n - [*np.array([1.0, 0.0]) * x[mm.REF_H], x[mm.REF_D]])
    np.testing.assert_allclose(z, want, atol=1e-8)


def test_heading_counts_while_the_reference_is_learned():
    """The innovation is that of the standard filter, its variance that of the field."""
    flt = MultiModeAhrs(gate=np.inf, reject_disturbed=False)
    x, P = start(flt, scalar_first(TURNED))
    before = quat(x)
    turned = Rotation.from_euler("Z", 0.1) * TURNED
    w = feed(flt, x, P, 0.04, np.zeros(3), NO_ACC, turned.inv().apply([2e-5, 0, 4e-5]))
    assert w[m.D_MAG] == pytest.approx(0.1, abs=1e-6)
    assert w[m.D_MAG + 3] > np.sqrt(7e-5) * 1e-4 / 2e-5
    moved = (rotation(quat(x)) * rotation(before).inv()).as_rotvec()
    assert moved[2] > 0.01


def test_reference_may_be_the_first_field_alone():
    flt = MultiModeAhrs(learn_time=0.0)
    x, P = start(flt, scalar_first(TURNED))
    for i, size in ((1, 1.0), (2, 1.05)):
        feed(flt, x, P, 0.04 * i, np.zeros(3), NO_ACC, TURNED.inv().apply([size * 2e-5, 0, 4e-5]))
        np.testing.assert_allclose(x[[mm.REF_H, mm.REF_D]], [2e-5, 4e-5], rtol=1e-9)
    x, P = start(flt, [1.0, 0, 0, 0])
    feed(flt, x, P, 0.04, np.zeros(3), NO_ACC, [0.0, 0.0, 5e-5])
    assert x[mm.REF_H] == 0.0  # a vertical field tells no heading


def test_gate_bounds_the_pull_of_field_and_course_but_not_of_gravity():
    """A course far off moves the state no more than one at the gate; a force has no gate."""
    found = []
    for yaw in (0.5, 2.5):
        flt, x, P = flying(gate=3.0)
        P[:] = seven(1e-4 * np.eye(6), quat(x))
        fix(x, 0.02, 9.0 * np.cos(yaw), 9.0 * np.sin(yaw))
        w = feed(flt, x, P, 0.02, np.zeros(3), NO_ACC)
        assert w[mm.W_COURSE + 6] == s.REJECTED_GATE
        assert int(x[m.STATUS]) & s.AIDING_REJECTED
        found.append(rotation(quat(x)).magnitude())
    assert 0.0 < found[1] < found[0]
    for bad, flag, sensor in (
        ([2.4e-5, 3e-5, 3.9e-5], s.MAG_REJECTED, m.D_MAG),
        (np.empty(0), 0, m.D_ACC),
    ):
        flt, x, P = flying(gate=3.0, reject_disturbed=False)
        P[:] = seven(1e-4 * np.eye(6), quat(x))
        w = feed(flt, x, P, 0.04, np.zeros(3), [50.0, 0.0, -G], bad)
        assert w[sensor + 6] == (s.REJECTED_GATE if flag else s.ACCEPTED)
        assert int(x[m.STATUS]) & s.MAG_REJECTED == flag
