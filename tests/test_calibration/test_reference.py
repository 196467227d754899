"""Twelve parameters against a reference, encoder rates, and the thesis's printed matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from truth import triads as truth
from truth.triads import DPS, G

from strapdown import calibration as cal
from strapdown.calibration.reference import NAMES
from strapdown.errors import InputError

# Scibona 2015, (6.17), (6.20), (6.23).
C_GYRO = np.array(
    [
        [0.9822, -0.0003, -0.0072, 0.0188],
        [-0.0021, 0.9836, 0.0143, -0.0680],
        [0.0093, 0.0039, 1.0002, 0.0028],
    ]
)
C_ACC = np.array(
    [
        [0.9941, 0.0025, -0.0123, -0.0163],
        [0.0015, 0.9896, 0.0000, 0.0404],
        [0.0073, -0.0035, 0.9673, -0.0875],
    ]
)
C_MAG = np.array(
    [
        [0.9875, -0.0168, -0.1961, -0.0280],
        [-0.0290, 1.0277, -0.0307, 0.0161],
        [-0.0980, -0.0001, 1.0425, -0.0170],
    ]
)
# Parameters derived from them by hand: k, then a_yz, a_zy, a_xz, a_zx, a_xy, a_yx in degrees,
# then the bias in deg/s, g and gauss.
RECOVERED = {
    "gyro": (C_GYRO, 1.0 / DPS, [1.01812, 1.01667, 0.99980],
             [0.017, -0.412, -0.123, -0.819, -0.543, 0.227], [-1.0967, 3.9611, -0.1656]),
    "acc": (C_ACC, 1.0, [1.00594, 1.01051, 1.03381],
            [-0.145, -0.729, 0.086, 0.000, -0.421, -0.203], [0.01762, -0.04085, 0.09018]),
    "mag": (C_MAG, 1.0, [1.01266, 0.97305, 0.95923],
            [0.937, -10.778, -1.683, 1.687, 5.686, -0.006], [0.03195, -0.01419, 0.01931]),
}  # fmt: skip


def raw_of(C, B):
    """Output whose correction by the 3 x 4 matrix C is B."""
    return np.linalg.solve(C[:, :3], (B - C[:, 3]).T).T


@pytest.mark.parametrize("sensor", RECOVERED)
def test_physical_parameters_of_the_printed_matrices(sensor):
    C, unit, k, angles, bias = RECOVERED[sensor]
    b = -np.linalg.solve(C[:, :3], C[:, 3])
    found = cal.physical_parameters(C[:, :3], b)
    # Half of the last digit written down.
    assert_allclose(found[:3], k, atol=5e-6)
    assert_allclose(found[3:6] * unit, bias, atol=5e-5)
    assert_allclose(np.degrees(found[6:]), angles, atol=5e-4)


def test_physical_parameters_and_correction_are_inverse():
    b = np.array([0.1, -0.2, 0.3])
    matrix, bias = cal.correction_from_physical(cal.physical_parameters(C_MAG[:, :3], b))
    assert_allclose(matrix, C_MAG[:, :3], atol=1e-15)
    assert_allclose(bias, b)


def test_small_rotation_of_a_sense_axis_has_the_sign_of_its_name():
    # The y sense axis turned by 1 mrad about z points to -x: it reads -1e-3 of x.
    y_axis = Rotation.from_rotvec([0, 0, 1e-3]).apply([0.0, 1.0, 0.0])
    response = np.vstack(([1, 0, 0], y_axis, [0, 0, 1]))  # y = response @ B
    found = dict(
        zip(NAMES, cal.physical_parameters(np.linalg.inv(response), np.zeros(3)), strict=True)
    )
    # B = T y: row x of T is (1, -a_yz, a_zy) and takes back nothing of y here, row y adds x.
    assert found["a_xz"] == pytest.approx(1e-3, rel=1e-5)
    assert found["a_yz"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("noise_in", ["samples", "reference"])
@pytest.mark.parametrize("C", [C_GYRO, C_ACC, C_MAG], ids=["gyr", "acc", "mag"])
def test_exact_samples_give_the_exact_matrix(C, noise_in):
    B = truth.directions(50)
    record = cal.against_reference("acc", raw_of(C, B), B, noise_in=noise_in)
    assert_allclose(record.matrix, C[:, :3], atol=1e-13)
    assert_allclose(-record.matrix @ record.bias, C[:, 3], atol=1e-13)
    assert record.dof == 150 - 12


def test_scale_of_the_accelerometer_z_is_out_of_tolerance_as_in_the_thesis():
    B = G * truth.directions(60)
    C = C_ACC * [1, 1, 1, G]
    record = cal.against_reference("acc", raw_of(C, B), B)
    assert record["k_z"].verdict is cal.Verdict.OUTSIDE
    assert record["k_x"].verdict is cal.Verdict.WITHIN
    assert record["k_y"].verdict is cal.Verdict.WITHIN
    gyro = cal.against_reference("gyr", raw_of(C_GYRO, B), B)
    assert gyro.verdict is cal.Verdict.WITHIN
    mag = cal.against_reference("mag", raw_of(C_MAG, B), B)
    assert mag.verdict is cal.Verdict.WITHIN


def test_sigma_is_honest_over_many_draws():
    true = cal.physical_parameters(C_GYRO[:, :3], -np.linalg.solve(C_GYRO[:, :3], C_GYRO[:, 3]))
    nees = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        B = 0.3 * rng.standard_normal((200, 3))
        y = raw_of(C_GYRO, B) + 0.02 * rng.standard_normal((200, 3))
        record = cal.against_reference("gyr", y, B)
        e = np.array([p.value for p in record.parameters]) - true
        nees.append(e @ np.linalg.solve(record.covariance, e))
    # Chi-square of 12: mean 12, standard deviation of the mean of 60 draws 0.63.
    assert 10.1 < np.mean(nees) < 13.9


def test_regression_of_the_reference_shrinks_by_noise_over_signal_and_the_default_does_not():
    rng = np.random.default_rng(0)
    B = 0.1 * rng.standard_normal((20_000, 3))
    y = B + 0.05 * rng.standard_normal(B.shape)
    thesis = cal.against_reference("gyr", y, B, noise_in="reference")
    default = cal.against_reference("gyr", y, B)
    # 1 / (1 + noise^2 / signal^2) = 0.8; three standard deviations of 20000 samples.
    assert_allclose(np.diag(thesis.matrix), 0.8, atol=0.01)
    assert_allclose(np.diag(default.matrix), 1.0, atol=0.012)


def test_figures_before_and_after_are_per_axis():
    rng = np.random.default_rng(0)
    B = 0.3 * rng.standard_normal((2000, 3))
    y = raw_of(C_GYRO, B) + 0.002 * rng.standard_normal(B.shape)
    q = cal.against_reference("gyr", y, B).quality
    # The bias of y, 3.96 deg/s, dominates before; the noise remains after.
    assert q["rms_before_y"] / DPS == pytest.approx(3.97, abs=0.05)
    assert q["rms_after_y"] == pytest.approx(0.002, rel=0.05)


def test_input_along_fewer_axes_is_refused():
    B = truth.directions(50) * [1, 1, 0]
    with pytest.raises(InputError, match="excite all axes, the input along z is always zero"):
        cal.against_reference("gyr", B, B)
    B = np.outer(np.linspace(-1, 1, 50), [1.0, 2.0, 0.5])
    with pytest.raises(InputError, match=r"cannot tell y and z apart.*move about all three axes"):
        cal.against_reference("gyr", B, B)


def test_too_few_samples_are_refused():
    with pytest.raises(InputError, match="12 unknowns, got 3 samples of 3 equations"):
        cal.against_reference("acc", np.eye(3), np.eye(3))


def test_samples_with_nan_are_left_out():
    B = truth.directions(50)
    y = raw_of(C_ACC, B)
    y[7] = np.nan
    record = cal.against_reference("acc", y, B)
    assert record.equations == 147
    assert_allclose(record.matrix, C_ACC[:, :3], atol=1e-13)


# --- encoders ------------------------------------------------------------------------------

LSB = 0.09 * DPS  # 0.09 deg in radians


def platform(seconds=25.0, rate_hz=100.0):
    """Angles of a slow motion about three axes, and its exact body rates."""
    t = np.arange(round(seconds * rate_hz)) / rate_hz

    def rpy(t):
        f = 2 * np.pi * np.outer(t, [0.11, 0.17, 0.07])
        phase = np.array([0.3, 1.0, 2.0])
        return np.radians([20.0, 15.0, 90.0]) * np.sin(f + phase)

    h = 1e-5
    after, before = (Rotation.from_euler("ZYX", rpy(t + d)[:, ::-1]) for d in (h, -h))
    return t, rpy(t), (before.inv() * after).as_rotvec() / (2 * h)


def test_body_rates_of_smooth_angles_are_the_rates_of_the_rotation():
    t, rpy, rates = platform()
    found = cal.body_rates(t, rpy, resolution=1e-9)
    # The spline may be off by 1e-9 rad, on a scale of 0.1 s.
    assert_allclose(found[20:-20], rates[20:-20], atol=1e-6)


def test_spline_removes_the_steps_of_the_encoder():
    t, rpy, rates = platform()
    steps = np.round(rpy / LSB) * LSB
    found = cal.body_rates(t, steps, resolution=LSB)
    rms = np.sqrt(np.mean((found - rates) ** 2, axis=0)) / DPS
    assert (rms < 0.08).all()  # under the white noise of the gyroscope, 0.08 deg/s
    direct = np.gradient(steps, t, axis=0)
    assert np.sqrt(np.mean((direct - np.gradient(rpy, t, axis=0)) ** 2)) / DPS > 1.0


def test_gyro_calibration_against_encoders_brings_the_errors_down_to_the_noise():
    t, rpy, rates = platform(250.0)
    noise = 0.08 * DPS * np.random.default_rng(1).standard_normal(rates.shape)
    y = raw_of(C_GYRO, rates) + noise
    reference = cal.body_rates(t, np.round(rpy / LSB) * LSB, resolution=LSB)
    record = cal.against_reference("gyr", y, reference)
    true = cal.physical_parameters(C_GYRO[:, :3], -np.linalg.solve(C_GYRO[:, :3], C_GYRO[:, 3]))
    error = np.array([p.value for p in record.parameters]) - true
    assert (np.abs(error[:3]) < 2e-3).all()
    assert (np.abs(error[3:6]) < 0.02 * DPS).all()
    assert (np.abs(error[6:]) < 2e-3).all()
    assert record.residual_rms / DPS < 0.1
    assert record.residual_rms_before / DPS > 2.0


def test_a_long_rest_leaves_the_rates_of_the_motion_as_they_are():
    """Counts that stand still do not scatter: what they leave must not coarsen the rest."""
    t, rpy, _ = platform(25.0)
    # held where it stands at the end, so there is no jump
    long = np.vstack((rpy, np.tile(rpy[-1], (10 * len(t), 1))))
    t_long = np.arange(len(long)) / 100.0
    short = cal.body_rates(t, np.round(rpy / LSB) * LSB, resolution=LSB)
    found = cal.body_rates(t_long, np.round(long / LSB) * LSB, resolution=LSB)
    inner = slice(100, len(t) - 300)  # the stop itself has no finite acceleration
    off = np.sqrt(np.mean((found[: len(t)] - short)[inner] ** 2))
    assert off < 0.03 * DPS  # the spline itself is good to 0.04 deg/s


def test_an_angle_that_stands_has_no_rate():
    t = np.arange(200) / 100.0
    rpy = np.column_stack((np.full(200, 0.1), np.where(t % 0.3 < 0.15, 0.0, LSB), t * 0.0))
    assert_allclose(cal.body_rates(t, rpy, resolution=LSB), 0.0, atol=1e-12)


def test_wrong_resolution_is_refused():
    t, rpy, _ = platform()
    with pytest.raises(InputError, match=r"got 0.09 deg, but the angle steps by 0.18 deg"):
        cal.body_rates(t, np.round(rpy / (2 * LSB)) * 2 * LSB, resolution=LSB)


def test_short_records_are_refused():
    with pytest.raises(InputError, match="at least 12 samples for a spline, got 5"):
        cal.body_rates(np.arange(5.0), np.zeros((5, 3)))


def test_body_vectors_are_those_of_scipy():
    rpy = np.random.default_rng(0).uniform(-1.2, 1.2, (20, 3))
    v_n = np.array([0.225, 0.01, 0.418])
    expected = Rotation.from_euler("ZYX", rpy[:, ::-1]).inv().apply(v_n)
    assert_allclose(cal.body_vectors(rpy, v_n), expected, atol=1e-15)
    level = cal.body_vectors([[0.0, 0.0, 1.0]], [0.0, 0.0, -G])
    assert_allclose(level, [[0.0, 0.0, -G]], atol=1e-15)


# --- quadrature ----------------------------------------------------------------------------

# Table 8.2: rows current, columns previous, both in the order 11, 10, 00, 01.
STATES = [(1, 1), (1, 0), (0, 0), (0, 1)]
TABLE_8_2 = [[0, -1, 0, 1], [1, 0, -1, 0], [0, 1, 0, -1], [-1, 0, 1, 0]]


@pytest.mark.parametrize("previous", range(4))
@pytest.mark.parametrize("current", range(4))
def test_all_sixteen_transitions_follow_table_8_2(previous, current):
    a, b = zip(STATES[previous], STATES[current], strict=True)
    decoded = cal.decode_quadrature(a, b)
    assert decoded.count.tolist() == [0, TABLE_8_2[current][previous]]
    assert decoded.invalid == ((previous - current) % 4 == 2)


def test_turn_forth_and_back_returns_to_zero():
    angle = np.radians(40.0 * np.sin(np.linspace(0, 2 * np.pi, 20_000)))
    phase = angle * 500  # electrical, 500 cycles per turn
    # 11, 10, 00, 01 as the angle grows: A leads with its fall after B's.
    quarter = np.floor(phase / (np.pi / 2)).astype(int) % 4
    a = np.array([1, 1, 0, 0])[quarter]
    b = np.array([1, 0, 0, 1])[quarter]
    decoded = cal.decode_quadrature(a, b, 500)
    assert decoded.invalid == 0
    assert decoded.resolution == pytest.approx(np.radians(0.18))
    assert_allclose(decoded.angle, angle, atol=decoded.resolution)


def test_levels_other_than_0_and_1_are_refused():
    with pytest.raises(ValueError, match="`a` must be levels 0 and 1"):
        cal.decode_quadrature([0, 3], [0, 1])
    with pytest.raises(ValueError, match="equal length, got 2 and 1"):
        cal.decode_quadrature([0, 1], [0])


def test_offset_is_the_middle_between_the_stops():
    angle = np.radians(np.concatenate((np.linspace(0, 37, 50), np.linspace(37, -43, 90), [-5.0])))
    assert cal.start_offset(angle) == pytest.approx(np.radians(-3.0))


def test_offset_without_a_visit_to_both_stops_is_refused():
    with pytest.raises(InputError, match=r"reach both stops, at least 20 deg apart.* over 12 deg"):
        cal.start_offset(np.radians([0.0, 12.0, 4.0]))
