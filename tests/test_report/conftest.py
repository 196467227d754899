"""A recording and a solution in closed form, of any length, for the report's tests."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from strapdown.recording import AttitudeReference, Imu, Mag, Recording, Reference
from strapdown.solution import Diagnostics, Solution, Status
from strapdown.units import DEG


def build(n=2000, *, rate=286.0, heading="magnetic", name="hand motion"):
    t = np.arange(n) / rate
    rng = np.random.default_rng(5)
    true = Rotation.from_euler(
        "ZYX", np.stack((0.4 * t, 0.9 * np.sin(0.7 * t), 2.0 * np.cos(0.3 * t)), axis=1)
    )
    error = Rotation.from_rotvec(np.stack((np.sin(t), np.cos(t), 0 * t + 2), axis=1) * DEG)
    q_ref, q_est = (np.roll(r.as_quat(), 1, axis=1) for r in (true, error * true))
    status = np.zeros(n, np.int64)
    status[: n // 20] = Status.ALIGNING
    status[n // 2 : n // 2 + 3] |= Status.GYR_INVALID
    status[n // 3 : n // 3 + 50] |= Status.REST
    gyr = rng.normal(size=(n, 3))
    gyr[n // 2 : n // 2 + 3] = np.nan
    rec = Recording(
        imu=Imu(t=t, gyr=gyr, acc=rng.normal(size=(n, 3)) + [0, 0, -9.8]),
        mag=Mag(t=t, mag=rng.normal(size=(n, 3)) * 1e-6 + [2e-5, 0, 4e-5]),
        reference=Reference(attitude=AttitudeReference(t=t, q_nb=q_ref), heading="magnetic"),
        meta={"name": name},
    )
    rows = slice(n // 20, n, 4)
    diagnostics = Diagnostics(
        t=t[rows],
        innovation=rng.normal(size=(len(t[rows]), 3)),
        sigma=np.ones((len(t[rows]), 3)),
        outcome=np.where(np.arange(len(t[rows])) % 40 == 0, 2, 1),
        labels=("x", "y", "z"),
    )
    sol = Solution(
        t=t,
        q_nb=q_est,
        status=status,
        filter="mekf",
        heading_reference=heading,
        gyr_bias=np.tile([0.001, -0.002, 0.003], (n, 1)),
        std_gyr_bias=np.full((n, 3), 5e-4),
        std_attitude_n=np.tile(np.array([1.0, 1.0, 3.0]) * DEG, (n, 1)),
        diagnostics={"acc": diagnostics},
        meta={"parameters": {"gyr_density": 0.001, "use_mag": True}},
    )
    return sol, rec


@pytest.fixture(scope="session")
def run():
    """`build`, to be called with the number of samples."""
    return build
