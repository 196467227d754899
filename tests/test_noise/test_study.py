"""A hundred records of four hours with the coefficients of thesis A, tables 5.3, 5.5 and 5.7.

Run with ``pytest -m slow tests/test_noise/test_study.py -s``: it prints the rows of the table in
the docs. A single record cannot give B to 5 %: the Cramer-Rao bound of the whole record, worked
out below from the spectrum alone, is 6 to 10 %. So B is held to 5 % in the mean of the records,
to the bound in its spread, and to its own interval in each.
"""

import numpy as np
import pytest
from truth.noise import at_rest

from strapdown.noise import Status, identify

HOURS, FS, RECORDS = 4.0, 100.0, 100
CHANNELS = {  # N, B, K in the units of the tables; 0 where a table has none
    "gyr x": (7.867e-3, 1.241e-3, 1.111e-4),
    "gyr y": (9.281e-3, 1.418e-3, 1.389e-4),
    "gyr z": (7.389e-3, 1.117e-3, 1.111e-4),
    "acc x": (2.426e-4, 0.0, 0.0),
    "acc z": (3.920e-4, 4.280e-5, 0.0),
    "mag x": (1.559e-4, 2.531e-5, 2.0e-6),
    "mag y": (1.473e-4, 3.234e-5, 2.0e-6),
    "mag z": (1.537e-4, 3.790e-5, 4.0e-6),
}


def cramer_rao(N, B, K):
    """Smallest relative deviation of B that an unbiased estimate can have."""
    f = np.arange(1, int(HOURS * 3600.0 * FS / 2)) / (HOURS * 3600.0)
    parts = [N**2 + 0.0 * f, B**2 / (2.0 * np.pi * f), (K / (2.0 * np.pi * f)) ** 2]
    shares = np.array([p for p, c in zip(parts, (N, B, K), strict=True) if c]) / sum(parts)
    return 0.5 * np.sqrt(np.linalg.inv(shares @ shares.T)[1, 1])


def records(channel):
    """Identify all simulated records of a channel."""
    N, B, K = CHANNELS[channel]
    number = list(CHANNELS).index(channel)
    for record in range(RECORDS):
        rng = np.random.default_rng(np.random.SeedSequence([2024, number, record]))
        yield identify(at_rest(rng, int(HOURS * 3600.0 * FS), FS, N=N, B=B, K=K), FS)


def study(channel, found):
    """Summarise the records of a channel: what the test asserts and the docs print."""
    row = {"channel": channel}
    for symbol, truth in zip("NBK", CHANNELS[channel], strict=True):
        terms = [c[symbol] for c in found]
        seen = [c for c in terms if c.status is Status.OBSERVED]
        off = np.array([c.value / truth - 1.0 for c in seen]) if truth else np.empty(0)
        row[symbol] = {
            "observed": len(seen),
            "held": sum(not c.low > truth and truth <= c.high for c in terms),
            "mean": off.mean() if off.size else np.nan,
            "spread": off.std() if off.size else np.nan,
            "largest": np.abs(off).max() if off.size else np.nan,
        }
    return row


def as_text(row):
    parts = [row["channel"], f"{100 * row['N']['largest']:.2f} %"]
    for symbol in "BK":
        r = row[symbol]
        if np.isnan(r["mean"]):
            parts += [f"not observable: {RECORDS - r['observed']}", ""]
        else:
            parts += [f"{100 * r['mean']:+.1f} %", f"{100 * r['spread']:.1f} %", str(r["held"])]
    return "| " + " | ".join(parts) + " |"


@pytest.mark.slow
@pytest.mark.parametrize("channel", CHANNELS)
def test_coefficients_of_thesis_a(channel):
    found = list(records(channel))
    row = study(channel, found)
    print("\n" + as_text(row))
    N, B, K = CHANNELS[channel]
    assert row["N"]["largest"] < 0.01
    if B:
        assert abs(row["B"]["mean"]) < 0.05
        assert row["B"]["spread"] < 1.3 * cramer_rao(N, B, K)  # known to 7 % from 100 records
    for symbol, truth in (("B", B), ("K", K)):
        if truth:
            # Of 95 expected, three standard deviations of a count are 6.5; the goal is K's.
            assert row[symbol]["held"] >= (90 if symbol == "K" else 87)
        else:  # the evidence asked for has a chance of 0.4 % where there is nothing
            assert row[symbol]["observed"] <= 3
    assert sum(c.R.observed for c in found) <= 1  # a random walk can look like a ramp
