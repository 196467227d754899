"""Text logs: what is read from which spelling, layout and packing."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_logs import G, assert_same, six_axes

import strapdown as sd
from strapdown import io
from strapdown.errors import FormatError
from strapdown.recording import Recording

Write = Callable[..., Path]
EPS = np.finfo(float).eps


def rows(table: np.ndarray, delimiter: str = ",") -> list[str]:
    return [delimiter.join(f"{x:.17g}" for x in row) for row in table]


def test_si_columns_come_back_bit_for_bit(write_text: Write) -> None:
    table = six_axes()
    head = "t_s,gyr_x_rad_s,gyr_y_rad_s,gyr_z_rad_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2"
    rec = sd.read(write_text(head, *rows(table)))
    assert np.array_equal(rec.imu.t, table[:, 0])
    assert np.array_equal(rec.imu.gyr, table[:, 1:4])
    assert np.array_equal(rec.imu.acc, table[:, 4:])
    assert "notes" not in rec.meta
    assert rec.meta["format"] == "csv"


def test_stated_units_become_si(write_text: Write) -> None:
    table = six_axes()
    mag = np.tile([20.0, -3.0, 44.0], (len(table), 1))
    head = "time_us,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g,mx [uT],my [uT],mz [uT],temp_degc"
    out = np.column_stack(
        (table[:, :1] * 1e6, np.rad2deg(table[:, 1:4]), table[:, 4:] / G, mag, 25 + table[:, 0])
    )
    rec = sd.read(write_text(head, *rows(out)))
    # one multiplication each: rounding of the last digit
    np.testing.assert_allclose(rec.imu.t, table[:, 0], rtol=4 * EPS)
    np.testing.assert_allclose(rec.imu.gyr, table[:, 1:4], rtol=4 * EPS)
    np.testing.assert_allclose(rec.imu.acc, table[:, 4:], rtol=4 * EPS)
    np.testing.assert_allclose(rec.mag.mag, mag * 1e-6, rtol=4 * EPS)
    np.testing.assert_allclose(rec.temperature.temp_degc, out[:, -1], rtol=4 * EPS)
    assert rec.mag.t is rec.imu.t  # one axis, one array


@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", " ", "   "])
def test_the_delimiter_is_found_out(write_text: Write, delimiter: str) -> None:
    table = six_axes()
    head = delimiter.join(["t_s", "gx", "gy", "gz", "ax", "ay", "az"])
    rec = sd.read(write_text(head, *rows(table, delimiter)))
    assert np.array_equal(rec.imu.gyr, table[:, 1:4])


def test_decimal_commas_are_found_out(write_text: Write) -> None:
    table = six_axes()
    text = [line.replace(".", ",") for line in rows(table, ";")]
    rec = sd.read(write_text("t_s;gx;gy;gz;ax;ay;az", *text))
    assert np.array_equal(rec.imu.acc, table[:, 4:])


def test_comments_preamble_units_row_and_blank_lines_are_passed_over(write_text: Write) -> None:
    table = six_axes()
    text = rows(table)
    text[10:10] = ["# a remark", "", "// another"]
    rec = sd.read(
        write_text(
            "// Logger 3, firmware 1.2",
            "Device: box 7",
            "time,gyro_x,gyro_y,gyro_z,acc_x,acc_y,acc_z",
            "s,rad/s,rad/s,rad/s,m/s^2,m/s^2,m/s^2",
            *text,
        )
    )
    assert np.array_equal(rec.imu.gyr, table[:, 1:4])
    assert "notes" not in rec.meta  # the units row states all units


def test_a_header_behind_a_comment_sign_is_the_header(write_text: Write) -> None:
    table = six_axes()
    rec = sd.read(write_text("# t_s,gx,gy,gz,ax,ay,az", *rows(table)))
    assert np.array_equal(rec.imu.gyr, table[:, 1:4])


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_encodings_and_line_ends(tmp_path: Path, encoding: str, newline: str) -> None:
    table = six_axes()
    head = "t [s],gx [°/s],gy [°/s],gz [°/s],ax,ay,az"
    path = tmp_path / "log.txt"
    path.write_bytes(newline.join([head, *rows(table), ""]).encode(encoding))
    rec = sd.read(path)
    np.testing.assert_allclose(rec.imu.gyr, np.deg2rad(table[:, 1:4]), rtol=4 * EPS)
    assert len(rec.imu) == len(table)


def test_gzip_is_found_out_from_content(tmp_path: Path) -> None:
    table = six_axes()
    path = tmp_path / "log.dat"
    path.write_bytes(gzip.compress("\n".join(["t,gx,gy,gz,ax,ay,az", *rows(table)]).encode()))
    assert np.array_equal(sd.read(path).imu.gyr, table[:, 1:4])


def test_quoted_cells_and_a_trailing_delimiter(write_text: Write) -> None:
    table = six_axes()
    text = [",".join(f'"{x:.17g}"' for x in row) + "," for row in table]
    rec = sd.read(write_text('"t_s","gx","gy","gz","ax","ay","az"', *text))
    assert np.array_equal(rec.imu.gyr, table[:, 1:4])


def test_columns_without_unit_are_read_as_si_with_a_note(write_text: Write) -> None:
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az", *rows(six_axes())))
    notes = " ".join(rec.meta["notes"])
    assert "'gx', 'gy', 'gz' state no unit and are read in rad/s" in notes
    assert "'t' states no unit and is read in s" in notes


def test_units_option_outranks_the_header(write_text: Write) -> None:
    table = six_axes()
    rec = sd.read(
        write_text("t,gx_rad_s,gy_rad_s,gz_rad_s,ax,ay,az", *rows(table)), units="gyr=dps,t=ms"
    )
    np.testing.assert_allclose(rec.imu.gyr, np.deg2rad(table[:, 1:4]), rtol=4 * EPS)
    np.testing.assert_allclose(rec.imu.t, table[:, 0] * 1e-3, rtol=4 * EPS)
    assert "read in °/s as asked, though its name says rad/s" in " ".join(rec.meta["notes"])


def test_columns_option_names_columns_by_name_and_number(write_text: Write) -> None:
    table = six_axes()
    mapping = {"t": 0, "gyr_x": "A", "gyr_y": "B", "gyr_z": 3, "acc_x": "D"}
    mapping |= {"acc_y": "E", "acc_z": "F"}
    path = write_text("T0,A,B,C,D,E,F", *rows(table))
    assert np.array_equal(sd.read(path, columns=mapping).imu.gyr, table[:, 1:4])
    text = ",".join(f"{role}={column}" for role, column in mapping.items())
    assert np.array_equal(sd.read(path, columns=text).imu.acc, table[:, 4:])


def test_a_file_without_header_is_read_by_columns(write_text: Write) -> None:
    table = six_axes()
    names = ["t", "gyr_x", "gyr_y", "gyr_z", "acc_x", "acc_y", "acc_z"]
    rec = sd.read(write_text(*rows(table)), columns={name: k for k, name in enumerate(names)})
    assert np.array_equal(rec.imu.acc, table[:, 4:])


def test_rate_counts_the_times_where_there_are_none(write_text: Write) -> None:
    table = six_axes()
    rec = sd.read(write_text("gx,gy,gz,ax,ay,az", *rows(table[:, 1:])), rate=200)
    assert np.array_equal(rec.imu.t, np.arange(len(table)) / 200)


@pytest.mark.parametrize(
    ("unit", "scale", "decimals"),
    [("s", 1, 6), ("ms", 10**3, 0), ("us", 10**6, 0), ("ns", 10**9, 0)],
)
def test_times_since_1970_become_an_origin(
    write_text: Write, unit: str, scale: int, decimals: int
) -> None:
    table = six_axes()
    steps = np.round(table[:, 0] * 1e9).astype(int)
    if decimals:
        stamps = [f"{1717156800 + s // 10**9}.{s % 10**9:09d}" for s in steps]
    else:
        stamps = [str(1717156800 * scale + s * scale // 10**9) for s in steps]
    text = [
        f"{stamp},{line.split(',', 1)[1]}" for stamp, line in zip(stamps, rows(table), strict=True)
    ]
    rec = sd.read(write_text("timestamp,gx,gy,gz,ax,ay,az", *text))
    assert rec.meta["epoch_utc"] == "2024-05-31T12:00:00Z"
    # float64 seconds since 1970 have steps of 0.24 us; whole numbers keep all their digits
    tolerance = 2.4e-7 if decimals else 1e-12
    np.testing.assert_allclose(rec.imu.t, table[:, 0], atol=tolerance, rtol=0)


@pytest.mark.parametrize("form", ["{}T{}Z", "{} {}", "{}T{}+00:00"])
def test_dates_are_read(write_text: Write, form: str) -> None:
    table = six_axes()
    stamps = [form.format("2024-05-31", f"23:59:59.{600 + 10 * k:03d}") for k in range(30)]
    text = [
        f"{s},{line.split(',', 1)[1]}" for s, line in zip(stamps, rows(table[:30]), strict=True)
    ]
    rec = sd.read(write_text("DateTime,gx,gy,gz,ax,ay,az", *text))
    np.testing.assert_allclose(rec.imu.t, np.arange(30) * 0.01, atol=1e-12)
    assert rec.meta["epoch_utc"] == "2024-05-31T23:59:59.6Z"
    assert ("without a time zone" in " ".join(rec.meta["notes"])) == (form == "{} {}")


def test_times_of_day_go_on_after_midnight(write_text: Write) -> None:
    table = six_axes(4)
    stamps = ["23:59:59.980", "23:59:59.990", "00:00:00.000", "00:00:00.010"]
    text = [f"{s},{line.split(',', 1)[1]}" for s, line in zip(stamps, rows(table), strict=True)]
    rec = sd.read(write_text("time,gx,gy,gz,ax,ay,az", *text))
    np.testing.assert_allclose(np.diff(rec.imu.t), 0.01, atol=1e-9)


def test_empty_cells_and_nan_are_lost_samples(write_text: Write) -> None:
    text = rows(six_axes())
    cells = text[7].split(",")
    text[7] = ",".join([cells[0], "", "", "", *cells[4:]])
    text[8] = ",".join([text[8].split(",")[0], *["nan"] * 6])
    text[9] = text[9].split(",")[0] + ",,,,,,"
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az", *text))
    assert len(rec.imu) == 50
    assert np.flatnonzero(rec.imu.nan_rows()).tolist() == [7, 8, 9]


def test_a_magnetometer_on_every_fifth_row_is_a_stream_of_its_own(write_text: Write) -> None:
    table = six_axes()
    text = [line + (",20,0,44" if k % 5 == 0 else ",,,") for k, line in enumerate(rows(table))]
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az,mx_ut,my_ut,mz_ut", *text))
    assert np.array_equal(rec.mag.t, table[::5, 0])
    assert len(rec.imu) == 50
    assert not rec.imu.nan_rows().any()


def test_rows_of_another_sensor_are_no_lost_imu_samples(write_text: Write) -> None:
    table = six_axes()
    text = []
    for k, line in enumerate(rows(table)):
        text.append(line + ",,,")
        if k % 10 == 3:
            text.append(f"{table[k, 0] + 0.004:.17g},,,,,,,47.1,8.{k},400")
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az,lat,lon,alt", *text))
    assert np.array_equal(rec.imu.t, table[:, 0])
    assert len(rec.gnss) == 5
    np.testing.assert_allclose(rec.gnss.lla[:, 0], np.deg2rad(47.1), rtol=4 * EPS)


def test_a_held_fix_is_new_where_it_changes(write_text: Write) -> None:
    text = [f"{line},47.{k // 20},8.5,400" for k, line in enumerate(rows(six_axes(100)))]
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az,lat_deg,lon_deg,alt_m", *text))
    np.testing.assert_allclose(rec.gnss.t, [0.0, 0.2, 0.4, 0.6, 0.8], atol=1e-12)
    assert "each fix is repeated on 20 rows" in " ".join(rec.meta["notes"])


def test_gyroscope_and_accelerometer_on_rows_of_their_own_are_merged(write_text: Write) -> None:
    table = six_axes()
    text = []
    for k, row in enumerate(table):
        cells = [f"{x:.17g}" for x in row]
        text.append(",".join([*cells[:4], "", "", ""]))
        if k % 4 == 0:
            text.append(",".join([f"{row[0] + 0.001:.17g}", "", "", "", *cells[4:]]))
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az", *text))
    assert rec.imu.gyr_real is None
    assert rec.imu.acc_real.sum() == 13
    assert np.array_equal(rec.imu.t, table[1:, 0])  # the first has no accelerometer yet


def test_a_receiver_that_repeats_a_fix_now_and_then_is_not_thinned(write_text: Write) -> None:
    text = [f"{line},47.{k - k % 3 // 2},8.5,400" for k, line in enumerate(rows(six_axes(60)))]
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az,lat_deg,lon_deg,alt_m", *text))
    assert len(rec.gnss) == 60


def test_temperatures_have_a_zero_of_their_own(write_text: Write) -> None:
    text = [f"{line},{77 + k},{298.15 + k}" for k, line in enumerate(rows(six_axes()))]
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az,temp_degf,hot_k", *text))
    np.testing.assert_allclose(rec.temperature.temp_degc[[0, 9]], [25.0, 30.0], rtol=1e-14)


def test_sorting_keeps_the_first_of_repeated_times(write_text: Write) -> None:
    table = six_axes(1000)
    table[:, 0] = np.repeat(table[::4, 0], 4)
    rec = sd.read(write_text("t_s,gx,gy,gz,ax,ay,az", *rows(table)), repair_time="sort")
    assert np.array_equal(rec.imu.gyr, table[::4, 1:4])


def test_up_becomes_down_and_1e7_degrees_become_radians(write_text: Write) -> None:
    text = [
        f"{line},471234567,{85000000 + k},400000,1,2,0.5"
        for k, line in enumerate(rows(six_axes()))
    ]
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az,lat,lon,alt,vn,ve,vu", *text))
    np.testing.assert_allclose(rec.gnss.lla[0], [np.deg2rad(47.1234567), np.deg2rad(8.5), 400.0])
    assert np.array_equal(rec.gnss.v_n[0], [1.0, 2.0, -0.5])


def test_px4_names_state_microseconds(write_text: Write) -> None:
    table = six_axes()
    out = table.copy()
    out[:, 0] = 5e6 + 1e4 * np.arange(50)
    head = "timestamp," + ",".join(f"gyro_rad[{k}]" for k in range(3))
    head += ",gyro_integral_dt," + ",".join(f"accelerometer_m_s2[{k}]" for k in range(3))
    out = np.insert(out, 4, 4000, axis=1)
    rec = sd.read(write_text(head, *rows(out)))
    np.testing.assert_allclose(rec.imu.t, 5.0 + table[:, 0], rtol=4 * EPS)
    assert np.array_equal(rec.imu.gyr, table[:, 1:4])


def test_start_and_stop_cut_and_keep_times(write_text: Write) -> None:
    path = write_text("t,gx,gy,gz,ax,ay,az", *rows(six_axes()))
    rec = sd.read(path, start=0.1, stop=0.2)
    assert rec.imu.t[0] == 0.1
    assert len(rec.imu) == 10
    with pytest.raises(FormatError, match=r"no sample lies between 5 and 6 s"):
        sd.read(path, start=5, stop=6)


@pytest.mark.parametrize("repair", ["drop", "sort"])
def test_times_are_repaired_when_asked(write_text: Write, repair: str) -> None:
    text = rows(six_axes())
    text[5], text[20:22] = text[4], [text[21], text[20]]
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az", *text), repair_time=repair)
    assert len(rec.imu) == {"drop": 48, "sort": 49}[repair]
    assert (np.diff(rec.imu.t) > 0).all()
    assert "times repaired" in " ".join(rec.meta["notes"])


def test_a_last_line_cut_off_is_left_out_with_a_note(write_text: Write) -> None:
    text = rows(six_axes())
    path = write_text("t,gx,gy,gz,ax,ay,az", *text)
    path.write_text(path.read_text().rstrip()[:-30])
    rec = sd.read(path)
    assert len(rec.imu) == 49
    assert "line 51" in " ".join(rec.meta["notes"]) or "row 51" in " ".join(rec.meta["notes"])


def test_text_columns_of_no_meaning_do_no_harm(write_text: Write) -> None:
    text = [f"{line},moving,{k}" for k, line in enumerate(rows(six_axes()))]
    rec = sd.read(write_text("t,gx,gy,gz,ax,ay,az,state,counter", *text))
    assert len(rec.imu) == 50


def test_read_raw_returns_columns_as_they_are_and_does_not_judge(write_text: Write) -> None:
    table = six_axes()
    table[:, 1:4] *= 1000.0  # no rad/s
    text = rows(table)
    text[3] = text[2]
    text[8] = text[8].replace(text[8].split(",")[5], "oops")
    raw = io.read_raw(write_text("t,gx,gy,gz,ax,ay,az,other", *[line + ",7" for line in text]))
    assert [c.name for c in raw.tables[0].columns][-1] == "other"
    gx = raw.tables[0].by_name("gx")
    assert gx.role == "gyr_x"
    assert gx.unit is None
    assert gx.values[0] == table[0, 1]
    kinds = [f.kind for f in raw.findings if f.fault]
    assert kinds == ["text", "unit", "time"]
    assert np.isnan(raw.tables[0].by_name("ay").values[8])


@pytest.mark.parametrize("name", ["all.csv", "all.tsv.gz"])
def test_what_is_written_as_csv_is_read_again(
    tmp_path: Path, every_stream: Recording, name: str
) -> None:
    sd.write(every_stream, tmp_path / name)
    rec = sd.read(tmp_path / name)
    assert {n for n, _ in rec.streams()} == {n for n, _ in every_stream.streams()}
    for stream_name, stream in every_stream.streams():
        other = getattr(rec, stream_name)
        assert np.array_equal(stream.t, other.t), stream_name
        for spec in stream.FIELDS:
            a, b = getattr(stream, spec.name), getattr(other, spec.name)
            if a is not None:
                # degrees and microtesla: two roundings there, two back
                np.testing.assert_allclose(b, a, rtol=4 * EPS, err_msg=stream_name)
    for part, stream in every_stream.reference.streams():
        other = getattr(rec.reference, part)
        assert np.array_equal(stream.t, other.t), part
        for spec in stream.FIELDS:
            a, b = getattr(stream, spec.name), getattr(other, spec.name)
            if a is not None:
                np.testing.assert_allclose(b, a, rtol=1e-15, atol=4 * EPS, err_msg=part)


def test_written_columns_carry_their_units(tmp_path: Path, every_stream: Recording) -> None:
    sd.write(every_stream, tmp_path / "log.csv")
    head = (tmp_path / "log.csv").read_text().split("\n", 1)[0].replace('"', "").split(",")
    assert head[:7] == ["t_s", "gyr_x_dps", "gyr_y_dps", "gyr_z_dps", "acc_x_m_s2", "acc_y_m_s2",
                        "acc_z_m_s2"]  # fmt: skip
    assert {"mag_x_ut", "lat_deg", "lon_deg", "height_m", "pressure_pa", "temp_degc"} <= set(head)


def test_the_same_recording_gives_the_same_bytes(tmp_path: Path, every_stream: Recording) -> None:
    for name in ("a.csv.gz", "b.csv.gz", "a.parquet", "b.parquet"):
        sd.write(every_stream, tmp_path / name)
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


def test_axes_turn_the_box_and_its_reference(tmp_path: Path, every_stream: Recording) -> None:
    sd.write(every_stream, tmp_path / "a.parquet")
    rec = sd.read(tmp_path / "a.parquet", axes="y,-x,z")
    x, y, z = every_stream.imu.gyr.T
    assert np.array_equal(rec.imu.gyr, np.column_stack((y, -x, z)), equal_nan=True)
    # the same vector in n, from either pair of attitude and axes
    from scipy.spatial.transform import Rotation

    old, new = every_stream.star.q_nb[0], rec.star.q_nb[0]
    f_old, f_new = every_stream.imu.acc[0], rec.imu.acc[0]
    C_old, C_new = (Rotation.from_quat(q[[1, 2, 3, 0]]) for q in (old, new))
    np.testing.assert_allclose(C_old.apply(f_old), C_new.apply(f_new), atol=1e-13)
    one = sd.read(tmp_path / "a.parquet", axes="mag=y,x,-z")
    assert_same(
        sd.Recording(imu=one.imu, star=one.star, reference=one.reference),
        sd.Recording(
            imu=every_stream.imu, star=every_stream.star, reference=every_stream.reference
        ),
    )
    assert np.array_equal(one.mag.mag[:, 0], every_stream.mag.mag[:, 1], equal_nan=True)
