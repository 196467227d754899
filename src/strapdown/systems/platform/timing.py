"""Sections 8.1 and 9.4: bus, processing times and the choice of the microcontroller.

The times were measured on an Arduino Due, so that only the arithmetic between them can be
checked here.
"""

from typing import Final

from strapdown.systems._parts import Part
from strapdown.systems._rows import Row, Shown, Tolerance, compared, info

CLOCKS: Final = 82  # of the bus per read of a sensor, as printed
BUS_HZ: Final = {"100 kHz": 100e3, "400 kHz": 400e3}
READ_MS: Final = {"100 kHz": 0.860, "400 kHz": 0.215}  # table 9.10
CPU_HZ: Final = 84e6
# Table 9.11: time [ms] and cycles.
PHASES: Final = {
    "predict": (0.796, 66864),
    "update, space": (1.893, 159012),
    "update, terrestrial": (4.728, 397152),
}
CYCLE_MS: Final = 10.0  # 100 Hz
# Reads, update, and the sums derived from the tables at both bus clocks [ms].
SCENARIOS: Final = {
    "space": (1, "update, space", {"100 kHz": 3.549, "400 kHz": 2.904}),
    "terrestrial": (3, "update, terrestrial", {"100 kHz": 8.104, "400 kHz": 6.169}),
}
# Table 8.1: Uno and Due.
BOARDS: Final = (
    ("operating voltage", "5 V", "3.3 V"),
    ("input voltage", "7-12 V", "7-12 V"),
    ("flash memory", "32 KB", "512 KB"),
    ("EEPROM", "1 KB", "-"),
    ("power", "240 mW", "410 mW"),
    ("weight", "25 g", "36 g"),
    ("size", "68.6 x 53.4 mm", "101.5 x 53.4 mm"),
)


def run(seed: int) -> Shown:
    """Work out the printed times from each other.

    Parameters
    ----------
    seed : int
        Nothing is drawn.

    Returns
    -------
    Shown
    """
    rows: list[Row] = []
    for name, clock in BUS_HZ.items():
        rows.append(
            compared(
                f"table 9.10, one sensor at {name}", READ_MS[name], CLOCKS / clock * 1e3, "ms",
                Tolerance(absolute=5e-4),
                f"{CLOCKS} clocks as 9.4 says; the printed time is that of "
                f"{READ_MS[name] * clock * 1e-3:.0f} clocks",
            )
        )  # fmt: skip
    slow, fast = READ_MS.values()
    rows.append(
        compared("9.4, time at 400 kHz over that at 100 kHz", 0.25, fast / slow, "",
                 Tolerance(absolute=1e-3), "'a quarter'; last digit of the times")
    )  # fmt: skip
    for name, (ms, cycles) in PHASES.items():
        rows.append(
            compared(f"table 9.11, {name}", float(cycles), ms * 1e-3 * CPU_HZ, "cycles",
                     Tolerance(absolute=0.5e-6 * CPU_HZ),
                     f"{ms:g} ms at {CPU_HZ * 1e-6:g} MHz; last digit of the time")
        )  # fmt: skip
    for scenario, (reads, update, sums) in SCENARIOS.items():
        for name, printed in sums.items():
            total = reads * READ_MS[name] + PHASES["predict"][0] + PHASES[update][0]
            rows.append(
                compared(f"9.4, cycle of the {scenario} scenario at {name}", printed, total, "ms",
                         Tolerance(absolute=5e-4),
                         f"{reads} read, predict and update; derived from the tables")
            )  # fmt: skip
            rows.append(
                compared(f"9.4, 100 Hz, {scenario} scenario at {name}", CYCLE_MS, total, "ms",
                         Tolerance(bound="at most"), "a cycle of 100 Hz")
            )  # fmt: skip
    rows += [
        info("table 8.1, interrupt pins", "2 and all", None, "",
             "the encoders need six: 'Due'"),
        info("table 8.1, SRAM", "2 KB and 96 KB", None, "",
             "too little on the Uno for the thesis's variables; its program is not printed"),
        info("table 8.1, clock", "16 MHz and 84 MHz", None, "", "hardware"),
        *(info(f"table 8.1, {what}", f"{uno} and {due}", None, "", "hardware")
          for what, uno, due in BOARDS),
        info("table 8.3, addresses on the bus", "0x68 and 0x1E", None, "", "hardware"),
        info("table 8.4, registers", "0x6B=0x00, 0x1A=0x01; 0x00=0x18, 0x02=0x00", None, "",
             "hardware: sensor on, 188 Hz; 75 Hz, continuous"),
        info("8.4, serial line", "115200 baud", None, "", "hardware"),
        info("figures 9.20, 9.21", "time profiles", None, "", "measured on the board"),
    ]  # fmt: skip
    return Shown(rows=rows)


PART = Part(
    name="timing",
    title="Bus and processing times: tables 8.1, 8.3, 8.4, 9.10, 9.11",
    source="8.1, 8.3, 9.4",
    run=run,
)
