"""Attitude from the gyroscope alone. Frames: n = NED, b = body."""

from math import inf

from strapdown.kernels._jit import Mat, Vec, kernel
from strapdown.kernels.memory import SKIP, W_HEAD, advance_attitude, begin, load, post, store

W_SIZE = W_HEAD


# fmt: off
@kernel
def step(
    x: Vec, P: Mat, p: Vec, w: Vec, t: float,
    gx: float, gy: float, gz: float,
    ax: float, ay: float, az: float,
) -> None:
    """Advance `x` by one sample: ``q_nb <- q_nb exp(omega dt)``, exact at constant rate."""
    # fmt: on
    todo, dt, wx, wy, wz, _, _ = begin(x, p, w, t, gx, gy, gz, ax, ay, az)
    if todo != SKIP:
        advance_attitude(x, wx * dt, wy * dt, wz * dt)


# fmt: off
@kernel
def run(
    x: Vec, P: Mat, p: Vec, w: Vec,
    t: Vec, gyr: Mat, acc: Mat, t_mag: Vec, mag: Mat, events: Mat,
    out: Mat, out_diag: Mat,
) -> None:
    """Loop of `step` over a recording."""
    # fmt: on
    j = 0
    for k in range(t.shape[0]):
        j = load(x, t[k], j, t_mag, mag)
        step(x, P, p, w, t[k], gyr[k, 0], gyr[k, 1], gyr[k, 2], acc[k, 0], acc[k, 1], acc[k, 2])
        store(x, w, k, out, out_diag)
    load(x, inf, j, t_mag, mag)


@kernel
def update(x: Vec, P: Mat, p: Vec, w: Vec, t: float, gyr: Vec, acc: Vec, mag: Vec) -> bool:
    """One `step` from vectors, for real-time code; False if their lengths are wrong."""
    ok = post(x, gyr, acc, mag)
    if ok:
        step(x, P, p, w, t, gyr[0], gyr[1], gyr[2], acc[0], acc[1], acc[2])
    return ok
