"""Noises of known coefficients, in the sense of IEEE Std 952 (two-sided densities)."""

import numpy as np
from scipy.fft import irfft, next_fast_len


def power_law(rng, n, fs, density, exponent):
    """Stationary Gaussian noise of two-sided density ``density * f**exponent`` up to fs / 2.

    Made on a circle four times as long, so that its ends do not meet.
    """
    length = next_fast_len(4 * n)
    f = np.arange(length // 2 + 1) * fs / length
    shape = np.zeros_like(f)
    shape[1:] = density * f[1:] ** exponent
    z = rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)
    return irfft(z * np.sqrt(0.5 * shape * fs * length), length)[:n]


def at_rest(rng, n, fs, N=0.0, B=0.0, K=0.0, R=0.0, Q=0.0, bias=0.0):
    """Samples of a sensor at rest: white noise, flicker, random walk, ramp, quantised angle."""
    y = np.full(n, float(bias))
    if N:
        y += N * np.sqrt(fs) * rng.standard_normal(n)
    if B:
        y += power_law(rng, n, fs, B * B / (2.0 * np.pi), -1.0)
    if K:
        y += K / np.sqrt(fs) * np.cumsum(rng.standard_normal(n))
    if R:
        y += R * np.arange(n) / fs
    if Q:
        y += Q * fs * np.diff(rng.standard_normal(n + 1))
    return y
