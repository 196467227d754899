"""Calibrate from recordings: which samples, which reference, which method.

What the commands ``strapdown calibrate`` do, for use from Python. Each function takes one or
several recordings of the same device, finds in them what its method needs, and returns the
records with notes on what it had to assume.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from strapdown import motion
from strapdown._checks import one_of
from strapdown._types import FloatArray
from strapdown.calibration.alignment import align_to_accelerometer
from strapdown.calibration.ellipsoid_fit import DIRECTION_LIMIT, HARD_IRON_LIMIT, ellipsoid
from strapdown.calibration.gyro_logs import (
    bias_at_rest,
    rates_and_reference,
    table_positions,
    usual_method,
)
from strapdown.calibration.multi_position import accelerometer_from_poses, gyro_from_rate_table
from strapdown.calibration.place import (
    Place,
    about_record,
    duration_of,
    field_of,
    gravity_of,
    reference_attitude,
)
from strapdown.calibration.poses import Poses, find_poses
from strapdown.calibration.positions import eighteen_position, six_position
from strapdown.calibration.record import CalibrationRecord, Fit
from strapdown.calibration.reference import against_reference
from strapdown.calibration.temperature import require_rest, temperature_model
from strapdown.errors import InputError, MissingStream
from strapdown.recording import Recording
from strapdown.rotation import dcm_from_quat, interpolate, rotvec_from_dcm
from strapdown.units import DEG, UT


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What a calibration from recordings gave.

    Attributes
    ----------
    records : tuple of Fit
        The records.
    notes : tuple of str
        What was assumed or left out, one sentence each.
    """

    records: tuple[Fit, ...]
    notes: tuple[str, ...] = ()


def accelerometer(
    recs: Sequence[Recording],
    *,
    method: str = "poses",
    gravity: float | None = None,
    place: Place | None = None,
    tolerances: Mapping[str, float] | None = None,
    sensor_id: str = "",
) -> Outcome:
    """Calibrate the accelerometer from the rests in recordings.

    Parameters
    ----------
    recs : sequence of Recording
        Logs in which the device was held still in many orientations.
    method : {"poses", "six", "eighteen", "reference"}
        Norm in unknown orientations; prescribed positions on a level plate; or the
        attitude that the recording's reference states.
    gravity : float, optional
        Local gravity [m/s^2]; from the place by default.
    place : Place, optional
        Where it was, if the recordings do not say.
    tolerances : mapping of str to float, optional
        See `CalibrationRecord.with_tolerances`.
    sensor_id : str
        Which piece of hardware; from the recordings by default.

    Returns
    -------
    Outcome
    """
    one_of("method", method, ("poses", "six", "eighteen", "reference"))
    notes: list[str] = []
    g = gravity_of(recs, gravity, place, notes)
    poses = [_poses(rec) for rec in recs]
    means = np.vstack([p.acc for p in poses])
    notes.append(f"{len(means)} poses found in {duration_of(recs):.0f} s.")
    about = about_record(recs, place, sensor_id, "acc")
    if method == "six":
        record = six_position(means, g, tolerances=tolerances, **about)
    elif method == "eighteen":
        record = eighteen_position(means, g, tolerances=tolerances, **about)
    elif method == "reference":
        true = np.vstack([_force_in_body(r, p, g) for r, p in zip(recs, poses, strict=True)])
        record = against_reference("acc", means, true, tolerances=tolerances, **about)
        record = replace(record, reference=g)
    else:
        std = max((p.acc_std for p in poses if len(p)), default=None)
        record = accelerometer_from_poses(means, g, std=std, tolerances=tolerances, **about)
    return Outcome(records=(record,), notes=tuple(notes))


def gyroscope(
    recs: Sequence[Recording],
    *,
    table_rates: Sequence[float] = (),
    resolution: float | None = None,
    method: str | None = None,
    place: Place | None = None,
    tolerances: Mapping[str, float] | None = None,
    sensor_id: str = "",
) -> Outcome:
    """Calibrate the gyroscope.

    Parameters
    ----------
    recs : sequence of Recording
        Logs on a turntable, with a reference attitude, or at rest.
    table_rates : sequence of float
        Rates of the turntable [rad/s]; not needed where the recording has its encoder. Each
        position takes the nearest, or zero if it stands.
    resolution : float, optional
        Angle of one count of the encoders that the reference attitude comes from [rad]; without
        it the reference is taken as smooth.
    method : {"table", "reference", "rest"}, optional
        By default what the recordings allow, in this order; ``"rest"`` gives the bias alone.
    place : Place, optional
        For the date.
    tolerances : mapping of str to float, optional
        See `CalibrationRecord.with_tolerances`.
    sensor_id : str
        Which piece of hardware; from the recordings by default.

    Returns
    -------
    Outcome
    """
    if method is None:
        method = usual_method(recs, table_rates)
    one_of("method", method, ("table", "reference", "rest"))
    about = about_record(recs, place, sensor_id, "gyr")
    if method == "table":
        means, rates, std = table_positions(recs, table_rates)
        record = gyro_from_rate_table(means, rates, std=std, tolerances=tolerances, **about)
        return Outcome(
            records=(record,),
            notes=(f"{len(means)} positions found in {duration_of(recs):.0f} s.",),
        )
    if method == "reference":
        pairs = [rates_and_reference(rec, resolution) for rec in recs]
        samples, true = (np.vstack(part) for part in zip(*pairs, strict=True))
        record = against_reference("gyr", samples, true, tolerances=tolerances, **about)
        return Outcome(records=(record,))
    record = bias_at_rest(recs, about)
    if tolerances:
        record = record.with_tolerances(tolerances)
    return Outcome(
        records=(record,),
        notes=(
            "a log at rest gives the bias alone; scale factors and axes are left as they are.",
        ),
    )


def magnetometer(
    recs: Sequence[Recording],
    *,
    method: str = "ellipsoid",
    field: float | None = None,
    place: Place | None = None,
    acc: CalibrationRecord | None = None,
    align: bool = True,
    hard_iron_limit: float = HARD_IRON_LIMIT,
    direction_limit: float = DIRECTION_LIMIT,
    tolerances: Mapping[str, float] | None = None,
    sensor_id: str = "",
) -> Outcome:
    """Calibrate the magnetometer, and turn it into the accelerometer's axes.

    Parameters
    ----------
    recs : sequence of Recording
        Logs in which the device was turned through all orientations in one place.
    method : {"ellipsoid", "reference"}
        The shape alone; or the attitude that the recording's reference states and the field
        of the place.
    field : float, optional
        Strength of the field [T]; by default from the world magnetic model where place and date
        are known, else from the samples.
    place : Place, optional
        Where and when, if the recordings do not say.
    acc : CalibrationRecord, optional
        Calibration of the accelerometer, for the alignment.
    align : bool
        False leaves the magnetometer's axes as the ellipsoid fit gives them.
    hard_iron_limit, direction_limit : float
        See `ellipsoid`.
    tolerances : mapping of str to float, optional
        See `CalibrationRecord.with_tolerances`.
    sensor_id : str
        Which piece of hardware; from the recordings by default.

    Returns
    -------
    Outcome
    """
    one_of("method", method, ("ellipsoid", "reference"))
    samples = np.vstack([rec.need("mag").mag for rec in recs])
    about = about_record(recs, place, sensor_id, "mag")
    notes: list[str] = []
    model = field_of(recs, place, notes)
    if method == "reference":
        if model is None:
            raise InputError(
                "the reference method needs the field of the place; give latitude and longitude "
                "with `--at`."
            )
        true = np.vstack([_field_in_body(rec, model) for rec in recs])
        record = against_reference("mag", samples, true, tolerances=tolerances, **about)
        return Outcome(records=(record,), notes=tuple(notes))
    if field is None and model is not None:
        field = float(np.linalg.norm(model))
        notes.append(f"the field is {field / UT:.2f} uT by the world magnetic model.")
    record = ellipsoid(
        samples,
        field,
        hard_iron_limit=hard_iron_limit,
        direction_limit=direction_limit,
        tolerances=tolerances,
        **about,
    )
    if align:
        record = _aligned(recs, record, acc, notes)
    return Outcome(records=(record,), notes=tuple(notes))


def temperature(
    rec: Recording,
    *,
    place: Place | None = None,
    tolerances: Mapping[str, float] | None = None,
    sensor_id: str = "",
) -> Outcome:
    """Return the linear change with temperature of all sensors of one log at rest.

    Parameters
    ----------
    rec : Recording
        A log at rest, in one pose, with a temperature stream.
    place : Place, optional
        For the date.
    tolerances : mapping of str to float, optional
        Slopes that need no compensation.
    sensor_id : str
        Which piece of hardware; from the recording by default.

    Returns
    -------
    Outcome

    Raises
    ------
    InputError
        If the log moves, or the temperature hardly changes.
    """
    thermometer = rec.need("temperature")
    known = ~np.isnan(thermometer.temp_degc)
    records: list[Fit] = []
    if rec.imu is not None:
        mask = motion.rest_mask(rec.imu.t, rec.imu.gyr, rec.imu.acc)
        require_rest(rec.imu.t, mask, "temperature calibration")
    streams = [(rec.imu, "gyr"), (rec.imu, "acc"), (rec.mag, "mag")]
    for stream, sensor in streams:
        if stream is None:
            continue
        temp_degc = np.interp(
            stream.t, thermometer.t[known], thermometer.temp_degc[known], left=np.nan, right=np.nan
        )
        about = about_record([rec], place, sensor_id, sensor)
        about.pop("temp_degc")
        samples = getattr(stream, sensor)
        records.append(
            temperature_model(sensor, temp_degc, samples, tolerances=tolerances, **about)
        )
    if not records:
        raise MissingStream("the log must have gyroscope, accelerometer or magnetometer.")
    return Outcome(records=tuple(records))


# --- accelerometer and magnetometer -------------------------------------------------------


def _poses(rec: Recording) -> Poses:
    imu = rec.need("imu")
    if rec.mag is None:
        return find_poses(imu.t, imu.gyr, imu.acc)
    return find_poses(imu.t, imu.gyr, imu.acc, rec.mag.t, rec.mag.mag)


def _aligned(
    recs: Sequence[Recording],
    record: CalibrationRecord,
    acc: CalibrationRecord | None,
    notes: list[str],
) -> CalibrationRecord:
    """Return the record turned into the accelerometer's axes, if the poses allow it."""
    poses = [_poses(rec) for rec in recs if rec.imu is not None]
    fields = [p.mag for p in poses if p.mag is not None]
    if not fields:
        notes.append("no accelerometer in the log: the axes are those of the magnetometer alone.")
        return record
    forces = np.vstack([p.acc for p in poses])
    means = np.vstack(fields)
    good = ~np.isnan(means).any(axis=1)
    f = forces[good] if acc is None else acc.correct(forces[good])
    try:
        found = align_to_accelerometer(record.correct(means[good]), f)
    except InputError as error:
        hint = " Calibrate the accelerometer into the same file first." if acc is None else ""
        notes.append(f"not aligned to the accelerometer: {error}{hint}")
        return record
    angle = float(np.linalg.norm(rotvec_from_dcm(found.C_am)))
    notes.append(
        f"turned by {angle / DEG:.2f} deg into the accelerometer's axes "
        f"(sigma {found.std.max() / DEG:.2f} deg, {len(f)} poses); "
        f"inclination {found.inclination / DEG:.1f} deg."
    )
    quality = {
        **record.quality,
        "alignment_deg": angle / DEG,
        "alignment_3sigma_deg": 3.0 * float(found.std.max()) / DEG,
        "inclination_deg": found.inclination / DEG,
    }
    return replace(record.rotated(found.C_am), method="ellipsoid, aligned", quality=quality)


def _force_in_body(rec: Recording, poses: Poses, g: float) -> FloatArray:
    """Return the specific force at rest in the attitude that the reference states."""
    t, q_nb = reference_attitude(rec)
    middle = 0.5 * (poses.t_start + poses.t_stop)
    C_nb = dcm_from_quat(interpolate(middle, t, q_nb))
    return np.asarray(-g * C_nb[:, 2, :])  # C_nb^T (0, 0, -g)


def _field_in_body(rec: Recording, field_n: FloatArray) -> FloatArray:
    t, q_nb = reference_attitude(rec)
    t_mag = rec.need("mag").t
    C_nb = dcm_from_quat(interpolate(np.clip(t_mag, t[0], t[-1]), t, q_nb))
    field_b = np.einsum("kji,j->ki", C_nb, field_n)
    field_b[(t_mag < t[0]) | (t_mag > t[-1])] = np.nan
    return np.asarray(field_b)
