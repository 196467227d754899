"""Write docs/tables/mechanisations.md: error after ten minutes of flight, time per sample."""

import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from truth.flight import Flight, position_error  # noqa: E402 - a flight in closed form

from strapdown.navigation import Start, mechanise  # noqa: E402
from strapdown.rotation import quat_from_dcm  # noqa: E402

RATES = (100, 1000)
FRAMES = ("ned", "ecef", "inertial", "wander")
FORMS = (
    [("quaternion", samples, True) for samples in (1, 2, 3, 4)]
    + [(attitude, 2, True) for attitude in ("dcm", "euler")]
    + [("quaternion", 1, False)]
)


def samples(rate):
    """Start, end and exact samples of ten minutes, made in pieces of a minute."""
    flight = Flight(0.83, 0.15, 1000.0, 0.7)
    part = 8 if rate < 1000 else 1  # quadrature within the interval
    t = np.arange(600 * rate + 1) / rate
    gyr, acc = [], []
    for first in range(0, len(t) - 1, 60 * rate):
        fine = np.arange(60 * rate * part + 1) / (rate * part) + t[first]
        for rows, values in zip((gyr, acc), flight.samples(fine), strict=True):
            rows.append(values[1:].reshape(-1, part, 3).mean(axis=1))
    at_start = flight.imu(t[:1])
    gyr, acc = (np.concatenate((c, *r)) for c, r in zip(at_start, (gyr, acc), strict=True))
    lla, v_n, C_nb = flight.state(0.0)
    start = Start(t=0.0, lla=lla, v_n=v_n, q_nb=quat_from_dcm(C_nb))
    return start, flight.state(600.0)[0], (t, gyr, acc)


def main() -> None:
    """Write the table."""
    logs = {rate: samples(rate) for rate in RATES}
    head = ["Attitude", "Samples", "Frame", *(f"Error at {rate} Hz" for rate in RATES), "Time"]
    rows = [head, ["---"] * len(head)]
    for attitude, count, compensate in FORMS:
        for frame in FRAMES:
            cells, took = [], np.inf
            for rate in RATES:
                start, end, log = logs[rate]
                for _ in range(8 if rate == RATES[0] else 1):  # the first may compile
                    begun = time.perf_counter()
                    sol = mechanise(
                        log, start, frame=frame, attitude=attitude, samples=count,
                        compensate=compensate,
                    )  # fmt: skip
                    took = min(took, (time.perf_counter() - begun) / len(log[0]))
                cells.append(f"{1e3 * position_error(sol.lla[-1], end):.2g} mm")
            name = f"{count}" if compensate else f"{count}, no compensation"
            rows.append([attitude, name, frame, *cells, f"{1e9 * took:.0f} ns"])
    text = "\n".join(f"| {' | '.join(cells)} |" for cells in rows) + "\n"
    (ROOT / "docs" / "tables" / "mechanisations.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
