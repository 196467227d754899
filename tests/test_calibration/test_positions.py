"""Six and eighteen prescribed positions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from truth import triads as truth
from truth.triads import DPS, MG, TABLE_6_1, G

from strapdown import calibration as cal
from strapdown.errors import InputError

FULL = np.array([[1.012, 0.004, -0.003], [-0.006, 0.991, 0.002], [0.001, 0.007, 1.005]])
BIAS = np.array([0.2, -0.1, 0.35])


def test_up_and_down_give_bias_and_scale_by_the_corrected_6_2_2():
    bias, scale = cal.up_down([1.03 * G + 0.1], [-1.03 * G + 0.1], G)
    assert_allclose(bias, 0.1, rtol=1e-12)
    assert_allclose(scale, 0.03, rtol=1e-12)


def test_six_positions_recover_the_full_matrix_in_any_order():
    nominal = G * np.vstack((np.eye(3), -np.eye(3)))
    order = [4, 0, 2, 5, 1, 3, 0]
    raw = (nominal @ FULL.T + BIAS)[order]
    record = cal.six_position(raw)
    assert_allclose(record.correct(raw), nominal[order], atol=1e-12)
    assert_allclose(record.bias, BIAS, atol=1e-12)
    assert_allclose(record.matrix, np.linalg.inv(FULL), atol=1e-13)
    for k, axis in enumerate("xyz"):
        assert record.quality[f"up_down_bias_{axis}"] == pytest.approx(BIAS[k])
        assert record.quality[f"up_down_scale_{axis}"] == pytest.approx(FULL[k, k] - 1.0)


def test_six_positions_that_are_not_level_put_the_tilt_into_the_misalignment():
    nominal = G * np.vstack((np.eye(3), -np.eye(3)))
    tilt = 1.0 * DPS  # one degree about z, all poses alike
    C = np.array([[np.cos(tilt), np.sin(tilt), 0], [-np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
    record = cal.six_position(nominal @ C.T)
    # B = T y takes y back by the tilt: T[0, 1] = -a_yz = -sin(tilt)
    assert record["a_yz"].value == pytest.approx(np.tan(tilt), rel=1e-3)


def test_a_missing_position_is_named():
    nominal = G * np.vstack((np.eye(3), -np.eye(3)))
    with pytest.raises(InputError, match="every position, missing are those with -y, -z up"):
        cal.six_position(nominal[[0, 1, 2, 3]])


def test_a_pose_in_between_is_refused():
    nominal = G * np.vstack((np.eye(3), -np.eye(3), [[0.7, 0.7, 0.0]]))
    with pytest.raises(InputError, match=r"within 20 deg of a position, got 45 deg in row 6"):
        cal.six_position(nominal)


def test_eighteen_positions_are_six_faces_and_twelve_edges():
    positions = cal.eighteen_positions()
    assert positions.shape == (18, 3)
    assert len(np.unique(positions.round(6), axis=0)) == 18
    assert_allclose(np.linalg.norm(positions, axis=1), 1.0)


def test_eighteen_positions_recover_table_6_1_though_not_level():
    rng = np.random.default_rng(0)
    true = G * cal.eighteen_positions() + 0.5 * rng.standard_normal((18, 3))
    true *= G / np.linalg.norm(true, axis=1, keepdims=True)  # off by some degrees
    record = cal.eighteen_position(truth.distort(true, TABLE_6_1))
    assert_allclose([p.value for p in record.parameters], TABLE_6_1, atol=1e-10)
    assert record.method == "18-position"


def test_a_missing_edge_is_named():
    with pytest.raises(InputError, match=r"18-position .* missing are those with \+x\+y up"):
        cal.eighteen_position(G * cal.eighteen_positions()[:17] + 0.1 * MG)
