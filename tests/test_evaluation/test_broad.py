"""The BROAD figures of a known program on a real trial: another program, stored results."""

import numpy as np
import pytest
from scipy.io import loadmat

from strapdown.evaluation import attitude_errors
from strapdown.recording import AttitudeReference
from strapdown.rotation import quat_ned_from_enu
from strapdown.solution import Solution


# RMSE of the PyPI package vqf 2.1.2, default parameters, online, in degrees: total, as
# computed by other code than this from the definition in the data's README.
@pytest.mark.parametrize(
    ("trial", "total_deg"),
    [("02_undisturbed_slow_rotation_B", 1.38), ("27_disturbed_phone_vibration_B", 6.73)],
)
def test_vqf_gets_its_known_figure(data_dir, trial, total_deg):
    vqf = pytest.importorskip("vqf")
    log = loadmat(data_dir / "broad" / f"{trial}.mat")
    dt = 1.0 / float(log["sampling_rate"].squeeze())
    samples = [np.ascontiguousarray(log[f"imu_{name}"]) for name in ("gyr", "acc", "mag")]
    q_enu = vqf.VQF(dt).updateBatch(*samples)["quat9D"]
    t = np.arange(len(q_enu)) * dt
    solution = Solution(
        t=t,
        q_nb=quat_ned_from_enu(q_enu),
        status=np.zeros(len(t), np.int64),
        filter="vqf",
        heading_reference="magnetic",
    )
    q_ref = log["opt_quat"] / np.linalg.norm(log["opt_quat"], axis=1, keepdims=True)
    reference = AttitudeReference(
        t=t, q_nb=quat_ned_from_enu(q_ref), valid=log["movement"].squeeze() > 0
    )
    summary = attitude_errors(solution, reference, remove_heading=False).summary()
    assert summary["total_rmse_deg"] == pytest.approx(total_deg, abs=0.0051)  # digits printed
