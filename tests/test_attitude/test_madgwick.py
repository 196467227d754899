"""The Madgwick filter on real trials beside the figures that the benchmark's authors publish."""

import numpy as np

import strapdown
from strapdown.attitude import Madgwick
from strapdown.evaluation import attitude_errors


def test_mean_over_ten_trials_is_near_that_of_the_authors_program(data_dir):
    """BROAD publishes 4.53 / 3.32 / 2.69 deg for Madgwick's own C code with beta 0.12.

    That code deviates from the paper's equations in the magnetometer part; the limits allow the
    mean 0.3 deg more in total and in inclination.
    """
    trials = sorted((data_dir / "broad").glob("*.mat"))
    assert len(trials) == 10
    rmse = []
    for path in trials:
        rec = strapdown.read(path)
        sol = Madgwick(beta=0.12).run(rec, diagnostics=False)
        summary = attitude_errors(sol, rec.reference, remove_heading=False).summary()
        rmse.append([summary[f"{k}_rmse_deg"] for k in ("total", "heading", "inclination")])
    total, heading, inclination = np.mean(rmse, axis=0)
    print(f"mean RMSE {total:.2f} / {heading:.2f} / {inclination:.2f} deg")
    assert total <= 4.83
    assert inclination <= 2.99
    assert heading <= 3.62
