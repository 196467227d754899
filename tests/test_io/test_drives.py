"""Road drives: the reference on the box, its masks, and the manifest."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import strapdown as sd
from strapdown.errors import FormatError
from strapdown.recording import Recording

DRIVES = [
    "mixed-road-highway-low-signal-001",
    "parking-lot-figure8-nominal-001",
    "urban-mixed-turns-nominal-001",
    "urban-short-turn-loop-nominal-001",
    "urban-stop-go-large-mount-001",
]


def turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return Rotation.from_quat(q[:, [1, 2, 3, 0]]).apply(v)


def smooth_at(t: np.ndarray, t_v: np.ndarray, v: np.ndarray, seconds: float) -> np.ndarray:
    n = max(int(seconds / np.median(np.diff(t_v))), 1)
    mean = np.column_stack([np.convolve(x, np.ones(n) / n, "same") for x in v.T])
    return np.column_stack([np.interp(t, t_v, x) for x in mean.T])


@pytest.fixture(scope="module", params=DRIVES)
def drive(request: pytest.FixtureRequest, data_dir: Path) -> Recording:
    return sd.read(data_dir / "drives" / request.param)


def test_gravity_in_the_reference_attitude_of_the_box_points_down(drive: Recording) -> None:
    a = drive.reference.attitude
    ok = a.valid & (a.t > drive.imu.t[0]) & (a.t < drive.imu.t[-1])
    f_n = turned(a.q_nb[ok], smooth_at(a.t[ok], drive.imu.t, drive.imu.acc, 1.0)).mean(axis=0)
    # accelerometer bias 0.1 m/s^2, roll and pitch of the reference to about a degree
    np.testing.assert_allclose(f_n, [0.0, 0.0, -9.81], atol=0.3)


def test_the_box_turns_as_its_reference_attitude_does(drive: Recording) -> None:
    a = drive.reference.attitude
    # the last quarter: the receiver has found its mount everywhere, the car still drives
    span = drive.imu.t[-1] - a.t[0]
    ok = a.valid & (a.t > a.t[0] + 0.5 * span) & (a.t < a.t[0] + 0.8 * span)
    t, q = a.t[ok], Rotation.from_quat(a.q_nb[ok][:, [1, 2, 3, 0]])
    omega_n = (q[1:] * q[:-1].inv()).as_rotvec() / np.diff(t)[:, None]
    gyr_n = q[1:].apply(smooth_at(t[1:], drive.imu.t, drive.imu.gyr, 2.0))
    window = np.ones(60) / 60  # 2 s of the 30 Hz reference
    yaw_rate = np.convolve(omega_n[:, 2], window, "same")
    correlation = np.corrcoef(yaw_rate, gyr_n[:, 2])[0, 1]
    assert correlation > 0.98  # the sign, and turns that agree within 20 %


def test_the_vehicle_of_the_reference_faces_where_it_drives(drive: Recording) -> None:
    # v_n = C_nv v_v with the nose along x: yaw of q_nv is the course of the fixes
    a, mount, g = drive.reference.attitude, drive.reference.mount, drive.gnss
    speed = np.hypot(g.v_n[:, 0], g.v_n[:, 1])
    at = np.clip(np.searchsorted(a.t, g.t), 0, len(a) - 1)
    use = (speed > 5.0) & a.valid[at] & (g.t < mount.t[-1])
    k = np.clip(np.searchsorted(mount.t, g.t[use]), 0, len(mount) - 1)
    q_nb = Rotation.from_quat(a.q_nb[at[use]][:, [1, 2, 3, 0]])
    q_vb = Rotation.from_quat(mount.q_vb[k][:, [1, 2, 3, 0]])
    nose_n = (q_nb * q_vb.inv()).apply([1.0, 0.0, 0.0])
    yaw = np.arctan2(nose_n[:, 1], nose_n[:, 0])
    course = np.arctan2(g.v_n[use, 1], g.v_n[use, 0])
    apart = np.angle(np.exp(1j * (yaw - course)))
    # side slip and the fixes' own noise at low speed; the figure eight is 12 deg off at times
    assert abs(np.rad2deg(np.median(apart))) < 3.0


def test_known_glitches_are_masked_and_little_else(data_dir: Path) -> None:
    glitches = {DRIVES[0]: (439.0, 452.0), DRIVES[3]: (64.0, 69.0)}
    for name in DRIVES:
        position = sd.read(data_dir / "drives" / name).reference.position
        low, high = glitches.get(name, (0.0, 0.0))
        inside = (position.t >= low) & (position.t <= high)
        if name in glitches:
            assert not position.valid[inside].any()
        beyond = ~position.valid & ((position.t < low - 6.0) | (position.t > high + 6.0))
        assert beyond.mean() < 0.05, name


def test_the_attitude_does_not_count_before_the_mount_is_found(data_dir: Path) -> None:
    rec = sd.read(data_dir / "drives" / "urban-stop-go-large-mount-001")
    a, mount = rec.reference.attitude, rec.reference.mount
    assert not a.valid[a.t < mount.t[np.argmax(mount.valid)]].any()
    # its first guess, 45 deg off, is left out too: gravity contradicts it until 214 s
    assert not a.valid[a.t < 214.0].any()
    assert a.valid[a.t > 225.0].all()


def test_fixes_are_in_radians_and_metres_with_their_deviations(parking_lot: Path) -> None:
    rec = sd.read(parking_lot)
    np.testing.assert_allclose(np.rad2deg(rec.gnss.lla[0, :2]), [43.4664498, -79.681135])
    assert rec.gnss.lla[0, 2] == 76.104
    assert rec.gnss.v_n[0].tolist() == [0.014, -0.02, 0.063]
    assert rec.gnss.std_position_n[0, 0] == 1.0935156148862257
    assert rec.gnss.std_velocity_n.shape == (302, 3)
    assert rec.reference.heading == "true"
    assert rec.meta["name"] == "parking-lot-figure8-nominal-001"


# --- made-up drives -------------------------------------------------------------------------


def make_drive(folder: Path, **changes: object) -> Path:
    """A drive straight north at 10 m/s with the box turned by 180 deg about its nose."""
    folder.mkdir()
    t = np.arange(0, 60, 0.02)
    imu = np.column_stack((t, 0 * t, 0 * t, 0 * t, 0 * t, 0 * t, 9.81 + 0 * t))
    fixes = np.arange(0, 60, 0.5)
    lat = 45.0 + fixes * 10.0 / 111_131.7
    gnss = np.column_stack((fixes, lat, 8 + 0 * fixes, 100 + 0 * fixes, 10 + 0 * fixes))
    slow = np.arange(0, 60, 0.1)
    zero = 0 * slow
    attitude = np.column_stack((slow, zero, zero + 1e-9, zero))
    mount = np.column_stack((fixes, 0 * fixes, np.where(fixes < 20, 0, 1e-9), 0 * fixes))
    ref_lat = 45.0 + slow * 10.0 / 111_131.7
    position = np.column_stack((slow, ref_lat, 8 + zero, 100 + zero, 10 + zero, zero, zero))
    position[300:310, 1] += 50 / 111_131.7  # 50 m north from 30 to 31 s
    names = {
        "imu": ("t_s,gx_radps,gy_radps,gz_radps,ax_mps2,ay_mps2,az_mps2", imu),
        "gnss": ("t_s,lat_deg,lon_deg,height_m,vn_mps", gnss),
        "reference_attitude": ("t_s,roll_deg,pitch_deg,yaw_deg", attitude),
        "reference_mount": ("t_s,roll_deg,pitch_deg,yaw_deg", mount),
        "reference_position": ("t_s,lat_deg,lon_deg,height_m,vn_mps,ve_mps,vd_mps", position),
    }
    files = {}
    for name, (head, table) in names.items():
        text = "\n".join([head, *[",".join(f"{x:.12g}" for x in row) for row in table]])
        (folder / f"{name}.csv.gz").write_bytes(gzip.compress(text.encode()))
        files[name] = {"path": f"{name}.csv.gz", "rows": len(table)}
    files |= changes.get("files", {})  # type: ignore[arg-type]
    (folder / "manifest.json").write_text(json.dumps({"dataset_id": "made up", "files": files}))
    return folder


def test_the_glitch_rule_masks_three_seconds_around_a_jump(tmp_path: Path) -> None:
    rec = sd.read(make_drive(tmp_path / "d"))
    position = rec.reference.position
    # fixes at 30.0 and 30.5 (and 31.0 just after) contradict it
    off = position.t[~position.valid]
    np.testing.assert_allclose([off[0], off[-1]], [27.0, 33.5], atol=0.11)


def test_the_mount_decides_the_attitude_of_the_box(tmp_path: Path) -> None:
    rec = sd.read(make_drive(tmp_path / "d"))
    a = rec.reference.attitude
    # C_vb = diag(1, -1, -1): a half turn about the nose, z of the box is up
    np.testing.assert_allclose(np.abs(a.q_nb[a.valid]), [[0, 1, 0, 0]] * a.valid.sum(), atol=1e-9)
    assert a.t[np.argmax(a.valid)] == 20.0


def test_an_angle_that_is_no_number_costs_its_own_sample_alone(tmp_path: Path) -> None:
    folder = make_drive(tmp_path / "d")
    sound = sd.read(folder).reference.attitude
    path = folder / "reference_attitude.csv.gz"
    lines = gzip.decompress(path.read_bytes()).decode().split("\n")
    lines[501] = "50,inf,1e-9,0"
    path.write_bytes(gzip.compress("\n".join(lines).encode()))
    attitude = sd.read(folder).reference.attitude
    assert np.flatnonzero(sound.valid != attitude.valid).tolist() == [500]


def test_a_file_of_the_manifest_that_is_missing_is_named(tmp_path: Path) -> None:
    folder = make_drive(tmp_path / "d")
    (folder / "gnss.csv.gz").unlink()
    with pytest.raises(FormatError, match=r"gnss\.csv\.gz: there is no such file"):
        sd.read(folder)


def test_fewer_rows_than_promised_are_refused(tmp_path: Path) -> None:
    folder = make_drive(tmp_path / "d", files={"imu": {"path": "imu.csv.gz", "rows": 4000}})
    with pytest.raises(FormatError, match=r"promises 4000 rows, found 3000; copy the folder"):
        sd.read(folder)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", r"manifest\.json: must be JSON"),
        ("[]", r"must list the files"),
        ('{"files": {"gnss": {"path": "x"}}}', r"must list imu, found gnss"),
    ],
)
def test_a_broken_manifest_is_explained(tmp_path: Path, text: str, sentence: str) -> None:
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(FormatError, match=sentence):
        sd.read(tmp_path)
