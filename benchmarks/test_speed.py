"""Speed beside the packages `vqf` and `imufusion`, and of the commands."""

import os
import statistics
import subprocess
import sys

import imufusion
import numpy as np
import pytest
import vqf

import strapdown as sd
from strapdown.constants import G0
from strapdown.units import DPS, UT

PER_CALL = 2_000  # samples of a Python loop


def ns(seconds: float, samples: int) -> str:
    return f"{seconds / samples * 1e9:.0f} ns"


def us(seconds: float, calls: int) -> str:
    return f"{seconds / calls * 1e6:.2f} us"


@pytest.fixture(scope="module")
def vqf_batch(recording):
    imu, mag = recording.imu, recording.mag
    gyr, acc, field = (np.ascontiguousarray(a) for a in (imu.gyr, imu.acc, mag.mag / UT))
    return lambda: vqf.VQF(0.01).updateBatch(gyr, acc, field)


@pytest.mark.parametrize(("name", "goal"), [("madgwick", 0.35), ("mekf", 2.5)])
def test_run_over_nine_axes(name, goal, recording, vqf_batch, take_turns, table):
    flt = sd.estimators.create(name)
    times = take_turns(here=lambda: flt.run(recording, diagnostics=False), vqf=vqf_batch)
    ratio, n = times["here"] / times["vqf"], len(recording.imu)
    table(
        f"{name} `run`, 9 axes, per sample",
        ns(times["here"], n),
        f"vqf `updateBatch` {ns(times['vqf'], n)}: {ratio:.2f} times",
        f"{goal:g} times",
    )
    assert ratio <= goal


@pytest.mark.parametrize("name", [e.name for e in sd.estimators.entries() if not e.needs])
def test_run_of_every_estimator_stays_below_6_us(name, recording, take_turns, table):
    flt = sd.estimators.create(name)
    n = len(recording.imu)
    times = take_turns(5, here=lambda: flt.run(recording))
    table(f"{name} `run` with diagnostics, per sample", ns(times["here"], n), "", "6000 ns")
    assert times["here"] / n < 6e-6


def test_kalman_filters_of_the_theses_cost_about_the_same(recording, take_turns, table):
    """Two-stage, indirect with truncated propagation, and both AHRS: within a factor of two."""
    flts = {
        "two-stage": sd.attitude.TwoStage(),
        "indirect-ekf truncated": sd.attitude.IndirectEkf(propagation="truncated"),
        "standard-ahrs": sd.attitude.StandardAhrs(),
        "multi-mode-ahrs": sd.attitude.MultiModeAhrs(),
    }
    runs = {
        name: lambda flt=flt: flt.run(recording, diagnostics=False) for name, flt in flts.items()
    }
    times = take_turns(
        5, **{name.replace("-", "_").replace(" ", "_"): r for name, r in runs.items()}
    )
    ratio, n = max(times.values()) / min(times.values()), len(recording.imu)
    table(
        "two-stage, indirect-ekf truncated, standard-ahrs, multi-mode-ahrs `run`, per sample",
        ", ".join(ns(seconds, n) for seconds in times.values()),
        f"dearest over cheapest: {ratio:.2f} times",
        "2 times",
    )
    assert ratio <= 2.0


@pytest.mark.parametrize("name", ["madgwick", "mekf"])
def test_tracker_from_python(name, recording, take_turns, table):
    imu, field = recording.imu, recording.mag.mag
    t = imu.t[:PER_CALL].tolist()
    ours = list(zip(t, imu.gyr, imu.acc, field, strict=False))
    theirs = list(zip(imu.gyr / DPS, imu.acc / G0, field / UT, strict=True))[:PER_CALL]

    def track() -> None:
        tracker = sd.estimators.create(name).tracker()
        for t_k, gyr, acc, mag in ours:
            tracker.update(t_k, gyr, acc, mag)
            tracker.q_nb  # noqa: B018 - reading it is part of the work

    def fusion() -> None:
        ahrs = imufusion.Ahrs()
        for gyr, acc, mag in theirs:
            ahrs.update(gyr, acc, mag)
            ahrs.get_quaternion()

    times = take_turns(here=track, imufusion=fusion)
    ratio = times["here"] / times["imufusion"]
    goal = "2 times" if name == "madgwick" else ""
    table(
        f"{name} `tracker.update` from Python",
        us(times["here"], PER_CALL),
        f"imufusion `update`, `get_quaternion` {us(times['imufusion'], PER_CALL)}: "
        f"{ratio:.2f} times",
        goal,
    )
    if goal:
        assert ratio <= 2.0


def test_tracker_of_the_robust_filter_from_python(recording, take_turns, table):
    rows = list(
        zip(
            recording.imu.t[:PER_CALL].tolist(), recording.imu.gyr, recording.imu.acc,
            recording.mag.mag, strict=False,
        )
    )  # fmt: skip

    def track() -> None:
        tracker = sd.estimators.create("robust-eskf").tracker()
        for t, gyr, acc, mag in rows:
            tracker.update(t, gyr, acc, mag)

    times = take_turns(here=track)
    table("robust-eskf `tracker.update` from Python", us(times["here"], PER_CALL), "", "4.5 us")
    assert times["here"] / PER_CALL <= 4.5e-6


@pytest.mark.parametrize(("name", "goal"), [("madgwick", 12), ("mekf", 12), ("robust-eskf", 10)])
def test_pure_step_from_python(name, goal, recording, take_turns, table):
    flt, imu = sd.estimators.create(name), recording.imu
    rows = list(zip(imu.t[:PER_CALL].tolist(), imu.gyr, imu.acc, recording.mag.mag, strict=False))

    def steps() -> None:
        state = flt.init()
        for t, gyr, acc, mag in rows:
            state = flt.step(state, t, gyr, acc, mag=mag)

    times = take_turns(here=steps)
    table(f"{name} `step` from Python", us(times["here"], PER_CALL), "", f"{goal} us")
    assert times["here"] / PER_CALL <= goal * 1e-6


def seconds(*arguments: str) -> float:
    """Processor time of a process."""
    before = os.times()
    subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
    after = os.times()
    return sum(
        getattr(after, kind) - getattr(before, kind)
        for kind in ("children_user", "children_system")
    )


def test_bare_import(table):
    timed = "import time; a = time.process_time(); import {}; print(time.process_time() - a)"

    def run(module: str) -> float:
        code = [sys.executable, "-c", timed.format(module)]
        return float(subprocess.run(code, check=True, capture_output=True, text=True).stdout)

    pairs = [(run("strapdown"), run("numpy")) for _ in range(11)]
    here, numpy = (statistics.median(column) for column in zip(*pairs, strict=True))
    table(
        "`import strapdown`",
        f"{here * 1e3:.0f} ms",
        f"`import numpy` {numpy * 1e3:.0f} ms: {here / numpy:.2f} times",
        "1.3 times",
    )
    assert here <= 1.3 * numpy


@pytest.mark.parametrize(
    ("verb", "options", "goal"), [("info", (), 1.5), ("run", ("-o", "out"), 4.0)]
)
def test_commands_on_a_benchmark_trial(
    verb, options, goal, broad_02, tmp_path, table, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    command = ("-m", "strapdown", verb, os.fspath(broad_02), *options)
    seconds(*command)  # the first call compiles
    took = statistics.median(seconds(*command) for _ in range(5))
    table(f"second `strapdown {verb}`, 53,240 samples", f"{took:.2f} s", "", f"{goal:g} s")
    assert took < goal
