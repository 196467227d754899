"""``strapdown characterize``: the noise of the sensors of a device that lay still."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapdown.cli import _console, _errors, _low_pass, _options
from strapdown.errors import InputError

if TYPE_CHECKING:
    from strapdown.noise import Characterization, Coefficient

_AXES = ("x", "y", "z")


@_options.reads_log
def characterize(
    source: _options.Source,
    file: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Noise file.")
    ] = Path("noise.toml"),
    sensors: Annotated[
        str | None,
        typer.Option("--sensors", metavar="gyr,acc,mag", help="Which; all by default."),
    ] = None,
    sensor_id: Annotated[
        str, typer.Option("--sensor-id", metavar="NAME", help="Which piece of hardware.")
    ] = "",
    low_pass: Annotated[
        str | None,
        typer.Option(
            "--low-pass",
            metavar="HZ:MS,...|mpu6050",
            help="Which of these cut-offs and delays of the gyroscope's filter to choose.",
        ),
    ] = None,
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Find the noise of gyroscope, accelerometer and magnetometer from a log at rest.

    Writes noise.toml, and beside it a page with the Allan deviations, fits and bands. The longer
    the log, the more shows: minutes for the white noise, hours for bias instability and drift.
    """
    from strapdown import noise

    filters = None if low_pass is None else _low_pass.filters(low_pass)
    asked = None if sensors is None else [name.strip() for name in sensors.split(",")]
    with _console.progress(3) as progress:
        progress.step(f"reading {source.main}")
        rec = source.read()
        progress.step("characterizing")
        with _errors.given(str(source.main)):
            found = noise.characterize(rec, asked, sensor_id=sensor_id)
        study = None if filters is None else _low_pass.study(filters, found)
        progress.step("writing")
        noise.save(found.record, file)
        outputs = {"noise": str(file)}
        if not no_report:
            from strapdown.report import noise as noise_report

            outputs["report"] = str(noise_report.write(found, file.with_suffix(".html")))
    filter_noise, notes = _filter_noise(found)
    if json:
        _console.print_json(
            {
                "log": str(source.main),
                "outputs": outputs,
                "sensors": {name: _facts(found, name) for name in found.record.sensors},
                "filter_noise": filter_noise,
                "notes": notes,
                "low_pass": None if study is None else _low_pass.facts(study),
            }
        )
    else:
        _print(str(source.main), found, notes)
        if study is not None:
            _low_pass.show(study)
        for key, path in outputs.items():
            _console.print_fact(key, path)


def _filter_noise(found: "Characterization") -> tuple[dict[str, float] | None, list[str]]:
    """Return the parameters of a filter, if there are any, and what to know of them."""
    try:
        worst = found.record.filter_noise()
    except InputError as error:
        return None, [str(error)]
    values = {name: getattr(worst, name) for name in worst.__slots__ if name != "notes"}
    return values, list(worst.notes)


def _facts(found: "Characterization", name: str) -> dict[str, Any]:
    """Return one sensor for JSON, SI units."""
    from strapdown.noise import coefficient_unit

    noise = found.record[name]
    facts: dict[str, Any] = {
        "rate_hz": noise.fs,
        "duration_s": noise.duration,
        "unit": noise.unit,
        "remarks": noise.remarks,
    }
    for letter, axis in zip(_AXES, noise.axes, strict=True):
        facts[letter] = {
            "mean": axis.mean,
            "std": axis.std,
            "model_error": axis.coefficients.model_error,
        } | {
            c.symbol: {
                "status": c.status.value,
                "value": c.value,
                "std": c.std,
                "low": c.low,
                "high": c.high,
                "unit": coefficient_unit(c.symbol, noise.unit),
                "remark": c.remark,
            }
            for c in axis.coefficients
        }
    return facts


def _print(log: str, found: "Characterization", notes: list[str]) -> None:
    """Print a row per axis, and below what to know before the numbers are used."""
    from strapdown.report.noise import SHOWN, cell

    remarks: list[str] = []

    def shown(place: str, c: "Coefficient", size: float) -> str:
        if c.remark and c.value == c.value:
            remarks.append(f"{place} {c.symbol}: {c.remark}")
        return cell(c, size)

    for name, noise in found.record.sensors.items():
        symbol, size = SHOWN[name]
        rows = [
            (
                f"{name} {letter}",
                f"{axis.mean / size:.4g}",
                f"{axis.std / size:.4g}",
                *(shown(f"{name} {letter}", axis.coefficients[s], size) for s in "NBKRQ"),
            )
            for letter, axis in zip(_AXES, noise.axes, strict=True)
        ]
        head = (
            "",
            f"mean {symbol}",
            f"std {symbol}",
            f"N {symbol}/√Hz",
            f"B {symbol}",
            f"K {symbol}·√Hz",
            f"R {symbol}/s",
            f"Q {symbol}·s",
        )
        title = f"{log}: {name}, {noise.duration:.0f} s at {noise.fs:.4g} Hz"
        _console.print_table(title, head, rows, right=(1, 2))
        for remark in noise.remarks:
            _console.note(f"{name}: {remark}")
    for remark in remarks:
        _console.note(remark)
    limits = [note for note in notes if "record's limit" in note]
    for note in notes:
        if note not in limits:
            _console.note(note)
    if limits:
        _console.note("'< x' is the limit of the record: a noise below x would not have shown.")
