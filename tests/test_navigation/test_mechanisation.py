"""The mechanisation of the filter, on its own, against a simulated drive without sensor errors."""

import drive
import numpy as np
import pytest

from strapdown.kernels.ins import layout as k
from strapdown.kernels.ins import mechanise
from strapdown.navigation import LooselyCoupled
from strapdown.rotation import quat_from_dcm


def coast(d, seconds, rate):
    """Position error after `seconds` of dead reckoning from the truth [m]."""
    x, _ = LooselyCoupled()._memory()
    first = int(100.0 * rate)
    x[k.Q : k.Q + 4] = quat_from_dcm(d.C_nb[first])
    x[k.V : k.V + 3] = d.v_n[first]
    x[k.LLA : k.LLA + 3] = d.lla[first]
    imu = d.rec.imu
    last = first + int(seconds * rate)
    for i in range(first + 1, last + 1):
        if (i - first) % 10 == 1:
            mechanise.earth_terms(x)
        mechanise.advance(x, 1.0 / rate, *imu.gyr[i], *imu.acc[i])
    error = drive.ned_error(x[k.LLA : k.LLA + 3].copy(), d.lla[last])
    return error, drive.attitude_error(x[k.Q : k.Q + 4], d.C_nb[last])


@pytest.mark.parametrize("lat", [-1.0, 0.0, 0.83, 1.4])
def test_a_minute_of_dead_reckoning_is_exact_to_centimetres(lat):
    C_vb = drive.rotation((1, 2, -1), 2.4)
    d = drive.simulate(seed=1, noise=0.0, duration=180.0, lla0=(lat, 2.0, 500.0), C_vb=C_vb)
    error, attitude = coast(d, 60.0, 100.0)
    # Coriolis alone makes 2 * 7.3e-5 * 14 m/s * (60 s)^2 / 2 = 3.7 m, the Earth's rate 0.25 deg
    assert np.abs(error).max() < 0.05
    assert np.abs(attitude).max() < 2e-6
