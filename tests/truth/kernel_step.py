"""Single kernel steps from a state of one's choice."""

import numpy as np
from scipy.spatial.transform import Rotation

from strapdown.kernels import memory as m

NO_MAG = np.empty(0)


def start(flt, q_nb, bias=(0.0, 0.0, 0.0)):
    """Memory of `flt` with this attitude and bias, as after a sample at t = 0."""
    state = flt.init(attitude=q_nb)
    x, P = state.x.copy(), state.P.copy()
    feed(flt, x, P, 0.0, np.zeros(3), np.full(3, np.inf))
    x[m.BG : m.BG + 3] = bias
    return x, P


def feed(flt, x, P, t, gyr, acc, mag=NO_MAG):
    """One sample; changes x and P, returns the scratch."""
    kernel = flt._kernel()
    w = np.zeros(kernel.W_SIZE)
    gyr, acc, mag = (np.array(v, dtype=float) for v in (gyr, acc, mag))
    assert kernel.update(x, P, flt._params(), w, float(t), gyr, acc, mag)
    return w


def quat(x):
    return x[m.Q : m.Q + 4].copy()


def bias(x):
    return x[m.BG : m.BG + 3].copy()


def rotation(q):
    """SciPy rotation of a quaternion, scalar first."""
    return Rotation.from_quat(np.asarray(q)[[1, 2, 3, 0]])


def scalar_first(r):
    return r.as_quat()[[3, 0, 1, 2]]


def unit(v):
    return np.asarray(v, dtype=float) / np.linalg.norm(v)
