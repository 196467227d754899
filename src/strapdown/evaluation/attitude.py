"""Errors of an attitude against a reference, split into heading and inclination."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from strapdown import _checks
from strapdown._types import BoolArray, FloatArray
from strapdown.errors import DataGap, MissingStream
from strapdown.evaluation.statistics import ErrorStatistics, robust_circular_mean
from strapdown.evaluation.sync import MAX_GAP_S, match
from strapdown.recording import AttitudeReference, MountReference, Reference
from strapdown.rotation import interpolate, quat_conj, quat_mul, rpy_from_quat, wrap_pi
from strapdown.solution import Solution, Status
from strapdown.units import DEG

COVERAGE = 0.97  # share of samples that an honest 3 sigma bound should hold at least


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AttitudeErrors:
    """Estimate less reference at the reference's times that count.

    Attributes
    ----------
    t : ndarray, shape (m,)
        Times of the reference [s].
    total : ndarray, shape (m,)
        Angle of the whole rotation error [rad], from 0 to pi.
    heading : ndarray, shape (m,)
        Rotation error about the vertical [rad], positive where the estimate is turned
        clockwise too far, seen from above.
    inclination : ndarray, shape (m,)
        Angle between the estimated and the true vertical [rad], from 0 to pi.
    tilt_n : ndarray, shape (m, 2)
        The inclination error as a rotation vector about north and east [rad].
    rpy : ndarray, shape (m, 3)
        Differences of roll, pitch and yaw [rad], each in (-pi, pi]. Near a pitch of 90 deg
        roll and yaw are not defined, and their differences say nothing.
    axes : {'body', 'vehicle'}
        What `rpy` belongs to: the box, or the vehicle by way of the reference's mount.
    through_own_mount : bool
        Whether all errors are the vehicle's, each side taken through its own mount.
    std_n : ndarray, shape (m, 3) or None
        Standard deviations that the estimator states about north, east and down [rad]. They
        are the box's: None where the errors are the vehicle's.
    heading_constant : float
        What was taken from all heading and yaw errors [rad]; 0 if nothing was.
    heading_removed : bool
        Whether a constant was taken away, as an arbitrary heading needs.
    heading_note : str
        What that means, in one sentence.
    left_out : mapping of str to int
        Reference samples that do not count, by reason.
    """

    t: FloatArray
    total: FloatArray
    heading: FloatArray
    inclination: FloatArray
    tilt_n: FloatArray
    rpy: FloatArray
    axes: str
    through_own_mount: bool
    std_n: FloatArray | None
    heading_constant: float
    heading_removed: bool
    heading_note: str
    left_out: Mapping[str, int]

    def __len__(self) -> int:
        return len(self.t)

    def statistics(self) -> dict[str, ErrorStatistics]:
        """Return the summaries [rad] of total, heading, inclination, roll, pitch and yaw."""
        out = {
            name: ErrorStatistics.of(getattr(self, name))
            for name in ("total", "heading", "inclination")
        }
        for column, name in enumerate(("roll", "pitch", "yaw")):
            out[name] = ErrorStatistics.of(self.rpy[:, column])
        return out

    def _needed(self) -> FloatArray | None:
        """Return how many stated standard deviations the inclination error is."""
        if self.std_n is None:
            return None
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.hypot(*(self.tilt_n / self.std_n[:, :2]).T)
        return np.asarray(np.where(np.isnan(ratio), 0.0, ratio))  # no error, none stated

    @property
    def inclination_within_3sigma(self) -> float | None:
        """Share of samples whose tilt lies inside the stated 3 sigma ellipse, or None."""
        needed = self._needed()
        return None if needed is None else float(np.mean(needed <= 3.0))

    @property
    def inclination_sigma_ratio(self) -> float | None:
        """Stated sigma over the sigma that was needed, or None.

        Needed is the one with which 97 % of the samples just lie within 3 sigma. Below 1 the
        estimator is too sure of itself, above 1 it is more careful than it has to be.
        """
        needed = self._needed()
        if needed is None:
            return None
        last = max(0, int(np.ceil(COVERAGE * len(needed))) - 1)
        reached = float(np.partition(needed, last)[last])  # may be infinite
        return 3.0 / reached if reached > 0.0 else float("inf")

    def summary(self) -> dict[str, float | int | str | bool | None]:
        """Return the figures that are printed and stored, angles in degrees."""
        out: dict[str, float | int | str | bool | None] = {"samples": len(self)}
        for name, s in self.statistics().items():
            out[f"{name}_rmse_deg"] = s.rmse / DEG
        for name in ("total", "heading", "inclination"):
            out[f"{name}_max_deg"] = float(np.abs(getattr(self, name)).max()) / DEG
        for name, values in (
            ("heading", self.heading), ("roll", self.rpy[:, 0]), ("pitch", self.rpy[:, 1]),
        ):  # fmt: skip
            out[f"{name}_std_deg"] = _circular_std(values) / DEG
        ratio = self.inclination_sigma_ratio
        out["inclination_within_3sigma"] = self.inclination_within_3sigma
        out["inclination_sigma_ratio"] = (
            ratio if ratio is not None and np.isfinite(ratio) else None
        )
        out["heading_constant_removed"] = self.heading_removed
        out["heading_constant_deg"] = self.heading_constant / DEG
        out["rpy_axes"] = self.axes
        out["through_own_mount"] = self.through_own_mount
        return out


def attitude_errors(
    solution: Solution,
    reference: Reference | AttitudeReference,
    *,
    max_gap: float = MAX_GAP_S,
    remove_heading: bool | None = None,
) -> AttitudeErrors:
    """Return the attitude errors on the samples that count.

    With the error rotation ``e = q_nb * conj(q_nb_reference)``, resolved in n, as in the
    benchmark BROAD [1]_: total ``2 acos|e_w|``, heading ``2 atan|e_z / e_w|`` and
    inclination ``2 acos sqrt(e_w^2 + e_z^2)``, computed in forms that keep their digits
    near zero. In NED only the sign of ``e_z`` differs from ENU, so the figures are the same.

    A reference sample counts if it is marked valid, the solution's samples that enclose it
    are not aligning, and it lies neither outside their span nor in a gap. The solution is
    interpolated to the reference's times.

    Where the solution and the reference both know the mount, all errors are those of the
    vehicle's attitude, each taken through its own mount: a receiver states the attitude of
    the vehicle, and its mount, which turns that into the box's, may still be wrong by tens of
    degrees when its attitude is right. A sample counts from where the solution's mount is
    found, that is, differs from the identity.

    Parameters
    ----------
    solution : Solution
        What was estimated.
    reference : Reference or AttitudeReference
        What is taken for true. With a mount in it and none in the solution, errors are the
        box's, but roll, pitch and yaw those of the vehicle by the reference's mount.
    max_gap : float
        Longest interval between samples of the solution that is bridged [s].
    remove_heading : bool, optional
        Whether one constant is taken from the heading error, the robust circular mean over
        the samples that count. By default just if the solution's or the reference's heading
        is arbitrary.

    Returns
    -------
    AttitudeErrors

    Raises
    ------
    MissingStream
        If the reference has no attitude.
    DataGap
        If no sample counts.

    References
    ----------
    .. [1] D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - a benchmark for robust
           inertial orientation estimation", Data 6(7):72, 2021.
    """
    _checks.instance("solution", solution, Solution, "an estimator's `run` gives one")
    if not isinstance(reference, AttitudeReference):
        _checks.instance(
            "reference", reference, Reference, "a recording has it as `rec.reference`"
        )
    parts = reference if isinstance(reference, Reference) else Reference(attitude=reference)
    if parts.attitude is None:
        raise MissingStream("attitude errors need a reference with attitude, it has none.")
    q_ref, valid = parts.attitude.q_nb, _valid(parts.attitude)

    found = match(solution.t, parts.attitude.t, max_gap)
    aligned = found.both((solution.status & Status.ALIGNING) == 0)
    counts = aligned & valid[found.rows]
    q_vb_ref = None if parts.mount is None else mount_at(parts.mount, parts.attitude.t)
    through = solution.q_vb is not None and q_vb_ref is not None
    mounted = np.ones_like(counts)
    if solution.q_vb is not None and through:
        mounted = found.both((solution.q_vb[:, 1:] != 0.0).any(axis=1))
        counts &= mounted
    left_out = {
        "outside the span of the solution": found.outside,
        "in a gap of the solution": found.in_gap,
        "reference not valid": int(np.count_nonzero(~valid[found.rows])),
        "solution still aligning": int(np.count_nonzero(valid[found.rows] & ~aligned)),
        "mount not found yet": int(np.count_nonzero(valid[found.rows] & aligned & ~mounted)),
    }
    left_out = {reason: number for reason, number in left_out.items() if number}
    if not counts.any():
        reasons = ", ".join(f"{number} {reason}" for reason, number in left_out.items())
        raise DataGap(
            f"no reference sample counts of {len(parts.attitude)}: {reasons or 'it is empty'}."
        )

    rows = found.rows[counts]
    q_est, q_true = found.quats(solution.q_nb)[counts], q_ref[rows]
    if solution.q_vb is not None and q_vb_ref is not None:
        q_est = quat_mul(q_est, quat_conj(found.quats(solution.q_vb)[counts]))
        q_true = quat_mul(q_true, quat_conj(q_vb_ref[rows]))
    error = quat_mul(q_est, quat_conj(q_true))

    removed = remove_heading
    if removed is None:
        removed = "arbitrary" in (solution.heading_reference, parts.heading)
    constant = 0.0
    if removed:
        constant = robust_circular_mean(_heading(error))
        turn = np.array([np.cos(constant / 2.0), 0.0, 0.0, -np.sin(constant / 2.0)])
        error = quat_mul(np.broadcast_to(turn, error.shape), error)

    if q_vb_ref is not None and not through:
        q_bv = quat_conj(q_vb_ref[rows])
        q_est, q_true = quat_mul(q_est, q_bv), quat_mul(q_true, q_bv)
    rpy = rpy_from_quat(q_est) - rpy_from_quat(q_true)
    rpy[:, 2] -= constant
    std_n = None if through else solution.std_attitude_n
    return AttitudeErrors(
        t=parts.attitude.t[rows],
        total=2.0 * np.arctan2(np.linalg.norm(error[:, 1:], axis=1), np.abs(error[:, 0])),
        heading=_heading(error),
        inclination=2.0
        * np.arctan2(np.hypot(error[:, 1], error[:, 2]), np.hypot(error[:, 0], error[:, 3])),
        tilt_n=_tilt(error),
        rpy=wrap_pi(rpy),
        axes="body" if q_vb_ref is None else "vehicle",
        through_own_mount=through,
        std_n=None if std_n is None else found.linear(std_n)[counts],
        heading_constant=constant,
        heading_removed=removed,
        heading_note=_note(solution.heading_reference, parts.heading, removed, constant),
        left_out=left_out,
    )


def mount_at(mount: MountReference, t: FloatArray) -> FloatArray | None:
    """Return the reference's mount, ``q_vb`` of shape (m, 4), at times `t`, or None.

    A mount hardly changes: between its valid samples it is interpolated however far they lie
    apart, before the first and after the last it is held.
    """
    _checks.instance("mount", mount, MountReference)
    known = mount.rows(_valid(mount))
    if not len(known):
        return None
    return interpolate(np.clip(t, known.t[0], known.t[-1]), known.t, known.q_vb)


def _valid(stream: AttitudeReference | MountReference) -> BoolArray:
    """Return which samples of a reference may be used."""
    usable = ~stream.nan_rows()
    return usable if stream.valid is None else usable & stream.valid


def _heading(error: FloatArray) -> FloatArray:
    """Return the rotation about down of error quaternions, in [-pi, pi]."""
    sign = np.where(error[:, 0] < 0.0, -1.0, 1.0)  # q and -q are one rotation
    return np.asarray(2.0 * np.arctan2(sign * error[:, 3], sign * error[:, 0]))


def _tilt(error: FloatArray) -> FloatArray:
    """Return the rotation vector about north and east that is left after the heading.

    With ``error = tilt * heading``, both unit quaternions; the tilt has no z component.
    """
    w, x, y, z = error.T
    upright = np.hypot(w, z)
    sideways = np.hypot(x, y)
    angle = 2.0 * np.arctan2(sideways, upright)
    cos_half = np.divide(w, upright, out=np.ones_like(w), where=upright > 0.0)
    sin_half = np.divide(z, upright, out=np.zeros_like(w), where=upright > 0.0)
    scale = np.divide(angle, sideways, out=np.zeros_like(w), where=sideways > 0.0)
    return np.stack(
        ((x * cos_half - y * sin_half) * scale, (y * cos_half + x * sin_half) * scale), axis=1
    )


def _circular_std(angles: FloatArray) -> float:
    """Return the standard deviation of angles about their circular mean [rad]."""
    mean = np.angle(np.mean(np.exp(1j * angles)))
    return float(np.sqrt(np.mean(wrap_pi(angles - mean) ** 2)))


def _note(estimate: str, reference: str, removed: bool, constant: float) -> str:
    """Return one sentence on what the heading errors mean."""
    if removed:
        why = "arbitrary" in (estimate, reference)
        return (
            f"{'The heading is arbitrary' if why else 'As asked'}: one constant, "
            f"{constant / DEG:.2f} deg, was taken from all heading and yaw errors."
        )
    if "arbitrary" in (estimate, reference):
        return "The heading is arbitrary, and no constant was taken from its errors."
    if estimate != reference:
        return (
            f"The solution's heading is {estimate}, the reference's is {reference}: the "
            "declination is part of the heading errors."
        )
    return f"Both headings are {estimate}; nothing was taken from their errors."
