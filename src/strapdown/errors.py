"""Errors and warnings of the package.

A wrong argument raises `ValueError` or `TypeError`. What goes wrong beyond the
arguments has a tree of its own::

    StrapdownError
    ├── InputError (also a ValueError)   the input is at fault
    │   ├── FormatError                  a file does not hold what it should
    │   ├── MissingStream                a recording lacks a sensor that is needed
    │   └── DataGap                      a stream has no samples where they are needed
    └── ComputationError                 the input is sound, the computation failed
        └── NotConverged                 an iteration did not reach its tolerance

Every message is one sentence: what must be, what was found, where, and the way
out when it is not obvious.
"""

from os import PathLike, fspath


class StrapdownError(Exception):
    """Base of all errors that the package raises for itself."""


class InputError(StrapdownError, ValueError):
    """The input cannot be used as it is; another input can."""


class FormatError(InputError):
    """A file does not hold what its format promises.

    Parameters
    ----------
    what : str
        What must be and what was found, without the place and the full stop.
    file : str or path, optional
        The file that was read.
    stream : str, optional
        Stream or column in the file, such as ``"imu"`` or ``"gyr_x_dps"``.
    row : int, optional
        Row in the file or stream, counted as the message says it.
    hint : str, optional
        The way out.
    """

    def __init__(
        self,
        what: str,
        *,
        file: str | PathLike[str] | None = None,
        stream: str | None = None,
        row: int | None = None,
        hint: str | None = None,
    ) -> None:
        super().__init__(what)
        self.what = what
        self.file = None if file is None else fspath(file)
        self.stream = stream
        self.row = row
        self.hint = hint

    def __str__(self) -> str:
        """One sentence: place, fault, way out."""
        place = ", ".join(
            part
            for part in (
                self.file,
                f"stream {self.stream}" if self.stream is not None else None,
                f"row {self.row}" if self.row is not None else None,
            )
            if part
        )
        fault = self.what.rstrip().rstrip(".")
        return (
            (f"{place}: " if place else "")
            + fault
            + (f"; {self.hint.rstrip().rstrip('.')}" if self.hint else "")
            + "."
        )


class MissingStream(InputError):
    """A recording lacks a sensor that the work needs."""


class DataGap(InputError):
    """A stream has no samples where they are needed."""


class ComputationError(StrapdownError):
    """The input is sound, but the computation failed."""


class NotConverged(ComputationError):
    """An iteration did not reach its tolerance.

    Parameters
    ----------
    what : str
        What was computed, such as ``"ellipsoid fit"``.
    iterations : int
        Iterations done.
    residual : float
        What was left when it stopped.
    hint : str, optional
        The way out.
    """

    def __init__(
        self, what: str, iterations: int = 0, residual: float = float("nan"), hint: str = ""
    ) -> None:
        super().__init__(what, iterations, residual, hint)
        self.what = what
        self.iterations = iterations
        self.residual = residual
        self.hint = hint

    def __str__(self) -> str:
        """One sentence: what, how far it came, way out."""
        tail = f"; {self.hint.rstrip().rstrip('.')}" if self.hint else ""
        return (
            f"{self.what} did not converge in {self.iterations} iterations, "
            f"residual {self.residual:.3g}{tail}."
        )


class StrapdownWarning(UserWarning):
    """Something the user can act on; the result stands with the stated reserve."""


class ModelExpiredWarning(StrapdownWarning):
    """A model, such as the magnetic one, was used outside its years of validity."""
