# SPDX-License-Identifier: Apache-2.0
"""What the docstrings say of the public names, and with which types, shapes, units and defaults."""

import dataclasses
import inspect
import re
import textwrap
from dataclasses import dataclass
from enum import Enum
from typing import Any

import lgvi_warp as lw
from lgvi_warp.sampling.designs.base import Sampling
from lgvi_warp.sampling.distributions.basic import Distribution
from lgvi_warp.statistics.base import Statistic

# Classes of all doors.
PUBLIC = {
    thing
    for door in (lw, *(getattr(lw, name) for name in lw.__all__ if inspect.ismodule(getattr(lw, name))))
    for thing in (getattr(door, name) for name in door.__all__)
    if inspect.isclass(thing)
}
# Users give the parameters of what scene files name by type, and call no methods of it.
NAMED_IN_FILES = (lw.laws.Term, Distribution, Sampling, Statistic)
SECTION = r"^(Args|Attributes|Returns|Yields|Raises|Examples):\n((?:    .*(?:\n|\Z)|\n)+)"
# A line that begins an item of a list, or any space.
SPACE = re.compile(r"\n\s*(\* )|\s+")
# What stands for the text of a base.
AS_OF = re.compile(r"As in `\w+`")
ENTRY = r"^(\*{0,2}\w[\w, *.]*):\s+(.+(?:\n(?: .*)?)*)"


@dataclass(frozen=True)
class Parameter:
    """A parameter of a public name: its type, or its shape and unit; its default, None if it is required; what it is."""

    name: str
    type: str
    default: str | None
    text: str

    @property
    def note(self) -> str:
        """Its type and default in one line."""
        return "; ".join(filter(None, [self.type, f"default {self.default}" if self.default else "required"]))


def sections(docstring: str) -> tuple[str, dict[str, str]]:
    """The text of a docstring before and after its sections, and the sections by their headings, without indent."""
    found = {heading: textwrap.dedent(text) for heading, text in re.findall(SECTION, docstring, re.MULTILINE)}
    return re.sub(SECTION, "", docstring, flags=re.MULTILINE).strip(), found


def entries(section: str) -> dict[str, str]:
    """Name -> text of each entry of a section, one line, and one for each item of a list.

    An entry such as "b, R: ..." is of each of its names.
    """
    pairs = re.findall(ENTRY, section, re.MULTILINE)
    return {
        name.strip(" *"): SPACE.sub(lambda found: "\n* " if found[1] else " ", text).strip()
        for names, text in pairs
        for name in names.split(",")
    }


def described(subject: Any) -> dict[str, str]:
    """Name -> text of all parameters that a docstring describes: that of a class, together with those of its bases."""
    texts: dict[str, str] = {}
    for owner in reversed(inspect.getmro(subject)) if inspect.isclass(subject) else [subject]:
        # An override inherits the docstring of the method.
        text = inspect.cleandoc(owner.__doc__ or "") if inspect.isclass(owner) else inspect.getdoc(owner) or ""
        _, found = sections(text)
        for name, text in {**entries(found.get("Args", "")), **entries(found.get("Attributes", ""))}.items():
            of_base = AS_OF.match(text) if name in texts else None
            texts[name] = texts[name].rstrip(".") + text[of_base.end() :] if of_base else text
    return texts


def parameters(subject: Any) -> list[Parameter]:
    """The parameters of a class or a function, in the order of its signature."""
    if inspect.isclass(subject) and issubclass(subject, Enum):
        return []
    texts, fields = described(subject), fields_of(subject)
    given = [item for item in inspect.signature(subject).parameters.values() if item.name not in ("self", "cls")]
    return [Parameter(i.name, _type(i, fields), _default(i, fields), texts.get(i.name, "")) for i in given]


def first_line(subject: Any) -> str:
    """The summary of a docstring."""
    return (inspect.getdoc(subject) or "").partition("\n")[0]


def fields_of(subject: Any) -> dict[str, Any]:
    """The fields of a dataclass by name; of anything else there are none."""
    return {item.name: item for item in dataclasses.fields(subject)} if dataclasses.is_dataclass(subject) else {}


def codes(subject: Any) -> dict[str, str]:
    """Name and number -> text of each member of an enumeration; of anything else there are none."""
    members = subject if inspect.isclass(subject) and issubclass(subject, Enum) else ()
    return {f"{member.name} = {member.value}": member.text for member in members}  # type: ignore[attr-defined]


def methods(kind: type) -> list[str]:
    """Public methods and properties of a class that a user may call, but for those that a public base of it documents."""
    if issubclass(kind, NAMED_IN_FILES) and (getattr(kind, "type", "") or getattr(kind, "kind", "")):
        return []
    public = [base for base in kind.__mro__[1:] if base in PUBLIC or not _of_package(base)]
    hidden = {*fields_of(kind), *getattr(kind, "_fields", ()), *(name for base in public for name in vars(base))}
    own = [base for base in kind.__mro__ if base not in public]
    found = {name: member for owner in own for name, member in vars(owner).items() if name not in hidden}
    return [
        name
        for name, member in found.items()
        # `dir` leaves out what only the package itself calls.
        if not name.startswith("_") and name in dir(kind) and _is_method(member) and member.__doc__
    ]


def _of_package(kind: type) -> bool:
    return kind.__module__.startswith("lgvi_warp.")


def _is_method(member: Any) -> bool:
    return inspect.isroutine(member) or inspect.isdatadescriptor(member) or hasattr(member, "func")


def _type(item: inspect.Parameter, fields: dict[str, Any]) -> str:
    """Shape and unit of a number that a term declares; otherwise the annotation, which says nothing where it is Any."""
    declared = fields[item.name].metadata if item.name in fields else {}
    if "shape" in declared:
        lengths = ", ".join(map(str, declared["shape"])) + "," * (len(declared["shape"]) == 1)
        return f"{f'numbers, shape ({lengths})' if lengths else 'number'} [{declared['unit']}]"
    return "" if item.annotation in (item.empty, "Any", Any) else inspect.formatannotation(item.annotation).strip("'")


def _default(item: inspect.Parameter, fields: dict[str, Any]) -> str | None:
    """The default as Python code."""
    if item.kind in (item.VAR_POSITIONAL, item.VAR_KEYWORD):
        return "none"
    if item.name in fields and fields[item.name].default_factory is not dataclasses.MISSING:
        value = fields[item.name].default_factory()
        return f"{type(value).__name__}()" if dataclasses.is_dataclass(value) else repr(value)
    if item.default is item.empty or item.default is dataclasses.MISSING:
        return None
    return getattr(item.default, "__name__", repr(item.default))
