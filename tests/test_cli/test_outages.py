"""The outage study as a command; the study itself has tests of its own."""

import json

import pytest


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
