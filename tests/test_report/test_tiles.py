"""Map tiles below a track: found on the disk, put where they belong, never fetched."""

import base64
import json
import re
import sqlite3
from dataclasses import replace

import numpy as np
import pymap3d
import pytest

from strapdown import report
from strapdown.earth import lla_from_ned
from strapdown.errors import FormatError
from strapdown.recording import Recording
from strapdown.report import Tiles
from strapdown.report.tiles import MOST, Box
from strapdown.units import DEG

PNG = b"\x89PNG\r\n\x1a\n"  # the head is enough: nobody draws here
PLACE = (52.52, 13.405)  # deg


def number(lat, lon, zoom):
    """Column and row of a tile, written out with the tangent and secant of the map's makers."""
    n = 2**zoom
    y = np.log(np.tan(lat * DEG) + 1.0 / np.cos(lat * DEG))
    return int((lon + 180.0) / 360.0 * n), int((1.0 - y / np.pi) / 2.0 * n)


def name(x, y, zoom):
    return f"{zoom}/{x}/{y}".encode()


def around(zoom, reach):
    x, y = number(*PLACE, zoom)
    return [
        (i, j) for i in range(x - reach, x + reach + 1) for j in range(y - reach, y + reach + 1)
    ]


@pytest.fixture(params=["folder", "mbtiles"])
def stored(request, tmp_path):
    """Tiles of two zooms, each with its name as content."""
    if request.param == "folder":
        for zoom in (14, 17):
            for x, y in around(zoom, 4):
                file = tmp_path / "map" / str(zoom) / str(x) / f"{y}.png"
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(PNG + name(x, y, zoom))
        return tmp_path / "map"
    path = tmp_path / "map.mbtiles"
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE metadata (name text, value text)")
        base.execute("INSERT INTO metadata VALUES ('attribution', 'drawn <by> nobody')")
        base.execute(
            "CREATE TABLE tiles (zoom_level int, tile_column int, tile_row int, tile_data blob)"
        )
        for zoom in (14, 17):
            for x, y in around(zoom, 4):
                row = (zoom, x, 2**zoom - 1 - y, PNG + name(x, y, zoom))
                base.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", row)
    base.close()
    return path


def box(metres):
    corners = lla_from_ned([[-metres, -metres, 0], [metres, metres, 0]], origin())
    return Box(corners[0, 0], corners[0, 1], corners[1, 0], corners[1, 1])


def origin():
    return np.array([PLACE[0] * DEG, PLACE[1] * DEG, 40.0])


def test_the_finest_zoom_that_few_tiles_cover_is_taken(stored):
    tiles = Tiles(stored)
    for metres, zoom in ((300.0, 17), (2500.0, 14)):
        found = tiles.covering(box(metres))
        assert 1 < len(found) <= MOST
        for tile in found:
            content = base64.b64decode(tile.url.partition(",")[2])
            assert tile.url.startswith("data:image/png;base64,")
            # which tile it is follows from its middle, by another formula
            lat, lon = (
                0.5 * (a + b) / DEG for a, b in zip(tile.box[:2], tile.box[2:], strict=True)
            )
            assert content == PNG + name(*number(lat, lon, zoom), zoom)
        edges = np.array([tile.box for tile in found])
        wanted = box(metres)
        assert (edges.min(axis=0)[:2] <= wanted[:2]).all()
        assert (edges.max(axis=0)[2:] >= wanted[2:]).all()


def test_where_there_is_no_map_there_are_no_tiles(stored):
    tiles = Tiles(stored)
    assert tiles.covering(Box(0.1, 0.1, 0.1001, 0.1001)) == []
    assert tiles.covering(Box(1.56, 0.1, 1.5601, 0.1001)) == []  # beyond the projection
    assert tiles.covering(Box(0.1, 3.14, 0.1001, -3.14)) == []  # across the antimeridian


@pytest.mark.parametrize("what", ["missing", "empty", "text"])
def test_what_holds_no_tiles_is_refused(tmp_path, what):
    path = tmp_path / what
    if what == "empty":
        path.mkdir()
    elif what == "text":
        path.write_text("not a database")
    message = "no such file or folder" if what == "missing" else "MBTiles file or a folder of zoom"
    with pytest.raises(FormatError, match=message):
        Tiles(path)


def test_tiles_lie_below_the_track_where_they_belong(run, stored, tmp_path):
    sol, rec = run(2000)
    r_n = np.stack((30.0 * sol.t, 20.0 * sol.t, 0.0 * sol.t), axis=1)
    sol = replace(sol, lla=lla_from_ned(r_n, origin()))
    rec = Recording(imu=rec.imu)
    content = report.write(sol, rec, tmp_path / "r.html", tiles=Tiles(stored)).read_text("utf-8")
    figures = [
        json.loads(m)
        for m in re.findall(r'<script type="application/json">(.*?)</script>', content)
    ]
    images = next(f["layout"]["images"] for f in figures if f.get("layout", {}).get("images"))
    assert all(image["source"].startswith("data:image/png") for image in images)
    image = images[0]
    x, y = (
        int(p)
        for p in base64.b64decode(image["source"].partition(",")[2])[len(PNG) + 3 :].split(b"/")
    )
    # the north-west corner of the tile, by the inverse of the projection and another library
    n = 2**17
    lat = np.degrees(2.0 * np.arctan(np.exp(np.pi * (1.0 - 2.0 * y / n))) - np.pi / 2)
    east, north, _ = pymap3d.geodetic2enu(lat, 360.0 * x / n - 180.0, 40.0, *PLACE, 40.0)
    # it is not turned by the meridians' convergence, 0.1 mrad for 300 m, over its size of 190 m
    assert (image["x"], image["y"]) == pytest.approx((east, north), abs=0.05)
    assert image["sizex"] == pytest.approx(
        360.0 / n * DEG * 6378137.0 * np.cos(lat * DEG), rel=4e-3
    )
    if stored.suffix:
        assert "drawn &lt;by&gt; nobody" in content
    elsewhere = replace(sol, lla=sol.lla + [0.1, 0.0, 0.0])
    content = report.write(elsewhere, rec, tmp_path / "r.html", tiles=Tiles(stored)).read_text(
        "utf-8"
    )
    assert "has no tiles here" in content
