"""Docstrings say what the signatures say: names, order, and defaults."""

import dataclasses
import importlib
import inspect
import re

import public
import pytest
from numpydoc.docscrape import NumpyDocString


def documented():
    """Yield every public class, function and method whose docstring has a Parameters section."""
    for name in public.modules():
        module = importlib.import_module(name)
        for attribute, value in sorted(vars(module).items()):
            if attribute.startswith("_") or getattr(value, "__module__", None) != name:
                continue
            if inspect.isclass(value):
                yield f"{name}.{attribute}", value
                for key, member in sorted(vars(value).items()):
                    function = getattr(member, "__func__", member)
                    if not key.startswith("_") and inspect.isfunction(function):
                        yield f"{name}.{attribute}.{key}", function
            elif inspect.isfunction(value):
                yield f"{name}.{attribute}", value


CASES = [
    pytest.param(value, id=name)
    for name, value in documented()
    if "\nParameters\n" in inspect.cleandoc(value.__doc__ or "").replace("\r", "")
]


def names_in(doc: NumpyDocString) -> list[str]:
    return [
        part.strip().lstrip("*")
        for parameter in doc["Parameters"]
        for part in parameter.name.split(",")
    ]


def names_of(value) -> list[str]:
    if dataclasses.is_dataclass(value):
        return [f.name for f in dataclasses.fields(value) if f.init and not f.name.startswith("_")]
    return [n for n in inspect.signature(value).parameters if n not in ("self", "cls")]


@pytest.mark.parametrize("value", CASES)
def test_documented_parameters_are_those_of_the_signature(value):
    doc = NumpyDocString(inspect.cleandoc(value.__doc__))
    own = [n for n in names_of(value) if n in getattr(value, "__annotations__", {})]
    # a subclass may leave the parameters of its base to the base's docstring
    assert names_in(doc) in (names_of(value), own)


@pytest.mark.parametrize("value", CASES)
def test_documented_defaults_are_those_of_the_signature(value):
    doc = NumpyDocString(inspect.cleandoc(value.__doc__))
    parameters = inspect.signature(value).parameters
    for parameter in doc["Parameters"]:
        stated = re.search(r"default[:= ]+`*([^`,\s]+)", parameter.type)
        if stated is None:
            continue
        for name in (n.strip().lstrip("*") for n in parameter.name.split(",")):
            default = parameters[name].default
            text = default.value if hasattr(default, "value") else default
            assert stated.group(1).strip("'\"") in (
                str(text),
                f"{text:g}" if isinstance(text, float) else "",
            ), name
