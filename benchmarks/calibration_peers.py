"""Calibrations beside imucal and magyc's two-step: the same simulated samples for both."""

import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from truth import triads  # noqa: E402 - the independent truths of the tests
from truth.triads import DPS, MG, TABLE_6_1, TABLE_6_2, UT, G  # noqa: E402

from strapdown import calibration as cal  # noqa: E402
from strapdown.errors import StrapdownError  # noqa: E402

PEERS = ROOT / ".venv/peers/bin/python"
DRAWS = 20
RATE_HZ, HOLD_S, TURN_S = 100.0, 5.0, 4.0
ACC_STD, GYR_STD = 0.038, 0.093 * DPS  # of a sample of the MPU-6050 at 100 Hz
SECTIONS = ("x_p", "x_a", "y_p", "y_a", "z_p", "z_a", "x_rot", "y_rot", "z_rot")
FIELD = 48.0 * UT
SOFT = np.array([[1.10, 0.06, -0.04], [0.06, 0.93, 0.05], [-0.04, 0.05, 1.02]])
HARD = np.array([23.0, -41.0, 17.0]) * UT
MAG_STD = 0.3 * UT


@dataclass
class Result:
    """What one program made of all draws of a case."""

    errors: dict[str, list[float]] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    failed: int = 0

    def add(self, seconds: float, **errors: float) -> None:
        """Add a draw."""
        self.seconds.append(seconds)
        for name, value in errors.items():
            self.errors.setdefault(name, []).append(value)


def ask(peer: str, draws: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what a peer says of the samples of each draw; in the units of its defaults."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{k}.npz" for k in range(len(draws))]
        for file, arrays in zip(files, draws, strict=True):
            np.savez(file, **arrays)
        script = Path(__file__).with_name("peer_calls.py")
        done = subprocess.run(
            [PEERS, script, peer, *files], capture_output=True, text=True, check=False
        )
    if done.returncode:
        raise RuntimeError(f"{peer}: {done.stderr.strip().splitlines()[-1]}")
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """Return what a call returns, and its processor time."""
    begun = time.process_time()
    found = call()
    return found, time.process_time() - begun


# --- six positions and three turns ------------------------------------------------------


def held_and_turned(seed: int, placing: float) -> dict[str, Any]:
    """Return the sections of a Ferraris calibration, each placed with an error [rad]."""
    rng = np.random.default_rng(seed)
    parts: dict[str, Any] = {"rate_hz": RATE_HZ, "gravity": G}
    ups = np.repeat(np.eye(3), 2, axis=0) * np.array([1.0, -1.0] * 3)[:, np.newaxis]
    for name, up in zip(SECTIONS, [*ups, *np.eye(3)], strict=True):
        turning = name.endswith("rot")
        n = round(RATE_HZ * (TURN_S if turning else HOLD_S))
        up = up + np.cross(placing * rng.standard_normal(3), up)
        up = up / np.linalg.norm(up)
        rate = -(2.0 * np.pi / TURN_S) * up if turning else np.zeros(3)
        acc = triads.distort(np.tile(G * up, (n, 1)), TABLE_6_1)
        gyr = triads.distort(np.tile(rate, (n, 1)), TABLE_6_2)
        parts[f"acc_{name}"] = acc + ACC_STD * rng.standard_normal((n, 3))
        parts[f"gyr_{name}"] = gyr + GYR_STD * rng.standard_normal((n, 3))
    return parts


def here_ferraris(parts: dict[str, Any]) -> tuple[Any, Any]:
    """Return both records of this package, from the same samples and the same knowledge."""
    means = np.array([parts[f"acc_{name}"].mean(axis=0) for name in SECTIONS[:6]])
    rates = np.zeros((9, 3))
    rates[6:] = -(2.0 * np.pi / TURN_S) * np.eye(3)
    gyr = [parts[f"gyr_{name}"] for name in SECTIONS]
    reference = np.repeat(rates, [len(part) for part in gyr], axis=0)
    return (
        cal.six_position(means, G),
        cal.against_reference("gyr", np.vstack(gyr), reference),
    )


def largest(matrix: Any, bias: Any, distortion: Any, size: float) -> float:
    """Return the largest error of a corrected vector of this size, any direction."""
    true = size * triads.even_directions(300)
    found = (triads.distort(true, distortion) - bias) @ np.asarray(matrix).T
    return float(np.linalg.norm(found - true, axis=1).max())


def ferraris(placing: float) -> tuple[Result, Result]:
    """Return the results here and of imucal."""
    draws = [held_and_turned(seed, placing) for seed in range(DRAWS)]
    here_ferraris(draws[0])  # the first call is slower
    here, beside = Result(), Result()
    for parts in draws:
        (acc, gyr), seconds = timed(lambda parts=parts: here_ferraris(parts))
        here.add(seconds, **_triads(acc.matrix, acc.bias, gyr.matrix, gyr.bias))
    deg = [{k: v / DPS if k.startswith("gyr_") else v for k, v in d.items()} for d in draws]
    for found in ask("imucal", deg):
        bias = np.array(found["gyr_bias"]) * DPS
        errors = _triads(found["acc_matrix"], found["acc_bias"], found["gyr_matrix"], bias)
        beside.add(found["seconds"], **errors)
    return here, beside


def _triads(acc_matrix: Any, acc_bias: Any, gyr_matrix: Any, gyr_bias: Any) -> dict[str, float]:
    """Return the errors of both sensors."""
    return {
        "acc_mg": largest(acc_matrix, acc_bias, TABLE_6_1, G) / MG,
        "gyr_dps": largest(gyr_matrix, gyr_bias, TABLE_6_2, 90 * DPS) / DPS,
    }


# --- hard and soft iron -----------------------------------------------------------------


def direction_error(matrix: Any, bias: Any) -> float:
    """Return the largest error of a corrected direction [deg]."""
    u = triads.even_directions(500)
    c = (FIELD * u @ SOFT.T + HARD - bias) @ np.asarray(matrix).T
    sine = np.linalg.norm(np.cross(c, u), axis=1)
    return float(np.degrees(np.arctan2(sine, np.sum(c * u, axis=1))).max())


def magnetometer(n: int, keep: float) -> tuple[Result, Result]:
    """Return the results here and of magyc's two-step, both told the field's strength."""
    draws = []
    for seed in range(DRAWS):
        u = triads.directions(3 * n, seed)
        u = u[u @ [0.48, -0.6, 0.64] > keep][:n]
        noise = np.random.default_rng(seed + 10_000).standard_normal(u.shape)
        draws.append(FIELD * u @ SOFT.T + HARD + MAG_STD * noise)
    cal.ellipsoid(draws[0], FIELD, hard_iron_limit=math.inf, direction_limit=math.inf)
    here, beside = Result(), Result()
    for mag in draws:
        try:
            record, seconds = timed(lambda mag=mag: cal.ellipsoid(mag, FIELD))
        except StrapdownError:
            here.failed += 1
        else:
            here.add(seconds, **_field(record.matrix, record.bias))
    gauss = 1e4  # the unit of the two-step's defaults
    reference, std = np.array([FIELD, 0.0, 0.0]) * gauss, MAG_STD * gauss
    arrays = [{"mag": mag * gauss, "reference": reference, "std": std} for mag in draws]
    for found in ask("magyc", arrays):
        if np.isfinite(found["matrix"]).all():
            errors = _field(found["matrix"], np.array(found["bias"]) / gauss)
            beside.add(found["seconds"], **errors)
        else:
            beside.failed += 1
    return here, beside


def _field(matrix: Any, bias: Any) -> dict[str, float]:
    """Return the errors of a magnetometer."""
    hard = float(np.linalg.norm(bias - HARD) / UT)
    return {"hard_ut": hard, "direction_deg": direction_error(matrix, bias)}


# --- the table --------------------------------------------------------------------------


def _text(result: Result, units: dict[str, str], fails: str) -> str:
    """Return one cell."""
    parts = []
    for key, values in result.errors.items():
        middle, most = statistics.median(values), max(values)
        parts.append(f"{middle:.3g} {units[key]} (largest {most:.3g})")
    if result.failed:
        parts.append(f"{result.failed} of {DRAWS} {fails}")
    if result.seconds:
        parts.append(f"{1e3 * statistics.median(result.seconds):.1f} ms")
    return "; ".join(parts)


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Yield the rows of the table: samples, here, the peer, what it found."""
    units = {"acc_mg": "mg", "gyr_dps": "deg/s"}
    for placing, text in ((0.0, "exact"), (0.01, "placed within 0.6 deg RMS")):
        here, beside = ferraris(placing)
        what = f"6 positions and 3 turns of 360 deg, {text}: largest error of 1 g, of 90 deg/s"
        yield what, _text(here, units, ""), "imucal", _text(beside, units, "failed")
    units = {"hard_ut": "µT", "direction_deg": "deg"}
    for n, keep, text in (
        (1000, -2.0, "all directions"),
        (5000, -2.0, "all directions"),
        (200, 0.0, "one hemisphere"),
        (1000, 0.0, "one hemisphere"),
    ):
        here, beside = magnetometer(n, keep)
        what = f"magnetometer, {n} samples with 0.3 µT, {text}: hard iron, largest direction"
        yield (
            what, _text(here, units, "refused"), "magyc `twostep_hsi`",
            _text(beside, units, "not finite"),
        )  # fmt: skip
