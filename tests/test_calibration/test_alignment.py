"""Magnetometer axes from the constant angle between gravity and field."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from truth import triads as truth
from truth.triads import DPS, UT, G

from strapdown import calibration as cal
from strapdown.errors import InputError

FIELD_N = np.array([20.0, 1.0, 43.0]) * UT


def poses(C_am, n=30, seed=0, noise=True):
    """Field in magnetometer axes and specific force in accelerometer axes, at rest."""
    rng = np.random.default_rng(seed)
    q_na = Rotation.random(n, random_state=seed)
    f_a = q_na.inv().apply([0.0, 0.0, -G])
    m_m = q_na.inv().apply(FIELD_N) @ C_am
    if noise:
        f_a = f_a + 5e-3 * rng.standard_normal(f_a.shape)
        m_m = m_m + 0.1 * UT * rng.standard_normal(m_m.shape)
    return m_m, f_a


@pytest.mark.parametrize("seed", range(6))
def test_any_rotation_is_found_exactly_without_noise(seed):
    C_am = Rotation.random(random_state=seed).as_matrix()
    found = cal.align_to_accelerometer(*poses(C_am, seed=seed, noise=False))
    assert_allclose(found.C_am, C_am, atol=1e-9)
    inclination = np.arctan2(43.0, np.hypot(20.0, 1.0))
    assert found.inclination == pytest.approx(inclination, abs=1e-9)


def test_inclination_is_negative_in_the_south():
    m, f = poses(np.eye(3), noise=False)
    q_na = Rotation.random(30, random_state=0)
    m = q_na.inv().apply(FIELD_N * [1, 1, -1])
    assert cal.align_to_accelerometer(m, f).inclination == pytest.approx(-1.134, abs=1e-3)


def test_sigma_of_the_rotation_is_honest():
    nees = []
    for seed in range(80):
        C_am = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
        found = cal.align_to_accelerometer(*poses(C_am, seed=seed))
        e = Rotation.from_matrix(found.C_am @ C_am.T).as_rotvec()
        nees.append(e @ np.linalg.solve(found.covariance[:3, :3], e))
        assert np.linalg.norm(e) < 0.3 * DPS
    # 3 * 26 / 24 = 3.25 for 26 degrees of freedom; 0.3 is its standard deviation over 80 draws.
    assert 2.4 < np.mean(nees) < 4.2


def test_general_soft_iron_is_undone_by_ellipsoid_and_alignment_together():
    soft = np.array([[1.1, 0.12, -0.04], [-0.03, 0.94, 0.10], [0.02, -0.06, 1.02]])
    hard = np.array([10.0, -20.0, 5.0]) * UT
    rng = np.random.default_rng(2)
    q_na = Rotation.random(800, random_state=5)
    b_a = q_na.inv().apply(FIELD_N)
    raw = b_a @ soft.T + hard + 0.1 * UT * rng.standard_normal(b_a.shape)
    record = cal.ellipsoid(raw)
    f_a = q_na.inv().apply([0.0, 0.0, -G])
    found = cal.align_to_accelerometer(record.correct(raw[:60]), f_a[:60])
    aligned = record.rotated(found.C_am)

    def worst(r):
        c = r.correct(b_a @ soft.T + hard)
        cosine = np.sum(c * b_a, axis=1) / np.linalg.norm(c, axis=1) / np.linalg.norm(b_a, axis=1)
        return np.degrees(np.arccos(np.clip(cosine, -1, 1))).max()

    assert worst(record) > 3.0  # the rotation that the shape does not show
    assert worst(aligned) < 0.35


def test_poses_tilted_about_one_axis_only_are_refused():
    q_na = Rotation.from_euler(
        "ZYX", np.column_stack((np.linspace(0, 6, 20),) + (np.zeros(20),) * 2)
    )
    f = q_na.inv().apply([0.0, 0.0, -G])
    m = q_na.inv().apply(FIELD_N)
    with pytest.raises(InputError, match=r"alignment .* cannot tell .*; hold the device still"):
        cal.align_to_accelerometer(m, f)


def test_nearly_level_poses_are_refused_with_their_sigma():
    rng = np.random.default_rng(0)
    tilt = np.column_stack((rng.uniform(0, 6, 20), 0.02 * rng.standard_normal((20, 2))))
    q_na = Rotation.from_euler("ZYX", tilt)
    f = q_na.inv().apply([0.0, 0.0, -G]) + 5e-3 * rng.standard_normal((20, 3))
    m = q_na.inv().apply(FIELD_N) + 0.3 * UT * rng.standard_normal((20, 3))
    with pytest.raises(InputError, match=r"must be known to 1 deg \(three sigma\)"):
        cal.align_to_accelerometer(m, f)


def test_too_few_poses_are_refused():
    with pytest.raises(InputError, match="6 unknowns, got 5 poses"):
        cal.align_to_accelerometer(truth.directions(5), truth.directions(5, 1))
