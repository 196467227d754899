"""Write docs/tables/calibration.md: what calibrations recover from simulated sensors."""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from truth import triads as truth  # noqa: E402 - the independent truths of the tests
from truth.triads import DPS, MG, TABLE_6_1, TABLE_6_2, UT, G  # noqa: E402

from strapdown import calibration as cal  # noqa: E402
from strapdown.errors import StrapdownError  # noqa: E402

DRAWS = 100
FIELD = 48.0 * UT
SOFT = np.array([[1.10, 0.06, -0.04], [0.06, 0.93, 0.05], [-0.04, 0.05, 1.02]])
HARD = np.array([23.0, -41.0, 17.0]) * UT
WELL_SPREAD = np.vstack(
    (np.eye(3), -np.eye(3), np.array([[1, 1, -1], [-1, 1, 1], [1, -1, 1]]) / np.sqrt(3))
)


def values(record):
    """Return parameters and their standard deviations."""
    return np.array([(p.value, p.std) for p in record.parameters]).T


def accelerometer(poses, noise, seed):
    """Return the record of random poses with noise on their means."""
    true = G * truth.directions(poses, seed + 1000)
    noise = noise * np.random.default_rng(seed).standard_normal(true.shape)
    return cal.accelerometer_from_poses(truth.distort(true, TABLE_6_1) + noise)


def bound(poses, seed):
    """Return the Cramér-Rao bound of random poses with 0.5 mg."""
    return truth.bound(G * truth.directions(poses, seed), TABLE_6_1, 0.5 * MG)


def share(bounds, limits):
    """Return how often errors of these covariances lie within limits, all at once."""
    rng = np.random.default_rng(1)
    draws = (rng.multivariate_normal(np.zeros(9), b, 2000) for b in bounds)
    return np.mean([(np.abs(z) < limits).all(axis=1).mean() for z in draws])


def accelerometer_rows():
    """Return the rows of the reference-free accelerometer calibration."""
    errors = [values(accelerometer(39, 0.5 * MG, s))[0] - TABLE_6_1 for s in range(DRAWS)]
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    limits = np.array([0.3 * MG] * 3 + [6e-4] * 6)
    inside = np.abs(errors) < limits
    bounds = [bound(39, s + 1000) for s in range(DRAWS)]
    least = np.sqrt(np.mean([np.diag(b) for b in bounds], axis=0))
    yield (
        "accelerometer, 39 random poses, 0.5 mg on the means",
        f"RMS error of biases {rms[:3].max() / MG:.2f} mg, of scales {rms[3:6].max():.1e}, of "
        f"angles {rms[6:].max():.1e} rad: {np.mean(rms / least):.2f} times the Cramér-Rao bound; "
        f"within 0.3 mg and 6e-4: {100 * inside.mean():.0f} % of "
        f"the parameters, all nine in {100 * inside.all(axis=1).mean():.0f} % of the draws, where "
        f"an estimator at the bound has {100 * share(bounds, limits):.0f} %",
    )
    for poses in (60, 100):
        bounds = [bound(poses, s) for s in range(20)]
        yield (
            f"the same bound for {poses} random poses",
            f"all nine within the limits in {100 * share(bounds, limits):.0f} %",
        )
    for per_pose, text in ((100, "per sample, 100 samples a pose"), (1, "on the means")):
        norms = [accelerometer(24, 1e-3 / per_pose**0.5, s).residual_rms for s in range(DRAWS)]
        yield (
            f"accelerometer, 24 random poses, 1e-3 m/s² {text}",
            f"residual of the norm {np.mean(norms):.1e} m/s² (largest {max(norms):.1e})",
        )


def hand_held_rows():
    """Return the rows of the continuous logs."""
    for tremor in (0.05, 0.15):
        counts, errors, residuals, before = [], [], [], []
        for seed in range(5):
            t, gyr, acc, _, _ = truth.hand_held_log(seed=seed, tremor=tremor * DPS)
            poses = cal.find_poses(t, gyr, acc)
            record = cal.accelerometer_from_poses(poses.acc, std=poses.acc_std)
            counts.append(len(poses))
            errors.append(np.abs(values(record)[0] - TABLE_6_1))
            residuals.append(record.residual_rms / MG)
            before.append(record.residual_rms_before / MG)
        worst = np.max(errors, axis=0)
        yield (
            f"5 logs of 10 min with 30 hand-held poses, tremor {tremor} deg RMS at 9 Hz",
            f"{min(counts)} to {max(counts)} poses found; largest error of biases "
            f"{worst[:3].max() / MG:.2f} mg, of scales and angles {worst[3:].max():.1e}; norm "
            f"before {min(before):.0f} to {max(before):.0f} mg, after {min(residuals):.2f} to "
            f"{max(residuals):.2f} mg",
        )


def gyro_rows():
    """Return the rows of the turntable."""
    rates = np.repeat([200 * DPS, 270 * DPS], 9)
    cases = (("well spread", WELL_SPREAD), ("within 34 deg", truth.even_directions(100)[:9]))
    for name, axes in cases:
        true = rates[:, np.newaxis] * np.tile(axes, (2, 1))
        ratios, stds = [], []
        for seed in range(DRAWS):
            noise = 0.02 * DPS * np.random.default_rng(seed).standard_normal(true.shape)
            record = cal.gyro_from_rate_table(
                truth.distort(true, TABLE_6_2) + noise, rates, std=0.02 * DPS
            )
            value, std = values(record)
            ratios.append(np.abs(value - TABLE_6_2) / std)
            stds.append(std)
        std = np.mean(stds, axis=0)
        yield (
            f"gyroscope, 9 positions at 200 and 270 deg/s, 0.02 deg/s on the means, {name}",
            f"{100 * np.mean(np.array(ratios) < 3.0):.1f} % of the parameters within 3 sigma; "
            f"sigma of biases up to {std[:3].max() / DPS:.3f} deg/s, of scales "
            f"{std[3:6].max():.1e}, of angles {std[6:].max():.1e} rad",
        )


def direction_error(record):
    """Return the largest error of a corrected direction [deg]."""
    u = truth.even_directions(500)
    c = record.correct(FIELD * u @ SOFT.T + HARD)
    sine = np.linalg.norm(np.cross(c, u), axis=1)
    return np.degrees(np.arctan2(sine, np.sum(c * u, axis=1))).max()


def ellipsoid_rows():
    """Return the rows of the magnetometer."""
    for name, keep, counts in (
        ("all directions", -2.0, (1000, 5000)),
        ("one hemisphere", 0.0, (200, 1000, 5000)),
    ):
        for n in counts:
            hard, angle, refused = [], [], 0
            for seed in range(DRAWS):
                u = truth.directions(3 * n, seed)
                u = u[u @ [0.48, -0.6, 0.64] > keep][:n]
                noise = np.random.default_rng(seed + 10_000).standard_normal(u.shape)
                try:
                    record = cal.ellipsoid(FIELD * u @ SOFT.T + HARD + 0.3 * UT * noise)
                except StrapdownError:
                    refused += 1
                    continue
                hard.append(np.linalg.norm(record.bias - HARD) / UT)
                angle.append(direction_error(record))
            found = "none accepted"
            if hard:
                found = (
                    f"largest error of the hard iron {max(hard):.3f} µT, of any direction "
                    f"{max(angle):.2f} deg"
                )
            yield (
                f"magnetometer, {name}, {n} samples with 0.3 µT",
                f"{refused} of {DRAWS} refused; {found}",
            )


def main() -> None:
    """Write the table."""
    lines = ["| Simulated | Recovered |", "|---|---|"]
    for rows in (accelerometer_rows, hand_held_rows, gyro_rows, ellipsoid_rows):
        lines += [f"| {left} | {right} |" for left, right in rows()]
    target = Path(__file__).with_name("calibration.md")
    target.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(target.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
