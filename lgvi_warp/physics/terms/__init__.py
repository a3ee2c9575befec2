"""The terms that a scene may name, one file each: weight, drag, currents, tethers, thrusters, fins, waves and noise."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from lgvi_warp.common import registry
from lgvi_warp.common.errors import Faults, SceneError, closest, shown
from lgvi_warp.common.names import folded
from lgvi_warp.physics.terms.base import AnyTerm, Term, build, few_enough
from lgvi_warp.physics.terms.hydrostatics import Restoring, Weight

# Classes of terms by their type in a scene file, each also an attribute of this package.
registry.load_modules(sys.modules[__name__])
TYPES = Term.kinds
globals().update({kind.__name__: kind for kind in TYPES.values()})

# Names that no term may have: its parameters would be mixed with those of the scene.
RESERVED = ("vehicle", "environment", "start")

# Terms that follow from the vehicle, and are refused in a list of terms.
IMPLIED: tuple[Term, ...] = (Weight(), Restoring())


def register_term(kind: type[AnyTerm]) -> type[AnyTerm]:
    """Check that scene files know a user's term or event by its `type`. It may be used as a decorator of the class.

    A class is known as soon as it is made, if its `type` is not taken; this function says so where it is.

    Args:
        kind: Subclass of `Term` or `Event` with a `type` of its own.

    Returns:
        The same class.

    Raises:
        ValueError: Where `type` is empty or taken by another class.
    """
    if not registry.add(kind.kinds, kind):
        raise ValueError(f"{kind.__name__}.type = {kind.type!r}: give a type that no other term has")
    return kind


def from_list(given: Any) -> tuple[Term, ...]:
    """Build the terms of a scene.

    Args:
        given: A list of tables of a scene file, of `Term` objects, or of both.

    Returns:
        The terms, in the same order.

    Raises:
        SceneError: Where an entry is no term, is an event, or shares its name with another. The message lists every fault.
    """
    faults = Faults()
    if not isinstance(given, Sequence) or isinstance(given, str):
        raise SceneError(
            [f"terms = {shown(given)}: is no list; write [[terms]] and type = ... below, or terms=[lw.Drag(...)]"]
        )
    few_enough("terms", given)
    terms: list[Term] = []
    for i, entry in enumerate(given):
        with faults.including():
            terms.append(
                _allowed(f"terms[{i}]", entry) if isinstance(entry, Term) else _from_table(f"terms[{i}]", entry)
            )
    counts = Counter(term.key for term in terms)
    for key in sorted(key for key in counts if folded(key) in RESERVED):
        faults.add("terms", key, "is the name of a section of the scene", f'give another name: name = "{key}_term"')
    for key in sorted(key for key, count in counts.items() if count > 1):
        faults.add(
            "terms", key, f"is the name of {counts[key]} terms", f'give each a name of its own: name = "{key}_2"'
        )
    faults.raise_if_any()
    return tuple(terms)


def _allowed(where: str, one: Term) -> Term:
    """The term, unless it is an event or follows from the vehicle: then SceneError."""
    if not one.acts:
        raise SceneError([f"{where} = {one.type!r}: is an event; give it in events=[...]"])
    if type(one) in (Weight, Restoring):
        raise SceneError([f"{where} = {one.type!r}: acts already; leave it out: it follows from the vehicle"])
    return one


def _from_table(where: str, table: Any) -> Term:
    if not isinstance(table, Mapping):
        remedy = "write a table with type = ..., or give a term such as lw.Drag(quadratic=...)"
        raise SceneError([f"{where} = {shown(table)}: is no term; {remedy}"])
    word = table.get("type", "")
    implied = [one.type for one in IMPLIED]
    kind = TYPES.get(word) if isinstance(word, str) else None
    if kind is None or word in implied:
        follows = word in (*implied, "buoyancy")
        known = sorted(TYPES.keys() - implied)
        remedy = "leave it out: it follows from the vehicle" if follows else closest(word, known)
        raise SceneError([f"{where}.type = {shown(word)}: is not known; {remedy}"])
    return build(where, kind, table)
