"""``strapdown doctor``, and the line that other verbs show of it."""

import json
import os

import numpy as np
import pytest
from test_cli import logs

ROWS = logs.table(3000)
ROWS[:, 9] += 0.1 * np.random.default_rng(8).standard_normal(len(ROWS))  # not stuck


def in_wrong_unit():
    rows = ROWS.copy()
    rows[:, 4:7] /= 9.80665
    return rows


def test_findings_are_shown_with_what_to_do(command, tmp_path):
    done = command("doctor", logs.write(tmp_path / "log.csv", in_wrong_unit()))
    assert done.status == 0, done.err
    text = " ".join(done.out.split())
    assert "error" in text
    assert "--units acc=g" in text
    assert "1 error" in text


def test_findings_as_json(command, tmp_path):
    done = command("doctor", logs.write(tmp_path / "log.csv", in_wrong_unit()), "--json")
    assert done.status == 0, done.err
    first = json.loads(done.out)["findings"][0]
    assert list(first) == ["check", "severity", "sentence", "confidence", "advice", "stream"]
    assert (first["check"], first["severity"], first["stream"]) == ("units", "error", "acc")


def test_log_that_cannot_be_read_is_examined_raw(command, tmp_path):
    rows = ROWS.copy()
    rows[[100, 101]] = rows[[101, 100]]
    log = logs.write(tmp_path / "log.csv", rows)
    assert command("info", log).status == 2
    done = command("doctor", log, "--json")
    assert done.status == 0, done.err
    sentences = [f["sentence"] for f in json.loads(done.out)["findings"]]
    assert any(s.startswith("1 of 3000 times steps back") for s in sentences)


def test_place_and_up_are_used(command, tmp_path):
    log = logs.write(tmp_path / "log.csv", ROWS)
    done = command("doctor", log, "--up", "z", "--place", "52.5,13.4", "--json")
    checks = {f["check"]: f for f in json.loads(done.out)["findings"]}
    assert checks["sign"]["severity"] == "ok"
    assert "world magnetic model says 68" in checks["dip"]["sentence"]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--up", "w"), "strapdown: --up: `up` must be one of x, -x, y, -y, z, -z, got 'w'"),
        (("--place", "here"), "strapdown: --place must be LAT,LON in degrees, got 'here'."),
        (("--place", "95,0"), "strapdown: --place must be on the Earth, got '95,0'."),
    ],
)
def test_wrong_options_are_refused(command, tmp_path, options, line):
    done = command("doctor", logs.write(tmp_path / "log.csv", ROWS), *options)
    assert done.status == 2
    assert done.line.startswith(line)


def test_no_log_no_diagnosis(command):
    done = command("doctor", "nowhere.csv")
    assert done.status == 2
    assert "nowhere.csv" in done.line


def test_info_and_run_show_the_gravest_alarm(command, tmp_path):
    log = logs.write(tmp_path / "log.csv", in_wrong_unit())
    for verb in (("info",), ("run", "--no-report")):
        done = command(*verb, log)
        assert done.status == 0, done.err
        assert "note: The accelerometer's values are" in done.err
        assert "`strapdown doctor` says what to do" in done.err
    sound = command("info", logs.write(tmp_path / "sound.csv", ROWS))
    assert "strapdown doctor" not in sound.err


def test_quick_look_costs_less_than_a_tenth_of_a_second(broad_02):
    import strapdown as sd
    from strapdown import doctor

    rec = sd.read(broad_02)
    doctor.examine(rec, quick=True)
    took = []
    for _ in range(3):
        before = os.times()
        doctor.examine(rec, quick=True)
        after = os.times()
        took.append(after.user - before.user + after.system - before.system)
    assert np.min(took) < 0.1  # processor time [s]
