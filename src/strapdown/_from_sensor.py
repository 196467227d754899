"""From the noise of a sensor to the parameters of an estimator."""

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from strapdown.estimator import Estimator


class Taken(NamedTuple):
    """How a parameter follows from the noise of a sensor: ``factor * quantity``.

    Attributes
    ----------
    parameter : str
        Of the estimator.
    quantity : str
        Of `strapdown.sensors.NoiseParameters`.
    factor : float
        From the quantity to the parameter.
    floor : bool
        The parameter stands for motion, vibration or the room besides the sensor's own noise:
        the default stays where it is the larger.
    """

    parameter: str
    quantity: str
    factor: float = 1.0
    floor: bool = False


class Noisy(Protocol):
    """What knows the noise of a sensor: a device of `sensors`, a record of `noise`."""

    def noise_parameters(self) -> Any:
        """Return `strapdown.sensors.NoiseParameters`."""


def parameters_of(cls: type["Estimator"], sensor: Noisy) -> dict[str, float]:
    """Return the parameters of an estimator that a sensor's noise gives.

    Raises
    ------
    ValueError
        If the sensor states none of the noises that the estimator takes.
    TypeError
        If it is neither a device nor a noise record.
    """
    if not hasattr(sensor, "noise_parameters"):
        raise TypeError(
            "`sensor` must be a device such as strapdown.sensors.preset('mpu6050'), or a noise "
            f"record such as strapdown.noise.load('noise.toml'), got {sensor!r}."
        )
    noise = sensor.noise_parameters()
    defaults = {f.name: f.default for f in fields(cls)}  # type: ignore[arg-type]
    values: dict[str, float] = {}
    for parameter, quantity, factor, floor in cls.FROM_SENSOR:
        value = factor * getattr(noise, quantity)
        if not math.isnan(value):
            values[parameter] = max(value, defaults[parameter]) if floor else value
    if not values:
        asked = ", ".join(taken.quantity for taken in cls.FROM_SENSOR)
        raise ValueError(
            f"`sensor` must state a noise that {cls.NAME} takes ({asked}), got "
            f"{getattr(sensor, 'name', type(sensor).__name__)}, which states none of them."
        )
    return values
