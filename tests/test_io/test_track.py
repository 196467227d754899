"""Tracks for other programs, read back by parsers that are not ours."""

import json
import xml.etree.ElementTree as ET
from datetime import datetime

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from strapdown import io
from strapdown.errors import FormatError, InputError
from strapdown.solution import Solution, Status
from strapdown.units import DEG

N = 401
RATE = 100.0
ALIGNING = 50


def solution(lon0=0.2, **changes):
    t = 10.0 + np.arange(N) / RATE
    lla = np.column_stack((0.8 + 1e-6 * np.arange(N), lon0 + 2e-6 * np.arange(N), 100.0 + 0.1 * t))
    lla[:ALIGNING] = np.nan
    status = np.zeros(N, np.int64)
    status[:ALIGNING] = Status.ALIGNING
    q_nb = np.roll(Rotation.random(N, rng=np.random.default_rng(3)).as_quat(), 1, axis=1)
    given = {"t": t, "q_nb": q_nb, "status": status, "filter": "test", "lla": lla,
             "meta": {"epoch_utc": "2026-05-04T12:00:00Z"}}  # fmt: skip
    return Solution(**{**given, **changes})


def local(tag):
    return tag.rpartition("}")[2]


def texts(path, name):
    return [e.text for e in ET.parse(path).iter() if local(e.tag) == name]


def test_maps_get_a_point_per_second_and_the_last_from_where_it_is_aligned(tmp_path):
    sol = solution()
    rows = [50, 150, 250, 350, 400]
    want = np.column_stack((sol.lla[rows, 1] / DEG, sol.lla[rows, 0] / DEG, sol.lla[rows, 2]))
    for suffix in ("kml", "gpx", "geojson"):
        io.write_solution(sol, tmp_path / f"t.{suffix}")
    kml = np.array([p.split(",") for p in texts(tmp_path / "t.kml", "coordinates")[0].split()])
    points = [e for e in ET.parse(tmp_path / "t.gpx").iter() if local(e.tag) == "trkpt"]
    gpx = np.array([[p.get("lon"), p.get("lat"), p[0].text] for p in points])
    feature = json.loads((tmp_path / "t.geojson").read_text())["features"][0]
    assert feature["geometry"]["type"] == "LineString"
    # nine decimals of a degree are 0.1 mm, three of a metre 1 mm
    for got in (kml, gpx, feature["geometry"]["coordinates"]):
        assert np.asarray(got, float) == pytest.approx(want, abs=1e-3)
        assert np.asarray(got, float)[:, :2] == pytest.approx(want[:, :2], abs=1e-9)
    assert feature["properties"]["t_s"] == pytest.approx(sol.t[rows])


def test_gpx_has_utc_times_where_the_epoch_is_known_and_none_where_not(tmp_path):
    io.write_solution(solution(), tmp_path / "t.gpx")
    stamps = [datetime.fromisoformat(s) for s in texts(tmp_path / "t.gpx", "time")]
    assert stamps[0] == datetime.fromisoformat("2026-05-04T12:00:10.500+00:00")
    io.write_solution(solution(meta={}), tmp_path / "t.gpx")
    assert texts(tmp_path / "t.gpx", "time") == []
    with pytest.raises(InputError, match="`epoch_utc` must be an ISO 8601 time, got 'noon'"):
        io.write_solution(solution(meta={"epoch_utc": "noon"}), tmp_path / "t.gpx")


def test_geojson_is_cut_at_the_antimeridian(tmp_path):
    io.write_solution(solution(lon0=np.pi - 4e-4), tmp_path / "t.geojson")
    geometry = json.loads((tmp_path / "t.geojson").read_text())["features"][0]["geometry"]
    assert geometry["type"] == "MultiLineString"
    first, second = (np.array(piece) for piece in geometry["coordinates"])
    assert (first[:, 0] > 179.9).all()
    assert (second[:, 0] < -179.9).all()
    assert len(first) + len(second) == 5


def test_tum_rows_are_east_north_up_and_scalar_last(tmp_path):
    sol = solution()
    io.write_solution(sol, tmp_path / "t.tum")
    rows = np.loadtxt(tmp_path / "t.tum")
    lla = sol.lla[ALIGNING:]
    east, north, up = pymap3d.geodetic2enu(
        lla[:, 0] / DEG, lla[:, 1] / DEG, lla[:, 2], lla[0, 0] / DEG, lla[0, 1] / DEG, lla[0, 2]
    )
    assert rows[:, 1:4] == pytest.approx(np.column_stack((east, north, up)), abs=2e-6)
    epoch = datetime.fromisoformat("2026-05-04T12:00:00Z").timestamp()
    assert rows[:, 0] - epoch == pytest.approx(sol.t[ALIGNING:], abs=2e-6)
    enu_from_ned = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    want = enu_from_ned * Rotation.from_quat(np.roll(sol.q_nb[ALIGNING:], -1, axis=1))
    assert (Rotation.from_quat(rows[:, 4:]) * want.inv()).magnitude().max() < 1e-8


def test_a_track_of_attitude_alone_or_of_nothing_aligned_is_refused(tmp_path):
    with pytest.raises(FormatError, match=r"t\.kml.*needs positions.*attitude only"):
        io.write_solution(solution(lla=None), tmp_path / "t.kml")
    never = np.full(N, int(Status.ALIGNING))
    with pytest.raises(FormatError, match="never aligned"):
        io.write_solution(solution(status=never), tmp_path / "t.gpx")
    with pytest.raises(FormatError, match=r"written as \.parquet, \.csv, \.kml.*got '\.shp'"):
        io.write_solution(solution(), tmp_path / "t.shp")
    assert list(tmp_path.iterdir()) == []


def test_only_solutions_of_ours_are_taken_for_solutions(tmp_path):
    io.write_solution(solution(), tmp_path / "s.parquet")
    (tmp_path / "x.parquet").write_bytes(b"PAR1 no")
    assert io.holds_solution(tmp_path / "s.parquet")
    for name in ("x.parquet", "missing.parquet", "."):
        assert not io.holds_solution(tmp_path / name)
