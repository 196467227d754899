"""What a log really holds: units, axes, signs, time and sensor health, found from the data.

`examine` tests hypotheses about a log instead of trusting its labels; it never looks at the
reference. ``docs/doctor.md`` says what each check can see and what it cannot.
"""

from strapdown.doctor._examine import examine
from strapdown.doctor._finding import Finding, Severity

__all__ = ["Finding", "Severity", "examine"]
