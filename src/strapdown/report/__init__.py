"""Reports: one HTML file each, that opens anywhere and needs no network.

`write` makes the report of a run; `Tiles` are pictures of a map to lie below its track, and
`doubts` says why a solution is not to be trusted. Other reports are composed from the same parts:
`page` (the file and its blocks), `figures` (what to draw), `decimate` (fewer points for display),
`scene` (the 3D view), `streams`, `attitude`, `navigation` and `health` (sections).
"""

from strapdown.report.health import doubts
from strapdown.report.run import compose, write
from strapdown.report.tiles import Tiles

__all__ = ["Tiles", "compose", "doubts", "write"]
