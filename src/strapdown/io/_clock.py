"""Times of tables: units, a common origin, and the repair of axes that do not advance."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from strapdown._types import FloatArray
from strapdown.io._raw import Finding, Table
from strapdown.units import units_of

# Seconds from 1970 to 2001 and to 2100: numbers between are dates.
_EPOCH_FROM: Final = 978_307_200.0
_EPOCH_TO: Final = 4_102_444_800.0
# Median intervals [s] that an axis in seconds can have.
SLOWEST_IMU: Final = 1.0
SLOWEST_AIDING: Final = 120.0
_FASTEST: Final = 1e-5
REPAIR_HINT: Final = 'repair the times with --repair-time drop or sort (repair_time="drop")'


@dataclass(slots=True, kw_only=True)
class Axis:
    """Time axis of a table: seconds after `origin_s` + the common origin.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Seconds, after the table's first time if that is a date.
    epoch_ns : int, optional
        Date of ``t = 0`` in ns after 1970 (UTC); None where times are no dates.
    """

    t: FloatArray
    epoch_ns: int | None = None


def axis_of(
    table: Table, rate: float | None, repair: str | None, findings: list[Finding]
) -> Axis | None:
    """Return a table's time axis, or None with a finding where there is none.

    Whole numbers are subtracted before they become floats, so that nanoseconds since 1970 keep
    all their digits.
    """
    column = table.by_role("t")
    if rate is not None:
        if column is not None:
            what = f"times are counted at {rate:g} Hz, the column {column.name!r} is not used"
            findings.append(Finding(kind="rate", what=what, file=table.file))
        return Axis(t=np.arange(len(table)) / rate)
    if column is None:
        findings.append(
            Finding(
                kind="time",
                what="there must be a column of times, found "
                + ", ".join(c.name for c in table.columns),
                fault=True,
                file=table.file,
                hint="state the rate with --rate HZ (rate=100), or the column with "
                '--columns t=NAME (columns={"t": "NAME"})',
            )
        )
        return None
    values = column.values
    finite = np.isfinite(values) if values.dtype.kind == "f" else np.ones(len(values), bool)
    if column.empty is not None:
        finite &= ~column.empty
    if not finite.all() and repair is None:
        k = int(np.argmin(finite))
        got = "nothing" if column.empty is not None and column.empty[k] else f"{values[k]}"
        findings.append(
            Finding(
                kind="time",
                what=f"every row must have a time, {column.name!r} holds {got}",
                fault=True,
                file=table.file,
                row=table.line(k),
                hint=REPAIR_HINT,
            )
        )
    if not finite.any():
        return None
    first = values[int(np.argmax(finite))]
    unit = column.unit
    if unit is None:
        dated = [u for u in units_of("time") if u.name in ("s", "ms", "us", "ns")]
        unit = next((u for u in dated if _is_date(float(first) * u.factor)), None)
        guess = unit or _seconds_or_fault(table, values, findings)
        if guess is None:
            return None
        what = (
            f"{column.name!r} states no unit, its size is that of {guess.symbol} since 1970"
            if unit is not None
            else f"{column.name!r} states no unit and is read in s"
        )
        findings.append(Finding(kind="unit", what=what, file=table.file))
        unit = guess
    date = _is_date(float(first) * unit.factor)
    epoch_ns: int | None = None
    if not date:
        t = _scaled(values, unit.factor)
    elif values.dtype.kind == "i":
        epoch_ns = int(first) * round(unit.factor * 1e9)
        t = _scaled(values - first, unit.factor)
    else:
        # From a whole second on: float64 dates have steps of 0.2 us anyway.
        whole = math.floor(float(first) * unit.factor)
        epoch_ns = whole * 10**9
        t = _scaled(values - round(whole / unit.factor), unit.factor)
    if not finite.all():
        t = np.where(finite, t, np.nan)
    return Axis(t=t, epoch_ns=epoch_ns)


def _scaled(values: NDArray[Any], factor: float) -> FloatArray:
    """Return times in seconds; powers of ten divide, which rounds once, not twice."""
    if factor == 1.0:
        return np.asarray(values, dtype=np.float64)
    if factor in (1e-3, 1e-6, 1e-9):
        return np.asarray(values / round(1.0 / factor), dtype=np.float64)
    return np.asarray(values * factor, dtype=np.float64)


def _is_date(seconds: float) -> bool:
    return _EPOCH_FROM <= seconds < _EPOCH_TO


def _seconds_or_fault(table: Table, values: NDArray[Any], findings: list[Finding]) -> Any:
    """Return the second, unless intervals of the axis contradict it."""
    seconds = units_of("time")[0]
    steps = np.diff(values[:20_000].astype(np.float64))
    steps = steps[steps > 0.0]
    if not len(steps):
        return seconds
    step = float(np.median(steps))
    is_imu = table.by_role("gyr_x") is not None or table.by_role("acc_x") is not None
    if _FASTEST <= step <= (SLOWEST_IMU if is_imu else SLOWEST_AIDING):
        return seconds
    column = table.by_role("t")
    # Rates that an IMU has: of the units that give one, the largest.
    fits = [
        u for u in units_of("time") if u.factor < 1.0 and 4.0 <= 1.0 / (step * u.factor) <= 2e4
    ]
    advice = (
        f"in {fits[0].symbol} it would be {1.0 / (step * fits[0].factor):.4g} Hz, then say "
        f'--units time={fits[0].name} (units="time={fits[0].name}")'
        if fits
        else 'state the unit with --units time=us (units="time=us")'
    )
    findings.append(
        Finding(
            kind="unit",
            what=f"{column.name if column else 'time'!r} states no unit and cannot be in s, "
            f"the rate would be {1.0 / step:.3g} Hz",
            fault=True,
            file=table.file,
            hint=advice,
        )
    )
    return None


def common_origin(axes: Iterable[Axis], findings: list[Finding], file: str) -> int | None:
    """Shift axes to one origin; return its date in ns after 1970, None without dates.

    Dates start at the first time of all. Times that are no dates stay as they are.
    """
    axes = list(axes)
    dated = [axis for axis in axes if axis.epoch_ns is not None]
    if not dated:
        return None
    if len(dated) < len(axes):
        findings.append(
            Finding(
                kind="clock",
                what="all files must have one clock, some hold dates and some do not",
                fault=True,
                file=file,
                hint="choose the time column of each with --columns t=NAME",
            )
        )
        return None
    origin = min(axis.epoch_ns for axis in dated if axis.epoch_ns is not None)
    for axis in dated:
        shift = (axis.epoch_ns or 0) - origin
        if shift:
            axis.t = axis.t + shift * 1e-9
        axis.epoch_ns = origin
    return origin


def iso_utc(epoch_ns: int) -> str:
    """Return a date in ns after 1970 as ISO 8601, with as many digits as it needs."""
    seconds, rest = divmod(epoch_ns, 10**9)
    stamp = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)
    digits = f".{rest:09d}".rstrip("0").rstrip(".")
    return stamp.strftime("%Y-%m-%dT%H:%M:%S") + digits + "Z"


def ns_of_iso(text: str) -> int:
    """Return ns after 1970 of what `iso_utc` writes, or of another ISO 8601 date."""
    stamp = datetime.fromisoformat(text)
    if stamp.tzinfo is None:
        stamp = stamp.replace(tzinfo=UTC)
    since = stamp - datetime(1970, 1, 1, tzinfo=UTC)
    seconds = since.days * 86_400 + since.seconds
    digits = text.partition(".")[2].rstrip("Z").partition("+")[0].partition("-")[0]
    return seconds * 10**9 + int((digits + "000000000")[:9] if digits else 0)


def advancing(
    t: FloatArray,
    *,
    repair: str | None,
    file: str,
    stream: str,
    line: Callable[[int], int],
    findings: list[Finding],
) -> NDArray[np.int64] | None:
    """Return the rows whose times advance, None when all do.

    Parameters
    ----------
    t : ndarray, shape (n,)
        Times [s].
    repair : {'drop', 'sort'}, optional
        Drop samples that are not later than those before, or sort them all and drop repeats.
        Without it a finding is a fault that names the first such row.
    file, stream
        For the message.
    line : callable
        Row in the file of a sample.
    findings : list
        Where the finding goes.
    """
    finite = np.isfinite(t)
    if finite.all() and (t[1:] > t[:-1]).all():
        return None
    order = np.arange(len(t))[finite]
    times = t[order]
    back = int(np.count_nonzero(np.diff(times) < 0.0))
    if repair is None:
        k = int(np.argmin(np.diff(times) > 0.0)) + 1
        if k < len(times) and times[k] <= times[k - 1]:
            verb = "goes back" if times[k] < times[k - 1] else "is repeated"
            findings.append(
                Finding(
                    kind="time",
                    what=f"time must increase, it {verb}: {times[k]:.9g} s after "
                    f"{times[k - 1]:.9g} s",
                    fault=True,
                    file=file,
                    stream=stream,
                    row=line(int(order[k])),
                    hint=REPAIR_HINT,
                )
            )
        return order if len(order) < len(t) else None
    if repair == "sort":
        order = order[np.argsort(times, kind="stable")]
        times = t[order]
    latest = np.maximum.accumulate(times)
    keep = np.ones(len(times), dtype=np.bool_)
    keep[1:] = times[1:] > latest[:-1]
    order = order[keep]
    done = f"{len(t) - len(order)} of {len(t)} samples dropped"
    if repair == "sort":
        done = f"sorted ({back} steps back), " + done
    findings.append(Finding(kind="time", what=f"times repaired: {done}", file=file, stream=stream))
    return order
