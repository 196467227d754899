"""Noise of sensors: Allan deviation, identification, static statistics, spectrum, bandwidth.

From a log of a device lying still to the parameters of a filter::

    found = strapdown.noise.characterize(rec)  # all sensors, all axes
    strapdown.noise.save(found.record, "noise.toml")
    found.record.filter_noise().gyr_noise  # rad/s/sqrt(Hz)

or step by step on arrays:

=======================  ====================================================================
`allan_deviation`        deviation over averaging times, with intervals: six estimators
`identify`               coefficients by maximum likelihood, or "not observable"
`read_off`               coefficients read off the slopes
`power_density`          one-sided power spectral density
`static_statistics`      means, variances, covariance; `zero_g`, `zero_rate`, `full_statistics`
`low_pass_study`         which cut-off of the sensor's filter to choose
`compare`                beside the figures of a datasheet
=======================  ====================================================================
"""

from strapdown.noise.allan import KINDS, AllanDeviation, allan_deviation, default_taus
from strapdown.noise.bandwidth import LowPassStudy, low_pass_study, sigma_behind_filter
from strapdown.noise.characterize import Characterization, characterize
from strapdown.noise.coefficients import (
    Coefficient,
    Coefficients,
    Status,
    coefficient_unit,
    line,
)
from strapdown.noise.datasheet import Agreement, Comparison, Figure, compare
from strapdown.noise.file import load, save
from strapdown.noise.identify import identify
from strapdown.noise.readoff import read_off
from strapdown.noise.record import AxisNoise, FilterNoise, NoiseRecord, SensorNoise
from strapdown.noise.spectrum import PowerDensity, power_density
from strapdown.noise.static import (
    StaticStatistics,
    ZeroG,
    full_statistics,
    static_statistics,
    zero_g,
    zero_rate,
)
from strapdown.noise.stillness import moving, require_signal, require_still

__all__ = [
    "KINDS",
    "Agreement",
    "AllanDeviation",
    "AxisNoise",
    "Characterization",
    "Coefficient",
    "Coefficients",
    "Comparison",
    "Figure",
    "FilterNoise",
    "LowPassStudy",
    "NoiseRecord",
    "PowerDensity",
    "SensorNoise",
    "StaticStatistics",
    "Status",
    "ZeroG",
    "allan_deviation",
    "characterize",
    "coefficient_unit",
    "compare",
    "default_taus",
    "full_statistics",
    "identify",
    "line",
    "load",
    "low_pass_study",
    "moving",
    "power_density",
    "read_off",
    "require_signal",
    "require_still",
    "save",
    "sigma_behind_filter",
    "static_statistics",
    "zero_g",
    "zero_rate",
]
