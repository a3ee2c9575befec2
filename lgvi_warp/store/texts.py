# SPDX-License-Identifier: Apache-2.0
"""Check of a store's texts: provenance, recipe, messages and shared parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from lgvi_warp.common.machine import DTYPES
from lgvi_warp.control.signals import SAVED
from lgvi_warp.scene.settings import MOST_MEMBERS
from lgvi_warp.store.layout_check import NotOursError, is_text

ATTRIBUTES = {
    "Conventions", "title", "source", "format", "complete", "members", "provenance", "recipe", "messages", "shared", "crc32c",
}  # fmt: skip
# Most lanes of a packet: more than any processor has.
MOST_WIDTH = 1024
Rule = Callable[[Any], bool]


def _whole(least: int, most: int) -> Rule:
    return lambda value: type(value) is int and least <= value <= most


def _number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e300 and math.isfinite(value)


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(is_text(item) for item in value)


def _known(value: Any) -> bool:
    return _texts(value) and all(name in SAVED for name in value)


def _table(value: Any) -> bool:
    return isinstance(value, dict)


def _maybe(rule: Rule) -> Rule:
    return lambda value: value is None or rule(value)


def _of_texts(value: Any) -> bool:
    return isinstance(value, dict) and all(is_text(name) and is_text(text) for name, text in value.items())


PROVENANCE: dict[str, Rule] = {
    "scene": _table, "ensemble": _table, "method": lambda value: isinstance(value, dict) and is_text(value.get("name")),
    "step": lambda value: _number(value) and value > 0, "steps": _whole(0, 2**53), "dtype": lambda value: value in DTYPES,
    "terms": _texts, "versions": lambda value: _of_texts(value) and "lgvi-warp" in value, "machine": _table,
    "kernel": is_text, "checks": is_text, "on_failure": is_text, "width": _whole(1, MOST_WIDTH),
}  # fmt: skip
RECIPE: dict[str, Rule] = {
    "members": _whole(1, MOST_MEMBERS), "method": _table, "step": PROVENANCE["step"], "messages": _texts, "fields": _known,
    "dtype": PROVENANCE["dtype"], "width": PROVENANCE["width"], "checks": is_text, "on_failure": is_text, "keepers": _texts,
    "store": lambda value: isinstance(value, dict) and _store(value),
}  # fmt: skip
OBSERVED: dict[str, Rule] = {
    "keep": lambda value: is_text(value) or (isinstance(value, list) and all(map(_whole(0, MOST_MEMBERS), value))),
    "statistics": lambda value: isinstance(value, list), "until": _table, "functions": _texts, "fields": _known,
}  # fmt: skip


def _store(value: Mapping[str, Any]) -> bool:
    rules = {"dtype": _maybe(lambda dtype: dtype in ("float32", "float64")), "fields": _maybe(_known),
             "chunk_bytes": _whole(1, 2**40)}  # fmt: skip
    return value.keys() == rules.keys() and all(rule(value[name]) for name, rule in rules.items())


def check_texts(attributes: Mapping[str, Any], provenance: Any, recipe: Any, messages: Any, shared: Any) -> None:
    """Check the attributes and texts of a store."""
    unknown = sorted(attributes.keys() - ATTRIBUTES)
    if unknown:
        raise NotOursError(f"attribute {unknown[0][:60]!r} is not known")
    for table, rules, name in ((provenance, PROVENANCE, "provenance"), (recipe, RECIPE, "recipe")):
        _rules(name, table, rules, required=True)
    if not _of_texts(provenance.get("functions", {})):
        raise NotOursError("provenance.functions is not a table of texts")
    if not isinstance(provenance.get("start", {}), dict):
        raise NotOursError("provenance.start is not a table")
    if "observed" in provenance:
        _rules("observed", provenance["observed"], OBSERVED, required=False)
    if not _texts(messages) or not isinstance(shared, dict) or not all(is_text(name) for name in shared):
        raise NotOursError("messages are no list of texts, or shared no table")
    words = ("Conventions", "title", "source")
    if type(attributes.get("complete")) is not bool or not all(is_text(attributes.get(word, "")) for word in words):
        raise NotOursError("complete is not a truth value, or the title no text")
    if not _maybe(_whole(1, recipe["members"]))(attributes.get("members")):
        raise NotOursError(f"members are {attributes['members']!r:.60} of {recipe['members']}")


def _rules(name: str, table: Any, rules: Mapping[str, Rule], required: bool) -> None:
    if not isinstance(table, dict):
        raise NotOursError(f"{name} is not a table")
    for key, rule in rules.items():
        if key not in table and not required:
            continue
        try:
            good = rule(table[key])
        except (KeyError, TypeError):
            good = False
        if not good:
            raise NotOursError(f"{name}.{key} is {table.get(key)!r:.60}")
    if name == "recipe" and table.keys() != rules.keys():
        raise NotOursError(f"recipe has {', '.join(sorted(map(str, table.keys() ^ rules.keys())))[:100]}")
