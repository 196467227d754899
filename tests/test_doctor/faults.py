"""Logs spoilt on purpose, and what puts them right again; no code of the doctor is used."""

import itertools
from dataclasses import replace

import numpy as np

from strapdown.recording import Recording


def signed_permutations() -> list[np.ndarray]:
    """All 48, the identity first."""
    out = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            S = np.zeros((3, 3))
            for row in range(3):
                S[row, order[row]] = signs[row]
            out.append(S)
    return out


def spoilt(rec: Recording, sensor: str, S: np.ndarray | float) -> Recording:
    """The recording with one sensor's samples multiplied by a matrix or a factor."""
    matrix = S * np.eye(3) if np.isscalar(S) else S
    if sensor == "mag":
        return replace(rec, mag=replace(rec.mag, mag=rec.mag.mag @ matrix.T))
    samples = getattr(rec.imu, sensor) @ matrix.T
    return replace(rec, imu=replace(rec.imu, **{sensor: samples}))


def remedy(sensor: str, S: np.ndarray) -> str:
    """The option of `read` that undoes ``v_recorded = S v``."""
    names = []
    for column in range(3):  # the true axis is the recorded one that it went to
        row = int(np.flatnonzero(S[:, column])[0])
        names.append(("-" if S[row, column] < 0 else "") + "xyz"[row])
    return f"{sensor}={','.join(names)}"
