# SPDX-License-Identifier: Apache-2.0
"""The scene's sea floor, for parts of a controller that read it."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.physics.terms.base import Packed, PackingContext, Term, own
from lgvi_warp.physics.terms.floor import Floor


def chosen(faults: Faults, where: str, name: Any, able: Sequence[Term], what: str, remedy: str) -> Any:
    """The thing among `able` with a name, or the only one for ""; None after adding a fault to `where`."""
    keys = [thing.key for thing in able]
    article = "an" if what[0] in "aeiou" else "a"
    if name and name not in keys:
        faults.add(where, name, f"is not {article} {what} of the scene", closest(str(name), keys) if keys else remedy)
    elif not name and len(able) != 1:
        problem = f"does not say which of {len(able)} {what}s" if able else f"needs {article} {what}"
        faults.add(where, name, problem, f"name one: {', '.join(keys)}" if able else remedy)
    else:
        return next(thing for thing in able if name in ("", thing.key))
    return None


def with_floor(part: Any, faults: Faults, events: Sequence[Term]) -> Any:
    """A copy of a part that knows the floor named by its field `floor`."""
    floors = [event for event in events if isinstance(event, Floor)]
    remedy = 'give the scene one, such as [[events]] type = "floor", depth = 40.0'
    part = copy.copy(part)
    object.__setattr__(part, "ground", chosen(faults, f"{part.key}.floor", part.floor, floors, "floor", remedy))
    return part


def packed_over(ground: Floor, context: PackingContext, values: dict[str, Any]) -> Packed:
    """Numbers of each member for device code that looks up the floor's depth, with further values."""
    return ground.packed_grid(own(ground, context.parameters), values)


# A clearance so far below the floor that nothing stops there [m].
NOWHERE = -1e6


def seen_floors(controller: Any, events: Sequence[Any]) -> tuple[Floor, ...]:
    """The floors among a scene's events that its controller reads, copied so that no member stops at them."""
    parts = controller.parts if controller is not None else ()
    grounds = {part.ground.key for part in parts if getattr(part, "ground", None) is not None}
    return tuple(replace(event, clearance=NOWHERE) for event in events if event.key in grounds)
