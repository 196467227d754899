"""``characterize --low-pass``: which cut-off of the gyroscope's filter to choose."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from strapdown.cli import _console, _errors
from strapdown.errors import InputError
from strapdown.units import DPS, MS

if TYPE_CHECKING:
    from strapdown.noise import Characterization, LowPassStudy


@dataclass(frozen=True, slots=True, kw_only=True)
class Filters:
    """The cut-offs to choose from.

    Attributes
    ----------
    text : str
        As typed.
    cutoff_hz, delay : tuple of float
        Cut-off [Hz] and delay [s] of each.
    sigma : tuple of float, optional
        Noise behind each [rad/s]; None: as the log shows.
    """

    text: str
    cutoff_hz: tuple[float, ...]
    delay: tuple[float, ...]
    sigma: tuple[float, ...] | None = None


def filters(text: str) -> Filters:
    """Return the cut-offs that ``--low-pass`` names.

    Parameters
    ----------
    text : str
        ``"256:0.98,188:1.9"``, hertz and milliseconds; ``"256:0.98:0.11,188:1.9:0.083"`` with
        the noise behind each in deg/s; or ``"mpu6050"``.

    Raises
    ------
    InputError
        If it is none of these.
    """
    from strapdown.noise import bandwidth

    if text.strip() == "mpu6050":
        return Filters(
            text=text,
            cutoff_hz=bandwidth.MPU6050_CUTOFF_HZ,
            delay=bandwidth.MPU6050_DELAY,
            sigma=bandwidth.MPU6050_SIGMA,
        )
    try:
        rows = [tuple(float(number) for number in part.split(":")) for part in text.split(",")]
    except ValueError:
        rows = []
    if {len(row) for row in rows} not in ({2}, {3}):
        raise InputError(
            "--low-pass must be mpu6050, or cut-offs and delays such as 256:0.98,188:1.9 "
            f"(Hz:ms, or Hz:ms:dps with the noise behind each), got {text!r}."
        )
    cutoff, delay, *sigma = zip(*rows, strict=True)
    return Filters(
        text=text,
        cutoff_hz=cutoff,
        delay=tuple(d * MS for d in delay),
        sigma=tuple(s * DPS for s in sigma[0]) if sigma else None,
    )


def study(chosen: Filters, found: "Characterization") -> "LowPassStudy":
    """Return the study at the log's sampling rate, with the worst axis' noise.

    Parameters
    ----------
    chosen : Filters
        To choose from.
    found : Characterization
        Of the log; its gyroscope counts.
    """
    from strapdown import noise

    gyr = found.record["gyr"]
    with _errors.given(f"--low-pass {chosen.text}"):
        sigma: Any = chosen.sigma
        if sigma is None:
            axes = [noise.sigma_behind_filter(s, chosen.cutoff_hz) for s in found.spectra["gyr"]]
            sigma = max(axes, key=lambda axis: float(axis[0]))
            _console.note("noise behind each cut-off is this log's, whose filter must be wide")
        else:
            _console.note("noise behind each cut-off is the one given, not this log's")
        return noise.low_pass_study(chosen.cutoff_hz, sigma, chosen.delay, 1.0 / gyr.fs)


def facts(result: "LowPassStudy") -> dict[str, Any]:
    """Return the study for JSON, SI units.

    Parameters
    ----------
    result : LowPassStudy
        What was found.
    """
    return {
        "cutoff_hz": result.cutoff_hz.tolist(),
        "noise_error_rad": result.noise_error[0].tolist(),
        "delay_error_rad": result.delay_error[-1].tolist(),
        "regret": result.regret.tolist(),
        "rejected_hz": list(result.rejected_hz),
        "recommended_hz": result.recommended_hz,
    }


def show(result: "LowPassStudy") -> None:
    """Print a row per cut-off.

    Parameters
    ----------
    result : LowPassStudy
        What was found.
    """
    from strapdown.units import DEG

    rows = []
    for k, cutoff in enumerate(result.cutoff_hz):
        verdict = "rejected" if result.rejected[k] else ""
        if k == result.recommended:
            verdict = "recommended"
        rows.append(
            (
                f"{cutoff:g}",
                f"{1e3 * result.noise_error[0, k] / DEG:.3f}",
                f"{1e3 * result.delay_error[-1, k] / DEG:.2f}",
                f"{result.regret[k]:.2f}",
                verdict,
            )
        )
    fastest = result.rates[-1] / DPS
    head = ("cut-off Hz", "noise mdeg", f"delay mdeg at {fastest:g} deg/s", "regret", "")
    _console.print_table(
        "low-pass of the gyroscope: errors of one sample", head, rows, right=range(4)
    )
    _console.note(
        "rejected: another cut-off is better at every rate; regret: error over the best one's, at "
        "the worst rate from rest on"
    )
