"""A bare import stays cheap, in a process of its own."""

import statistics
import subprocess
import sys

HEAVY = ("numba", "scipy", "plotly", "pandas", "pyarrow", "h5py", "typer", "rich", "pygeomag")


def run(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    return done.stdout.strip()


def test_bare_import_loads_no_heavy_library():
    loaded = run(
        "import sys, strapdown; strapdown.__version__;"
        f"print([m for m in {HEAVY!r} if m in sys.modules])"
    )
    assert loaded == "[]"


def test_looking_around_loads_no_heavy_library():
    loaded = run(
        "import sys, strapdown as sd; dir(sd); sd.conventions, sd.errors, sd.units, sd.Recording;"
        "sd.from_arrays([0, 1], [[0, 0, 0]] * 2, [[0, 0, 9.8]] * 2).info();"
        f"print([m for m in {HEAVY!r} if m in sys.modules])"
    )
    assert loaded == "[]"


def test_command_line_loads_no_heavy_library_for_its_version():
    heavy = tuple(m for m in HEAVY if m not in ("typer", "rich"))
    loaded = run(
        "import sys; from strapdown.cli import main; main(['--version']);"
        f"print([m for m in {heavy!r} if m in sys.modules])"
    )
    assert loaded.splitlines()[-1] == "[]"


def test_bare_import_costs_at_most_1_3_times_numpy():
    timed = "import time; a = time.perf_counter(); import {}; print(time.perf_counter() - a)"

    def ratio() -> float:
        numpy, ours = [], []
        for _ in range(5):  # interleaved: both see the same machine
            numpy.append(float(run(timed.format("numpy"))))
            ours.append(float(run(timed.format("strapdown"))))
        return statistics.median(ours) / statistics.median(numpy)

    # a busy machine gets a second chance; a heavy import fails both
    assert min(ratio(), ratio()) <= 1.3
