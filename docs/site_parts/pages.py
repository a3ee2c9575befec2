# SPDX-License-Identifier: Apache-2.0
"""Pages of the reference that the build of the site writes: public names, keys of the scene file, the help of the command."""

import argparse
import ast
import inspect
import operator
import os
import re
import textwrap
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from unittest import mock

import lgvi_warp as lw
from lgvi_warp.cli import parser
from lgvi_warp.control.controller import SECTIONS as CONTROLLER
from lgvi_warp.physics import terms
from lgvi_warp.physics.shape import Shape
from lgvi_warp.physics.terms import events
from lgvi_warp.physics.terms.base import word_of
from lgvi_warp.sampling.designs import KINDS as SAMPLINGS
from lgvi_warp.sampling.distributions.named import IN_MEMORY
from lgvi_warp.sampling.distributions.named import KINDS as DISTRIBUTIONS
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.statistics.base import TYPES as STATISTICS

from . import documented

DOCS = Path(__file__).parents[1]
# Section of scene files -> the class whose parameters are its keys.
SECTIONS: dict[str, Any] = {
    "[vehicle]": lw.Vehicle,
    "[vehicle.shape]": Shape,
    "[environment]": lw.Environment,
    "[start]": lw.Start,
    "[controller]": lw.Controller,
    "[ensemble]": EnsembleSettings,
    "[run]": RunSettings,
    "[run.until]": lw.Until,
}
# Heading -> the classes by type that the loader of scene files knows there.
TYPES: dict[str, Mapping[str, Any]] = {
    "[[terms]]": terms.TYPES,
    "[[events]]": events.TYPES,
    **{f"[[controller.{section}]]": base.kinds for section, base in CONTROLLER.items()},
    # But for those that no file may name.
    "[ensemble.vary]": {word: kind for word, kind in DISTRIBUTIONS.items() if word not in IN_MEMORY},
    "[ensemble] sampling": SAMPLINGS,
    "[[run.statistics]]": STATISTICS,
}


def write(folder: Path) -> None:
    """Write all pages into a folder; what has not changed is left alone, so that it is not built again."""
    folder.mkdir(exist_ok=True)
    texts = {"scene_file_keys.rst": scene_file_page(), "command_help.rst": command_page(), "changelog.md": changelog()}
    texts |= {f"{slug(title)}.rst": names_page(title, names) for title, names in groups().items()}
    for old in folder.iterdir():
        if old.name not in texts:
            old.unlink()
    for name, text in texts.items():
        page = folder / name
        if not page.exists() or page.read_text() != text:
            page.write_text(text)


def groups() -> dict[str, list[str]]:
    """Heading -> public names of each table of docs/reference/api.md."""
    found: dict[str, list[str]] = {}
    page = (DOCS / "reference" / "api.md").read_text()
    for heading, text in re.findall(r"^## (.*)\n([^#]*)", page, re.MULTILINE):
        title = heading.partition(" (")[0]
        names = re.findall(r"^\| `lw\.([\w.]+)` \|", text, re.MULTILINE)
        found[title] = names
    return found


def slug(title: str) -> str:
    """The name of a page: the words of its title before a colon."""
    return re.sub(r"\W+", "_", title.partition(":")[0].lower())


def names_page(title: str, names: list[str]) -> str:
    """A page of public names, one after another."""
    return "\n".join([heading(title, "="), *(line for name in names for line in _entry(name))]) + "\n"


def _entry(name: str) -> Iterator[str]:
    """The directives that document a public name, or what a public module holds."""
    subject = operator.attrgetter(name)(lw)
    if inspect.ismodule(subject):
        yield from (heading(f"lw.{name}", "-"), escaped(documented.first_line(subject)), "")
        for inner in in_module(subject):
            yield from _directive(f"{name}.{inner}", getattr(subject, inner))
    else:
        yield from _directive(name, subject)


def in_module(module: Any) -> list[str]:
    """Public functions and classes of a door."""
    return [name for name in module.__all__ if callable(getattr(module, name))]


def _directive(path: str, subject: Any) -> Iterator[str]:
    yield f".. auto{'class' if inspect.isclass(subject) else 'function'}:: lgvi_warp::{path}"
    if inspect.isclass(subject) and (methods := list(documented.methods(subject))):
        yield f"   :members: {', '.join(methods)}"
    yield ""


def scene_file_page() -> str:
    """The page on the scene file: every key of every section and type, with shape, unit, default and meaning."""
    lines = [heading("The scene file, key by key", "=")]
    lines += ["How sections work together: :doc:`/start/scene_file`.", ""]
    for title, kind in SECTIONS.items():
        lines += [heading(title, "-"), escaped(documented.first_line(kind)), "", *_table(kind)]
    for title, kinds in TYPES.items():
        lines += [heading(title, "-")]
        for word, kind in sorted(kinds.items()):
            # Classes of users' own are known to the loader too.
            if kind.__module__.startswith("lgvi_warp."):
                lines += [heading(f"``{word}``", "~"), escaped(documented.first_line(kind)), "", *_table(kind)]
    return "\n".join(lines) + "\n"


def _table(kind: Any) -> list[str]:
    """The keys of a type as a table."""
    words = {name: word_of(item) for name, item in documented.fields_of(kind).items()}
    rows = [("key", "type, shape, unit", "default", "meaning")]
    for item in documented.parameters(kind):
        default = "required" if item.default is None else f"``{item.default}``"
        text = escaped(item.text.replace("\n", " "))
        rows.append((f"``{words.get(item.name, item.name)}``", escaped(item.type), default, text))
    if len(rows) == 1:
        return ["It has no keys.", ""]
    cells = [f"   {'* -' if place == 0 else '  -'} {cell}" for row in rows for place, cell in enumerate(row)]
    return [".. list-table::", "   :header-rows: 1", "   :widths: 15 20 15 50", "", *cells, ""]


def command_page() -> str:
    """The help of the command, and of each of its verbs."""
    lines = [heading("The command's own help", "="), "With examples: :doc:`/start/cli`.", ""]
    with mock.patch.dict(os.environ, COLUMNS="100"):
        top = parser()
        verbs = next(action for action in top._actions if isinstance(action, argparse._SubParsersAction)).choices
        # An alias has the parser of the verb.
        names = {verb: name for name, verb in reversed(verbs.items())}
        for verb, title in [(top, "lgvi-warp"), *reversed(names.items())]:
            text = verb.format_help().splitlines()
            lines += [heading(title, "-"), ".. code-block:: text", "", *(f"   {line}".rstrip() for line in text), ""]
    return "\n".join(lines) + "\n"


def changelog() -> str:
    """The changelog, which stands outside of the site's folder; its links lead from where the page is."""
    return (DOCS.parent / "CHANGELOG.md").read_text().replace("](docs/", "](../../")


def heading(text: str, mark: str) -> str:
    """A heading of reStructuredText."""
    return f"{text}\n{mark * len(text)}\n"


def escaped(text: str) -> str:
    """A docstring's text as reStructuredText: lists and `code` in single backticks, and nothing else that marks anything."""
    parts = re.split(r"(?s)``(.+?)``|`([^`]+)`", text)
    plain = [
        re.sub(r"(?m)^( *\* )|([*|\\]|_(?!\w))", lambda found: found[1] or "\\" + found[2], part) for part in parts[::3]
    ]
    code = [f"\\ ``{first or second}``\\ " for first, second in zip(parts[1::3], parts[2::3], strict=True)]
    return "".join(part for pair in zip(plain, [*code, ""], strict=True) for part in pair)


def signature(subject: Any, text: str) -> str:
    """A signature with the defaults that dataclasses hide; "..." stands for one that is no Python code."""
    defaults = {item.name: item.default or "..." for item in documented.parameters(subject)} if "<" in text else {}
    return re.sub(
        r"(\w+)=<(?:factory|[\w.]+ object at \w+)>", lambda match: f"{match[1]}={_code(defaults[match[1]])}", text
    )


def _code(default: str) -> str:
    try:
        ast.parse(default, mode="eval")
    except SyntaxError:
        return "..."
    return default


def fields(subject: Any, docstring: str) -> list[str]:
    """A docstring as lines of reStructuredText, each parameter with its type and default."""
    text, found = documented.sections(docstring)
    lines = [*escaped(text).splitlines(), ""]
    attributes = documented.entries(found.get("Attributes", "")) | documented.codes(subject)
    described = inspect.isfunction(subject) or inspect.ismethod(subject) or inspect.isclass(subject)
    given = documented.parameters(subject) if described else []
    constructed = "Attributes" not in found or "Args" in found
    if constructed:
        lines += [f":param {item.name}: ({linked(item.note)}) {indented(item.text)}" for item in given]
    types = {item.name: f"({linked(item.type)}) " for item in given if item.type}
    lines += [":Attributes:", ""] if attributes else []
    lines += [f"   * **{name}** -- {types.get(name, '')}{indented(value)}" for name, value in attributes.items()]
    lines += [""] if attributes else []
    for title in ("Returns", "Yields"):
        if title in found:
            lines += [f":{title.lower()}: {escaped(' '.join(found[title].split()))}"]
    raised = documented.entries(found.get("Raises", ""))
    lines += [f":raises {name}: {escaped(value)}" for name, value in raised.items()]
    if "Examples" in found:
        lines += ["", ".. code-block:: pycon", "", textwrap.indent(found["Examples"].strip(), "   ")]
    return "\n".join([*lines, ""]).splitlines()


def indented(text: str) -> str:
    """The text of an entry within a field of reStructuredText: its list stands apart."""
    first, *items = escaped(text).split("\n")
    return "\n".join([first, "", *(f"     {item.strip()}" for item in items)]) if items else first


def linked(note: str) -> str:
    """Types and defaults with links to the public names among them."""
    paths = {path.rpartition(".")[2]: path for names in groups().values() for path in names}
    names = "|".join(sorted(paths, key=len, reverse=True))
    parts = re.split(rf"(?<![\w.'\"])({names})(?![\w'\"])", note)
    return "".join(
        f"\\ :py:obj:`{part} <lgvi_warp.{paths[part]}>`\\ " if place % 2 else escaped(part)
        for place, part in enumerate(parts)
    )
