"""The standard AHRS's kernel: the levelled field, gravity and then heading with dense matrices."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from truth.kernel_step import feed, quat, rotation, scalar_first
from truth.sphere import (
    FIELD_N,
    NO_ACC,
    TURNED,
    TURNS,
    G,
    along,
    begun,
    carried,
    dense_update,
    gravity_rows,
    predicted,
    row,
    same,
    seven,
    tangent,
)

from strapdown.attitude import StandardAhrs
from strapdown.kernels import memory as m
from strapdown.kernels import standard_ahrs as st
from strapdown.kernels import status as s


@pytest.mark.parametrize("r_nb", TURNS)
def test_row_of_the_levelled_heading_agrees_with_central_differences_on_the_sphere(r_nb):
    """The measured field stays, what levels it moves: minus the slope of the innovation."""
    flt = StandardAhrs(declination=0.3)
    x, _ = begun(flt, r_nb=r_nb)
    field = r_nb.inv().apply([2e-5 * np.cos(0.3), 2e-5 * np.sin(0.3), 3e-5])
    x[m.MAG + 1 : m.MAG + 4] = field

    def left(r):
        h = r.apply(field)
        return np.array([np.angle(np.exp(1j * (0.3 - np.arctan2(h[1], h[0]))))])

    w = np.zeros(st.W_SIZE)
    st.levelled_row(x, flt._params(), w)
    np.testing.assert_allclose(row(w) @ tangent(quat(x)), -along(left, r_nb)[0], atol=1e-7)
    seen = row(w)
    # noise of the heading is no part of the row
    turned = Rotation.from_euler("Z", 0.2) * r_nb
    x[m.MAG + 1 : m.MAG + 4] = r_nb.inv().apply(turned.apply(field))
    st.levelled_row(x, flt._params(), w)
    np.testing.assert_allclose(row(w), seen, atol=1e-14)
    assert st.heading_left(x, flt._params()) == pytest.approx(-0.2, abs=1e-12)


def test_heading_levelled_as_before_is_the_compass_of_the_source():
    """(2.43) to (2.45) with other angles than the estimate's."""
    flt = StandardAhrs(declination=0.3, levelling="before")
    x, _ = begun(flt)
    roll, pitch = 0.4, -0.2
    x[st.ROLL], x[st.PITCH] = roll, pitch
    truth = Rotation.from_euler("ZYX", [-2.0, pitch, roll])
    x[m.MAG + 1 : m.MAG + 4] = truth.inv().apply([2e-5, 0.0, 4e-5])
    yaw = TURNED.as_euler("ZYX")[0]
    want = np.angle(np.exp(1j * (-2.0 + 0.3 - yaw)))
    assert st.heading_left(x, flt._params()) == pytest.approx(want, abs=1e-12)


def test_tilt_is_kept_for_the_step_after():
    flt = StandardAhrs(levelling="before")
    x, P = begun(flt)
    feed(flt, x, P, 0.02, [0.5, -0.3, 0.8], NO_ACC)
    _, pitch, roll = rotation(quat(x)).as_euler("ZYX")
    np.testing.assert_allclose(x[[st.ROLL, st.PITCH]], [roll, pitch], atol=1e-14)


def test_standard_corrects_by_gravity_and_then_by_heading():
    flt = StandardAhrs(declination=0.1, mag_rate=25.0, gate=np.inf)
    b0, rate, dt = np.array([0.02, -0.01, 0.03]), np.array([0.5, -0.8, 1.3]), 0.04
    x, P = begun(flt, b0, seed=8)
    off = TURNED * Rotation.from_rotvec([0.05, -0.02, 0.03])
    acc, mag = off.inv().apply([0.1, 0.2, -G]), off.inv().apply(FIELD_N)
    q, b, P1 = predicted(flt, x, P, rate, dt)
    z = acc - rotation(q).inv().apply([0, 0, -G])
    r_acc, r_mag = 1.962361, 0.014924 * 2.5  # printed, at 25 Hz; the heading's for 10 Hz
    r1, b, P1 = dense_update(P1, q, b, z, gravity_rows(rotation(q)), r_acc * np.eye(3))

    def left(r):
        h = r.apply(mag)
        return np.array([np.angle(np.exp(1j * (0.1 - np.arctan2(h[1], h[0]))))])

    def expected(r):
        """The field as it is seen by r1 if its heading is as predicted, levelled by r."""
        h = r1.apply(mag)
        h = np.array([np.hypot(*h[:2]) * np.cos(0.1), np.hypot(*h[:2]) * np.sin(0.1), h[2]])
        h = r.apply(r1.inv().apply(h))
        return np.array([np.angle(np.exp(1j * (0.1 - np.arctan2(h[1], h[0]))))])

    q1 = scalar_first(r1)
    turn = carried(P1, q, q1)
    H = -along(expected, r1) @ (4.0 * tangent(q1).T)
    r2, b, P2 = dense_update(turn, q1, b, left(r1), H, np.array([[r_mag]]))
    w = feed(flt, x, P, dt, rate, acc, mag)
    same(x, P, r2, b, (P2, q1))
    assert w[m.D_ACC + 6] == w[m.D_MAG + 6] == s.ACCEPTED
    np.testing.assert_allclose(w[m.D_MAG], left(r1)[0], atol=1e-9)


def test_gate_bounds_the_pull_of_a_heading():
    flt = StandardAhrs(gate=3.0)
    x, P = begun(flt, r_nb=Rotation.identity())
    P[:] = seven(1e-4 * np.eye(6), quat(x))
    w = feed(flt, x, P, 0.02, np.zeros(3), NO_ACC, [-2.4e-5, 0.0, 3.9e-5])
    assert w[m.D_MAG + 6] == s.REJECTED_GATE
