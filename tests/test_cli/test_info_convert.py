"""Verbs that only read and write logs, and the frame around all verbs."""

import json
import os

import numpy as np
import pytest
from test_cli import logs

import strapdown as sd


def test_version_is_that_of_the_package(process):
    done = process("--version")
    assert (done.status, done.out, done.err) == (0, f"strapdown {sd.__version__}\n", "")


def test_no_command_shows_what_there_is(command):
    done = command()
    assert done.status == 0
    for verb in ("run", "demo", "info", "convert", "filters"):
        assert verb in done.out


@pytest.mark.parametrize("verb", ["run", "demo", "info", "convert", "filters"])
def test_every_verb_has_help(command, verb):
    done = command(verb, "--help")
    assert (done.status, done.err) == (0, "")
    assert f"strapdown {verb}" in done.out


def test_completion_script_is_printed(process):
    done = process("--show-completion", "bash", _TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION="1")
    assert done.status == 0
    assert "_STRAPDOWN_COMPLETE" in done.out


def test_info_names_streams_rate_and_units(command, tmp_path):
    done = command("info", logs.write(tmp_path / "log.csv"))
    assert done.status == 0, done.err
    assert "gyr_xyz_rad_s acc_xyz_m_s2" in done.out
    assert "mag_xyz_t" in done.out
    assert "100" in done.out


def test_info_as_json_counts_gaps_and_nan(command, tmp_path):
    rows = logs.table()
    rows[10:13, 8] = np.nan
    log = logs.write(tmp_path / "log.csv", np.delete(rows, range(100, 150), axis=0))
    done = command("info", log, "--json")
    assert done.status == 0, done.err
    streams = json.loads(done.out)["streams"]
    assert streams["imu"]["samples"] == logs.COUNT - 50
    assert streams["imu"]["gaps"] == 1
    assert streams["imu"]["longest_gap_s"] == pytest.approx(0.51)
    assert streams["imu"]["rate_hz"] == pytest.approx(100.0)
    assert streams["mag"]["nan_samples"] == 3


def test_info_reads_a_benchmark_trial_within_a_second_and_a_half(process, broad_02):
    process("info", broad_02)  # bytecode and disk cache
    before = os.times()
    done = process("info", broad_02, "--json")
    after = os.times()
    assert done.status == 0, done.err
    assert json.loads(done.out)["streams"]["imu"]["samples"] == 53240
    # processor time, which other processes on the machine hardly change
    took = after.children_user + after.children_system
    assert took - before.children_user - before.children_system < 1.5


def test_convert_to_parquet_and_back_keeps_every_bit(command, tmp_path):
    log = logs.write(tmp_path / "log.csv")
    assert command("convert", log, "a.parquet").status == 0
    assert command("convert", "a.parquet", "b.parquet").status == 0
    a, b, c = (sd.read(tmp_path / name) for name in ("log.csv", "a.parquet", "b.parquet"))
    for other in (b, c):
        assert np.array_equal(a.imu.gyr, other.imu.gyr)
        assert np.array_equal(a.imu.t, other.imu.t)
        assert np.array_equal(a.mag.mag, other.mag.mag)


def test_convert_takes_one_file_per_sensor(command, tmp_path):
    rows = logs.table()
    names = logs.HEADER.split(",")
    imu = logs.write(tmp_path / "imu.csv", rows[:, :7], ",".join(names[:7]))
    mag = logs.write(tmp_path / "mag.csv", rows[:, [0, 7, 8, 9]], ",".join(["t_s", *names[7:]]))
    done = command("convert", "--imu", imu, "--mag", mag, "log.parquet")
    assert done.status == 0, done.err
    rec = sd.read(tmp_path / "log.parquet")
    assert len(rec.imu) == len(rec.mag) == logs.COUNT


def test_convert_cuts_and_states_units(command, tmp_path):
    header = "t_s,gyr_x,gyr_y,gyr_z,acc_x,acc_y,acc_z"
    log = logs.write(tmp_path / "log.csv", logs.table()[:, :7], header)
    options = ("--units", "gyr=dps,acc=m/s^2", "--from", "1", "--to", "2")
    done = command("convert", log, "part.parquet", *options)
    assert done.status == 0, done.err
    rec = sd.read(tmp_path / "part.parquet")
    assert len(rec.imu) == 100
    assert rec.imu.gyr[:, 2].mean() == pytest.approx(np.deg2rad(20.0), abs=1e-3)


def test_convert_does_not_replace_a_file_unasked(command, tmp_path):
    log = logs.write(tmp_path / "log.csv")
    (tmp_path / "there.parquet").write_text("precious")
    done = command("convert", log, "there.parquet")
    assert done.status == 2
    assert done.line == "strapdown: there.parquet is there already; give --force to replace it."
    assert (tmp_path / "there.parquet").read_text() == "precious"
    assert command("convert", log, "there.parquet", "--force").status == 0


def test_convert_to_an_unknown_format_leaves_nothing(command, tmp_path):
    done = command("convert", logs.write(tmp_path / "log.csv"), "log.xyz")
    assert done.status == 2
    assert "xyz" in done.line
    assert [p.name for p in tmp_path.iterdir()] == ["log.csv"]
