"""Position and velocity Kalman filter of thesis E, 7.7.2: 9 or 12 states, all in n.

States: position x, velocity v, acceleration a, accelerometer bias b, three components each; in
the residual form their errors, GNSS less INS. As printed:

``x+ = x + v dt``, ``v+ = v + a dt + b dt``, ``a+ = a + b``, ``b+ = b``, ``Q = diag``.

That is for steps of 1 s; for others the b that goes into a, and Q, count in proportion.

Consistent: a and b are random walks that both enter v, v has white noise; Phi and Q are exact.
"""

from strapdown.kernels._jit import Mat, kernel
from strapdown.kernels.gnssins.layout import PV


@kernel
def transition(P: Mat, first: int, states: int, dt: float, printed: float) -> None:
    """``P <- Phi P Phi^T`` of the block of `states` rows from `first` on, by row operations."""
    half = 0.0 if printed > 0.0 else 0.5 * dt * dt
    extra = dt if printed > 0.0 else 0.0  # a+ = a + b, as printed
    for i in range(3):
        ix, iv, ia, ib = first + i, first + 3 + i, first + 6 + i, first + 9 + i
        for m in range(states):
            j = first + m
            b = P[ib, j] if states > 9 else 0.0
            P[ix, j] += dt * P[iv, j] + half * (P[ia, j] + b)
            P[iv, j] += dt * (P[ia, j] + b)
            P[ia, j] += extra * b
    for i in range(3):
        ix, iv, ia, ib = first + i, first + 3 + i, first + 6 + i, first + 9 + i
        for m in range(states):
            j = first + m
            b = P[j, ib] if states > 9 else 0.0
            P[j, ix] += dt * P[j, iv] + half * (P[j, ia] + b)
            P[j, iv] += dt * (P[j, ia] + b)
            P[j, ia] += extra * b
    for i in range(states):
        for j in range(i):
            P[first + j, first + i] = P[first + i, first + j]


# fmt: off
@kernel
def add_noise(
    P: Mat, first: int, states: int, dt: float,
    q_v: float, q_a: float, q_b: float, printed: float,
) -> None:
    """Add Q: printed, (7.7.22), q_v to x and v, q_a, q_b; else the integrals of densities."""
    # fmt: on
    for i in range(3):
        ix, iv, ia, ib = first + i, first + 3 + i, first + 6 + i, first + 9 + i
        if printed > 0.0:
            P[ix, ix] += q_v * dt
            P[iv, iv] += q_v * dt
            P[ia, ia] += q_a * dt
            if states > 9:
                P[ib, ib] += q_b * dt
        else:
            P[ix, ix] += q_v * dt * dt * dt / 3.0
            P[ix, iv] += q_v * dt * dt / 2.0
            P[iv, iv] += q_v * dt
            _add_walk(P, ix, iv, ia, dt, q_a)
            if states > 9:
                _add_walk(P, ix, iv, ib, dt, q_b)
            P[iv, ix] = P[ix, iv]


@kernel
def _add_walk(P: Mat, ix: int, iv: int, ia: int, dt: float, q: float) -> None:
    """Add the noise of a random walk of acceleration, integrated twice."""
    dt2 = dt * dt
    P[ix, ix] += q * dt2 * dt2 * dt / 20.0
    P[ix, iv] += q * dt2 * dt2 / 8.0
    P[ix, ia] += q * dt2 * dt / 6.0
    P[iv, iv] += q * dt2 * dt / 3.0
    P[iv, ia] += q * dt2 / 2.0
    P[ia, ia] += q * dt
    P[iv, ix] = P[ix, iv]
    P[ia, ix] = P[ix, ia]
    P[ia, iv] = P[iv, ia]


@kernel
def start(P: Mat, states: int, var_a: float, var_b: float) -> None:
    """Set the covariance of the estimator's filter; x and v follow from the fix."""
    for i in range(states):
        for j in range(states):
            P[PV + i, PV + j] = 0.0
    for i in range(3):
        P[PV + 6 + i, PV + 6 + i] = var_a
        if states > 9:
            P[PV + 9 + i, PV + 9 + i] = var_b
