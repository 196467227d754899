"""The main job: a recording in, a folder of results and a short table out."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from strapdown import __version__
from strapdown.cli import _console, _errors, _output, _sensor, _settings, doctor
from strapdown.errors import ComputationError, DataGap, InputError

if TYPE_CHECKING:
    from strapdown.evaluation import AttitudeErrors, NavigationErrors, Window
    from strapdown.recording import Recording
    from strapdown.report import Tiles
    from strapdown.solution import Solution

EXPORTS: Final = ("kml", "gpx", "geojson", "csv", "tum")


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """What to do with a recording.

    Parameters
    ----------
    folder : path
        Where the results go.
    filter : str, optional
        Registry name; a sensible one for the recording's streams by default.
    settings : sequence of str
        Parameters of the estimator as ``key=value``.
    sensor : str, optional
        Preset or noise file that fills the noise parameters.
    calibration : path, optional
        Calibration file to apply first.
    smooth : bool
        Whether to use the estimator's offline twin.
    outages : sequence of (float, float)
        Spans [s] in which the fixes are taken away.
    exports : sequence of str
        Of `EXPORTS`: more files of the solution or its track.
    report : bool
        Whether to write ``report.html``.
    tiles : Tiles, optional
        Map to lie below the track in the report.
    json : bool
        Whether to print the summary as JSON instead of a table.
    """

    folder: Path
    filter: str | None = None
    settings: Sequence[str] = ()
    sensor: str | None = None
    calibration: Path | None = None
    smooth: bool = False
    outages: Sequence[tuple[float, float]] = ()
    exports: Sequence[str] = ()
    report: bool = True
    tiles: "Tiles | None" = None
    json: bool = False


def do(job: Job, log: str, read: Callable[[], "Recording"]) -> None:
    """Read, estimate, compare, write, print.

    Parameters
    ----------
    job : Job
        What to do.
    log : str
        Name of the log for the summary.
    read : callable
        Returns the recording.
    """
    if job.filter is not None:  # a misspelt option is found before a long log is read
        _estimator(job.filter, job)
    elif job.sensor is not None:
        _sensor.named(job.sensor)
    with _console.progress(3 + job.report) as progress, _output.made_aside(job.folder) as aside:
        progress.step(f"reading {log}")
        begun = time.perf_counter()
        rec = read()
        if job.calibration is not None:
            rec = _calibrated(rec, job.calibration)
        timing = {"read_s": time.perf_counter() - begun}
        for note in rec.meta.get("notes", ()):
            progress.note(note)
        for line in doctor.brief(rec):
            progress.note(line)
        summary = _results(job, log, rec, aside, timing, progress)
        _output.write_text(aside / _output.SUMMARY, _console.to_json(summary))
    if job.json:
        _console.print_json(summary)
    else:
        _print(summary)


def _results(
    job: Job,
    log: str,
    rec: "Recording",
    aside: Path,
    timing: dict[str, float],
    progress: _console.Progress,
) -> dict[str, Any]:
    """Run the estimator, write its files into `aside`, and return the summary."""
    from strapdown import io, report

    sol = _solution(job, log, _without_fixes(job, rec), timing, progress)
    doubts = report.doubts(sol)
    for line in doubts:
        progress.note(line)
    progress.step("comparing with the reference" if rec.reference else "writing")
    errors = _errors_of(sol, rec, progress)
    outages = _outages_of(job, log, sol, rec)
    files = {"solution": "solution.parquet", "summary": _output.SUMMARY}
    io.write_solution(sol, aside / files["solution"])
    for kind in job.exports:
        files[kind] = f"{'solution' if kind == 'csv' else 'track'}.{kind}"
        io.write_solution(sol, aside / files[kind])
    begun = time.perf_counter()
    if job.report:
        progress.step("writing the report")
        files["report"] = "report.html"
        report.write(sol, rec, aside / files["report"], errors, outages=outages, tiles=job.tiles)
    timing["report_s"] = time.perf_counter() - begun
    return {
        _output.MARK: f"strapdown {__version__}",
        "log": log,
        "filter": sol.filter,
        "parameters": dict(sol.meta.get("parameters", {})),
        "causal": sol.causal,
        "samples": len(sol),
        "duration_s": float(sol.t[-1] - sol.t[0]),
        "status_counts": sol.status_counts(),
        "heading_reference": sol.heading_reference,
        "outputs": {key: str(job.folder / file) for key, file in files.items()},
        "timing": timing,
        "errors": None if errors is None else errors.summary(),
        "outages": [window.as_dict() for window in outages],
        "doubts": doubts,
    }


def _estimator(name: str, job: Job) -> Any:
    """Return the estimator `name` with its sensor's noise, and its parameters as typed."""
    from strapdown import estimator as estimators

    with _errors.given("--filter"):
        cls = estimators.entry(name).cls
    given = _settings.parameters(name, cls, job.settings)
    if job.sensor is not None:
        sensor = _sensor.named(job.sensor)
        with _errors.given(f"--sensor {job.sensor}"):
            return cls.from_sensor(sensor, **given)
    with _errors.given(f"--set {_settings.mapping_text(given)}"):
        return estimators.create(name, **given)


def _solution(
    job: Job,
    log: str,
    rec: "Recording",
    timing: dict[str, float],
    progress: _console.Progress,
) -> "Solution":
    """Return what the estimator makes of the recording."""
    from strapdown import estimator as estimators

    with _errors.given(log):
        name = job.filter or estimators.preferred(rec)
    flt = to_true_north({name: _estimator(name, job)}, rec, progress)[name]
    if job.smooth and not hasattr(flt, "smooth"):
        raise InputError(f"{name} has no offline twin; leave --smooth out, or choose another.")
    tracks = [kind for kind in job.exports if kind != "csv"]
    if tracks and estimators.entry(name).gives != "navigation":
        raise InputError(
            f"--export {tracks[0]} needs positions, and {name} gives attitude; leave it out, or "
            "use a log with GNSS."
        )
    _overlapping(log, rec, estimators.entry(name).needs)
    progress.step(f"estimating with {name}")
    if not estimators.entry(name).is_compiled():
        progress.note(f"compiling {name} (once)")
    begun = time.perf_counter()
    with _errors.given(log):
        sol: Solution = flt.smooth(rec) if job.smooth else flt.run(rec)
    timing["estimate_s"] = time.perf_counter() - begun
    if len(sol) == 0:
        raise InputError(f"{log}: the log must hold inertial samples, it has none.")
    _on_the_earth(sol)
    return sol


def _overlapping(log: str, rec: "Recording", needs: Sequence[str]) -> None:
    """Refuse a log whose aiding lies outside the times of its inertial samples."""
    t = rec.need("imu").t
    for name in needs:
        aid = rec.need(name).t
        if len(t) and len(aid) and (aid[0] > t[-1] or aid[-1] < t[0]):
            raise InputError(
                f"{log}: stream {name}, {aid[0]:.6g} to {aid[-1]:.6g} s, must overlap stream imu, "
                f"{t[0]:.6g} to {t[-1]:.6g} s; their clocks have different zeros: bring the times "
                "of one to the other's."
            )


def _on_the_earth(sol: "Solution") -> None:
    """Refuse a solution that was carried over a pole in latitude and longitude."""
    import numpy as np

    if sol.lla is None:
        return
    beyond = np.abs(sol.lla[:, 0]) > np.pi / 2
    if beyond.any():
        raise ComputationError(
            f"{sol.filter} must keep off the poles, it came beyond one at "
            f"{sol.t[int(np.argmax(beyond))]:.6g} s; `navigation.mechanise` goes over them with "
            "frame='wander' or 'ecef'."
        )


def _without_fixes(job: Job, rec: "Recording") -> "Recording":
    """Return the recording without the fixes of the outages that were asked for."""
    if not job.outages:
        return rec
    from strapdown.evaluation import blank

    with _errors.given("--outage"):
        return blank(rec, job.outages)


def _outages_of(job: Job, log: str, sol: "Solution", rec: "Recording") -> "tuple[Window, ...]":
    """Return the errors in the outages that were asked for."""
    if not job.outages:
        return ()
    from strapdown.evaluation import outage_errors

    with _errors.given("--outage"):
        return outage_errors(sol, rec, job.outages, name=Path(log).name)


def to_true_north(
    estimators: Mapping[str, Any], rec: "Recording", progress: _console.Progress
) -> dict[str, Any]:
    """Return estimators with the declination of the recording's place and date, if known.

    Parameters
    ----------
    estimators : mapping of str to Estimator
        Those without a declination, or that were given one, stay as they are.
    rec : Recording
        What they are to run on.
    progress : Progress
        Told what was found.

    Returns
    -------
    dict
    """
    found = dict(estimators)
    unset = [
        label
        for label, flt in found.items()
        if getattr(flt, "declination", 0.0) is None and flt.use_mag
    ]
    if rec.mag is None or not unset:
        return found
    from strapdown.attitude import declination
    from strapdown.units import DEG

    angle = declination(rec)
    if angle is not None:
        progress.note(f"heading is from true north: declination {angle / DEG:.2f} deg east.")
        found |= {label: replace(found[label], declination=angle) for label in unset}
    return found


def _errors_of(
    sol: "Solution", rec: "Recording", progress: _console.Progress
) -> "AttitudeErrors | NavigationErrors | None":
    """Return the errors against the reference; None, and why, if nothing can be compared."""
    from strapdown import evaluation

    if rec.reference is None:
        return None
    try:
        if sol.is_navigation and rec.reference.position is not None:
            return evaluation.navigation_errors(sol, rec.reference)
        if rec.reference.attitude is not None:
            return evaluation.attitude_errors(sol, rec.reference)
    except DataGap as gap:
        progress.note(f"no errors: {gap}")
    return None


def _calibrated(rec: "Recording", file: Path) -> "Recording":
    """Return the recording with a calibration file applied."""
    try:
        from strapdown import calibration
    except ImportError:
        raise InputError(f"--calibration needs a part that {__version__} lacks.") from None
    with _errors.given(file):
        calibrated: Recording = calibration.load(file).apply(rec)
    return calibrated


def _print(summary: dict[str, Any]) -> None:
    """Print what one wants to know first."""
    smoothed = "" if summary["causal"] else ", smoothed offline"
    parameters = _settings.mapping_text(_changed(summary))
    counts = ", ".join(f"{name} {n}" for name, n in summary["status_counts"].items())
    timing = summary["timing"]
    rows = [
        ("filter", f"{summary['filter']}{smoothed}" + (f" ({parameters})" if parameters else "")),
        ("samples", f"{summary['samples']} in {summary['duration_s']:.1f} s"),
        ("flagged", counts or "none"),
        ("heading", summary["heading_reference"]),
        (
            "took",
            f"read {timing['read_s']:.2f} s, estimate {timing['estimate_s']:.2f} s, "
            f"report {timing['report_s']:.2f} s",
        ),
    ]
    _console.print_table(summary["log"], ("", ""), rows)
    errors = summary["errors"]
    if errors is not None:
        print()
        _console.print_table(
            "", ("error", "RMSE", "spread", "largest", ""), _error_rows(errors), right=(1, 2, 3)
        )
        if errors.get("heading_constant_removed"):
            constant = errors["heading_constant_deg"]
            print(f"Heading is arbitrary: a constant of {constant:.1f} deg was removed.")
        if errors.get("through_own_mount"):
            print("Attitude errors are the vehicle's, each side through its own mount.")
        within = errors.get("inclination_within_3sigma")
        if within is not None:
            print(f"Inclination within its stated 3 sigma: {100 * within:.1f} % of the time.")
    if summary["outages"]:
        print()
        _print_outages(summary)
    print()
    for path in summary["outputs"].values():
        print(path)


def _print_outages(summary: dict[str, Any]) -> None:
    """Print how far the solution was off where fixes were taken away."""
    keys = ("horizontal_error_m", "vertical_error_m", "percent_of_distance", "heading_error_deg")
    rows = [
        (
            f"{w['start_s']:g}:{w['start_s'] + w['length_s']:g}",
            *("" if w[key] is None else f"{w[key]:.2f}" for key in keys),
        )
        for w in summary["outages"]
    ]
    header = ("outage s", "horizontal m", "vertical m", "% of way", "heading deg")
    where = "at the end" if summary["causal"] else "in the middle"
    _console.print_table(f"error of the antenna {where} of outages", header, rows, right=range(5))


def _changed(summary: dict[str, Any]) -> dict[str, Any]:
    """Return the parameters that differ from their defaults."""
    from strapdown import estimator as estimators

    cls = estimators.entry(summary["filter"]).cls
    defaults = {f.name: f.default for f in fields(cls)}  # type: ignore[arg-type]
    return {k: v for k, v in summary["parameters"].items() if v != defaults.get(k)}


def _error_rows(errors: dict[str, Any]) -> list[tuple[str, ...]]:
    """Return one row per kind of error that the summary has: RMSE, about the mean, largest."""
    rows = []
    for key, value in errors.items():
        name, found, unit = key.partition("_rmse_")
        if found:
            others = (errors.get(f"{name}_{what}_{unit}") for what in ("std", "max"))
            shown = ("" if other is None else f"{other:.2f}" for other in others)
            rows.append((name, f"{value:.2f}", *shown, unit.replace("m_s", "m/s")))
    return rows
