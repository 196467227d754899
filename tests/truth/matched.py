"""Recordings of which the model of a filter is true: noises, bias and rates of stated sizes.

The rate is a first-order process; gyroscope, accelerometer and field have white noise, the field
in its direction. Given to a filter with the same numbers, its errors and innovations are as large
as it says.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from strapdown.recording import Imu, Mag, Recording

G = 9.80665
DIP = 1.07
STRENGTH = 4.7e-5
FIELD_N = STRENGTH * np.array([np.cos(DIP), 0.0, np.sin(DIP)])


@dataclass(frozen=True)
class Sizes:
    """Densities and deviations, in SI; small enough for a linearised filter."""

    gyr_noise: float = 2e-3
    gyr_bias_noise: float = 0.0
    std_gyr_bias: float = 0.0
    acc_noise: float = 0.1
    mag_noise: float = 0.01  # rad/sqrt(Hz)
    std_tilt: float = 0.02
    rate_std: float = 1.0
    rate_time: float = 0.5
    rate_hz: float = 50.0
    seconds: float = 6.0
    mag_every: int = 2


def draw(sizes, seed):
    """Recording, true attitudes, rates and biases, and an attitude to start from."""
    rng = np.random.default_rng(seed)
    n, dt = round(sizes.seconds * sizes.rate_hz), 1.0 / sizes.rate_hz

    def white(density, rows, interval=dt):
        return density / np.sqrt(interval) * rng.standard_normal((rows, 3))

    a = np.exp(-dt / sizes.rate_time)
    omega = sizes.rate_std * rng.standard_normal((n, 3))
    for k in range(1, n):
        omega[k] = a * omega[k - 1] + np.sqrt(1 - a**2) * omega[k]
    bias = sizes.std_gyr_bias * rng.standard_normal(3)
    bias = bias + dt * np.cumsum(white(sizes.gyr_bias_noise, n), axis=0)
    turns = [Rotation.random(random_state=rng)]
    for turn in Rotation.from_rotvec(omega[1:] * dt):
        turns.append(turns[-1] * turn)
    r_nb = Rotation.concatenate(turns)
    t, rows = dt * np.arange(n), slice(None, None, sizes.mag_every)
    field = r_nb[rows].inv().apply(FIELD_N / STRENGTH)
    field = field + white(sizes.mag_noise, len(field), sizes.mag_every * dt)
    rec = Recording(
        imu=Imu(
            t=t,
            gyr=omega + bias + white(sizes.gyr_noise, n),
            acc=r_nb.inv().apply([0.0, 0.0, -G]) + white(sizes.acc_noise, n),
        ),
        mag=Mag(t=t[rows], mag=STRENGTH * field),
    )
    off = Rotation.from_rotvec(sizes.std_tilt * rng.standard_normal(3))
    return rec, r_nb, omega, bias, off.inv() * r_nb[0]


def degrees_of_freedom(sol):
    """Sum of the squared innovations over their variances, and their number."""
    z = [(d.innovation / d.sigma)[np.isfinite(d.sigma)] for d in sol.diagnostics.values()]
    z = np.concatenate(z)
    return float(z @ z), len(z)


def interval(degrees, runs=1, share=0.99):
    """Where the mean over `runs` of a chi-square variable lies."""
    edge = 0.5 * (1.0 - share)
    return chi2.ppf([edge, 1.0 - edge], degrees * runs) / runs
