"""
In a real-time loop
===================

A tracker holds the state and takes one sample at a time. The same kernel does the batch run, so
both agree to the last bit, and a filter tuned offline behaves the same on the device. The state of
the pure form can be kept and carried on later: here it goes through a file halfway.
"""

import tempfile
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.units import DEG

rec = sd.simulation.demo.recording(seed=3)
flt = sd.attitude.Madgwick(beta=0.05)
batch = flt.run(rec)

# The stateful form: what a loop over a serial port would do.
tracker = flt.tracker()
for t, gyr, acc, mag in zip(rec.imu.t, rec.imu.gyr, rec.imu.acc, rec.mag.mag, strict=True):
    tracker.update(t, gyr, acc, mag)
    if t % 15.0 == 0.0:
        roll, pitch, yaw = sd.rotation.rpy_from_quat(tracker.q_nb) / DEG
        print(f"{t:5.1f} s  roll {roll:7.2f}  pitch {pitch:7.2f}  yaw {yaw:7.2f} deg")
print("tracker equals batch:", np.array_equal(tracker.q_nb, batch.q_nb[-1]))

# The pure form: a state goes in, another comes out; nothing is hidden.
first, state = flt.advance(flt.init(), rec.between(0.0, 30.0))
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "state.npz"
    np.savez(file, **state._asdict())
    state = type(state)(**np.load(file))
second, state = flt.advance(state, rec.between(30.0, 100.0))
halves = np.concatenate((first.q_nb, second.q_nb))
print("two halves equal batch:", np.array_equal(halves, batch.q_nb))
