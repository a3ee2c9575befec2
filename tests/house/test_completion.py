# SPDX-License-Identifier: Apache-2.0
"""Tab completion shows what a user writes or reads: at least half of the names of every public class.

`python -m tests.house.test_completion` prints the share of each class, the worst first.
"""

import abc
import dataclasses
import enum
import inspect
import re
import subprocess
import sys
from typing import Any, ClassVar

import pytest

import lgvi_warp as lw
from lgvi_warp.common.documented import Documented
from tests.conftest import ROOT
from tests.support.pages import blocks, chains
from tests.support.public import DOORS, things

CLASSES = {
    f"{door}.{name}": thing
    for door, module in {"lw": lw, **DOORS}.items()
    for name, thing in things(module).items()
    if inspect.isclass(thing) and not issubclass(thing, BaseException)
}
SECTION = r"^(?:Args|Attributes|Methods):\n((?:    .*\n|\n)+)"


def of_users(kind):
    """Names that a user writes or reads: arguments, fields, members of an enumeration, and what docstrings list.

    Base classes for authors of laws do not count for the classes that derive from them.
    """
    if issubclass(kind, enum.Enum):
        return set(kind.__members__)
    bases = [base for base in kind.__mro__ if base is kind or base not in map(lw.laws.__dict__.get, lw.laws.__all__)]
    texts = [f"{inspect.cleandoc(base.__doc__ or '')}\n" for base in (kind.__mro__ if kind in OF_AUTHORS else bases)]
    sections = "".join("".join(re.findall(SECTION, text, re.MULTILINE)) for text in texts)
    return {*re.findall(r"^    (\w+):", sections, re.MULTILINE), *inspect.signature(kind).parameters}


OF_AUTHORS = [getattr(lw.laws, name) for name in lw.laws.__all__ if inspect.isclass(getattr(lw.laws, name))]


def completed(kind, names):
    """Public names of a class and of its objects, without those that other packages' classes have."""
    fields = [item.name for item in dataclasses.fields(kind) if item.init] if dataclasses.is_dataclass(kind) else []
    plain = {name for base in kind.__mro__ if base.__module__.partition(".")[0] != "lgvi_warp" for name in dir(base)}
    return {name for name in {*names, *fields} - plain if not name.startswith("_")}


def share(kind, names=None):
    """Share of the names of tab completion that a user writes or reads, and the others."""
    shown = completed(kind, dir(kind) if names is None else names)
    others = shown - of_users(kind)
    return 1.0 - len(others) / max(len(shown), 1), sorted(others)


@pytest.mark.parametrize("path", CLASSES)
def test_half_of_the_names_are_of_users(path):
    part, others = share(CLASSES[path])
    assert part >= 0.5, others


@pytest.mark.parametrize("kind", [lw.terms.Drag, lw.control.HeadingPID, lw.statistics.Mean, lw.designs.Sobol])
def test_all_names_of_a_class_would_be_too_many(kind):
    assert share(kind, type.__dir__(kind))[0] < 0.25


def test_names_of_a_term():
    assert completed(lw.terms.Drag, dir(lw.terms.Drag)) == {"linear", "quadratic", "name"}
    assert completed(lw.terms.Drag, dir(lw.terms.Drag())) == {"linear", "quadratic", "name"}
    assert {"thrust", "command_for"} <= set(dir(lw.terms.Thrusters))
    assert {"packed", "potential", "device", "timed"} <= set(dir(lw.laws.Term))
    assert {"packed", "demands", "needs", "section"} <= set(dir(lw.laws.ControlLaw))
    assert {"__init__", "__doc__", "__reduce__"} <= set(dir(lw.terms.Drag))


@pytest.mark.parametrize("path", [path for path, kind in CLASSES.items() if issubclass(kind, Documented)])
def test_what_is_documented_is_there(path):
    """A docstring lists nothing that tab completion lacks; arguments without a default are of objects alone."""
    kind = CLASSES[path]
    needed = {
        name for name, argument in inspect.signature(kind).parameters.items() if argument.default is argument.empty
    }
    fields = {item.name for item in dataclasses.fields(kind)} if dataclasses.is_dataclass(kind) else set()
    text = "".join(re.findall(SECTION.replace("Args|", ""), f"{inspect.cleandoc(kind.__doc__)}\n", re.MULTILINE))
    of_objects = needed | fields | set(inspect.get_annotations(kind))
    assert set(re.findall(r"^    (\w+):", text, re.MULTILINE)) - of_objects <= set(dir(kind))


def test_pages_and_examples_use_names_that_are_shown():
    pages = [path.relative_to(ROOT) for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]]
    codes = [code for page in pages for code in blocks(page, "python")]
    codes += [path.read_text() for path in (ROOT / "examples").rglob("*.py")]
    used = {(*chain,)[:3] for code in codes for chain in chains(code)}
    named = {
        (".".join(["lw", *chain[:-1]][-2:]), chain[-1]) for chain in used | {chain[:2] for chain in used} if chain[1:]
    }
    checked = [(path, name) for path, name in sorted(named) if path in CLASSES]
    assert len(checked) > 10
    assert [(path, name) for path, name in checked if name not in dir(CLASSES[path])] == []


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class OfAnAuthor(lw.laws.Term, abc.ABC):
    type: ClassVar[str] = "law_of_an_author"
    strength: Any = lw.laws.number((), "N", 1.0)

    def curve(self):
        """Names of other packages are shown without a docstring's list."""


def test_a_class_of_another_package_shows_what_it_defines():
    assert {"strength", "curve", "name"} <= set(dir(OfAnAuthor()))
    assert not {"packed", "beside", "lanes"} & set(dir(OfAnAuthor()))


def test_without_docstrings_all_names_are_shown():
    code = "import lgvi_warp as lw; print('packed' in dir(lw.terms.Drag), 'linear' in dir(lw.terms.Drag()))"
    shown = subprocess.run([sys.executable, "-OO", "-c", code], check=True, capture_output=True, text=True).stdout
    assert shown.split() == ["True", "True"]


if __name__ == "__main__":
    for part, path in sorted((share(kind)[0], path) for path, kind in CLASSES.items()):
        print(f"{part:4.0%}  {path}: without {', '.join(share(CLASSES[path])[1]) or 'any'}")
