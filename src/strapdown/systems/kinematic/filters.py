"""Section 4.3: Kalman filters, described there and never run; and what the filters cost.

The thesis compares the quaternion filter of seven states with Madgwick's in words. The same
simulated recordings go through both here, and through the filter of nine measurements that it
argues against.
"""

import time
from typing import Any, Final

import numpy as np

from strapdown import kalman
from strapdown._types import FloatArray
from strapdown.attitude import Madgwick, QuestEkf
from strapdown.attitude.determination import quest
from strapdown.constants import G0
from strapdown.estimator import Estimator
from strapdown.recording import Recording
from strapdown.rotation import dcm_from_quat, quat_conj, quat_mul, rotate, rotation_angle
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, worded
from strapdown.systems.kinematic import device
from strapdown.systems.kinematic.moving import motion
from strapdown.units import DEG, US

STEP: Final = 1.0 / device.RATE  # [s]
TAU: Final = 0.5  # of the limb's rates [s]; not printed
BEFORE: Final = 20.0  # the sensor lies still until then [s]


def run(seed: int) -> Shown:
    """Compare the printed recursions, and run the filters.

    Parameters
    ----------
    seed : int
        Of models and noise.

    Returns
    -------
    Shown
    """
    rng = np.random.default_rng(seed)
    still, moving = device.record(device.still(), seed), device.record(motion(), seed)
    rows = [*_linear(rng), *_limb(rng), *_quest(), *_nine(rng), *_covariances(still)]
    rows += [*_compared(still, moving), *_variants(moving), *_cost(moving)]
    return Shown(rows=rows)


# --- formulas ---------------------------------------------------------------------------


def _linear(rng: np.random.Generator) -> list[Row]:
    """Return the rows of the generic filter, (53) to (62)."""
    A = np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.1], [0.0, -0.2, 0.9]])
    H = rng.standard_normal((2, 3))
    Q, R = np.diag([1e-4, 1e-3, 1e-2]), np.diag([0.1, 0.2])
    z = rng.standard_normal((200, 2))
    x, P, apart = np.zeros(3), np.eye(3), 0.0
    ours = kalman.Estimate(x, P)
    for measured in z:
        x, P = A @ x, A @ P @ A.T + Q  # (58), (59)
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)  # (60)
        x, P = x + K @ (measured - H @ x), (np.eye(3) - K @ H) @ P  # (61), (62)
        ahead = kalman.predict(ours.x, ours.P, A, Q)
        after = kalman.update(ahead.x, ahead.P, measured, H, R)
        ours = kalman.Estimate(after.x, after.P)
        apart = max(apart, float(np.abs(x - ours.x).max()), float(np.abs(P - ours.P).max()))
    gains = [
        float(np.linalg.norm(kalman.update(x, P + noise, z[0], H, R).K)) for noise in (Q, 100 * Q)
    ]
    return [
        compared("(58) to (62), generic filter, states and covariances over 200 steps", 0.0, apart,
                 "1", Tolerance(absolute=1e-12), "beside strapdown.kalman; rounding"),
        worded("4.3.2, gain for a larger process noise", "goes to zero",
               f"{gains[0]:.2f} to {gains[1]:.2f} for 100 times as much", same=gains[1] < gains[0],
               remark="wrong in the text: process noise raises the gain, the measurement's noise "
               "takes it to zero"),
    ]  # fmt: skip


def _limb_rate(x: FloatArray) -> FloatArray:
    """Return (64) and (65): derivatives of rates and quaternion."""
    q_dot = 0.5 * np.array(
        [
            -x[4] * x[0] - x[5] * x[1] - x[6] * x[2],
            x[3] * x[0] + x[5] * x[2] - x[6] * x[1],
            x[3] * x[1] - x[4] * x[2] + x[6] * x[0],
            x[3] * x[2] + x[4] * x[1] - x[5] * x[0],
        ]
    )
    return np.concatenate((-x[:3] / TAU, q_dot))


def _limb(rng: np.random.Generator) -> list[Row]:
    """Return the rows of (64) to (68): the model of a limb and its transition matrix."""
    q = rng.standard_normal(4)
    x = np.concatenate((rng.uniform(-3.0, 3.0, 3), q / np.linalg.norm(q)))
    F = kalman.jacobian(_limb_rate, x)
    half = 0.5 * STEP
    printed = np.array([*(-half * x[4:]), 1.0, *(-half * x[:3])])  # its dot, lost in print, added
    row4 = (np.eye(7) + STEP * F)[3]
    exact = kalman.transition(F, STEP)
    return [
        compared("(68), row 4 of Phi", 0.0, float(np.abs(printed - row4).max()), "1",
                 Tolerance(absolute=1e-9), "beside differences of (65); their rounding"),
        not_given("(64), factor of the rates over a sample, 1 - dt / tau", 1.0 - STEP / TAU, "1",
                  f"tau is not printed, {TAU:g} s here; exactly {exact[0, 0]:.6f}"),
        not_given("(68), Phi to first order less the exact one, largest element",
                  float(np.abs(np.eye(7) + STEP * F - exact).max()), "1",
                  "at rates of up to 3 rad/s and 100 Hz"),
    ]  # fmt: skip


def _quest() -> list[Row]:
    """Return the row of QUEST on the means of tables 4 and 5."""
    seen = np.array([-np.array(device.ACC_MEAN), device.MAG_MEAN])
    found = quest(seen, rotate(device.rest_pose(), seen))
    off = float(rotation_angle(quat_mul(quat_conj(found.q_nb), device.rest_pose())))
    return [
        compared("item 39, QUEST, off the attitude of tables 4 and 5", 0.0, off, "rad",
                 Tolerance(absolute=1e-7),
                 "both vectors fit exactly there; rounding of the eigenvalue"),
    ]  # fmt: skip


def _nine(rng: np.random.Generator) -> list[Row]:
    """Return the rows of the measurement equation of the naive choice."""
    q = rng.standard_normal(4)
    w, a, b, c = q / np.linalg.norm(q)
    d1, d2, d3 = d = rng.uniform(-1.0, 1.0, 3)
    own = (w**2 + a**2 - b**2 - c**2) * d1 + 2 * (a * b + w * c) * d2 + 2 * (a * c - w * b) * d3
    # as printed, x4 to x7 being the quaternion in the order of (63)
    x4, x5, x6, x7 = w, a, b, c
    printed = (
        (x4**2 + x7**2 - x5**2 - x6**2) * d1 + 2 * (x4 * x5 - x6 * x7) * d2
        + 2 * (x4 * x6 + x5 * x7) * d3
    )  # fmt: skip
    true = float((dcm_from_quat([w, a, b, c]).T @ d)[0])
    other = float((dcm_from_quat([x7, x4, x5, x6]) @ d)[0])
    return [
        compared("item 40, z4 in the thesis's own order of the quaternion", true, float(own), "1",
                 Tolerance(absolute=4e-15), "a direction seen in the sensor; rounding"),
        compared("item 40, z4 as printed is that of a scalar-last quaternion", other,
                 float(printed), "1", Tolerance(absolute=4e-15),
                 "turned from sensor to Earth: taken over from elsewhere; rounding"),
    ]  # fmt: skip


def _covariances(still: Recording) -> list[Row]:
    """Return the rows of R from recorded data: rates and the components of the quaternion."""
    imu, mag = device.streams(still)
    seen = np.stack((-imu.acc, mag.mag), axis=1)
    mean = np.array([-imu.acc.mean(axis=0), mag.mag.mean(axis=0)])
    q = quest(seen, rotate(device.rest_pose(), mean)).q_nb
    q = q * np.sign(q @ device.rest_pose())[:, np.newaxis]  # of the two signs, the near one
    R = np.cov(np.hstack((imu.gyr, q)), rowvar=False)
    sigma = np.sqrt(np.diag(R))
    correlation = R / np.outer(sigma, sigma) - np.eye(7)
    least = float(np.linalg.eigvalsh(R[3:, 3:])[0] / np.linalg.eigvalsh(R[3:, 3:])[-1])
    return [
        info("item 42, R, variances of the rates", "table 3",
             ", ".join(f"{v:.3g}" for v in sigma[:3] ** 2), "(rad/s)^2", "simulated from it"),
        not_given("item 42, R, deviations of the quaternion's components",
                  ", ".join(f"{s:.1e}" for s in sigma[3:]), "1", "QUEST on every sample at rest"),
        worded("item 42, R", "not necessarily diagonal",
               f"correlations up to {np.abs(correlation[3:, 3:]).max():.2f}",
               same=bool(np.abs(correlation[3:, 3:]).max() > 0.1), from_simulation=True,
               remark="between components of the quaternion; not diagonal: over 0.1"),
        not_given("item 42, R, least over largest eigenvalue of the quaternion's part", least, "1",
                  "its norm is one: four components have three errors, and R no full rank"),
        info("item 42, Q, three non-zero elements", "variances of the rates", None, "",
             "no values and no method printed"),
    ]  # fmt: skip


# --- filters ----------------------------------------------------------------------------


def _dip() -> float:
    """Return the dip of the field of table 5 at the gravity of table 4 [rad]."""
    north, east, down = rotate(device.rest_pose(), np.array(device.MAG_MEAN))
    return float(np.arctan2(down, np.hypot(north, east)))


def _from_tables(**parameters: Any) -> QuestEkf:
    """Return the filter with R of tables 3 to 5: densities of their worst axes."""
    root = np.sqrt(STEP)
    field = float(np.linalg.norm(device.MAG_MEAN))
    return QuestEkf(
        gyr_noise=root * np.sqrt(max(device.GYR_VARIANCE)),
        acc_noise=root * np.sqrt(max(device.ACC_VARIANCE)) * G0,
        mag_noise=root * np.sqrt(max(device.MAG_VARIANCE)) / field,
        rate_time=TAU,
        **parameters,
    )


def _compared(still: Recording, moving: Recording) -> list[Row]:
    """Return the rows of items 38 and 43: both filters on the same recordings."""
    filters: dict[str, Estimator] = {
        "Madgwick": Madgwick(beta=device.BETA_LOW),
        "EKF of 7 states": QuestEkf(rate_time=TAU),
        "EKF, R of tables 3 to 5": _from_tables(),
    }
    rows = []
    truth = motion()
    for name, flt in filters.items():
        rest, sol = flt.run(still), flt.run(moving)
        rms = _rms(quat_mul(quat_conj(truth.q_nb), sol.q_nb)[sol.t > BEFORE])
        yaw = np.unwrap(device.angles(rest.q_nb)[:, 2])[device.SAMPLES // 2 :]
        slope = float(np.polyfit(rest.t[device.SAMPLES // 2 :], yaw, 1)[0])
        rows += [
            not_given(f"item 43, {name}: bias, slope of yaw at rest", slope / DEG, "deg/s",
                      "last 75 s; the gyroscope's bias is 0.07 deg/s"),
            not_given(f"item 43, {name}: stability, std of yaw at rest", float(yaw.std()) / DEG,
                      "deg", "last 75 s"),
            not_given(f"item 43, {name}: response, rms error while turned",
                      rms / DEG, "deg", "one axis at a time"),
            not_given(f"item 43, {name}: load, time per sample", _per_sample(flt, moving) / US,
                      "us", "of the processor, in a batch"),
        ]  # fmt: skip
    return rows


def _rms(q: FloatArray) -> float:
    """Return the root of the mean square of rotations [rad]."""
    return float(np.sqrt(np.mean(rotation_angle(q) ** 2)))


def _variants(moving: Recording) -> list[Row]:
    """Return the rows of items 39 and 40, seven and nine measurements, and of the printed Phi."""
    seven = _from_tables(dip=_dip())
    nine = _from_tables(dip=_dip(), measurements="vectors")
    printed = _from_tables(dip=_dip(), integration="printed")
    found = [flt.run(moving) for flt in (seven, nine, printed)]
    late = found[0].t > BEFORE
    apart = [_rms(quat_mul(quat_conj(found[0].q_nb), s.q_nb)[late]) / DEG for s in found[1:]]
    turning = quat_mul(quat_conj(motion().q_nb), found[2].q_nb)
    costs = [_per_sample(flt, moving) / US for flt in (seven, nine)]
    return [
        info("item 39, load of QUEST and H = I beside nine measurements", "lower",
             f"{costs[0]:.2f} and {costs[1]:.2f} us", "",
             "near each other: with the same noise on all axes two of the nine tell no turn, and "
             "scalars one by one need no inverse of a matrix"),
        not_given("item 40, nine measurements, apart from QUEST and H = I", apart[0], "deg",
                  "rms while turned; of second order in errors and noise"),
        not_given("(68), first order and the rate of the sample before, apart from the exact one",
                  apart[1], "deg", "rms while turned"),
        not_given("(68), first order and the rate of the sample before, rms error",
                  _rms(turning[late]) / DEG, "deg", "while turned"),
    ]  # fmt: skip


def _per_sample(flt: Estimator, rec: Recording) -> float:
    """Return the processor's time for one sample [s]: the best of five, for noise only adds."""
    best = np.inf
    for _ in range(5):
        begun = time.process_time()
        flt.run(rec, diagnostics=False)
        best = min(best, time.process_time() - begun)
    return best / device.SAMPLES


def _cost(moving: Recording) -> list[Row]:
    """Return the row of real-time operation: item 50."""
    imu, mag = device.streams(moving)
    tracker = Madgwick(beta=device.BETA_LOW).tracker()
    samples = list(zip(imu.t.tolist(), imu.gyr, imu.acc, mag.mag, strict=True))[:2000]
    begun = time.process_time()
    for t, gyr, acc, field in samples:
        tracker.update(t, gyr, acc, field)
    spent = (time.process_time() - begun) / len(samples)
    return [
        not_given("item 50, Madgwick's filter, one sample from Python", spent / US, "us",
                  "of the processor; at 100 Hz there are 10,000 us"),
    ]  # fmt: skip


PART: Final = Part(
    name="filters",
    title="Kalman filters beside Madgwick's: described in 4.3, never run there",
    source="4.1, 4.3, conclusions; items 37 to 43, 50",
    run=run,
)
