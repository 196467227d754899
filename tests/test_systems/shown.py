"""Experiments run once per test session, and helpers to look at their rows."""

from functools import cache

from strapdown.systems import Row, Shown, Verdict, parts


def shown(system: str, name: str, seed: int = 0) -> Shown:
    """What an experiment shows."""
    return _run(system, name, seed)  # a cache takes a default left out for another argument


@cache
def _run(system: str, name: str, seed: int) -> Shown:
    (part,) = parts(system, name)
    return part.run(seed)


def rows(system: str, name: str, seed: int = 0) -> dict[str, Row]:
    """Its rows by item."""
    found = shown(system, name, seed).rows
    by_item = {row.item: row for row in found}
    # one item may stand twice in two units
    assert len({(row.item, row.unit) for row in found}) == len(found)
    return by_item


def missed(system: str, name: str, seed: int = 0) -> set[str]:
    """Items that are missed."""
    return {row.item for row in shown(system, name, seed).rows if row.verdict is Verdict.MISSED}


def count(system: str, name: str, beginning: str) -> int:
    """How many rows begin with these words."""
    return sum(row.item.startswith(beginning) for row in shown(system, name).rows)
