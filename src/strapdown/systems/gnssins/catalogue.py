"""Tables 4.1 to 4.4: sensors that chapter 4 describes and nobody used. Nothing is simulated."""

from typing import Final

from strapdown.navigation.grades import gyro_grade
from strapdown.systems._rows import Row, info
from strapdown.units import DEG_PER_HR, DPS

WHY: Final = "described in chapter 4, not used: no preset"
# table, quantity, as printed, unit; three values are those of GG1178AU01, AU02, AU04
FIGURES: Final = (
    ("4.1, quartz tuning forks", "principle", "Coriolis, piezoelectric drive and detection", ""),
    ("4.1, silicon micromachining", "principle",
     "Coriolis, piezoelectric, electrostatic or electromagnetic drive", ""),
    ("4.2, GG1178", "operating range", "75, 150, 300", "deg/s"),
    ("4.2, GG1178", "output bandwidth", "31, 62 or 125", "Hz"),
    ("4.2, GG1178", "sensitivity", "26.7, 13.3, 6.7", "mV/(deg/s)"),
    ("4.2, GG1178", "total sensitivity error", "under 2.0", "%"),
    ("4.2, GG1178", "total zero offset", "under 2.0, 4.0, 8.0", "deg/s"),
    ("4.2, GG1178", "cross coupling", "under 2.0", "%"),
    ("4.2, GG1178", "linearity", "0.20", "% FS"),
    ("4.2, GG1178", "g-sensitivity", "under 0.1, 0.075, 0.05", "deg/s/g"),
    ("4.2, GG1178", "output resolution", "14", "bit"),
    ("4.2, GG1178", "signal noise", "0.10, 0.20, 0.20", "deg/s rms"),
    ("4.3, GG1178", "supply, current", "4.75 to 5.25 V, 35 mA", ""),
    ("4.3, GG1178", "temperature, vibration", "-40 to 125 degC, over 3.2 g rms", ""),
    ("4.4, HG1930", "size, volume, weight", "2.0 in x 1.3 in, under 4 cu.in, under 0.35 lb", ""),
    ("4.4, HG1930", "power, temperature", "under 3 W, -55 to 85 degC", ""),
    ("4.4, HG1930", "output rate", "up to 2400", "Hz"),
    ("4.4, HG1930", "gyro range", "1440", "deg/s"),
    ("4.4, HG1930", "gyro scale factor", "300", "ppm"),
    ("4.4, HG1930", "angular random walk", "0.15 deg/hr as printed; deg/sqrt(h) is meant", ""),
    ("4.4, HG1930", "accelerometer range", "30", "g"),
    ("4.4, HG1930", "accelerometer linearity", "30", "ppm"),
    ("4.4, HG1930", "accelerometer scale factor", "700", "ppm"),
    ("4.4, HG1930", "accelerometer bias", "4", "mg"),
    ("4.3, ADXL-50", "principle", "capacitance of beams of 150 um, 2 um above substrate", ""),
)  # fmt: skip


def rows() -> list[Row]:
    """Return the rows of the tables, and the grades of the two gyroscopes.

    Returns
    -------
    list of Row
    """
    found = [
        info(f"{table}, {what}", printed, None, unit, WHY)
        for table, what, printed, unit in FIGURES
    ]
    for name, printed, stability in (
        ("4.2, GG1178, in-run bias stability", "1 deg/s", 1.0 * DPS),
        ("4.4, HG1930, gyro bias", "20 deg/h", 20.0 * DEG_PER_HR),
    ):
        grade = gyro_grade(stability) or "worse than moderate"
        found.append(info(name, printed, grade, "", "its grade by table 1.2; " + WHY))
    return found
