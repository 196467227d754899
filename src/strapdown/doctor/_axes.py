"""Which sensor's axes, and which unit of the gyroscope, agree with how the world turns."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.doctor._axes48 import DETERMINANTS, IDENTITY, SIGNED, index_of, name_of
from strapdown.doctor._course import course_loss, turns_of
from strapdown.doctor._finding import Finding, Severity
from strapdown.doctor._log import Grid, Log
from strapdown.doctor._rest import rest_bias, velocity_at
from strapdown.doctor._scales import WORD, mistake_finding, scales_of
from strapdown.doctor._turning import DECIDED, SURE, Turning, survivors
from strapdown.units import DPS

# What is left unexplained where a hypothesis is believed, relative to the field.
_EXPLAINED: Final = 0.15
_UNKNOWN_BIAS: Final = 3.0 * DPS  # of a gyroscope that is never seen at rest
# Asked first: the unit as stated, a half and the double of it, and degrees for radians.
_USUAL_SCALES: Final = [1.0, 0.5, 2.0, DPS, 1.0 / DPS]


class _Answer(NamedTuple):
    """How badly each hypothesis explains the turning."""

    loss: FloatArray  # (blocks, scales, 48), or 96 where the course tells the field's sign
    signed: bool
    explained: bool  # False: not even the best does
    still: float  # loss of a gyroscope that shows nothing
    course: FloatArray  # the part of the loss that the course makes
    turned: bool  # whether the field turned, so that no turning explains it worse
    clear: bool  # whether what is explained is most of it


_Ask = Callable[[list[float]], _Answer | None]


@dataclass(frozen=True, slots=True, eq=False)
class Relation:
    """How a field turns, seen by the gyroscope: ``Q omega`` is the rate in the field's axes.

    Attributes
    ----------
    sensor : str
        ``"acc"`` or ``"mag"``.
    scale : float
        Factor that the gyroscope's values need.
    alive : list of tuple of int
        Hypotheses that remain, best first: the number of Q, and the sign of the field where it
        was seen, else 0. Empty if none explains how the field turns.
    confidence : float
        Of the best.
    """

    sensor: str
    scale: float
    alive: list[tuple[int, int]]
    confidence: float

    @property
    def decided(self) -> bool:
        """Whether one Q remains."""
        return len({q for q, _ in self.alive}) == 1 and self.confidence >= SURE

    @property
    def agrees(self) -> bool:
        """Whether the recorded axes are among what remains."""
        return any(q == IDENTITY and sign >= 0 for q, sign in self.alive)


def relations(log: Log, grid: Grid, *, quick: bool = False) -> list[Relation]:
    """Return how the field of each sensor turns, seen by the gyroscope.

    Parameters
    ----------
    log, grid
        The sensors.
    quick : bool
        Whether not to ask for the gyroscope's unit.
    """
    bias = rest_bias(grid, log.gnss)
    gyr = grid.fields["gyr"] - bias
    gyr[grid.bad] = 0.0
    fields = {name: values for name, values in grid.fields.items() if name != "gyr"}
    drift = 0.0 if bias.any() else _UNKNOWN_BIAS
    velocity = velocity_at(log.gnss, grid.t)
    turning = Turning(gyr, fields, grid.dt, grid.bad, drift, velocity)
    found = []
    for sensor in fields:
        ask = partial(_losses, log, grid, gyr, turning, sensor)
        scale = 1.0
        if not quick:
            scale = _scale(ask, _USUAL_SCALES)
            relation = _relation(sensor, ask, 1.0) if scale == 1.0 else None
            if relation is None or not relation.decided:
                other = _scale(ask, scales_of("gyr", log.sensors["gyr"].unit))
                scale = other if other != 1.0 else scale
        relation = _relation(sensor, ask, scale)
        if relation is not None:
            found.append(relation)
    return found


def _losses(
    log: Log, grid: Grid, gyr: FloatArray, turning: Turning, sensor: str, scales: list[float]
) -> _Answer | None:
    """Return how badly each hypothesis explains the turning; None where there is none.

    Of 96 hypotheses the second half is for the opposite of the field.
    """
    values = grid.fields[sensor]
    evidence = turning.evidence(sensor, scales)
    if evidence is None:
        return None
    loss, still = evidence.loss, float(evidence.still.sum())
    turned = float(loss.sum(axis=0).min()) < still - DECIDED
    turns = None
    if sensor == "acc" and log.gnss is not None:
        turns = turns_of(log.gnss, grid.t, gyr, values)
    if turns is None:
        explained = evidence.residual <= _EXPLAINED
        return _Answer(loss, False, explained, still, np.zeros_like(loss), turned, evidence.clear)
    course = course_loss(turns, [*scales, 0.0], len(values) * grid.dt)
    still += float(course[:, -1, IDENTITY].sum())
    course = course[:, :-1]
    mirrored = [index_of(-Q) for Q in SIGNED]
    course = np.concatenate((course, course[:, :, mirrored]), axis=2)
    loss = np.concatenate((loss, loss), axis=2) + course
    return _Answer(loss, True, True, still, course, turned, True)


def _relation(sensor: str, ask: _Ask, scale: float) -> Relation | None:
    """Return what remains of the hypotheses at one scale."""
    answer = ask([scale])
    if answer is None:
        return None
    if not answer.explained:
        return Relation(sensor, scale, [], SURE)
    alive, confidence = survivors(answer.loss[:, 0])
    one = len({int(i) % 48 for i in alive}) == 1 and confidence >= SURE
    if IDENTITY not in alive and not (answer.turned and (one or answer.clear)):
        # The field hardly turned: what speaks against the axes are accelerations, or a bias.
        possible, share = survivors(answer.course[:, 0])
        if IDENTITY in possible:
            alive, confidence = possible, share
    signs = [(int(i) % 48, 0 if not answer.signed else (1 if i < 48 else -1)) for i in alive]
    return Relation(sensor, scale, _without_sign(signs), confidence)


def _without_sign(alive: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return hypotheses, those that remain with both signs once, without one."""
    both = {q for q, sign in alive if (q, -sign) in alive}
    return list(dict.fromkeys((q, 0 if q in both else sign) for q, sign in alive))


def _scale(ask: _Ask, scales: list[float]) -> float:
    """Return the scale that explains most; another than one only when it leads clearly."""
    answer = ask(scales)
    if answer is None or not (answer.explained and answer.clear):
        return 1.0
    loss = answer.loss
    best = loss.sum(axis=0).min(axis=1)
    k = int(best.argmin())
    if k == 0 or min(best[0], answer.still) - best[k] < DECIDED:
        return 1.0
    total = loss[:, k].sum(axis=0)
    first, second = np.partition(total, 1)[:2]
    # A scale is believed with the axes as recorded, or with others that stand out.
    believed = total[IDENTITY] - first < DECIDED or second - first >= 0.5 * DECIDED
    columns = np.stack([loss[:, i, int(loss[:, i].sum(axis=0).argmin())] for i in (k, 0)], axis=1)
    _, confidence = survivors(columns)
    return scales[k] if confidence >= SURE and believed else 1.0


def axes_findings(log: Log, found: Iterable[Relation]) -> list[Finding]:
    """Return what the relations say of the sensors' axes and of the gyroscope's unit."""
    by_sensor = {relation.sensor: relation for relation in found}
    out = _unit_findings(log, by_sensor.values())
    decided = {name: r for name, r in by_sensor.items() if r.decided}
    for name in ("acc", "mag"):
        if name in log.sensors and name not in decided:
            out.append(_undecided(name, by_sensor.get(name)))
    if len(decided) == 2:
        out.append(_three(decided["acc"], decided["mag"]))
    elif decided:
        out.append(_two(*decided.values()))
    return out


def _unit_findings(log: Log, found: Iterable[Relation]) -> list[Finding]:
    """Return whether the gyroscope's unit explains how the world turns."""
    asked = [r for r in found if r.decided or r.scale != 1.0]
    if not asked:
        return []
    scales = {r.scale for r in asked}
    names = " and ".join(_FIELD[r.sensor] for r in asked)
    plural = "s" if len(asked) == 1 else ""
    confidence = min(r.confidence for r in asked)
    if len(scales) > 1:
        asked = [max(asked, key=lambda r: r.confidence)]
    scale = asked[0].scale
    if scale != 1.0:
        why = f"only then do its rates explain how {names} turn{plural}"
        stated = log.sensors["gyr"].unit
        return [mistake_finding("gyr", stated, scale, why, max(confidence, 0.5))]
    return [
        Finding(
            check="units",
            severity=Severity.OK,
            sentence=f"The gyroscope's rates explain how {names} turn{plural}: its unit is right.",
            confidence=confidence,
            stream="gyr",
        )
    ]


_FIELD: Final = {"acc": "gravity", "mag": "the magnetic field"}


def _undecided(sensor: str, relation: Relation | None) -> Finding:
    """Return what is left open, or excluded without a single answer."""
    name = WORD[sensor]
    if relation is not None and not relation.alive:
        return Finding(
            check="axes",
            severity=Severity.WARNING,
            sentence=f"The gyroscope does not explain how {_FIELD[sensor]} turns in the {name}, "
            "whatever the axes.",
            confidence=relation.confidence,
            advice="Look for times of one sensor that are off by seconds, doubled or frozen "
            "columns, a wrong unit of the gyroscope, and strong accelerations or magnets.",
            stream=sensor,
        )
    if relation is None or relation.agrees:
        more = ""
        if relation is not None and len(relation.alive) > 1:
            more = f"; the recorded axes are among the {len(relation.alive)} that remain possible"
        return Finding(
            check="axes",
            severity=Severity.NOTE,
            sentence=f"Whether the axes of gyroscope and {name} agree is not observable from "
            f"this motion{more}.",
            confidence=1.0 if relation is None else relation.confidence,
            advice="Turn the box by hand about all three axes, a minute is enough.",
            stream=sensor,
        )
    readings = [_pair_reading(sensor, q, sign) for q, sign in relation.alive[:3]]
    return Finding(
        check="axes",
        severity=Severity.WARNING,
        sentence=f"The axes of gyroscope and {name} disagree, this motion leaves "
        f"{len(relation.alive)} explanations.",
        confidence=SURE,
        advice="The likeliest: " + "; or ".join(readings) + ". Turn the box by hand about all "
        "three axes to know which.",
        stream=sensor,
    )


def _options(sensor: str, Q: FloatArray, sign: int) -> list[str]:
    """Return the options that put a field sensor right, one for each possible sign.

    ``Q omega`` is the rate in the recorded axes; so the true field is ``+-Q'`` times the recorded.
    """
    signs = (1.0, -1.0) if sign == 0 else (float(sign),)
    return [f"--axes {sensor}={name_of(s * Q.T)}" for s in signs]


def _pair_reading(sensor: str, q: int, sign: int) -> str:
    """Return the ways to explain one relation when only two sensors can be compared."""
    Q = SIGNED[q]
    if DETERMINANTS[q] > 0:
        options = _options(sensor, Q, sign)
        if sign >= 0 and q != IDENTITY:
            options = [f"--axes gyr={name_of(Q)}", *options]
    else:
        options = [f"--axes gyr={name_of(Q)}"]
        if sign < 0:
            options = [f"--axes 'gyr={name_of(Q)}; {sensor}=-x,-y,-z'"]
    return " or ".join(options)


def _two(relation: Relation) -> Finding:
    """Return what one field alone says of the axes."""
    q, sign = relation.alive[0]
    name = WORD[relation.sensor]
    if q == IDENTITY and sign >= 0:
        return _agreement((relation,), f"gyroscope and {name}")
    if q == IDENTITY:
        sentence = f"The {name} shows the opposite of what it must: the course over ground turns "
        sentence += "the other way."
    elif DETERMINANTS[q] < 0:
        sentence = f"The gyroscope's axes are mirrored or of the wrong sign against the {name}'s."
    else:
        sentence = f"The axes of gyroscope and {name} disagree; which of the two is wrong, a third"
        sentence += " sensor or the box's drawing must say."
    return Finding(
        check="axes",
        severity=Severity.ERROR,
        sentence=sentence,
        confidence=relation.confidence,
        advice=f"Read it with {_pair_reading(relation.sensor, q, sign)}.",
        stream="gyr" if DETERMINANTS[q] < 0 else relation.sensor,
    )


def _agreement(found: tuple[Relation, ...], names: str) -> Finding:
    """Return that all agree, and which sign stays open."""
    known = any(sign > 0 for relation in found for _, sign in relation.alive)
    fields = " and ".join(WORD[r.sensor] for r in found)
    text = (
        "; the course over ground confirms the sign of gravity."
        if known
        else f", up to the sign of {fields} as a whole, which a gyroscope cannot see: "
        "x,y,z or -x,-y,-z."
    )
    return Finding(
        check="axes",
        severity=Severity.OK,
        sentence=f"The axes of {names} agree{text}",
        confidence=min(relation.confidence for relation in found),
    )


def _three(acc: Relation, mag: Relation) -> Finding:
    """Return which of three sensors is the odd one."""
    (qa, sign), (qm, _) = acc.alive[0], mag.alive[0]
    Qa, Qm = SIGNED[qa], SIGNED[qm]
    confidence = min(acc.confidence, mag.confidence)
    proper = DETERMINANTS[qa] > 0 and DETERMINANTS[qm] > 0
    if qa == qm == IDENTITY and sign >= 0:
        return _agreement((acc, mag), "gyroscope, accelerometer and magnetometer")
    if qa == qm and qa != IDENTITY:
        odd, others = "gyr", "accelerometer and magnetometer"
        options = [f"--axes gyr={name_of(Qa)}"]
    elif qm == IDENTITY and proper:
        odd, others = "acc", "gyroscope and magnetometer"
        options = _options("acc", Qa, sign)
    elif qa == IDENTITY and proper and sign >= 0:
        odd, others = "mag", "gyroscope and accelerometer"
        options = _options("mag", Qm, 0)
    elif proper:
        return _disagreement(confidence, [_options("acc", Qa, sign), _options("mag", Qm, 0)])
    else:  # a mirrored gyroscope, which no turning of the others explains
        relative = Qm @ Qa.T
        relative *= np.linalg.det(relative)
        return _disagreement(
            confidence, [[f"--axes gyr={name_of(Qa)}"], _options("mag", relative, 0)]
        )
    both = " or ".join(options)
    return Finding(
        check="axes",
        severity=Severity.ERROR,
        sentence=f"The {WORD[odd]}'s axes do not match those of {others}, which agree.",
        confidence=confidence,
        advice=f"Read it with {both}"
        + ("; turning alone cannot tell which of the two." if len(options) > 1 else "."),
        stream=odd,
    )


def _disagreement(confidence: float, options: list[list[str]]) -> Finding:
    """Return that no two of three sensors agree."""
    text = " together with ".join(" or ".join(ways) for ways in options)
    return Finding(
        check="axes",
        severity=Severity.ERROR,
        sentence="No two of gyroscope, accelerometer and magnetometer have the same axes.",
        confidence=confidence,
        advice=f"One way to bring them together: {text}.",
    )
