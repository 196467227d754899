"""From magnetic to true north, by the world magnetic model."""

import math
from datetime import date as calendar_date
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.earth import magnetic_field
from strapdown.recording import Recording


def declination(rec: Recording) -> float | None:
    """Return the magnetic declination where and when a recording was made.

    Parameters
    ----------
    rec : Recording
        With GNSS fixes, or ``lat_rad``, ``lon_rad`` and ``height_m`` in its metadata; and the
        date of ``t = 0`` in ``epoch_utc``.

    Returns
    -------
    float or None
        Declination [rad], east positive; None if place or date are not known.
    """
    _checks.recording("rec", rec)
    place, epoch = _place(rec), rec.meta.get("epoch_utc")
    if place is None or epoch is None:
        return None
    start = next((float(s.t[0]) for _, s in rec.streams() if len(s)), 0.0)
    date = datetime.fromisoformat(str(epoch)) + timedelta(seconds=start)
    return magnetic_field(place, date).declination


def reference_field(lla: ArrayLike, date: calendar_date | float) -> dict[str, Any]:
    """Return the parameters of filters that are told the Earth's field.

    Parameters
    ----------
    lla : array_like, shape (3,)
        Latitude, longitude, height [rad, rad, m].
    date : date or float
        Date or decimal year.

    Returns
    -------
    dict
        ``declination`` [rad] and ``mag_reference``, horizontal and downward [T].
    """
    field = magnetic_field(lla, date)
    north, east, down = (float(part) for part in field.field_n)
    return {
        "declination": field.declination,
        "mag_reference": (math.hypot(north, east), down),
    }


def _place(rec: Recording) -> FloatArray | None:
    """Return the first fix, or the place that the metadata state."""
    if rec.gnss is not None:
        known = rec.gnss.lla[np.isfinite(rec.gnss.lla).all(axis=1)]
        if len(known):
            return np.asarray(known[0])
    found = [rec.meta.get(key) for key in ("lat_rad", "lon_rad", "height_m")]
    if found[0] is None or found[1] is None:
        return None
    return np.array([float(x or 0.0) for x in found])
