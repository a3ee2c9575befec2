# SPDX-License-Identifier: Apache-2.0
"""The known name that is nearest to a word, independent of case; NumPy is not imported."""

from __future__ import annotations

import functools

# Fewest letters of a word that names are searched for; most names that a message suggests.
SHORTEST, MOST = 3, 6


def meant(word: str, names: tuple[str, ...]) -> str:
    """Suggest all names that end with a word, if they are few, or else the nearest name; "" if there is none."""
    text = word.casefold()
    ends = [name for name in names if name.casefold().endswith(f".{text}")]
    if len(text) >= SHORTEST and not any(name.casefold() == text for name in names):
        ends = ends or [name for name in names if name.casefold().endswith(text)]
    near = ends if 1 < len(ends) <= MOST else [name for name in [nearest(word, names)] if name]
    return f"did you mean {' or '.join(map(repr, near))}?" if near else ""


# A file may have the same fault in thousands of tables, of which few are told.
@functools.lru_cache(maxsize=64)
def nearest(word: str, names: tuple[str, ...]) -> str | None:
    """Find a name that ends with the word, differs only in case, has a similar spelling, or contains the word."""
    import difflib  # loads slowly

    folded = {name.casefold(): name for name in reversed(names)}
    text = word.casefold()
    found = [name for name in folded if name.endswith(f".{text}")] or [name for name in folded if name == text]
    found = found or difflib.get_close_matches(text, folded, n=1, cutoff=0.6)
    found = found or [name for name in folded if len(text) >= SHORTEST and text in name]
    return folded[found[0]] if found else None
