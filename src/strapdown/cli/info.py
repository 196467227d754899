"""``strapdown info``: what a log holds."""

import re
from typing import TYPE_CHECKING, Any

from strapdown.cli import _console, _options, doctor

if TYPE_CHECKING:
    from strapdown.recording import Recording

_HEADER = ("stream", "samples", "rate Hz", "from s", "to s", "gaps", "longest s", "NaN", "columns")


@_options.reads_log
def info(
    source: _options.Source,
    json: _options.Json = False,
    debug: _options.Debug = False,
) -> None:
    """Show streams, rates, gaps, units and span of a log."""
    rec = source.read()
    if json:
        _console.print_json({"log": str(source.main), **_facts(rec)})
    else:
        _print(str(source.main), rec)


def _facts(rec: "Recording") -> dict[str, Any]:
    """Return the streams by name, and the metadata."""
    streams = {}
    for row in rec.info():
        facts = {key: getattr(row, key) for key in row.__slots__}
        streams[facts.pop("name")] = facts
    return {"streams": streams, "meta": dict(rec.meta), "findings": doctor.brief(rec)}


def _brief(columns: tuple[str, ...]) -> str:
    """Return columns with the components of a vector drawn together: ``gyr_xyz_rad_s``."""
    components: dict[tuple[str, str], str] = {}
    for column in columns:
        found = re.fullmatch(r"(.+_)([wxyz])((?:_.*)?)", column)
        head, letter, tail = found.groups() if found else (column, "", "")
        components[head, tail] = components.get((head, tail), "") + letter
    return " ".join(head + letters + tail for (head, tail), letters in components.items())


def _print(log: str, rec: "Recording") -> None:
    rows = [
        (
            row.name,
            str(row.samples),
            f"{row.rate_hz:.4g}",
            f"{row.start_s:.3f}",
            f"{row.stop_s:.3f}",
            str(row.gaps),
            f"{row.longest_gap_s:.4g}",
            str(row.nan_samples),
            _brief(row.columns),
        )
        for row in rec.info()
    ]
    _console.print_table(log, _HEADER, rows, right=range(1, 8))
    for key, value in rec.meta.items():
        if key == "notes":
            for note in value:
                _console.note(note)
        else:
            _console.print_fact(key, value)
    for line in doctor.brief(rec):
        _console.note(line)
