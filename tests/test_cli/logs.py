"""Small logs in files, sound and broken in one way each."""

from pathlib import Path

import numpy as np

HEADER = (
    "t_s,gyr_x_dps,gyr_y_dps,gyr_z_dps,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,mag_x_ut,mag_y_ut,mag_z_ut"
)
COUNT = 300


def table(count: int = COUNT, seed: int = 5) -> np.ndarray:
    """Rows of a box that lies almost level, z up, and turns slowly about its z axis."""
    rng = np.random.default_rng(seed)
    t = np.arange(count) * 0.01
    rows = np.empty((count, 10))
    rows[:, 0] = t
    rows[:, 1:4] = (0.1, -0.2, 20.0) + 0.05 * rng.standard_normal((count, 3))
    rows[:, 4:7] = (0.3, -0.2, 9.8) + 0.02 * rng.standard_normal((count, 3))
    angle = np.deg2rad(20.0) * t
    rows[:, 7] = 20.0 * np.cos(angle)
    rows[:, 8] = -20.0 * np.sin(angle)
    rows[:, 9] = -40.0
    return rows


def text(rows: np.ndarray, header: str = HEADER) -> str:
    """CSV of rows."""
    lines = (",".join(f"{x:.6g}" for x in row) for row in rows)
    return "\n".join([header, *lines]) + "\n"


def write(path: Path, rows: np.ndarray | None = None, header: str = HEADER) -> Path:
    """Write a CSV log and return its path."""
    path.write_text(text(table() if rows is None else rows, header))
    return path
