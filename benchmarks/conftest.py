"""Times side by side: candidates take turns, medians are compared, a table is printed.

Processor time is taken, not time on the wall: all candidates use one thread, and what else runs
on the machine then hardly counts.
"""

import os
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
os.environ.setdefault("STRAPDOWN_CACHE_DIR", str(ROOT / ".numba_cache"))

_rows: list[tuple[str, str, str, str]] = []


@pytest.fixture
def take_turns(benchmark) -> Callable[..., dict[str, float]]:
    """Time calls in turns, so that all see the same machine; returns median seconds by name."""

    def measure(rounds: int = 15, **calls: Callable[[], object]) -> dict[str, float]:
        times: dict[str, list[float]] = {name: [] for name in calls}

        def one_round() -> None:
            for name, call in calls.items():
                begun = time.process_time()
                call()
                times[name].append(time.process_time() - begun)

        for call in calls.values():
            call()  # compiles, fills caches
        benchmark.pedantic(one_round, rounds=rounds, iterations=1)
        medians = {name: statistics.median(values) for name, values in times.items()}
        benchmark.extra_info.update(medians)
        return medians

    return measure


@pytest.fixture
def table() -> Callable[[str, str, str, str], None]:
    """Add a row to the table: what, here, beside it, goal."""

    def add(what: str, here: str, beside: str, goal: str) -> None:
        _rows.append((what, here, beside, goal))

    return add


@pytest.fixture(scope="session")
def recording():
    """50,000 samples of the demo's motion, 9 axes at 100 Hz."""
    from strapdown.simulation import demo

    return demo.recording(duration=500.0, rate=100.0)


@pytest.fixture(scope="session")
def broad_02() -> Path:
    """A benchmark trial of 186 s at 286 Hz."""
    path = ROOT.parent / "shared/data/broad/02_undisturbed_slow_rotation_B.mat"
    if not path.is_file():
        pytest.skip("needs the real recordings in ../shared/data")
    return path


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the table, and keep it for the docs when all of it was measured."""
    if not _rows:
        return
    text = _markdown()
    terminalreporter.write_line("")
    terminalreporter.write_line(text)
    target = os.environ.get("STRAPDOWN_SPEED_TABLE")
    if target:
        Path(target).write_text(text, encoding="utf-8")


def _markdown() -> str:
    from importlib.metadata import version

    used = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "vqf", "imufusion"))
    head = ("What", "Here", "Beside it, in the same run", "Goal")
    lines = [f"| {' | '.join(row)} |" for row in (head, ("---",) * 4, *_rows)]
    where = (
        f"{os.cpu_count()} processors, {platform.machine()}, Python {platform.python_version()}"
    )
    return "\n".join(
        [*lines, "", f"Processor time, medians, by `make bench` on {where}; {used}.", ""]
    )
