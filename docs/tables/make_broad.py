"""Write docs/tables/broad.md: RMSE of every estimator on the BROAD trials that are there."""

import sys
from pathlib import Path

import numpy as np

import strapdown as sd

ROOT = Path(__file__).resolve().parents[2]
TRIALS = ROOT.parent / "shared" / "data" / "broad"
PARTS = ("total", "heading", "inclination")

# Per trial: total, heading, inclination RMSE [deg] that BROAD's authors publish for their C code
# of Madgwick's filter with beta 0.12.
PUBLISHED = {
    "02": (1.50, 1.26, 0.80),
    "06": (2.31, 1.77, 1.48),
    "09": (2.48, 1.65, 1.86),
    "11": (4.24, 2.61, 3.34),
    "16": (4.82, 3.70, 3.09),
    "18": (4.46, 2.87, 3.42),
    "25": (3.92, 2.76, 2.78),
    "27": (10.62, 10.50, 1.57),
    "30": (5.57, 1.81, 5.26),
    "34": (5.37, 4.25, 3.29),
}


def cell(figures: np.ndarray) -> str:
    """Return ``1.50 / 1.26 / 0.80``."""
    return " / ".join(f"{x:.2f}" for x in figures)


def main() -> None:
    """Run all, write the table."""
    logs = sorted(TRIALS.glob("*.mat"))
    if not logs:
        sys.exit(f"needs the trials of BROAD in {TRIALS}")
    flts = {"madgwick, beta 0.12": sd.estimators.create("madgwick", beta=0.12)}
    flts |= {e.name: e.cls() for e in sd.estimators.entries() if e.gives == "attitude"}
    rows: dict[str, list[np.ndarray]] = {}
    for log in logs:
        rec, trial = sd.read(log), log.name[:2]
        figures = [np.array(PUBLISHED[trial])]
        for flt in flts.values():
            errors = sd.evaluation.attitude_errors(flt.run(rec), rec.reference).summary()
            figures.append(np.array([errors[f"{part}_rmse_deg"] for part in PARTS]))
        rows[trial] = figures
    head = ["Trial", "authors' C code, beta 0.12", *flts]
    lines = [head, ["---"] * len(head)]
    lines += [[trial, *(cell(f) for f in figures)] for trial, figures in rows.items()]
    mean = np.mean([np.array(figures) for figures in rows.values()], axis=0)
    lines.append(["**mean**", *(f"**{cell(f)}**" for f in mean)])
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    text += "\n\nTotal / heading / inclination RMSE in degrees, by `make tables`.\n"
    Path(__file__).with_name("broad.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
