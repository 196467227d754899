"""Run a peer on the samples of files: by the Python of .venv/peers, which has no strapdown.

``python peer_calls.py PEER FILE.npz ...`` prints one JSON list: what the peer found in each, and
the processor time that it took.
"""

import json
import sys
import time
import warnings

import numpy as np

SECTIONS = ("x_p", "x_a", "y_p", "y_a", "z_p", "z_a", "x_rot", "y_rot", "z_rot")


def timed(call):
    """Return what a call returns, and its processor time."""
    begun = time.process_time()
    found = call()
    return found, time.process_time() - begun


def ferraris(file):
    """Return matrices and biases of imucal's Ferraris calibration: ``true = A (y - b)``."""
    from imucal import FerrarisCalibration, FerrarisSignalRegions

    parts = {f"{s}_{name}": file[f"{s}_{name}"] for s in ("acc", "gyr") for name in SECTIONS}
    regions = FerrarisSignalRegions(**parts)
    method = FerrarisCalibration(grav=float(file["gravity"]))
    found, seconds = timed(
        lambda: method.compute(
            regions, float(file["rate_hz"]), from_acc_unit="m/s^2", from_gyr_unit="deg/s"
        )
    )
    return {
        "acc_matrix": np.linalg.inv(found.K_a @ found.R_a).tolist(),
        "acc_bias": np.asarray(found.b_a).tolist(),
        "gyr_matrix": np.linalg.inv(found.K_g @ found.R_g).tolist(),
        "gyr_bias": np.asarray(found.b_g).tolist(),
        "seconds": seconds,
    }


def twostep(file):
    """Return hard and soft iron of magyc's two-step: ``true = soft^-1 (y - hard)``."""
    from magyc import twostep_hsi

    mag, reference = file["mag"], file["reference"]  # samples of shape (n, 3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (hard, soft, _), seconds = timed(
            lambda: twostep_hsi(mag, reference, measurement_noise_std=float(file["std"]))
        )
    return {
        "matrix": np.linalg.inv(soft).tolist(),
        "bias": np.asarray(hard).tolist(),
        "seconds": seconds,
    }


if __name__ == "__main__":
    peer = {"imucal": ferraris, "magyc": twostep}[sys.argv[1]]
    files = [np.load(name) for name in sys.argv[2:]]
    peer(files[0])  # the first call is slower
    print(json.dumps([peer(file) for file in files]))
