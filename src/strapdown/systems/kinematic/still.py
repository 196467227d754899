"""Figures 12 to 14: gyro integration and Madgwick's filter on the sensor lying still.

The thesis starts its filter at the identity, so that the first instants are a transient: the
sensor's x axis is turned by more than 140 deg against the field.
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.attitude import GyroIntegration, Madgwick
from strapdown.recording import Recording
from strapdown.report import page
from strapdown.report.figures import Panel, time_figure, xyz
from strapdown.rotation import quat_mul, rotation_angle, wrap_pi
from strapdown.solution import Solution
from strapdown.systems._parts import Part
from strapdown.systems._rows import (
    Row,
    Shown,
    Tolerance,
    compared,
    info,
    not_given,
    simulated,
    worded,
)
from strapdown.systems.kinematic import device
from strapdown.units import DEG, DPS

NAMES: Final = ("roll", "pitch", "yaw")
BAND: Final = 5.0 * DEG  # wider than the noise at the high gain
GYR_ERROR: Final = 5.0 * DPS  # from which the printed beta follows by (43)
ZETA: Final = 0.0015  # [rad/s^2]; the thesis gives no value


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """Angles of a filter on the way to its rest, and how it gets there.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Times [s].
    angles : ndarray, shape (n, 3)
        Roll, pitch, yaw in the thesis's frame [rad], without jumps.
    """

    t: FloatArray
    angles: FloatArray

    @classmethod
    def of(cls, sol: Solution) -> "Response":
        """Return that of a solution."""
        return cls(t=sol.t, angles=np.unwrap(device.angles(sol.q_nb), axis=0))

    @property
    def late(self) -> FloatArray:
        """The second half of the angles."""
        return self.angles[len(self.t) // 2 :]

    @property
    def final(self) -> FloatArray:
        """Where they end, shape (3,) [rad]."""
        return np.asarray(self.late.mean(axis=0))

    @property
    def std(self) -> FloatArray:
        """Standard deviations of the second half, shape (3,) [rad]."""
        return np.asarray(self.late.std(axis=0))

    @property
    def slopes(self) -> FloatArray:
        """Slopes of the second half, shape (3,) [rad/s]."""
        t = self.t[len(self.t) // 2 :]
        return np.asarray(np.polyfit(t - t.mean(), self.late, 1)[0])

    @property
    def settled(self) -> float:
        """Time from which on all angles stay within 5 deg of their end [s]."""
        outside = np.flatnonzero(np.abs(self.angles - self.final).max(axis=1) > BAND)
        return float(self.t[outside[-1] + 1]) if len(outside) else float(self.t[0])

    @property
    def overshoot(self) -> float:
        """How far the yaw goes beyond its end before it has settled for as long again [rad]."""
        early = self.t < 2.0 * self.settled
        way = self.final[2] - self.angles[0, 2]
        return float(np.max(np.sign(way) * (self.angles[early, 2] - self.final[2])))


def filtered(rec: Recording, q_nb: FloatArray = device.Q_N_THESIS, **parameters: Any) -> Solution:
    """Return Madgwick's filter on a recording, started at an attitude."""
    flt = Madgwick(**parameters)
    return flt.advance(flt.init(attitude=q_nb), rec)[0]


def run(seed: int) -> Shown:
    """Simulate the recording, integrate and filter it.

    Parameters
    ----------
    seed : int
        Of the noise.

    Returns
    -------
    Shown
    """
    rec = device.record(device.still(), seed)
    low = Response.of(filtered(rec, beta=device.BETA_LOW))
    high = Response.of(filtered(rec, beta=device.BETA_HIGH))
    summed = _sums(rec)
    rows = [*_integration(rec, summed), *_gains(), *_transient(low, high), *_rest(low, high)]
    rows += [*_six_axes(rec), *_bias(rec), *_limits(rec, high)]
    return Shown(
        rows=rows,
        blocks=(
            _figure(Response(t=low.t, angles=summed), "Figure 12: sums of the angular rates."),
            _figure(low, "Figure 13: Madgwick's filter, beta 0.07557."),
            _figure(high, "Figure 14: Madgwick's filter, beta 0.7557."),
        ),
    )


def _sums(rec: Recording) -> FloatArray:
    """Return the sums of the rates on each axis [rad]."""
    imu, _ = device.streams(rec)
    return np.asarray(np.cumsum(imu.gyr, axis=0) / device.RATE)


def _integration(rec: Recording, summed: FloatArray) -> list[Row]:
    """Return the rows of figure 12."""
    mean = max(abs(m) for m in device.GYR_MEAN)
    worst = int(np.argmax(np.abs(summed[-1])))
    angle = float(np.abs(summed[-1]).max()) / DEG
    flt = GyroIntegration()
    sol = flt.advance(flt.init(attitude=device.Q_N_THESIS), rec)[0]
    turned = quat_mul(device.Q_N_THESIS * [1.0, -1.0, -1.0, -1.0], sol.q_nb[-1])
    wander = 4.0 * math.sqrt(device.GYR_VARIANCE[1] * device.DURATION / device.RATE) / DEG
    tolerance = Tolerance(absolute=0.5 + wander)
    remark = "half of the last printed digit, and 4 sigma of the random walk"
    return [
        compared("figure 12, worst axis after 150 s, from the mean of table 3", 10.0,
                 mean * device.DURATION / DEG, "deg", Tolerance(absolute=0.5),
                 "tolerance: half of the last printed digit"),
        compared("figure 12, drift, from the mean of table 3", 0.07, mean / DPS, "deg/s",
                 Tolerance(absolute=0.005), "tolerance: half of the last printed digit"),
        simulated("figure 12, worst axis after 150 s, rates summed", 10.0, angle, "deg", tolerance,
                  f"axis {'xyz'[worst]}; {remark}"),
        simulated("figure 12, drift, rates summed", 0.07, angle / device.DURATION, "deg/s",
                  Tolerance(absolute=0.005 + wander / device.DURATION), remark),
        simulated("figure 12, whole angle after 150 s, (25) and (26)", 10.0,
                  float(rotation_angle(turned)) / DEG, "deg", tolerance,
                  f"estimator gyro-integration, all axes together; {remark}"),
    ]  # fmt: skip


def _gains() -> list[Row]:
    """Return the rows of (43)."""
    flt = Madgwick.from_gyro_error(GYR_ERROR)
    digits = "tolerance: half of the last printed digit"
    return [
        compared("(43), beta for a gyro error of 5 deg/s", device.BETA_LOW, flt.beta, "rad/s",
                 Tolerance(absolute=5e-6),
                 f"(43) and beta are printed, the 5 deg/s are what connects them; {digits}"),
        compared("figure 14, beta 10 times larger", device.BETA_HIGH,
                 Madgwick.from_gyro_error(10.0 * GYR_ERROR).beta, "rad/s",
                 Tolerance(absolute=5e-5), digits),
    ]  # fmt: skip


def _transient(low: Response, high: Response) -> list[Row]:
    """Return the rows of how the filter settles."""
    faster = low.settled / high.settled
    beyond = high.overshoot / high.std[2]
    exact = device.angles(device.rest_pose())
    return [
        not_given("figure 13, settled within 5 deg", low.settled, "s", "all angles"),
        not_given("figure 14, settled within 5 deg", high.settled, "s", "all angles"),
        worded("figure 14, dynamics", "markedly faster than figure 13",
               f"settles {faster:.1f} times as fast", same=faster > 3.0, from_simulation=True,
               remark="markedly: more than 3 times"),
        worded("figure 14, overshoot", "none", f"yaw passes its end by {beyond:.1f} sigma",
               same=beyond < 5.0, from_simulation=True,
               remark="none: not beyond 5 sigma of the noise that stays"),
        worded("figures 13 and 14, first settled angle about z", "not zero",
               f"{low.final[2] / DEG:.2f} deg", same=abs(low.final[2]) > BAND,
               from_simulation=True, remark="measured from magnetic north; value not printed"),
        *(
            not_given(f"figure 13, {name} at rest less that of the means of tables 4 and 5",
                      float(wrap_pi(low.final[k] - exact[k])) / DEG, "deg",
                      f"the means give {exact[k] / DEG:.3f} deg")
            for k, name in enumerate(NAMES)
        ),
    ]  # fmt: skip


def _rest(low: Response, high: Response) -> list[Row]:
    """Return the rows of what stays."""
    ratio = high.std / low.std
    drift = np.abs(low.slopes).max() / DPS
    integrated = max(abs(m) for m in device.GYR_MEAN) / DPS
    rows = [
        not_given(f"figure {figure}, {name}, std of the last 75 s",
                  float(response.std[k]) / DEG, "deg")
        for figure, response in ((13, low), (14, high))
        for k, name in enumerate(NAMES)
    ]  # fmt: skip
    rows.append(worded(
        "figure 14, oscillations once stable", "larger than in figure 13",
        f"{ratio.min():.1f} to {ratio.max():.1f} times", same=bool(ratio.min() > 1.5),
        from_simulation=True, remark="larger: more than 1.5 times on each angle",
    ))  # fmt: skip
    rows.append(worded(
        "figure 13, drift of the gyro", "completely corrected",
        f"{drift:.1e} deg/s of {integrated:.3f} deg/s left", same=bool(drift < 0.05 * integrated),
        from_simulation=True, remark="largest slope of the last 75 s; completely: less than 5 %",
    ))  # fmt: skip
    return rows


def _six_axes(rec: Recording) -> list[Row]:
    """Return the rows of the filter without a magnetometer."""
    response = Response.of(filtered(rec, beta=device.BETA_LOW, use_mag=False))
    # z points up: the yaw of the frame follows the gyroscope's z axis
    yaw = response.slopes[2] / DPS
    tilt = np.abs(response.slopes[:2]).max() / DPS
    bias = device.GYR_MEAN[2] / DPS
    # slope that least squares find in a random walk of density q over T: variance 6 q / (5 T)
    sigma = math.sqrt(1.2 * device.GYR_VARIANCE[2] / device.RATE / 75.0) / DPS
    return [
        simulated("without magnetometer, slope of yaw", bias, float(yaw), "deg/s",
                  Tolerance(absolute=4.0 * sigma),
                  "follows the bias of table 3, z; 4 sigma of a random walk's slope over 75 s"),
        worded("without magnetometer, roll and pitch", "stable",
               f"slopes up to {tilt:.1e} deg/s", same=bool(tilt < 0.05 * abs(bias)),
               from_simulation=True, remark="stable: under 5 % of the bias of z"),
    ]  # fmt: skip


def _bias(rec: Recording) -> list[Row]:
    """Return the rows of (50) to (52)."""
    starts: dict[str, FloatArray] = {
        "from the right attitude": device.rest_pose(),
        "from the identity": device.Q_N_THESIS,
    }
    rows = []
    for zeta in (ZETA, 10.0 * ZETA):
        for name, start in starts.items():
            sol = filtered(rec, start, beta=device.BETA_LOW, zeta=zeta)
            off = np.abs(np.asarray(sol.gyr_bias)[-1] - device.GYR_MEAN).max()
            rows.append(not_given(
                f"item 34, sigma {zeta:g}, {name}: error of the bias after 150 s",
                float(off), "rad/s", "worst axis; sigma is not printed",
            ))  # fmt: skip
    first, wound = (float(str(row.here)) for row in rows[:2])
    rows.append(worded(
        "item 34, compensated bias", "good results",
        f"{100.0 * first / max(device.GYR_MEAN):.0f} % of it left, {wound / first:.0f} times that "
        "from the identity",
        same=first < 0.25 * max(device.GYR_MEAN), from_simulation=True,
        remark="sigma 0.0015; good: under a quarter; (51) winds up during a long transient",
    ))  # fmt: skip
    return rows


def _limits(rec: Recording, high: Response) -> list[Row]:
    """Return the rows of gains that are too high, and of the correction's rate."""
    beta = 100.0 * device.BETA_LOW
    wild = Response.of(filtered(rec, device.rest_pose(), beta=beta))
    ratio = float((wild.std / high.std).min())
    slews = {
        name: _slew(filtered(rec, beta=value)) / DPS
        for name, value in (("0.07557", device.BETA_LOW), ("0.7557", device.BETA_HIGH))
    }
    return [
        worded("item 31, beta 7.557", "oscillates about the solution",
               f"std {ratio:.1f} times that of figure 14 at least", same=ratio > 1.5,
               from_simulation=True, remark="an excess of gain; oscillates: more than 1.5 times"),
        not_given("item 31, beta 7.557, a step of the chatter, 2 beta dt",
                  2.0 * beta / device.RATE / DEG, "deg"),
        *(
            not_given(f"item 48, largest rate of correction, beta {name}", slew, "deg/s",
                      "over 1 s of the transient; at most 2 beta and the bias")
            for name, slew in slews.items()
        ),
        info("item 48, attitude that changes too abruptly", "reliability not guaranteed", None, "",
             "the rates above say what the correction can follow"),
    ]  # fmt: skip


def _slew(sol: Solution) -> float:
    """Return the largest rate at which a filter turns the still sensor [rad/s]."""
    step = round(device.RATE)
    turned = quat_mul(sol.q_nb[:-step] * [1.0, -1.0, -1.0, -1.0], sol.q_nb[step:])
    return float(rotation_angle(turned).max())


def _figure(response: Response, caption: str) -> page.Block:
    series = xyz(response.t, response.angles / DEG, names=NAMES)
    return page.plot(
        time_figure([Panel(y_label="angle [deg]", items=series, height=240)]), caption
    )


PART: Final = Part(
    name="still",
    title="Gyro integration and Madgwick's filter at rest: figures 12 to 14",
    source="4.2, chapter 5; items 22, 27 to 31, 34, 36, 48",
    run=run,
)
