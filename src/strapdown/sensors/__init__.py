"""Sensors: their errors, their datasheets, and raw counts to SI and back."""

from strapdown.sensors.datasheet import Datasheet, Figure, datasheet
from strapdown.sensors.device import Device, NoiseParameters
from strapdown.sensors.digital import Digital
from strapdown.sensors.fixes import GnssFix, StarTracker
from strapdown.sensors.linear import Linear
from strapdown.sensors.noise import Noise
from strapdown.sensors.presets import preset, preset_names
from strapdown.sensors.sampling import Sampling
from strapdown.sensors.scalars import AxisEncoder, Barometer, Pitot, Thermometer, Warmth
from strapdown.sensors.triads import Accelerometer, Gyro, Magnetometer, Samples, Spread

__all__ = [
    "Accelerometer",
    "AxisEncoder",
    "Barometer",
    "Datasheet",
    "Device",
    "Digital",
    "Figure",
    "GnssFix",
    "Gyro",
    "Linear",
    "Magnetometer",
    "Noise",
    "NoiseParameters",
    "Pitot",
    "Samples",
    "Sampling",
    "Spread",
    "StarTracker",
    "Thermometer",
    "Warmth",
    "datasheet",
    "preset",
    "preset_names",
]
