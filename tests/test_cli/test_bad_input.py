"""Each kind of bad input: one sentence, exit status 2, nothing half written."""

import errno
import gzip
import json
import os
import re
import tempfile

import numpy as np
import pytest
from test_cli import logs

MAG = (7, 8, 9)


def broken_row(column: int, row: int, value: float) -> np.ndarray:
    rows = logs.table()
    rows[row, column] = value
    return rows


def missing(folder):
    return folder / "nowhere.csv"


def folder_without_manifest(folder):
    path = folder / "drive"
    path.mkdir()
    (path / "readme.txt").write_text("nothing here\n")
    return path


def empty_file(folder):
    path = folder / "log.csv"
    path.write_text("")
    return path


def header_only(folder):
    return logs.write(folder / "log.csv", logs.table(0))


def unknown_columns(folder):
    return logs.write(folder / "log.csv", header="a,b,c,d,e,f,g,h,i,j")


def mixed_units(folder):
    header = logs.HEADER.replace("gyr_y_dps", "gyr_y_rad_s")
    return logs.write(folder / "log.csv", header=header)


def text_in_numbers(folder):
    path = folder / "log.csv"
    lines = logs.text(logs.table()).splitlines()
    lines[101] = lines[101].replace(",", ",broken,", 1).rsplit(",", 1)[0]
    path.write_text("\n".join(lines) + "\n")
    return path


def time_backwards(folder):
    return logs.write(folder / "log.csv", broken_row(0, 40, 0.1))


def time_repeated(folder):
    return logs.write(folder / "log.csv", broken_row(0, 40, 0.39))


def magnitude_of_degrees(folder):
    header = logs.HEADER.replace("_dps", "").replace("_m_s2", "").replace("_ut", "")
    rows = logs.table()
    rows[:, 1:4] *= 10.0
    rows[50:200, 3] += 800.0
    return logs.write(folder / "log.csv", rows, header=header)


def truncated_mat(folder):
    path = folder / "log.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(90))
    return path


def truncated_hdf5(folder):
    path = folder / "log.hdf5"
    path.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(100))
    return path


def truncated_parquet(folder):
    path = folder / "log.parquet"
    path.write_bytes(b"PAR1" + bytes(200))
    return path


def truncated_gz(folder):
    path = folder / "log.csv.gz"
    path.write_bytes(gzip.compress(logs.text(logs.table()).encode())[:-200])
    return path


def only_noise(folder):
    path = folder / "log.bin"
    path.write_bytes(np.random.default_rng(1).bytes(4000))
    return path


def no_acc(folder):
    rows = np.delete(logs.table(), (4, 5, 6), axis=1)
    header = ",".join(h for h in logs.HEADER.split(",") if not h.startswith("acc"))
    return logs.write(folder / "log.csv", rows, header)


BAD_LOGS = {
    missing: "no such file",
    folder_without_manifest: "",
    empty_file: "empty",
    header_only: "",
    unknown_columns: "--columns|columns",
    mixed_units: "gyr",
    text_in_numbers: "broken",
    time_backwards: "row 4[012]|line 4[012]",
    time_repeated: "row 4[012]|line 4[012]",
    magnitude_of_degrees: "--units",
    truncated_mat: "",
    truncated_hdf5: "",
    truncated_parquet: "",
    truncated_gz: "",
    only_noise: "",
    no_acc: "acc",
}


@pytest.mark.parametrize("make", BAD_LOGS, ids=lambda make: make.__name__)
def test_bad_log_ends_with_one_line_and_status_2(make, command, tmp_path):
    path = make(tmp_path)
    before = sorted(p.name for p in tmp_path.iterdir())
    done = command("run", path)
    assert done.status == 2, done.err
    assert done.out == ""
    assert done.line.startswith("strapdown: ")
    assert path.name in done.line
    assert re.search(BAD_LOGS[make], done.line), done.line
    assert done.line.endswith(".")
    assert "Traceback" not in done.err
    assert sum(line.startswith("strapdown: ") for line in done.err.splitlines()) == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == before


def test_missing_file_in_a_process_of_its_own(process):
    done = process("run", "nowhere.mat", "--json")
    assert (done.status, done.out) == (2, "")
    assert done.err.count("\n") == 1
    assert "nowhere.mat" in done.err


def test_unknown_filter_offers_the_nearest_name(process, tmp_path):
    done = process("run", logs.write(tmp_path / "log.csv"), "--filter", "magdwick")
    assert (done.status, done.out) == (2, "")
    assert re.search("--filter.*'magdwick'.*madgwick", done.line)
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("bata=0.1", "--set bata: madgwick has no parameter 'bata'.*'beta'"),
        ("beta=-1", "--set beta=-1: `beta` must be .*got -1"),
        ("beta=fast", "--set beta: must be a number, got 'fast'"),
        ("beta", "--set must be key=value, got 'beta'"),
        ("beta=", "--set must be key=value, got 'beta='"),
        ("beta=nan", "beta.*must be .*finite.*got nan"),
    ],
)
def test_wrong_parameter_is_told_before_anything_is_read(command, setting, message):
    done = command("run", "nowhere.csv", "--filter", "madgwick", "--set", setting)
    assert done.status == 2
    assert re.search(message, done.line), done.line


def test_parameter_given_twice_is_refused(command):
    done = command("demo", "--filter", "madgwick", "--set", "beta=1", "--set", "beta=2")
    assert done.status == 2
    assert "--set must name each key once, got 'beta' twice." in done.line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["rnu", "x"], "no such command 'rnu'; did you mean 'run'.*strapdown --help"),
        (["run", "x", "--fliter", "a"], "no such option: --fliter; .*'--filter'"),
        (["run", "x", "--rate", "fast"], "invalid value for '--rate'"),
        (["run"], "no log to read"),
        (["run", "a", "b"], "unexpected extra argument"),
        (["convert", "a.csv"], "no file to write to"),
        (["run", "x", "--filter"], "--filter"),
    ],
)
def test_wrong_usage_is_one_line_too(command, arguments, message):
    done = command(*arguments)
    assert done.status == 2
    assert done.out == ""
    assert done.err.count("\n") == 1
    assert re.search(message, done.line), done.line


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--units", "gyr=parsec"], "parsec"),
        (["--axes", "x,y"], "x, y and z once each"),
        (["--axes", "-x,y,z"], "right-handed"),
        (["--from", "5", "--to", "1"], "before"),
        (["--from", "500"], "no sample lies between"),
        (["--repair-time", "guess"], "drop, sort"),
        (["--rate", "-3"], "positive"),
        (["--reference", "nowhere.csv"], "nowhere.csv"),
        (["--calibration", "nowhere.toml"], "nowhere.toml|--calibration"),
        (["--format", "bvh"], "bvh"),
    ],
)
def test_wrong_reading_option_is_told(command, tmp_path, options, message):
    log = logs.write(tmp_path / "log.csv")
    done = command("run", log, *options)
    assert done.status == 2, done.err
    assert done.out == ""
    assert re.search(message, done.line), done.line
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]


def test_all_nan_stream_is_refused(command, tmp_path):
    rows = logs.table()
    rows[:, 1:4] = np.nan
    done = command("run", logs.write(tmp_path / "log.csv", rows))
    assert done.status == 2, done.err
    assert re.search("gyr", done.line), done.line


def test_bursts_of_nan_are_skipped_and_counted(command, tmp_path):
    rows = logs.table()
    rows[100:110, 2] = np.nan
    rows[150, 7:10] = 0.0
    rows[160, 4:7] = 0.0
    done = command("run", logs.write(tmp_path / "log.csv", rows), "--json")
    assert done.status == 0, done.err
    counts = json.loads(done.out)["status_counts"]
    assert counts["GYR_INVALID"] == 10
    assert counts["MAG_INVALID"] == 1
    assert counts["ACC_INVALID"] == 1


def test_repair_is_the_way_out_of_repeated_times(command, tmp_path):
    log = logs.write(tmp_path / "log.csv", broken_row(0, 40, 0.39))
    assert command("run", log, "--repair-time", "drop", "--no-report").status == 0


def test_folder_without_permission_is_told(command, tmp_path, monkeypatch):
    def refuse(**_: object) -> str:  # root, as in containers, may write anywhere
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), "a random name")

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)
    done = command("demo", "-o", tmp_path / "closed" / "out")
    assert (done.status, done.out) == (2, "")
    assert re.search(r"closed: permission denied; .*-o", done.line), done.line


def test_full_disk_is_a_failed_computation(command, tmp_path, monkeypatch):
    def refuse(**_: object) -> str:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "a random name")

    monkeypatch.setattr(tempfile, "mkdtemp", refuse)
    done = command("demo", "-o", tmp_path / "out")
    assert (done.status, done.out) == (1, "")
    assert re.search("no space left on device; free some space", done.line), done.line


def test_folder_that_cannot_be_made_is_told(process):
    done = process("demo", "-o", "/proc/strapdown/out")
    assert (done.status, done.out) == (2, "")
    assert "/proc/strapdown" in done.line
    assert done.err.count("\n") == 1


def test_debug_shows_the_traceback(process):
    done = process("run", "nowhere.csv", "--debug")
    assert done.status != 0
    assert "Traceback" in done.err
