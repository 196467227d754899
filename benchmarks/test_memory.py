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


DAY = """
import resource, sys
import numpy as np
import strapdown as sd
from strapdown.recording import Gnss, Imu, Recording

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024

# the shipped drive, again and again
drive = sd.simulation.load("drive").record()
imu, fixes = drive.imu, drive.gnss
n = round(24 * 3600 / np.median(np.diff(imu.t)))
m = int(n * len(fixes) / len(imu))
flt = sd.navigation.LooselyCoupled()
flt.smooth(drive)  # compiles

def again(a, rows):
    return np.resize(a, (rows, *a.shape[1:]))

idle = peak()
tracker, dt, j = flt.tracker(), np.median(np.diff(imu.t)), 0
for k in range(200_000):
    t = (k + 1) * dt
    if k * m // n > j:
        j += 1
        i = j % len(fixes)
        tracker.add_gnss(t, fixes.lla[i], fixes.v_n[i], fixes.std_position_n[i],
                         fixes.std_velocity_n[i])
    tracker.update(t, imu.gyr[k % len(imu)], imu.acc[k % len(imu)])
streaming = peak() - idle
rec = Recording(
    imu=Imu(t=dt * np.arange(1, n + 1), gyr=again(imu.gyr, n), acc=again(imu.acc, n)),
    gnss=Gnss(
        t=24 * 3600 / m * np.arange(1, m + 1), lla=again(fixes.lla, m), v_n=again(fixes.v_n, m),
        std_position_n=again(fixes.std_position_n, m),
        std_velocity_n=again(fixes.std_velocity_n, m),
    ),
)
sol = flt.smooth(rec)
print(len(sol), streaming, peak() - idle)
"""


def test_a_day_of_driving_is_smoothed_and_streamed_within_its_memory(table):
    done = subprocess.run([sys.executable, "-c", DAY], check=True, capture_output=True, text=True)
    samples, streaming, smoothed = (float(part) for part in done.stdout.split())
    table(
        f"loosely-coupled `smooth`, a day, {samples / 1e6:.2f} million samples, peak memory",
        f"{smoothed / 1e9:.2f} GB", "", "4 GB",
    )  # fmt: skip
    table(
        "loosely-coupled `tracker`, 200,000 samples, memory added", f"{streaming / 1e6:.0f} MB",
        "", "200 MB",
    )  # fmt: skip
    assert smoothed < 4e9
    assert streaming < 2e8
