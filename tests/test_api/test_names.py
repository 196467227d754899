"""Public names exist and are found lazily."""

import importlib
import pkgutil
import sys
import types

import public
import pytest

import strapdown as sd


@pytest.mark.parametrize("name", public.modules())
def test_every_name_in_all_exists(name):
    module = importlib.import_module(name)
    for attribute in getattr(module, "__all__", ()):
        assert hasattr(module, attribute), f"{name}.{attribute}"


@pytest.mark.parametrize("name", sd.__all__)
def test_top_level_names_are_loaded_on_first_use(name):
    assert getattr(sd, name) is not None
    assert name in dir(sd)


def test_every_package_on_disk_can_be_reached_from_the_top():
    flat_but_not_for_users = {"cli", "kernels", "constants", "recording", "solution", "truth"}
    there = {
        module.name
        for module in pkgutil.iter_modules(sd.__path__)
        if not module.name.startswith("_")
    }
    reached = set(sd.__all__) | {"estimator", "motion"} | flat_but_not_for_users
    assert there <= reached


def test_estimators_is_the_registry():
    assert isinstance(sd.estimators, types.ModuleType)
    assert sd.estimators is sys.modules["strapdown.estimator"]


def test_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'strapdown' has no attribute 'madgwick'"):
        _ = sd.madgwick


def test_part_that_is_not_built_yet_says_so(monkeypatch):
    monkeypatch.setattr(sd, "_MODULES", (*sd._MODULES, "teleport"))
    with pytest.raises(AttributeError, match=r"strapdown [\d.]+ has no 'teleport' yet"):
        _ = sd.teleport
