"""Peak memory of a long run, in a process of its own."""

import subprocess
import sys

import pytest

CODE = """
import resource, sys
import numpy as np
import strapdown as sd

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

n = int(sys.argv[1])
flt = sd.estimators.create(sys.argv[2])
small = sd.simulation.demo.recording(12.0, 100.0)
flt.run(small, diagnostics=False)  # compiles
idle = peak()
rng = np.random.default_rng(0)
t = np.arange(n) * 0.01
arrays = [np.empty((n, 3)) for _ in range(3)]
for array, source in zip(arrays, (small.imu.gyr, small.imu.acc, small.mag.mag)):
    for start in range(0, n, len(source)):
        part = array[start : start + len(source)]
        part[:] = source[: len(part)]
inputs = t.nbytes + sum(a.nbytes for a in arrays)
rec = sd.from_arrays(t, *arrays)
sol = flt.run(rec, diagnostics=False)
assert len(sol) == n
print((peak() - idle) / inputs)
"""


@pytest.mark.parametrize("name", ["madgwick", "mekf"])
def test_ten_million_samples_need_less_than_three_times_their_size(name, table):
    done = subprocess.run(
        [sys.executable, "-c", CODE, "10_000_000", name],
        check=True,
        capture_output=True,
        text=True,
    )
    ratio = float(done.stdout)
    table(
        f"{name} `run`, 10 million samples, peak memory", f"{ratio:.2f} times the inputs", "", "3"
    )
    assert ratio < 3.0
