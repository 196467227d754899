"""General Kalman tools, in plain NumPy: for models of one's own, for study and for checks.

The estimators of `strapdown.attitude` and `strapdown.navigation` have compiled filters of their
own; these tools are what the theses describe in general, on matrices of any size.

==================================  ========================================================
`predict`, `update`, `run`          linear filter, Joseph form
`extended_predict`,                 extended filter: Jacobians at the estimate
`extended_update`, `run_extended`
`run_linearised`                    Jacobians on a nominal trajectory
`Information`, `fuse`               estimates and measurements added in information form
`wiener`, `gauss_markov`,           noise with memory as states
`augment`
`steady_state`, `run_constant`      constant gain, computed beforehand
`van_loan`, `transition`,           from continuous to discrete: exact, or by series
`noise_series`, `input_matrix`
`nees`, `nis`, `mean_bounds`        is a filter as sure as it should be?
`observability`                     what measurements tell of a state, and what stays open
==================================  ========================================================
"""

from strapdown.kalman.consistency import mean_bounds, nees, nis
from strapdown.kalman.discretise import input_matrix, noise_series, transition, van_loan
from strapdown.kalman.information import Information, fuse
from strapdown.kalman.linear import Correction, Estimate, Track, predict, run, update
from strapdown.kalman.nonlinear import (
    extended_predict,
    extended_update,
    jacobian,
    run_extended,
    run_linearised,
)
from strapdown.kalman.observability import Observed, observability
from strapdown.kalman.shaping import Augmented, NoiseModel, augment, gauss_markov, wiener
from strapdown.kalman.steady import SteadyState, run_constant, steady_state

__all__ = [
    "Augmented",
    "Correction",
    "Estimate",
    "Information",
    "NoiseModel",
    "Observed",
    "SteadyState",
    "Track",
    "augment",
    "extended_predict",
    "extended_update",
    "fuse",
    "gauss_markov",
    "input_matrix",
    "jacobian",
    "mean_bounds",
    "nees",
    "nis",
    "noise_series",
    "observability",
    "predict",
    "run",
    "run_constant",
    "run_extended",
    "run_linearised",
    "steady_state",
    "transition",
    "update",
    "van_loan",
    "wiener",
]
