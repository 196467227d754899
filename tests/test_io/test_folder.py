"""One file per sensor: folders of phones and loggers, and files given one by one."""

from pathlib import Path

import numpy as np
import pytest
from small_logs import G, six_axes

import strapdown as sd
from strapdown.errors import FormatError
from strapdown.io import _imu
from strapdown.recording import Recording


def save(path: Path, head: str, table: np.ndarray) -> None:
    text = [",".join(f"{x:.17g}" for x in row) for row in table]
    path.write_text("\n".join([head, *text]) + "\n")


def phone(folder: Path, rate_acc: float = 100.0) -> Path:
    """A folder as Phyphox exports it."""
    folder.mkdir()
    t = np.arange(200) / 100.0
    t_acc = 0.003 + np.arange(int(2 * rate_acc)) / rate_acc
    gyr = np.column_stack((t, np.sin(t), np.cos(t), 0.1 * t))
    acc = np.column_stack((t_acc, 0 * t_acc, np.sin(t_acc), G + 0 * t_acc))
    mag = np.column_stack((t[::5], 20 + 0 * t[::5], 0 * t[::5], -44 + 0 * t[::5]))
    save(folder / "Gyroscope.csv", '"Time (s)","X (rad/s)","Y (rad/s)","Z (rad/s)"', gyr)
    save(folder / "Accelerometer.csv", '"Time (s)","X (m/s^2)","Y (m/s^2)","Z (m/s^2)"', acc)
    save(
        folder / "Linear Accelerometer.csv", '"Time (s)","X (m/s^2)","Y (m/s^2)","Z (m/s^2)"', acc
    )
    save(folder / "Magnetometer.csv", '"Time (s)","X (µT)","Y (µT)","Z (µT)"', mag)
    fix = '"Time (s)","Latitude (°)","Longitude (°)","Height (m)","Velocity (m/s)"'
    save(
        folder / "Location.csv",
        fix,
        np.array([[0.5, 47.0, 8.0, 400.0, 1.0], [1.5, 47.1, 8, 401, 2]]),
    )
    return folder


def test_a_phones_folder_becomes_one_recording(tmp_path: Path) -> None:
    rec = sd.read(phone(tmp_path / "walk"))
    assert rec.meta["format"] == "folder"
    assert len(rec.mag) == 40
    np.testing.assert_allclose(rec.mag.mag[0], [20e-6, 0, -44e-6], rtol=1e-15)
    np.testing.assert_allclose(rec.gnss.lla[1], [np.deg2rad(47.1), np.deg2rad(8), 401.0])
    # same rate, other instants: the gyroscope's axis, the accelerometer held
    assert rec.imu.t[0] == 0.01
    assert rec.imu.acc_real.all()
    np.testing.assert_allclose(rec.imu.acc[0], [0, np.sin(0.003), G])


def test_the_times_of_several_files_keep_one_origin(tmp_path: Path) -> None:
    folder = tmp_path / "log"
    folder.mkdir()
    start = 1717156800
    for name, head, shift in (
        ("Gyroscope", "time,seconds_elapsed,z,y,x", 0),
        ("TotalAcceleration", "time,seconds_elapsed,z,y,x", 2_000_000),
        ("Accelerometer", "time,seconds_elapsed,z,y,x", 0),
        ("Magnetometer", "time,seconds_elapsed,z,y,x", 5_000_000),
    ):
        size = {"TotalAcceleration": G, "Accelerometer": 0.01, "Magnetometer": 48.0}.get(name, 0.1)
        text = [
            f"{start * 10**9 + k * 10_000_000 + shift},{k / 100},{size},0,{0.01 * k}"
            for k in range(100)
        ]
        (folder / f"{name}.csv").write_text("\n".join([head, *text]))
    rec = sd.read(folder)
    assert rec.meta["epoch_utc"] == "2024-05-31T12:00:00Z"
    np.testing.assert_allclose(rec.imu.t, np.arange(1, 100) / 100, atol=1e-12)
    np.testing.assert_allclose(rec.mag.t[0], 0.005, atol=1e-12)
    np.testing.assert_allclose(rec.imu.acc[3], [0.03, 0.0, G])  # x is the last column
    np.testing.assert_allclose(rec.mag.mag[0], [0, 0, 48e-6], rtol=1e-15)  # as that app writes


def test_an_autopilots_folder_shares_its_microseconds(tmp_path: Path) -> None:
    t = 5e6 + 4000 * np.arange(100)
    one = np.ones(100)
    imu = np.column_stack((t, 0.1 * one, 0.2 * one, 0.3 * one, 0 * one, 0 * one, -G * one))
    names = [f"gyro_rad[{k}]" for k in range(3)] + [f"accelerometer_m_s2[{k}]" for k in range(3)]
    save(tmp_path / "log_sensor_combined_0.csv", ",".join(["timestamp", *names]), imu)
    air = np.column_stack((t[::5], 400 + one[::5], 95000 + one[::5]))
    head = "timestamp,baro_alt_meter,baro_pressure_pa"
    save(tmp_path / "log_vehicle_air_data_0.csv", head, air)
    rec = sd.read(tmp_path)
    np.testing.assert_allclose(rec.imu.t[[0, -1]], [5.0, 5.396])
    np.testing.assert_allclose(rec.baro.t, rec.imu.t[::5])
    assert rec.baro.pressure[0] == 95001.0


def test_two_recordings_in_a_folder_are_refused(tmp_path: Path) -> None:
    head = "t_s,gx_rad_s,gy_rad_s,gz_rad_s,ax_m_s2,ay_m_s2,az_m_s2"
    for name in ("monday.csv", "tuesday.csv"):
        save(tmp_path / name, head, six_axes())
    with pytest.raises(FormatError, match=r"one recording, these are several: monday\.csv, tue"):
        sd.read(tmp_path)


def test_files_given_one_by_one(tmp_path: Path) -> None:
    folder = phone(tmp_path / "walk")
    rec = sd.read(
        gyr=folder / "Gyroscope.csv",
        acc=folder / "Accelerometer.csv",
        mag=folder / "Magnetometer.csv",
        gnss=folder / "Location.csv",
    )
    whole = sd.read(folder)
    assert np.array_equal(rec.imu.gyr, whole.imu.gyr)
    assert np.array_equal(rec.mag.mag, whole.mag.mag)
    assert len(rec.gnss) == 2


def test_a_file_of_one_sensor_joins_a_log_of_any_format(
    tmp_path: Path, every_stream: Recording
) -> None:
    folder = phone(tmp_path / "walk")
    sd.write(every_stream, tmp_path / "a.parquet")
    rec = sd.read(tmp_path / "a.parquet", mag=folder / "Magnetometer.csv")
    assert len(rec.mag) == 40
    assert np.array_equal(rec.imu.t, every_stream.imu.t)
    table = six_axes()
    save(tmp_path / "imu.csv", "t,gx,gy,gz,ax,ay,az", table)
    rec = sd.read(imu=tmp_path / "imu.csv", mag=tmp_path / "a.parquet")
    assert np.array_equal(rec.mag.t, every_stream.mag.t)
    assert np.array_equal(rec.imu.gyr, table[:, 1:4])


def test_a_file_without_the_sensor_it_was_given_for_is_refused(tmp_path: Path) -> None:
    folder = phone(tmp_path / "walk")
    with pytest.raises(FormatError, match=r"stream mag: must hold mag_x, mag_y, mag_z, found"):
        sd.read(folder, mag=folder / "Location.csv")


def test_clocks_of_two_kinds_are_refused(tmp_path: Path) -> None:
    folder = phone(tmp_path / "walk")
    mag = np.column_stack((1717156800.0 + np.arange(40) / 10, np.tile([20.0, 0, 44], (40, 1))))
    save(folder / "Magnetometer.csv", "time_s,x_ut,y_ut,z_ut", mag)
    with pytest.raises(FormatError, match=r"all files must have one clock, some hold dates"):
        sd.read(folder)


# --- one axis for two rates ------------------------------------------------------------------


def test_a_slow_accelerometer_is_held_on(tmp_path: Path) -> None:
    rec = sd.read(phone(tmp_path / "walk", rate_acc=25.0))
    imu = rec.imu
    assert imu.gyr_real is None
    assert imu.acc_real.sum() == 50
    for k in np.flatnonzero(imu.acc_real):
        # the first axis sample at or after an accelerometer sample at 0.003 + j / 25
        since = (imu.t[k] - 0.003) % 0.04
        assert since < 0.01 + 1e-9
    held = np.sin(0.003 + np.floor((imu.t - 0.003) * 25 + 1e-9) / 25)
    np.testing.assert_allclose(imu.acc[:, 1], held, atol=1e-12)


def test_a_slow_gyroscope_is_held_back_over_the_interval_it_covers() -> None:
    t_gyr, t_acc = np.arange(1, 11) * 0.04, np.arange(1, 41) * 0.01
    gyr = np.column_stack((np.arange(10.0), np.zeros(10), np.zeros(10)))
    acc = np.tile([0, 0, -G], (40, 1))
    imu = _imu.merge(t_gyr, gyr, t_acc, acc, "log", [])
    assert imu.acc_real is None
    # sample j covers (t_j - 0.04, t_j]: the four axis samples up to it
    assert np.array_equal(imu.gyr[:, 0], np.repeat(np.arange(10.0), 4))
    assert np.array_equal(np.flatnonzero(imu.gyr_real), np.arange(3, 40, 4))
    # the turning is that of the gyroscope
    assert np.isclose((imu.gyr[:, 0] * 0.01).sum(), (gyr[:, 0] * 0.04).sum())


def test_a_gap_of_the_slower_sensor_is_not_bridged() -> None:
    t_gyr = np.arange(100) * 0.01
    t_acc = np.concatenate((np.arange(10) * 0.02, 0.6 + np.arange(20) * 0.02))
    imu = _imu.merge(t_gyr, np.zeros((100, 3)), t_acc, np.ones((30, 3)), "log", [])
    lost = imu.t[np.isnan(imu.acc).any(axis=1)]
    np.testing.assert_allclose([lost[0], lost[-1]], [0.25, 0.59], atol=1e-9)


def test_sensors_that_never_overlap_are_refused() -> None:
    t = np.arange(10) * 0.01
    with pytest.raises(FormatError, match=r"must overlap in time, they span 0 to 0\.09 s and 5 t"):
        _imu.merge(t, np.zeros((10, 3)), t + 5, np.zeros((10, 3)), "log", [])
