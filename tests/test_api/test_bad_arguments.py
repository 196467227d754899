"""Every public function refuses nonsense with a sentence.

The tests walk over all public functions. Arguments come from the shapes in the docstrings; then
each argument in turn is replaced by what users pass by mistake. What comes back must be a result,
or a sentence of ours: never an error of NumPy, of an index, or a warning.
"""

import importlib
import inspect
import re
import warnings

import numpy as np
import pytest

import strapdown as sd

MODULES = (
    "rotation", "earth", "units", "motion", "evaluation", "kalman", "attitude.determination",
    "noise", "calibration", "doctor", "simulation", "simulation.motions", "simulation.vehicles",
    "simulation.demo", "sensors",
)  # fmt: skip
JUNK = {
    "empty": np.zeros(0),
    "no rows": np.zeros((0, 3)),
    "transposed": np.ones((3, 7)),
    "a row": np.ones(7),
    "NaN": np.nan,
    "infinity": np.inf,
    "negative": -1,
    "zero": 0,
    "huge": 1e300,
    "tiny": 1e-300,
    "beyond a double": 10**400,
    "text": "abc",
    "None": None,
    "list": [1, 2],
    "dict": {},
    "ragged": [[1, 2], [3]],
    "object": object(),
    "complex": 1j,
    "true": True,
    "bytes": b"x",
}
FOREIGN = re.compile(r"broadcast together|ufunc|operand|ambiguous|unpack|not supported between")


def functions():
    seen = set()
    for module in MODULES:
        loaded = importlib.import_module(f"strapdown.{module}")
        names = getattr(loaded, "__all__", None) or [
            name
            for name, value in vars(loaded).items()
            if not name.startswith("_") and getattr(value, "__module__", "") == loaded.__name__
        ]
        for name in names:
            f = getattr(loaded, name)
            if not callable(f) or f in seen or hasattr(f, "__members__"):
                continue
            seen.add(f)
            # A result that users only read checks nothing; what they fill in has defaults.
            if inspect.isclass(f) and not _settings(f):
                continue
            yield pytest.param(f, id=f"{module}.{name}")


def _settings(cls):
    parameters = inspect.signature(cls).parameters.values()
    return all(p.default is not p.empty for p in parameters) and "args" not in {
        p.name for p in parameters
    }


def documented(f):
    """Parameter name to the type that its docstring states."""
    section = re.search(r"Parameters\n-+\n(.*?)(\n\n[A-Z]\w+\n-+|\Z)", inspect.getdoc(f), re.S)
    found = {}
    for line in section.group(1).split("\n") if section else ():
        match = re.match(r"^([\w, *]+) : (.*)$", line)
        if match:
            found |= {name.strip(" *"): match.group(2) for name in match.group(1).split(",")}
    return found


def shape_of(text, sizes):
    match = re.search(r"shape \(([^)]*)\)", text)
    if not match:
        return None
    out = []
    for item in (part.strip() for part in match.group(1).split(",")):
        if item == "...":
            out.append(5)
        elif item.isdigit():
            out.append(int(item))
        elif re.fullmatch(r"[a-z]\w*", item):
            out.append(sizes.setdefault(item, {"n": 64, "m": 3}.get(item, 4)))
        elif item:
            return None
    return tuple(out)


def usual(name, text, sizes, default, rng):
    """A value of the stated type, or the default; None where nothing is known of it."""
    shape = shape_of(text, sizes)
    if shape is not None:
        if name in ("t", "t_ref", "times"):
            return 0.01 * np.arange(shape[0])
        if shape[-1:] == (4,):
            q = rng.standard_normal(shape)
            return q / np.linalg.norm(q, axis=-1, keepdims=True)
        if name.startswith("lla"):
            return np.broadcast_to([0.7, 0.2, 100.0], shape).copy()
        if len(shape) > 1 and shape[-1] == shape[-2]:
            return np.broadcast_to(np.eye(shape[-1]), shape).copy()
        return 0.3 + 0.1 * rng.standard_normal(shape)
    if default is not inspect.Parameter.empty:
        return default
    if text.startswith("int"):
        return 2
    return 0.5 if text.startswith(("float", "array_like")) else None


def spoilt(value):
    yield from JUNK.items()
    if isinstance(value, np.ndarray) and value.size:
        for name, number in (("one NaN", np.nan), ("one infinite", np.inf), ("one huge", 1e300)):
            copy = value.copy()
            copy.flat[-1] = number
            yield name, copy
        yield "all NaN", value * np.nan
        yield "all huge", value * 1e300
        yield "all zero", value * 0.0
        yield "turned over", value.T.copy()
        yield "one row", value[:1]
        yield "half", value[: len(value) // 2]
        yield "as text", value.astype(str)
        yield "as lists", value.tolist()


def complaint(f, arguments):
    """What is wrong with how `f` refuses the arguments, or None."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            f(**arguments)
    except np.linalg.LinAlgError as error:
        return f"LinAlgError: {error}"
    except OSError:
        return None  # no such file: the system's sentence says which
    except (sd.errors.StrapdownError, ValueError, TypeError) as error:
        ours = str(error).startswith("`") or str(error).endswith(".")
        path_like = "PathLike" in str(error)
        return None if (ours or path_like) and not FOREIGN.search(str(error)) else str(error)
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None


@pytest.mark.parametrize("f", list(functions()))
def test_nonsense_is_refused_with_a_sentence(f):
    types, sizes, rng = documented(f), {}, np.random.default_rng(1)
    arguments = {
        p.name: usual(p.name, types.get(p.name, ""), sizes, p.default, rng)
        for p in inspect.signature(f).parameters.values()
        if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
    }
    found = []
    for name, value in arguments.items():
        if isinstance(value, bool):
            continue
        for what, junk in spoilt(value):
            problem = complaint(f, {**arguments, name: junk})
            if problem is not None:
                found.append(f"{name} = {what}: {problem}")
    assert found == []
