"""Which way is up, the sign of gravity and field, their angle, and the field's calibration."""

from datetime import datetime
from typing import Any, Final

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.doctor._finding import Finding, Severity, short
from strapdown.doctor._log import Grid, Log
from strapdown.units import DEG, UT

UP_AXES: Final = ("x", "-x", "y", "-y", "z", "-z")
_LEVEL: Final = 0.7  # cosine from which an axis is called up or down
_DIP_WITHIN: Final = 15.0 * DEG  # of the model, with steel nearby
_DIP_SEEN: Final = 20.0 * DEG  # below, the sign of the angle says little
_STRENGTH_WITHIN: Final = 0.25
_OFFSET_NOTE: Final = 0.2  # of the field, found by a sphere
_OFFSET_WARNING: Final = 0.5
_EXTENT: Final = 5.0  # of the samples over their noise: below, only noise spreads them
_DRIFT: Final = 0.02  # of the field: its strength varies so much by itself
_COVERED: Final = 0.1  # least share of directions for a sphere to mean something


def calm(grid: Grid) -> BoolArray:
    """Return where the specific force is nearly gravity's size, the calmest third at least."""
    norm = np.sqrt((grid.fields["acc"] ** 2).sum(axis=1))
    off = np.abs(norm - np.median(norm))
    return np.asarray((off <= max(float(np.quantile(off, 0.33)), 1e-12)) & ~grid.bad)


def up_finding(grid: Grid, up: str | None) -> Finding | None:
    """Return which axis of the box points up at the start, and whether that was declared.

    Parameters
    ----------
    grid : Grid
        The sensors.
    up : str, optional
        The axis that points up at the start, one of `UP_AXES`.
    """
    if "acc" not in grid.fields:
        return None
    m = max(int(1.0 / grid.dt), 1)
    start = grid.fields["acc"][:m][~grid.bad[:m]]
    if not len(start):
        return None
    mean = start.mean(axis=0)
    mean = mean / max(float(np.linalg.norm(mean)), 1e-12)
    if up is not None:
        axis = np.eye(3)["xyz".index(up[-1])] * (-1.0 if up[0] == "-" else 1.0)
        cosine = float(mean @ axis)
        if cosine > _LEVEL:
            text = f"The specific force points along {up} at the start, as declared."
            return Finding(check="sign", severity=Severity.OK, sentence=text, stream="acc")
        opposite = cosine < -_LEVEL
        return Finding(
            check="sign",
            severity=Severity.ERROR,
            sentence=f"The box's {up} axis is declared to point up at the start, the "
            "accelerometer shows "
            + ("the opposite: it logs minus the specific force." if opposite else "another axis."),
            confidence=0.98,
            advice="Read it with --axes acc=-x,-y,-z."
            if opposite
            else "Check the axes of the accelerometer against the box.",
            stream="acc",
        )
    j = int(np.abs(mean).argmax())
    if abs(mean[j]) < _LEVEL:
        sentence = "The box lies askew at the start, no axis is within 45° of the vertical."
        return Finding(check="up", severity=Severity.NOTE, sentence=sentence, stream="acc")
    name = ("" if mean[j] > 0.0 else "-") + "xyz"[j]
    if name == "-z":
        text = "The box's z axis points down at the start, as forward-right-down has it"
    elif name == "z":
        text = "The log is z-up: the box's z axis points up at the start"
    else:
        text = f"The box stands on its side: its {name} axis points up at the start"
    return Finding(
        check="up",
        severity=Severity.OK if name == "-z" else Severity.NOTE,
        sentence=text + ", if it logs the specific force and not its negative.",
        confidence=0.9,
        advice="" if name == "-z" else "Nothing needs to be done: estimators keep the box's axes.",
        stream="acc",
    )


def place_of(log: Log) -> tuple[FloatArray, Any] | None:
    """Return latitude, longitude, height and the date, or None where the place is not known."""
    place: FloatArray | None = None
    if log.meta.get("lat_rad") is not None and log.meta.get("lon_rad") is not None:
        keys = ("lat_rad", "lon_rad", "height_m")
        place = np.array([float(log.meta.get(key) or 0.0) for key in keys])
    elif log.gnss is not None:
        known = log.gnss.lla[np.isfinite(log.gnss.lla).all(axis=1)]
        place = np.asarray(known[0]) if len(known) else None
    if place is None or not (abs(place[0]) <= 0.5 * np.pi and -1e3 <= place[2] <= 8e5):
        return None
    epoch = log.meta.get("epoch_utc")
    try:
        date = datetime.fromisoformat(str(epoch)) if epoch is not None else None
    except ValueError:
        date = None
    # The field turns by some hundredths of a degree in a year: a missing date hardly matters.
    year = 2025.0 if date is None else date.year + date.month / 12.0
    return place, float(np.clip(year, 2010.0, 2030.0))


def dip_findings(log: Log, grid: Grid) -> list[Finding]:
    """Return angle and strength of the field against the world magnetic model."""
    if not {"acc", "mag"} <= set(grid.fields):
        return []
    from strapdown.earth import magnetic_field

    rows = calm(grid)
    f, m = grid.fields["acc"][rows], grid.fields["mag"][rows]
    norms = np.sqrt((f * f).sum(axis=1) * (m * m).sum(axis=1))
    sound = norms > 0.0
    if sound.sum() < 10:
        return []
    sine = -(f[sound] * m[sound]).sum(axis=1) / norms[sound]
    dip = float(np.arcsin(np.median(sine)))
    spread = float(np.arcsin(np.clip(0.5 * np.ptp(np.quantile(sine, (0.16, 0.84))), 0.0, 1.0)))
    shown = f"{dip / DEG:.0f}° ± {spread / DEG:.0f}°"
    where = place_of(log)
    if where is None:
        side = "northern" if dip > 0.0 else "southern"
        return [
            Finding(
                check="dip",
                severity=Severity.OK,
                sentence=f"The field is inclined by {shown} if both signs are right, as on the "
                f"{side} hemisphere; the place is not known, so the signs cannot be told.",
                confidence=0.9,
                stream="mag",
            )
        ]
    model = magnetic_field(*where)
    expected = model.inclination
    told = f"the world magnetic model says {expected / DEG:.0f}° here"
    out = []
    if abs(dip - expected) <= _DIP_WITHIN + spread:
        text = f"The field is inclined by {shown}, {told}."
        signs = " The signs of gravity and field are right together."
        seen = abs(expected) > _DIP_SEEN
        text += signs if seen else ""
        out.append(Finding(check="dip", severity=Severity.OK, sentence=text, stream="mag"))
    elif abs(dip + expected) <= _DIP_WITHIN + spread and abs(expected) > _DIP_SEEN:
        out.append(
            Finding(
                check="sign",
                severity=Severity.ERROR,
                sentence=f"The field is inclined by {shown} and {told}: accelerometer or "
                "magnetometer shows the opposite of what it must.",
                confidence=0.98,
                advice="Read it with --axes acc=-x,-y,-z or --axes mag=-x,-y,-z.",
                stream="mag",
            )
        )
    else:
        out.append(
            Finding(
                check="dip",
                severity=Severity.WARNING,
                sentence=f"The field is inclined by {shown}, {told}.",
                confidence=0.9,
                advice="Look for steel and magnets, calibrate the magnetometer, and see what is "
                "said of its axes.",
                stream="mag",
            )
        )
    size = float(np.median(np.sqrt((m * m).sum(axis=1))))
    strength = float(np.linalg.norm(model.field_n))
    if _STRENGTH_WITHIN < abs(size / strength - 1.0) < 2.0:
        text = f"The field's strength is {size / UT:.1f} µT, the model says {strength / UT:.1f}."
        advice = "Look for steel and magnets, or calibrate the magnetometer."
        out.append(
            Finding(
                check="strength",
                severity=Severity.WARNING,
                sentence=text,
                confidence=0.9,
                advice=advice,
                stream="mag",
            )
        )
    return out


def mag_calibration(grid: Grid) -> Finding | None:
    """Return whether the field's strength depends on the attitude: hard and soft iron."""
    if "mag" not in grid.fields:
        return None
    m = grid.fields["mag"][~grid.bad][::5]
    size = float(np.median(np.sqrt((m * m).sum(axis=1)))) if len(m) > 50 else 0.0
    if size == 0.0:
        return None
    m = m / size
    norm = np.sqrt((m * m).sum(axis=1))
    spread = float(norm.std())
    # |m|^2 = 2 c . m + r^2 - |c|^2 is linear in the centre c.
    design = np.column_stack((2.0 * m, np.ones(len(m))))
    solution, _, rank, _ = np.linalg.lstsq(design, norm * norm, rcond=None)
    away = m - solution[:3]
    away /= np.maximum(np.sqrt((away * away).sum(axis=1, keepdims=True)), 1e-12)
    covered = float(np.linalg.eigvalsh(np.cov(away.T))[0]) * 3.0
    noise = float(np.sqrt(np.diff(m, axis=0).var(axis=0).sum() / 2.0))
    extent = float(np.sqrt(m.var(axis=0).sum()))
    if rank < 4 or covered < _COVERED or extent < _EXTENT * max(noise, _DRIFT):
        if spread < 0.05:
            return None
        return Finding(
            check="calibration",
            severity=Severity.NOTE,
            sentence=f"The field's strength varies by {100.0 * spread:.0f} %, and the box was not "
            "turned enough to tell iron on it from iron around it.",
            confidence=0.8,
            advice="Turn the box through all directions, far from steel, and run `strapdown "
            "calibrate mag`.",
            stream="mag",
        )
    offset = float(np.linalg.norm(solution[:3]))
    severity = (
        Severity.WARNING
        if offset > _OFFSET_WARNING
        else Severity.NOTE
        if offset > _OFFSET_NOTE
        else Severity.OK
    )
    return Finding(
        check="calibration",
        severity=severity,
        sentence=f"The field's centre is off by {100.0 * offset:.0f} % of its strength, which "
        f"varies by {100.0 * spread:.0f} % with the attitude"
        + (": the magnetometer is not calibrated." if severity is Severity.WARNING else "."),
        confidence=0.95,
        advice=""
        if severity is Severity.OK
        else "Run `strapdown calibrate mag` on a log that turns through all directions.",
        stream="mag",
    )


def motion_finding(grid: Grid, scale: float) -> Finding:
    """Return how much the box turned.

    Parameters
    ----------
    grid : Grid
        The sensors.
    scale : float
        Factor that the gyroscope's values need.
    """
    rate = scale * grid.fields["gyr"][~grid.bad]
    turned = np.abs(rate).sum(axis=0) * grid.dt / DEG
    rates = np.sqrt((rate * rate).mean(axis=0)) / DEG if len(rate) else np.zeros(3)
    text = (
        f"Axes x, y, z turn at {short(rates[0])}, {short(rates[1])}, {short(rates[2])} °/s (RMS)"
    )
    second = float(np.sort(rates)[1])
    if float(rates.max(initial=0.0)) < 1.0 or float(turned.max(initial=0.0)) < 30.0:
        sentence = text + ": too little for axes, scales or a magnetometer to be told."
        advice = "Good for noise and bias; for the rest, turn the box about all three axes."
    elif second < 0.1 * float(rates.max()):
        sentence = text + ": nearly all about one axis."
        advice = "Axes and calibration need turning about two axes at least."
    else:
        return Finding(check="motion", severity=Severity.OK, sentence=text + ".", stream="gyr")
    return Finding(
        check="motion", severity=Severity.NOTE, sentence=sentence, advice=advice, stream="gyr"
    )
