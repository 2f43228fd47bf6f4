"""Settings that count something are whole numbers, in every config."""

from __future__ import annotations

import dataclasses
import importlib
import re
import typing
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import pianomime
from pianomime.errors import InputError
from pianomime.learn.imitation.config import policy_config
from pianomime.learn.runs.trainer_config import TrainerConfig

_MADE = {TrainerConfig: TrainerConfig(steps=10), type(policy_config("bc-mse")): None}
"""Configs that have no default, and None for those whose settings are in configs of their own."""

_CONFIG = re.compile(r"^@dataclass.*\nclass (\w*(?:Config|Sampler))\b", re.MULTILINE)


def configs() -> Iterator[type[Any]]:
    """The settings of the program: dataclasses that are called so."""
    root = Path(pianomime.__file__).parent
    for file in sorted(root.rglob("*.py")):
        # Only modules that define some are imported, which spares torch.
        for name in _CONFIG.findall(file.read_text(encoding="utf-8")):
            module = ".".join(["pianomime", *file.relative_to(root).with_suffix("").parts])
            yield getattr(importlib.import_module(module), name)


def test_a_fraction_is_refused_in_one_line() -> None:
    tried = []
    for kind in configs():
        config = _MADE[kind] if kind in _MADE else kind()
        for name, hint in typing.get_type_hints(kind).items():
            wrong: list[Any] = []
            if hint is int:
                wrong = [1.5, True, "3"]
            elif hint == tuple[int, ...]:
                wrong = [(8.5,)]
            for value in wrong:
                with pytest.raises(InputError, match=f"{name.replace('_', '-')} must be a whole"):
                    dataclasses.replace(config, **{name: value})
                tried.append((kind.__name__, name))
    assert ("TrainerConfig", "steps") in tried
    assert ("FingeringConfig", "beam") in tried
    assert len(tried) > 100
