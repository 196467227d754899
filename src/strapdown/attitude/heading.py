"""From magnetic to true north, by the world magnetic model."""

from datetime import datetime, timedelta

import numpy as np

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
