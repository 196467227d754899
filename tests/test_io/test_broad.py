"""BROAD trials in MATLAB 5, MATLAB 7.3 and HDF5, against SciPy and the data set's own metric."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy.io import loadmat, savemat
from scipy.spatial.transform import Rotation
from small_logs import assert_same

import strapdown as sd
from strapdown import io
from strapdown.errors import FormatError


@pytest.fixture
def trial() -> dict[str, Any]:
    rng = np.random.default_rng(5)
    q = rng.normal(size=(200, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    q[10:14] = np.nan
    return {
        "imu_gyr": rng.normal(size=(200, 3)),
        "imu_acc": rng.normal(size=(200, 3)) + [0, 0, 9.8],
        "imu_mag": rng.normal(size=(200, 3)) + [20, 0, -40],
        "opt_quat": q,
        "movement": (np.arange(200) > 50).astype(np.uint8)[:, None],
        "sampling_rate": 250.0,
    }


def as_mat5(path: Path, trial: dict[str, Any]) -> Path:
    savemat(path, trial, do_compression=True)
    return path


def as_hdf5(path: Path, trial: dict[str, Any]) -> Path:
    with h5py.File(path, "w") as file:
        for name, value in trial.items():
            if name == "sampling_rate":
                file.attrs[name] = value
            else:
                file[name] = value if name != "movement" else value[:, 0]
    return path


def as_mat73(path: Path, trial: dict[str, Any]) -> Path:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in trial.items():
            file[name] = np.atleast_2d(value).T  # MATLAB stores columns first
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
    return path


WRITERS = {"trial.mat": as_mat5, "trial.hdf5": as_hdf5, "trial73.mat": as_mat73}


@pytest.mark.parametrize("name", WRITERS)
def test_all_three_containers_give_the_same_recording(
    tmp_path: Path, trial: dict[str, Any], name: str
) -> None:
    rec = sd.read(WRITERS[name](tmp_path / name, trial))
    assert rec.meta["format"] == "broad"
    assert np.array_equal(rec.imu.t, np.arange(200) / 250.0)
    assert np.array_equal(rec.imu.gyr, trial["imu_gyr"])
    np.testing.assert_allclose(rec.mag.mag, trial["imu_mag"] * 1e-6, rtol=1e-15)
    assert rec.reference.heading == "magnetic"
    valid = rec.reference.attitude.valid
    assert np.array_equal(np.flatnonzero(valid), np.arange(51, 200))
    assert np.isnan(rec.reference.attitude.q_nb[10:14]).all()


def test_the_mask_is_off_where_the_optical_reference_is_lost(
    tmp_path: Path, trial: dict[str, Any]
) -> None:
    trial["movement"][:] = 1
    rec = sd.read(as_hdf5(tmp_path / "a.hdf5", trial))
    assert np.array_equal(np.flatnonzero(~rec.reference.attitude.valid), [10, 11, 12, 13])


def test_the_optical_attitude_turns_enu_into_ned(tmp_path: Path, trial: dict[str, Any]) -> None:
    rec = sd.read(as_mat5(tmp_path / "a.mat", trial))
    v_b = np.array([0.3, -0.2, 0.9])
    e, n, u = Rotation.from_quat(trial["opt_quat"][20][[1, 2, 3, 0]]).apply(v_b)
    v_n = Rotation.from_quat(rec.reference.attitude.q_nb[20][[1, 2, 3, 0]]).apply(v_b)
    np.testing.assert_allclose(v_n, [n, e, -u], atol=1e-15)


def test_a_real_trial_agrees_with_its_sensors(broad_02: Path) -> None:
    rec = sd.read(broad_02)
    file = loadmat(broad_02)
    assert np.array_equal(rec.imu.acc, file["imu_acc"])
    assert rec.reference.attitude.valid.sum() == file["movement"].sum()
    seen = ~np.isnan(rec.reference.attitude.q_nb).any(axis=1)
    C_nb = Rotation.from_quat(rec.reference.attitude.q_nb[seen][:, [1, 2, 3, 0]])
    f_n = C_nb.apply(rec.imu.acc[seen]).mean(axis=0)
    # accelerometer bias below 0.1 m/s^2; motion averages out
    np.testing.assert_allclose(f_n, [0.0, 0.0, -9.81], atol=0.1)
    m_n = C_nb.apply(rec.mag.mag[seen]).mean(axis=0)
    assert m_n[0] > 10e-6  # magnetic north, Berlin
    assert m_n[2] > 30e-6  # and down
    assert abs(np.arctan2(m_n[1], m_n[0])) < np.deg2rad(6.0)


def test_a_trial_survives_parquet(tmp_path: Path, broad_02: Path) -> None:
    rec = sd.read(broad_02)
    sd.write(rec, tmp_path / "a.parquet")
    assert_same(sd.read(tmp_path / "a.parquet"), rec)


def test_another_mat_file_lists_what_it_holds(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"x": np.zeros(3), "gyro": np.zeros(3)})
    with pytest.raises(FormatError, match=r"must hold imu_gyr, found gyro, x; export"):
        sd.read(tmp_path / "a.mat")
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["y"] = [1.0]
    with pytest.raises(FormatError, match=r"must hold imu_gyr, found y"):
        sd.read(tmp_path / "a.hdf5")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"imu_acc": np.zeros((9, 3))}, r"imu_acc must have shape \(200, 3\) like imu_gyr, got"),
        ({"imu_gyr": np.full((200, 3), np.nan)}, r"stream imu_gyr: a sensor must have numbers"),
        ({"sampling_rate": -1.0}, r"sampling_rate must be one positive number"),
        ({"imu_gyr": np.array(["a"] * 200)}, r"imu_gyr must hold numbers, got"),
        ({"opt_quat": np.full((200, 4), 0.7)}, r"must have unit norm"),
        ({"imu_acc": np.full((200, 3), np.inf)}, r"`imu\.acc` must be finite or NaN"),
    ],
)
def test_a_wrong_variable_is_named(
    tmp_path: Path, trial: dict[str, Any], change: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(FormatError, match=sentence):
        sd.read(as_mat5(tmp_path / "a.mat", trial | change))


@pytest.mark.parametrize("keep", [0.01, 0.4, 0.95])
@pytest.mark.parametrize("name", ["trial.hdf5", "trial73.mat"])
def test_a_truncated_hdf5_is_called_damaged(
    tmp_path: Path, trial: dict[str, Any], name: str, keep: float
) -> None:
    path = WRITERS[name](tmp_path / name, trial)
    path.write_bytes(path.read_bytes()[: max(int(keep * path.stat().st_size), 130)])
    with pytest.raises(FormatError, match=r"(HDF5 file is cut off or damaged|no known format)"):
        sd.read(path)


def test_read_raw_keeps_the_units_of_the_file(tmp_path: Path, trial: dict[str, Any]) -> None:
    raw = io.read_raw(as_mat5(tmp_path / "a.mat", trial))
    column = raw.table("imu_mag").columns[2]
    assert column.name == "imu_mag[2]"
    assert column.unit.name == "ut"
    assert np.array_equal(column.values, trial["imu_mag"][:, 2])


def test_reading_a_trial_loads_neither_pandas_nor_numba(broad_02: Path) -> None:
    code = (
        "import sys, strapdown as sd; sd.read(sys.argv[1]); "
        "print([m for m in ('pandas', 'numba', 'plotly', 'h5py', 'pyarrow') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(broad_02)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
