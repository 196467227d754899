"""The outage study as a command; the study itself has tests of its own."""

import json
import re

import pytest
from test_cli import logs


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--filter", "mekf"), "--filter must be a navigation filter, mekf gives attitude"),
        (("--filter", "lose"), "must be one of"),
        (("--lengths", "10;30"), "--lengths must be numbers with commas"),
        (("--set", "nothing=1"), "has no parameter 'nothing'"),
        ((), "no such file"),
    ],
)
def test_wrong_options_end_in_one_line(command, arguments, line):
    done = command("outages", "missing", *arguments)
    assert (done.status, done.out) == (2, "")
    assert line in done.line.lower()


def test_the_json_has_a_row_per_window_and_per_length(command, data_dir):
    folder = data_dir / "drives" / "urban-short-turn-loop-nominal-001"
    done = command("outages", folder, "--lengths", "10", "--json")
    assert done.status == 0, done.err
    found = json.loads(done.out)
    assert found["windows"], "the drive has windows"
    assert set(found["windows"][0]) >= {
        "drive", "length_s", "start_s", "horizontal_error_m", "vertical_error_m",
        "percent_of_distance", "heading_error_deg", "solution",
    }  # fmt: skip
    assert found["summary"][0]["n"] == len(found["windows"])
    assert all((w["start_s"] - 120.0) % 60.0 == 0.0 for w in found["windows"])


# --- outages that are asked for in a run, and the track for other programs ---------------------


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--outage", "300-360"), "--outage must be START:END in seconds, got '300-360'"),
        (("--outage", "360:300"), "--outage must end after it starts, got '360:300'"),
        (("--outage", "1:2"), "must have the stream .gnss."),
        (("--export", "kml,shp"), "--export must be of kml, gpx, geojson, csv, tum, got 'shp'"),
        (("--tiles", "nowhere"), "nowhere: there is no such file or folder"),
        (("--export", "kml"), "--export kml needs positions, and robust-eskf gives attitude"),
    ],
)
def test_outages_and_tracks_without_sense_end_in_one_line(command, tmp_path, arguments, line):
    log = logs.write(tmp_path / "log.csv")
    done = command("run", log, *arguments)
    assert (done.status, done.out) == (2, "")
    assert re.search(line, done.line)
    assert not (tmp_path / "log.strapdown").exists()


def test_a_run_without_fixes_for_a_while_says_how_far_it_was_off(command, data_dir, tmp_path):
    drive = data_dir / "drives" / "urban-short-turn-loop-nominal-001"
    done = command("run", drive, "--outage", "120:150", "--export", "gpx,csv", "-o", "out",
                   "--json")  # fmt: skip
    assert done.status == 0, done.err
    found = json.loads(done.out)
    [window] = found["outages"]
    assert (window["start_s"], window["length_s"]) == (120.0, 30.0)
    # The study's largest 30 s error on this drive is below 5 m; standing still would be 100 m off.
    assert 0.0 < window["horizontal_error_m"] < 10.0
    assert "Outages" in (tmp_path / "out" / "report.html").read_text()
    for path in found["outputs"].values():
        assert (tmp_path / path).is_file()
    again = command("convert", tmp_path / "out" / "solution.parquet", tmp_path / "t.gpx")
    assert again.status == 0, again.err
    assert (tmp_path / "t.gpx").read_text() == (tmp_path / "out" / "track.gpx").read_text()
