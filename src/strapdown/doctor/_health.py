"""Channels that are stuck, held, clipped, missing, over-filtered or shaken; bias at rest."""

from typing import Final

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.doctor._finding import Finding, Severity, short
from strapdown.doctor._log import Log, Sensor
from strapdown.doctor._scales import WORD
from strapdown.motion import RestTest
from strapdown.units import DPS

_STUCK_S: Final = 5.0  # one axis unchanged so long while another moves
_REST: Final = RestTest()
_STEADY: Final = 0.02  # spread of a field's axes at rest, of its strength
_HELD_S: Final = 1.0  # a sample repeated for longer is rest or a fault, not a slower sensor
_CLIPPED_RUN: Final = 3  # samples at the extreme one after another
_CLIPPED_TIMES: Final = 2.0  # as many as lie just inside it; a peak has as many beside it
_CLIPPED_LEAST: Final = 5  # of them in the log
_NAN_SHARE: Final = 0.01
_BIAS_NOTE: Final = 1.0 * DPS
_BIAS_WARNING: Final = 5.0 * DPS
_LEAST_NOISE: Final = {"gyr": 1e-6, "acc": 1e-5}  # SI, in a fifth of the band; sensors show 1e-4
_SEGMENT: Final = 512  # samples of a spectrum
_ENOUGH: Final = 200_000


def health_findings(log: Log) -> list[Finding]:
    """Return what each sensor's samples show of its health."""
    out: list[Finding] = []
    exact = _without_noise(log)
    if exact:
        out.append(
            Finding(
                check="noise",
                severity=Severity.NOTE,
                sentence="Gyroscope and accelerometer show no noise at all: the log is simulated, "
                "or smoothed so that nothing is left of it.",
                confidence=0.9,
                stream="gyr",
            )
        )
    for name, sensor in log.sensors.items():
        if len(sensor.t) < 10:
            continue
        found = [
            _missing(name, sensor),
            None if exact else _stuck(name, sensor, log),
            _copied(name, sensor),
            _held(name, sensor),
            _clipped(name, sensor),
            _spectrum(name, sensor),
        ]
        out += [finding for finding in found if finding is not None]
    return out


def _without_noise(log: Log) -> bool:
    """Return whether gyroscope and accelerometer are both smooth where they are calmest."""
    for name, least in _LEAST_NOISE.items():
        spectra = _spectra(log.sensors[name]) if name in log.sensors else None
        if spectra is None:
            return False
        high = spectra[:, int(0.8 * spectra.shape[1]) :].sum(axis=1)
        if float(np.sqrt(np.quantile(high, 0.1))) > least:
            return False
    return True


def _interval(sensor: Sensor) -> float:
    dt = np.diff(sensor.t)
    dt = dt[dt > 0.0]
    return float(np.median(dt)) if len(dt) else 1.0


def _missing(name: str, sensor: Sensor) -> Finding | None:
    lost = int((~np.isfinite(sensor.values).all(axis=1)).sum())
    if not lost:
        return None
    share = lost / len(sensor.t)
    return Finding(
        check="missing",
        severity=Severity.WARNING if share > _NAN_SHARE else Severity.NOTE,
        sentence=f"{lost} samples ({short(100.0 * share)} %) of the {WORD[name]} are no numbers.",
        advice="Estimators skip and flag them; look at the logger if they are many.",
        stream=name,
    )


def _stuck(name: str, sensor: Sensor, log: Log) -> Finding | None:
    """Return the axis that stands still while the others move."""
    values = sensor.values
    need = max(int(_STUCK_S / _interval(sensor)), 10)
    runs = [_longest_run(values[:, j]) for j in range(3)]
    if len(values) < 2 * need:
        need = len(values)
    stuck = [j for j in range(3) if runs[j][1] - runs[j][0] >= need]
    if not stuck:
        return None
    axes = ", ".join("xyz"[j] for j in stuck)
    start, stop = runs[stuck[0]]
    if len(stuck) == 3:
        sentence = f"The {WORD[name]} repeats the same sample for "
    else:
        others = [j for j in range(3) if j not in stuck]
        if not (np.ptp(values[start:stop, others], axis=0) > 0.0).any():
            return None
        sentence = f"Axis {axes} of the {WORD[name]} stands still for "
    t = sensor.t
    sentence += f"{t[stop - 1] - t[start]:.3g} s from {t[start]:.4g} s on"
    if _others_rest(name, log, t[start], t[stop - 1]):
        return Finding(
            check="stuck",
            severity=Severity.NOTE,
            sentence=sentence + ", while the box rests.",
            confidence=0.8,
            advice="A coarse sensor does so; one that is stuck would go on when the box moves.",
            stream=name,
        )
    return Finding(
        check="stuck",
        severity=Severity.ERROR,
        sentence=sentence + ".",
        advice="Look at the sensor's bus and the logger's column; leave that time out with "
        "--from and --to.",
        stream=name,
    )


def _others_rest(name: str, log: Log, first: float, last: float) -> bool:
    """Return whether the others, one of gyroscope and accelerometer among them, rest by then.

    They rest where they are about as quiet as they ever are in this log.
    """
    seen = False
    for other, sensor in log.sensors.items():
        sound = np.isfinite(sensor.values).all(axis=1)
        m = max(round(_REST.window / _interval(sensor)), 4)
        count = int(sound.sum()) // m
        blocks = sensor.values[sound][: count * m].reshape(count, m, 3)
        t = sensor.t[sound][: count * m : m]
        inside = (t >= first) & (t <= last)
        if other == name or not inside.any():
            continue
        means, spreads = blocks.mean(axis=1), np.sqrt(blocks.var(axis=1).mean(axis=1))
        size = float(np.median(np.linalg.norm(means, axis=1)))
        limit = {"gyr": _REST.max_gyr_std, "acc": _REST.max_acc_std}.get(other, _STEADY * size)
        floor = float(np.quantile(spreads, 0.01)) + _resolution(sensor.values[:, 0])
        spread = float(np.quantile(spreads[inside], 0.9))
        rate = float(np.linalg.norm(means[inside], axis=1).max())
        if not spread <= min(_REST.factor * floor, limit) or not size > 0.0:
            return False
        if other == "gyr" and rate > _REST.max_rate:
            return False
        seen |= other != "mag"
    return seen


def _copied(name: str, sensor: Sensor) -> Finding | None:
    """Return two axes that are one: equal, or the negative of each other, sample by sample."""
    values = sensor.values[np.isfinite(sensor.values).all(axis=1)]
    for i, j in ((0, 1), (0, 2), (1, 2)):
        a, b = values[:, i], values[:, j]
        if len(a) < 10 or np.ptp(a) == 0.0:
            continue
        sign = 1.0 if (a == b).all() else -1.0
        if (a == sign * b).all():
            return Finding(
                check="copied",
                severity=Severity.ERROR,
                sentence=f"Axes {'xyz'[i]} and {'xyz'[j]} of the {WORD[name]} are "
                f"{'the same' if sign > 0 else 'opposite'} in all samples.",
                advice="Look at which column is read as which axis, and at --columns.",
                stream=name,
            )
    return None


def _longest_run(values: FloatArray) -> tuple[int, int]:
    """Return first and past-the-last row of the longest run of one value."""
    edges = np.flatnonzero(np.r_[True, values[1:] != values[:-1], True])
    k = int(np.diff(edges).argmax())
    return int(edges[k]), int(edges[k + 1])


def _held(name: str, sensor: Sensor) -> Finding | None:
    """Return that a slower sensor's samples are repeated."""
    same = (sensor.values[1:] == sensor.values[:-1]).all(axis=1)
    rate = 1.0 / _interval(sensor)
    edges = np.flatnonzero(np.r_[True, ~same, True])
    runs = np.diff(edges)
    runs = runs[runs <= max(_HELD_S * rate, 2.0)]
    if len(runs) < 10:
        return None
    share = float(1.0 - len(runs) / runs.sum())
    if share < 0.4:
        return None
    return Finding(
        check="held",
        severity=Severity.NOTE,
        sentence=f"{100.0 * share:.0f} % of the {WORD[name]}'s samples repeat the one before: it "
        f"is sampled at about {rate * (1.0 - share):.3g} Hz and logged at {rate:.4g} Hz.",
        advice="Log each sensor when it has a new sample.",
        stream=name,
    )


def _clipped(name: str, sensor: Sensor) -> Finding | None:
    """Return the axis that reaches its extreme again and again and stays there."""
    worst, where = 0, ""
    values = sensor.values[np.isfinite(sensor.values).all(axis=1)]
    new = (values[1:] != values[:-1]).any(axis=1)  # a sample that is only held is none
    values = values[np.r_[True, new]] if len(values) else values
    for column, axis in zip(values.T, "xyz", strict=True):
        if len(column) < 10:
            continue
        for extreme in (column.max(), column.min()):
            at = column == extreme
            count = int(at.sum())
            span = float(np.ptp(column))
            step = max(_step(column), 1e-7 * abs(extreme))
            beside = (np.abs(column - extreme) < max(2.5 * step, 0.005 * span)) & ~at
            if count < _CLIPPED_TIMES * beside.sum() or span <= 50.0 * _resolution(column):
                continue
            # A coarse sensor at rest stands on its extremes too, and a stuck one always.
            if count < _CLIPPED_LEAST:
                continue
            if count > worst and _run_of(at) >= _CLIPPED_RUN:
                worst, where = count, f"{axis} at {extreme:.4g}"
    if not worst:
        return None
    return Finding(
        check="clipped",
        severity=Severity.WARNING,
        sentence=f"The {WORD[name]} is saturated in {worst} samples: axis {where} (SI) stays at "
        "its end.",
        advice="Choose a larger full-scale range; estimators cannot know what was cut off.",
        stream=name,
    )


def _run_of(mask: BoolArray) -> int:
    """Return the length of the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask.astype(np.int8), 0]))
    return int((edges[1::2] - edges[::2]).max()) if len(edges) else 0


def _step(values: FloatArray) -> float:
    """Return a usual small step between samples: one count of a coarse sensor, else noise."""
    steps = np.abs(np.diff(values[:20_000]))
    steps = steps[steps > 0.0]
    return float(np.quantile(steps, 0.25)) if len(steps) else 0.0


def _resolution(values: FloatArray) -> float:
    """Return the smallest step between samples."""
    steps = np.abs(np.diff(values[:20_000]))
    steps = steps[steps > 0.0]
    return float(steps.min()) if len(steps) else 0.0


def _spectra(sensor: Sensor) -> FloatArray | None:
    """Return the mean squares per line of segments, the axes added; None for too few samples."""
    values = sensor.values[:_ENOUGH]
    count = len(values) // _SEGMENT
    if count < 4 or not np.isfinite(values).all():
        return None
    blocks = values[: count * _SEGMENT].reshape(count, _SEGMENT, 3)
    blocks = blocks - blocks.mean(axis=1, keepdims=True)
    window = np.sin(np.pi * (np.arange(_SEGMENT) + 0.5) / _SEGMENT) ** 2
    power = (np.abs(np.fft.rfft(blocks * window[:, None], axis=1)) ** 2).sum(axis=2)
    return np.asarray(power * (2.0 / (_SEGMENT * (window * window).sum())))


def _spectrum(name: str, sensor: Sensor) -> Finding | None:
    """Return what the calmest and the loudest second show of bandwidth and vibration."""
    rate = 1.0 / _interval(sensor)
    power = None if name == "mag" else _spectra(sensor)
    if power is None:
        return None
    total = power.sum(axis=1)
    calm = power[total <= np.quantile(total, 0.1)].mean(axis=0)
    n = len(calm)
    floor, top = float(np.median(calm[n // 20 : n // 8])), float(np.median(calm[n - n // 5 :]))
    if floor > 0.0 and top < 1e-3 * floor:
        edge = int(np.argmax(calm[n // 20 :] < 0.1 * floor)) + n // 20
        cutoff = edge / n * 0.5 * rate
        # a line above the edge is a motion that a low-pass would have taken away
        if cutoff < 0.1 * rate and calm[edge:].max() < floor:
            return Finding(
                check="filtered",
                severity=Severity.NOTE,
                sentence=f"The {WORD[name]} is low-passed at about {cutoff:.3g} Hz and logged at "
                f"{rate:.4g} Hz: its delay is of the order of {0.4e3 / cutoff:.0f} ms.",
                confidence=0.8,
                advice="Widen its filter if fast motion matters.",
                stream=name,
            )
    loud = power[total >= np.quantile(total, 0.9)].mean(axis=0)
    high = float(np.sqrt(loud[int(0.7 * n) :].sum()))
    limit = 1.0 if name == "acc" else 10.0 * DPS
    falling = loud[int(0.9 * n) :].mean() < 0.2 * loud[int(0.4 * n) : int(0.6 * n)].mean()
    if high < limit or falling:
        return None
    unit = "m/s²" if name == "acc" else "rad/s"
    return Finding(
        check="aliasing",
        severity=Severity.NOTE,
        sentence=f"The {WORD[name]} shows vibration of {short(high)} {unit} up to half its rate "
        f"of {rate:.4g} Hz: some of it may be folded down from above.",
        confidence=0.7,
        advice="Mount it softly, or sample faster with a low-pass below half the rate.",
        stream=name,
    )


def bias_finding(bias: FloatArray, seconds: float) -> Finding:
    """Return the gyroscope's mean rate at rest, as a bias.

    Parameters
    ----------
    bias : ndarray, shape (3,)
        Mean rate at rest [rad/s].
    seconds : float
        How long it rests.
    """
    size = float(np.abs(bias).max())
    text = ", ".join(f"{b / DPS:.2f}" for b in bias)
    severity = (
        Severity.WARNING
        if size > _BIAS_WARNING
        else Severity.NOTE
        if size > _BIAS_NOTE
        else Severity.OK
    )
    return Finding(
        check="bias",
        severity=severity,
        sentence=f"At rest ({seconds:.0f} s) the gyroscope shows {text} °/s.",
        confidence=0.95,
        advice=""
        if severity is Severity.OK
        else "Calibrate it, or let the estimator find its bias while the box rests.",
        stream="gyr",
    )
