# SPDX-License-Identifier: Apache-2.0
"""The terms of the core, one file each: weight, drag, currents, tethers, thrusters, fins, waves and noise."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping
from typing import Any

from lgvi_warp.common import registry
from lgvi_warp.common.errors import Faults, among, closest, refusal
from lgvi_warp.common.names import folded
from lgvi_warp.common.sentences import sentences
from lgvi_warp.physics.terms.base import AnyTerm, Term, build, check_list
from lgvi_warp.physics.terms.hydrostatics import Restoring, Weight

# Classes of terms by their type in a scene file; those of this package are attributes of it.
registry.load_modules(sys.modules[__name__])
TYPES = Term.kinds
globals().update({kind.__name__: kind for kind in TYPES.loaded.values()})

# Names that no term may have: its parameters would be mixed with those of the scene.
RESERVED = ("vehicle", "environment", "start")

# Terms that follow from the vehicle, and are refused in a list of terms.
IMPLIED: tuple[Term, ...] = (Weight(), Restoring())


def register(kind: type[AnyTerm]) -> type[AnyTerm]:
    """Register a user's term, event or part of a controller under its `type`, for scene files; use as a class decorator.

    A class registers itself when it is defined, unless its `type` is taken. In that case this function raises an error.

    Args:
        kind: Subclass of `Term`, of `Event` or of a part, such as `ControlLaw`, with a new `type`.

    Returns:
        The same class.

    Raises:
        ValueError: If `type` is empty or taken by another class.
    """
    if not isinstance(kind, type) or not hasattr(kind, "kinds"):
        raise refusal("kind", kind, "is not a class of a term", "give a subclass of lw.laws.Term")
    if not registry.add(kind.kinds, kind):
        former = kind.kinds.get(kind.type)
        problem = f"is that of {former.__module__}.{former.__qualname__}" if former else "is missing"
        raise ValueError(
            sentences(f"{kind.__name__}.type = {kind.type!r}", problem, "give a type that no other term has")
        )
    return kind


def from_list(entries: Any) -> tuple[Term, ...]:
    """Build the terms of a scene from tables of a scene file, `Term` objects, or both, in their order."""
    entries = check_list("terms", entries, "write [[terms]] and type = ... below, or terms=[lw.terms.Drag(...)]")
    faults, terms = Faults(), list[Term]()
    for i, entry in enumerate(entries):
        with faults.including():
            build_entry = _allowed if isinstance(entry, Term) else _from_table
            terms.append(build_entry(f"terms[{i}]", entry))
    counts = Counter(term.key for term in terms)
    for key in sorted(key for key in counts if folded(key) in RESERVED):
        faults.add("terms", key, "is the name of a section of the scene", f'give another name: name = "{key}_term"')
    # Other names would not help these.
    unique = [term for term in terms if term.unique]
    for i, term in enumerate(unique):
        if any(other.type == term.type for other in unique[:i]):
            faults.add("terms", term.key, f"is a second term of the type {term.type}", "keep one of them")
    several = {key for key, count in counts.items() if count > 1} - {term.key for term in unique}
    for key in sorted(several):
        remedy = f'give each a name of its own: name = "{key}_2"'
        faults.add("terms", key, f"is the name of {counts[key]} terms", remedy)
    faults.raise_if_any()
    return tuple(terms)


def _allowed(where: str, term: Term) -> Term:
    """The term. Raises SceneError if it is an event, or a term that follows from the vehicle."""
    if not term.acts:
        raise refusal(where, term.type, "is an event", "give it in events=[...]")
    if type(term) in (Weight, Restoring):
        raise refusal(where, term.type, "acts already", "leave it out: it follows from the vehicle")
    return term


def _from_table(where: str, table: Any) -> Term:
    if not isinstance(table, Mapping):
        remedy = "write a table with type = ..., or give a term such as lw.terms.Drag(quadratic=...)"
        raise refusal(where, table, "is not a term", remedy)
    word = table.get("type", "")
    implied = [term.type for term in IMPLIED]
    kind = TYPES.get(word) if isinstance(word, str) else None
    if kind is None or word in implied:
        follows = among(word, (*implied, "buoyancy"))
        known = sorted(TYPES.keys() - implied)
        remedy = "leave it out: it follows from the vehicle" if follows else closest(word, known)
        raise refusal(f"{where}.type", word, "is not known", remedy)
    return build(where, kind, table)
