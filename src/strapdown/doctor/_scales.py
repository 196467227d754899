"""Factors between what is recorded and what must be, and the mistakes that make them."""

import math
from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.constants import G0
from strapdown.doctor._finding import Finding, Severity
from strapdown.doctor._log import Log
from strapdown.units import UT, Unit, units_of

# Units that loggers write, the commoner first.
_UNITS: Final = {
    "gyr": ("rad_s", "dps", "mdps", "mrad_s", "rpm", "deg_per_hr"),
    "acc": ("m_s2", "g", "mg", "cm_s2"),
    "mag": ("t", "ut", "mgauss", "gauss", "nt", "mt"),
}
_QUANTITY: Final = {"gyr": "angular_rate", "acc": "acceleration", "mag": "magnetic_field"}
WORD: Final = {"gyr": "gyroscope", "acc": "accelerometer", "mag": "magnetometer"}

_GRAVITY_WITHIN: Final = (0.80, 1.25)  # of 9.8 m/s^2: bias, scale and motion of a sound log
EARTH_FIELD_T: Final = (22.0 * UT, 67.0 * UT)
_FIELD_TYPICAL_T: Final = 45.0 * UT
_FIELD_POSSIBLE_T: Final = (12.0 * UT, 130.0 * UT)  # with magnets and steel nearby
_RANGES: Final = (0.5, 2.0, 0.25, 4.0)  # of counts scaled with another range
_CALM: Final = 0.15  # spread of the norm in the calmest windows, of its size
_SCALE_WITHIN: Final = 0.005  # of an accelerometer that tells mg from cm/s^2
_FASTEST_GYR: Final = 36.0  # [rad/s] 2000 deg/s


class Mistake(NamedTuple):
    """A unit that was taken for another; true values are `factor` times the recorded ones."""

    factor: float
    true: Unit
    taken: Unit


def mistakes(sensor: str, stated: Unit | None) -> list[Mistake]:
    """Return the mistakes that are possible, the commoner first.

    Parameters
    ----------
    sensor : str
        ``"gyr"``, ``"acc"`` or ``"mag"``.
    stated : Unit, optional
        The unit that the log states; any, where it is not known.
    """
    units = {u.name: u for u in units_of(_QUANTITY[sensor])}
    names = _UNITS[sensor]
    taken = [stated] if stated is not None else [units[name] for name in names]
    pairs = sorted(
        (
            (i + j, Mistake(units[true].factor / other.factor, units[true], other))
            for i, true in enumerate(names)
            for j, other in enumerate(taken)
            if true != other.name
        ),
        key=lambda pair: pair[0],
    )
    return [mistake for _, mistake in pairs]


def scales_of(sensor: str, stated: Unit | None) -> list[float]:
    """Return one, the factors of wrong full-scale ranges and of the mistakes, each once."""
    found = [1.0, *_RANGES]
    for mistake in mistakes(sensor, stated):
        if all(abs(math.log(mistake.factor / k)) > 0.03 for k in found):
            found.append(mistake.factor)
    return found


def mistake_finding(
    sensor: str, stated: Unit | None, factor: float, why: str, confidence: float
) -> Finding:
    """Return the error that values must be multiplied by about `factor`."""
    near = [m for m in mistakes(sensor, stated) if abs(math.log(m.factor / factor)) < 0.05]
    if stated is None:
        near = near[:2]
    names = " or ".join(f"{m.true.symbol} taken for {m.taken.symbol}" for m in near)
    if factor in _RANGES:
        return Finding(
            check="units",
            severity=Severity.ERROR,
            sentence=f"The {WORD[sensor]}'s values must be {factor:g} times as large: {why}.",
            confidence=confidence,
            advice="Check the full-scale range that its counts were scaled with.",
            stream=sensor,
        )
    inverse = 1.0 / factor
    size = f"{inverse:.4g} times too large" if inverse > 1.0 else f"{factor:.4g} times too small"
    offers = list(dict.fromkeys(f"--units {sensor}={m.true.name}" for m in near))
    return Finding(
        check="units",
        severity=Severity.ERROR,
        sentence=f"The {WORD[sensor]}'s values are {size}: {why}; it looks like {names}.",
        confidence=confidence,
        advice=f"Read it with {' or '.join(offers)}.",
        stream=sensor,
    )


def acc_units(log: Log) -> Finding | None:
    """Return what gravity says of the accelerometer's unit."""
    size, spread, mean = _norm(log, "acc")
    if size is None:
        return None
    ratio = size / G0
    stated = log.sensors["acc"].unit
    if _GRAVITY_WITHIN[0] <= ratio <= _GRAVITY_WITHIN[1]:
        text = f"The accelerometer shows {size:.2f} m/s² at its calmest, as gravity is."
        twin = _twin(stated)
        if stated is None or twin is None:
            return Finding(check="units", severity=Severity.OK, sentence=text, stream="acc")
        other = size * twin.factor / stated.factor
        text = text[:-1] + f"; read in {twin.symbol} instead of {stated.symbol}, {other:.2f}."
        nearer = abs(math.log(other / G0)) < abs(math.log(ratio)) - _SCALE_WITHIN
        return Finding(
            check="units",
            severity=Severity.NOTE if nearer else Severity.OK,
            sentence=text,
            confidence=0.6,
            advice=f"The two units differ by 2 %, as scales do: check which, or read it with "
            f"--units acc={twin.name}."
            if nearer
            else "",
            stream="acc",
        )
    fits = [m for m in mistakes("acc", stated) if abs(math.log(ratio * m.factor)) < 0.15]
    # Without gravity the norm is what motion leaves: small, of any size and direction.
    if fits and not (ratio < 0.5 and spread > 0.5):
        why = f"at its calmest it shows {size:.4g} m/s² and gravity is 9.8"
        best = min(fits, key=lambda m: abs(math.log(ratio * m.factor)))
        return mistake_finding("acc", stated, best.factor, why, 0.99)
    # Gravity of a wrong scale keeps its size while the box turns; motion does not.
    if ratio < 0.8 and mean < 0.5 * size + 0.3 and spread > 0.2:
        return Finding(
            check="units",
            severity=Severity.ERROR,
            sentence=f"The accelerometer shows no gravity: typically {size:.3g} m/s², "
            f"{mean:.2g} in the mean.",
            confidence=0.95,
            advice="Log the raw specific force, not 'linear' or 'user' acceleration.",
            stream="acc",
        )
    if spread > _CALM and 0.5 < ratio < 2.0:
        return Finding(
            check="units",
            severity=Severity.NOTE,
            sentence=f"The accelerometer shows {size:.2f} m/s² at its calmest, and is never calm: "
            "whether its scale is right cannot be told from this motion.",
            confidence=0.8,
            advice="Let it rest for some seconds.",
            stream="acc",
        )
    power = round(math.log2(ratio))
    doubled = power != 0 and abs(math.log(ratio / 2.0**power)) < 0.15
    return Finding(
        check="units",
        severity=Severity.ERROR if doubled else Severity.WARNING,
        sentence=f"The accelerometer shows {size:.4g} m/s² at its calmest, gravity is 9.8: "
        + (f"a factor of {2.0**power:g}." if doubled else "no unit explains it."),
        confidence=0.95,
        advice="Check the full-scale range that its counts were scaled with."
        if doubled
        else "Check its scale, or calibrate it with `strapdown calibrate acc`.",
        stream="acc",
    )


def _twin(stated: Unit | None) -> Unit | None:
    """Return the unit that an accelerometer's scale error hides: mg and cm/s² differ by 2 %."""
    twins = {"mg": "cm_s2", "cm_s2": "mg"}
    if stated is None or stated.name not in twins:
        return None
    return next(u for u in units_of("acceleration") if u.name == twins[stated.name])


def mag_units(log: Log) -> Finding | None:
    """Return what the Earth's field says of the magnetometer's unit."""
    size, _, _ = _norm(log, "mag")
    if size is None:
        return None
    low, high = EARTH_FIELD_T
    text = f"{size / UT:.4g} µT"
    if _FIELD_POSSIBLE_T[0] <= size <= _FIELD_POSSIBLE_T[1]:
        inside = low <= size <= high
        return Finding(
            check="units",
            severity=Severity.OK if inside else Severity.NOTE,
            sentence=f"The magnetometer shows {text}, "
            + ("as" if inside else "though")
            + " the Earth's field is 22 to 67 µT.",
            advice="" if inside else "Look for magnets and steel, or calibrate it.",
            stream="mag",
        )
    stated = log.sensors["mag"].unit
    fits = [m for m in mistakes("mag", stated) if low <= size * m.factor <= high]
    if fits:
        best = min(fits, key=lambda m: abs(math.log(size * m.factor / _FIELD_TYPICAL_T)))
        why = f"it shows {text} and the Earth's field is 22 to 67 µT"
        return mistake_finding("mag", stated, best.factor, why, 0.95)
    return Finding(
        check="units",
        severity=Severity.WARNING,
        sentence=f"The magnetometer shows {text} where the Earth's field is 22 to 67 µT, "
        "and no unit explains it.",
        confidence=0.9,
        advice="Calibrate it with `strapdown calibrate mag`, far from magnets and steel.",
        stream="mag",
    )


def gyr_magnitude(log: Log) -> Finding | None:
    """Return whether the gyroscope's rates are larger than any such sensor measures."""
    values = _finite(log, "gyr")
    if values is None:
        return None
    peak = float(np.quantile(np.sqrt((values * values).sum(axis=1)), 0.998))
    if peak <= _FASTEST_GYR:
        return None
    return Finding(
        check="units",
        severity=Severity.ERROR,
        sentence=f"The gyroscope shows rates up to {peak:.4g} rad/s, more than such sensors "
        "measure (35 rad/s): it looks like °/s taken for rad/s.",
        confidence=0.9,
        advice="Read it with --units gyr=dps.",
        stream="gyr",
    )


def _finite(log: Log, sensor: str) -> FloatArray | None:
    """Return the samples that are whole, at most 100 000, evenly spread; None for none."""
    if sensor not in log.sensors:
        return None
    values = log.sensors[sensor].values
    values = values[:: max(len(values) // 100_000, 1)]
    values = values[np.isfinite(values).all(axis=1)]
    return values if len(values) else None


def _norm(log: Log, sensor: str) -> tuple[float | None, float, float]:
    """Return the norm in the calmest windows, its spread there, and the mean vector's norm."""
    values = _finite(log, sensor)
    if values is None:
        return None, 0.0, 0.0
    norm = np.sqrt((values * values).sum(axis=1))
    norm = norm[norm > 0.0]
    if not len(norm):
        return None, 0.0, 0.0
    m = 50
    if len(norm) >= 20 * m and sensor == "acc":
        blocks = norm[: len(norm) // m * m].reshape(-1, m)
        noise = blocks.std(axis=1)
        norm = blocks[noise <= np.quantile(noise, 0.3)].ravel()
    size = float(np.median(norm))
    quartiles = np.quantile(norm, (0.25, 0.75))
    mean = float(np.linalg.norm(values.mean(axis=0)))
    return size, float(quartiles[1] - quartiles[0]) / size, mean
