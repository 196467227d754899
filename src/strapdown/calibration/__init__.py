"""Calibration of gyroscopes, accelerometers and magnetometers.

Every method ends in a `CalibrationRecord` with covariance, residuals, degrees of freedom and a
verdict against tolerances; `load` reads the records of a device from TOML, and their `apply`
corrects a recording. Which method needs what:

==============================  ===========================================================
`accelerometer_from_poses`      rests in unknown orientations, known gravity
`gyro_from_rate_table`          unknown orientations on a table of known rate
`six_position`                  a levelled plate, each axis up and down
`eighteen_position`             the same with edges; only the norm is used
`against_reference`             the true input, such as `body_rates` of encoder angles
`ellipsoid`                     a magnetometer turned through all orientations
`align_to_accelerometer`        magnetometer and accelerometer in the same poses
`turn_on_bias`                  a rest at the start of a log
`temperature_model`             a log at rest while the temperature changes
==============================  ===========================================================
"""

from strapdown.calibration.alignment import Alignment, align_to_accelerometer
from strapdown.calibration.calibration_set import Calibration
from strapdown.calibration.ellipsoid_fit import ellipsoid
from strapdown.calibration.encoder import (
    Quadrature,
    body_rates,
    body_vectors,
    decode_quadrature,
    start_offset,
)
from strapdown.calibration.file import load, merge_into, save
from strapdown.calibration.multi_position import (
    accelerometer_from_poses,
    distortion_matrix,
    gyro_from_rate_table,
)
from strapdown.calibration.poses import Poses, find_poses, find_turntable_positions
from strapdown.calibration.positions import (
    eighteen_position,
    eighteen_positions,
    six_position,
    six_positions,
    up_down,
)
from strapdown.calibration.record import (
    CalibrationRecord,
    Parameter,
    TemperatureRecord,
    Verdict,
)
from strapdown.calibration.reference import (
    against_reference,
    correction_from_physical,
    physical_parameters,
)
from strapdown.calibration.sphere import Coverage, coverage
from strapdown.calibration.temperature import require_rest, slope_matters, temperature_model
from strapdown.calibration.turn_on import TurnOnBias, turn_on_bias

__all__ = [
    "Alignment",
    "Calibration",
    "CalibrationRecord",
    "Coverage",
    "Parameter",
    "Poses",
    "Quadrature",
    "TemperatureRecord",
    "TurnOnBias",
    "Verdict",
    "accelerometer_from_poses",
    "against_reference",
    "align_to_accelerometer",
    "body_rates",
    "body_vectors",
    "correction_from_physical",
    "coverage",
    "decode_quadrature",
    "distortion_matrix",
    "eighteen_position",
    "eighteen_positions",
    "ellipsoid",
    "find_poses",
    "find_turntable_positions",
    "gyro_from_rate_table",
    "load",
    "merge_into",
    "physical_parameters",
    "require_rest",
    "save",
    "six_position",
    "six_positions",
    "slope_matters",
    "start_offset",
    "temperature_model",
    "turn_on_bias",
    "up_down",
]
