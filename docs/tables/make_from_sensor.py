"""Write docs/tables/from_sensor.md: what estimators take from a sensor, for one preset."""

from pathlib import Path

import strapdown as sd
from strapdown.estimator import Taken

PRESET = "mpu6050"


def formula(taken: Taken) -> str:
    """Return where a parameter comes from."""
    text = f"`{taken.quantity}`"
    if taken.factor != 1.0:
        text = f"{taken.factor:.3g} {text}"
    return f"{text}, not below the default" if taken.floor else text


def main() -> None:
    """Write the table."""
    rows = [("Estimator", "Parameter", "From", "Default", f"`{PRESET}`"), ("---",) * 5]
    box = sd.sensors.preset(PRESET)
    for entry in sd.estimators.entries():
        if not entry.cls.FROM_SENSOR:
            continue
        default, told = entry.cls(), entry.cls.from_sensor(box)
        for taken in entry.cls.FROM_SENSOR:
            values = (getattr(flt, taken.parameter) for flt in (default, told))
            rows.append(
                (
                    f"`{entry.name}`",
                    f"`{taken.parameter}`",
                    formula(taken),
                    *(f"{value:.3g}" for value in values),
                )
            )
    text = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    Path(__file__).with_name("from_sensor.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
