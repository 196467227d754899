"""Write docs/tables/noise.md: what a hundred simulated records give back. Takes ten minutes."""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from test_noise import test_study as study  # noqa: E402 - the study of the slow test

HEAD = (
    "Channel", "N, largest error", "B, mean error", "B, spread", "B, bound on the spread",
    "B within its interval", "K, mean error", "K, spread", "K within its interval",
)  # fmt: skip


def row(channel):
    """Return the cells of a channel."""
    found = study.study(channel, list(study.records(channel)))
    cells = [channel, f"{100 * found['N']['largest']:.2f} %"]
    for symbol in "BK":
        r = found[symbol]
        if study.CHANNELS[channel]["NBK".index(symbol)] == 0.0:
            silent = f"not observable in {study.RECORDS - r['observed']}"
            cells += [silent] + [""] * (3 if symbol == "B" else 2)
            continue
        cells += [f"{100 * r['mean']:+.1f} %", f"{100 * r['spread']:.1f} %"]
        if symbol == "B":
            cells.append(f"{100 * study.cramer_rao(*study.CHANNELS[channel]):.1f} %")
        cells.append(f"{r['held']} of {study.RECORDS}")
    return cells


def main() -> None:
    """Write the table."""
    rows = [HEAD, ("---",) * len(HEAD), *map(row, study.CHANNELS)]
    text = "\n".join(f"| {' | '.join(cells)} |" for cells in rows) + "\n"
    (ROOT / "docs" / "tables" / "noise.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
