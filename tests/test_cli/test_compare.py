"""Several estimators on several logs."""

import json

import numpy as np
import pytest

import strapdown as sd


@pytest.fixture
def two_logs(tmp_path):
    """Two demo logs with their truth as reference."""
    paths = [tmp_path / "first.parquet", tmp_path / "second.parquet"]
    for seed, path in enumerate(paths):
        sd.write(sd.simulation.demo.recording(duration=14.0, seed=seed), path)
    return paths


def test_the_figures_are_those_of_run_and_evaluation(command, two_logs):
    done = command("compare", *two_logs, "--filters", "madgwick,gyro", "--set",
                   "madgwick.beta=0.3", "--json")  # fmt: skip
    assert done.status == 0, done.err
    found = json.loads(done.out)
    assert [(row["filter"], row["errors"] is not None) for row in found["trials"]] == [
        ("madgwick", True), ("gyro", True),
    ] * 2  # fmt: skip
    rec = sd.read(two_logs[1])
    north = sd.attitude.declination(rec)
    sol = sd.attitude.Madgwick(beta=0.3, declination=north).run(rec)
    expected = sd.evaluation.attitude_errors(sol, rec.reference).summary()
    assert found["trials"][2]["errors"]["total_rmse_deg"] == expected["total_rmse_deg"]
    each = [row["errors"]["total_rmse_deg"] for row in found["trials"] if row["filter"] == "gyro"]
    mean = next(row for row in found["means"] if row["filter"] == "gyro")
    assert mean["total_rmse_deg"] == pytest.approx(np.mean(each), rel=1e-12)


def test_offline_twins_stand_beside_their_filters(command, two_logs):
    done = command("compare", two_logs[0], "--filters", "robust-eskf,mekf", "--smooth", "--json")
    rows = json.loads(done.out)["trials"]
    assert [(row["filter"], row["causal"]) for row in rows] == [
        ("robust-eskf", True), ("robust-eskf (smoothed)", False), ("mekf", True),
    ]  # fmt: skip


def test_the_report_is_one_page_with_all_names(command, two_logs, tmp_path):
    done = command("compare", *two_logs, "--filters", "madgwick,mahony", "-o", "compared.html")
    assert done.status == 0, done.err
    text = (tmp_path / "compared.html").read_text()
    assert all(word in text for word in ("madgwick", "mahony", "first", "second"))
    assert "mean of 2" in done.out
    # each table names its log, and each of its rows the filter, whatever the width of the paper
    assert [line.split()[0] for line in done.out.splitlines() if line.startswith("ma")] == [
        "madgwick", "mahony",
    ] * 3  # fmt: skip
    assert "compared.html" in done.out


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("--filters", "madgwik"), "the nearest name is 'madgwick'"),
        (("--filters", ","), "--filters must name at least one estimator"),
        (("--filters", "mekf", "--set", "beta=1"), "must begin with one of mekf and a dot"),
        (("--filters", "mekf", "--set", "mekf.gat=1"), "the nearest name is 'gate'"),
        (("--set", "mekf.gate=1"), "--set needs --filters"),
    ],
)
def test_wrong_options_end_in_one_line(command, two_logs, arguments, line):
    done = command("compare", two_logs[0], *arguments)
    assert (done.status, done.out) == (2, "")
    assert line in done.line


def test_a_log_without_reference_says_so(command, tmp_path):
    rec = sd.simulation.demo.recording(duration=12.0)
    bare = sd.from_arrays(rec.imu.t, rec.imu.gyr, rec.imu.acc)
    sd.write(bare, tmp_path / "bare.parquet")
    done = command("compare", "bare.parquet", "--filters", "mekf")
    assert done.status == 2
    assert "must have a reference to compare with" in done.line


def test_compare_and_run_agree_on_which_north_is_meant(command, tmp_path):
    done = command("demo", "--seconds", "20", "--save", "demo.parquet", "--no-report", "-o", "own",
                   "--filter", "madgwick", "--json")  # fmt: skip
    assert done.status == 0, done.err
    alone = json.loads(done.out)["errors"]
    assert "declination" in done.err
    done = command("compare", "demo.parquet", "--filters", "madgwick,gyro", "--json")
    assert done.status == 0, done.err
    assert done.err.count("declination") == 1
    beside = json.loads(done.out)["trials"][0]["errors"]
    assert beside["heading_rmse_deg"] == pytest.approx(alone["heading_rmse_deg"], rel=1e-9)
