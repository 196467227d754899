"""The report of a run: complete, self-contained, small, quick, never half written."""

import base64
import json
import re
import time
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from strapdown import report
from strapdown.earth import lla_from_ned
from strapdown.errors import FormatError
from strapdown.evaluation import attitude_errors, navigation_errors, outage_errors
from strapdown.recording import Gnss, MountReference, PositionReference, Recording
from strapdown.report import page
from strapdown.solution import Status

VOID = {"meta", "br", "input", "link", "img", "hr"}


class Reader(HTMLParser):
    """Collects elements, attributes and the texts of headings, cells and scripts."""

    def __init__(self, content):
        super().__init__()
        self.open, self.tags, self.links, self.scripts, self.text = [], [], [], [], []
        self.feed(content)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for key, value in attrs:
            if key in ("src", "href", "action", "data-src", "srcset", "poster"):
                self.links.append(value)
        if tag == "script":
            self.scripts.append((dict(attrs).get("type", "text/javascript"), ""))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag, f"</{tag}> closes another element"

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts[-1] = (self.scripts[-1][0], self.scripts[-1][1] + data)
        elif self.open and self.open[-1] != "style":
            self.text.append(data)

    @property
    def words(self):
        return " ".join(self.text)

    @property
    def data(self):
        return [json.loads(body) for kind, body in self.scripts if kind == "application/json"]

    @property
    def figures(self):
        return [data for data in self.data if "layout" in data]


def unpack(array):
    kind = {"f4": "<f4", "f8": "<f8", "u1": "u1"}[array["dtype"]]
    return np.frombuffer(base64.b64decode(array["bdata"]), kind)


@pytest.fixture(scope="module")
def written(run, tmp_path_factory):
    sol, rec = run(20_000)
    path = tmp_path_factory.mktemp("report") / "report.html"
    assert report.write(sol, rec, path) == path
    return Reader(path.read_text("utf-8")), sol, rec, path


def test_it_is_well_formed_html(written):
    reader = written[0]
    assert reader.open == []
    assert reader.tags.count("html") == reader.tags.count("main") == reader.tags.count("h1") == 1


def test_it_loads_nothing_from_elsewhere(written):
    reader, *_, path = written
    assert all(link.startswith("#") for link in reader.links)
    content = path.read_text("utf-8")
    own = content.replace(page._plotly(), "")
    assert not re.search(r"https?://", own)
    assert "@import" not in own
    assert "url(" not in own
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', content).group(1)
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy


def test_plotly_is_inside_just_once(written):
    assert written[3].read_text("utf-8").count("* plotly.js v") == 1


def test_all_that_is_known_has_its_section(written):
    headings = ["Summary", "3D view", "Attitude", "Attitude errors", "Biases", "Innovations",
                "Status", "Sensors", "Timing"]  # fmt: skip
    assert [h for h in headings if h not in written[0].text] == []
    for words in ("roll [°]", "rate [°/s]", "mag. field [µT]", "±3 sigma", "interval [ms]"):
        assert any(words in json.dumps(f, ensure_ascii=False) for f in written[0].figures), words
    for words in ("GYR_INVALID", "Skipped samples", "gyr_density", "RMSE [°]"):
        assert words in written[0].words


def test_numbers_are_those_of_the_errors(written):
    reader, sol, rec, _ = written
    summary = attitude_errors(sol, rec.reference).summary()
    for key in ("total_rmse_deg", "heading_rmse_deg", "inclination_rmse_deg"):
        assert page.number(summary[key], 3) in reader.text
    assert f"{summary['total_rmse_deg']:.2f}" in reader.text
    assert "2.00" in reader.text  # heading, by construction


def test_lines_hold_samples_and_their_extremes(written):
    reader, _, rec, _ = written
    sensors = next(f for f in reader.figures if "rate [°/s]" in json.dumps(f, ensure_ascii=False))
    for column in range(3):
        y = unpack(sensors["data"][column]["y"])
        rate = np.degrees(rec.imu.gyr[:, column])
        drawn = y[np.isfinite(y)]
        assert drawn.max() == np.float32(np.nanmax(rate))
        assert drawn.min() == np.float32(np.nanmin(rate))
        assert len(drawn) < 3500


def test_the_view_has_estimate_and_reference(written):
    reader, sol, rec, _ = written
    view = next(d for d in reader.data if "estimate" in d)
    t = np.frombuffer(base64.b64decode(view["t"]), "<f8")
    q = np.frombuffer(base64.b64decode(view["estimate"]), "<f4").reshape(-1, 4)
    ghost = np.frombuffer(base64.b64decode(view["reference"]), "<f4").reshape(-1, 4)
    known = np.frombuffer(base64.b64decode(view["known"]), "u1")
    rows = np.searchsorted(sol.t, t)
    assert np.array_equal(sol.t[rows], t)  # every frame is a sample
    assert q == pytest.approx(sol.q_nb[rows], abs=1e-7)
    assert ghost == pytest.approx(rec.reference.attitude.q_nb[rows], abs=1e-7)
    aligned = (sol.status[rows] & Status.ALIGNING) == 0
    assert np.array_equal(known, aligned + 2)


def test_text_cannot_break_out_of_the_page(run, tmp_path):
    bad = '</script><script>alert("x")</script><b onload=1>&'
    sol, rec = run(300, name=bad)
    sol = replace(sol, filter="<i>", meta={bad: bad})
    path = report.write(sol, rec, tmp_path / "r.html", title=bad)
    reader = Reader(path.read_text("utf-8"))
    assert bad in reader.text
    assert "i" not in reader.tags
    assert not any('alert("x")' in body for _, body in reader.scripts)


def test_an_hour_at_286_hz_stays_small(run, tmp_path):
    sol, rec = run(3600 * 286)
    start = time.perf_counter()
    path = report.write(sol, rec, tmp_path / "hour.html")
    assert time.perf_counter() - start < 30.0  # some 3 s; a slow machine may take longer
    assert path.stat().st_size < 8e6
    figures = Reader(path.read_text("utf-8")).figures
    longest = max(len(unpack(t["y"])) for f in figures for t in f["data"])
    assert longest < 6500  # two points in 3000 buckets, and where the pen is lifted


def test_a_trial_takes_well_under_two_seconds(run, tmp_path):
    sol, rec = run(53_000)
    took = []
    for _ in range(2):
        start = time.perf_counter()
        report.write(sol, rec, tmp_path / "trial.html")
        took.append(time.perf_counter() - start)
    assert min(took) < 1.5  # 0.3 s here


def test_an_arbitrary_heading_is_said_and_the_reference_turned(run, tmp_path):
    sol, rec = run(2000, heading="arbitrary")
    reader = Reader(report.write(sol, rec, tmp_path / "r.html").read_text("utf-8"))
    assert "heading from an arbitrary direction" in reader.words
    assert "one constant, 2.00 deg, was taken" in reader.words
    assert "The reference is turned by 2.00°" in reader.words


def test_without_reference_and_extras_it_still_comes(run, tmp_path):
    sol, rec = run(500)
    bare = Recording(imu=rec.imu)
    plain = replace(sol, gyr_bias=None, std_gyr_bias=None, std_attitude_n=None, diagnostics={},
                    meta={})  # fmt: skip
    reader = Reader(report.write(plain, bare, tmp_path / "r.html").read_text("utf-8"))
    assert "recording: mekf" in reader.text
    for heading in ("Attitude errors", "Biases", "Innovations", "Track"):
        assert heading not in reader.text


def test_where_the_reference_does_not_count_it_is_drawn_apart(run, tmp_path):
    sol, rec = run(2000)
    valid = np.arange(2000) > 1000
    part = replace(rec.reference.attitude, valid=valid)
    rec = replace(rec, reference=replace(rec.reference, attitude=part))
    reader = Reader(report.write(sol, rec, tmp_path / "r.html").read_text("utf-8"))
    pitch = {d["name"]: d for d in reader.figures[0]["data"] if d["yaxis"] == "y2"}
    assert unpack(pitch["reference"]["x"])[0] == np.float32(sol.t[1001])
    assert unpack(pitch["reference, not counted"]["x"])[-1] == np.float32(sol.t[1000])
    assert "1\u202f001 reference not valid" in reader.words


def test_notes_of_the_reader_are_shown(run, tmp_path):
    sol, rec = run(300)
    rec = replace(rec, meta={"notes": ["columns without a unit are taken as <SI>."]})
    reader = Reader(report.write(sol, rec, tmp_path / "r.html").read_text("utf-8"))
    assert "columns without a unit are taken as <SI>." in reader.text


@pytest.mark.parametrize("n", [1, 2, 3])
def test_a_handful_of_samples_is_enough(run, tmp_path, n):
    sol, rec = run(50)
    sol, rec = sol.between(0, (n - 0.5) / 286.0), rec.between(0, (n - 0.5) / 286.0)
    assert len(sol) == n
    reader = Reader(report.write(sol, rec, tmp_path / "r.html").read_text("utf-8"))
    assert reader.open == []


def test_alignment_that_never_ends_is_reported(run, tmp_path):
    sol, rec = run(400)
    never = replace(sol, status=np.full(400, int(Status.ALIGNING)))
    reader = Reader(report.write(never, rec, tmp_path / "r.html").read_text("utf-8"))
    assert "with attitude 0.0" in reader.words
    assert "Attitude errors" not in reader.text


def test_times_of_a_unix_clock_keep_their_resolution(run, tmp_path):
    sol, rec = run(2000)
    shift = 1.7e9
    late = Recording(imu=rec.imu.shifted(shift))
    moved = replace(sol, t=sol.t + shift, diagnostics={})
    reader = Reader(report.write(moved, late, tmp_path / "r.html").read_text("utf-8"))
    x = unpack(reader.figures[0]["data"][0]["x"])  # roll
    assert np.isin(x, moved.t).all()


# --- navigation -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def drive(run):
    sol, rec = run(6000, heading="true")
    t, n = sol.t, len(sol.t)
    r_n = np.stack((100 * np.sin(0.3 * t), 50 * t, 0.1 * t), axis=1)
    lla = lla_from_ned(r_n, [0.8, 0.2, 300.0])
    mine = lla_from_ned(r_n + [1.0, 2.0, -3.0], [0.8, 0.2, 300.0])
    mine[:400] = np.nan
    q_vb = np.tile([0.0, 1.0, 0.0, 0.0], (n, 1))
    position = PositionReference(t=t, lla=lla, v_n=np.gradient(r_n, t, axis=0))
    mount = MountReference(t=t[:1], q_vb=q_vb[:1])
    reference = replace(rec.reference, position=position, mount=mount, heading="true")
    rec = replace(rec, gnss=Gnss(t=t[::100], lla=lla[::100]), reference=reference)
    sol = replace(
        sol,
        lla=mine,
        v_n=position.v_n + 0.5,
        q_vb=q_vb,
        acc_bias=np.ones((n, 3)),
        std_position_n=np.full((n, 3), 2.0),
        std_velocity_n=np.full((n, 3), 1.0),
    )
    return sol, rec


def test_a_navigation_report_has_track_errors_and_mount(drive, tmp_path):
    sol, rec = drive
    path = report.write(sol, rec, tmp_path / "drive.html")
    reader = Reader(path.read_text("utf-8"))
    for heading in ("Track", "Position errors", "Standard deviations", "Mount and lever arm"):
        assert heading in reader.text
    errors = navigation_errors(sol, rec.reference)
    assert errors.statistics()["horizontal"].rmse == pytest.approx(np.sqrt(5.0), abs=0.01)
    assert page.number(errors.statistics()["horizontal"].rmse, 3) in reader.text
    track = next(f for f in reader.figures if "east [m]" in json.dumps(f))
    estimate = next(d for d in track["data"] if d["name"] == "estimate")
    truth = next(d for d in track["data"] if d["name"] == "reference")
    east = unpack(estimate["x"])
    assert (east[0], east[-1]) == pytest.approx((0.0, 50 * (sol.t[-1] - sol.t[400])), abs=0.01)
    assert unpack(truth["x"])[-1] - east[-1] == pytest.approx(-2.0, abs=0.01)
    assert path.stat().st_size < 8e6


def test_given_errors_are_used(drive, tmp_path):
    sol, rec = drive
    errors = navigation_errors(sol, rec.reference, lever_arm_b=[0.0, 0.0, 100.0])
    reader = Reader(report.write(sol, rec, tmp_path / "r.html", errors=errors).read_text("utf-8"))
    assert page.number(errors.statistics()["vertical"].rmse, 3) in reader.text


def test_withheld_fixes_are_drawn_apart_and_their_errors_listed(drive, tmp_path):
    sol, rec = drive
    span = (8.0, 14.0)
    outages = outage_errors(sol, rec, [span])
    arm = np.tile([0.4, -1.3, 0.2], (len(sol), 1))
    path = report.write(replace(sol, antenna_b=arm), rec, tmp_path / "r.html", outages=outages)
    reader = Reader(path.read_text("utf-8"))
    assert "fixes withheld [s]" in reader.text
    assert page.number(outages[0].horizontal_error_m, 3) in reader.text
    track = next(f for f in reader.figures if "east [m]" in json.dumps(f))
    drawn = {d["name"]: len(unpack(d["x"])) for d in track["data"] if "fixes" in d["name"]}
    withheld = int(((rec.gnss.t >= span[0]) & (rec.gnss.t <= span[1])).sum())
    assert drawn == {"GNSS fixes": len(rec.gnss) - withheld, "withheld fixes": withheld}
    assert any("lever arm [m]" in json.dumps(f) for f in reader.figures)


def test_a_reference_that_does_not_count_is_not_on_the_map(drive, tmp_path):
    sol, rec = drive
    lla = rec.reference.position.lla.copy()
    lla[3000:3100, 0] += 4e-4  # 2.5 km off
    position = replace(rec.reference.position, lla=lla, valid=np.abs(np.arange(6000) - 3050) > 50)
    rec = replace(rec, reference=replace(rec.reference, position=position))
    reader = Reader(report.write(sol, rec, tmp_path / "r.html").read_text("utf-8"))
    track = next(f for f in reader.figures if "east [m]" in json.dumps(f))
    truth = next(d for d in track["data"] if d["name"] == "reference")
    north = unpack(truth["y"])
    assert np.nanmax(np.abs(north)) < 200.0  # the swing of 100 m, and where it begins
    assert np.isnan(north).sum() == 1  # the pen is lifted there


def test_the_gate_is_drawn_where_the_estimator_has_one(run, tmp_path):
    sol, rec = run(2000)
    gated = replace(sol, meta={"parameters": {"gate": 4.5}})
    for solution, count in ((gated, 6), (sol, 0)):  # two lines in each of three panels
        reader = Reader(report.write(solution, rec, tmp_path / "r.html").read_text("utf-8"))
        drawn = [d for f in reader.figures for d in f["data"] if d.get("name") == "gate"]
        assert len(drawn) == count
        assert ("4.5 sigma" in reader.words) == bool(count)
    assert count == 0
    reader = Reader(report.write(gated, rec, tmp_path / "r.html").read_text("utf-8"))
    drawn = [d for f in reader.figures for d in f["data"] if d.get("name") == "gate"]
    assert sorted({float(v) for d in drawn for v in unpack(d["y"])}) == [-4.5, 4.5]


def test_the_first_wide_sigma_does_not_flatten_what_follows(run, tmp_path):
    sol, rec = run(4000)
    d = sol.diagnostics["acc"]
    sigma, innovation = d.sigma.copy(), d.innovation.copy()
    sigma[:5], innovation[7] = 1e3, 2.4e3  # a start, and a jump that the gate refuses
    outcome = np.ones(len(d.t), int)
    outcome[7] = 2
    d = replace(d, sigma=sigma, innovation=innovation, outcome=outcome)
    std = sol.std_gyr_bias.copy()
    std[:300] = 1.0
    sol = replace(sol, diagnostics={"acc": d}, std_gyr_bias=std)
    reader = Reader(report.write(sol, rec, tmp_path / "r.html").read_text("utf-8"))
    shown = [
        f["layout"]["yaxis"]["range"] for f in reader.figures
        if any(t.get("name") == "±3 sigma" for t in f["data"]) and "range" in f["layout"]["yaxis"]
    ]  # fmt: skip
    bias, innovations = (high for _, high in shown)
    assert 3.0 < innovations < 5.0  # the largest of 950 of sigma one
    # 0.001 rad/s and three times 5e-4, in deg/s
    assert bias == pytest.approx(np.degrees(0.0025), rel=1e-3)


def test_a_mount_is_shown_from_where_it_was_found(drive, tmp_path):
    sol, rec = drive
    q_vb = sol.q_vb.copy()
    q_vb[:2000] = (1.0, 0.0, 0.0, 0.0)
    found = replace(sol, q_vb=q_vb)
    reader = Reader(report.write(found, rec, tmp_path / "r.html").read_text("utf-8"))
    figure = next(f for f in reader.figures if "angle [°]" in json.dumps(f, ensure_ascii=False))
    assert unpack(figure["data"][0]["x"])[0] == np.float32(sol.t[2000])
    assert figure["layout"]["xaxis"]["range"] == [sol.t[0], sol.t[-1]]
    assert "They differ by 0.00°" in reader.words
    never = replace(sol, q_vb=np.tile((1.0, 0.0, 0.0, 0.0), (len(sol), 1)))
    reader = Reader(report.write(never, rec, tmp_path / "r.html").read_text("utf-8"))
    assert "The mount was not found" in reader.words


def test_a_solution_that_rejects_what_it_measures_is_doubted(drive, tmp_path):
    sol, rec = drive
    d = sol.diagnostics["acc"]
    for share, count in ((0.2, 0), (0.5, 1)):
        outcome = np.where(np.arange(len(d.t)) < share * len(d.t), 2, 1)
        doubtful = replace(sol, diagnostics={"gnss_position": replace(d, outcome=outcome)})
        found = report.doubts(doubtful)
        assert len(found) == count
        reader = Reader(report.write(doubtful, rec, tmp_path / "r.html").read_text("utf-8"))
        assert ("Not to be trusted" in reader.text) == bool(count)
    assert f"{int(np.sum(outcome == 2))} of {len(d.t)} measurements of gnss_position" in found[0]
    # an attitude filter may well refuse most of a field
    assert report.doubts(replace(doubtful, lla=None, v_n=None, q_vb=None)) == []


# --- the file ---------------------------------------------------------------------------


def test_a_failed_write_leaves_the_old_file_and_no_other(run, tmp_path, monkeypatch):
    sol, rec = run(300)
    path = tmp_path / "report.html"
    path.write_text("old")

    def refuse(*_):
        raise OSError("disk full")

    monkeypatch.setattr("os.replace", refuse)
    with pytest.raises(FormatError, match="disk full"):
        report.write(sol, rec, path)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["report.html"]


def test_a_folder_that_is_not_there_is_refused(run, tmp_path):
    sol, rec = run(300)
    with pytest.raises(FormatError, match="cannot be written: there is no folder"):
        report.write(sol, rec, tmp_path / "no" / "report.html")


def test_the_same_run_gives_the_same_bytes(run, tmp_path):
    sol, rec = run(300)
    one = report.write(sol, rec, tmp_path / "a.html").read_bytes()
    assert one == report.write(sol, rec, tmp_path / "b.html").read_bytes()
