"""``strapdown compare``: several estimators on several logs, side by side."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from strapdown.cli import _console, _errors, _job, _options, _settings
from strapdown.errors import InputError

if TYPE_CHECKING:
    from strapdown.estimator import Estimator
    from strapdown.evaluation import Trial
    from strapdown.recording import Recording


@_options.reads_logs
def compare(
    sources: _options.Sources,
    filters: Annotated[
        str | None,
        typer.Option(
            "--filters", metavar="A,B,C", help="Estimators; by default all that the logs allow."
        ),
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME.KEY=VALUE", help="A parameter of one of them; repeatable."
        ),
    ] = None,
    smooth: Annotated[
        bool, typer.Option("--smooth", help="Run the offline twins too, where there are any.")
    ] = False,
    report: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE", help="Write a report, as HTML."),
    ] = None,
    json: _options.Json = False,
    debug: _options.Debug = False,
) -> None:
    """Run several estimators on logs with a reference, and show their errors side by side.

    The logs must have a reference: in them, or by --reference.
    """
    from strapdown import evaluation

    wanted = None if filters is None else _named(filters, set_ or ())
    if wanted is None and set_:
        raise InputError("--set needs --filters, so that NAME is one of them.")
    table: list[Trial] = []
    with _console.progress(len(sources) + 1) as progress:
        for source in sources:
            log = str(source.main)
            progress.step(f"reading {log}")
            rec = source.read()
            estimators = wanted if wanted is not None else _fitting(rec)
            estimators = _job.to_true_north(estimators, rec, progress)
            progress.step(f"{', '.join(estimators)} on {log}")
            with _errors.given(log):
                table += evaluation.trials(rec, log, estimators, smooth=smooth)
        if report is not None:
            from strapdown.report import comparison

            progress.step("writing the report")
            comparison.write(table, report)
    if json:
        _console.print_json(
            {"trials": [trial.summary() for trial in table], "means": evaluation.means(table)}
        )
        return
    _print(table)
    if report is not None:
        print(report)


def _named(filters: str, settings: Sequence[str]) -> "dict[str, Estimator]":
    """Return the estimators of ``a,b,c`` with their parameters as typed."""
    from strapdown import estimator as estimators

    names = [name.strip() for name in filters.split(",") if name.strip()]
    if not names:
        raise InputError("--filters must name at least one estimator; see strapdown filters.")
    given: dict[str, list[str]] = {name: [] for name in names}
    for text in settings:
        name, _, setting = text.partition(".")
        if name not in given:
            raise InputError(
                f"--set must begin with one of {', '.join(names)} and a dot, got {text!r}."
            )
        given[name].append(setting)
    made: dict[str, Any] = {}
    for name in names:
        with _errors.given("--filters"):
            cls = estimators.entry(name).cls
        with _errors.given("--set"):
            made[name] = cls(**_settings.parameters(name, cls, given[name]))
    return made


def _fitting(rec: "Recording") -> "dict[str, Estimator]":
    """Return all estimators whose streams are there, with default parameters."""
    from strapdown import estimator as estimators

    rec.need("imu")
    return {
        entry.name: entry.cls()
        for entry in estimators.entries()
        if all(getattr(rec, stream) is not None for stream in entry.needs)
    }


def _print(table: "Sequence[Trial]") -> None:
    """Print a table per log, a row per filter, and the means if there are several logs."""
    from strapdown import evaluation

    figures = [trial.summary()["errors"] or {} for trial in table]
    shown = list(dict.fromkeys(key for own in figures for key in own if _is_main(key)))
    header = tuple(key.replace("_rmse_", " ").replace("m_s", "m/s") for key in shown)

    def show(title: str, rows: "Iterable[tuple[str, Mapping[str, float]]]") -> None:
        cells = [(name, *(_cell(own.get(key)) for key in shown)) for name, own in rows]
        right = range(1, 1 + len(shown))
        _console.print_table(title, ("filter", *header), cells, right=right)

    logs = list(dict.fromkeys(trial.log for trial in table))
    for log in logs:
        rows = ((t.label, own) for t, own in zip(table, figures, strict=True) if t.log == log)
        show(f"RMSE, {Path(log).stem}", rows)
        print()
    if len(logs) > 1:
        means = evaluation.means(table)
        show(f"RMSE, mean of {len(logs)} logs", ((row["filter"], row) for row in means))
        print()


def _is_main(key: str) -> bool:
    """Whether a figure stands in the table; roll, pitch and yaw are in the report."""
    name, found, _ = key.partition("_rmse_")
    return bool(found) and name not in ("roll", "pitch", "yaw")


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
