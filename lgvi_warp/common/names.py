# SPDX-License-Identifier: Apache-2.0
"""Names of terms and events in a scene: each becomes part of a folder's name in a store, on any file system."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable

# A folder is called "name.field"; with the longest field it stays well below the 255 bytes that file systems allow.
MOST_NAME_BYTES = 100
# Names that Windows reserves for devices, for folders too, whatever follows a point.
DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(10))}
BESIDE = " _-."
RULE = "give letters, digits, _, - and points"


def wrong_with(name: str) -> tuple[str, str] | None:
    """Check the name of a term or an event: (problem, remedy), or None for a good name."""
    if not name:
        return "is empty", RULE
    bad = next((character for character in name if not (character.isalnum() or character in BESIDE)), None)
    if bad is not None:
        return f"has {shown_character(bad)}, which no folder's name may have everywhere", RULE
    if len(name.encode()) > MOST_NAME_BYTES:
        return f"has {len(name.encode()):,} bytes", f"give at most {MOST_NAME_BYTES}"
    if not name[0].isalnum() and name[0] != "_":
        return f"begins with {shown_character(name[0])}", "begin with a letter, a digit or _"
    if name[-1] in " .":
        return f"ends with {shown_character(name[-1])}, which some file systems drop", "end with a letter or a digit"
    if folded(name.split(".")[0].strip()) in DEVICES:
        return "is the name of a device on Windows", "give another name"
    return None


def shown_character(character: str) -> str:
    """Write a character so that a message can show it."""
    return {" ": "a space", ".": "a point"}.get(
        character, ascii(character) if not character.isprintable() else repr(character)
    )


def folded(name: str) -> str:
    """Normalise a name as file systems do that ignore case, or that encode accents in two ways."""
    return unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())


def alike(names: Iterable[str]) -> list[tuple[str, str]]:
    """Pairs (earlier, later), in their order, of different names that some file system cannot distinguish."""
    first: dict[str, str] = {}
    pairs: list[tuple[str, str]] = []
    for name in names:
        earlier = first.setdefault(folded(name), name)
        if earlier != name and (earlier, name) not in pairs:
            pairs.append((earlier, name))
    return pairs
