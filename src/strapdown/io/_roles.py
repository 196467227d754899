"""What a column can stand for, and where it goes in a recording."""

from collections.abc import Mapping
from typing import Final, NamedTuple


class Role(NamedTuple):
    """Place of one column: group of columns that are sampled together, field, component."""

    group: str
    field: str
    component: int
    quantity: str


def _triad(group: str, field: str, names: str, quantity: str) -> dict[str, Role]:
    return {
        name: Role(group, field, component, quantity)
        for component, name in enumerate(names.split())
    }


# Short names, as the option `columns` takes them. A column that states its unit in the native
# way is the short name and the unit: gyr_x_dps, lat_deg, t_us.
ROLES: Final[Mapping[str, Role]] = {
    "t": Role("time", "t", 0, "time"),
    **_triad("gyr", "gyr", "gyr_x gyr_y gyr_z", "angular_rate"),
    **_triad("acc", "acc", "acc_x acc_y acc_z", "acceleration"),
    **_triad("mag", "mag", "mag_x mag_y mag_z", "magnetic_field"),
    **_triad("gnss", "lla", "lat lon", "angle"),
    "height": Role("gnss", "lla", 2, "length"),
    **_triad("gnss", "v_n", "v_n v_e v_d", "speed"),
    "v_u": Role("gnss", "v_u", 0, "speed"),
    **_triad("gnss", "std_position_n", "std_n std_e std_d", "length"),
    **_triad("gnss", "std_velocity_n", "std_v_n std_v_e std_v_d", "speed"),
    "h_acc": Role("gnss", "h_acc", 0, "length"),
    "v_acc": Role("gnss", "v_acc", 0, "length"),
    "heading": Role("gnss", "heading", 0, "angle"),
    "pressure": Role("baro", "pressure", 0, "pressure"),
    "temp": Role("temperature", "temp_degc", 0, "temperature"),
    "airspeed": Role("airspeed", "airspeed", 0, "speed"),
    "speed": Role("speed", "speed", 0, "speed"),
    "angle": Role("encoder", "angle", 0, "angle"),
    **_triad("star", "q_nb", "star_q_w star_q_x star_q_y star_q_z", "dimensionless"),
    # Attitude from elsewhere; its frames are found out by `read(..., reference=FILE)`.
    **_triad("attitude", "q", "q_w q_x q_y q_z", "dimensionless"),
    **_triad("attitude", "rpy", "roll pitch yaw", "angle"),
    # A reference in the log itself: body as recorded to NED, as all of this project.
    **_triad("ref_attitude", "q_nb", "ref_q_w ref_q_x ref_q_y ref_q_z", "dimensionless"),
    **_triad("ref_attitude", "rpy", "ref_roll ref_pitch ref_yaw", "angle"),
    "ref_valid": Role("ref_attitude", "valid", 0, "dimensionless"),
    **_triad("ref_position", "lla", "ref_lat ref_lon", "angle"),
    "ref_height": Role("ref_position", "lla", 2, "length"),
    **_triad("ref_position", "v_n", "ref_v_n ref_v_e ref_v_d", "speed"),
    "ref_position_valid": Role("ref_position", "valid", 0, "dimensionless"),
    **_triad("ref_mount", "q_vb", "ref_q_vb_w ref_q_vb_x ref_q_vb_y ref_q_vb_z", "dimensionless"),
    "ref_mount_valid": Role("ref_mount", "valid", 0, "dimensionless"),
    "gyr_real": Role("gyr", "gyr_real", 0, "dimensionless"),
    "acc_real": Role("acc", "acc_real", 0, "dimensionless"),
}

# Fields without which a group is no stream.
NEEDED: Final[Mapping[str, tuple[str, ...]]] = {
    "gyr": ("gyr_x", "gyr_y", "gyr_z"),
    "acc": ("acc_x", "acc_y", "acc_z"),
    "mag": ("mag_x", "mag_y", "mag_z"),
    "gnss": ("lat", "lon", "height"),
    "baro": ("pressure",),
    "temperature": ("temp",),
    "airspeed": ("airspeed",),
    "speed": ("speed",),
    "encoder": ("angle",),
    "star": ("star_q_w", "star_q_x", "star_q_y", "star_q_z"),
    "ref_position": ("ref_lat", "ref_lon", "ref_height"),
    "ref_mount": ("ref_q_vb_w", "ref_q_vb_x", "ref_q_vb_y", "ref_q_vb_z"),
}

# What users call the groups in `units="gyr=dps,acc=g"`, and the quantity that is meant.
GROUP_NAMES: Final[Mapping[str, str]] = {
    "t": "time",
    "time": "time",
    "gyr": "gyr",
    "acc": "acc",
    "mag": "mag",
    "baro": "baro",
    "pressure": "baro",
    "temperature": "temperature",
    "temp": "temperature",
    "airspeed": "airspeed",
    "speed": "speed",
    "encoder": "encoder",
    "angle": "encoder",
}


def roles_of(group: str) -> list[str]:
    """Return the short names of a group's columns."""
    return [name for name, role in ROLES.items() if role.group == group]
