"""Deterministic errors: the theses' forms, printed numbers, and the way back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from strapdown.errors import NotConverged
from strapdown.sensors import Linear
from strapdown.units import DEG, DPS

# Thesis A, equation (6.17), rates in rad/s.
C_GYRO = [
    [0.9822, -0.0003, -0.0072, 0.0188],
    [-0.0021, 0.9836, 0.0143, -0.0680],
    [0.0093, 0.0039, 1.0002, 0.0028],
]
X = np.array([[1.0, -2.0, 0.5], [0.3, 0.7, -4.0], [-3.0, 0.1, 0.2]])


def test_sense_axes_and_calibration_matrix_of_thesis_a_are_the_same_device():
    # the twelve parameters that the matrix (6.17) stands for, in degrees and deg/s
    gyro = Linear.from_sense_axes(
        (1.01812, 1.01667, 0.99980),
        a_yz=0.017 * DEG, a_zy=-0.412 * DEG, a_xz=-0.123 * DEG,
        a_zx=-0.819 * DEG, a_xy=-0.543 * DEG, a_yx=0.227 * DEG,
        bias=np.array((-1.0967, 3.9611, -0.1656)) * DPS,
    )  # fmt: skip
    printed = Linear.from_calibration(C_GYRO)
    # five printed digits of scale, three decimals of a degree: 1e-5
    assert np.array(gyro.matrix) == pytest.approx(np.array(printed.matrix), abs=1.5e-5)
    # deg/s with four decimals
    assert np.array(gyro.bias) == pytest.approx(np.array(printed.bias), abs=1e-4 * DPS)


def test_calibration_matrix_brings_the_truth_back():
    y = Linear.from_calibration(C_GYRO).apply(X)
    assert np.column_stack((y, np.ones(3))) @ np.array(C_GYRO).T == pytest.approx(X, abs=1e-14)


def test_triangular_form_is_undone_by_the_corrected_formula_of_thesis_e():
    sx, sy, sz = 0.00775, 0.008838, 0.008041  # table 6.1
    yz, zx, zy = -0.00086, 0.01142, -0.00049
    b = np.array((0.012133, 0.023295, -0.03593))
    y = Linear.from_triangular((sx, sy, sz), theta_yz=yz, theta_zx=zx, theta_zy=zy, bias=b).apply(
        X
    )
    A1, B1, C1 = 1 / (1 + sx), 1 / (1 + sy), 1 / (1 + sz)
    lx, ly, lz = (y - b).T
    back = np.stack(  # (6.2.14)
        (
            A1 * lx,
            yz * A1 * B1 * lx + B1 * ly,
            A1 * C1 * (B1 * yz * zx - zy) * lx + zx * B1 * C1 * ly + C1 * lz,
        ),
        axis=1,
    )
    assert back == pytest.approx(X, abs=1e-14)


def test_scale_and_misalignment_form():
    M = np.array([[1e-3, 2e-4, -3e-4], [5e-4, -8e-4, 6e-4], [-7e-4, 3e-4, 9e-4]])
    y = Linear.from_scale_and_misalignment(M, (0.1, 0.2, 0.3), nominal=2.0).apply(X)
    assert y == pytest.approx((2.0 * (np.eye(3) + M) @ X.T).T + [0.1, 0.2, 0.3], abs=1e-14)


def test_gain_and_alignment_form():
    R = np.array([[0.999, 0.02, 0.0], [-0.01, 0.998, 0.03], [0.02, 0.0, 1.0]])
    y = Linear.from_gain_and_alignment((2.0, 3.0, 4.0), R, (1.0, 2.0, 3.0)).apply(X[0])
    assert y == pytest.approx(np.array((2, 3, 4)) * (R @ X[0]) + [1, 2, 3], abs=1e-14)


def test_hard_and_soft_iron_form_of_thesis_a():
    soft = np.array([[0.95, 0.03, 0.0], [0.03, 1.02, -0.04], [0.0, -0.04, 1.1]])
    axes = Linear.from_sense_axes(a_yz=0.02, a_zx=-0.01)
    T = np.linalg.inv(np.array(axes.matrix))
    y = Linear.from_hard_and_soft_iron((20.0, -10.0, 5.0), soft, axes=axes).apply(X)
    assert pytest.approx(X, abs=1e-13) == (T @ soft @ (y - [20.0, -10.0, 5.0]).T).T


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.floats(-0.1, 0.1), min_size=21, max_size=21),
    st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3),
)
def test_inverse_undoes_every_error(parameters, x):
    p = np.array(parameters)
    linear = Linear(
        matrix=np.eye(3) + p[:9].reshape(3, 3),
        bias=p[9:12],
        quadratic=p[12:].reshape(3, 3) * 0.03,
    )
    # inputs of 10 through a matrix of condition 2
    assert linear.invert(linear.apply(x)) == pytest.approx(np.array(x), abs=2e-13)


def test_quadratic_term_is_a_share_of_the_square_of_each_axis():
    linear = Linear(quadratic=((0.01, 0, 0), (0, 0.02, 0), (0, 0.03, 0)))
    assert linear.apply([2.0, -3.0, 1.0]) == pytest.approx([2.04, -2.82, 1.27], abs=1e-15)


def test_errors_without_effect_are_ideal_and_nan_stays_in_its_row():
    assert Linear().is_ideal
    assert not Linear(bias=(0.0, 0.0, 1e-9)).is_ideal
    y = Linear.from_calibration(C_GYRO).apply([[1.0, np.nan, 0.0], [1.0, 1.0, 1.0]])
    assert np.isnan(y[0]).any()
    assert np.isfinite(y[1]).all()


def test_impossible_models_are_refused():
    with pytest.raises(ValueError, match="`matrix` must be one 3x3 matrix that can be inverted"):
        Linear(matrix=((1, 0, 0), (1, 0, 0), (0, 0, 1)))
    steep = Linear(quadratic=((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)))
    with pytest.raises(NotConverged, match="lower `quadratic`"):
        steep.invert([-5.0, 0.0, 0.0])
