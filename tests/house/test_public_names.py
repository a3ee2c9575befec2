# SPDX-License-Identifier: Apache-2.0
"""Public names: each has one door, the root has few, every door finds what its stub lists; and verbs of two names."""

import importlib
import inspect
from collections import Counter

import pytest

import lgvi_warp as lw
from lgvi_warp.cli.arguments import parser
from lgvi_warp.cli.command import VERBS
from tests.conftest import ROOT

DOORS = sorted(name for name in lw.__all__ if inspect.ismodule(getattr(lw, name)))
STUBS = sorted(path.relative_to(ROOT) for path in (ROOT / "lgvi_warp").rglob("*.pyi"))
MOST_NAMES_OF_THE_ROOT = 40


def names():
    """(door, name) of all public names; "" is the root."""
    return [("", name) for name in lw.__all__ if name not in DOORS] + [
        (door, name) for door in DOORS for name in getattr(lw, door).__all__
    ]


def test_the_root_has_few_names():
    assert len([name for door, name in names() if not door]) <= MOST_NAMES_OF_THE_ROOT


def test_each_thing_has_one_door():
    things = Counter(id(getattr(getattr(lw, door) if door else lw, name)) for door, name in names())
    twice = [(door, name) for door, name in names() if things[id(getattr(getattr(lw, door) if door else lw, name))] > 1]
    assert twice == []


def test_only_doors_have_stubs():
    paths = [path.with_suffix("") for path in STUBS]
    doors = {(path.parent if path.name == "__init__" else path).relative_to("lgvi_warp").as_posix() for path in paths}
    assert doors == {".", *DOORS}


@pytest.mark.parametrize("door", DOORS)
def test_a_door_can_be_imported_by_its_name(door):
    assert importlib.import_module(f"lgvi_warp.{door}") is getattr(lw, door)


@pytest.mark.parametrize("door", DOORS)
def test_a_door_finds_its_names_and_no_others(door):
    module = getattr(lw, door)
    assert dir(module) == module.__all__
    assert all(getattr(module, name) is not None for name in module.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'Setings'"):
        module.Setings


def test_the_verb_plan_is_the_verb_predict():
    chosen = [vars(parser().parse_args([verb, "scene.toml", "--members", "3"])) for verb in ("plan", "predict")]
    assert chosen[0].pop("verb") == "plan"
    assert chosen[1].pop("verb") == "predict"
    assert chosen[0] == chosen[1]
    assert VERBS["plan"] is VERBS["predict"]
    assert "predict (plan)" in parser().format_help()
