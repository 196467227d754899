"""Write docs/tables/report.md: size of the report and the time it takes, by length of the log."""

import os
import platform
import tempfile
import time
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.units import DEG

RATE_HZ = 286.0
LENGTHS_S = (30.0, 185.0, 3600.0)  # the demo, a trial of BROAD, an hour


def solution(rec: sd.Recording) -> sd.Solution:
    """Return the reference as an estimate, with all that an estimator can state."""
    t, rows = rec.imu.t, (len(rec.imu.t), 3)
    return sd.Solution(
        t=t,
        q_nb=rec.reference.attitude.q_nb,
        status=np.zeros(len(t), np.int64),
        filter="reference",
        heading_reference="true",
        gyr_bias=rec.imu.gyr,
        std_gyr_bias=np.full(rows, 0.01),
        std_attitude_n=np.full(rows, 0.5 * DEG),
    )


def main() -> None:
    """Write each report twice, keep the quicker time."""
    lines = ["| Log | samples | report [MB] | time to write [s] |", "|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        for length in LENGTHS_S:
            rec = sd.simulation.demo.recording(length, RATE_HZ)
            sol, took = solution(rec), []
            for _ in range(2):
                start = time.perf_counter()
                path = sd.report.write(sol, rec, Path(folder) / "report.html")
                took.append(time.perf_counter() - start)
            lines.append(
                f"| {length:.0f} s at {RATE_HZ:.0f} Hz | {len(rec.imu.t)} "
                f"| {path.stat().st_size / 1e6:.1f} | {min(took):.2f} |"
            )
    text = "\n".join(lines)
    text += (
        f"\n\nErrors against the reference included; {platform.machine()} with "
        f"{os.cpu_count()} cores, Python {platform.python_version()}, by `make tables`.\n"
    )
    Path(__file__).with_name("report.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
