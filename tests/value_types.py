"""The law of value types: they do not change, and arrays are not compared by accident."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
from types import ModuleType

import pytest


def check_value_types(package: ModuleType) -> None:
    """Configs are frozen dataclasses with defaults; all dataclasses of a package are frozen.

    Comparing two that hold arrays would raise, so they are compared by identity.
    """
    checked = 0
    for info in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
        module = importlib.import_module(info.name)
        for name, kind in inspect.getmembers(module, inspect.isclass):
            if kind.__module__ != info.name:
                continue
            if name.endswith("Config"):
                assert dataclasses.is_dataclass(kind), name
                assert kind() == kind(), name
            if not dataclasses.is_dataclass(kind):
                continue
            checked += 1
            one = object.__new__(kind)
            field = dataclasses.fields(kind)[0]
            with pytest.raises(dataclasses.FrozenInstanceError):
                setattr(one, field.name, None)
            holds_arrays = any("NDArray" in str(each.type) for each in dataclasses.fields(kind))
            by_identity = kind.__eq__ is object.__eq__
            assert by_identity or not holds_arrays, name
    assert checked >= 2
