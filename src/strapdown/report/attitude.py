"""The attitude of a solution and its errors, as sections of a report."""

from typing import NamedTuple

import numpy as np

from strapdown._types import BoolArray, FloatArray
from strapdown.evaluation import AttitudeErrors, match, mount_at
from strapdown.evaluation.sync import MAX_GAP_S
from strapdown.recording import Reference
from strapdown.report.figures import (
    AXIS_COLORS,
    ESTIMATE,
    REFERENCE,
    REFERENCE_PALE,
    Band,
    Panel,
    Series,
    sigma_band,
    time_figure,
)
from strapdown.report.page import Block, Section, number, plot, table
from strapdown.report.scene import frame_rows, scene
from strapdown.rotation import quat_conj, quat_mul, rpy_from_quat
from strapdown.solution import Solution, Status
from strapdown.units import DEG

TURN_DEG = 360.0
BUCKETS = 3000  # attitude is what one zooms into: twice the detail of other figures


def aligned(sol: Solution) -> BoolArray:
    """Return where the solution has an attitude."""
    return np.asarray((sol.status & Status.ALIGNING) == 0)


class TurnedReference(NamedTuple):
    """The reference as it is drawn beside the estimate."""

    t: FloatArray
    q_nb: FloatArray
    valid: BoolArray  # False where it is known but does not count


def turned_reference(
    reference: Reference | None, errors: AttitudeErrors | None
) -> TurnedReference | None:
    """Return the reference, turned by the constant by which an arbitrary heading differs."""
    if reference is None or reference.attitude is None:
        return None
    part = reference.attitude
    use = ~part.nan_rows()
    if not use.any():
        return None
    q_nb = part.q_nb[use]
    if errors is not None and errors.heading_constant:
        half = 0.5 * errors.heading_constant
        turn = np.array([np.cos(half), 0.0, 0.0, np.sin(half)])
        q_nb = quat_mul(np.broadcast_to(turn, q_nb.shape), q_nb)
    valid = np.ones(len(q_nb), dtype=np.bool_) if part.valid is None else part.valid[use]
    return TurnedReference(part.t[use], q_nb, valid)


def scene_section(
    sol: Solution, reference: Reference | None, errors: AttitudeErrors | None
) -> Section:
    """Return the 3D view."""
    rows = frame_rows(sol.t)
    if not len(rows):
        return Section(title="3D view", blocks=[])
    ghost = None
    turned = turned_reference(reference, errors)
    if turned is not None:
        interval = float(np.median(np.diff(turned.t))) if len(turned.t) > 1 else 0.0
        found = match(turned.t, sol.t[rows], max_gap=max(MAX_GAP_S, 2.0 * interval))
        ghost = np.full((len(rows), 4), np.nan)
        counts = found.both(turned.valid)
        ghost[found.rows[counts]] = found.quats(turned.q_nb)[counts]
    view = scene(sol.t[rows], sol.q_nb[rows], aligned(sol)[rows], ghost)
    return Section(title="3D view", blocks=[view])


def attitude_section(
    sol: Solution, reference: Reference | None, errors: AttitudeErrors | None
) -> Section:
    """Return roll, pitch and yaw, and the standard deviations where stated."""
    q_nb, whose = sol.q_nb, "box, axes as recorded"
    turned = turned_reference(reference, errors)
    if sol.q_vb is not None:
        q_nb, whose = quat_mul(q_nb, quat_conj(sol.q_vb)), "vehicle, through the estimated mount"
        turned = _through_mount(turned, reference)
    rpy = np.where(aligned(sol)[:, np.newaxis], rpy_from_quat(q_nb), np.nan) / DEG
    panels = []
    for column, name in enumerate(("roll", "pitch", "yaw")):
        period = None if name == "pitch" else TURN_DEG
        items = [] if turned is None else _reference_lines(turned, column, period)
        items.append(Series(x=sol.t, y=rpy[:, column], name="estimate", period=period))
        panels.append(Panel(y_label=f"{name} [°]", items=items))
    if sol.std_attitude_n is not None:
        std = np.where(aligned(sol)[:, np.newaxis], sol.std_attitude_n, np.nan) / DEG
        items = [
            Series(x=sol.t, y=std[:, i], name=f"sigma about {name}", color=AXIS_COLORS[i])
            for i, name in enumerate(("north", "east", "down"))
        ]
        panels.append(Panel(y_label="std. dev. [°]", items=items, log_y=True, height=120))
    note = f"Attitude of the {whose}, relative to north, east, down; {_heading(sol)}"
    if errors is not None and errors.heading_removed and turned is not None:
        note += f" The reference is turned by {errors.heading_constant / DEG:.2f}° for the figure."
    return Section(
        title="Attitude", intro=note, blocks=[plot(time_figure(panels, buckets=BUCKETS))]
    )


def _reference_lines(turned: TurnedReference, column: int, period: float | None) -> list[Series]:
    """Return the reference where it counts, and the rest of it in a paler line."""
    angle = rpy_from_quat(turned.q_nb)[:, column] / DEG
    lines = []
    for mask, name, color in (
        (~turned.valid, "reference, not counted", REFERENCE_PALE),
        (turned.valid, "reference", REFERENCE),
    ):
        if mask.any():
            y = np.where(mask, angle, np.nan)
            lines.append(Series(x=turned.t, y=y, name=name, color=color, width=3.0, period=period))
    return lines


def _through_mount(
    turned: TurnedReference | None, reference: Reference | None
) -> TurnedReference | None:
    """Return the reference's attitude of the vehicle, or None if its mount is not known."""
    if turned is None or reference is None or reference.mount is None:
        return None
    q_vb = mount_at(reference.mount, turned.t)
    if q_vb is None:
        return None
    return turned._replace(q_nb=quat_mul(turned.q_nb, quat_conj(q_vb)))


def _heading(sol: Solution) -> str:
    """Return what heading is measured from, as a half-sentence."""
    return {
        "true": "heading from true north.",
        "magnetic": "heading from magnetic north.",
        "arbitrary": "heading from an arbitrary direction.",
    }[sol.heading_reference]


# --- errors -----------------------------------------------------------------------------


def error_table(errors: AttitudeErrors) -> Block:
    """Return the summary of the attitude errors."""
    rows = [
        (name, s.rmse / DEG, s.median / DEG, s.p95 / DEG, s.maximum / DEG)
        for name, s in errors.statistics().items()
    ]
    return table(
        ("attitude error", "RMSE [°]", "median [°]", "95 % [°]", "maximum [°]"),
        rows,
        caption="Attitude errors against the reference",
        digits=3,
    )


def error_notes(errors: AttitudeErrors) -> list[str]:
    """Return what must be known to read the attitude errors, one sentence each."""
    notes = [f"{number(len(errors))} samples of the reference count."]
    if errors.left_out:
        listed = ", ".join(f"{number(count)} {why}" for why, count in errors.left_out.items())
        notes.append(f"Left out: {listed}.")
    notes.append(errors.heading_note)
    if errors.through_own_mount:
        notes.append(
            "All attitude errors are those of the vehicle, estimate and reference each taken "
            "through its own mount."
        )
    elif errors.axes == "vehicle":
        notes.append("Roll, pitch and yaw are those of the vehicle, by the reference's mount.")
    within, ratio = errors.inclination_within_3sigma, errors.inclination_sigma_ratio
    if within is not None and ratio is not None:
        notes.append(
            f"{100.0 * within:.1f} % of the inclination errors lie within the stated 3 sigma; "
            f"the stated sigma is {ratio:.2f} times what 97 % would have needed."
        )
    return notes


def error_section(errors: AttitudeErrors, span: tuple[float, float] | None = None) -> Section:
    """Return the attitude errors over time, with 3 sigma where it is stated."""

    def panel(name: str, values: FloatArray, sigma: FloatArray | None = None) -> Panel:
        items: list[Series | Band] = []
        if sigma is not None:
            items.append(sigma_band(errors.t, sigma / DEG))
        items.append(Series(x=errors.t, y=values / DEG, name="error", color=ESTIMATE))
        return Panel(y_label=f"{name} [°]", items=items, height=125)

    std = errors.std_n
    split = [
        panel("total", errors.total),
        panel("inclination", errors.inclination),
        panel("heading", errors.heading, None if std is None else std[:, 2]),
    ]
    if std is not None:
        split.append(panel("about north", errors.tilt_n[:, 0], std[:, 0]))
        split.append(panel("about east", errors.tilt_n[:, 1], std[:, 1]))
    names = ("roll", "pitch", "yaw")
    rpy = [panel(f"{name} error", errors.rpy[:, i]) for i, name in enumerate(names)]
    return Section(
        title="Attitude errors",
        intro="Estimate less reference, where the reference counts. Heading: about the "
        "vertical, positive clockwise. Inclination: between the two verticals, made of the "
        "parts about north and east.",
        blocks=[
            plot(time_figure(split, span=span)),
            plot(
                time_figure(rpy, span=span),
                "Near a pitch of ±90° roll and yaw are not defined: their differences grow "
                "there without meaning.",
            ),
        ],
    )
