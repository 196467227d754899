"""The five devices of the theses: their experiments, and their printed tables beside ours.

Each system is a package whose ``PARTS`` are its experiments; `strapdown reproduce` runs them.
"""

from strapdown.systems._parts import SYSTEMS, Part, System, parts
from strapdown.systems._rows import Row, Shown, Tolerance, Verdict

__all__ = [
    "SYSTEMS",
    "Part",
    "Row",
    "Shown",
    "System",
    "Tolerance",
    "Verdict",
    "parts",
]
