"""The examples in the docstrings of the ground floor do what they print."""

import doctest
import importlib

import pytest


@pytest.mark.parametrize("name", ["units", "rotation", "earth"])
def test_docstring_examples_run(name):
    failed, run = doctest.testmod(importlib.import_module(f"strapdown.{name}"))
    assert (failed, run > 0) == (0, True)
