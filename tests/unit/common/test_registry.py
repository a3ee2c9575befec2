# SPDX-License-Identifier: Apache-2.0
"""Classes add themselves to the table of their kind, under the word of their own body."""

import sys
from importlib import import_module
from types import SimpleNamespace

import pytest

import lgvi_warp as lw
from lgvi_warp.common import registry
from lgvi_warp.control.base import SECTIONS
from lgvi_warp.physics.terms import events
from lgvi_warp.sampling.designs import KINDS as SAMPLINGS
from lgvi_warp.sampling.distributions.named import KINDS as DISTRIBUTIONS
from lgvi_warp.statistics.base import TYPES as STATISTICS
from tests.house.test_start import modules_after

TABLES = [(STATISTICS, "type"), (SAMPLINGS, "kind"), *((base.kinds, "type") for base in SECTIONS.values())]


def kind(name, word=None, module=__name__):
    return type(name, (), {"__module__": module} | ({} if word is None else {"type": word}))


def test_the_first_class_keeps_its_word():
    known, first = {}, kind("First", "wave")
    assert registry.add(known, first)
    assert registry.add(known, first)
    assert not registry.add(known, kind("Second", "wave"))
    assert not registry.add(known, kind("First", "wave", "other"))
    assert known == {"wave": first}


def test_a_class_made_again_replaces_the_former():
    known, again = {}, kind("First", "wave")
    registry.add(known, kind("First", "wave"))
    assert registry.add(known, again)
    assert known == {"wave": again}


@pytest.mark.parametrize("word", ["", None])
def test_a_class_without_a_word_is_not_added(word):
    known = {}
    assert not registry.add(known, kind("First", word))
    assert known == {}
    inherits = type("Second", (kind("First", "wave"),), {})
    assert not registry.add(known, inherits)
    assert known == {}


def test_each_family_knows_its_classes():
    tables = (lw.laws.Term.kinds, events.TYPES, STATISTICS, SAMPLINGS, DISTRIBUTIONS)
    some = (
        lw.terms.Waves, lw.events.StopTime, lw.statistics.PathTime, lw.designs.UnitCubePoints,
        lw.distributions.PhysicalInertia,
    )  # fmt: skip
    assert all(one in known.values() for known, one in zip(tables, some, strict=True))


def test_a_built_in_class_is_imported_when_its_word_is_looked_up():
    modules = modules_after("from lgvi_warp.statistics.base import TYPES; TYPES['each']")
    assert "lgvi_warp.statistics.paths.member_values" in modules
    assert "lgvi_warp.statistics.metrics.tracking_metrics" not in modules


def test_the_tables_of_built_in_words_are_true():
    for table, attribute in TABLES:
        assert isinstance(table, registry.Kinds)
        assert all(vars(kind)[attribute] == word for word, kind in table.items())


CROWD = """
from tests.unit.common.test_registry import registry
KINDS = registry.Kinds("{name}", {{"one": ["first"]}})
class Base:
    def __init_subclass__(cls):
        registry.add(KINDS, cls)
"""


def test_a_class_that_no_table_names_is_found_too(tmp_path, monkeypatch):
    (tmp_path / "listed").mkdir()
    (tmp_path / "listed" / "__init__.py").write_text(CROWD.format(name="listed"))
    for name, word in (("one", "first"), ("two", "second")):
        text = f"from listed import Base\nclass {name.title()}(Base):\n    type = {word!r}\n"
        (tmp_path / "listed" / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    kinds = import_module("listed").KINDS
    assert kinds["first"].__name__ == "One"
    assert "listed.two" not in sys.modules
    assert kinds["second"].__name__ == "Two"
    assert list(kinds) == ["first", "second"]
    assert "third" not in kinds


def test_all_modules_of_a_package_are_imported(tmp_path, monkeypatch):
    (tmp_path / "crowd").mkdir()
    for name in ("__init__", "one", "two"):
        (tmp_path / "crowd" / f"{name}.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    registry.load_modules(SimpleNamespace(__name__="crowd", __path__=[str(tmp_path / "crowd")]))
    assert {"crowd.one", "crowd.two"} <= sys.modules.keys()
