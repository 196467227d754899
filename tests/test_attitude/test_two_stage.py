"""The two-stage filter as a whole: where it converges to, corrected and as printed."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.attitude import TwoStage
from strapdown.recording import Imu, Mag, Recording

G = 9.80665
C_UN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # NED to ENU
LEVEL = Rotation.from_matrix(C_UN.T)  # where the source starts: z up, x east
HORIZONTAL, DIPPING = (2e-5, 0.0, 0.0), (2e-5, 0.0, 4.5e-5)


def still(r_nb, seconds, field_n):
    """A box that lies still, ideal sensors at 100 Hz."""
    t = np.arange(round(seconds * 100)) / 100
    acc, mag = (np.tile(r_nb.inv().apply(v), (len(t), 1)) for v in ((0, 0, -G), field_n))
    return Recording(imu=Imu(t=t, gyr=np.zeros((len(t), 3)), acc=acc), mag=Mag(t=t, mag=mag))


def found(flt, r_nb, start, seconds=60.0, field_n=HORIZONTAL):
    """Attitudes of a run from `start`."""
    state = flt.init(attitude=start.as_quat()[[3, 0, 1, 2]])
    sol, _ = flt.advance(state, still(r_nb, seconds, field_n), diagnostics=False)
    return Rotation.from_quat(sol.q_nb[:, [1, 2, 3, 0]])


def yaw_pitch_roll_deg(r_nb):
    """Angles of the source, relative to east-north-up."""
    return (Rotation.from_matrix(C_UN) * r_nb).as_euler("ZYX", degrees=True)


def box(*ypr_deg):
    """Attitude of a box from the angles of the source."""
    return LEVEL * Rotation.from_euler("ZYX", ypr_deg, degrees=True)


@pytest.mark.parametrize("linearisation", ["sequential", "printed"])
@pytest.mark.parametrize("field_n", [HORIZONTAL, DIPPING])
def test_corrected_filter_converges_from_every_start(linearisation, field_n):
    """Errors decay in 7 s, so 90 s leave 3e-6 of half a turn; 0.05 deg is for slow first turns."""
    flt, rng = TwoStage(linearisation=linearisation), np.random.default_rng(1)
    for _ in range(40):
        truth, start = Rotation.random(2, random_state=rng)
        end = found(flt, truth, start, 90.0, field_n)[-1]
        assert np.degrees((end.inv() * truth).magnitude()) < 0.05


@pytest.mark.parametrize("axis", np.vstack((np.eye(3), [[0.6, 0.0, 0.8], [0.5, -0.5, 0.7]])))
def test_corrected_filter_leaves_the_opposite_attitude(axis):
    """A start 179 deg off, where the pull is almost nothing."""
    truth = box(-100, 10, -20)
    start = truth * Rotation.from_rotvec(np.radians(179.0) * axis / np.linalg.norm(axis))
    end = found(TwoStage(), truth, start, 120.0, DIPPING)[-1]
    assert np.degrees((end.inv() * truth).magnitude()) < 0.05


def test_printed_field_model_settles_four_degrees_off():
    """Documented: truth -100/10/-20 deg settles at a yaw of -96.04 deg."""
    truth = box(-100, 10, -20)
    flt = TwoStage(field_model="printed", restriction="printed")
    yaw, _, _ = yaw_pitch_roll_deg(found(flt, truth, LEVEL)[-1])
    assert yaw == pytest.approx(-96.04, abs=0.005)
    whole = yaw_pitch_roll_deg(found(TwoStage.as_printed(), truth, LEVEL)[-1])
    assert whole[0] == pytest.approx(-96.04, abs=0.01)
    corrected = yaw_pitch_roll_deg(found(TwoStage(), truth, LEVEL)[-1])
    np.testing.assert_allclose(corrected, [-100, 10, -20], atol=0.02)


def test_printed_field_model_still_converges_where_the_box_is_level():
    for yaw in (40.0, -100.0, 150.0):
        end = found(TwoStage(field_model="printed"), box(yaw, 0, 0), LEVEL)[-1]
        np.testing.assert_allclose(yaw_pitch_roll_deg(end), [yaw, 0, 0], atol=0.05)


def test_transient_with_stages_apart_by_components_is_the_documented_one():
    """Yaw to 170 deg: 155.7 after 1 s, 167.4 after 5. Pitch to 10: 5.9, 7.7, 9.97 after 60 s."""
    flt = TwoStage(restriction="printed")
    yaw = yaw_pitch_roll_deg(found(flt, box(170, 0, 0), LEVEL))[:, 0]
    np.testing.assert_allclose(yaw[[100, 500]], [155.7, 167.4], atol=0.05)
    pitch = yaw_pitch_roll_deg(found(flt, box(-100, 10, -20), LEVEL))[:, 1]
    np.testing.assert_allclose(pitch[[100, 500]], [5.9, 7.7], atol=0.05)
    assert pitch[-1] == pytest.approx(9.97, abs=0.005)


def test_printed_restriction_gives_a_box_with_z_down_no_heading():
    truth, start = Rotation.from_euler("Z", 0.5), Rotation.identity()
    stuck = found(TwoStage(restriction="printed"), truth, start)[-1]
    free = found(TwoStage(), truth, start)[-1]
    assert (stuck.inv() * truth).magnitude() > 0.4
    assert (free.inv() * truth).magnitude() < 1e-3


def test_without_the_field_the_second_stage_is_off_and_heading_stays():
    truth, start = box(-100, 10, -20), box(30, 0, 0)
    yaw, pitch, roll = yaw_pitch_roll_deg(found(TwoStage(use_mag=False), truth, start)[-1])
    np.testing.assert_allclose([pitch, roll], [10, -20], atol=0.05)
    assert abs(yaw - 30.0) < 3.0  # turning level by 22 deg moves the yaw angle by a little


def test_defaults_are_the_variances_of_the_source_at_100_hz():
    flt = TwoStage()
    dt = 0.01
    assert flt.process_noise**2 * dt == pytest.approx(1e-6)
    assert flt.acc_noise**2 / dt == pytest.approx(2.0)
    assert flt.mag_noise**2 / dt == pytest.approx(1.0)
    assert flt.variance == 0.5


@pytest.mark.parametrize("name", ["linearisation", "field_model", "restriction", "integration"])
def test_unknown_formula_is_refused(name):
    with pytest.raises(ValueError, match=rf"`{name}` must be one of .*printed"):
        TwoStage(**{name: "typo"})


@pytest.mark.parametrize("name", ["acc_noise", "mag_noise", "variance"])
def test_noise_must_be_positive(name):
    with pytest.raises(ValueError, match=rf"`{name}` must be positive"):
        TwoStage(**{name: 0.0})
