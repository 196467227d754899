"""The native format: bit for bit, readable by other tools."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from small_logs import assert_same, six_axes

import strapdown as sd
from strapdown import io
from strapdown.errors import FormatError
from strapdown.recording import Imu, Mag, Recording
from strapdown.solution import Diagnostics, Solution


def test_every_stream_comes_back_bit_for_bit(tmp_path: Path, every_stream: Recording) -> None:
    path = tmp_path / "log.parquet"
    sd.write(every_stream, path)
    assert_same(sd.read(path), every_stream)


def test_a_copy_of_a_copy_is_the_same_file(tmp_path: Path, every_stream: Recording) -> None:
    sd.write(every_stream, tmp_path / "a.parquet")
    sd.write(sd.read(tmp_path / "a.parquet"), tmp_path / "b.parquet")
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_nan_keeps_its_bits(tmp_path: Path) -> None:
    odd = np.array([0x7FF8000000000123, 0xFFF0000000000001], dtype=np.uint64).view(float)
    table = six_axes()
    table[3, 1], table[4, 5] = odd
    rec = Recording(imu=Imu(t=table[:, 0], gyr=table[:, 1:4], acc=table[:, 4:]))
    sd.write(rec, tmp_path / "a.parquet")
    back = sd.read(tmp_path / "a.parquet")
    assert back.imu.gyr.tobytes() == rec.imu.gyr.tobytes()
    assert back.imu.acc.tobytes() == rec.imu.acc.tobytes()


def test_empty_streams_and_a_bare_recording_survive(tmp_path: Path) -> None:
    rec = Recording(mag=Mag(t=np.empty(0), mag=np.empty((0, 3))), meta={"name": "none"})
    sd.write(rec, tmp_path / "a.parquet")
    back = sd.read(tmp_path / "a.parquet")
    assert len(back.mag) == 0
    assert back.imu is None


def test_streams_longer_than_a_row_group_come_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, every_stream: Recording
) -> None:
    monkeypatch.setattr("strapdown.io.parquet._ROWS", 64)
    sd.write(every_stream, tmp_path / "a.parquet")
    assert pq.ParquetFile(tmp_path / "a.parquet").num_row_groups > 10
    assert_same(sd.read(tmp_path / "a.parquet"), every_stream)


def test_other_tools_find_streams_by_a_column_and_si_by_names(
    tmp_path: Path, every_stream: Recording
) -> None:
    sd.write(every_stream, tmp_path / "a.parquet")
    table = pq.read_table(tmp_path / "a.parquet", filters=[("stream", "==", "mag")])
    assert table.column("t_s").to_pylist() == every_stream.mag.t.tolist()
    assert np.array_equal(
        table.column("mag_y_t").to_numpy(), every_stream.mag.mag[:, 1], equal_nan=True
    )
    assert table.column("gyr_x_rad_s").null_count == len(table)
    header = json.loads(pq.read_schema(tmp_path / "a.parquet").metadata[b"strapdown"])
    assert header["streams"]["imu"]["fields"] == ["gyr", "acc", "acc_real"]


def test_a_table_of_other_origin_is_recognised_by_names(tmp_path: Path) -> None:
    table = six_axes()
    names = ["timestamp", "gyro_x_dps", "gyro_y_dps", "gyro_z_dps", "ax", "ay", "az"]
    columns = dict(zip(names, table.T, strict=True))
    columns["timestamp"] = (1717156800 * 10**9 + np.arange(50) * 10**7).astype("datetime64[ns]")
    pq.write_table(pa.table(columns), tmp_path / "a.parquet")
    rec = sd.read(tmp_path / "a.parquet")
    np.testing.assert_allclose(rec.imu.t, table[:, 0], atol=1e-12)
    np.testing.assert_allclose(rec.imu.gyr, np.deg2rad(table[:, 1:4]), rtol=1e-15)
    assert rec.meta["epoch_utc"] == "2024-05-31T12:00:00Z"


def test_read_raw_lists_each_stream(tmp_path: Path, every_stream: Recording) -> None:
    sd.write(every_stream, tmp_path / "a.parquet")
    raw = io.read_raw(tmp_path / "a.parquet")
    assert [t.stream for t in raw.tables][:2] == ["imu", "mag"]
    names = [c.name for c in raw.table("imu").columns]
    assert names[:2] == ["t_s", "gyr_x_rad_s"]


def test_a_later_version_asks_for_an_update(tmp_path: Path) -> None:
    header = json.dumps({"format_version": 99, "kind": "recording", "meta": {}, "streams": {}})
    table = pa.table({"t_s": [0.0]}).replace_schema_metadata({"strapdown": header})
    pq.write_table(table, tmp_path / "a.parquet")
    with pytest.raises(FormatError, match=r"format version 99, this program knows up to 1; upd"):
        sd.read(tmp_path / "a.parquet")


# --- solutions ------------------------------------------------------------------------------


@pytest.fixture
def sol(rng: np.random.Generator) -> Solution:
    n = 40
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    lla = rng.normal(size=(n, 3))
    lla[:3] = np.nan
    return Solution(
        t=np.arange(n) * 0.01,
        q_nb=q,
        status=rng.integers(0, 4096, n),
        filter="mekf",
        heading_reference="magnetic",
        gyr_bias=rng.normal(size=(n, 3)),
        std_attitude_n=rng.uniform(size=(n, 3)),
        lla=lla,
        v_n=rng.normal(size=(n, 3)),
        q_vb=q,
        diagnostics={
            "acc": Diagnostics(
                t=np.zeros(1),
                innovation=np.zeros((1, 3)),
                sigma=np.ones((1, 3)),
                outcome=np.zeros(1, dtype=np.int64),
                labels=("x", "y", "z"),
            )
        },
        meta={"beta": 0.1},
    )


def test_a_solution_comes_back_bit_for_bit_without_diagnostics(
    tmp_path: Path, sol: Solution
) -> None:
    path = tmp_path / "solution.parquet"
    io.write_solution(sol, path)
    back = io.read_solution(path)
    for name in ("t", "q_nb", "status", "gyr_bias", "std_attitude_n", "lla", "v_n", "q_vb"):
        a, b = getattr(sol, name), getattr(back, name)
        assert a.dtype == b.dtype
        assert a.tobytes() == b.tobytes(), name
    assert back.acc_bias is None
    assert (back.filter, back.causal, back.heading_reference) == ("mekf", True, "magnetic")
    assert back.meta == {"beta": 0.1}
    assert back.diagnostics == {}


def test_the_columns_of_a_solution_are_those_of_the_contract(
    tmp_path: Path, sol: Solution
) -> None:
    path = tmp_path / "solution.parquet"
    io.write_solution(sol, path)
    names = pq.read_schema(path).names
    assert names[:5] == ["t_s", "q_nb_w", "q_nb_x", "q_nb_y", "q_nb_z"]
    assert names[5:11] == ["lat_rad", "lon_rad", "height_m", "v_n_m_s", "v_e_m_s", "v_d_m_s"]
    assert names[11:15] == ["q_vb_w", "q_vb_x", "q_vb_y", "q_vb_z"]
    assert names[15].startswith("gyr_bias_")
    assert names[-1] == "status"


def test_a_solution_in_csv_holds_the_same_numbers(tmp_path: Path, sol: Solution) -> None:
    io.write_solution(sol, tmp_path / "s.csv")
    lines = (tmp_path / "s.csv").read_text().splitlines()
    assert lines[0].replace('"', "").startswith("t_s,q_nb_w,")
    assert [float(x) for x in lines[6].split(",")[1:5]] == sol.q_nb[5].tolist()


def test_a_solution_refuses_other_endings_and_damage(tmp_path: Path, sol: Solution) -> None:
    with pytest.raises(FormatError, match=r"written as \.parquet, \.csv, \.kml, .*got '\.json'"):
        io.write_solution(sol, tmp_path / "s.json")
    path = tmp_path / "s.parquet"
    io.write_solution(sol, path)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(FormatError, match=r"cut off or damaged"):
        io.read_solution(path)
    with pytest.raises(FormatError, match=r"there is no such file"):
        io.read_solution(tmp_path / "none.parquet")
