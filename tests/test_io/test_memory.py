"""A long text log is read in blocks: little more than its arrays is in memory."""

import gzip
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import csv

ROWS = 1_000_000
HEAD = "t_s gx_dps gy_dps gz_dps ax_g ay_g az_g mx_ut my_ut mz_ut"
NAMES = HEAD.split(" ")
READ = """
import sys
import pyarrow.csv
import strapdown as sd
sd.read

def kilobytes(key):
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith(key))

idle = kilobytes("VmRSS")
rec = sd.read(sys.argv[1])
arrays = (rec.imu.t, rec.imu.gyr, rec.imu.acc, rec.mag.mag)
assert rec.mag.t is rec.imu.t
print((kilobytes("VmHWM") - idle) * 1024 / sum(a.nbytes for a in arrays))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the memory from /proc")
@pytest.mark.parametrize("name", ["long.csv", "long.csv.gz"])
def test_the_peak_stays_below_two_and_a_half_times_the_arrays(tmp_path: Path, name: str) -> None:
    rng = np.random.default_rng(1)
    columns = [np.arange(ROWS) / 200, *(rng.normal(size=1000) for _ in NAMES[1:])]
    table = pa.table(
        {
            n: np.resize(c, ROWS) if k else c
            for k, (n, c) in enumerate(zip(NAMES, columns, strict=True))
        }
    )
    if name.endswith(".gz"):
        with gzip.open(tmp_path / name, "wb", compresslevel=1) as stream:
            csv.write_csv(table, stream)
    else:
        csv.write_csv(table, tmp_path / name)
    done = subprocess.run(
        [sys.executable, "-c", READ, str(tmp_path / name)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) < 2.5
