"""How far an estimate is from a reference."""

from strapdown.evaluation.attitude import AttitudeErrors, attitude_errors, mount_at
from strapdown.evaluation.comparison import Trial, means, trials
from strapdown.evaluation.navigation import NavigationErrors, navigation_errors
from strapdown.evaluation.statistics import ErrorStatistics, robust_circular_mean
from strapdown.evaluation.sync import Match, match

__all__ = [
    "AttitudeErrors",
    "ErrorStatistics",
    "Match",
    "NavigationErrors",
    "Trial",
    "attitude_errors",
    "match",
    "means",
    "mount_at",
    "navigation_errors",
    "robust_circular_mean",
    "trials",
]
