# SPDX-License-Identifier: Apache-2.0
"""Files of vehicles from a stranger: refused in a few lines, in bounded time and memory; nothing is written."""

import pytest

from lgvi_warp.vehicles import from_sdf, from_yaml
from tests.unit.scene.test_hostile_files import KINDS, check_refused, numbered, refused, tree

pytest.importorskip("yaml")
# Coefficients in YAML.
GOOD = "mass: 30\ninertia: [1, 2, 2]\n"
BOMB = "a: &a [1, 1, 1, 1, 1, 1, 1, 1, 1]\n" + "".join(
    f"{one}: &{one} [{', '.join(['*' + before] * 9)}]\n" for before, one in zip("abcdefgh", "bcdefghi", strict=True)
)
MERGES = "a: &a {x: 1}\n" + "".join(
    f"{one}: &{one} {{<<: [{', '.join(['*' + before] * 9)}]}}\n"
    for before, one in zip("abcdefgh", "bcdefghi", strict=True)
)
YAML = {
    "octal": (GOOD.replace("30", "010"), ("line 1 = '010'", "octal", "Write 10")),
    "base 60": (GOOD.replace("30", "1:30"), ("line 1 = '1:30'", "base 60")),
    "base 60 with a point": (GOOD.replace("30", "1:30.5"), ("base 60",)),
    "octal in a list": (GOOD.replace("[1,", "[-010,"), ("line 2 = '-010'",)),
    "doubled keys": (GOOD + "mass: 31\n", ("line 3 = 'mass'", "is there already, in line 1")),
    "doubled keys within": ("hull:\n  mass: 1\n  mass: 2\n", ("line 3", "line 2")),
    "a bomb of aliases": (BOMB, ("every alias", "at most 20,000")),
    "a bomb of merges": (MERGES, ("every alias",)),
    "a list that holds itself": ("a: &a [*a]\n", ("contains itself",)),
    "lists in lists": (GOOD + "a: " + "[" * 10_000 + "]" * 10_000, ("nested too deep",)),
    "maps in maps": (GOOD + "a: " + "{a: " * 10_000 + "}" * 10_000, ("nested too deep",)),
    "code": ("mass: !!python/object/apply:os.system ['touch escaped']\n", ("is a type that is not read",)),
    "a module": ("mass: !!python/name:os.system\n", ("is a type that is not read",)),
    "bytes": ("mass: !!binary aGVsbG8=\n", ("is a type that is not read",)),
    "a date": (GOOD.replace("30", "2001-01-01"), ("is a type that is not read",)),
    "a date that there is not": (GOOD.replace("30", "2001-99-99"), ("is a type that is not read",)),
    "a number that is none": ("mass: !!int ''\n", ("has a value that cannot be read",)),
    "5,000 digits": (GOOD.replace("30", "9" * 5000), ("has a value that cannot be read",)),
    "infinite": (GOOD.replace("30", ".inf"), ("mass = inf", "not finite")),
    "yes": (GOOD.replace("30", "yes"), ("mass = True", "not numeric")),
    "two documents": (GOOD + "---\n" + GOOD, ("another document",)),
    "a key that is a list": ("[1, 2]: 3\n", ("is a key that is not a text",)),
    "a zero byte": (GOOD + "a: \0\n", ("not allowed",)),
    "unknown keys": (GOOD + numbered("k{}: 1\n", 2000), ("2,000 faults", "and 1,980 more")),
    "a long text": (GOOD + "a: '" + "x" * 200_000 + "'\n", ("131,072",)),
    "a million dashes": (GOOD + "a:\n" + "- " * 60_000, ("YAML",)),
}


def test_yaml_that_two_versions_read_alike_is_read():
    plain = from_yaml(GOOD + "buoyancy: 290.0\n")
    other = from_yaml("mass: 3e1\ninertia: &j [1.0, 2, 2]\nbuoyancy: 2_90.0\nspare: {cog: [0, 0, 0]}\n")
    assert plain == other
    quoted = "mass: 30\ninertia: [1, 2, 2]\n'010': 3\n"
    refused(from_yaml, quoted, words=("010 = 3", "unknown key"))


@pytest.mark.parametrize("name", YAML)
def test_a_file_is_refused(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    content, words = YAML[name]
    refused(from_yaml, content, words=words)
    assert tree(tmp_path) == []


@pytest.mark.parametrize("load", [from_yaml, from_sdf])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_file_is_refused(kind, load, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_refused(load, kind, tmp_path)
