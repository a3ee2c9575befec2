"""The terms that a scene may name, one file each: weight, drag, currents, tethers, thrusters, fins, waves and noise."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from lgvi_warp.common.errors import Faults, SceneError, closest, shown
from lgvi_warp.common.names import folded
from lgvi_warp.physics.terms.base import AnyTerm, Packed, PackingContext, Term, build, few_enough, number
from lgvi_warp.physics.terms.control_fins import ControlFins
from lgvi_warp.physics.terms.cross_flow import CrossFlow
from lgvi_warp.physics.terms.current import Current, CurrentProfile
from lgvi_warp.physics.terms.current_harmonics import CurrentHarmonics
from lgvi_warp.physics.terms.drag import Drag, DragMatrix
from lgvi_warp.physics.terms.fins import Fins
from lgvi_warp.physics.terms.gauss_markov_current import GaussMarkovCurrent
from lgvi_warp.physics.terms.hydrostatics import Restoring, Weight
from lgvi_warp.physics.terms.lift import BodyLift
from lgvi_warp.physics.terms.stratification import Stratification
from lgvi_warp.physics.terms.tether import Tether
from lgvi_warp.physics.terms.thrusters import Thrusters
from lgvi_warp.physics.terms.waves import Waves
from lgvi_warp.physics.terms.wrench import Wrench, WrenchSchedule
from lgvi_warp.physics.terms.wrench_noise import WrenchNoise

# Classes of terms by their type in a scene file.
TYPES = Term.kinds

# Names that no term may have: its parameters would be mixed with those of the scene.
RESERVED = ("vehicle", "environment", "start")

# Terms that follow from the vehicle, and are refused in a list of terms.
IMPLIED: tuple[Term, ...] = (Weight(), Restoring())


def register_term(kind: type[AnyTerm]) -> type[AnyTerm]:
    """Make a user's term or event known to scene files by its `type`. It may be used as a decorator of the class.

    Args:
        kind: Subclass of `Term` or `Event` with a `type` of its own.

    Returns:
        The same class.

    Raises:
        ValueError: Where `type` is empty or taken.
    """
    known: dict[str, Any] = kind.kinds
    if not kind.type or kind.type in known or kind.type in ("weight", "restoring"):
        raise ValueError(f"{kind.__name__}.type = {kind.type!r}: give a type that no other term has")
    known[kind.type] = kind
    return kind


for _kind in (
    Drag,
    DragMatrix,
    Current,
    CurrentProfile,
    Tether,
    Thrusters,
    Wrench,
    WrenchSchedule,
    CurrentHarmonics,
    Waves,
    GaussMarkovCurrent,
    WrenchNoise,
    Stratification,
    Fins,
    ControlFins,
    CrossFlow,
    BodyLift,
):
    TYPES[_kind.type] = _kind


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
    kind = TYPES.get(word) if isinstance(word, str) else None
    if kind is None:
        implied = word in ("weight", "restoring", "buoyancy")
        remedy = "leave it out: it follows from the vehicle" if implied else closest(word, TYPES)
        raise SceneError([f"{where}.type = {shown(word)}: is not known; {remedy}"])
    return build(where, kind, table)


__all__ = [
    "IMPLIED",
    "TYPES",
    "BodyLift",
    "ControlFins",
    "CrossFlow",
    "Current",
    "CurrentHarmonics",
    "CurrentProfile",
    "Drag",
    "DragMatrix",
    "Fins",
    "GaussMarkovCurrent",
    "Packed",
    "PackingContext",
    "Restoring",
    "Stratification",
    "Term",
    "Tether",
    "Thrusters",
    "Waves",
    "Weight",
    "Wrench",
    "WrenchNoise",
    "WrenchSchedule",
    "build",
    "from_list",
    "number",
    "register_term",
]
