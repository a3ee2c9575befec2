# SPDX-License-Identifier: Apache-2.0
"""The page on the scene file has every key of every section, with its default, and no other.

python -m tests.house.test_scene_file_page writes its tables of types.
"""

import dataclasses
import json
import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import terms
from lgvi_warp.physics.terms import events
from lgvi_warp.sampling.designs import KINDS as SAMPLINGS
from lgvi_warp.sampling.distributions.named import KINDS as DISTRIBUTIONS
from lgvi_warp.sampling.distributions.named import SCIPY
from lgvi_warp.scene.scene import SECTIONS
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.statistics.base import TYPES as STATISTICS
from lgvi_warp.statistics.base import Statistic
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "start" / "scene_file.md").read_text()
# Heading of each table of keys -> the class whose fields they are.
KEYS = {
    "`[vehicle]`": lw.Vehicle, "`[environment]`": lw.Environment, "`[start]`": lw.Start,
    "`[ensemble]`": EnsembleSettings, "`[run]`": RunSettings, "`[[run.statistics]]`": Statistic,
    "`[run.until]`": lw.Until, "Not in the file: the store": lw.Store,
}  # fmt: skip
# Introduction of each table of types -> its classes by type, and the class whose fields they share.
KINDS = {
    "`[[terms]]`": (terms.TYPES, lw.laws.Term),
    "`[[events]]`": (events.TYPES, lw.laws.Event),
    "Distributions and their keys": (DISTRIBUTIONS, None),
    "Samplings and their keys": (SAMPLINGS, None),
    "Types and their further keys": (STATISTICS, Statistic),
}

# Types that the page treats in its text, and those that no file may name.
IN_WORDS = ("scipy", "own", "openturns", "derived", "weight", "restoring")


def rows(start):
    """The cells of the first table after a text of the page."""
    _, found, rest = PAGE.partition(start)
    assert found, start
    lines = rest[rest.index("\n|") + 1 :].split("\n\n")[0].splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def default(field):
    """The default of a field as the page writes it; None where it says in words what holds."""
    if field.default_factory is not dataclasses.MISSING:
        return json.dumps(field.default_factory())
    if field.default is dataclasses.MISSING or field.default is None:
        return None
    return json.dumps(field.default)


def key(field):
    """A field of a type, with shape, unit and default, as the page's tables of types write it."""
    shape, unit = field.metadata.get("shape", ()), field.metadata.get("unit")
    shape_text = f" ({', '.join(map(str, shape))}{',' * (len(shape) == 1)})" if shape else ""
    if field.default is dataclasses.MISSING:
        value = "required"
    elif field.default is None:
        value = "none"
    elif unit and not np.any(np.asarray(field.default)):
        value = "0"
    else:
        value = json.dumps(field.default)
    return f"`{field.name}`{shape_text}{f' [{unit}]' if unit else ''}: {value}"


def table(kinds, base):
    """The rows of a table of types: each type with the keys that the base class does not have."""
    shared = {field.name for field in dataclasses.fields(base)} if base else set()
    keys = {
        name: "; ".join(key(field) for field in dataclasses.fields(kind) if field.init and field.name not in shared)
        for name, kind in sorted(kinds.items())
        # Other tests have classes of their own.
        if kind.__module__.startswith("lgvi_warp.") and name not in IN_WORDS
    }
    return [[f"`{name}`", text or "none"] for name, text in keys.items()]


@pytest.mark.parametrize("heading", KEYS)
def test_keys_and_defaults(heading):
    fields = {field.name: field for field in dataclasses.fields(KEYS[heading])}
    expected = {name: default(field) for name, field in fields.items()}
    if KEYS[heading] is Statistic:
        expected["type"] = None
    found = rows(f"# {heading}")
    assert sorted(row[0] for row in found) == sorted(f"`{name}`" for name in expected)
    for name, _, shown, meaning in found:
        value = expected[name.strip("`")]
        assert shown == f"`{value}`" if value is not None else re.match("none|required", shown), (name, shown, value)
        assert meaning


@pytest.mark.parametrize("start", KINDS)
def test_types_and_their_keys(start):
    assert rows(start) == table(*KINDS[start]), "run: python -m tests.house.test_scene_file_page"


def test_every_section_and_every_distribution_of_scipy():
    sections = {name.split(".")[0] for name in re.findall(r"^##+ `\[+([\w.]+)\]+`", PAGE, re.MULTILINE)}
    assert sections == set(SECTIONS)
    assert all(f"`{name}`" in PAGE for name in SCIPY)


def write():
    """Write the tables of types into the page."""
    text = PAGE
    for start, kinds in KINDS.items():
        before, found, rest = text.partition(start)
        first = rest.index("\n|") + 1
        end = rest.index("\n\n", first)
        head = rest[first:end].splitlines()[:2]
        lines = head + [f"| {name} | {keys} |" for name, keys in table(*kinds)]
        text = before + found + rest[:first] + "\n".join(lines) + rest[end:]
    (ROOT / "docs" / "start" / "scene_file.md").write_text(text)


if __name__ == "__main__":
    write()
