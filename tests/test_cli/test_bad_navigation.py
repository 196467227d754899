"""Drives that cannot be navigated: a sentence that says why, a status, nothing half written."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

import strapdown as sd
from strapdown.cli import _job
from strapdown.errors import ComputationError
from strapdown.simulation import load
from strapdown.units import DEG


@pytest.fixture(scope="module")
def drive():
    return load("drive").record(seed=3).between(0.0, 60.0)


def moved(rec, **changes):
    return replace(rec, gnss=replace(rec.gnss, **changes), reference=None)


def beyond_the_pole(rec):
    lla = rec.gnss.lla.copy()
    lla[3, 0] = 95.0 * DEG
    return moved(rec, lla=lla)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (lambda rec: replace(rec, gnss=None), "must have the stream 'gnss', it has imu"),
        (
            lambda rec: replace(rec, gnss=rec.gnss.shifted(3600.0)),
            r"stream gnss, 36\d\d.* s, must overlap stream imu, .* bring the times of one to",
        ),
        (
            lambda rec: replace(rec, gnss=rec.gnss.shifted(-3600.0)),
            "must overlap stream imu, .* their clocks have different zeros",
        ),
        (beyond_the_pole, r"stream gnss, row 3: latitude must lie between -90 and 90 deg, got 95"),
    ],
)
def test_what_no_filter_can_use_is_refused(command, drive, tmp_path, change, line):
    sd.write(change(drive), tmp_path / "log.parquet")
    done = command("run", "log.parquet", "--filter", "loosely-coupled")
    assert (done.status, done.out) == (2, "")
    assert re.search(line, done.line), done.line
    assert [p.name for p in tmp_path.iterdir()] == ["log.parquet"]


def test_a_latitude_beyond_the_pole_is_refused_in_a_table_too(command, tmp_path):
    (tmp_path / "fixes.csv").write_text(
        "t_s,lat_deg,lon_deg,height_m\n0,50,8,100\n1,50,8,100\n2,150,8,100\n"
    )
    done = command("info", "--gnss", "fixes.csv", "--imu", "fixes.csv")
    assert done.status == 2
    done = command("convert", "fixes.csv", "out.parquet")
    assert done.status == 2
    assert "stream gnss, row 2: latitude must lie between -90 and 90 deg, got 150" in done.line


@pytest.mark.parametrize(
    ("change", "doubt"),
    [
        (lambda rec: moved(rec, std_position_n=1e9 * rec.gnss.std_position_n,
                           std_velocity_n=1e9 * rec.gnss.std_velocity_n), "still aligning"),
        (lambda rec: replace(rec, gnss=rec.gnss.rows(slice(-1, None))), "still aligning"),
    ],
)  # fmt: skip
def test_a_solution_that_never_aligned_says_so_and_its_report_too(
    command, drive, tmp_path, change, doubt
):
    sd.write(change(drive), tmp_path / "log.parquet")
    done = command("run", "log.parquet", "--filter", "loosely-coupled", "--json")
    assert done.status == 0, done.err
    assert doubt in done.err
    assert [doubt in line for line in json.loads(done.out)["doubts"]] == [True]
    page = (tmp_path / "log.strapdown" / "report.html").read_text("utf-8")
    assert "Not to be trusted" in page
    assert doubt in page


def test_a_solution_beyond_the_pole_is_no_solution(drive):
    n = len(drive.imu)
    sol = sd.solution.Solution(
        t=drive.imu.t, q_nb=np.tile((1.0, 0, 0, 0), (n, 1)), status=np.zeros(n, int), filter="x",
        lla=np.tile((np.pi / 2, 0.0, 0.0), (n, 1)),
    )  # fmt: skip
    _job._on_the_earth(sol)
    sol.lla[n // 2 :, 0] += 1e-6
    with pytest.raises(ComputationError, match=r"came beyond one at 30 s; .*wander"):
        _job._on_the_earth(sol)
