"""Write docs/tables/robustness.md: every attitude estimator on the faults of the tests."""

import math
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from truth import faults  # noqa: E402 - the faults of the tests

import strapdown as sd  # noqa: E402


def cell(outcome: faults.Outcome, case: faults.Case) -> str:
    """Return how far off, and when it was back; that nothing told of it, or that it broke."""
    if not outcome.finite:
        return "**not finite**"
    text = f"{outcome.largest:.2f}"
    if outcome.recovery == math.inf:
        text += f", {outcome.at_end:.1f} at the end"
    elif outcome.largest > faults.RECOVERED:
        text += f", back in {outcome.recovery:.1f} s"
    if case.flags and not outcome.flags & case.flags:
        text += ", **no flag**"
    return text


def flags(case: faults.Case) -> str:
    """Return the flags that tell."""
    return " or ".join(f"`{flag.name}`" for flag in case.flags)


def main() -> None:
    """Write the table."""
    names = [e.name for e in sd.estimators.entries() if e.gives == "attitude"]
    flts = {name: sd.estimators.create(name) for name in names}
    head = ("Fault", *(f"`{name}`" for name in names), "Flag")
    lines = [head, ("---",) * len(head)]
    for name, case in faults.cases().items():
        cells = [cell(faults.judge(flt, case), case) for flt in flts.values()]
        lines.append((name, *cells, flags(case)))
    text = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    text += "\n\nDegrees off the solution of the untouched log, by `make tables`.\n"
    Path(__file__).with_name("robustness.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
