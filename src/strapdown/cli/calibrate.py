"""``strapdown calibrate``: from logs to a calibration file."""

import datetime as dt
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapdown.cli import _console, _errors, _options, _settings
from strapdown.errors import InputError

if TYPE_CHECKING:
    from strapdown.calibration.from_recordings import Outcome
    from strapdown.calibration.place import Place
    from strapdown.recording import Recording

app = typer.Typer(help="Calibrate a sensor from logs, and keep the result in a file.")

File = Annotated[
    Path,
    typer.Option("-o", "--output", metavar="FILE", help="Calibration file; merged into."),
]
At = Annotated[
    str | None,
    typer.Option("--at", metavar="LAT,LON[,HEIGHT]", help="Where it was, in degrees and metres."),
]
Date = Annotated[
    str | None, typer.Option("--date", metavar="YYYY-MM-DD", help="When the logs were made.")
]
SensorId = Annotated[
    str, typer.Option("--sensor-id", metavar="NAME", help="Which piece of hardware.")
]
Tolerance = Annotated[
    list[str] | None,
    typer.Option(
        "--tolerance", metavar="KEY=VALUE", help="Of a parameter or kind, SI; repeatable."
    ),
]


def _method(*names: str) -> Any:
    return Annotated[str | None, typer.Option("--method", metavar="|".join(names), help="How.")]


def _calibrate(
    sources: Sequence[_options.Source],
    file: Path,
    json: bool,
    report: bool,
    work: "Callable[[list[Recording]], Outcome]",
    sensor: str,
) -> None:
    """Read the logs, calibrate, merge into the file, report and print."""
    from strapdown import calibration
    from strapdown.report import calibration as calibration_report

    with _console.progress(3) as progress:
        recs = []
        for source in sources:
            progress.step(f"reading {source.main}")
            recs.append(source.read())
        progress.step("calibrating")
        with _errors.given(", ".join(str(source.main) for source in sources)):
            outcome = work(recs)
        for note in outcome.notes:
            progress.note(note)
        progress.step("writing")
        calibration.merge_into(file, outcome.records)
        page = file.with_name(f"{file.stem}.{sensor}.html")
        if report:
            calibration_report.write(outcome.records, page, outcome.notes)
    outputs = {"calibration": str(file), **({"report": str(page)} if report else {})}
    if json:
        _console.print_json(_summary(outcome, outputs))
    else:
        _print(outcome, outputs)


@_options.reads_logs
def acc(
    sources: _options.Sources,
    file: File = Path("imu.toml"),
    method: _method("poses", "six", "eighteen", "reference") = None,  # type: ignore[valid-type]
    gravity: Annotated[
        float | None, typer.Option("--gravity", metavar="M_S2", help="Local gravity.")
    ] = None,
    at: At = None,
    date: Date = None,
    tolerance: Tolerance = None,
    sensor_id: SensorId = "",
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Accelerometer, from logs in which it was held still in many orientations.

    The poses are found by themselves. Hold each for some seconds, at least 12 of them, better 30,
    each axis up, down and tilted; a hand will do.
    """
    from strapdown.calibration import from_recordings

    place, tolerances = _place(at, date), _tolerances(tolerance)

    def work(recs: "list[Recording]") -> "Outcome":
        return from_recordings.accelerometer(
            recs,
            method=method or "poses",
            gravity=gravity,
            place=place,
            tolerances=tolerances,
            sensor_id=sensor_id,
        )

    _calibrate(sources, file, json, not no_report, work, "acc")


@_options.reads_logs
def gyro(
    sources: _options.Sources,
    file: File = Path("imu.toml"),
    method: _method("table", "reference", "rest") = None,  # type: ignore[valid-type]
    rates: Annotated[
        str | None,
        typer.Option("--rates", metavar="DPS,DPS", help="Rates of the turntable in deg/s."),
    ] = None,
    resolution: Annotated[
        float | None,
        typer.Option(
            "--resolution", metavar="DEG", help="One count of the reference's encoders in deg."
        ),
    ] = None,
    date: Date = None,
    tolerance: Tolerance = None,
    sensor_id: SensorId = "",
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Gyroscope, on a turntable, against a reference attitude, or at rest for the bias alone."""
    from strapdown.calibration import from_recordings
    from strapdown.units import DEG, DPS

    table = [rate * DPS for rate in _numbers("--rates", rates)]
    place, tolerances = _place(None, date), _tolerances(tolerance)

    def work(recs: "list[Recording]") -> "Outcome":
        return from_recordings.gyroscope(
            recs,
            table_rates=table,
            resolution=None if resolution is None else resolution * DEG,
            method=method,
            place=place,
            tolerances=tolerances,
            sensor_id=sensor_id,
        )

    _calibrate(sources, file, json, not no_report, work, "gyr")


@_options.reads_logs
def mag(
    sources: _options.Sources,
    file: File = Path("imu.toml"),
    method: _method("ellipsoid", "reference") = None,  # type: ignore[valid-type]
    field: Annotated[
        float | None, typer.Option("--field", metavar="UT", help="Strength of the field in uT.")
    ] = None,
    at: At = None,
    date: Date = None,
    no_align: Annotated[
        bool, typer.Option("--no-align", help="Do not turn it into the accelerometer's axes.")
    ] = False,
    accept: Annotated[
        bool, typer.Option("--accept", help="Accept what is known to be inaccurate.")
    ] = False,
    tolerance: Tolerance = None,
    sensor_id: SensorId = "",
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Magnetometer, from logs in which it was turned through all orientations in one place.

    With an accelerometer in the log, and rests in between, its axes are aligned to those.
    """
    import math

    from strapdown import calibration
    from strapdown.calibration import from_recordings
    from strapdown.units import UT

    place, tolerances = _place(at, date), _tolerances(tolerance)
    known = calibration.load(file).records.get("acc") if file.exists() else None
    limits = {"hard_iron_limit": math.inf, "direction_limit": math.inf} if accept else {}

    def work(recs: "list[Recording]") -> "Outcome":
        return from_recordings.magnetometer(
            recs,
            method=method or "ellipsoid",
            field=None if field is None else field * UT,
            place=place,
            acc=known,
            align=not no_align,
            tolerances=tolerances,
            sensor_id=sensor_id,
            **limits,
        )

    _calibrate(sources, file, json, not no_report, work, "mag")


@_options.reads_logs
def temperature(
    sources: _options.Sources,
    file: File = Path("imu.toml"),
    date: Date = None,
    tolerance: Tolerance = None,
    sensor_id: SensorId = "",
    json: _options.Json = False,
    no_report: _options.NoReport = False,
    debug: _options.Debug = False,
) -> None:
    """Change of the biases with temperature, from one log at rest with a thermometer."""
    from strapdown.calibration import from_recordings

    if len(sources) > 1:
        raise InputError(
            "temperature calibration takes one log, since the bias changes at each switch-on; "
            f"got {len(sources)}."
        )
    place, tolerances = _place(None, date), _tolerances(tolerance)

    def work(recs: "list[Recording]") -> "Outcome":
        return from_recordings.temperature(
            recs[0], place=place, tolerances=tolerances, sensor_id=sensor_id
        )

    _calibrate(sources, file, json, not no_report, work, "temperature")


@app.callback(invoke_without_command=True)
def _root(ctx: typer.Context) -> None:
    """Calibrate a sensor from logs, and keep the result in a file."""
    if ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


app.command("acc")(acc)
app.command("gyro")(gyro)
app.command("mag")(mag)
app.command("temperature")(temperature)


# --- options and output -------------------------------------------------------------------


def _numbers(option: str, text: str | None) -> list[float]:
    try:
        return [] if text is None else [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option} must be numbers with commas, got {text!r}.") from None


def _place(at: str | None, date: str | None) -> "Place":
    from strapdown.calibration.place import Place
    from strapdown.units import DEG

    numbers = _numbers("--at", at)
    if at is not None and len(numbers) not in (2, 3):
        raise InputError(
            f"--at must be latitude,longitude[,height], such as 45.4,11.9,20, got {at!r}."
        )
    day = None
    if date is not None:
        try:
            day = dt.date.fromisoformat(date)
        except ValueError:
            raise InputError(f"--date must be a day such as 2025-03-31, got {date!r}.") from None
    if not numbers:
        return Place(date=day)
    lat, lon, height = (*numbers, 0.0)[:3]
    if not (abs(lat) <= 90.0 and abs(lon) <= 360.0):
        raise InputError(f"--at must be degrees, latitude first, got {at!r}.")
    return Place(lla=(lat * DEG, lon * DEG, height), date=day)


def _tolerances(texts: list[str] | None) -> dict[str, float] | None:
    if not texts:
        return None
    found = {}
    for key, text in _settings.pairs("--tolerance", texts).items():
        try:
            found[key] = float(text)
        except ValueError:
            raise InputError(f"--tolerance {key} must be a number, got {text!r}.") from None
    return found


def _summary(outcome: "Outcome", outputs: dict[str, str]) -> dict[str, Any]:
    records = []
    for record in outcome.records:
        records.append(
            {
                "sensor": record.sensor,
                "method": record.method,
                "sensor_id": record.sensor_id,
                "date": record.date.isoformat(),
                "verdict": record.verdict.value,
                "residual_rms": record.residual_rms,
                "residual_rms_before": record.residual_rms_before,
                "unit": record.unit,
                "equations": record.equations,
                "dof": record.dof,
                "parameters": {
                    p.name: {
                        "value": p.value,
                        "std": p.std,
                        "unit": p.unit,
                        "tolerance": p.tolerance,
                        "verdict": p.verdict.value,
                    }
                    for p in record.parameters
                },
                "quality": dict(record.quality),
            }
        )
    return {"records": records, "notes": list(outcome.notes), "outputs": outputs}


def _print(outcome: "Outcome", outputs: dict[str, str]) -> None:
    from strapdown.calibration.record import SENSOR_NAMES
    from strapdown.report.calibration import SHOWN, shown

    for record in outcome.records:
        rows = []
        for parameter in record.parameters:
            value, std, tolerance, symbol = shown(parameter)
            limit = "" if tolerance is None else f"±{tolerance:.3g}"
            verdict = "" if tolerance is None else parameter.verdict.value
            rows.append((parameter.name, f"{value:.5g}", f"{std:.2g}", symbol, limit, verdict))
        header = ("parameter", "value", "sigma", "unit", "tolerance", "verdict")
        _console.print_table(
            f"{SENSOR_NAMES[record.sensor]}, {record.method}", header, rows, right=(1, 2, 4)
        )
        symbol, size = SHOWN[record.unit]
        _console.print_fact(
            "residual",
            f"{record.residual_rms_before / size:.3g} {symbol} before, "
            f"{record.residual_rms / size:.3g} {symbol} after "
            f"({record.equations} equations, {record.dof} degrees of freedom)",
        )
        if "coverage" in record.quality:
            _console.print_fact("coverage", f"{100.0 * record.quality['coverage']:.0f} %")
        _console.print_fact("verdict", record.verdict.value)
    for name, path in outputs.items():
        _console.print_fact(name, path)
