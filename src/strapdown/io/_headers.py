"""What the columns of a table mean, from their names.

A name is taken apart into words; each says a sensor (``gyro``, ``accelerometer``), an axis
(``x``, ``[0]``), a unit (``dps``, ``(m/s^2)``), or that the column is something else
(``bias``, ``covariance``). A column is recognised when its words leave no doubt.
"""

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from strapdown.errors import InputError
from strapdown.io._roles import NEEDED, ROLES
from strapdown.units import Unit, parse_unit


class Meaning(NamedTuple):
    """What a name says: its role, its unit, and unit text that no unit is spelled like."""

    role: str | None = None
    unit: Unit | None = None
    strange_unit: str | None = None


def _split(words: str) -> list[str]:
    return words.split()


_SENSORS: Final = {
    "gyr": "gyr gyro gyros gyroscope gyroscopes gyrometer omega angvel angularvelocity"
    " angularrate rotationrate turnrate",
    "acc": "acc accel accelero accelerometer accelerometers acceleration accelerations"
    " specificforce",
    "mag": "mag magn magneto magnetometer magnetic magfield magneticfield compass",
}
_SENSOR_OF: Final = {word: key for key, words in _SENSORS.items() for word in _split(words)}
_PAIRS: Final = {
    ("angular", "velocity"): "gyr",
    ("angular", "rate"): "gyr",
    ("rotation", "rate"): "gyr",
    ("turn", "rate"): "gyr",
    ("specific", "force"): "acc",
}
# One letter is a sensor only right before its axis: gx, a_y, w_RS_S_z.
_LETTERS: Final = {"g": "gyr", "w": "gyr", "a": "acc", "f": "acc", "m": "mag"}
_AXES: Final = {"x": 0, "y": 1, "z": 2, "0": 0, "1": 1, "2": 2}

# Words that make a column something other than a sample of the sensor.
_OTHER: Final = frozenset(
    _split(
        "bias biases integral integrated delta dt std sigma var variance cov covariance norm"
        " magnitude abs error offset scale clip clipping clipped device id count counter accuracy"
        " status flag range user free gravity grav timestamp time stamp noise temp temperature rms"
        " jerk setpoint sp"
    )
)
# Gravity is taken off in these. ROS calls its specific force linear_acceleration, though.
_NO_GRAVITY: Final = frozenset(("linear", "lin"))

_TIME: Final = frozenset(
    _split(
        "t time timestamp timestamps ts datetime date epoch clock stamp elapsed millis micros"
        " sampletime unixtime msec usec seconds secs"
    )
)
_TIME_COMPANY: Final = _TIME | frozenset(
    _split(
        "unix since start boot device sensor local system utc gps gnss field header log logging"
        " recording sample rx host s sec ms us ns second ts txt imu reboot 1970 since1970"
    )
)
_TIME_UNITS: Final = {"millis": "ms", "micros": "us", "elapsed": "", "seconds": "s", "secs": "s"}

_FUSED: Final = re.compile(
    r"^(gyros?|gyr|accel|acc|magn?|omega|[gwafm])_?([xyz])$|^([xyz])_?(gyros?|gyr|accel|acc|magn?)$"
)
# Words in brackets or at the end that say nothing of interest.
_NOISE: Final = frozenset(
    _split(
        "raw cal calibrated uncal uncalibrated filtered value values data txt val v sensor imu"
        " n/a field the of axis total body b rs msg fast wgs84 n a.u. au"
    )
)


def _words(text: str) -> list[str]:
    """Return the lower-case words of a name, split at signs and where the case changes."""
    words: list[str] = []
    for piece in re.split(r"[\s_.,:;\-\[\](){}<>\"'#%|]+", text):
        if not piece:
            continue
        if _unit_or_none(piece, None) is None:
            piece = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", piece)
            piece = re.sub(r"([A-Z]+)([A-Z][a-z])", r"\1 \2", piece)
        words += piece.lower().split()
    return words


@lru_cache(maxsize=4096)
def _unit_or_none(text: str, quantity: str | None) -> Unit | None:
    """Return the unit that `text` spells, or None; ``rad`` of a rate is rad/s."""
    if quantity == "angular_rate" and text.lower() in ("rad", "deg", "degree", "degrees"):
        text += "/s"
    if quantity == "angle" and text.lower() == "dege7":
        text = "deg_1e7"
    try:
        return parse_unit(text, quantity)
    except InputError:
        return None


def _native(name: str) -> Meaning | None:
    """Return the meaning of a name such as ``gyr_x_dps``: a role and perhaps a unit."""
    lowered = name.strip().lower()
    if lowered.startswith("q_nb_"):  # the native names of a reference's attitude
        lowered = "ref_q_" + lowered.removeprefix("q_nb_")
    elif lowered.startswith("ref_q_nb_"):
        lowered = "ref_q_" + lowered.removeprefix("ref_q_nb_")
    for role in sorted(ROLES, key=len, reverse=True):
        if lowered == role:
            return Meaning(role)
        if lowered.startswith(role + "_"):
            unit = _unit_or_none(name.strip()[len(role) + 1 :], ROLES[role].quantity)
            if unit is not None:
                return Meaning(role, unit)
    return None


def _bracketed(name: str) -> tuple[str, str | None]:
    """Return the name without a unit in brackets at its end, and that unit's text."""
    found = re.match(r"^(.*?)\s*[\[({<]\s*([^\[\](){}<>]+?)\s*[\])}>]\s*$", name)
    if not found or found[2].strip().lower() in _AXES or not found[1].strip():
        return name, None
    return found[1], found[2]


def _unit_in(words: Sequence[str], quantity: str) -> Unit | None:
    """Return the unit that the last words spell together."""
    for start in range(len(words)):
        for joint in ("_", "/"):
            unit = _unit_or_none(joint.join(words[start:]), quantity)
            if unit is not None:
                return unit
    return None


def _vector(words: list[str], context: str | None, ros: bool) -> tuple[str, list[str]] | None:
    """Return the role of a component of a sensor's vector, and the words left over."""
    if _OTHER.intersection(words) or (_NO_GRAVITY.intersection(words) and not ros):
        return None
    sensor: str | None = None
    axis: int | None = None
    left: list[str] = []
    k = 0
    while k < len(words):
        word = words[k].rstrip("0123456789") or words[k]
        pair = (word, words[k + 1]) if k + 1 < len(words) else (word, "")
        fused = _FUSED.match(word)
        if fused and sensor in (None, _SENSOR_OF.get(fused[1] or fused[4])) and axis is None:
            stem = fused[1] or fused[4]
            sensor = _SENSOR_OF.get(stem) or _LETTERS[stem]
            axis = _AXES[fused[2] or fused[3]]
        elif pair in _PAIRS and sensor is None:
            sensor = _PAIRS[pair]
            k += 1
        elif word in _SENSOR_OF and sensor in (None, _SENSOR_OF[word]):
            sensor = _SENSOR_OF[word]
        elif words[k] in _AXES and axis is None and (sensor or context):
            axis = _AXES[words[k]]
        elif word in _LETTERS and k == 0 and sensor is None and len(words) > 1:
            sensor = _LETTERS[word]
        else:
            left.append(words[k])
        k += 1
    if sensor is None and context in ("gyr", "acc", "mag"):
        sensor = context
    if sensor is None or axis is None:
        return None
    return f"{sensor}_{'xyz'[axis]}", [w for w in left if w not in _NOISE]


_POSITION: Final = {
    "lat": "lat", "latitude": "lat", "lon": "lon", "lng": "lon", "long": "lon",
    "longitude": "lon", "alt": "height", "altitude": "height", "height": "height",
    "hgt": "height", "elevation": "height", "ele": "height",
}  # fmt: skip
_COMPASS: Final = {
    "n": "n", "north": "n", "e": "e", "east": "e", "d": "d", "down": "d", "u": "u", "up": "u",
}  # fmt: skip
_VELOCITY: Final = {f"v{axis}": axis for axis in "nedu"} | {f"vel{axis}": axis for axis in "nedu"}


def _gnss(words: list[str]) -> tuple[str, list[str]] | None:
    """Return the role of a column of GNSS fixes, and the words left over."""
    known = set(words)
    deviation = known & {"std", "sigma", "accuracy", "acc", "sd", "stddev"}
    compass = next((_COMPASS[w] for w in words if w in _COMPASS), None)
    fused = next((_VELOCITY[w] for w in words if w in _VELOCITY), None)
    speed = bool(known & {"vel", "velocity", "v"}) or fused is not None
    left = [
        w
        for w in words
        if w not in _COMPASS and w not in _VELOCITY and w not in deviation and w not in _POSITION
    ]
    left = [w for w in left if w not in ("pos", "position", "vel", "velocity", "v", "gps", "gnss")]
    if deviation:
        if compass and compass != "u" and known & {"pos", "position"}:
            return f"std_{compass}", left
        if compass and compass != "u" and speed:
            return f"std_v_{compass}", left
        if "horizontal" in known or "hor" in known:
            return "h_acc", [w for w in left if w not in ("horizontal", "hor")]
        if known & {"vertical", "ver"}:
            return "v_acc", [w for w in left if w not in ("vertical", "ver")]
        return None
    if known & {"hacc", "eph"}:
        return "h_acc", [w for w in left if w not in ("hacc", "eph")]
    if known & {"vacc", "epv"}:
        return "v_acc", [w for w in left if w not in ("vacc", "epv")]
    axis = fused or (compass if speed else None)
    if axis and not known & {"bias", "innov", "variance", "cov"}:
        return f"v_{axis}", left
    place = [_POSITION[w] for w in words if w in _POSITION]
    if len(place) == 1 and not known & {"ellipsoid", "relative", "var", "variance", "baro"}:
        return place[0], [w for w in left if w not in ("msl", "hae", "amsl")]
    if known & {"heading", "course", "bearing", "cog"} and not known & {"var", "rate"}:
        return "heading", [w for w in left if w not in ("heading", "course", "bearing", "cog")]
    return None


def _scalar(words: list[str]) -> tuple[str, list[str]] | None:
    """Return the role of a sensor with one number per sample, and the words left over."""
    known = set(words)
    if known & {"bias", "std", "sigma", "var", "variance", "accuracy", "error", "offset"}:
        return None
    for role, spellings in (
        ("temp", {"temp", "temperature", "thermometer"}),  # of the barometer, too
        ("pressure", {"pressure", "press", "baro", "barometer"}),
        ("airspeed", {"airspeed", "tas", "ias", "eas"}),
        ("angle", {"encoder"}),
    ):
        hit = known & spellings
        if hit and not (role == "pressure" and known & {"alt", "altitude", "height"}):
            extra = {"angle", "air", "static", "ambient", "gyr", "gyro", "acc", "imu", "sensor"}
            return role, [w for w in words if w not in hit | extra]
    if "speed" in known and known & {"wheel", "odo", "odometer", "vehicle", "forward", "can"}:
        noise = {"speed", "wheel", "odo", "odometer", "vehicle", "forward", "can"}
        return "speed", [w for w in words if w not in noise]
    return None


def _attitude(words: list[str]) -> tuple[str, list[str]] | None:
    """Return the role of a component of an attitude, and the words left over."""
    known = set(words)
    if known & {"rate", "bias", "std", "speed", "sigma", "var", "variance", "covariance"}:
        return None
    owned = bool(known & {"ref", "reference", "truth", "gt", "opt", "optical", "mocap", "true"})
    prefix = "ref_" if owned else ""
    noise = {"ref", "reference", "truth", "gt", "opt", "optical", "mocap", "true", "euler"}
    for angle in ("roll", "pitch", "yaw"):
        if angle in known:
            return prefix + angle, [w for w in words if w != angle and w not in noise]
    joined = " ".join(w for w in words if w not in noise and w not in _NOISE)
    found = re.match(r"^(?:q|quat|quaternion|orientation)[ ]?([wxyz0123])\b(.*)$", joined)
    if found:
        axis = {"0": "w", "1": "x", "2": "y", "3": "z"}.get(found[1], found[1])
        return f"{prefix}q_{axis}", found[2].split()
    return None


def _time(words: list[str]) -> bool:
    """Tell whether a name is one of a time axis."""
    if words in (["ms"], ["us"], ["ns"], ["s"], ["sec"]):
        return True
    known = set(words)
    return bool(known & _TIME) and known <= _TIME_COMPANY


def recognise(name: str, *, context: str | None = None, ros: bool = False) -> Meaning:
    """Return what a column's name says.

    Parameters
    ----------
    name : str
        As in the file.
    context : str, optional
        Group that the whole table belongs to, such as ``"gyr"`` for gyroscope.csv; bare axes
        ``x``, ``y``, ``z`` are then its components.
    ros : bool
        Whether the table is ROS's sensor_msgs/Imu, whose linear_acceleration holds gravity.

    Returns
    -------
    Meaning
        Without a role when the name says nothing, or not enough.
    """
    native = _native(name)
    if native is not None and not (native.role == "speed" and context == "gnss"):
        return native
    base, unit_text = _bracketed(name)
    words = _words(base)
    if unit_text is not None and unit_text.lower() in _NOISE:
        unit_text = None
    if _time(words):
        spelled = [_TIME_UNITS.get(w, w) for w in words]
        unit = _unit_or_none(unit_text, "time") if unit_text else None
        if unit_text is None:
            of_time = [u for w in spelled if w != "t" and (u := _unit_or_none(w, "time"))]
            unit = of_time[-1] if of_time else None
        return Meaning("t", unit)
    found = (
        _attitude(words)
        or _vector(words, context, ros)
        or (_scalar(words) if context != "gnss" else None)
        or _gnss(words)
    )
    if found is None:
        return Meaning()
    role, left = found
    quantity = ROLES[role].quantity
    if unit_text is not None:
        unit = _unit_or_none(unit_text, quantity)
        return Meaning(role, unit, None if unit else unit_text)
    return Meaning(role, _unit_in(left, quantity))


def recognise_all(names: Sequence[str], *, context: str | None = None) -> list[Meaning]:
    """Return what the columns of one table mean; each role is given once.

    Of several columns with one role, such as those of a second sensor, the first counts. A
    group that lacks a component is left to the caller, except that altitude or speed without
    latitude and longitude are no fixes.
    """
    ros = any({"angular", "velocity"} <= set(_words(name)) for name in names)
    meanings = [recognise(name, context=context, ros=ros) for name in names]
    roles = {m.role for m in meanings}
    fixes = {"lat", "lon"} <= roles
    quats = {"q_w", "q_x", "q_y", "q_z"} <= roles
    taken: set[str] = set()
    for k, meaning in enumerate(meanings):
        role = meaning.role
        if role is None:
            continue
        group = ROLES[role].group
        lonely = (group == "gnss" and not fixes) or (role in ("roll", "pitch", "yaw") and quats)
        if lonely or (role in taken and role != "t"):
            meanings[k] = Meaning()
        taken.add(role)
    return meanings


def missing_parts(group: str, roles: Sequence[str]) -> list[str]:
    """Return the columns that a group needs and that are not among `roles`."""
    return [role for role in NEEDED.get(group, ()) if role not in roles]
