"""Solutions in files: one flat table in SI, for any tool that reads Parquet or CSV.

Columns are ``t_s``, those of `solution.COLUMNS` that the solution has, and ``status``. What
cannot stand in columns (filter, heading reference, parameters) is in the Parquet file's metadata
under ``strapdown``; a CSV file is without it. Diagnostics, which have times of their own, stay
out of both.
"""

from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from strapdown import _checks
from strapdown.errors import FormatError
from strapdown.io import track
from strapdown.io._atomic import written_aside
from strapdown.io.parquet import KEY, VERSION, as_json, damaged, header_of, open_file
from strapdown.solution import COLUMNS, Solution


def write_solution(sol: Solution, path: str | PathLike[str]) -> None:
    """Write a solution as the path's ending says.

    ``.parquet`` keeps it bit for bit but for the diagnostics, ``.csv`` its columns in SI;
    ``.kml``, ``.gpx`` and ``.geojson`` the track for maps, a point per second, ``.tum`` the
    track and attitude that `evo` reads.

    Parameters
    ----------
    sol : Solution
        Its diagnostics are not written.
    path : str or path
        The file; written aside first, so that it is whole or not there.

    Raises
    ------
    FormatError
        If it cannot be written, the ending is another, or a track is asked of a solution
        without positions.
    """
    import pyarrow as pa

    _checks.instance("sol", sol, Solution, "an estimator's `run` gives one")
    target = Path(path)
    suffix = target.suffix.lower()
    if suffix in track.SUFFIXES:
        text = track.text_of(sol, suffix, target)
        with written_aside(target) as stream:
            stream.write(text.encode())
        return
    columns: dict[str, Any] = {"t_s": sol.t}
    for name, labels in COLUMNS.items():
        array = getattr(sol, name)
        if array is None:
            continue
        for j, label in enumerate(labels):
            values = array if array.ndim == 1 else array[:, j]
            columns[label] = np.ascontiguousarray(values)
    table = pa.table({k: pa.array(v, from_pandas=False) for k, v in columns.items()})
    if suffix == ".csv":
        from pyarrow import csv

        with written_aside(target) as stream:
            csv.write_csv(table, stream, csv.WriteOptions(quoting_style="none"))
        return
    if suffix not in (".parquet", ".pq"):
        raise FormatError(
            f"a solution is written as .parquet, .csv, {', '.join(track.SUFFIXES)}, "
            f"got {target.suffix!r}",
            file=target,
        )
    from pyarrow import parquet

    header = {
        "format_version": VERSION,
        "kind": "solution",
        "filter": sol.filter,
        "causal": sol.causal,
        "heading_reference": sol.heading_reference,
        "meta": dict(sol.meta),
    }
    table = table.replace_schema_metadata({KEY: as_json(header, target)})
    with written_aside(target) as stream:
        parquet.write_table(
            table,
            stream,
            compression="zstd",
            compression_level=1,
            use_dictionary=False,
            write_page_checksum=True,
        )


def holds_solution(path: str | PathLike[str]) -> bool:
    """Whether a file holds a solution that `write_solution` wrote as Parquet.

    Parameters
    ----------
    path : str or path
        Any file or folder, there or not.

    Returns
    -------
    bool
    """
    target = Path(path)
    try:
        return header_of(open_file(target), target, "solution") is not None
    except FormatError:
        return False


def read_solution(path: str | PathLike[str]) -> Solution:
    """Return the solution that `write_solution` wrote as Parquet; diagnostics are empty.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    Solution
        Bit for bit what was written.

    Raises
    ------
    FormatError
        If the file is missing, damaged, or holds something else.
    """
    import pyarrow as pa

    target = Path(path)
    file = open_file(target)
    header = header_of(file, target, "solution")
    if header is None:
        raise FormatError("must hold a solution that strapdown wrote", file=target)
    try:
        table = file.read()
        arrays: dict[str, Any] = {}
        for name, labels in COLUMNS.items():
            if labels[0] in table.column_names:
                parts = [table.column(label).to_numpy() for label in labels]
                arrays[name] = np.stack(parts, axis=1) if len(parts) > 1 else parts[0]
        return Solution(
            t=table.column("t_s").to_numpy(),
            filter=str(header["filter"]),
            causal=bool(header["causal"]),
            heading_reference=str(header["heading_reference"]),
            meta=header["meta"],
            **arrays,
        )
    except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as error:
        raise damaged(target, error) from None
