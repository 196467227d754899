"""Bad input: one sentence says what is wrong, where, and the way out; nothing is half written."""

import gzip
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_logs import G, six_axes

import strapdown as sd
from strapdown import io
from strapdown.errors import FormatError, InputError
from strapdown.recording import Recording, from_arrays

Write = Callable[..., Path]
HEAD = "t_s,gx_rad_s,gy_rad_s,gz_rad_s,ax_m_s2,ay_m_s2,az_m_s2"


def rows(table: np.ndarray) -> list[str]:
    return [",".join(f"{x:.17g}" for x in row) for row in table]


# --- files that are not there, or not what they should be ------------------------------------


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"no\.csv: there is no such file or folder\."):
        sd.read(tmp_path / "no.csv")
    with pytest.raises(FormatError, match="there is no such file"):
        sd.read(tmp_path / "no.csv", format="csv")


def test_a_folder_without_manifest_or_tables_says_what_it_holds(tmp_path: Path) -> None:
    (tmp_path / "photo.jpg").write_bytes(b"x")
    with pytest.raises(
        FormatError, match=r"must hold manifest\.json, or a CSV file for each sensor.*photo\.jpg"
    ):
        sd.read(tmp_path)


def test_an_empty_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"for each sensor, found nothing"):
        sd.read(tmp_path)


@pytest.mark.parametrize("content", [b"", b"\n\n  \n", gzip.compress(b"", mtime=0)])
def test_an_empty_file_is_called_empty(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=r"log\.csv: the file is empty"):
        sd.read(path)


def test_a_header_without_rows_is_named(write_text: Write) -> None:
    with pytest.raises(FormatError, match=r"holds a header \(t_s, gx_rad_s.*but no row of num"):
        sd.read(write_text(HEAD))


def test_unknown_columns_are_listed_with_the_way_out(write_text: Write) -> None:
    path = write_text("time_s,G1,G2,G3", *rows(six_axes()[:, :4]))
    with pytest.raises(FormatError, match=r"(?s)no column is known.*found.*--columns t=NAME"):
        sd.read(path)


def test_a_table_without_header_asks_for_columns(write_text: Write) -> None:
    with pytest.raises(FormatError, match=r"has no header, only 7 columns.*--columns t=0"):
        sd.read(write_text(*rows(six_axes())))


def test_a_missing_axis_is_named(write_text: Write) -> None:
    path = write_text(HEAD.replace("gz_rad_s", "spare"), *rows(six_axes()))
    with pytest.raises(FormatError, match=r"gyr needs gyr_x, gyr_y, gyr_z, found only 'gx_rad_s'"):
        sd.read(path)


def test_a_missing_accelerometer_is_named(write_text: Write) -> None:
    path = write_text("t_s,gx_dps,gy_dps,gz_dps", *rows(six_axes()[:, :4]))
    with pytest.raises(FormatError, match=r"accelerometer is missing; give its file with acc="):
        sd.read(path)


def test_a_missing_time_column_asks_for_the_rate(write_text: Write) -> None:
    path = write_text(HEAD[4:], *rows(six_axes()[:, 1:]))
    with pytest.raises(FormatError, match=r"must be a column of times.*--rate HZ"):
        sd.read(path)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"PK\x03\x04" + bytes(50), "zip archive: unpack it"),
        (b"ULog\x01\x12\x35" + bytes(50), "PX4 ULog: export it as CSV"),
        (bytes(range(256)), "is of no known format"),
    ],
)
def test_other_formats_are_named(tmp_path: Path, content: bytes, sentence: str) -> None:
    path = tmp_path / "log.bin"
    path.write_bytes(content)
    with pytest.raises(FormatError, match=sentence):
        sd.read(path)


# --- cells, rows and times ------------------------------------------------------------------


def test_text_in_a_number_column_is_named_with_its_line(write_text: Write) -> None:
    text = rows(six_axes())
    text[10] = text[10].rsplit(",", 1)[0] + ",err"
    text[4:4] = ["# remark", ""]
    with pytest.raises(
        FormatError, match=r"log\.csv, stream az_m_s2, row 14: must hold numbers, got 'err'"
    ):
        sd.read(write_text(HEAD, *text))


def test_text_far_down_a_long_file_is_found(write_text: Write) -> None:
    text = rows(six_axes(60_000))  # several blocks
    text[59_000] = "x" + text[59_000]
    with pytest.raises(FormatError, match=r"stream t_s, row 59002: must hold numbers, got 'x"):
        sd.read(write_text(HEAD, *text))


def test_a_row_of_another_width_is_named(write_text: Write) -> None:
    text = rows(six_axes())
    text[20] += ",5"
    with pytest.raises(FormatError, match=r"row 22: every row must have 7 cells.*got 8"):
        sd.read(write_text(HEAD, *text))


@pytest.mark.parametrize(("k", "verb"), [(7, "is repeated"), (3, "goes back")])
def test_times_that_do_not_advance_are_named_with_line_and_way_out(
    write_text: Write, k: int, verb: str
) -> None:
    table = six_axes()
    table[8, 0] = table[k, 0]
    with pytest.raises(
        FormatError, match=rf"stream imu, row 10: time must increase, it {verb}.*--repair-time"
    ):
        sd.read(write_text(HEAD, *rows(table)))


def test_a_row_without_time_is_named(write_text: Write) -> None:
    text = rows(six_axes())
    text[5] = "," + text[5].split(",", 1)[1]
    with pytest.raises(FormatError, match=r"row 7: every row must have a time.*holds nothing"):
        sd.read(write_text(HEAD, *text))
    assert len(sd.read(write_text(HEAD, *text), repair_time="drop").imu) == 49


def test_an_infinite_sample_is_named(write_text: Write) -> None:
    table = six_axes()
    table[5, 4] = np.inf
    with pytest.raises(FormatError, match=r"row 7: `imu\.acc` must be finite or NaN, got"):
        sd.read(write_text(HEAD, *rows(table)))


@pytest.mark.parametrize("columns", [slice(1, 4), slice(4, 7)])
def test_a_sensor_of_nan_only_is_refused(write_text: Write, columns: slice) -> None:
    table = six_axes()
    table[:, columns] = np.nan
    with pytest.raises(FormatError, match=r"all 50 samples of '[ga]x_\w+' are NaN"):
        sd.read(write_text(HEAD, *rows(table)))


def test_an_aiding_sensor_of_nan_only_is_refused_and_an_empty_one_left_out(
    write_text: Write,
) -> None:
    head = HEAD + ",mx_ut,my_ut,mz_ut"
    with pytest.raises(FormatError, match=r"stream mag: a sensor must have numbers, all 50"):
        sd.read(write_text(head, *[r + ",nan,nan,nan" for r in rows(six_axes())]))
    rec = sd.read(write_text(head, *[r + ",,," for r in rows(six_axes())]))
    assert rec.mag is None
    assert "the columns of mag are empty" in " ".join(rec.meta["notes"])


# --- units ----------------------------------------------------------------------------------


def test_mixed_units_of_one_sensor_are_refused(write_text: Write) -> None:
    path = write_text(HEAD.replace("gy_rad_s", "gy_dps"), *rows(six_axes()))
    with pytest.raises(FormatError, match=r"one unit, found 'gx_rad_s' rad/s, 'gy_dps' °/s"):
        sd.read(path)
    assert sd.read(path, units="gyr=rad_s").imu is not None


@pytest.mark.parametrize(
    ("group", "scale", "said"),
    [
        ("gyr", 57.3 * 10, r"peak size is .* they look like °/s.*--units gyr=dps"),
        ("acc", 1 / G, r"typical size is 0.99.* they look like g.*--units acc=g"),
        ("acc", 1000 / G, r"they look like mg.*--units acc=mg"),
        ("mag", 1e6, r"they look like µT.*--units mag=ut"),
        ("mag", 1e9, r"they look like nT.*--units mag=nt"),
    ],
)
def test_numbers_that_contradict_si_name_the_units_option(
    write_text: Write, group: str, scale: float, said: str
) -> None:
    table = six_axes(200)
    table = np.column_stack((table, np.tile([20e-6, 1e-6, 44e-6], (200, 1))))
    columns = {"gyr": slice(1, 4), "acc": slice(4, 7), "mag": slice(7, 10)}[group]
    table[:, columns] *= scale
    path = write_text("t_s,gx,gy,gz,ax,ay,az,mx,my,mz", *rows(table))
    with pytest.raises(
        FormatError, match=rf"(?s)stream {group}: .*state no unit and cannot.*{said}"
    ):
        sd.read(path)


def test_linear_acceleration_without_gravity_is_refused(write_text: Write) -> None:
    table = six_axes()
    table[:, 4:] -= [0, 0, -G]
    path = write_text("t_s,gx,gy,gz,ax,ay,az", *rows(table))
    with pytest.raises(FormatError, match=r"specific force must contain gravity"):
        sd.read(path)
    assert sd.read(path, units="acc=m_s2").imu is not None


def test_a_time_that_cannot_be_in_seconds_names_the_unit(write_text: Write) -> None:
    table = six_axes()
    table[:, 0] = 10 * np.arange(50)
    with pytest.raises(
        FormatError, match=r"'timestamp' states no unit and cannot be in s.*ms it would be 100 Hz"
    ):
        sd.read(write_text(HEAD.replace("t_s", "timestamp"), *rows(table)))


def test_a_unit_that_is_none_is_refused(write_text: Write) -> None:
    path = write_text(HEAD.replace("gx_rad_s", "gx (LSB)"), *rows(six_axes()))
    with pytest.raises(FormatError, match=r"'gx \(LSB\)' is in 'LSB', which is no unit of angul"):
        sd.read(path)


# --- options --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"units": "gyr=furlong"}, r"unknown unit 'furlong'"),
        ({"units": "gyro=dps"}, r"`units` must name a sensor.*nearest name is 'gyr"),
        ({"units": "gyr"}, r"`units` must be written key=value, got 'gyr'"),
        ({"columns": {"gyr_q": "gx"}}, r"`columns` must name one of"),
        (
            {"columns": {"gyr_x": "gq_rad_s"}},
            r"`columns` asks for 'gq_rad_s' as gyr_x.*nearest name is 'gz_rad_s'",
        ),
        ({"columns": {"gyr_x": 99}}, r"the file has columns 0 to 6"),
        ({"axes": "x,y"}, r"`axes` must name x, y and z once each"),
        ({"axes": "x,y,y"}, r"`axes` must name x, y and z once each"),
        ({"axes": "x,-y,z"}, r"must keep the box right-handed.*mag=x,-y,z"),
        ({"axes": "nose=x,y,z"}, r"`axes` must name imu, gyr, acc or mag, got 'nose'"),
        ({"rate": -1}, r"`rate` must be positive"),
        ({"repair_time": "guess"}, r"`repair_time` must be one of drop, sort"),
        ({"delimiter": ",,"}, r"`delimiter` must be one character"),
        ({"start": 2, "stop": 1}, r"`start` must be before `stop`, got 2 and 1"),
        ({"format": "csw"}, r"`format` must be one of .*nearest name is 'csv'"),
    ],
)
def test_wrong_options_are_explained(write_text: Write, options: dict, sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        sd.read(write_text(HEAD, *rows(six_axes())), **options)


def test_options_of_text_are_refused_for_formats_that_state_all(
    tmp_path: Path, every_stream: Recording
) -> None:
    sd.write(every_stream, tmp_path / "a.parquet")
    with pytest.raises(InputError, match=r"the format parquet takes no option `delimiter`"):
        sd.read(tmp_path / "a.parquet", delimiter=";")


def test_nothing_to_read_is_an_input_error() -> None:
    with pytest.raises(InputError, match=r"`path` must name a log"):
        sd.read()


# --- damaged files -----------------------------------------------------------------------


@pytest.mark.parametrize("keep", [0.3, 0.9])
def test_a_truncated_gzip_is_called_damaged(tmp_path: Path, keep: float) -> None:
    packed = gzip.compress("\n".join([HEAD, *rows(six_axes(5000))]).encode())
    path = tmp_path / "log.csv.gz"
    path.write_bytes(packed[: int(keep * len(packed))])
    with pytest.raises(FormatError, match=r"gzip packing is damaged or cut off"):
        sd.read(path)


@pytest.mark.parametrize("keep", [0.02, 0.5, 0.999])
def test_a_truncated_parquet_is_called_damaged(
    tmp_path: Path, every_stream: Recording, keep: float
) -> None:
    path = tmp_path / "log.parquet"
    sd.write(every_stream, path)
    path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
    with pytest.raises(FormatError, match=r"log\.parquet: the Parquet file is cut off or damaged"):
        sd.read(path)


@pytest.mark.parametrize("keep", [0.001, 0.3, 0.9])
def test_a_truncated_mat_file_is_called_damaged(
    tmp_path: Path, broad_02: Path, keep: float
) -> None:
    content = broad_02.read_bytes()
    path = tmp_path / "trial.mat"
    path.write_bytes(content[: int(keep * len(content))])
    with pytest.raises(
        FormatError, match=r"trial\.mat: (the MATLAB file is cut|a trial of BROAD)"
    ):
        sd.read(path)


# --- writing ---------------------------------------------------------------------------------


@pytest.fixture
def small() -> Recording:
    table = six_axes()
    return from_arrays(table[:, 0], table[:, 1:4], table[:, 4:], name="small")


def test_a_folder_without_write_permission_is_named(
    tmp_path: Path, small: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed = tmp_path / "closed"
    closed.mkdir()
    if os.geteuid() == 0:  # root may write anywhere: the system's refusal is made up

        def refuse(*args: object, **kwargs: object) -> None:
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("tempfile.mkstemp", refuse)
    else:
        closed.chmod(0o500)
    with pytest.raises(FormatError, match=r"a\.parquet: cannot be written: permission denied"):
        sd.write(small, closed / "a.parquet")
    assert list(closed.iterdir()) == []


def test_a_file_without_read_permission_is_named(
    write_text: Write, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_text(HEAD, *rows(six_axes()))
    if os.geteuid() == 0:

        def refuse(*args: object, **kwargs: object) -> None:
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(Path, "open", refuse)
    else:
        path.chmod(0)
    with pytest.raises(FormatError, match=r"log\.csv: may not be read: permission denied"):
        sd.read(path)


def test_a_missing_folder_is_named(tmp_path: Path, small: Recording) -> None:
    with pytest.raises(FormatError, match=r"cannot be written: there is no folder '.*nowhere'"):
        sd.write(small, tmp_path / "nowhere" / "a.csv")


def test_another_ending_lists_those_that_are_written(tmp_path: Path, small: Recording) -> None:
    with pytest.raises(FormatError, match=r"written as \.parquet, .*\.csv.*got 'a\.mat'"):
        sd.write(small, tmp_path / "a.mat")
    with pytest.raises(InputError, match=r"the format broad is read, not written"):
        sd.write(small, tmp_path / "a.mat", format="broad")


@pytest.mark.parametrize("name", ["a.parquet", "a.csv", "a.csv.gz"])
def test_a_failure_half_way_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, small: Recording, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    path = tmp_path / name
    path.write_bytes(b"old")

    def full(*args: object, **kwargs: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pyarrow.csv.write_csv", full)
    monkeypatch.setattr("pyarrow.parquet.ParquetWriter.write_table", full)
    with pytest.raises(FormatError, match=r"cannot be written: No space left on device"):
        sd.write(small, path)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_metadata_that_json_cannot_hold_are_refused(tmp_path: Path) -> None:
    table = six_axes()
    rec = from_arrays(table[:, 0], table[:, 1:4], table[:, 4:], odd=object())
    with pytest.raises(InputError, match=r"`meta` must hold text, numbers, lists and mappings"):
        sd.write(rec, tmp_path / "a.parquet")
    assert list(tmp_path.iterdir()) == []


def test_a_solution_is_no_recording_and_the_other_way_round(
    tmp_path: Path, small: Recording
) -> None:
    path = tmp_path / "a.parquet"
    sd.write(small, path)
    with pytest.raises(
        FormatError, match=r"must hold a solution, it holds a recording; use io\.r"
    ):
        io.read_solution(path)
