"""Rows and transition of the GNSS/INS filter against central differences on the manifold."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.kernels.ins import covariance, field, gnss, mechanise, vehicle
from strapdown.kernels.ins import layout as k
from strapdown.kernels.memory import MAG
from strapdown.navigation import LooselyCoupled
from strapdown.navigation.loosely_coupled import STATES

FLT = LooselyCoupled(states=STATES)
P_VEC = FLT._params()
N, M = int(P_VEC[k.N]), int(P_VEC[k.M])
EPS = 1e-6


def quat(rng):
    q = rng.standard_normal(4)
    return q / np.linalg.norm(q)


def memory(seed):
    """A state far from the origin of everything."""
    rng = np.random.default_rng(seed)
    x, _ = FLT._memory()
    x[0] = 100.0
    x[k.Q : k.Q + 4], x[k.QVB : k.QVB + 4] = quat(rng), quat(rng)
    x[k.LLA : k.LLA + 3] = rng.uniform(-1.2, 1.2), rng.uniform(-3, 3), rng.uniform(0, 3000)
    x[k.V : k.V + 3] = rng.uniform(-20, 20, 3)
    x[k.BG : k.BG + 3], x[k.BA : k.BA + 3] = rng.uniform(-0.01, 0.01, (2, 3))
    x[k.SG : k.SG + 3], x[k.SA : k.SA + 3] = rng.uniform(-1e-4, 1e-4, (2, 3))
    x[k.ARM_V], x[k.DELAY] = -1.5, 0.05
    x[k.ARM_A : k.ARM_A + 3] = rng.uniform(-1, 1, 3)
    x[k.BP : k.BP + 3] = rng.uniform(-1, 1, 3)
    x[k.BR : k.BR + 3], x[k.BV : k.BV + 3] = rng.uniform(-0.1, 0.1, (2, 3))
    x[k.SODO], x[k.BARO] = 0.02, 30.0
    x[k.IRON : k.IRON + 3] = rng.uniform(-3e-5, 3e-5, 3)
    x[k.DECLINATION] = 0.1
    x[MAG : MAG + 4] = 1.0, 3e-5, -2e-5, 4e-5
    x[k.ACC_N : k.ACC_N + 3] = rng.uniform(-2, 2, 3)
    x[k.RATE : k.RATE + 3] = rng.uniform(-0.5, 0.5, 3)
    mechanise.earth_terms(x)
    return x


def scratch():
    return np.zeros(k.TAPE)


def moved(x, i, eps):
    """The state with error-state component `i` added."""
    x, w = x.copy(), scratch()
    w[k.DX + i] = eps
    covariance.apply(x, P_VEC, w, k.DX)
    return x


def numeric_row(x, predicted):
    row = np.empty(N)
    for i in range(N):
        # position enters linearly, and a millionth of a metre is lost in the radians
        eps = 1.0 if k.DP <= i < k.DP + 3 else EPS
        row[i] = (predicted(moved(x, i, eps)) - predicted(moved(x, i, -eps))) / (2 * eps)
    return row


def close(analytic, numeric):
    # central differences of double precision: eps^2 and round-off / eps, of numbers up to 100
    np.testing.assert_allclose(analytic, numeric, atol=2e-6)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", range(3))
def test_position_row_is_the_derivative_of_the_predicted_fix(seed, axis):
    x = memory(seed)
    at = x[k.LLA : k.LLA + 3].copy()
    radii = x[k.R_N], x[k.R_E], -1.0
    age = 0.03

    def predicted(y):
        expected = gnss.position_row(y, P_VEC, scratch(), axis, age + y[k.DELAY])
        return (y[k.LLA + axis] - at[axis]) * radii[axis] + expected

    w = scratch()
    gnss.position_row(x, P_VEC, w, axis, age + x[k.DELAY])
    numeric = numeric_row(x, predicted)
    # the acceleration's part of the delay, a few millimetres, is left out of the row
    i = int(P_VEC[k.I_DELAY])
    assert abs(w[k.H + i] - numeric[i]) < 0.08 * 2.0 + 0.2  # of 2 m/s^2; b_r and b_v
    numeric[i] = w[k.H + i]
    close(w[k.H : k.H + N], numeric)


@pytest.mark.parametrize("seed", range(4))
def test_field_row_is_the_derivative_of_the_field_across_north(seed):
    x = memory(seed)
    w = scratch()
    field.field_row(x, P_VEC, w)
    # the row adds up to what is missing: minus the field across north that is seen
    numeric = numeric_row(x, lambda y: -field.field_row(y, P_VEC, scratch()))
    # iron enters times one: 1e-9 T of round-off over the step; angles times 1e-5 T
    np.testing.assert_allclose(w[k.H : k.H + N], numeric, atol=1e-9)
    i = int(P_VEC[k.I_MAG])
    assert np.abs(numeric[i : i + 3]).max() > 0.3
    assert abs(numeric[k.PHI + 2]) > 1e-6


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", range(3))
def test_velocity_row_is_the_derivative_of_the_predicted_velocity(seed, axis):
    x = memory(seed)

    def predicted(y):
        expected = gnss.velocity_row(y, P_VEC, scratch(), axis, 0.03 + y[k.DELAY])
        return y[k.V + axis] + expected

    w = scratch()
    gnss.velocity_row(x, P_VEC, w, axis, 0.03 + x[k.DELAY])
    close(w[k.H : k.H + N], numeric_row(x, predicted))


def dcm(q):
    w, a, b, c = q
    return np.array(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("axis", range(3))
def test_vehicle_row_is_the_derivative_of_the_velocity_at_the_constraint_point(seed, axis):
    x = memory(seed)
    # the rate in vehicle axes turns the arm; its own error is left out of the row
    w_v = dcm(x[k.QVB : k.QVB + 4]) @ x[k.RATE : k.RATE + 3]

    def predicted(y):
        C_vn = dcm(y[k.QVB : k.QVB + 4]) @ dcm(y[k.Q : k.Q + 4]).T
        arm = np.cross(w_v, [y[k.ARM_V], 0.0, 0.0])
        return (C_vn @ y[k.V : k.V + 3] + arm)[axis]

    C_vn = dcm(x[k.QVB : k.QVB + 4]) @ dcm(x[k.Q : k.Q + 4]).T
    v = C_vn @ x[k.V : k.V + 3]
    w = scratch()
    arm = (0.0, w_v[2], -w_v[1])[axis]
    vehicle.velocity_row(x, P_VEC, w, *C_vn[axis], axis, *v, arm)
    close(w[k.H : k.H + N], numeric_row(x, predicted))
    vx, vy, vz = vehicle.velocity(x)[:3]
    moved_v = v + np.cross(w_v, [x[k.ARM_V], 0.0, 0.0])
    np.testing.assert_allclose((vx, vy, vz), moved_v, atol=1e-12)


def propagate(x, samples, dt):
    x = x.copy()
    for gyr, acc in samples:
        mechanise.advance(x, dt, *gyr, *acc)
    return x


def difference(a, b):
    """Error state that leads from b to a."""
    D = dcm(a[k.Q : k.Q + 4]) @ dcm(b[k.Q : k.Q + 4]).T
    phi = 0.5 * np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    dv = a[k.V : k.V + 3] - b[k.V : k.V + 3]
    d = a[k.LLA : k.LLA + 3] - b[k.LLA : k.LLA + 3]
    return np.concatenate((phi, dv, (d[0] * b[k.R_N], d[1] * b[k.R_E], -d[2])))


@pytest.mark.parametrize("seed", range(3))
def test_transition_over_a_tick_is_the_derivative_of_the_mechanisation(seed):
    rng = np.random.default_rng(seed)
    x = memory(seed)
    for i in range(k.N_SUMS):
        x[k.DT + i] = 0.0
    dt = 0.01
    samples = [
        (rng.uniform(-0.3, 0.3, 3), rng.uniform(-3, 3, 3) + (0, 0, -9.8)) for _ in range(10)
    ]
    numeric = np.empty((9, M))
    for i in range(M):
        # position and accelerometer bias enter linearly, and would be lost in the radians
        eps = 100.0 if k.DP <= i < k.DP + 3 else 1e-3 if k.DBA <= i < k.DBA + 3 else 1e-5
        up = propagate(moved(x, i, eps), samples, dt)
        down = propagate(moved(x, i, -eps), samples, dt)
        numeric[:, i] = difference(up, down) / (2 * eps)
    end = propagate(x, samples, dt)
    w = scratch()
    covariance.transition(end, P_VEC, w)
    analytic = w[k.F : k.F + 9 * M].reshape(9, M) + np.eye(9, M)
    # attitude and velocity from attitude and accelerometer bias are exact up to the turn within
    # the tick; position takes half a tick of the mean force, which here changes by 6 m/s^2 from
    # sample to sample: (0.1 s)^2 * 6 / 12
    tolerance = np.full((9, M), 2e-4)
    tolerance[:3, :3] = 1e-6  # a seventh of what the Earth turns in the tick
    tolerance[6:, :3] = 5e-3
    # velocity from gyro bias: half of the product of the two sums; position leaves it out
    tolerance[3:, k.DBG : k.DBG + 3] = 5e-3
    # scale errors: velocity from gyro scale is that times 0.3 rad/s; position from accelerometer
    # scale, (0.1 s)^2 g / 2, is left out, being a tenth of a millimetre at 0.2 %
    tolerance[3:, k.CORE : k.CORE + 3] = 5e-3
    tolerance[6:, k.CORE + 3 : k.CORE + 6] = 0.06
    np.testing.assert_array_less(np.abs(analytic - numeric), tolerance)
    assert np.abs(numeric[3:6, :3]).max() > 0.5  # it is not compared at zero


@pytest.mark.parametrize("cell", [k.PHI + 2, k.DV, k.DP + 1, k.DBA])
def test_a_scalar_measurement_is_the_textbook_update(cell):
    rng = np.random.default_rng(1)
    A = rng.standard_normal((N, N))
    P = A @ A.T + np.eye(N)
    want = P.copy()
    w = scratch()
    w[k.H : k.H + N] = rng.standard_normal(N) * (rng.random(N) < 0.3)
    w[k.H + cell] = 1.3
    h, r, y = w[k.H : k.H + N].copy(), 0.7, 2.0
    covariance.project(P, P_VEC, w)
    covariance.absorb(P, P_VEC, w, y, r)
    s = h @ want @ h + r
    gain = want @ h / s
    np.testing.assert_allclose(w[k.DX : k.DX + N], gain * y, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(P, want - np.outer(gain, gain) * s, atol=1e-10)
    np.testing.assert_array_equal(P, P.T)


@pytest.mark.parametrize("seed", range(4))
def test_a_mount_that_was_found_is_off_by_what_the_attitude_is_off(seed):
    """Vehicle axes from the course: ``q_vb = conj(q_nv) q_nb``, an error of one is the other's."""
    x = memory(seed)
    rng = np.random.default_rng(seed)
    root = 0.02 * rng.standard_normal((N, N))
    P = root @ root.T
    before = P.copy()
    vehicle.tie_mount(x, P, P_VEC, scratch())
    m = int(P_VEC[k.I_MOUNT])
    q_vb, q_nb = (Rotation.from_quat(x[i : i + 4][[1, 2, 3, 0]]) for i in (k.QVB, k.Q))
    C_vn = (q_vb * q_nb.inv()).as_matrix()
    others = [i for i in range(N) if not m <= i < m + 3]
    # a prior of 3 rad where there is none: 1 / 900 of the variance goes missing
    scale = np.abs(before).max()
    np.testing.assert_allclose(
        P[np.ix_(others, others)], before[np.ix_(others, others)], atol=1e-2 * scale
    )
    tied = C_vn @ before[:3]
    np.testing.assert_allclose(P[m : m + 3][:, others], tied[:, others], atol=1e-2 * scale)
    own = C_vn @ before[:3, :3] @ C_vn.T + FLT.std_mount**2 * np.eye(3)
    np.testing.assert_allclose(P[m : m + 3, m : m + 3], own, atol=1e-2 * scale)
    assert np.abs(tied[:, :3]).max() > 0.1 * scale
