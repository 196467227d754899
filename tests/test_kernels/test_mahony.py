"""The Mahony kernel against closed forms of its error dynamics."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation
from truth.kernel_step import bias, feed, quat, rotation, scalar_first, start, unit
from truth.rotations import random_quats

from strapdown.attitude import Mahony
from strapdown.kernels import memory as m

G = 9.80665
FIELD_N = np.array([2e-5, 0.0, 3e-5])
NONE = np.empty(0)


def errors(flt, r_nb, error_n, gyr_bias=(0, 0, 0), n=200, dt=0.01, field=None):
    """Rotation vectors in n that bring the estimate to the truth; the box rests."""
    x, P = start(flt, scalar_first(Rotation.from_rotvec(error_n).inv() * r_nb))
    acc = r_nb.inv().apply([0, 0, -G])
    mag = NONE if field is None else r_nb.inv().apply(field)
    out = [np.asarray(error_n, dtype=float)]
    for k in range(1, n + 1):
        feed(flt, x, P, k * dt, gyr_bias, acc, mag)
        out.append((r_nb * rotation(quat(x)).inv()).as_rotvec())
    return np.array(out), x


def test_one_step_follows_the_equations_of_the_filter():
    """Rate plus kp times the error less bias, which integrates -ki times the error.

    The error: gravity's cross product, and the sine of the heading's error about down.
    """
    rng = np.random.default_rng(1)
    flt, dt, rate = Mahony(kp=0.7, ki=0.3, limit=np.inf), 0.02, np.array([0.5, -0.8, 1.3])
    for q in random_quats(10, seed=3):
        acc, mag = 9 * unit(rng.standard_normal(3)), unit(rng.standard_normal(3))
        b0 = np.array([0.02, -0.01, 0.03])
        x, P = start(flt, q, b0)
        w = feed(flt, x, P, dt, rate, acc, mag)
        to_b = rotation(q).inv()
        h = rotation(q).apply(mag)
        field = to_b.apply([np.hypot(h[0], h[1]), 0.0, h[2]])
        down = to_b.apply([0, 0, 1])
        heading = np.arctan2(h[1], h[0])
        error = np.cross(-unit(acc), down) - np.sin(heading) * down
        b1 = b0 - 0.3 * error * dt
        want = rotation(q) * Rotation.from_rotvec((rate - b1 + 0.7 * error) * dt)
        np.testing.assert_allclose(bias(x), b1, atol=1e-15)
        assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-14
        np.testing.assert_allclose(w[m.D_ACC : m.D_ACC + 3], -unit(acc) - down, atol=1e-15)
        np.testing.assert_allclose(w[m.D_MAG : m.D_MAG + 3], mag - field, atol=1e-15)


@pytest.mark.parametrize("kp", [0.5, 2.0])
def test_tilt_error_decays_as_exp_minus_kp_t(kp):
    error_n = np.array([0.01, -0.02, 0.0])
    r_nb = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])
    got, _ = errors(Mahony(kp=kp, ki=0.0), r_nb, error_n)
    t = 0.01 * np.arange(len(got))
    # a step shrinks by 1 - kp dt, not exp(-kp dt): kp^2 dt t / 2 relative; sine: 1e-4
    rtol = 0.5 * kp**2 * 0.01 * 2.0 + 2e-4
    np.testing.assert_allclose(got[:, :2], np.exp(-kp * t)[:, None] * error_n[:2], rtol=rtol)
    np.testing.assert_allclose(got[:, 2], 0.0, atol=1e-4)  # second order of the error


@pytest.mark.parametrize("limit", [0.05, 0.2])
def test_large_tilt_errors_decay_at_a_limited_rate(limit):
    r_nb = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])
    got, _ = errors(Mahony(kp=2.0, ki=0.0, limit=limit), r_nb, [0.6, 0.0, 0.0], n=100)
    # 1 s at kp * limit, all of it beyond the limit; round-off
    np.testing.assert_allclose(got[-1], [0.6 - 2.0 * limit, 0.0, 0.0], atol=1e-12)


def test_heading_decays_as_tilt_does_whatever_the_dip():
    """And an error of heading leaves the tilt alone; one of tilt shows in the observed heading.

    With the unit field (c, 0, s) the observed heading is off by ``phi_d - phi_n s / c``.
    """
    error_n, kp = np.array([0.01, -0.005, 0.02]), 2.0
    r_nb = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])
    for field in (FIELD_N, np.array([1e-5, 0.0, 4.5e-5])):
        c, _, s = unit(field)
        matrix = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-s / c, 0.0, 1.0]])
        for k in (50, 100, 200):
            got, _ = errors(Mahony(kp=kp, ki=0.0), r_nb, error_n, n=k, field=field)
            want = expm(-kp * 0.01 * k * matrix) @ error_n
            # steps of 10 ms: kp^2 dt t / 2 relative; second order of the errors: 6e-4
            np.testing.assert_allclose(got[-1], want, atol=1.2e-3)


def test_gravity_alone_leaves_the_heading():
    r_nb = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])
    got, _ = errors(Mahony(kp=2.0, ki=0.0), r_nb, [0, 0, 0.5])
    np.testing.assert_allclose(got, np.tile([0, 0, 0.5], (len(got), 1)), atol=1e-14)


def test_bias_is_found_and_its_error_leaves():
    """kp = 1, ki = 0.1: s^2 + s + 0.1, slowest pole -0.113, so 180 s leave 1.5e-9 of it."""
    r_nb = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])
    b = np.array([0.02, -0.03, 0.01])
    got, x = errors(Mahony(kp=1.0, ki=0.1), r_nb, [0, 0, 0], b, n=3600, dt=0.05, field=FIELD_N)
    np.testing.assert_allclose(bias(x), b, atol=3e-8)
    np.testing.assert_allclose(got[-1], 0.0, atol=3e-7)
    assert np.abs(got).max() > 0.01  # else there was nothing to find


@pytest.mark.parametrize("declination", [0.0, 0.5])
def test_declination_turns_the_heading_that_it_settles_at(declination):
    r_nb = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])  # b to magnetic north
    flt = Mahony(kp=2.0, ki=0.0, declination=declination)
    got, _ = errors(flt, r_nb, [0, 0, 0.1], n=3000, dt=0.02, field=FIELD_N)
    # 60 s at kp = 2 leave exp(-120)
    np.testing.assert_allclose(got[-1], [0, 0, -declination], atol=1e-8)


def test_without_vectors_it_only_integrates():
    flt, rate = Mahony(kp=0.7, ki=0.3), np.array([0.5, -0.8, 1.3])
    r_nb = Rotation.from_euler("ZYX", [1.0, -0.4, 2.5])
    x, P = start(flt, scalar_first(r_nb), [0.02, -0.01, 0.03])
    feed(flt, x, P, 0.02, rate, np.full(3, np.inf))
    want = r_nb * Rotation.from_rotvec((rate - [0.02, -0.01, 0.03]) * 0.02)
    assert (rotation(quat(x)) * want.inv()).magnitude() < 1e-14
    assert np.array_equal(bias(x), [0.02, -0.01, 0.03])
