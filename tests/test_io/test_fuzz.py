"""Whatever is in a file, reading it ends in a recording or in an error of this package."""

import gzip
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat
from small_logs import six_axes

import strapdown as sd
from strapdown import io
from strapdown.errors import InputError
from strapdown.recording import Recording, from_arrays

RELAXED = settings(
    max_examples=150,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    derandomize=True,
)


def ends_well(path: Path, **options: object) -> None:
    """Read a file both ways; only errors that are explained may come out."""
    for read in (sd.read, io.read_raw):
        try:
            read(path, **options if read is sd.read else {})
        except InputError as error:
            text = str(error)
            assert text.endswith(".")
            assert "\n" not in text.split(str(path))[-1][:40]


SPELLINGS = (
    "t time_s timestamp time_us gx gy gz gyr_x_dps gyr_y_dps gyr_z_dps ax ay az acc_x_g mx my mz "
    "mag_x_ut lat lon alt vn ve vd qw qx qy qz roll pitch yaw pressure_hpa temp speed ref_q_nb_w "
    "state x y z %time [0] gyro_rad[0] (m/s^2)"
)
NAMES = st.sampled_from(SPELLINGS.split(" "))
CELLS = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True).map(repr),
    st.integers(-(10**20), 10**20).map(str),
    st.sampled_from(
        ["", "nan", "NA", "inf", "x", "1,5", '"', "2024-05-31T12:00:00Z", "12:00:01", "1e400",
         "0x10", "1_0", "--", "²", "\x00", "9999-12-31 23:59:59", "1,2,3", "#", "true"]
    ),
)  # fmt: skip


@RELAXED
@given(
    names=st.lists(NAMES, min_size=1, max_size=10),
    rows=st.lists(st.lists(CELLS, min_size=0, max_size=11), max_size=8),
    delimiter=st.sampled_from([",", ";", "\t", " ", "|"]),
    packed=st.booleans(),
)
def test_tables_of_odd_cells(
    tmp_path: Path, names: list[str], rows: list[list[str]], delimiter: str, packed: bool
) -> None:
    content = "\n".join(delimiter.join(cells) for cells in [names, *rows]).encode()
    path = tmp_path / "log.csv"
    path.write_bytes(gzip.compress(content) if packed else content)
    ends_well(path)
    ends_well(path, repair_time="sort", rate=100.0)


@RELAXED
@given(content=st.binary(min_size=0, max_size=400))
def test_bytes_of_any_kind(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.bin"
    path.write_bytes(content)
    ends_well(path)


@RELAXED
@given(content=st.text(alphabet="tgaxyz_0123456789.,;-+eE \n#\"'[]()naif\r\t", max_size=300))
def test_texts_of_any_kind(tmp_path: Path, content: str) -> None:
    path = tmp_path / "log.txt"
    path.write_text(content)
    ends_well(path)


@RELAXED
@given(
    position=st.floats(0, 1, exclude_max=True),
    junk=st.binary(min_size=1, max_size=12),
    insert=st.booleans(),
)
def test_a_sound_table_with_junk_in_it(
    tmp_path: Path, position: float, junk: bytes, insert: bool
) -> None:
    head = b"t_s,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g\n"
    table = six_axes(30)
    table[:, 4:] /= 9.8
    body = "\n".join(",".join(f"{x:.6g}" for x in row) for row in table).encode()
    content = head + body
    k = int(position * len(content))
    path = tmp_path / "log.csv"
    path.write_bytes(content[:k] + junk + content[k if insert else k + len(junk) :])
    ends_well(path)


def small(tmp_path: Path, kind: str) -> bytes:
    """Content of a sound binary file."""
    table = six_axes(40)
    rec = from_arrays(table[:, 0], table[:, 1:4], table[:, 4:], mag=table[:, 4:] * 1e-6)
    path = tmp_path / f"sound.{kind}"
    if kind == "parquet":
        sd.write(rec, path)
    else:
        arrays = {"imu_gyr": table[:, 1:4], "imu_acc": table[:, 4:], "sampling_rate": 100.0}
        if kind == "mat":
            savemat(path, arrays, do_compression=True)
        else:
            import h5py

            with h5py.File(path, "w") as file:
                for name, value in arrays.items():
                    file[name] = value
    return path.read_bytes()


@pytest.mark.parametrize("kind", ["parquet", "mat", "hdf5"])
def test_binary_files_cut_off_or_damaged(tmp_path: Path, kind: str) -> None:
    sound = small(tmp_path, kind)
    rng = np.random.default_rng(11)
    path = tmp_path / f"damaged.{kind}"
    for k in range(120):
        content = bytearray(sound)
        if k % 3 == 0:
            del content[int(rng.integers(len(content))) :]
        else:
            for _ in range(int(rng.integers(1, 6))):
                content[int(rng.integers(len(content)))] = int(rng.integers(256))
        path.write_bytes(content)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the libraries warn of what they then refuse
            ends_well(path)


@RELAXED
@given(
    n=st.integers(1, 30),
    seed=st.integers(0, 2**32 - 1),
    lost=st.floats(0, 1),
)
def test_native_files_keep_any_numbers(tmp_path: Path, n: int, seed: int, lost: float) -> None:
    rng = np.random.default_rng(seed)
    bits = rng.integers(0, 2**64, (n, 6), dtype=np.uint64).view(float)
    beyond = ~(np.abs(bits) < 1e75)  # no quantity in SI is as large: a recording refuses it
    values = np.where(beyond | (rng.random((n, 6)) < lost), np.nan, bits)
    rec: Recording = from_arrays(np.cumsum(rng.uniform(1e-6, 1, n)), values[:, :3], values[:, 3:])
    sd.write(rec, tmp_path / "a.parquet")
    back = sd.read(tmp_path / "a.parquet")
    assert back.imu.gyr.tobytes() == rec.imu.gyr.tobytes()
    assert back.imu.acc.tobytes() == rec.imu.acc.tobytes()
    assert back.imu.t.tobytes() == rec.imu.t.tobytes()
