"""`write`: a recording into a file, whole or not at all."""

from os import PathLike
from pathlib import Path

from strapdown.errors import InputError
from strapdown.io._atomic import written_aside
from strapdown.io._registry import for_suffix, module
from strapdown.recording import Recording


def write(rec: Recording, path: str | PathLike[str], format: str | None = None) -> None:
    """Write a recording.

    Parameters
    ----------
    rec : Recording
        All its streams and its reference are written.
    path : str or path
        ``.parquet`` keeps everything bit for bit; ``.csv``, ``.tsv`` and either with ``.gz``
        hold the numbers in the units of columns' names, without metadata.
    format : {'parquet', 'csv'}, optional
        By default told by the ending.

    Raises
    ------
    FormatError
        If it cannot be written there; what stood there before is then unchanged.
    InputError
        If the recording cannot be written in this format.
    """
    target = Path(path)
    handler = for_suffix(target) if format is None else module(format)
    if not hasattr(handler, "save"):
        raise InputError(f"the format {handler.NAME} is read, not written; write parquet or csv.")
    with written_aside(target) as stream:
        handler.save(rec, target, stream)
