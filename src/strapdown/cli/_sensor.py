"""``--sensor``: the noise that an estimator is told, from a preset or a noise file."""

from pathlib import Path
from typing import TYPE_CHECKING

from strapdown.cli import _errors
from strapdown.errors import InputError

if TYPE_CHECKING:
    from strapdown.estimator import Noisy


def named(text: str) -> "Noisy":
    """Return the sensor that ``--sensor`` names.

    Parameters
    ----------
    text : str
        Presets with commas between, which share a box; or a file of ``strapdown characterize``.

    Returns
    -------
    Device or NoiseRecord

    Raises
    ------
    InputError
        If it is neither a preset nor a noise file.
    """
    if Path(text).suffix or Path(text).exists():
        from strapdown import noise

        with _errors.given("--sensor"):
            return noise.load(text)
    from strapdown import sensors

    known = sensors.preset_names()
    device = sensors.Device(name=text)
    for name in (part.strip() for part in text.split(",")):
        if name not in known:
            from strapdown._checks import nearest

            raise InputError(
                f"--sensor must be a preset ({', '.join(known)}) or a noise file such as "
                f"noise.toml, got {name!r}{nearest(name, known)}."
            )
        device = device.with_sensors_of(sensors.preset(name))
    return device
