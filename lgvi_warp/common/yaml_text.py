# SPDX-License-Identifier: Apache-2.0
"""Reader of untrusted YAML: no objects, no alias bombs, and no number that two versions of YAML read differently."""

from __future__ import annotations

import functools
import importlib
import re
from typing import Any

from lgvi_warp.common.errors import Faults, MissingExtra, SceneError

# Most values with every alias written out: a vehicle has some hundreds of coefficients.
MOST_VALUES = 20_000
# YAML 1.1 reads these as octal and in base 60; YAML 1.2 as decimal and as a text.
OCTAL = re.compile(r"[-+]?0[0-9_]+")
SIXTIES = re.compile(r"[-+]?[0-9][0-9_]*(:[0-5]?[0-9])+(\.[0-9_]*)?")
# YAML 1.2 reads these as numbers, 1.1 as texts: without a point, or without a sign after the e.
EXPONENT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)[eE][-+]?[0-9]+")
# Most levels of nested brackets.
DEEPEST = 50
DEEP = "YAML is nested too deep. Write mass: ..., added_mass: ..."
PLAIN = {f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float", "str", "seq", "map")}


def parsed(text: str) -> Any:
    """Parse a YAML text into plain tables, lists, texts and numbers."""
    try:
        yaml = importlib.import_module("yaml")
    except ImportError:
        raise MissingExtra("YAML files", "PyYAML", "yaml") from None
    if _depth(text) > DEEPEST:
        raise SceneError([DEEP])
    try:
        loader = _loader(yaml)(text)
        node = loader.get_single_node()
        faults = Faults("YAML: ")
        if node is not None:
            _look(yaml, faults, node)
        faults.raise_if_any()
        return None if node is None else loader.construct_document(node)
    except SceneError:
        raise
    except RecursionError:
        raise SceneError([DEEP]) from None
    except yaml.YAMLError as error:
        raise SceneError([f"YAML: {' '.join(str(error).split())}. Correct that line"]) from None
    except Exception as error:  # PyYAML passes on what int(), float() and dates raise
        text = f"YAML has a value that cannot be read ({type(error).__name__}: {error}). Correct it"
        raise SceneError([text]) from None


def _depth(text: str) -> int:
    """Largest depth of open brackets in a text, including those in words: the time of PyYAML grows with it."""
    depth = deepest = 0
    for bracket in re.finditer(r"[\[\]{}]", text):
        depth += 1 if bracket[0] in "[{" else -1
        deepest = max(deepest, depth)
    return deepest


@functools.cache
def _loader(yaml: Any) -> Any:
    """PyYAML's safe loader in Python. The loader in C recurses as deeply as the text is nested, and crashes."""

    class Loader(yaml.SafeLoader):
        """PyYAML's safe loader that also reads numbers such as 1e3, as YAML 1.2 does."""

    Loader.add_implicit_resolver("tag:yaml.org,2002:float", EXPONENT, list("-+.0123456789"))
    return Loader


def _look(yaml: Any, faults: Faults, root: Any) -> None:
    """Add faults for everything that is refused in a tree of nodes, before any object is constructed from it."""
    sizes: dict[int, int] = {}
    _size(yaml, root, sizes, set())
    if sizes[id(root)] > MOST_VALUES:
        problem = f"are {sizes[id(root)]:,} with every alias (*name) written out"
        faults.add("values", "...", problem, f"give at most {MOST_VALUES:,}")
        return
    visited: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) in visited:
            continue
        visited.add(id(node))
        if isinstance(node, yaml.MappingNode):
            _check_keys(yaml, faults, node)
            waiting += [child for pair in reversed(node.value) for child in reversed(pair)]
        elif isinstance(node, yaml.SequenceNode):
            waiting += reversed(node.value)
        else:
            _check_scalar(faults, node)
        if node.tag not in PLAIN and not _is_merge(node):
            faults.add(_line(node), node.tag, "is a type that is not read", "give numbers, texts, lists and maps")


def _size(yaml: Any, node: Any, sizes: dict[int, int], above: set[int]) -> int:
    """Number of values of a node, with aliases expanded. Raises SceneError if a node contains itself."""
    if id(node) in above:
        raise SceneError([f"YAML: {_line(node)} contains itself through an alias. Write it out"])
    if id(node) not in sizes:
        above.add(id(node))
        children: list[Any] = []
        if isinstance(node, yaml.MappingNode):
            children = [child for pair in node.value for child in pair]
        elif isinstance(node, yaml.SequenceNode):
            children = node.value
        sizes[id(node)] = 1 + sum(_size(yaml, child, sizes, above) for child in children)
        above.discard(id(node))
    return sizes[id(node)]


def _check_keys(yaml: Any, faults: Faults, node: Any) -> None:
    """Add faults for keys that are not texts, and for repeated keys, of which PyYAML keeps the last."""
    first: dict[str, Any] = {}
    for key, _ in node.value:
        if not isinstance(key, yaml.ScalarNode):
            faults.add(_line(key), "...", "is a key that is not a text", "write key: value")
        elif _is_merge(key):
            continue
        elif key.value in first:
            faults.add(_line(key), key.value, f"is there already, in {_line(first[key.value])}", "keep one of them")
        else:
            first[key.value] = key


def _check_scalar(faults: Faults, node: Any) -> None:
    """Add a fault for a number that versions of YAML read differently."""
    number = node.style is None and node.tag.endswith((":int", ":float"))
    text = node.value
    if number and OCTAL.fullmatch(text):
        meant = text.replace("_", "").lstrip("+-0") or "0"
        faults.add(_line(node), text, "is octal in YAML 1.1 and decimal in YAML 1.2", f"write {meant} if that is meant")
    elif number and SIXTIES.fullmatch(text):
        remedy = "write the number, or the text in quotes"
        faults.add(_line(node), text, "is a number in base 60 in YAML 1.1 and a text in YAML 1.2", remedy)


def _is_merge(node: Any) -> bool:
    """Tell whether a node is the key of a merge, <<."""
    return bool(node.tag == "tag:yaml.org,2002:merge")


def _line(node: Any) -> str:
    return f"line {node.start_mark.line + 1}"
