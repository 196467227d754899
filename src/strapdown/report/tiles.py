"""Pictures of a map to lie below a track: tiles that are on the disk, never from a network.

Map programs store them as one file (MBTiles, an SQLite database) or as a folder of
``zoom/x/y.png``, both in the square projection of web maps (Web Mercator on WGS-84 latitudes).
"""

import base64
import math
import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final, NamedTuple

from strapdown.errors import FormatError

MOST: Final = 40  # tiles in a page: some 20 kB each
DEEPEST: Final = 19
LIMIT: Final = math.radians(85.0)  # the projection ends at 85.05 deg of latitude
_KINDS: Final = {b"\x89PNG": "png", b"\xff\xd8\xff": "jpeg", b"RIFF": "webp"}
_NEITHER: Final = "map tiles must be an MBTiles file or a folder of zoom/x/y.png, this is neither"
_ENDINGS: Final = (".png", ".jpg", ".jpeg", ".webp")


class Box(NamedTuple):
    """Limits of a piece of the Earth [rad]."""

    south: float
    west: float
    north: float
    east: float


class Tile(NamedTuple):
    """A picture, where it lies, and its content as a URL."""

    box: Box
    url: str


class Tiles:
    """Tiles of a map on the disk.

    Parameters
    ----------
    path : str or path
        An MBTiles file, or a folder of ``zoom/x/y.png`` (``jpg``, ``webp``), y counted from the
        north.

    Raises
    ------
    FormatError
        If it is neither.

    Examples
    --------
    >>> Tiles("nowhere.mbtiles")
    Traceback (most recent call last):
        ...
    strapdown.errors.FormatError: nowhere.mbtiles: there is no such file or folder.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.credit = ""
        if not self.path.exists():
            raise FormatError("there is no such file or folder", file=self.path)
        if self.path.is_dir():
            self._zooms = sorted(
                int(p.name) for p in self.path.iterdir() if p.is_dir() and p.name.isdigit()
            )
        else:
            with self._reading() as base:
                self._zooms = sorted(
                    row[0] for row in base.execute("SELECT DISTINCT zoom_level FROM tiles")
                )
                names = "SELECT value FROM metadata WHERE name = 'attribution'"
                self.credit = next((str(row[0]) for row in base.execute(names)), "")
        if not self._zooms:
            raise FormatError(_NEITHER, file=self.path)

    def covering(self, box: Box) -> list[Tile]:
        """Return the tiles of the finest zoom that covers a box with few of them.

        Parameters
        ----------
        box : Box
            Limits [rad]. One across the antimeridian has its west beyond its east.

        Returns
        -------
        list of Tile
            None where the map does not reach.
        """
        if box.west > box.east or max(-box.south, box.north) > LIMIT:
            return []
        for zoom in reversed([z for z in self._zooms if 0 <= z <= DEEPEST]):
            left, top = _square(box.north, box.west, zoom)
            right, bottom = _square(box.south, box.east, zoom)
            if (right - left + 1) * (bottom - top + 1) > MOST:
                continue
            found = list(self._read(zoom, range(left, right + 1), range(top, bottom + 1)))
            if found:
                return found
        return []

    def _read(self, zoom: int, columns: range, rows: range) -> Iterator[Tile]:
        for x in columns:
            for y in rows:
                content = self._content(zoom, x, y)
                kind = next((k for head, k in _KINDS.items() if content.startswith(head)), None)
                if kind is not None:
                    text = base64.b64encode(content).decode("ascii")
                    yield Tile(_box(x, y, zoom), f"data:image/{kind};base64,{text}")

    def _content(self, zoom: int, x: int, y: int) -> bytes:
        """Return the file of a tile; empty where there is none."""
        if self.path.is_dir():
            for ending in _ENDINGS:
                file = self.path / str(zoom) / str(x) / f"{y}{ending}"
                if file.is_file():
                    return file.read_bytes()
            return b""
        with self._reading() as base:  # its rows count from the south
            rows = base.execute(
                "SELECT tile_data FROM tiles "
                "WHERE zoom_level = ? AND tile_column = ? AND tile_row = ?",
                (zoom, x, (1 << zoom) - 1 - y),
            )
            return next((bytes(row[0]) for row in rows), b"")

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        """Open the database; what goes wrong in it is the file's fault."""
        address = f"{self.path.resolve().as_uri()}?mode=ro"
        try:
            with closing(sqlite3.connect(address, uri=True)) as base:
                yield base
        except sqlite3.Error:
            raise FormatError(_NEITHER, file=self.path) from None


def _square(lat: float, lon: float, zoom: int) -> tuple[int, int]:
    """Return column and row, from the north, of the tile that holds a point."""
    n = 1 << zoom
    x = (lon / math.pi + 1.0) / 2.0 * n
    y = (1.0 - math.asinh(math.tan(lat)) / math.pi) / 2.0 * n
    return min(n - 1, max(0, math.floor(x))), min(n - 1, max(0, math.floor(y)))


def _box(x: int, y: int, zoom: int) -> Box:
    """Return the limits of a tile."""
    n = 1 << zoom

    def lat(row: int) -> float:
        return math.atan(math.sinh(math.pi * (1.0 - 2.0 * row / n)))

    def lon(column: int) -> float:
        return math.pi * (2.0 * column / n - 1.0)

    return Box(south=lat(y + 1), west=lon(x), north=lat(y), east=lon(x + 1))
