"""Tables 5.1 and 5.2: which cut-off of the gyroscope's low-pass to choose, noise against delay."""

import math
from typing import Final

import numpy as np

from strapdown._types import FloatArray
from strapdown.noise import allan_deviation, identify, low_pass_study
from strapdown.noise.bandwidth import LowPassStudy
from strapdown.report import page
from strapdown.report.figures import Panel, Series, grid_figure
from strapdown.sensors import Noise, datasheet
from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info, not_given, simulated
from strapdown.units import DEG, DPS, MS

CUTOFF_HZ: Final = (256.0, 188.0, 98.0, 42.0, 20.0, 10.0, 5.0)
DELAY_MS: Final = (0.98, 1.9, 2.8, 4.8, 8.3, 13.4, 18.6)  # table 5.1
N_DPS: Final = (0.0110, 0.0083, 0.0069, 0.0055, 0.0046, 0.0045, 0.0044)  # table 5.2, per √Hz
SIGMA_DPS: Final = (0.110, 0.083, 0.069, 0.055, 0.046, 0.045, 0.044)  # table 5.2
RATE_HZ: Final = 100.0
CHOSEN_HZ: Final = 188.0
LEAST_HZ: Final = 42.0  # below, the cut-off only worsens the measurement
MINUTES: Final = 60.0  # of each simulated record
_COLORS: Final = ("#d55e00", "#e69f00", "#009e73", "#56b4e9", "#0072b2", "#cc79a7", "#5b6470")


def run(seed: int) -> Shown:
    """Weigh the printed noise against the printed delay, and simulate the printed noise.

    Parameters
    ----------
    seed : int
        Of all that is simulated.

    Returns
    -------
    Shown
    """
    sheet = datasheet("mpu6050")
    rows: list[Row] = []
    for k, cutoff in enumerate(CUTOFF_HZ):
        delay = sheet.value("gyr", "delay", f"DLPF_CFG={k}") / MS
        exact = Tolerance(absolute=1e-9)
        rows.append(
            compared(f"table 5.1, {cutoff:g} Hz, delay", DELAY_MS[k], delay, "ms", exact,
                     "of the preset's datasheet")
        )  # fmt: skip
    rows += [
        compared(
            f"table 5.2, {cutoff:g} Hz, sigma_w = N √f_s", SIGMA_DPS[k],
            N_DPS[k] * math.sqrt(RATE_HZ), "deg/s", Tolerance(absolute=5e-4), "last printed digit",
        )
        for k, cutoff in enumerate(CUTOFF_HZ)
    ]  # fmt: skip
    items: list[Series] = []
    for k, cutoff in enumerate(CUTOFF_HZ):
        row, tau, dev = _simulated(seed, k)
        rows.append(row)
        items.append(
            Series(x=tau, y=dev, name=f"{cutoff:g} Hz", color=_COLORS[k], kind="path")
        )  # fmt: skip
    rows += [_folded(k) for k in range(len(CUTOFF_HZ))]
    study = low_pass_study(
        CUTOFF_HZ, np.array(SIGMA_DPS) * DPS, np.array(DELAY_MS) * MS, 1.0 / RATE_HZ
    )
    rows += verdicts(study)
    blocks = (
        page.plot(
            grid_figure(
                [
                    Panel(
                        x_label="averaging time [s]", y_label="Allan deviation [deg/s]",
                        items=items, height=280, log_x=True, log_y=True,
                    )
                ]
            ),
            "Figure 5.7: white noise of table 5.2, simulated.",
        ),
        page.plot(
            grid_figure([_noise_panel(study), _delay_panel(study)], columns=2),
            "Figures 5.8 and 5.9: angle error of one interval of 10 ms by noise (5.14), and by "
            "the filter's delay (5.15).",
        ),
    )  # fmt: skip
    return Shown(rows=rows, blocks=blocks)


def verdicts(study: LowPassStudy) -> list[Row]:
    """Return what the study says beside what the thesis says.

    Parameters
    ----------
    study : LowPassStudy
        Of the printed tables.

    Returns
    -------
    list of Row
    """
    kept = study.cutoff_hz[~study.rejected]
    exact = Tolerance(absolute=1e-9)
    noise, delay = study.noise_error / DEG, study.delay_error / DEG
    least, most = (f"{study.rates[k] / DPS:g}" for k in (0, -1))
    rejected = ", ".join(f"{f:g}" for f in study.rejected_hz)
    return [
        compared(
            "5.3.1, least cut-off that is of use", LEAST_HZ, float(kept.min()), "Hz", exact,
            f"rejected: {rejected} Hz, at no rate from {least} to {most} deg/s and no multiple of "
            "sigma the best",
        ),
        compared(
            "5.3.1, cut-off chosen", CHOSEN_HZ, study.recommended_hz, "Hz", exact,
            "least regret: the largest ratio of its error to the least possible, at any rate",
        ),
        *(
            not_given(
                f"figure 5.8, noise error at {f:g} Hz, 1 sigma",
                float(noise[0, k]),
                "deg",
                "(5.14)",
            )
            for k, f in enumerate(study.cutoff_hz)
        ),
        *(
            not_given(
                f"figure 5.9, delay error at {f:g} Hz, {most} deg/s", float(delay[-1, k]), "deg",
                "(5.15)",
            )
            for k, f in enumerate(study.cutoff_hz)
        ),
    ]  # fmt: skip


def _simulated(seed: int, k: int) -> tuple[Row, FloatArray, FloatArray]:
    """Return the row of N, and the curve of the record that it was identified from."""
    rng = np.random.default_rng([seed, k])
    n = round(MINUTES * 60.0 * RATE_HZ)
    y = Noise(white=N_DPS[k]).sample(n, 1.0 / RATE_HZ, rng, 1)[:, 0]
    found = identify(y, RATE_HZ).N
    half = found.high - found.value if N_DPS[k] > found.value else found.value - found.low
    curve = allan_deviation(y, RATE_HZ)
    row = simulated(
        f"table 5.2, {CUTOFF_HZ[k]:g} Hz, N", N_DPS[k], found.value, "deg/s/√Hz",
        Tolerance(absolute=half), f"95 % interval; {MINUTES:g} min of white noise",
    )  # fmt: skip
    return row, curve.tau, curve.dev


def _folded(k: int) -> Row:
    """Return what N must be if the sensor's density is that of 5 Hz and the rest is folding."""
    folding = math.sqrt(max(1.0, 2.0 * CUTOFF_HZ[k] / RATE_HZ))
    return info(
        f"table 5.2, {CUTOFF_HZ[k]:g} Hz, N by folding alone", N_DPS[k], N_DPS[-1] * folding,
        "deg/s/√Hz",
        "N at 5 Hz times √(2 f_cut / f_s): noise beyond half of 100 Hz folds into the samples",
    )  # fmt: skip


def _noise_panel(study: LowPassStudy) -> Panel:
    return Panel(
        x_label="cut-off [Hz]",
        y_label="noise error [mdeg]",
        items=[
            Series(x=study.cutoff_hz[::-1], y=row[::-1] / DEG * 1e3, name=f"{multiple:g} sigma",
                   color=_COLORS[k], kind="path")
            for k, (multiple, row) in enumerate(
                zip(study.multiples, study.noise_error, strict=True)
            )
        ],
        height=260,
        log_x=True,
    )  # fmt: skip


def _delay_panel(study: LowPassStudy) -> Panel:
    chosen = [int(np.argmin(np.abs(study.rates / DPS - rate))) for rate in (0.1, 1.0, 10.0, 40.0)]
    return Panel(
        x_label="cut-off [Hz]",
        y_label="delay error [deg]",
        items=[
            Series(x=study.cutoff_hz[::-1], y=study.delay_error[row, ::-1] / DEG,
                   name=f"{study.rates[row] / DPS:.1g} deg/s", color=_COLORS[3 + k], kind="path")
            for k, row in enumerate(chosen)
        ],
        height=260,
        log_x=True,
        log_y=True,
    )  # fmt: skip


PART = Part(
    name="low-pass",
    title="Cut-off of the low-pass: tables 5.1, 5.2, figures 5.7 to 5.9",
    source="5.3.1, (5.14), (5.15)",
    run=run,
)
