"""Tracks of solutions for other programs: maps (KML, GPX, GeoJSON) and `evo` (TUM).

Rows that are still aligning or have no position are left out. Maps get at most one point per
second: for looking at, a point per sample is too many.
"""

import json
from collections.abc import Callable, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import numpy as np

from strapdown._types import FloatArray, IntArray
from strapdown.earth import ned_from_lla
from strapdown.errors import FormatError, InputError
from strapdown.rotation import quat_mul
from strapdown.solution import Solution, Status
from strapdown.units import DEG

MAP_INTERVAL: Final = 1.0  # least time between the points on a map [s]
_Q_ENU_NED: Final = np.array([0.0, 1.0, 1.0, 0.0]) / np.sqrt(2.0)


def text_of(sol: Solution, suffix: str, path: Path) -> str:
    """Return a solution's track as the text of a file.

    Parameters
    ----------
    sol : Solution
        With positions.
    suffix : str
        One of `SUFFIXES`.
    path : path
        The file, for messages.

    Returns
    -------
    str

    Raises
    ------
    FormatError
        If the solution has no positions, or none after alignment.
    """
    if sol.lla is None:
        raise FormatError(
            "a track needs positions, the solution has attitude only", file=path,
            hint="write .parquet or .csv, or navigate with GNSS",
        )  # fmt: skip
    known = ((sol.status & Status.ALIGNING) == 0) & np.isfinite(sol.lla).all(axis=1)
    rows = np.flatnonzero(known)
    if not len(rows):
        raise FormatError("a track needs positions, the solution never aligned", file=path)
    return _WRITERS[suffix](sol, rows)


def _points(sol: Solution, rows: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return times [s] and longitude, latitude, height [deg, deg, m] of the points on a map."""
    assert sol.lla is not None
    kept = []
    last = -np.inf
    for row in rows:
        if sol.t[row] >= last + MAP_INTERVAL:
            kept.append(row)
            last = sol.t[row]
    if kept[-1] != rows[-1]:
        kept.append(rows[-1])
    lla = sol.lla[kept]
    lon = np.remainder(lla[:, 1] + np.pi, 2.0 * np.pi) - np.pi
    return sol.t[kept], np.column_stack((lon / DEG, lla[:, 0] / DEG, lla[:, 2]))


def _epoch(sol: Solution) -> datetime | None:
    """Return the UTC of ``t = 0``, None if it is not known."""
    text = sol.meta.get("epoch_utc")
    if text is None:
        return None
    try:
        epoch = datetime.fromisoformat(str(text))
    except ValueError:
        raise InputError(f"`epoch_utc` must be an ISO 8601 time, got {text!r}.") from None
    return epoch.replace(tzinfo=UTC) if epoch.tzinfo is None else epoch.astimezone(UTC)


def _stamps(epoch: datetime, t: FloatArray) -> list[str]:
    """Return times as ``2026-01-31T12:00:00.250Z``."""
    return [
        (epoch + timedelta(seconds=float(s)))
        .isoformat(timespec="milliseconds")
        .replace("+00:00", "Z")
        for s in t
    ]


def _kml(sol: Solution, rows: IntArray) -> str:
    """Return a line string at ellipsoidal heights."""
    t, points = _points(sol, rows)
    root = ET.Element("kml", xmlns="http://www.opengis.net/kml/2.2")
    document = ET.SubElement(root, "Document")
    ET.SubElement(document, "name").text = f"strapdown: {sol.filter}"
    style = ET.SubElement(document, "Style", id="track")
    line = ET.SubElement(style, "LineStyle")
    ET.SubElement(line, "color").text = "ffb4591f"  # alpha, blue, green, red
    ET.SubElement(line, "width").text = "3"
    mark = ET.SubElement(document, "Placemark")
    ET.SubElement(mark, "name").text = sol.filter
    ET.SubElement(mark, "description").text = "WGS-84, heights above the ellipsoid"
    epoch = _epoch(sol)
    if epoch is not None:
        span = ET.SubElement(mark, "TimeSpan")
        for name, stamp in zip(("begin", "end"), _stamps(epoch, t[[0, -1]]), strict=True):
            ET.SubElement(span, name).text = stamp
    ET.SubElement(mark, "styleUrl").text = "#track"
    string = ET.SubElement(mark, "LineString")
    ET.SubElement(string, "altitudeMode").text = "clampToGround"
    ET.SubElement(string, "coordinates").text = " ".join(
        f"{lon:.9f},{lat:.9f},{height:.3f}" for lon, lat, height in points
    )
    return _xml(root)


def _gpx(sol: Solution, rows: IntArray) -> str:
    """Return one track segment; times only where the epoch is known, as GPX has no others."""
    t, points = _points(sol, rows)
    epoch = _epoch(sol)
    stamps = _stamps(epoch, t) if epoch is not None else None
    root = ET.Element(
        "gpx", version="1.1", creator="strapdown", xmlns="http://www.topografix.com/GPX/1/1"
    )
    track = ET.SubElement(root, "trk")
    ET.SubElement(track, "name").text = sol.filter
    segment = ET.SubElement(track, "trkseg")
    for k, (lon, lat, height) in enumerate(points):
        point = ET.SubElement(segment, "trkpt", lat=f"{lat:.9f}", lon=f"{lon:.9f}")
        ET.SubElement(point, "ele").text = f"{height:.3f}"
        if stamps is not None:
            ET.SubElement(point, "time").text = stamps[k]
    return _xml(root)


def _geojson(sol: Solution, rows: IntArray) -> str:
    """Return a feature whose property ``t_s`` has the time of each point."""
    t, points = _points(sol, rows)
    properties: dict[str, Any] = {"filter": sol.filter, "t_s": [round(float(s), 6) for s in t]}
    if sol.meta.get("epoch_utc") is not None:
        properties["epoch_utc"] = str(sol.meta["epoch_utc"])
    coordinates = [[round(lon, 9), round(lat, 9), round(h, 3)] for lon, lat, h in points.tolist()]
    # RFC 7946 cuts lines at the antimeridian, lest they be drawn around the Earth.
    cuts = np.flatnonzero(np.abs(np.diff(points[:, 0])) > 180.0) + 1
    pieces = [
        coordinates[a:b]
        for a, b in zip([0, *cuts.tolist()], [*cuts.tolist(), len(coordinates)], strict=True)
    ]
    geometry: dict[str, Any] = {"type": "MultiLineString", "coordinates": pieces}
    if len(pieces) == 1:
        geometry = {"type": "LineString", "coordinates": coordinates}
    feature = {"type": "Feature", "properties": properties, "geometry": geometry}
    return json.dumps({"type": "FeatureCollection", "features": [feature]}, allow_nan=False) + "\n"


def _tum(sol: Solution, rows: IntArray) -> str:
    """Return every row as ``t x y z qx qy qz qw``: east, north, up of the first position."""
    assert sol.lla is not None
    lla = sol.lla[rows]
    ned = ned_from_lla(lla, lla[0])
    q = quat_mul(_Q_ENU_NED, sol.q_nb[rows])
    epoch = _epoch(sol)
    t = sol.t[rows] + (0.0 if epoch is None else epoch.timestamp())
    lines = ["# timestamp x y z qx qy qz qw: s, m, east-north-up, body to east-north-up"]
    lines += [
        f"{time:.6f} {east:.6f} {north:.6f} {-down:.6f} {x:.9f} {y:.9f} {z:.9f} {w:.9f}"
        for time, (north, east, down), (w, x, y, z) in zip(t, ned, q, strict=True)
    ]
    return "\n".join(lines) + "\n"


def _xml(root: ET.Element) -> str:
    ET.indent(root)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    )


_WRITERS: Final[Mapping[str, Callable[[Solution, IntArray], str]]] = {
    ".kml": _kml,
    ".gpx": _gpx,
    ".geojson": _geojson,
    ".tum": _tum,
}
SUFFIXES: Final = tuple(_WRITERS)
