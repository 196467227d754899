"""The mounting of a box in a car, found from a drive: against simulated and real cars."""

from pathlib import Path

import drive
import numpy as np
import pytest

import strapdown as sd
from strapdown.errors import InputError
from strapdown.evaluation import mount_at
from strapdown.navigation import alignment
from strapdown.recording import Imu, Recording
from strapdown.rotation import dcm_from_quat
from strapdown.units import DEG

DRIVES = ("urban-mixed-turns-nominal-001", "urban-stop-go-large-mount-001")


def turn_v(found, C_vb):
    """Rotation from the found mount to the true one, about the vehicle's axes [rad]."""
    D = np.asarray(C_vb) @ dcm_from_quat(found.q_vb).T
    assert np.trace(D) > 2.0  # no half turn, which has no sine
    return 0.5 * np.array((D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]))


@pytest.mark.parametrize(
    ("lat", "axis", "angle"),
    [
        (-1.0, (1, 2, -1), 2.4),
        (0.0, (0, 1, 0), 1.4),
        (0.8, (1, 0, 0), np.pi),
        (1.2, (0, 0, 1), 0.1),
    ],
)
def test_any_mounting_is_found_at_any_latitude(lat, axis, angle):
    d = drive.simulate(
        seed=5, duration=170.0, lla0=(lat, 0.2, 50.0), C_vb=drive.rotation(axis, angle),
        gyr_bias=(0.002, -0.003, 0.004), acc_bias=(0.05, -0.04, 0.06),
    )  # fmt: skip
    found = alignment.mount(d.rec, span=(18.0, 95.0))
    error = turn_v(found, d.C_vb)
    assert np.linalg.norm(error) < 5.0 * DEG  # an upside-down or mirrored answer is 90 or more
    assert (np.abs(error) < 3.5 * found.std_v).all()
    assert (found.std_v < 8.0 * DEG).all()


def test_a_box_turned_by_hand_has_its_mount_turned_alike():
    d = drive.simulate(seed=2, duration=120.0)
    R = drive.rotation((2, -1, 3), 2.0)  # new axes of the box in the old ones
    imu = Imu(t=d.rec.imu.t, gyr=d.rec.imu.gyr @ R, acc=d.rec.imu.acc @ R)
    one = alignment.mount(d.rec, span=(18.0, 95.0))
    two = alignment.mount(Recording(imu=imu, gnss=d.rec.gnss), span=(18.0, 95.0))
    # the adjustment ends at a thousandth of its sigma, in other components of the biases
    assert np.abs(turn_v(two, dcm_from_quat(one.q_vb) @ R)).max() < 0.02 * DEG
    assert two.std_v == pytest.approx(one.std_v, rel=1e-2)


def test_good_sensors_on_level_roads_give_the_mount_to_fractions_of_a_degree():
    d = drive.simulate(
        seed=1, noise=0.0, vibration=0.0, duration=170.0, antenna_v=(0, 0, 0),
        C_vb=drive.rotation((3, -1, 1), 1.9),
    )  # fmt: skip
    found = alignment.mount(
        d.rec, span=(58.0, 165.0), velocity_std=0.01, gyr_bias_std=1e-5, acc_bias_std=1e-4,
        sideslip_std=0.0, road_std=0.1 * DEG,
    )  # fmt: skip
    assert np.abs(turn_v(found, d.C_vb)).max() < 0.3 * DEG


def test_its_covariance_is_careful_but_not_idle():
    """Biases and slopes as large as their sigmas, fixes as good as the receiver says."""
    rng, nees = np.random.default_rng(8), []
    for seed in range(12):
        d = drive.simulate(
            seed=seed, duration=100.0, vibration=0.3, antenna_v=(0, 0, 0), velocity_error=0.1,
            gyr_bias=0.3 * DEG * rng.standard_normal(3), acc_bias=0.05 * rng.standard_normal(3),
            stated=(0.5, 0.1), C_vb=drive.rotation((1, 2, -1), 2.4),
        )  # fmt: skip
        found = alignment.mount(
            d.rec, span=(58.0, 95.0), gyr_bias_std=0.3 * DEG, acc_bias_std=0.05, road_std=0.0,
            sideslip_std=0.1 * DEG, max_heading_std=1.0,
        )  # fmt: skip
        error = turn_v(found, d.C_vb)
        nees.append(error @ np.linalg.solve(found.covariance_v, error))
    # three if it were exact; it takes the attitude's sigma at the end, the greatest of the span
    assert 0.2 < np.mean(nees) < 3.0


def test_a_drive_that_goes_nowhere_straight_is_refused():
    d = drive.simulate(seed=2, duration=120.0)
    with pytest.raises(
        InputError, match=r"straight ahead at 50 m/s or more at 5 fixes, it does at"
    ):
        alignment.mount(d.rec, span=(18.0, 95.0), min_speed=50.0)
    with pytest.raises(InputError, match="the motion must show its heading"):
        alignment.mount(d.rec, span=(2.0, 17.0))
    with pytest.raises(ValueError, match="`road_time` must be positive"):
        alignment.mount(d.rec, road_time=0.0)


@pytest.mark.parametrize("name", DRIVES)
def test_on_real_drives_it_is_within_its_sigmas(name, data_dir):
    rec = sd.read(Path(data_dir) / "drives" / name)
    last = np.array([rec.imu.t[-1]])
    truth = dcm_from_quat(mount_at(rec.reference.mount, last)[0])
    seen = 0
    for start in range(60, 400, 60):
        try:
            found = alignment.mount(rec, span=(start, start + 60.0))
        except InputError:  # it stands, or nothing shows the heading
            continue
        seen += 1
        error = turn_v(found, truth)
        assert np.linalg.norm(error) < 6.0 * DEG
        assert (np.abs(error) < 3.5 * found.std_v).all()
    assert seen >= 2
