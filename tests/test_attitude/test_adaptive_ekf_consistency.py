"""Thesis E's attitude filter is off by what its covariance says: NEES and NIS over 100 runs."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from truth import hand

from strapdown.attitude import AdaptiveEkf
from strapdown.recording import Imu, Mag, Recording

G = 9.80665
SIGMA, N, WALK, B0 = 0.02, 0.002, 1e-4, 0.02
RUNS = 100


def consistent(seed, r_nb, t, rates):
    """Errors over sigmas at the end, and of the residuals, of one run with honest noise.

    The field is level, so that tilt and heading are measured equally well from any attitude:
    to 0.02 rad, by force and field alike.
    """
    rng = np.random.default_rng(seed)
    h = 1.0 / 25.0
    bias = B0 * rng.standard_normal(3)
    bias = bias + np.cumsum(WALK * np.sqrt(h) * rng.standard_normal(rates.shape), axis=0)
    gyr = rates + bias + N / np.sqrt(h) * rng.standard_normal(rates.shape)
    acc = r_nb.inv().apply([0, 0, -G]) + SIGMA * G * rng.standard_normal(rates.shape)
    mag = r_nb.inv().apply([3e-5, 0, 0]) + SIGMA * 3e-5 * rng.standard_normal(rates.shape)
    flt = AdaptiveEkf(
        gyr_noise=N, bias_walk=(WALK,) * 3, quat_std=(SIGMA / 2,) * 3, k_acc=(0.0,) * 3,
        base_rate=(1.0,) * 3, method="master-slave", std_attitude=SIGMA / 2, std_gyr_bias=B0,
        reset_every=np.inf, gravity=G, limit=3.0,
    )  # fmt: skip
    rec = Recording(imu=Imu(t=t, gyr=gyr, acc=acc), mag=Mag(t=t, mag=mag))
    sol, state = flt.advance(flt.init(), rec)
    a, b, c, d = state.q_nb
    to_angles = np.zeros((6, 7))
    to_angles[:3, :4] = 2.0 * np.array([[-b, a, -d, c], [-c, d, a, -b], [-d, -c, b, a]])
    to_angles[3:, 4:] = np.eye(3)
    P = to_angles @ state.P @ to_angles.T
    e = np.concatenate((hand.rotvec_off(sol.q_nb[-1:], r_nb[-1:])[0], bias[-1] - state.gyr_bias))
    found = sol.diagnostics["attitude"]
    return e @ np.linalg.solve(P, e), (found.innovation / found.sigma) ** 2


def test_error_and_residuals_are_what_the_covariance_says():
    """NEES of attitude on the manifold and bias, NIS of three angles, inside 99 %."""
    t = np.arange(1, 751) / 25.0
    rates = np.stack([0.6 * np.sin(0.5 * t + i) + 0.2 * np.sin(1.7 * t) for i in range(3)], axis=1)
    rates[0] = 0.0
    turned = [Rotation.from_euler("ZYX", [0.4, 0.1, -0.2])]
    for w in rates[1:]:
        turned.append(turned[-1] * Rotation.from_rotvec(w / 25.0))
    r_nb = Rotation.concatenate(turned)
    runs = [consistent(seed, r_nb, t, rates) for seed in range(RUNS)]
    nees = sum(run[0] for run in runs)
    assert chi2.ppf(0.005, 6 * RUNS) < nees < chi2.ppf(0.995, 6 * RUNS)
    squares = np.concatenate([run[1] for run in runs])
    low, high = chi2.ppf([0.005, 0.995], squares.size)
    assert low < squares.sum() < high
