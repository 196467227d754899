"""When navigation begins, with receivers that state too much."""

import drive
import numpy as np

from strapdown.navigation import LooselyCoupled
from strapdown.solution import Status

FLT = LooselyCoupled()


def test_a_receiver_that_states_too_much_does_not_delay_the_start():
    for seed in range(6):
        d = drive.simulate(seed=seed, duration=40.0, rate=50.0, stated=(5.0, 2.5))
        sol = FLT.run(d.rec, diagnostics=False)
        known = (sol.status & Status.ALIGNING) == 0
        first = int(np.argmax(known))
        assert known[first]
        assert d.t[first] < 25.0  # the car pulls away at 20 s, and is faster than 3 m/s at 24 s
        heading = drive.attitude_error(sol.q_nb[first], d.C_nb[first])[2]
        assert abs(heading) < 3.0 * sol.std_attitude_n[first, 2]
