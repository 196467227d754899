"""A flight in closed form: truth of mechanisations, anywhere on the Earth, over poles as well.

Position in ECEF is a circle about the Earth's centre with sines added, attitude a product of
turns about fixed axes by sums of sines; rates, accelerations and specific forces are their
derivatives on paper. Nothing here is taken from the package; NumPy only.
"""

import numpy as np

OMEGA = 7.292115e-5
A, F = 6378137.0, 1 / 298.257223563
E2 = F * (2 - F)


def geodetic(r):
    """Latitude, longitude, height by fixed-point iteration of the definition."""
    p = np.hypot(r[..., 0], r[..., 1])
    lat = np.arctan2(r[..., 2], p * (1 - E2))
    for _ in range(12):
        n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
        lat = np.arctan2(r[..., 2] + E2 * n * np.sin(lat), p)
    n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    h = p * np.cos(lat) + r[..., 2] * np.sin(lat) - n * (1 - E2 * np.sin(lat) ** 2)
    return np.stack((lat, np.arctan2(r[..., 1], r[..., 0]), h), axis=-1)


def ecef(lat, lon, h):
    n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    return np.array(
        ((n + h) * np.cos(lat) * np.cos(lon), (n + h) * np.cos(lat) * np.sin(lon),
         (n * (1 - E2) + h) * np.sin(lat))
    )  # fmt: skip


def axes(lat, lon):
    """C_ne: rows north, east, down."""
    sp, cp, sl, cl = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    zero = np.zeros_like(sp)
    rows = (-sp * cl, -sp * sl, cp, -sl, cl, zero, -cp * cl, -cp * sl, -sp)
    return np.stack(rows, axis=-1).reshape(*np.shape(sp), 3, 3)


def gravity_e(r):
    """Somigliana's formula with the second-order fall with height, along the normal."""
    lat, lon, h = np.moveaxis(geodetic(r), -1, 0)
    s2 = np.sin(lat) ** 2
    g = 9.7803253359 * (1 + 0.00193185265241 * s2) / np.sqrt(1 - E2 * s2)
    g = g * (1 - 2 / A * (1 + F + 0.00344978650684 - 2 * F * s2) * h + 3 * h**2 / A**2)
    return g[..., None] * axes(lat, lon)[..., 2, :]


def sines(t, terms):
    """Sum of (amplitude, angular rate, phase) and its first two derivatives."""
    x = sum(a * np.sin(w * t + p) for a, w, p in terms)
    v = sum(a * w * np.cos(w * t + p) for a, w, p in terms)
    q = sum(-a * w * w * np.sin(w * t + p) for a, w, p in terms)
    return x, v, q


def turn(axis, angle):
    """Matrices that turn by an angle about x, y or z."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.zeros((*np.shape(angle), 3, 3))
    i, j, k = (axis + 1) % 3, (axis + 2) % 3, axis
    R[..., k, k] = 1
    R[..., i, i], R[..., i, j], R[..., j, i], R[..., j, j] = c, -s, s, c
    return R


class Flight:
    """A great circle from a point on a heading, with waves; an attitude that swings about it."""

    def __init__(self, lat, lon, h, heading, speed=250.0, swing=1.0, waves=1.0):
        r = ecef(lat, lon, h)
        C = axes(lat, lon)
        self.R = np.linalg.norm(r)
        self.u = r / self.R
        ahead = np.cos(heading) * C[0] + np.sin(heading) * C[1]
        ahead -= self.u * (self.u @ ahead)
        self.v = ahead / np.linalg.norm(ahead)
        self.side = np.cross(self.u, self.v)
        self.rate = speed / self.R
        self.waves = [
            [(waves * a, w, p) for a, w, p in terms]
            for terms in (
                [(30.0, 0.11, 0.3), (2.0, 0.7, 1.0)],
                [(40.0, 0.07, 1.3), (1.5, 0.9, 2.0)],
                [(20.0, 0.13, 2.1), (1.0, 0.8, 0.5)],
            )
        ]
        self.C0 = C.T @ turn(2, heading)
        self.angles = [
            [(swing * 0.5, 0.31, 0.2), (swing * 0.1, 1.3, 1.1)],
            [(swing * 0.3, 0.43, 1.2), (swing * 0.1, 1.1, 0.3)],
            [(swing * 0.7, 0.17, 2.2), (swing * 0.1, 0.9, 2.9)],
        ]

    def position(self, t):
        """r_e and its derivatives."""
        t = np.asarray(t, dtype=float)
        c, s = np.cos(self.rate * t)[..., None], np.sin(self.rate * t)[..., None]
        r = self.R * (c * self.u + s * self.v)
        v = self.R * self.rate * (-s * self.u + c * self.v)
        a = -(self.rate**2) * r
        for axis, terms in zip((self.u, self.v, self.side), self.waves, strict=True):
            x, dx, ddx = sines(t, terms)
            r, v, a = r + x[..., None] * axis, v + dx[..., None] * axis, a + ddx[..., None] * axis
        return r, v, a

    def attitude(self, t):
        """C_eb and omega_eb_b."""
        t = np.asarray(t, dtype=float)
        (a, da, _), (b, db, _), (c, dc, _) = (sines(t, terms) for terms in self.angles)
        Rx, Ry, Rz = turn(0, a), turn(1, b), turn(2, c)
        x, y, z = np.eye(3)
        omega = dc[..., None] * z + np.einsum("...ji,...j->...i", Rz, db[..., None] * y)
        omega += np.einsum("...ji,...j->...i", Ry @ Rz, da[..., None] * x)
        return self.C0 @ Rx @ Ry @ Rz, omega

    def imu(self, t):
        """Rate and specific force at times."""
        r, v, a = self.position(t)
        C_eb, omega = self.attitude(t)
        w = np.array((0.0, 0.0, OMEGA))
        f_e = a + 2 * np.cross(w, v) - gravity_e(r)
        return omega + C_eb[..., 2, :] * OMEGA, np.einsum("...ji,...j->...i", C_eb, f_e)

    def samples(self, t):
        """Means over the intervals by Gauss-Legendre of two points; row 0 is the value there."""
        h = np.diff(t)
        at = 0.5 / np.sqrt(3.0)
        one, two = self.imu(t[:-1] + (0.5 - at) * h), self.imu(t[:-1] + (0.5 + at) * h)
        first = self.imu(t[:1])
        return tuple(
            np.concatenate((c, 0.5 * (a + b))) for a, b, c in zip(one, two, first, strict=True)
        )

    def state(self, t):
        """lla, v_n and C_nb at a time."""
        r, v, _ = self.position(t)
        lla = geodetic(r)
        C_ne = axes(lla[..., 0], lla[..., 1])
        C_eb, _ = self.attitude(t)
        return lla, np.einsum("...ij,...j->...i", C_ne, v), C_ne @ C_eb


def position_error(lla, truth):
    """Distance between two points [m]."""
    return np.linalg.norm(ecef(*lla) - ecef(*truth))
