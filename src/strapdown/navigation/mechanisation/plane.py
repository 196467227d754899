"""Strapdown navigation in a vertical plane: the teaching systems of thesis E1, section 2.2."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from strapdown import _checks
from strapdown._types import FloatArray
from strapdown.constants import WGS84_A

# Signs of the frame's terms: of z in the radius, v_x / r in the rate of theta, v_x v_z / r in
# v_x', v_x^2 / r in v_z', and of gravity in v_z'.
_SIGNS: Final = {
    "up": (1.0, -1.0, -1.0, 1.0, -1.0),
    "down": (-1.0, 1.0, 1.0, -1.0, 1.0),
    "printed": (1.0, -1.0, 1.0, -1.0, -1.0),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneSolution:
    """Motion in a vertical plane.

    Attributes
    ----------
    t : ndarray, shape (n,)
        Time [s].
    theta : ndarray, shape (n,)
        Turn of the body about y [rad].
    x, z : ndarray, shape (n,)
        Position [m]; on a meridian x is the way that the box itself made along it.
    v_x, v_z : ndarray, shape (n,)
        Velocity [m/s].
    """

    t: FloatArray
    theta: FloatArray
    x: FloatArray
    z: FloatArray
    v_x: FloatArray
    v_z: FloatArray


def mechanise_plane(
    t: ArrayLike,
    rate: ArrayLike,
    f_xb: ArrayLike,
    f_zb: ArrayLike,
    *,
    system: Literal["inertial", "meridian"] = "meridian",
    axes: Literal["up", "down", "printed"] = "down",
    gravity: ArrayLike = 9.80665,
    radius: float = WGS84_A,
    theta: float = 0.0,
    position: ArrayLike = (0.0, 0.0),
    velocity: ArrayLike = (0.0, 0.0),
) -> PlaneSolution:
    """Return the motion that two accelerometers and one gyroscope tell in a vertical plane.

    Parameters
    ----------
    t : array_like, shape (n,)
        Time [s]; the motion begins at ``t[0]``.
    rate : array_like, shape (n,)
        Rate about y [rad/s]; row k is the mean over ``(t[k-1], t[k]]``, row 0 is not used.
    f_xb, f_zb : array_like, shape (n,)
        Specific force along x and z of the body [m/s^2], likewise.
    system : {'inertial', 'meridian'}
        A plane at rest in inertial space, or a meridian plane of a sphere that does not turn, with
        x tangent to the meridian and z vertical.
    axes : {'up', 'down', 'printed'}
        Where z points on the meridian. ``'printed'`` has the signs of the thesis's table 2.2.2,
        which mixes the two and is right for neither; z is up there.
    gravity : float or array_like, shape (2,)
        On the meridian its size [m/s^2]; in the inertial plane its components along x and z.
    radius : float
        Of the meridian at z = 0 [m].
    theta : float
        Turn of the body about y at the start [rad].
    position, velocity : array_like, shape (2,)
        Along x and z at the start [m], [m/s].

    Returns
    -------
    PlaneSolution

    Notes
    -----
    Online; error of second order of the sampling interval.

    References
    ----------
    .. [1] Thesis E1, section 2.2, tables 2.2.1 and 2.2.2.

    Examples
    --------
    >>> still = [0.0, 0.0]
    >>> mechanise_plane([0.0, 1.0], still, still, [-9.80665, -9.80665]).z
    array([0., 0.])
    """
    from strapdown.kernels.mechanisation import plane as k

    times = _checks.as_times("t", t)
    n = len(times)
    omega = _checks.as_series("rate", rate, n)
    along, across = _checks.as_series("f_xb", f_xb, n), _checks.as_series("f_zb", f_zb, n)
    p = np.zeros(k.P_SIZE)
    if _checks.one_of("system", system, ("inertial", "meridian")) == "meridian":
        signs = _SIGNS[_checks.one_of("axes", axes, _SIGNS)]
        p[k.RADIUS] = _checks.positive("radius", radius)
        p[k.RADIUS_Z], p[k.TURN], p[k.CROSS], p[k.CENTRAL] = signs[:4]
        p[k.GZ] = signs[4] * _checks.positive("gravity", gravity, allow_zero=True)
    else:
        p[k.GX], p[k.GZ] = _checks.as_vector("gravity", gravity, 2)
    x = np.array(
        (
            _checks.finite("theta", theta),
            *_checks.as_vector("position", position, 2),
            *_checks.as_vector("velocity", velocity, 2),
        )
    )
    out = np.empty((n, k.X_SIZE))
    k.run(x, p, times, omega, along, across, out)
    columns = (np.ascontiguousarray(column) for column in out.T)
    return PlaneSolution(
        t=times, **dict(zip(("theta", "x", "z", "v_x", "v_z"), columns, strict=True))
    )
