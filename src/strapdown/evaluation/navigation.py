"""Errors of a navigation solution against a reference: position, velocity, attitude."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray
from strapdown.earth import dcm_ne, ecef_from_lla
from strapdown.errors import DataGap, MissingStream
from strapdown.evaluation.attitude import AttitudeErrors, attitude_errors
from strapdown.evaluation.statistics import ErrorStatistics
from strapdown.evaluation.sync import MAX_GAP_S, Match, match
from strapdown.recording import PositionReference, Reference
from strapdown.solution import Solution, Status


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NavigationErrors:
    """Estimate less reference at the reference's times that count.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Times of the position reference [s].
    position_n : ndarray, shape (m, 3)
        Position error north, east, down [m]; down is the negative height error.
    velocity_n : ndarray, shape (m, 3) or None
        Velocity error north, east, down [m/s].
    std_position_n, std_velocity_n : ndarray, shape (m, 3) or None
        Standard deviations that the estimator states [m], [m/s].
    lever_arm_b : ndarray, shape (3,)
        From the IMU to the point compared, in b [m].
    attitude : AttitudeErrors or None
        Attitude errors, where the reference has an attitude that overlaps.
    left_out : mapping of str to int
        Reference samples that do not count, by reason.
    """

    t: FloatArray
    position_n: FloatArray
    velocity_n: FloatArray | None
    std_position_n: FloatArray | None
    std_velocity_n: FloatArray | None
    lever_arm_b: FloatArray
    attitude: AttitudeErrors | None
    left_out: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.t)

    @property
    def horizontal(self) -> FloatArray:
        """Horizontal distance from the reference [m], shape (m,)."""
        return np.asarray(np.hypot(self.position_n[:, 0], self.position_n[:, 1]))

    @property
    def vertical(self) -> FloatArray:
        """Height error [m], shape (m,), positive where the estimate is too high."""
        return -self.position_n[:, 2]

    @property
    def velocity(self) -> FloatArray | None:
        """Length of the velocity error [m/s], shape (m,), or None."""
        if self.velocity_n is None:
            return None
        return np.asarray(np.linalg.norm(self.velocity_n, axis=1))

    @property
    def horizontal_within_3sigma(self) -> float | None:
        """Share of samples inside the stated 3 sigma ellipse of north and east, or None."""
        if self.std_position_n is None:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.hypot(*(self.position_n[:, :2] / self.std_position_n[:, :2]).T)
        return float(np.mean(np.where(np.isnan(ratio), 0.0, ratio) <= 3.0))

    def statistics(self) -> dict[str, ErrorStatistics]:
        """Return the summaries of horizontal and vertical [m] and velocity error [m/s]."""
        out = {
            "horizontal": ErrorStatistics.of(self.horizontal),
            "vertical": ErrorStatistics.of(self.vertical),
        }
        if (velocity := self.velocity) is not None:
            out["velocity"] = ErrorStatistics.of(velocity)
        return out

    def summary(self) -> dict[str, Any]:
        """Return the figures that are printed and stored; those of the attitude too."""
        units = {"horizontal": "m", "vertical": "m", "velocity": "m_s"}
        out: dict[str, Any] = {} if self.attitude is None else self.attitude.summary()
        out["position_samples"] = len(self)
        for name, s in self.statistics().items():
            out[f"{name}_rmse_{units[name]}"] = s.rmse
            out[f"{name}_p95_{units[name]}"] = s.p95
            out[f"{name}_max_{units[name]}"] = s.maximum
        out["horizontal_within_3sigma"] = self.horizontal_within_3sigma
        return out


def navigation_errors(
    solution: Solution,
    reference: Reference,
    *,
    lever_arm_b: ArrayLike | None = None,
    max_gap: float = MAX_GAP_S,
    remove_heading: bool | None = None,
) -> NavigationErrors:
    """Return position, velocity and attitude errors on the samples that count.

    A reference sample counts if it is marked valid and the solution's samples that enclose
    it hold a position, are not aligning, and are no gap apart. The solution is interpolated
    to the reference's times.

    Parameters
    ----------
    solution : Solution
        What was estimated, with position.
    reference : Reference
        What is taken for true, with position.
    lever_arm_b : array_like, shape (3,), optional
        From the IMU to the point that the reference describes, often the antenna, in b [m].
        By default the two are taken for the same.
    max_gap : float
        Longest interval between samples of the solution that is bridged [s].
    remove_heading : bool, optional
        As for `attitude_errors`.

    Returns
    -------
    NavigationErrors

    Raises
    ------
    MissingStream
        If the solution or the reference has no position.
    DataGap
        If no sample counts.
    """
    _checks.instance("solution", solution, Solution, "an estimator's `run` gives one")
    _checks.instance("reference", reference, Reference, "a recording has it as `rec.reference`")
    if reference.position is None:
        raise MissingStream("navigation errors need a reference with position, it has none.")
    arm = np.zeros(3) if lever_arm_b is None else _checks.as_vector("lever_arm_b", lever_arm_b)
    lla, v_n, truth = solution.lla, solution.v_n, reference.position
    if lla is None:
        raise MissingStream("navigation errors need a solution with position, it has none.")
    if arm.any():
        moved = solution.at(arm)
        lla, v_n = lla if moved.lla is None else moved.lla, moved.v_n

    found = match(solution.t, truth.t, max_gap)
    located = ~np.isnan(lla).any(axis=1) & ((solution.status & Status.ALIGNING) == 0)
    if v_n is not None:
        located &= ~np.isnan(v_n).any(axis=1)
    counts, left_out = _counting(located, truth, found)
    rows = found.rows[counts]
    lla_ref = truth.lla[rows]
    # in ECEF there is no step at the antimeridian; the chord is within 1e-6 m of the ground
    r_e = found.linear(ecef_from_lla(lla))[counts]
    position_n = np.einsum("kij,kj->ki", dcm_ne(lla_ref), r_e - ecef_from_lla(lla_ref))
    position_n[:, 2] = lla_ref[:, 2] - found.linear(lla[:, 2])[counts]  # free of curvature

    def interpolated(values: FloatArray | None) -> FloatArray | None:
        return None if values is None else found.linear(values)[counts]

    velocity_n = None
    if v_n is not None and truth.v_n is not None:
        velocity_n = found.linear(v_n)[counts] - truth.v_n[rows]
    attitude = None
    if reference.attitude is not None:
        try:
            attitude = attitude_errors(
                solution, reference, max_gap=max_gap, remove_heading=remove_heading
            )
        except DataGap:  # position and attitude references may cover different times
            attitude = None
    return NavigationErrors(
        t=truth.t[rows],
        position_n=position_n,
        velocity_n=velocity_n,
        std_position_n=interpolated(solution.std_position_n),
        std_velocity_n=interpolated(solution.std_velocity_n),
        lever_arm_b=arm,
        attitude=attitude,
        left_out=left_out,
    )


def _counting(
    located: BoolArray, truth: PositionReference, found: Match
) -> tuple[BoolArray, dict[str, int]]:
    """Return which matched samples count, and how many do not for which reason."""
    usable = ~truth.nan_rows()
    if truth.valid is not None:
        usable &= truth.valid
    usable = usable[found.rows]
    ready = found.both(located)
    reasons = {
        "outside the span of the solution": found.outside,
        "in a gap of the solution": found.in_gap,
        "reference not valid": int(np.count_nonzero(~usable)),
        "solution without position yet": int(np.count_nonzero(usable & ~ready)),
    }
    reasons = {reason: count for reason, count in reasons.items() if count}
    if not (usable & ready).any():
        listed = ", ".join(f"{count} {reason}" for reason, count in reasons.items())
        raise DataGap(f"no reference sample counts of {len(truth)}: {listed or 'it is empty'}.")
    return usable & ready, reasons
