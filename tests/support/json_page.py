# SPDX-License-Identifier: Apache-2.0
"""The tables of docs/reference/json.md, and what of a document differs from them."""

import re

from tests.conftest import ROOT

TEXT = (ROOT / "docs" / "reference" / "json.md").read_text()
# A document or part of one -> key -> its type.
TABLES = {
    name.strip(): {
        key: kind.strip()
        for keys, kind in re.findall(r"^\| (`.*?`) \| (.*?) \|", section, re.MULTILINE)
        for key in re.findall(r"`(\w+)`", keys)
    }
    for names, section in re.findall(r"^##+ ([\w, -]+)\n(.*?)(?=^##|\Z)", TEXT, re.DOTALL | re.MULTILINE)
    for name in names.split(",")
}
PLAIN = {
    "text": lambda value: isinstance(value, str),
    "number": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "whole number": lambda value: isinstance(value, int) and not isinstance(value, bool),
    "true or false": lambda value: isinstance(value, bool),
    "null": lambda value: value is None,
    "any": lambda value: True,
}


def differing(document, name):
    """Differences of a document from a table of the page: texts, none where it is as stated."""
    return _table(document, TABLES["every document"] | TABLES[name], name)


def _table(value, keys, where):
    if not isinstance(value, dict):
        return [f"{where}: no table"]
    needed = {key for key, kind in keys.items() if not kind.endswith(", optional")}
    found = [f"{where}.{key}: missing" for key in sorted(needed - value.keys())]
    found += [f"{where}.{key}: not stated" for key in sorted(value.keys() - keys.keys())]
    for key in sorted(value.keys() & keys.keys()):
        found += _value(value[key], keys[key].removesuffix(", optional"), f"{where}.{key}")
    return found


def _value(value, kind, where):
    if kind in PLAIN:
        return [] if PLAIN[kind](value) else [f"{where}: {value!r} is not a {kind}"]
    if kind.startswith("list of "):
        if not isinstance(value, list):
            return [f"{where}: no list"]
        return [text for i, one in enumerate(value) for text in _value(one, kind[8:], f"{where}[{i}]")]
    if kind.startswith("table of "):
        if not isinstance(value, dict):
            return [f"{where}: no table"]
        return [text for key, one in value.items() for text in _value(one, kind[9:], f"{where}.{key}")]
    if " or " in kind:
        tried = [_value(value, one, where) for one in kind.split(" or ")]
        return min(tried, key=len)
    return _table(value, TABLES[kind.strip("`")], where)
