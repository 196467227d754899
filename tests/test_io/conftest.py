"""Recordings and files that the io tests write and read."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from small_logs import G, unit_rows

from strapdown.recording import (
    Airspeed,
    AttitudeReference,
    Baro,
    Encoder,
    Gnss,
    Imu,
    Mag,
    MountReference,
    PositionReference,
    Recording,
    Reference,
    Speed,
    Star,
    Temperature,
)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240531)


@pytest.fixture
def every_stream(rng: np.random.Generator) -> Recording:
    """All streams, each with its own axis, NaN samples, masks and optional fields."""

    def times(n: int, dt: float) -> np.ndarray:
        return 0.1 + np.cumsum(rng.uniform(0.5, 1.5, n)) * dt

    gyr = rng.normal(size=(400, 3))
    gyr[17] = np.nan
    acc = rng.normal(size=(400, 3)) + [0.0, 0.0, -G]
    mag = rng.normal(size=(90, 3)) * 1e-6 + [2e-5, 0.0, 4e-5]
    mag[3, 1] = np.nan
    q_ref = unit_rows(rng, 70)
    q_ref[5] = np.nan
    lla = np.column_stack(
        (rng.uniform(-1.5, 1.5, 12), rng.uniform(-3, 3, 12), rng.uniform(0, 900, 12))
    )
    return Recording(
        imu=Imu(t=times(400, 0.01), gyr=gyr, acc=acc, acc_real=rng.random(400) < 0.5),
        mag=Mag(t=times(90, 0.04), mag=mag),
        gnss=Gnss(
            t=times(12, 0.3),
            lla=lla,
            v_n=rng.normal(size=(12, 3)),
            std_position_n=rng.uniform(1, 5, (12, 3)),
            heading=rng.uniform(-3, 3, 12),
        ),
        baro=Baro(t=times(40, 0.1), pressure=rng.uniform(9e4, 1e5, 40)),
        temperature=Temperature(t=times(4, 1.0), temp_degc=rng.uniform(20, 30, 4)),
        airspeed=Airspeed(t=times(20, 0.2), airspeed=rng.uniform(0, 9, 20)),
        speed=Speed(t=times(20, 0.2), speed=rng.uniform(0, 9, 20)),
        encoder=Encoder(t=times(30, 0.1), angle=rng.uniform(-9, 9, 30)),
        star=Star(t=times(8, 0.5), q_nb=unit_rows(rng, 8)),
        reference=Reference(
            attitude=AttitudeReference(t=times(70, 0.05), q_nb=q_ref, valid=rng.random(70) < 0.7),
            position=PositionReference(t=times(12, 0.3), lla=lla, v_n=rng.normal(size=(12, 3))),
            mount=MountReference(t=times(5, 0.5), q_vb=unit_rows(rng, 5)),
            heading="magnetic",
        ),
        meta={"name": "all", "list": [1, 2.5, None, "x"], "epoch_utc": "2024-05-31T12:00:00Z"},
    )


@pytest.fixture
def write_text(tmp_path: Path) -> Callable[..., Path]:
    """Write lines to a file of a temporary folder."""

    def write(*lines: str, name: str = "log.csv") -> Path:
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write
