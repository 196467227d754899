"""Validation shared by the API layer; kernels never call it.

Each function takes the argument's name first and returns the value in the form
that kernels want: C-contiguous float64. An input that already has this form is
returned as it is, not copied. A refusal is one sentence: what must be, what was
got, and in which row.
"""

import difflib
import math
import operator
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from strapdown._types import BoolArray, FloatArray

UNIT_NORM_TOLERANCE = 1e-6  # a quaternion further off is not a rounded unit quaternion
LARGEST = 1e75  # no quantity in SI comes near; the fourth power is still a number
ROUND_OFF = 1e-15  # a quaternion just scaled to unit norm is off by less: about 3 eps


def as_floats(name: str, value: ArrayLike) -> FloatArray:
    """Return `value` as a C-contiguous float64 array of any shape.

    Masked elements become NaN. Text, objects and complex numbers are refused.
    """
    if isinstance(value, np.ma.MaskedArray):
        value = np.ma.filled(value.astype(np.float64), np.nan)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ValueError(
            f"`{name}` must be a regular array of numbers, got rows of different length."
        ) from None
    if array.dtype.kind not in "biuf":
        raise TypeError(f"`{name}` must hold real numbers, got dtype {array.dtype}.")
    # ascontiguousarray would make a scalar one-dimensional.
    return np.asarray(array, dtype=np.float64, order="C")


def _place(array_shape: tuple[int, ...], flat_index: int) -> str:
    """Return `` in row 3`` or `` at index (2, 3)``, nothing for a single item."""
    if not array_shape:
        return ""
    if len(array_shape) == 1:
        return f" in row {flat_index}"
    index = tuple(int(i) for i in np.unravel_index(flat_index, array_shape))
    return f" at index {index}"


def _require_finite(
    name: str,
    array: FloatArray,
    item_ndim: int,
    *,
    allow_nan: bool,
    largest: float = np.finfo(np.float64).max,
) -> None:
    """Refuse inf, and NaN too unless allowed, naming the first bad item."""
    bad: BoolArray = np.abs(array) > largest  # False for NaN
    if not allow_nan:
        bad |= np.isnan(array)
    if not bad.any():
        return
    shape = array.shape[: array.ndim - item_ndim]
    items = bad.reshape(*shape, -1).any(axis=-1) if item_ndim else bad
    first = int(np.flatnonzero(items)[0])
    got = " ".join(str(array.reshape(-1, *array.shape[len(shape) :])[first]).split())
    must = "finite or NaN" if allow_nan else "finite"
    if np.isfinite(array[bad]).all():
        must += f" and below {largest:g} in size"
    raise ValueError(f"`{name}` must be {must}, got {got}{_place(shape, first)}.")


def as_samples(
    name: str, value: ArrayLike, width: int = 3, *, allow_nan: bool = False
) -> FloatArray:
    """Return `value` as samples of shape (n, width), finite unless `allow_nan`.

    `allow_nan` admits NaN, which estimators skip and flag; infinity stays refused.
    """
    array = as_floats(name, value)
    if array.ndim != 2 or array.shape[1] != width:
        raise ValueError(f"`{name}` must have shape (n, {width}), got {array.shape}.")
    _require_finite(name, array, 1, allow_nan=allow_nan, largest=LARGEST)
    return array


def as_series(
    name: str, value: ArrayLike, n: int | None = None, *, allow_nan: bool = False
) -> FloatArray:
    """Return `value` as one number per sample, shape (n,)."""
    array = as_floats(name, value)
    if array.ndim != 1 or (n is not None and array.size != n):
        raise ValueError(
            f"`{name}` must have shape ({'n' if n is None else n},), got {array.shape}."
        )
    _require_finite(name, array, 0, allow_nan=allow_nan, largest=LARGEST)
    return array


def as_vector(
    name: str, value: ArrayLike, size: int = 3, *, allow_nan: bool = False
) -> FloatArray:
    """Return `value` as one vector of shape (size,)."""
    array = as_floats(name, value)
    if array.shape != (size,):
        raise ValueError(f"`{name}` must have shape ({size},), got {array.shape}.")
    _require_finite(name, array, 1, allow_nan=allow_nan, largest=LARGEST)
    return array


def as_vectors(
    name: str, value: ArrayLike, width: int = 3, *, allow_nan: bool = False
) -> FloatArray:
    """Return `value` as vectors of any leading shape, (..., width)."""
    array = as_floats(name, value)
    if array.ndim < 1 or array.shape[-1] != width:
        raise ValueError(f"`{name}` must have shape (..., {width}), got {array.shape}.")
    _require_finite(name, array, 1, allow_nan=allow_nan)
    return array


def as_matrices(
    name: str, value: ArrayLike, rows: int = 3, columns: int = 3, *, allow_nan: bool = False
) -> FloatArray:
    """Return `value` as matrices of any leading shape, (..., rows, columns)."""
    array = as_floats(name, value)
    if array.ndim < 2 or array.shape[-2:] != (rows, columns):
        raise ValueError(f"`{name}` must have shape (..., {rows}, {columns}), got {array.shape}.")
    _require_finite(name, array, 2, allow_nan=allow_nan)
    return array


def as_times(
    name: str, value: ArrayLike, n: int | None = None, *, after: float | None = None
) -> FloatArray:
    """Return `value` as strictly increasing finite times, shape (n,).

    With `after`, the first one must be later than it.
    """
    array = as_series(name, value, n)
    late = array[1:] > array[:-1]
    first_is_late = after is None or array.size == 0 or bool(array[0] > after)
    if not first_is_late:
        raise ValueError(f"`{name}` must increase, got {array[0]} after {after} in row 0.")
    if not late.all():
        k = int(np.argmin(late)) + 1
        raise ValueError(
            f"`{name}` must increase, got {array[k]} after {array[k - 1]} in row {k}."
        )
    return array


def as_quats(name: str, value: ArrayLike, *, allow_nan: bool = False) -> FloatArray:
    """Return unit quaternions (w, x, y, z) of any leading shape, (..., 4).

    A norm within 1e-6 of one is rounding and is scaled away; any other is an error.
    Quaternions that are unit to the last digits keep their bits, so that a stored
    and loaded one is the same.
    """
    array = as_vectors(name, value, 4, allow_nan=allow_nan)
    norm = np.sqrt(np.einsum("...i,...i->...", array, array))
    bad = np.abs(norm - 1.0) > UNIT_NORM_TOLERANCE  # False for NaN
    if bad.any():
        first = int(np.flatnonzero(bad)[0])
        raise ValueError(
            f"`{name}` must have unit norm within {UNIT_NORM_TOLERANCE:g}, got norm "
            f"{norm.flat[first]:.9g}{_place(norm.shape, first)}; "
            "if only its direction counts, divide it by its norm first."
        )
    rounded = np.abs(norm - 1.0) > ROUND_OFF
    if not rounded.any():
        return array
    return np.where(rounded[..., np.newaxis], array / norm[..., np.newaxis], array)


def same_length(**arrays: FloatArray) -> int:
    """Return the common length of the named arrays."""
    lengths = {name: len(array) for name, array in arrays.items()}
    if len(set(lengths.values())) > 1:
        names = " and ".join(f"`{name}`" for name in lengths)
        found = " and ".join(str(length) for length in lengths.values())
        raise ValueError(f"{names} must have equal length, got {found}.")
    return next(iter(lengths.values()))


def finite(name: str, value: Any) -> float:
    """Return `value` as a finite float."""
    out = _as_float(name, value)
    if not math.isfinite(out):
        raise ValueError(f"`{name}` must be finite, got {value!r}.")
    return _of_a_size(name, out)


def positive(name: str, value: Any, *, allow_zero: bool = False, allow_inf: bool = False) -> float:
    """Return `value` as a finite float greater than zero, or not negative, or infinite."""
    out = _as_float(name, value)
    if allow_inf and out == math.inf:
        return out
    if not (math.isfinite(out) and (out >= 0.0 if allow_zero else out > 0.0)):
        kind = "non-negative" if allow_zero else "positive"
        kind += "" if allow_inf else " and finite"
        raise ValueError(f"`{name}` must be {kind}, got {value!r}.")
    return _of_a_size(name, out)


def _of_a_size(name: str, value: float) -> float:
    """Refuse what is so large or small that its square is infinite or zero."""
    if value != 0.0 and not 1.0 / LARGEST <= abs(value) <= LARGEST:
        raise ValueError(
            f"`{name}` must be between {1.0 / LARGEST:g} and {LARGEST:g} in size, got {value!r}."
        )
    return value


def same_shape(**arrays: FloatArray) -> None:
    """Refuse arrays that do not broadcast."""
    try:
        np.broadcast_shapes(*(array.shape for array in arrays.values()))
    except ValueError:
        names = " and ".join(f"`{name}`" for name in arrays)
        found = " and ".join(str(array.shape) for array in arrays.values())
        raise ValueError(
            f"{names} must have equal or broadcastable shapes, got {found}."
        ) from None


def in_range(name: str, value: Any, low: float, high: float) -> float:
    """Return `value` as a float in the closed interval from `low` to `high`."""
    out = _as_float(name, value)
    if not low <= out <= high:
        raise ValueError(f"`{name}` must lie in [{low:g}, {high:g}], got {value!r}.")
    return out


def whole(name: str, value: Any, low: int | None = None, high: int | None = None) -> int:
    """Return `value` as an int, between `low` and `high` where given."""
    try:
        out = operator.index(value)
    except TypeError:
        if not (isinstance(value, float) and value.is_integer()):
            raise TypeError(f"`{name}` must be a whole number, got {value!r}.") from None
        out = int(value)
    if (low is not None and out < low) or (high is not None and out > high):
        bounds = " and ".join(
            text
            for text in (
                f"at least {low}" if low is not None else "",
                f"at most {high}" if high is not None else "",
            )
            if text
        )
        raise ValueError(f"`{name}` must be {bounds}, got {value!r}.")
    return out


def one_of(name: str, value: Any, choices: Iterable[str]) -> str:
    """Return `value` if it is one of `choices`; else offer the nearest name."""
    names = list(choices)
    if isinstance(value, str) and value in names:
        return value
    raise ValueError(
        f"`{name}` must be one of {', '.join(names)}, got {value!r}{nearest(value, names)}."
    )


def instance(name: str, value: Any, cls: type, way_out: str = "") -> None:
    """Refuse what is not a `cls`, saying how to get one."""
    if not isinstance(value, cls):
        hint = f"; {way_out}" if way_out else ""
        raise TypeError(f"`{name}` must be a {cls.__name__}, got {type(value).__name__}{hint}.")


def instances(name: str, values: Any, cls: type) -> list[Any]:
    """Return `values` as a list, all of it of `cls`."""
    try:
        found = list(values)
    except TypeError:
        raise TypeError(
            f"`{name}` must be a sequence of {cls.__name__}, got {type(values).__name__}."
        ) from None
    for k, value in enumerate(found):
        instance(f"{name}[{k}]", value, cls)
    return found


def call(name: str, value: Any) -> None:
    """Refuse what cannot be called."""
    if not callable(value):
        raise TypeError(f"`{name}` must be a function, got {type(value).__name__}.")


def recording(name: str, value: Any) -> None:
    """Refuse what is not a recording."""
    from strapdown.recording import Recording

    instance(name, value, Recording, "strapdown.read(path) makes one of a log")


def nearest(value: Any, choices: Iterable[str]) -> str:
    """Return the tail of a message that offers the nearest choice, or nothing."""
    by_lower = {choice.lower(): choice for choice in choices}
    found = difflib.get_close_matches(str(value).lower(), by_lower, n=1, cutoff=0.6)
    return f"; the nearest name is {by_lower[found[0]]!r}" if found else ""


def _as_float(name: str, value: Any) -> float:
    """Return `value` as a float; text is not a number here."""
    if isinstance(value, (str, bytes)):
        raise TypeError(f"`{name}` must be a number, got {value!r}.")
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise TypeError(f"`{name}` must be a number, got {value!r}.") from None
