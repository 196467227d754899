"""How far an estimate is from a reference."""

from strapdown.evaluation.attitude import AttitudeErrors, attitude_errors, mount_at
from strapdown.evaluation.comparison import Trial, means, trials
from strapdown.evaluation.navigation import NavigationErrors, navigation_errors
from strapdown.evaluation.outages import Window, blank, outage_errors
from strapdown.evaluation.statistics import ErrorStatistics, robust_circular_mean
from strapdown.evaluation.sync import Match, match

__all__ = [
    "AttitudeErrors",
    "ErrorStatistics",
    "Match",
    "NavigationErrors",
    "Trial",
    "Window",
    "attitude_errors",
    "blank",
    "match",
    "means",
    "mount_at",
    "navigation_errors",
    "outage_errors",
    "robust_circular_mean",
    "trials",
]
