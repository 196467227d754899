"""Errors on BROAD beside those of `vqf`, trial by trial, as a Markdown table.

    python benchmarks/broad.py [FOLDER] [--latency S] [--filter NAME] [--magnet UT] [--sensitivity]

Both sides see the same samples, and the declared latency is on in both or off in both. The
metric is that of BROAD: the root mean square over the samples with movement. ``--magnet`` adds
what a magnet on the box does that comes with the motion and goes after 60 % of it. With
``--sensitivity`` each noise parameter is halved and doubled instead, and the change that would
be best on all trials but one is tried on that one: how much is there to gain by fitting?
"""

import argparse
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import vqf

ROOT = Path(__file__).resolve().parents[1]
os.environ.setdefault("STRAPDOWN_CACHE_DIR", str(ROOT / ".numba_cache"))

import strapdown as sd  # noqa: E402
from strapdown.evaluation import attitude_errors  # noqa: E402
from strapdown.rotation import quat_from_rotvec, quat_mul  # noqa: E402
from strapdown.units import DEG, UT  # noqa: E402

FOLDER = ROOT.parent / "shared/data/broad"
ENU_TO_NED = np.array([0.0, 0.5**0.5, 0.5**0.5, 0.0])
VARIED = (
    "gyr_noise", "gyr_rate_noise", "gyr_bias_walk", "gyr_bias_std", "gyr_scale_std", "acc_noise",
    "acc_bias_std", "velocity_std", "velocity_time", "mag_std", "mag_time", "mag_walk",
    "mag_delay_std", "tails", "rest_gyr", "rest_acc", "interval",
)  # fmt: skip
OUTLIER = "27"  # a phone lies on the box: its field stays, and weighs a third of the mean


def vqf_solution(rec, latency, offline, like):
    """Return what `vqf` estimates, as a solution, and the seconds it took."""
    imu, field = rec.imu, np.ascontiguousarray(rec.mag.mag * 1e6)
    gyr, acc = np.ascontiguousarray(imu.gyr), np.ascontiguousarray(imu.acc)
    interval = float(np.median(np.diff(imu.t)))
    begun = time.perf_counter()
    if offline:
        q_eb = vqf.offlineVQF(gyr, acc, field, interval)["quat9D"]
    else:
        q_eb = vqf.VQF(interval).updateBatch(gyr, acc, field)["quat9D"]
    seconds = time.perf_counter() - begun
    q_nb = quat_mul(np.broadcast_to(ENU_TO_NED, q_eb.shape), q_eb)
    if latency:
        q_nb = quat_mul(q_nb, quat_from_rotvec(gyr * latency))
    sol = sd.Solution(
        t=imu.t, q_nb=q_nb, status=like.status, filter="vqf", heading_reference="magnetic"
    )
    return sol, seconds


def with_magnet(rec, strength):
    """Return the recording with a constant field in b, in one direction, while it is there."""
    reference = rec.reference.attitude
    moving = reference.t[reference.valid]
    begin, end = moving[0] - 2.0, moving[0] + 0.6 * (moving[-1] - moving[0])
    there = (rec.mag.t > begin) & (rec.mag.t < end)
    field = rec.mag.mag + np.where(there[:, None], strength * 3.0**-0.5, 0.0)
    return replace(rec, mag=replace(rec.mag, mag=field))


def estimates(rec, flt, latency):
    """Yield column, solution and seconds of each candidate."""
    begun = time.perf_counter()
    sol = flt.run(rec, diagnostics=False)
    yield "causal", sol, time.perf_counter() - begun
    yield "vqf", *vqf_solution(rec, latency, False, sol)
    begun = time.perf_counter()
    smoothed = flt.smooth(rec)
    yield "smoothed", smoothed, time.perf_counter() - begun
    yield "vqf offline", *vqf_solution(rec, latency, True, sol)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    parser.add_argument("--latency", type=float, default=0.0, help="declared latency [s]")
    parser.add_argument("--filter", default="robust-eskf")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--magnet", type=float, default=0.0, help="strength of one [uT]")
    parser.add_argument("--sensitivity", action="store_true")
    args = parser.parse_args()
    changed = {k: float(v) for k, v in (item.split("=") for item in args.set)}
    flt = sd.estimators.create(args.filter, latency=args.latency, **changed)
    if args.sensitivity:
        sensitivity([sd.read(path) for path in sorted(args.folder.glob("*.mat"))], flt)
        return
    names, errors, honesty, cost = [], [], [], []
    for path in sorted(args.folder.glob("*.mat")):
        rec = with_magnet(sd.read(path), args.magnet * UT)
        names.append(path.stem[:2])
        rows, held = [], []
        list(estimates(rec, flt, args.latency)) if not cost else None  # the first call compiles
        for name, sol, seconds in estimates(rec, flt, args.latency):
            e = attitude_errors(sol, rec.reference)
            rows.append(
                [np.sqrt(np.mean(x**2)) / DEG for x in (e.total, e.heading, e.inclination)]
            )
            cost.append((name, seconds / len(sol)))
            if e.std_n is not None:
                held += [100.0 * e.inclination_within_3sigma, e.inclination_sigma_ratio]
        errors.append(rows)
        honesty.append(held)
    report(names, np.array(errors), np.array(honesty), cost)


def sensitivity(recordings, flt):
    """Print what halving and doubling each parameter does, and what choosing by it would gain."""
    changes = [(None, 1.0)] + [(name, factor) for name in VARIED for factor in (0.5, 2.0)]
    table = np.empty((len(changes), len(recordings), 2, 2))  # change, trial, causal or not, part
    for row, (name, factor) in zip(table, changes, strict=True):
        changed = replace(flt, **{name: factor * getattr(flt, name)}) if name else flt
        for cell, rec in zip(row, recordings, strict=True):
            for i, sol in enumerate((changed.run(rec, diagnostics=False), changed.smooth(rec))):
                e = attitude_errors(sol, rec.reference)
                cell[i] = [np.sqrt(np.mean(x**2)) / DEG for x in (e.total, e.inclination)]
    print("Mean RMSE, total / inclination [deg]\n\n| Change | causal | smoothed |\n|---|---|---|")
    for (name, factor), row in zip(changes, table.mean(axis=1), strict=True):
        what = f"{name} x {factor:g}" if name else "none"
        print(f"| {what} | " + " | ".join(f"{a:.2f} / {b:.2f}" for a, b in row) + " |")
    print("\n| Chosen on the other trials | causal | smoothed |\n|---|---|---|")
    held = []
    for trial in range(len(recordings)):
        others = np.delete(table[..., 0], trial, axis=1).mean(axis=1)
        held.append([table[others[:, i].argmin(), trial, i, 0] for i in range(2)])
    for what, row in (
        ("none changed", table[0, :, :, 0].mean(axis=0)),
        ("one", np.mean(held, axis=0)),
    ):
        print(f"| {what} | {row[0]:.2f} | {row[1]:.2f} |")


def report(names, errors, honesty, cost):
    """Print errors, stated deviations and times."""
    columns = list(dict.fromkeys(name for name, _ in cost))
    print(f"RMSE total / heading / inclination [deg]\n\n| Trial | {' | '.join(columns)} |")
    print("|---" * (len(columns) + 1) + "|")

    def line(name, rows):
        cells = (" / ".join(f"{value:.2f}" for value in row) for row in rows)
        print(f"| {name} | {' | '.join(cells)} |")

    for name, rows in zip(names, errors, strict=True):
        line(name, rows)
    line("mean", errors.mean(axis=0))
    keep = [name != OUTLIER for name in names]
    if not all(keep):
        line(f"mean without {OUTLIER}", errors[keep].mean(axis=0))
    line("worst", errors.max(axis=0))
    print("\n| Trial | causal: inside 3 sigma | sigma / needed | smoothed | sigma / needed |")
    print("|---|---|---|---|---|")
    for name, (inside, ratio, inside_s, ratio_s) in zip(names, honesty, strict=True):
        print(f"| {name} | {inside:.2f} % | {ratio:.2f} | {inside_s:.2f} % | {ratio_s:.2f} |")
    print("\n| | us per sample, median over the trials | times vqf |\n|---|---|---|")
    took = {c: 1e6 * np.median([s for name, s in cost if name == c]) for c in columns}
    for ours, theirs in zip(columns[::2], columns[1::2], strict=True):
        print(f"| {ours} | {took[ours]:.2f} | {took[ours] / took[theirs]:.2f} |")
        print(f"| {theirs} | {took[theirs]:.2f} | |")


if __name__ == "__main__":
    main()
