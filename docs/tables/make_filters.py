"""Write docs/tables/filters.md: what the registry knows of every estimator."""

from pathlib import Path

import strapdown as sd


def main() -> None:
    """Write the table."""
    rows = [("Name", "What it is", "Needs", "Uses", "Offline twin", "Source", "Cost per sample")]
    rows.append(("---",) * 7)
    for entry in sd.estimators.entries():
        what = entry.summary.rstrip(".")
        needs, uses = ", ".join(("imu", *entry.needs)), ", ".join(entry.uses)
        twin = "yes" if entry.smooths else ""
        rows.append((f"`{entry.name}`", what, needs, uses, twin, entry.source, entry.cost))
    text = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    Path(__file__).with_name("filters.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
