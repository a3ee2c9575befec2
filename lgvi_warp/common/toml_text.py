# SPDX-License-Identifier: Apache-2.0
"""Reader of untrusted TOML: texts that are deeper or larger than any scene are refused, in bounded time."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from lgvi_warp.common.errors import Faults, SceneError

# Most levels of nested tables and lists: a scene has six.
DEEPEST = 24
# Most points in one key: tomllib's time grows with their square.
MOST_DOTS = 8
_PART = r"""(?:[\w\-]{1,200}|"(?:[^"\\\n]|\\.){0,200}"|'[^'\n]{0,200}')"""
DOTTED = re.compile(rf"""(?<![\w\-"'\\]){_PART}(?:[ \t]{{0,200}}\.[ \t]{{0,200}}{_PART}){{{MOST_DOTS}}}""")
# Most tables: each term is one.
MOST_TABLES = 5000
TABLE = re.compile(r"^[ \t]*\[[^,\n]*\][ \t]*(?:#.*)?$", re.MULTILINE)
LONGEST_KEY, LONGEST_TEXT = 200, 4096
# Range of TOML's whole numbers.
LEAST, MOST = -(2**63), 2**63 - 1


def parsed(text: str, name: str) -> dict[str, Any]:
    """Parse a TOML text."""
    if DOTTED.search(text):
        raise SceneError([f"{name} has a key of more than {MOST_DOTS} parts. Write section.key"])
    if (tables := sum(1 for _ in TABLE.finditer(text))) > MOST_TABLES:
        raise SceneError([f"{name} has {tables:,} tables. Give at most {MOST_TABLES:,}"])
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise SceneError([f"{name} is not TOML: {error}. Correct that line"]) from error
    except RecursionError:
        raise SceneError([_deep(name)]) from None
    except ValueError:  # Python refuses whole numbers of several thousand digits
        text = f"{name} has a whole number of thousands of digits. Write it with a point: 1.0e20"
        raise SceneError([text]) from None
    _check(content, name)
    return content


def _deep(name: str) -> str:
    return f"{name} has tables or lists nested more than {DEEPEST} deep. Write a scene's tables, [vehicle] and so on"


def _check(content: dict[str, Any], name: str) -> None:
    """Refuse content that no scene has, layer by layer, without recursion for content of any depth."""
    faults = Faults()
    layer: list[tuple[str, Any]] = [("", content)]
    for _ in range(DEEPEST):
        following: list[tuple[str, Any]] = []
        for where, value in layer:
            if isinstance(value, dict):
                for key, item in value.items():
                    at = f"{where}.{key[:LONGEST_KEY]}" if where else key[:LONGEST_KEY]
                    if len(key) > LONGEST_KEY:
                        faults.add(at, item, f"has a name of {len(key):,} characters", f"give at most {LONGEST_KEY}")
                    _note(faults, at, item, following)
            else:
                for item in value:
                    _note(faults, where, item, following)
        layer = following
    if layer:
        raise SceneError([_deep(name)])
    faults.raise_if_any()


def _note(faults: Faults, at: str, value: Any, following: list[tuple[str, Any]]) -> None:
    """Add faults of a value; a table or list is kept for the next layer."""
    if isinstance(value, dict | list):
        following.append((at, value))
    elif isinstance(value, str) and len(value) > LONGEST_TEXT:
        faults.add(at, value, f"has {len(value):,} characters", f"give at most {LONGEST_TEXT:,}")
    elif isinstance(value, int) and not LEAST <= value <= MOST:
        faults.add(at, value, "is beyond the whole numbers of TOML, 64 bits", "write it with a point: 1.0e20")
