"""What the doctor says: one sentence, how sure it is, and what to do."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum, unique


@unique
class Severity(StrEnum):
    """How much a finding matters."""

    OK = "ok"
    NOTE = "note"
    WARNING = "warning"
    ERROR = "error"

    @property
    def rank(self) -> int:
        """Zero for what is in order, three for what makes every result wrong."""
        return list(Severity).index(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One answer of the doctor.

    Attributes
    ----------
    check : str
        What was asked, such as ``"axes"`` or ``"units"``; see ``docs/doctor.md``.
    severity : Severity
        ``ok``: in order; ``note``: worth knowing; ``warning``: results will suffer;
        ``error``: results will be wrong.
    sentence : str
        What was found.
    confidence : float
        Probability of what the sentence claims, from 0 to 1; 1 for what was counted.
    advice : str
        What to do; empty when there is nothing to do.
    stream : str
        Stream that it concerns, such as ``"gyr"``; empty for the whole log.
    """

    check: str
    severity: Severity
    sentence: str
    confidence: float = 1.0
    advice: str = ""
    stream: str = ""

    @property
    def is_alarm(self) -> bool:
        """Whether it is a warning or an error."""
        return self.severity.rank >= Severity.WARNING.rank

    def __str__(self) -> str:
        """Return the sentence and the advice."""
        return f"{self.sentence} {self.advice}".strip()


def short(value: float) -> str:
    """Return a number in two digits, without an exponent where it is large."""
    return f"{value:.2g}" if abs(value) < 99.5 else f"{value:.0f}"


def worst_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings in the order of their weight, those of equal weight as they came."""
    return tuple(sorted(findings, key=lambda finding: -finding.severity.rank))
