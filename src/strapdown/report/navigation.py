"""Track, velocity, mount and their errors, as sections of a report."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from strapdown._types import FloatArray
from strapdown.earth import ned_from_lla
from strapdown.evaluation import NavigationErrors, Window, mount_at
from strapdown.recording import PositionReference, Recording, Reference
from strapdown.report import decimate
from strapdown.report.figures import (
    AXIS_COLORS,
    ESTIMATE,
    REFERENCE,
    Band,
    Panel,
    Picture,
    Series,
    grid_figure,
    sigma_band,
    time_figure,
)
from strapdown.report.page import Block, Section, plot, table, text
from strapdown.report.tiles import Box, Tiles
from strapdown.rotation import quat_conj, quat_mul, rotvec_from_quat, rpy_from_quat
from strapdown.solution import Solution
from strapdown.units import DEG

AXES = ("north", "east", "down")
FIX = "#e08a1e"
WITHHELD = "#c2272d"


class _Local(NamedTuple):
    """Positions north, east, down [m] of one origin, at their times; NaN rows left out."""

    t: FloatArray
    r_n: FloatArray


def _local(t: FloatArray, lla: FloatArray, origin: FloatArray) -> _Local:
    there = ~np.isnan(lla).any(axis=1)
    r_n = ned_from_lla(lla[there], origin)
    r_n[:, 2] = origin[2] - lla[there, 2]  # heights, free of the Earth's curvature
    return _Local(t[there], r_n)


def _origin(sol: Solution) -> FloatArray | None:
    """Return the first position of the solution."""
    if sol.lla is None:
        return None
    there = np.flatnonzero(~np.isnan(sol.lla).any(axis=1))
    return sol.lla[there[0]] if len(there) else None


def _counting(ref: PositionReference | None) -> PositionReference | None:
    """Return the samples of a reference that count, None if there are none."""
    if ref is not None and ref.valid is not None:
        ref = ref.rows(ref.valid)
    return ref if ref is not None and len(ref) else None


def track_section(
    sol: Solution,
    rec: Recording,
    outages: Sequence[Window] = (),
    tiles: Tiles | None = None,
) -> Section:
    """Return the track in local metres, the height and the velocity; fixes not used in red."""
    origin = _origin(sol)
    if origin is None or sol.lla is None:
        return Section(title="Track", blocks=[])
    track = _local(sol.t, sol.lla, origin)
    ref = rec.reference.position if rec.reference is not None else None
    ref = _counting(ref)
    reference = _local(ref.t, ref.lla, origin) if ref is not None else None
    fixes = _local(rec.gnss.t, rec.gnss.lla, origin) if rec.gnss is not None else None

    path: list[Series | Band] = []
    if reference is not None:
        path.append(_path(reference, "reference", REFERENCE, 3.5))
    if fixes is not None:
        withheld = np.zeros(len(fixes.t), np.bool_)
        for w in outages:
            withheld |= (fixes.t >= w.start_s) & (fixes.t <= w.start_s + w.length_s)
        for name, color, those in (
            ("GNSS fixes", FIX, ~withheld), ("withheld fixes", WITHHELD, withheld),
        ):  # fmt: skip
            if those.any():
                x, y = fixes.r_n[those, 1], fixes.r_n[those, 0]
                path.append(Series(x=x, y=y, name=name, color=color, kind="points", width=4.0))
    path.append(_path(track, "estimate", ESTIMATE, 1.6))
    for row, name, color in ((0, "start", "#2c8a4b"), (-1, "end", "#1d232b")):
        x, y = track.r_n[[row], 1], track.r_n[[row], 0]
        path.append(Series(x=x, y=y, name=name, color=color, kind="points", width=10.0))
    pictures = _pictures(tiles, sol.lla, origin)
    chart = Panel(x_label="east [m]", y_label="north [m]", items=path, height=520, equal=True,
                  pictures=pictures)  # fmt: skip
    where = f"{origin[0] / DEG:.6f}°, {origin[1] / DEG:.6f}°, {origin[2]:.1f} m"
    note = tiles.credit if tiles is not None and pictures else ""
    if tiles is not None and not pictures:
        note = f"The map {tiles.path.name} has no tiles here."
    return Section(
        title="Track",
        intro=f"Metres north and east of the first position, {where}.",
        blocks=[
            plot(grid_figure([chart]), note),
            plot(time_figure(_motion(sol, rec, track, ref, reference, fixes))),
        ],
    )


def _pictures(tiles: Tiles | None, lla: FloatArray, origin: FloatArray) -> list[Picture]:
    """Return the map below a track; each tile lies right in its middle and is turned nowhere."""
    if tiles is None:
        return []
    lat, lon = lla[~np.isnan(lla).any(axis=1), :2].T
    pictures = []
    for (south, west, north, east), url in tiles.covering(_view(lat, lon)):
        middle = 0.5 * (south + north), 0.5 * (west + east)
        corners = [(north, middle[1]), (south, middle[1]), (middle[0], west), (middle[0], east)]
        r_n = ned_from_lla([(*corner, origin[2]) for corner in corners], origin)
        (top, _, _), (bottom, _, _), (_, left, _), (_, right, _) = r_n.tolist()
        pictures.append(
            Picture(url=url, left=left, top=top, width=right - left, height=top - bottom)
        )
    return pictures


def _view(lat: FloatArray, lon: FloatArray) -> Box:
    """Return the box around a track [rad] that fills a chart twice as wide as high."""
    south, north, west, east = lat.min(), lat.max(), lon.min(), lon.max()
    squeeze = max(np.cos(0.5 * (south + north)), 1e-3)
    up = 0.55 * max(north - south, 0.5 * squeeze * (east - west))
    across = 2.0 * up / squeeze
    lat_0, lon_0 = 0.5 * (south + north), 0.5 * (west + east)
    return Box(lat_0 - up, lon_0 - across, lat_0 + up, lon_0 + across)


def _path(local: _Local, name: str, color: str, width: float) -> Series:
    """Return a track, thinned out with its extremes kept."""
    east, north = decimate.path(local.t, local.r_n[:, 1], local.r_n[:, 0])
    return Series(x=east, y=north, name=name, color=color, kind="path", width=width)


def _motion(
    sol: Solution,
    rec: Recording,
    track: _Local,
    ref: PositionReference | None,
    reference: _Local | None,
    fixes: _Local | None,
) -> list[Panel]:
    """Return height and velocity over time."""
    height: list[Series | Band] = []
    if reference is not None:
        height.append(Series(x=reference.t, y=-reference.r_n[:, 2], name="reference",
                             color=REFERENCE, width=3.0))  # fmt: skip
    if fixes is not None:
        height.append(Series(x=fixes.t, y=-fixes.r_n[:, 2], name="GNSS fixes", color=FIX,
                             kind="points", width=3.0))  # fmt: skip
    height.append(Series(x=track.t, y=-track.r_n[:, 2], name="estimate"))
    panels = [Panel(y_label="height gain [m]", items=height, height=120)]
    if sol.v_n is None:
        return panels
    for i, axis in enumerate(AXES):
        items: list[Series | Band] = []
        if ref is not None and ref.v_n is not None:
            items.append(Series(x=ref.t, y=ref.v_n[:, i], name="reference", color=REFERENCE,
                                width=3.0))  # fmt: skip
        if rec.gnss is not None and rec.gnss.v_n is not None:
            items.append(Series(x=rec.gnss.t, y=rec.gnss.v_n[:, i], name="GNSS fixes", color=FIX,
                                kind="points", width=3.0))  # fmt: skip
        items.append(Series(x=sol.t, y=sol.v_n[:, i], name="estimate"))
        panels.append(Panel(y_label=f"v {axis} [m/s]", items=items, height=120))
    return panels


def outage_section(outages: Sequence[Window], *, causal: bool) -> Section:
    """Return the errors in the outages that were asked for."""
    rows = [
        (
            f"{w.start_s:g} to {w.start_s + w.length_s:g}",
            w.horizontal_error_m,
            w.vertical_error_m,
            w.percent_of_distance,
            w.heading_error_deg,
        )
        for w in outages
    ]
    columns = (
        "fixes withheld [s]", "horizontal [m]", "vertical [m]", "of the way [%]", "heading [°]",
    )  # fmt: skip
    where = "at the end" if causal else "in the middle"
    return Section(
        title="Outages",
        intro=f"Error of the antenna {where} of each, against the reference's position or, "
        "without one, against the withheld fixes. A dash: there was no solution.",
        blocks=[table(columns, rows, digits=3)],
    )


def sigma_section(sol: Solution) -> Section:
    """Return the standard deviations of position and velocity that the estimator states."""
    panels = []
    for label, std in (
        ("position [m]", sol.std_position_n),
        ("velocity [m/s]", sol.std_velocity_n),
    ):
        if std is not None:
            items = [
                Series(x=sol.t, y=std[:, i], name=AXES[i], color=AXIS_COLORS[i]) for i in range(3)
            ]
            panels.append(Panel(y_label=label, items=items, log_y=True))
    return Section(
        title="Standard deviations",
        intro="Of position and velocity, as the estimator states them.",
        blocks=[plot(time_figure(panels))] if panels else [],
    )


def mount_section(sol: Solution, reference: Reference | None = None) -> Section:
    """Return the estimated mount, roll, pitch and yaw of the box in the vehicle."""
    blocks: list[Block] = []
    known = np.zeros(len(sol), np.bool_)
    if sol.q_vb is not None:  # the identity to the last bit: not found yet
        known = (sol.q_vb != (1.0, 0.0, 0.0, 0.0)).any(axis=1)
    if sol.q_vb is not None and known.any():
        span = (float(sol.t[0]), float(sol.t[-1]))
        blocks += _mount_blocks(sol.t[known], sol.q_vb[known], reference, span)
    elif sol.q_vb is not None:
        blocks.append(text("The mount was not found; the box's axes stand for the vehicle's."))
    if sol.antenna_b is not None and sol.antenna_b.any():
        items = [
            Series(x=sol.t, y=sol.antenna_b[:, i], name="xyz"[i], color=AXIS_COLORS[i])
            for i in range(3)
        ]
        blocks += [
            plot(time_figure([Panel(y_label="lever arm [m]", items=items)]),
                 "From the IMU to the GNSS antenna, along the box's axes."),
            table(("axis", "at the end [m]"),
                  list(zip("xyz", sol.antenna_b[-1].tolist(), strict=True))),
        ]  # fmt: skip
    return Section(
        title="Mount and lever arm",
        intro="Attitude of the box in the vehicle's axes, forward, right, down, from where it is "
        "known.",
        blocks=blocks,
    )


def _mount_blocks(
    t: FloatArray, q_vb: FloatArray, reference: Reference | None, span: tuple[float, float]
) -> list[Block]:
    """Return the mount over time, and at the end beside that of the reference."""
    names = ("roll", "pitch", "yaw")
    rpy = rpy_from_quat(q_vb) / DEG
    items = [
        Series(x=t, y=rpy[:, i], name=name, color=AXIS_COLORS[i], period=360.0)
        for i, name in enumerate(names)
    ]
    figure = plot(time_figure([Panel(y_label="angle [°]", items=items)], span=span))
    truth = None
    if reference is not None and reference.mount is not None:
        truth = mount_at(reference.mount, t[-1:])
    if truth is None:
        rows = list(zip(names, rpy[-1].tolist(), strict=True))
        return [figure, table(("axis", "at the end [°]"), rows)]
    theirs = rpy_from_quat(truth[0]) / DEG
    both = list(zip(names, rpy[-1].tolist(), theirs.tolist(), strict=True))
    turn = rotvec_from_quat(quat_mul(q_vb[-1], quat_conj(truth[0]))) / DEG
    about = ", ".join(f"{part:.2f}" for part in turn)
    return [
        figure,
        table(("axis", "at the end [°]", "reference [°]"), both),
        text(
            f"They differ by {np.linalg.norm(turn):.2f}°: {about}° about the vehicle's forward, "
            "right and down axes."
        ),
    ]


def error_table(errors: NavigationErrors) -> Block:
    """Return the summary of the position and velocity errors."""
    units = {"horizontal": "m", "vertical": "m", "velocity": "m/s"}
    rows = [
        (f"{name} [{units[name]}]", s.rmse, s.median, s.p95, s.maximum)
        for name, s in errors.statistics().items()
    ]
    return table(
        ("error", "RMSE", "median", "95 %", "maximum"),
        rows,
        caption="Position and velocity errors against the reference",
        digits=3,
    )


def error_section(errors: NavigationErrors, span: tuple[float, float] | None = None) -> Section:
    """Return position and velocity errors over time, with 3 sigma where it is stated."""
    blocks = []
    for values, std, what, unit in (
        (errors.position_n, errors.std_position_n, "position", "m"),
        (errors.velocity_n, errors.std_velocity_n, "velocity", "m/s"),
    ):
        if values is None:
            continue
        panels = []
        for i, axis in enumerate(AXES):
            items: list[Series | Band] = []
            if std is not None:
                items.append(sigma_band(errors.t, std[:, i]))
            items.append(Series(x=errors.t, y=values[:, i], name="error"))
            panels.append(Panel(y_label=f"{axis} [{unit}]", items=items, height=120))
        blocks.append(plot(time_figure(panels, span=span), f"Errors of the {what}."))
    return Section(
        title="Position errors",
        intro="Estimate less reference, where the reference counts.",
        blocks=blocks,
    )
