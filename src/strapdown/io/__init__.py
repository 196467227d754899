"""Recordings and solutions in files: formats found out from content, errors that say what to do.

`read` returns a recording, `read_raw` columns and findings without judging, `write` keeps a
recording; `formats` tells what is known. ``docs/formats.md`` describes each format.
"""

from strapdown.io._raw import Column, Finding, RawLog, Table
from strapdown.io._reading import read, read_raw
from strapdown.io._registry import FormatInfo, formats
from strapdown.io._roles import ROLES
from strapdown.io._writing import write
from strapdown.io.solution import holds_solution, read_solution, write_solution

__all__ = [
    "ROLES",
    "Column",
    "Finding",
    "FormatInfo",
    "RawLog",
    "Table",
    "formats",
    "holds_solution",
    "read",
    "read_raw",
    "read_solution",
    "write",
    "write_solution",
]
