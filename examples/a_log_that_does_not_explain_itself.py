"""
A log that does not explain itself
==================================

Loggers write what they like: odd names, raw units, no times. Reading states what the file does
not, and never guesses: without the units, numbers of this size are refused, with the way out.
"""

import tempfile
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.constants import G0
from strapdown.units import DPS, GAUSS

made = sd.simulation.demo.recording(duration=20.0, rate=100.0)
columns = np.column_stack((made.imu.gyr / DPS, made.imu.acc / G0, made.mag.mag / GAUSS))

with tempfile.TemporaryDirectory() as folder:
    log = Path(folder) / "LOG00042.TXT"
    np.savetxt(
        log, columns, fmt="%.5f", delimiter=";", header="g1;g2;g3;a1;a2;a3;m1;m2;m3", comments=""
    )
    names = "gyr_x=g1,gyr_y=g2,gyr_z=g3,acc_x=a1,acc_y=a2,acc_z=a3,mag_x=m1,mag_y=m2,mag_z=m3"

    try:
        sd.read(log, columns=names, rate=100.0)
    except sd.errors.FormatError as error:
        print("refused:", str(error).partition(": ")[2])

    rec = sd.read(log, columns=names, rate=100.0, units="gyr=dps,acc=g,mag=gauss")

for row in rec.info():
    print(f"{row.name}: {row.samples} samples, {row.rate_hz:.0f} Hz, {row.stop_s:.1f} s")
g = np.linalg.norm(rec.imu.acc[:400].mean(axis=0))
print(f"specific force at rest: {g:.2f} m/s^2")
