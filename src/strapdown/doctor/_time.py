"""Rates, jitter, gaps, repeated and backward times, of each stream."""

from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.doctor._finding import Finding, Severity, short
from strapdown.doctor._log import Log

_GAP: Final = 1.5  # median intervals
_LOST_SHARE: Final = 0.01  # of samples, from which gaps are a warning
_LOST_FIXES: Final = 0.5  # the same of a receiver, which loses its satellites
_JITTER_SHARE: Final = 0.2  # of the interval


def time_findings(log: Log) -> list[Finding]:
    """Return what the times of each stream show; sensors that share an axis are one."""
    axes: list[tuple[str, FloatArray]] = []
    for name, sensor in log.sensors.items():
        if not any(t.shape == sensor.t.shape and np.array_equal(t, sensor.t) for _, t in axes):
            axes.append((name, sensor.t))
    if log.gnss is not None:
        axes.append(("gnss", log.gnss.t))
    return [finding for name, t in axes for finding in _stream(name, t)]


def _stream(name: str, t: FloatArray) -> list[Finding]:
    sound = t[np.isfinite(t)]
    if len(sound) < 3:
        return [_finding(name, Severity.WARNING, f"There are only {len(sound)} samples.", "")]
    dt = np.diff(sound)
    out = []
    missing = len(t) - len(sound)
    if missing:
        text = f"{missing} of {len(t)} samples have no time."
        out.append(_finding(name, Severity.ERROR, text, _REPAIR))
    for count, what in (
        (int((dt < 0.0).sum()), "step back"),
        (int((dt == 0.0).sum()), "repeat the one before"),
    ):
        if count:
            row = int(np.argmax(dt < 0.0 if "back" in what else dt == 0.0)) + 1
            verb = what if count != 1 else what.replace("step", "steps").replace("peat", "peats")
            text = f"{count} of {len(t)} times {verb}, first in sample {row}."
            out.append(_finding(name, Severity.ERROR, text, _REPAIR))
    advancing = dt[dt > 0.0]
    if not len(advancing):
        return out
    step = float(np.median(advancing))
    gaps = advancing > _GAP * step
    lost = float((advancing[gaps] / step - 1.0).sum())
    regular = advancing[~gaps]
    jitter = float(np.sqrt(np.mean((regular - step) ** 2)))
    rate = 1.0 / step
    text = f"{rate:.4g} Hz over {sound[-1] - sound[0]:.4g} s"
    text += f", jitter {short(1e3 * jitter)} ms" if jitter > 1e-3 * step else ", no jitter"
    if gaps.any():
        n = int(gaps.sum())
        text += f", {n} gap{'s' if n > 1 else ''}, the longest {advancing.max():.3g} s"
        text += f", {short(100.0 * lost / (len(t) + lost))} % of the samples lost"
    stepwise = len(regular) and jitter > _JITTER_SHARE * step
    if name == "gnss" and gaps.any() and lost < _LOST_FIXES * (len(t) + lost):
        # a receiver has none under a bridge: no fault of the log
        advice = "Estimators go on without fixes; the longer, the further off."
        out.append(_finding(name, Severity.NOTE, text + ".", advice))
    elif lost > _LOST_SHARE * len(t):
        advice = "Look at the logger's buffers and the transport; estimators bridge short gaps."
        out.append(_finding(name, Severity.WARNING, text + ".", advice))
    elif stepwise:
        advice = "If the times are those of arrival, let the sensor's own clock stamp them."
        out.append(_finding(name, Severity.NOTE, text + ".", advice))
    else:
        out.append(_finding(name, Severity.NOTE if gaps.any() else Severity.OK, text + ".", ""))
    return out


_REPAIR: Final = "Read it with --repair-time drop or sort, and look for what made it."


def _finding(name: str, severity: Severity, sentence: str, advice: str) -> Finding:
    return Finding(check="time", severity=severity, sentence=sentence, advice=advice, stream=name)
