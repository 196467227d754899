"""The MEKF as a whole: consistent where its model holds, by Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from strapdown.attitude import Mekf
from strapdown.recording import Imu, Mag, Recording
from strapdown.simulation import demo
from strapdown.solution import Outcome

G = 9.80665
RATE = 100.0
FIELD_N = np.array([2.0, 0.0, 4.0]) / np.sqrt(20.0)
CHECKS = (2.0, 8.0, 20.0)  # seconds


def model_run(flt, seed):
    """NEES of attitude and bias at `CHECKS`, on data that the filter's model describes."""
    rng = np.random.default_rng(seed)
    n, dt = round(CHECKS[-1] * RATE), 1.0 / RATE
    t = dt * np.arange(n)
    omega = np.sin(2 * np.pi * np.outer(t, rng.uniform(0.1, 0.5, 3)) + rng.uniform(0, 6.28, 3))
    turns = [Rotation.random(random_state=rng)]
    for rate in omega[1:]:
        turns.append(turns[-1] * Rotation.from_rotvec(rate * dt))
    r_nb = Rotation.concatenate(turns)

    def white(density, shape, interval):
        return density / np.sqrt(interval) * rng.standard_normal(shape)

    walk = np.cumsum(white(flt.gyr_bias_noise, (n, 3), dt), axis=0) * dt
    bias = flt.std_gyr_bias * rng.standard_normal(3) + walk
    acc = r_nb.inv().apply([0.0, 0.0, -G])
    mag = r_nb.inv().apply(FIELD_N)[::5]
    rec = Recording(
        imu=Imu(
            t=t,
            gyr=omega + bias + white(flt.gyr_noise, (n, 3), dt),
            acc=acc + white(flt.acc_noise, (n, 3), dt),
        ),
        mag=Mag(t=t[::5], mag=5e-5 * (mag + white(flt.mag_noise, mag.shape, 5 * dt))),
    )
    start = r_nb[0] * Rotation.from_rotvec(flt.std_tilt * rng.standard_normal(3)).inv()
    state = flt.init(attitude=start.as_quat()[[3, 0, 1, 2]])
    found, before = [], 0.0
    for stop in CHECKS:
        _, state = flt.advance(state, rec.between(before, stop), diagnostics=False)
        k, before = round(stop * RATE) - 1, stop
        estimate = Rotation.from_quat(state.q_nb[[1, 2, 3, 0]])
        error = np.r_[(estimate.inv() * r_nb[k]).as_rotvec(), bias[k] - state.gyr_bias]
        found.append(error @ np.linalg.solve(state.P, error))
    return found


@pytest.mark.slow
def test_mean_nees_lies_in_its_chi_square_interval():
    """Errors small enough for the linear model: 2 deg at the start, 1 m/s^2 and 5 deg a sample."""
    flt = Mekf(
        gyr_noise=2e-3,
        gyr_bias_noise=2e-4,
        acc_noise=0.1,
        mag_noise=0.02,
        std_tilt=0.03,
        std_gyr_bias=0.01,
        gate=np.inf,
    )
    runs = 150
    mean = np.mean([model_run(flt, seed) for seed in range(runs)], axis=0)
    low, high = chi2.ppf([0.005, 0.995], 6 * runs) / runs  # 5.30 and 6.75
    print(f"mean NEES of {runs} runs at {CHECKS} s: {mean.round(2)}, within {low:.2f}..{high:.2f}")
    assert np.all((mean > low) & (mean < high))


def test_one_run_is_no_surprise():
    """The quick form of the study above: four runs, far bounds, alarms at gross faults only."""
    flt = Mekf(
        gyr_noise=2e-3, gyr_bias_noise=2e-4, acc_noise=0.1, mag_noise=0.02, std_tilt=0.03,
        std_gyr_bias=0.01, gate=np.inf,
    )  # fmt: skip
    mean = np.mean([model_run(flt, seed) for seed in range(4)])
    low, high = chi2.ppf([1e-6, 1.0 - 1e-6], 6 * 4 * len(CHECKS)) / (4 * len(CHECKS))
    assert low < mean < high


def test_diagnostics_of_the_field_are_its_heading_and_nothing_empty():
    rec = demo.recording(duration=14.0)
    found = Mekf().run(rec).diagnostics
    assert found["mag"].labels == ("heading",)
    used = found["mag"].outcome == Outcome.ACCEPTED
    assert used.sum() > 100
    assert np.isfinite(found["mag"].innovation[used]).all()
    assert np.isfinite(found["mag"].sigma[used]).all()
    assert found["acc"].labels == ("x", "y", "z")


def test_first_field_after_a_long_wait_leaves_the_deviation_of_the_tilt():
    rec = demo.recording(duration=40.0)
    late = replace(rec, mag=rec.mag.between(30.0, 40.0))
    sol = Mekf().run(late)
    k = int(np.searchsorted(sol.t, late.mag.t[0]))
    before, after = sol.std_attitude_n[k - 1], sol.std_attitude_n[k]
    assert (after[:2] < 1.05 * before[:2]).all()
    assert after[2] == pytest.approx(Mekf().std_heading, rel=0.02)
