"""A reference on its own clock, in its own frames, is brought onto the log."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from small_logs import G

import strapdown as sd
from strapdown.errors import FormatError
from strapdown.recording import Imu, Mag, Recording

# What is to be found: clock, mount and world of the reference.
OFFSET = 7.2345
Q_SB = Rotation.from_euler("zyx", [70.0, -35.0, 120.0], degrees=True)
FIELD_N = np.array([20e-6, 0.0, 44e-6])
SECONDS = 60.0


def attitude(t: np.ndarray) -> Rotation:
    """A box that turns about all axes, unevenly: body to NED."""
    yaw = 0.9 * np.sin(0.7 * t) + 0.1 * t
    pitch = 0.5 * np.sin(0.43 * t + 1.0)
    roll = 0.8 * np.sin(0.31 * t) * np.cos(0.11 * t)
    return Rotation.from_euler("ZYX", np.column_stack((yaw, pitch, roll)))


def simulate(rate: float = 200.0, magnetometer: bool = True) -> Recording:
    t = np.arange(0.0, SECONDS, 1.0 / rate)
    q = attitude(t)
    gyr = (attitude(t - 1.0 / rate).inv() * q).as_rotvec() * rate
    acc = q.inv().apply([0.0, 0.0, -G])
    mag = Mag(t=t, mag=q.inv().apply(FIELD_N)) if magnetometer else None
    return Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=mag, meta={"name": "made up"})


def write_reference(path: Path, world: Rotation, rate: float = 97.0) -> np.ndarray:
    """Write q_ws = q_wn q_nb q_bs on a clock that is OFFSET behind; return log times."""
    t = np.arange(3.0, SECONDS - 4.0, 1.0 / rate)
    q = (world * attitude(t) * Q_SB.inv()).as_quat()[:, [3, 0, 1, 2]]
    text = [",".join(f"{x:.9f}" for x in (s - OFFSET, *row)) for s, row in zip(t, q, strict=True)]
    path.write_text("\n".join(["time_s,qw,qx,qy,qz", *text]))
    return t


def degrees_apart(rec: Recording, t: np.ndarray) -> np.ndarray:
    found = Rotation.from_quat(rec.reference.attitude.q_nb[:, [1, 2, 3, 0]])
    return np.rad2deg((attitude(t).inv() * found).magnitude())


@pytest.fixture
def log(tmp_path: Path) -> Callable[..., Path]:
    def write(**options: bool) -> Path:
        sd.write(simulate(**options), tmp_path / "log.parquet")
        return tmp_path / "log.parquet"

    return write


WORLDS = {
    "ned": Rotation.identity(),
    "enu": Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]]),
    "y up": Rotation.from_euler("zyx", [30, 80, 95], degrees=True),
}


@pytest.mark.parametrize("world", WORLDS)
def test_clock_mount_and_world_are_found(
    tmp_path: Path, log: Callable[..., Path], world: str
) -> None:
    t = write_reference(tmp_path / "ref.csv", WORLDS[world])
    rec = sd.read(log(), reference=tmp_path / "ref.csv")
    found = rec.meta["reference"]
    assert abs(found["clock_offset_s"] - OFFSET) < 1e-3  # a fifth of the log's interval
    q_sb = Rotation.from_quat(np.array(found["q_sb"])[[1, 2, 3, 0]])
    assert np.rad2deg((q_sb * Q_SB.inv()).magnitude()) < 0.05
    assert found["correlation"] > 0.99
    assert rec.reference.heading == "magnetic"
    # rates of 1.5 rad/s times 1 ms of clock, and the mean directions
    assert degrees_apart(rec, t).max() < 0.3
    np.testing.assert_allclose(rec.reference.attitude.t, t, atol=1e-3)


def test_without_magnetometer_heading_is_arbitrary_and_tilt_right(
    tmp_path: Path, log: Callable[..., Path]
) -> None:
    t = write_reference(tmp_path / "ref.csv", WORLDS["y up"])
    rec = sd.read(log(magnetometer=False), reference=tmp_path / "ref.csv")
    assert rec.reference.heading == "arbitrary"
    assert "the heading of the reference is arbitrary" in " ".join(rec.meta["notes"])
    found = Rotation.from_quat(rec.reference.attitude.q_nb[:, [1, 2, 3, 0]])
    down_b, want = found.inv().apply([0, 0, 1]), attitude(t).inv().apply([0, 0, 1])
    assert np.rad2deg(np.arccos(np.clip((down_b * want).sum(axis=1), -1, 1))).max() < 0.3


def test_a_log_with_a_reference_to_ned_keeps_its_world(tmp_path: Path, broad_02: Path) -> None:
    rec = sd.read(broad_02, reference=broad_02)
    own = sd.read(broad_02).reference
    assert rec.reference.heading == "magnetic"
    assert rec.meta["reference"]["q_nw"] == [1.0, 0.0, 0.0, 0.0]
    # the optical clock and the sensor's filter: below two samples of 3.5 ms
    assert abs(rec.meta["reference"]["clock_offset_s"]) < 0.007
    a, b = rec.reference.attitude.q_nb, own.attitude.q_nb
    ok = ~np.isnan(b).any(axis=1)
    apart = 2 * np.arccos(np.clip(np.abs((a[ok] * b[ok]).sum(axis=1)), 0, 1))
    assert np.rad2deg(apart.max()) < 1.0


def test_roll_pitch_yaw_in_degrees_will_do(tmp_path: Path, log: Callable[..., Path]) -> None:
    t = np.arange(3.0, 50.0, 0.01)
    rpy = (attitude(t) * Q_SB.inv()).as_euler("ZYX", degrees=True)[:, ::-1]
    text = [",".join(f"{x:.9f}" for x in (s, *row)) for s, row in zip(t, rpy, strict=True)]
    (tmp_path / "ref.txt").write_text("\n".join(["t_s,roll_deg,pitch_deg,yaw_deg", *text]))
    rec = sd.read(log(), reference=tmp_path / "ref.txt")
    assert degrees_apart(rec, t).max() < 0.3


def test_the_reference_of_another_motion_is_refused(
    tmp_path: Path, log: Callable[..., Path]
) -> None:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 40.0, 0.01)
    wander = np.cumsum(rng.normal(size=(len(t), 3)), axis=0) * 0.02
    q = Rotation.from_rotvec(wander).as_quat()[:, [3, 0, 1, 2]]
    text = [",".join(f"{x:.9f}" for x in (s, *row)) for s, row in zip(t, q, strict=True)]
    (tmp_path / "ref.csv").write_text("\n".join(["t,qw,qx,qy,qz", *text]))
    with pytest.raises(
        FormatError, match=r"ref\.csv: must turn as the log does, its angular rate"
    ):
        sd.read(log(), reference=tmp_path / "ref.csv")


def test_a_file_without_attitude_lists_what_it_holds(
    tmp_path: Path, log: Callable[..., Path]
) -> None:
    text = [f"{k / 100},{k % 7},3" for k in range(100)]
    (tmp_path / "ref.csv").write_text("\n".join(["t,foo,mood", *text]))
    with pytest.raises(FormatError, match=r"(no column is known|must hold quaternions)"):
        sd.read(log(), reference=tmp_path / "ref.csv")


def test_a_reference_of_positions_is_taken_by_the_clock(
    tmp_path: Path, log: Callable[..., Path]
) -> None:
    text = [f"{k / 10},47.{k:03d},8.5,400" for k in range(100)]
    (tmp_path / "ref.csv").write_text("\n".join(["t_s,lat_deg,lon_deg,height_m", *text]))
    rec = sd.read(log(), reference=tmp_path / "ref.csv")
    assert len(rec.reference.position) == 100
    assert rec.reference.attitude is None
    assert "taken to be on the log's clock" in " ".join(rec.meta["notes"])
