# SPDX-License-Identifier: Apache-2.0
"""XML of robot descriptions (SDF, URDF), read in bounded time and memory: nothing is fetched, expanded or executed."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, brief
from lgvi_warp.common.reading import MOST_OTHERS, UnreadableError, file_bytes
from lgvi_warp.common.sentences import capital, sentences

# Limits of one file. The largest robot descriptions are far below: some 1 MB, 20,000 elements, 20 levels.
MOST_BYTES, MOST_ELEMENTS, MOST_LEVELS = MOST_OTHERS, 100_000, 200
# Marks of templates, whose values another program fills in, and the remedy for each.
TEMPLATES = {
    "${": "run xacro on it (xacro FILE > FILE.urdf) and read what it writes",
    "$(": "run xacro on it (xacro FILE > FILE.urdf) and read what it writes",
    "<%": "run erb on it (erb FILE > model.sdf) and read what it writes",
    "{{": "render the template (Jinja) and read what it writes",
    "{%": "render the template (Jinja) and read what it writes",
    "@": "generate the file with the script that it belongs to, or write the number in its place",
}


class Refused(Exception):  # noqa: N818
    """Error for XML that is well-formed but refused; the text names the problem and the remedy."""


class Reader:
    """Handlers of expat that build a tree of elements; prefixes of names are kept, even if they are not declared."""

    def __init__(self) -> None:
        self.tree, self.level, self.elements = TreeBuilder(), 0, 0

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Open an element and count it."""
        self.level, self.elements = self.level + 1, self.elements + 1
        if self.level > MOST_LEVELS:
            raise Refused(f"is nested more than {MOST_LEVELS} levels deep. Give the model alone")
        if self.elements > MOST_ELEMENTS:
            raise Refused(f"has more than {MOST_ELEMENTS:,} elements. Give the model alone")
        self.tree.start(tag, attributes)

    def end(self, tag: str) -> None:
        """Close the element that was opened last."""
        self.level -= 1
        self.tree.end(tag)

    def doctype(self, *_: Any) -> None:
        """Refuse a document type, since it may declare entities, which can expand without bound or name other files."""
        raise Refused("has a document type declaration (<!DOCTYPE>), which is not read. Remove it")


def parse_xml(source: str | os.PathLike[str], format_name: str = "SDF") -> Element:
    """Parse the XML of a text or of a file."""
    is_text = isinstance(source, str) and source.lstrip("\ufeff \t\r\n").startswith("<")
    content = str(source).encode() if is_text else read_bytes(source, format_name)
    content = content.removeprefix(b"\xef\xbb\xbf").lstrip(b" \t\r\n")
    if len(content) > MOST_BYTES:
        raise SceneError([f"{format_name} is longer than {MOST_BYTES / 2**20:g} MiB. Give the model alone"])
    reader = Reader()
    parser = expat.ParserCreate("utf-8" if is_text else None)
    parser.StartElementHandler, parser.EndElementHandler = reader.start, reader.end
    parser.CharacterDataHandler, parser.StartDoctypeDeclHandler = reader.tree.data, reader.doctype
    try:
        parser.Parse(content, True)
    except Refused as error:
        raise SceneError([f"{format_name} {error}"]) from None
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise SceneError([f"{format_name} is not XML: {error}. {capital(remedy_for(content))}"]) from None
    return reader.tree.close()


def remedy_for(content: bytes) -> str:
    """Return the remedy for a text that is not XML."""
    mark = next((mark for mark in (b"<%", b"{%", b"{{", b"@(", b"@{", b"=@") if mark in content), None)
    if mark is None:
        return "correct that line"
    shown = f"{mark.decode()}, which is not executed here"
    return f"it looks like a template: it holds {shown}. {capital(TEMPLATES.get(mark.decode(), TEMPLATES['@']))}"


def read_bytes(source: Any, format_name: str) -> bytes:
    """Return the content of a file."""
    try:
        return file_bytes(source, f"{format_name} file")
    except UnreadableError as error:
        raise SceneError([sentences(f"{format_name} file {brief(source)}", error.what, error.remedy)]) from None


# Values -------------------------------------------------------------------------------------------------------------


def text_of(element: Element | None) -> str:
    """Return the text of an element without spaces around it; "" if there is no element."""
    return (element.text or "").strip() if element is not None else ""


def child_of(parent: Element | None, tag: str) -> Element | None:
    """The first child of an element with a tag; None if the element or the child is missing."""
    return None if parent is None else parent.find(tag)


def is_true(text: str | None) -> bool:
    """Return whether a text means true in SDF."""
    return (text or "").strip().lower() in ("1", "true")


def floats(text: str) -> np.ndarray | None:
    """Return the numbers in a text, separated by spaces; None if it holds anything else."""
    try:
        return np.array([float(word) for word in text.split()]) if text.isascii() and "_" not in text else None
    except ValueError:
        return None


def numbers_in(faults: Faults, key: str, text: str, count: int) -> np.ndarray:
    """Return the numbers in a text that must hold `count` finite numbers; zeros after adding a fault."""
    values = floats(text)
    if values is not None and values.shape == (count,) and np.all(np.isfinite(values)):
        return values
    mark = next((mark for mark in TEMPLATES if mark in text), None)
    wanted = f"{count} finite numbers" if count > 1 else "a finite number"
    if values is None and mark is not None:
        problem = f"is not {wanted} but a placeholder of a template, which is not executed"
        faults.add(key, text, problem, TEMPLATES[mark])
    else:
        faults.add(key, text, f"does not hold {count} finite numbers", f"write {wanted}")
    return np.zeros(count)


def read_floats(faults: Faults, where: str, parent: Element | None, tag: str, default: str) -> np.ndarray:
    """Return the numbers in a child of an element, or the default."""
    return numbers_in(faults, f"{where}<{tag}>", text_of(child_of(parent, tag)) or default, len(default.split()))


def number(faults: Faults, where: str, parent: Element | None, tag: str, default: str) -> float:
    """Return the number in a child of an element, or the default; 0 after adding a fault."""
    return float(read_floats(faults, where, parent, tag, default)[0])


def plugins_of(element: Element) -> Iterator[Element]:
    """Iterate over the plugins of a model and of the models nested in it, without plugins of included files."""
    for child in element:
        if child.tag == "plugin":
            yield child
        elif child.tag in ("model", "gazebo"):
            yield from plugins_of(child)


def plugin_name(plugin: Element) -> str:
    """Return the name and file name of a plugin, which identify it."""
    return (plugin.get("name", "") + " " + plugin.get("filename", "")).lower()
