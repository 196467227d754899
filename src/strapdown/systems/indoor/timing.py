"""Section 6.1: reading, transmission and the highest frequency of each mode.

The 101 us, 57 ms and 3.2 ms were measured or declared for the board; what follows from them is
worked out here.
"""

import math
from typing import Final, NamedTuple

from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info

READS_MS: Final = 101.0  # a thousand registers
BUS_BPS: Final = 400e3
USB_BPS: Final = 12e6
TEST_BYTES: Final = 8574
TEST_MS: Final = 57.0
FUSION_MS: Final = 3.2  # MotionFX, worst case, declared
GOODPUT_MBPS: Final = 1.2  # as the thesis goes on with


class Mode(NamedTuple):
    """A row of the tables of 6.1.2 and 6.1.3; times [ms] as printed."""

    name: str
    axes: int
    packet: int
    reading: float
    sending: float
    fuses: bool
    total: float
    highest_hz: int


MODES: Final = (
    Mode("LCM 6DOF", 6, 42, 1.2, 0.28, False, 1.48, 675),
    Mode("LCM 9DOF", 9, 60, 1.8, 0.40, False, 2.20, 454),
    Mode("HCM 6DOF", 6, 18, 1.2, 0.12, True, 4.52, 221),
    Mode("HCM 9DOF", 9, 18, 1.8, 0.12, True, 5.12, 195),
    Mode("TCM 6DOF", 6, 60, 1.2, 0.40, True, 4.80, 208),
    Mode("TCM 9DOF", 9, 78, 1.8, 0.52, True, 5.52, 181),
)
# Bytes of the fields, bars, semicolons and line feed, tables 5.2 to 5.6.
FIELDS: Final = {"acc": 3 * 5, "gyr": 3 * 7, "mag": 3 * 5, "angles": 3 * 5}
PACKETS: Final = (
    ("5.2, LCM 6DOF", ("acc", "gyr"), 42),
    ("5.3, LCM 9DOF", ("acc", "gyr", "mag"), 60),
    ("5.4, HCM", ("angles",), 18),
    ("5.5, TCM 6DOF", ("acc", "gyr", "angles"), 60),
    ("5.6, TCM 9DOF", ("acc", "gyr", "mag", "angles"), 78),
)
FRAME_BITS: Final = 4 * 9 + 3  # four bytes with their acknowledges, two starts, a stop; figure 5.4


def run(seed: int) -> Shown:
    """Work out the printed times and frequencies.

    Parameters
    ----------
    seed : int
        Nothing is drawn.

    Returns
    -------
    Shown
    """
    rows: list[Row] = [*_bus(), *_usb()]
    for table, groups, printed in PACKETS:
        rows.append(
            compared(f"table {table}, longest packet", float(printed), float(length(groups)),
                     "bytes", Tolerance(absolute=0.0),
                     "fields, 2 semicolons a group, bars between groups, line feed; signs, which "
                     "the thesis does not count, make it longer")
        )  # fmt: skip
    for mode in MODES:
        rows += mode_rows(mode)
    return Shown(rows=rows)


def length(groups: tuple[str, ...]) -> int:
    """Return the longest packet of some groups of three fields [bytes]."""
    return sum(FIELDS[group] + 2 for group in groups) + (len(groups) - 1) + 1


def _bus() -> list[Row]:
    """Return reading a register of 8 bit, 6.1.1."""
    register_us = READS_MS
    goodput = 8.0 / register_us * 1e3  # kb/s
    theory = FRAME_BITS / BUS_BPS * 1e6
    burst = ((3 + 6) * 9 + 3) / BUS_BPS * 1e6
    return [
        compared("6.1.1, goodput of the bus", 80.0, goodput, "kb/s", Tolerance(absolute=1.0),
                 "8 bit in 101 us, printed as a round fifth of 400 kb/s"),
        compared("6.1.1, share of the bus", 20.0, 100.0 * goodput * 1e3 / BUS_BPS, "%",
                 Tolerance(absolute=0.5), "last digit"),
        compared("5.1.2.1, frame of figure 5.4 at 400 kb/s", 97.5, theory, "us",
                 Tolerance(absolute=0.05), "derived: 39 bits; the measured 101 us are nearly all "
                 "protocol"),
        compared("5.1.2.1, six registers in one burst", 210.0, burst, "us",
                 Tolerance(absolute=0.5), "derived: 84 bits; the thesis's better way"),
        compared("6.1.1, six registers one by one", 606.0, 6.0 * register_us, "us",
                 Tolerance(absolute=0.5), "derived"),
        compared("(6.3), reading of 9 axes", 1.8, 9 * 2 * register_us * 1e-3, "ms",
                 Tolerance(absolute=0.05), "last digit"),
        compared("(6.4), reading of 6 axes", 1.2, 6 * 2 * register_us * 1e-3, "ms",
                 Tolerance(absolute=0.05), "last digit"),
    ]  # fmt: skip


def _usb() -> list[Row]:
    """Return the transmission over USB, 6.1.2."""
    goodput = 8.0 * TEST_BYTES / TEST_MS * 1e-3  # Mb/s
    return [
        compared("6.1.2, goodput of USB", GOODPUT_MBPS, goodput, "Mb/s", Tolerance(absolute=0.05),
                 "8574 bytes in 57 ms; last digit"),
        compared("6.1.2, share of USB", 10.0, 100.0 * goodput * 1e6 / USB_BPS, "%",
                 Tolerance(absolute=0.5), "last digit"),
        info("6.1.1, 6.1.2, measured times", "101 ms, 57 ms", None, "", "hardware"),
        info("6.1.3, MotionFX, worst case", "3.2 ms", None, "", "declared by its maker"),
    ]  # fmt: skip


def mode_rows(mode: Mode) -> list[Row]:
    """Return transmission, least window and highest frequency of a mode.

    Parameters
    ----------
    mode : Mode
        As printed.

    Returns
    -------
    list of Row
    """
    sending = 8.0 * mode.packet / (GOODPUT_MBPS * 1e3)
    plain = mode.reading + mode.sending
    total = plain + (FUSION_MS if mode.fuses else 0.0)
    digit = Tolerance(absolute=5e-3)
    return [
        compared(f"6.1.2, {mode.name}, transmission", mode.sending, sending, "ms", digit,
                 "packet over 1.2 Mb/s; last digit"),
        compared(f"6.1.3, {mode.name}, least window", mode.total, total, "ms", digit,
                 "sum of the printed times"
                 + (f"; {plain:.2f} ms without MotionFX" if mode.fuses else "")),
        compared(f"6.1.3, {mode.name}, highest frequency", float(mode.highest_hz),
                 float(math.floor(1e3 / mode.total)), "Hz", Tolerance(absolute=0.0),
                 "whole part of the inverse"),
        compared(f"6.1.3, {mode.name}, 100 Hz fits", 10.0, total, "ms", Tolerance(bound="at most"),
                 "the sampling time of 10 ms that the filter takes"),
    ]  # fmt: skip


PART = Part(
    name="timing",
    title="Timing: tables of 6.1, packets of tables 5.2 to 5.6",
    source="5.1.2, 5.2.2, 6.1",
    run=run,
)
