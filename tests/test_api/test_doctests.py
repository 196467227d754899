"""Examples in docstrings run, and print what they show."""

import doctest
import importlib

import public
import pytest


@pytest.mark.parametrize("name", public.modules())
def test_examples_in_docstrings_are_true(name, tmp_path, monkeypatch):
    module = importlib.import_module(name)
    monkeypatch.chdir(tmp_path)
    found = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert found.failed == 0
