"""The loosely coupled filter on the road drives: outages, start, consistency, heading, speed.

Usage: python benchmarks/drives.py [--turned] [--varied] [--starts] [--data FOLDER]

`--turned` repeats the outages with the box turned about other axes, by rotating its raw data.
`--varied` repeats them with the logs changed as another drive or a worse sensor would be.
`--starts` cuts each drive every 30 s while it moves, and compares the heading that the filter
begins with, and later ones, with the smoothed heading of the whole drive.
"""

import argparse
import time
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

import strapdown as sd
from strapdown.evaluation import mount_at
from strapdown.evaluation.outages import outage_study
from strapdown.navigation import LooselyCoupled
from strapdown.navigation.loosely_coupled import STATES
from strapdown.recording import Imu
from strapdown.rotation import dcm_from_rotvec, quat_conj, quat_mul, rpy_from_quat
from strapdown.solution import Outcome, Status

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "drives"
TURNS_DEG = ((0, 0, 80), (0, 80, 0), (80, 0, 0), (180, 0, 0), (37, -120, 65))


def error_table(drives, smooth):
    """Print median and 95 % per length, together and for each drive."""
    study = outage_study(drives, LooselyCoupled(), smooth=smooth)
    print("\n" + ("smoothed, middle of the window" if smooth else "causal, end of the window"))
    for row in study.summary():
        print(
            f"  {row['length_s']:3.0f} s  n {row['n']}  without solution {row['without_solution']}"
            f"  median {row['median_m']:.2f} m  95 % {row['p95_m']:.2f} m"
        )
    for name, _ in drives:
        cells = []
        for length in (10.0, 30.0, 60.0):
            of = [
                w.horizontal_error_m
                for w in study.windows
                if w.drive == name and w.length_s == length
            ]
            cells.append(f"{np.median(of):5.2f} / {max(of):5.2f} ({len(of)})" if of else "-")
        print(f"  {name:34s} median / largest (n)  " + "   ".join(cells))
    if not smooth:
        for s in study.starts:
            print(f"  {s.drive:34s} navigates {s.first_solution_s - s.first_motion_s:5.1f} s "
                  "after the first motion")  # fmt: skip


def consistency(name, rec):
    """Print innovations, heading and full-GNSS position of one drive."""
    sol = LooselyCoupled().run(rec)
    cells = []
    for key in ("gnss_position", "gnss_velocity"):
        rows = sol.diagnostics[key]
        taken = rows.outcome == Outcome.ACCEPTED
        nis = np.mean((rows.innovation[taken] / rows.sigma[taken]) ** 2)
        share = 100 * taken.mean()
        z = (rows.innovation / rows.sigma)[taken]
        lag = [np.corrcoef(z[1:, i], z[:-1, i])[0, 1] for i in range(3)]
        lags = " ".join(f"{c:+.2f}" for c in lag)
        cells.append(f"{key[5:]} NIS per axis {nis:.2f}, lag one {lags}, {share:.1f} % taken")
    errors = sd.evaluation.navigation_errors(sol, rec.reference)
    attitude = rec.reference.attitude
    k = np.clip(np.searchsorted(sol.t, attitude.t), 0, len(sol.t) - 1)
    valid = np.ones(len(attitude), bool) if attitude.valid is None else attitude.valid
    late = valid & ((sol.status[k] & Status.ALIGNING) == 0)
    late &= attitude.t > attitude.t[np.argmax(valid)] + 60.0
    q_nv = quat_mul(sol.q_nb[k], quat_conj(sol.q_vb[k]))
    mount = mount_at(rec.reference.mount, attitude.t)
    d = rpy_from_quat(q_nv) - rpy_from_quat(quat_mul(attitude.q_nb, quat_conj(mount)))
    d = (d + np.pi) % (2 * np.pi) - np.pi
    roll, pitch, yaw = np.degrees(np.std(d[late], axis=0))
    rms = float(np.sqrt(np.mean(errors.horizontal**2)))
    print(f"  {name:34s} {'; '.join(cells)}; roll, pitch, heading {roll:.2f} {pitch:.2f} "
          f"{yaw:.2f} deg; horizontal {rms:.2f} m")  # fmt: skip


def best(call, times=5):
    """Least process time of a call [s]."""
    call()
    spent = []
    for _ in range(times):
        start = time.process_time()
        call()
        spent.append(time.process_time() - start)
    return min(spent)


def speed(rec):
    """Print microseconds per IMU sample."""
    n = len(rec.imu) / 1e6
    plain = best(lambda: LooselyCoupled().run(rec)) / n
    core = best(lambda: LooselyCoupled(states=()).run(rec)) / n
    full = best(lambda: LooselyCoupled(states=STATES).run(rec)) / n
    smooth = best(lambda: LooselyCoupled().smooth(rec), 3) / n
    print(f"\nus per IMU sample: 15 states {core:.2f}, default {plain:.2f}, all {full:.2f}, "
          f"smoother {smooth:.2f} ({smooth / plain:.1f} times the filter)")  # fmt: skip


def turned(rec, rotvec_deg):
    """The recording of a box that is turned in the car."""
    C = dcm_from_rotvec(np.radians(rotvec_deg))
    imu = rec.imu
    return replace(rec, imu=Imu(t=imu.t, gyr=imu.gyr @ C.T, acc=imu.acc @ C.T))


def _with_imu(rec, gyr=0.0, acc=0.0, scale=1.0):
    imu = rec.imu
    return replace(rec, imu=replace(imu, gyr=scale * imu.gyr + gyr, acc=imu.acc + acc))


def _with_sigmas(rec, factor):
    fixes = rec.gnss
    return replace(
        rec,
        gnss=replace(
            fixes,
            std_position_n=factor * fixes.std_position_n,
            std_velocity_n=factor * fixes.std_velocity_n,
        ),
    )


def _every_second_fix(rec):
    fixes = rec.gnss
    names = (f.name for f in fields(fixes) if f.name != "meta")
    kept = {n: v[::2] for n in names if isinstance(v := getattr(fixes, n), np.ndarray)}
    return replace(rec, gnss=replace(fixes, **kept))


def _noisy(rec):
    rng = np.random.default_rng(0)
    shape = rec.imu.gyr.shape
    return _with_imu(rec, 2e-3 * rng.standard_normal(shape), 0.1 * rng.standard_normal(shape))


# As another drive, another receiver or a worse sensor would have it.
VARIATIONS = {
    "as recorded": lambda rec: rec,
    "the first 90 s cut off": lambda rec: rec.between(rec.imu.t[0] + 90.0, rec.imu.t[-1]),
    "gyroscope off by 1 deg/s more": lambda rec: _with_imu(rec, np.radians([1.0, -1.0, 1.0])),
    "accelerometer off by 0.3 m/s^2 more": lambda rec: _with_imu(rec, acc=[0.3, -0.2, 0.3]),
    "gyroscope's scale off by 1 %": lambda rec: _with_imu(rec, scale=1.01),
    "noise of 0.11 deg/s and 0.1 m/s^2 added": _noisy,
    "stated sigmas times three": lambda rec: _with_sigmas(rec, 3.0),
    "stated sigmas over three": lambda rec: _with_sigmas(rec, 1.0 / 3.0),
    "every second fix": _every_second_fix,
}


def varied(drives):
    """Print the outages of changed logs, and the slowest start."""
    print("\n| Change | 10 s | 30 s | 60 s | slowest start |\n|---|---|---|---|---|")
    for what, change in VARIATIONS.items():
        study = outage_study([(n, change(r)) for n, r in drives], LooselyCoupled())
        cells = " | ".join(f"{r['median_m']:.2f} / {r['p95_m']:.2f}" for r in study.summary())
        slowest = max(s.first_solution_s - s.first_motion_s for s in study.starts)
        print(f"| {what} | {cells} | {slowest:.1f} s |")


def starts(drives):
    """Print how wrong heading is after beginning in motion, and how often by more than stated."""
    flt, after = LooselyCoupled(), (0.0, 10.0, 30.0, 60.0)
    off, ratio = [], []
    for _, rec in drives:
        whole = flt.smooth(rec)
        aligned = whole.t[np.argmax((whole.status & Status.ALIGNING) == 0)]
        for cut in np.arange(aligned + 60.0, rec.imu.t[-1] - 60.0, 30.0):
            part = rec.between(cut, min(cut + 120.0, rec.imu.t[-1]))
            if np.hypot(*part.gnss.v_n[:6, :2].T).mean() < 2.0:
                continue
            sol = flt.run(part, diagnostics=False)
            known = (sol.status & Status.ALIGNING) == 0
            if not known.any():
                print(f"cut at {cut:.0f} s: no start in {sol.t[-1] - cut:.0f} s")
                continue
            rows = np.searchsorted(sol.t, sol.t[np.argmax(known)] + np.array(after))
            rows = np.minimum(rows, len(sol.t) - 1)
            d = quat_mul(
                sol.q_nb[rows], quat_conj(whole.q_nb[np.searchsorted(whole.t, sol.t[rows])])
            )
            angle = np.abs((2 * np.arctan2(d[:, 3], d[:, 0]) + np.pi) % (2 * np.pi) - np.pi)
            off.append(np.degrees(angle))
            ratio.append(angle / sol.std_attitude_n[rows, 2])
    off, ratio = np.array(off), np.array(ratio)
    print(f"\n{len(off)} starts in motion\n| after | median | above 25 deg | above 3 sigma |")
    print("|---|---|---|---|")
    for t, angle, z in zip(after, off.T, ratio.T, strict=True):
        print(
            f"| {t:.0f} s | {np.median(angle):.1f} deg | {np.sum(angle > 25)} | {np.sum(z > 3)} |"
        )


def main():
    """Run what the arguments ask for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--turned", action="store_true")
    parser.add_argument("--varied", action="store_true")
    parser.add_argument("--starts", action="store_true")
    options = parser.parse_args()
    drives = [(p.name, sd.read(p)) for p in sorted(options.data.iterdir()) if p.is_dir()]
    error_table(drives, smooth=False)
    error_table(drives, smooth=True)
    print("\nfull GNSS (attitude: standard deviation a minute after the reference is valid)")
    for name, rec in drives:
        consistency(name, rec)
    speed(max((rec for _, rec in drives), key=lambda rec: len(rec.imu)))
    if options.turned:
        for turn in TURNS_DEG:
            study = outage_study([(n, turned(r, turn)) for n, r in drives], LooselyCoupled())
            rows = "  ".join(
                f"{r['length_s']:.0f} s {r['median_m']:.2f}/{r['p95_m']:.2f} m"
                for r in study.summary()
            )
            print(f"box turned by {turn} deg: {rows}")
    if options.varied:
        varied(drives)
    if options.starts:
        starts(drives)


if __name__ == "__main__":
    main()
