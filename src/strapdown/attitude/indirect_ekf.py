"""Indirect extended Kalman filter of Trawny-Roumeliotis form, with a star tracker."""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.attitude._base import AttitudeEstimator
from strapdown.constants import G0
from strapdown.estimator import Taken, register
from strapdown.kernels import memory as _m
from strapdown.recording import Recording
from strapdown.solution import Solution
from strapdown.units import DEG

Propagation = Literal["exact", "truncated"]


@register(
    source="thesis three-axis platform, ch. 7; Trawny, Roumeliotis 2005",
    cost="7 states, 6x6 covariance",
    uses=("mag", "star"),
    rank=15,
)
@dataclass(frozen=True, slots=True, kw_only=True)
class IndirectEkf(AttitudeEstimator):
    """Indirect EKF: attitude and gyro bias from gravity, field and a star tracker.

    State: q_nb and gyro bias; error state ``(dtheta_b, dbg)``, ``q_nb_true = q_nb exp(dtheta_b)``.
    The source writes JPL quaternions of n to b, scalar last; the Hamilton q_nb here is made of
    the same four numbers. Specific force and field enter as vectors against a fixed
    reference, scaled by its magnitude; the star tracker as twice the vector part of the rotation
    that it disagrees by. Joseph form, one scalar at a time. Sensors must be calibrated.

    Misprints corrected: Q_d (7.27)-(7.28), the correction beyond half a turn (7.54), ``P_0 = I6``
    (7.41). None has a printed variant: those formulas give no covariance, or no real number.

    Parameters
    ----------
    reject_disturbed : bool
        Whether a field of unusual strength or dip is left out, not only flagged.
    gyr_noise : float
        Angle random walk N [rad/s/sqrt(Hz)]. Larger trusts the gyroscope less.
    gyr_bias_noise : float
        Rate random walk K of the bias [rad/s^2/sqrt(Hz)]. Zero: the bias is constant.
    acc_noise : float
        Density of the accelerometer's error, motion included [m/s^2/sqrt(Hz)]. The sensor's own,
        3e-3, is the source's, for a platform that turns about its centre.
    mag_noise : float
        White noise of the field [T/sqrt(Hz)].
    mag_factor : float
        What its sigma is multiplied by: k of the source. It stands for the errors that
        calibration leaves and that are no noise.
    star_resolution : float
        Least step of the star tracker's angles [rad]; its sigma is this over the root of 12.
    star_only : bool
        The source's space scenario: only the star tracker corrects, and the first one aligns.
    propagation : {'exact', 'truncated'}
        Of the covariance: v1, closed forms, or v2, series truncated for small turns. A turn of
        more than 0.5 rad in a sample is taken exactly in both.
    std_tilt, std_heading : float
        Standard deviations of the first alignment [rad].
    std_gyr_bias : float
        Standard deviation of the first bias [rad/s].
    gyr_bias : tuple of 3 floats
        The first bias [rad/s], as the mean rate at rest.
    mag_reference : tuple of 2 floats, optional
        Horizontal part and part down of the field [T]. None: as first measured.
    gate : float
        Innovations beyond so many sigma are weighted down. Infinite, as in the source, switches
        it off.
    gap_rate : float
        Rate that may have gone unseen in a gap or beyond the gyro's range [rad/s]. A gap in which
        it hides more than `std_tilt` levels again, and takes the heading from the next field.
    gravity : float
        Magnitude of gravity [m/s^2].

    Notes
    -----
    Online. `terrestrial` and `space` are the source's two configurations.

    References
    ----------
    .. [1] N. Trawny, S. I. Roumeliotis, "Indirect Kalman filter for 3D attitude estimation",
           report 2005-002, University of Minnesota, 2005.

    Examples
    --------
    >>> from strapdown.simulation import demo
    >>> sol = IndirectEkf(mag_factor=10.0).run(demo.recording())
    """

    NAME: ClassVar[str] = "indirect-ekf"
    OUTPUTS: ClassVar[tuple[str, ...]] = ("q_nb", "gyr_bias", "std_attitude_n", "std_gyr_bias")
    FROM_SENSOR: ClassVar[tuple[Taken, ...]] = (
        Taken("gyr_noise", "gyr_noise"),
        Taken("gyr_bias_noise", "gyr_bias_walk"),
        Taken("acc_noise", "acc_noise", floor=True),
        Taken("mag_noise", "mag_noise"),
        Taken("std_gyr_bias", "gyr_bias_std"),
    )
    reject_disturbed: bool = True
    gyr_noise: float = 8.2e-3 * DEG
    gyr_bias_noise: float = 1.1e-4 * DEG
    acc_noise: float = 1.0
    mag_noise: float = 1.5e-8
    mag_factor: float = 20.0
    star_resolution: float = 0.09 * DEG
    star_only: bool = False
    propagation: Propagation = "exact"
    std_tilt: float = 5.0 * DEG
    std_heading: float = 10.0 * DEG
    std_gyr_bias: float = 1.0 * DEG
    gyr_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mag_reference: tuple[float, float] | None = None
    gate: float = 5.0
    gap_rate: float = 0.5
    gravity: float = G0

    def __post_init__(self) -> None:
        """Check the parameters."""
        AttitudeEstimator.__post_init__(self)
        for name in (
            "gyr_noise", "acc_noise", "mag_noise", "mag_factor", "star_resolution", "std_tilt",
            "std_heading", "gravity",
        ):  # fmt: skip
            _checks.positive(name, getattr(self, name))
        for name in ("gyr_bias_noise", "std_gyr_bias", "gap_rate"):
            _checks.positive(name, getattr(self, name), allow_zero=True)
        if self.gate != math.inf:
            _checks.positive("gate", self.gate)
        if not isinstance(self.star_only, bool):
            raise TypeError(f"`star_only` must be True or False, got {self.star_only!r}.")
        _checks.one_of("propagation", self.propagation, ("exact", "truncated"))
        _checks.as_vector("gyr_bias", self.gyr_bias)
        if self.mag_reference is not None:
            horizontal, _ = _checks.as_vector("mag_reference", self.mag_reference, 2)
            _checks.positive("mag_reference", horizontal)

    @classmethod
    def terrestrial(cls, **parameters: Any) -> "IndirectEkf":
        """Return the source's filter on the ground: ``P_0 = I``, sensors' own noise, no gate.

        Parameters
        ----------
        **parameters
            Other fields.

        Returns
        -------
        IndirectEkf
        """
        ours = {"acc_noise": 3.0e-4 * G0, "gate": math.inf, "reject_disturbed": False}
        start = {"std_tilt": 1.0, "std_heading": 1.0, "std_gyr_bias": 1.0}
        return cls(**{**ours, **start, **parameters})

    @classmethod
    def space(cls, **parameters: Any) -> "IndirectEkf":
        """Return the source's filter in space: star tracker alone, ``P_0`` of (7.43).

        That is ``diag(1e7 N^2 dt, 1e5 K^2 dt)`` at 100 Hz: 2.5 deg and 0.0035 deg/s. `gyr_bias`
        must come from a rest before.

        Parameters
        ----------
        **parameters
            Other fields.

        Returns
        -------
        IndirectEkf
        """
        noise = cls(**parameters)
        attitude = math.sqrt(1e7 * 0.01) * noise.gyr_noise
        start = {"std_tilt": attitude, "std_heading": attitude}
        start["std_gyr_bias"] = math.sqrt(1e5 * 0.01) * noise.gyr_bias_noise
        return cls(**{"gate": math.inf, "star_only": True, **start, **parameters})

    def rate(self, rec: Recording, sol: Solution) -> FloatArray:
        """Return the corrected rate ``omega_nb_b`` at each sample, (7.56).

        Parameters
        ----------
        rec : Recording
            Of which `sol` is the solution.
        sol : Solution
            With its gyro bias.

        Returns
        -------
        ndarray, shape (n, 3)
            Measured rate without its estimated bias [rad/s]; NaN where it was not measured.

        Raises
        ------
        ValueError
            If the solution is of other samples or has no bias.
        """
        imu = rec.need("imu")
        if sol.gyr_bias is None or not np.array_equal(sol.t, imu.t):
            raise ValueError(
                f"`sol` must hold the gyro bias at the {len(imu)} samples of `rec`, got "
                f"{'no bias' if sol.gyr_bias is None else f'{len(sol)} others'}."
            )
        return np.asarray(imu.gyr - sol.gyr_bias, dtype=np.float64)

    @staticmethod
    def _kernel() -> Any:
        from strapdown.kernels import indirect_ekf

        return indirect_ekf

    def _params(self) -> FloatArray:
        from strapdown.kernels import mekf

        k = self._kernel()
        p = self._common(k.P_SIZE)
        p[_m.P_REALIGN] = 0.0
        if self.star_only:
            p[_m.P_USE_MAG] = 0.0
        p[mekf.P_GYR_NOISE] = self.gyr_noise
        p[mekf.P_BIAS_NOISE] = self.gyr_bias_noise
        p[mekf.P_ACC_NOISE] = self.acc_noise
        p[mekf.P_MAG_NOISE] = self.mag_factor * self.mag_noise
        p[mekf.P_GRAVITY] = self.gravity
        p[mekf.P_GATE] = self.gate
        p[mekf.P_GAP_RATE] = self.gap_rate
        p[mekf.P_STD_TILT] = self.std_tilt
        p[mekf.P_STD_HEADING] = self.std_heading
        p[k.P_STD_STAR] = self.star_resolution / math.sqrt(12.0) / 2.0  # (8.8), (8.9)
        p[k.P_STAR_ONLY] = float(self.star_only)
        p[k.P_TRUNCATED] = float(self.propagation == "truncated")
        return p

    def _memory(self) -> tuple[FloatArray, FloatArray]:
        head, _ = AttitudeEstimator._memory(self)
        k = self._kernel()
        x = np.zeros(k.X_SIZE)
        x[: _m.HEAD] = head
        x[_m.BG : _m.BG + 3] = self.gyr_bias
        x[_m.STD_ATT : _m.STD_ATT + 3] = math.pi  # nothing is known
        x[_m.STD_BG : _m.STD_BG + 3] = self.std_gyr_bias
        if self.mag_reference is not None:
            x[k.REF_H], x[k.REF_D] = self.mag_reference
        P = np.zeros((6, 6))
        P[:3, :3] = self.std_tilt**2 * np.eye(3)
        P[3:, 3:] = self.std_gyr_bias**2 * np.eye(3)
        return x, P

    def _events(self, rec: Recording) -> FloatArray:
        star = rec.star
        if star is None:
            return np.empty((0, 7))
        rows = np.empty((len(star), 7))
        rows[:, 0] = star.t
        rows[:, 1] = _m.STAR
        rows[:, 2] = 4.0
        rows[:, 3:] = star.q_nb
        return rows

    def _heading_reference(self, rec: Recording) -> str:
        """Return what the heading of a solution is measured from."""
        if rec.star is not None:
            return "true"
        if self.star_only:
            return "arbitrary"
        return AttitudeEstimator._heading_reference(self, rec)
