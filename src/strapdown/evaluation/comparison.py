"""Several estimators on several logs, side by side."""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from strapdown._checks import instances
from strapdown.errors import DataGap, InputError
from strapdown.estimator import Estimator, entry
from strapdown.evaluation.attitude import AttitudeErrors, attitude_errors
from strapdown.evaluation.navigation import NavigationErrors, navigation_errors
from strapdown.recording import Recording
from strapdown.solution import Solution


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """What one estimator made of one log.

    Attributes
    ----------
    log : str
        Name of the log.
    label : str
        Name of the estimator as it was given, with ``(smoothed)`` for its offline twin.
    causal : bool
        Whether it looked at past samples only.
    estimate_s : float
        Time it took [s], without that of compiling.
    samples : int
        IMU samples.
    errors : AttitudeErrors, optional
        Attitude errors; None without a reference of attitude.
    position : NavigationErrors, optional
        Errors of position and velocity, where both sides have them.
    """

    log: str
    label: str
    causal: bool
    estimate_s: float
    samples: int
    errors: AttitudeErrors | None
    position: NavigationErrors | None

    def summary(self) -> dict[str, Any]:
        """Return the figures that are printed and stored."""
        figures: dict[str, Any] = {}
        if self.position is not None:
            figures = self.position.summary()
        elif self.errors is not None:
            figures = self.errors.summary()
        return {
            "log": self.log,
            "filter": self.label,
            "causal": self.causal,
            "samples": self.samples,
            "estimate_s": self.estimate_s,
            "errors": figures or None,
        }


def trials(
    rec: Recording, log: str, estimators: Mapping[str, Estimator], *, smooth: bool = False
) -> Iterator[Trial]:
    """Run each estimator on a recording and yield its errors, one trial at a time.

    Parameters
    ----------
    rec : Recording
        With a reference of attitude or position.
    log : str
        Its name.
    estimators : mapping of str to Estimator
        By the label that is shown.
    smooth : bool
        Whether to run the offline twins too, where there are any.

    Yields
    ------
    Trial

    Raises
    ------
    InputError
        If the recording has no reference to compare with.
    """
    if rec.reference is None:
        raise InputError("the log must have a reference to compare with; give one.")
    for label, flt in estimators.items():
        if rec.imu is not None and len(rec.imu):  # compiles or loads the kernel: not its time
            flt.run(replace(rec, imu=rec.imu.rows(slice(2))), diagnostics=False)
        begun = time.perf_counter()
        sol = flt.run(rec, diagnostics=False)
        yield _trial(rec, log, label, sol, time.perf_counter() - begun)
        if smooth and entry(flt.NAME).smooths:
            begun = time.perf_counter()
            sol = flt.smooth(rec)  # type: ignore[attr-defined]
            yield _trial(rec, log, f"{label} (smoothed)", sol, time.perf_counter() - begun)


def _trial(rec: Recording, log: str, label: str, sol: Solution, seconds: float) -> Trial:
    """Return the errors of one solution."""
    position, errors = None, None
    try:
        if rec.reference is not None and rec.reference.position is not None and sol.is_navigation:
            position = navigation_errors(sol, rec.reference)
            errors = position.attitude
        elif rec.reference is not None and rec.reference.attitude is not None:
            errors = attitude_errors(sol, rec.reference)
    except DataGap:  # it never had an attitude while the reference had one
        pass
    return Trial(
        log=log, label=label, causal=sol.causal, estimate_s=seconds, samples=len(sol),
        errors=errors, position=position,
    )  # fmt: skip


def means(table: Sequence[Trial]) -> list[dict[str, Any]]:
    """Return, per estimator, the mean over the logs of each RMSE figure that all have.

    Parameters
    ----------
    table : sequence of Trial
        Of several logs.

    Returns
    -------
    list of dict
        ``filter``, ``logs``, ``ns_per_sample`` and the mean of every ``..._rmse_...``.
    """
    table = instances("table", table, Trial)
    rows = []
    for label in dict.fromkeys(trial.label for trial in table):
        own = [trial for trial in table if trial.label == label]
        figures = [trial.summary()["errors"] or {} for trial in own]
        keys = [k for k in figures[0] if "_rmse_" in k and all(k in f for f in figures)]
        row: dict[str, Any] = {"filter": label, "logs": len(own)}
        row |= {key: float(np.mean([f[key] for f in figures])) for key in keys}
        seconds, samples = sum(t.estimate_s for t in own), sum(t.samples for t in own)
        row["ns_per_sample"] = 1e9 * seconds / samples if samples else float("nan")
        rows.append(row)
    return rows
