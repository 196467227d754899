"""Logs with everything that a real one has, and estimators fed sample by sample."""

import numpy as np

from strapdown.kernels import memory as m
from strapdown.recording import Imu, Mag, Recording
from truth import hand

CELLS = {
    "q_nb": slice(m.Q, m.Q + 4),
    "gyr_bias": slice(m.BG, m.BG + 3),
    "std_attitude_n": slice(m.STD_ATT, m.STD_ATT + 3),
    "std_gyr_bias": slice(m.STD_BG, m.STD_BG + 3),
}


def rough_log(seconds=12.0, rate=64.0, mag_rate=17.0, seed=1):
    """Jittered clock, slower magnetometer that starts late, bad samples, a gap, noise, bias.

    Times are multiples of 2**-16 s, so that a shift by whole seconds changes no interval.
    """
    rng = np.random.default_rng(seed)
    n = round(seconds * rate)
    t = np.round((np.arange(n) + rng.uniform(-0.2, 0.2, n)) / rate * 2**16) / 2**16
    t = t[(t < 7.0) | (t > 8.5)]
    t_mag = np.round((np.arange(1.3, seconds, 1.0 / mag_rate)) * 2**16) / 2**16
    both = np.union1d(t, t_mag)
    _, gyr, acc, _ = hand.sensors(t, rest=1.0)
    *_, mag = hand.sensors(both, rest=1.0)
    mag = mag[np.searchsorted(both, t_mag)]
    gyr = gyr + [0.01, -0.02, 0.015] + 0.002 * rng.standard_normal(gyr.shape)
    acc = acc + 0.1 * rng.standard_normal(acc.shape)
    mag = mag + 3e-7 * rng.standard_normal(mag.shape)
    gyr[0], acc[1], acc[2] = np.nan, np.nan, 0.0
    gyr[200], gyr[301:305, 1] = np.nan, np.nan
    acc[210], acc[303:310, 2], acc[320] = np.nan, np.nan, 0.0
    mag[0], mag[60], mag[70:73, 0], mag[80] = np.nan, np.nan, np.nan, 0.0
    return Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t_mag, mag=mag))


def samples(rec):
    """Yield t, gyr, acc and the latest field sample since the sample before, or None."""
    j = 0
    for t, gyr, acc in zip(rec.imu.t, rec.imu.gyr, rec.imu.acc, strict=True):
        field = None
        while rec.mag is not None and j < len(rec.mag) and rec.mag.t[j] <= t:
            field = rec.mag.mag[j]
            j += 1
        yield float(t), gyr, acc, field


def collect(states):
    """Arrays of a solution from the memory after each sample."""
    x = np.array([state.x for state in states])
    found = {name: x[:, cells] for name, cells in CELLS.items()}
    return found | {"status": x[:, m.STATUS].astype(np.int64)}


def assert_same_bits(sol, other, rows=slice(None)):
    """All arrays that a solution has equal those of `other`, a solution or a dict."""
    for name in (*CELLS, "status"):
        mine = getattr(sol, name)
        if mine is not None:
            theirs = other[name] if isinstance(other, dict) else getattr(other, name)
            assert np.array_equal(mine[rows], theirs), name
