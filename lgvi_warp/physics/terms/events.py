# SPDX-License-Identifier: Apache-2.0
"""Events: conditions that stop a member. Each has a status of its own, and the run records the time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common import registry
from lgvi_warp.common.declared import text
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.common.status import Status
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, build, check_list, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Event(Term):
    """A condition that stops a member as soon as its distance, positive while the member goes on, is 0 or below.

    Distances look at the position of the body's origin, in inertial axes.

    Args:
        name: Name of the event in parameters ("name.field"); by default its type.

    Attributes:
        device: Name of a module of lgvi_kernels.stops, or any object with `distance(view, p)`.
        status: Status of a member that it stopped.
    """

    status: ClassVar[Status] = Status.CONDITION
    kinds: ClassVar[registry.Kinds] = registry.Kinds("lgvi_warp.physics.terms", {}, "events")
    acts: ClassVar[bool] = False


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface(Event):
    """Stop where the body's origin rises to a depth.

    Args:
        depth: Depth [m]; 0 by default, the surface.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.Scene.named("remus_100", events=[lw.events.Surface(depth=0.5)]).parameters()["surface.depth"]
        array(0.5)
    """

    type: ClassVar[str] = "surface"
    status: ClassVar[Status] = Status.SURFACE

    depth: Any = number((), "m", 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Box(Event):
    """Stop where the body's origin leaves a box.

    Args:
        lower: Lower corner, shape (3,) [m], in inertial axes.
        upper: Upper corner, shape (3,) [m], in inertial axes; above `lower` on each axis.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.events.Box(lower=[-50.0, -50.0, 0.0], upper=[50.0, 50.0, 30.0]).upper
        array([50., 50., 30.])
    """

    type: ClassVar[str] = "box"
    status: ClassVar[Status] = Status.BOX

    lower: Any = number((3,), "m")
    upper: Any = number((3,), "m")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        # In addition, refuses members whose corners span no box.
        bad = super().unphysical(numbers)
        crossed = np.any(numbers["upper"] <= numbers["lower"], axis=1)
        return {"lower": bad["lower"] | crossed, "upper": bad["upper"] | crossed}

    def check(self, faults: Faults) -> None:
        if np.any(self.upper <= self.lower):
            fault = f"is not above lower = {self.lower.tolist()}"
            faults.add("upper", self.upper, fault, "give upper > lower on each axis")


@dataclass(frozen=True, eq=False, kw_only=True)
class StopTime(Event):
    """Stop a member at a time.

    Args:
        at: Time [s], from 0.

    Examples:
        >>> import lgvi_warp as lw
        >>> [event.key for event in lw.Scene.named("remus_100", events=[lw.events.StopTime(at=60.0)]).events]
        ['time']
    """

    type: ClassVar[str] = "time"
    status: ClassVar[Status] = Status.TIME
    timed: ClassVar[bool] = True

    at: Any = number((), "s", least=0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Battery(Event):
    """Stop a member where the energy that it has used reaches the capacity of its battery.

    The scene accounts that energy by a term `lw.terms.EnergyUse`.

    Args:
        capacity: Energy that the battery gives [J]: 3.6e6 is 1 kWh.

    Examples:
        >>> import lgvi_warp as lw
        >>> account, battery = lw.terms.EnergyUse(hotel=20.0), lw.events.Battery(capacity=50.0)
        >>> result = lw.solve(lw.Scene.named("remus_100", terms=[account], events=[battery]), h=0.1, t1=5.0)
        >>> print(f"{lw.Status(result.status[0]).text}, after {result.failure_time[0]:.6g} s")
        stopped by an event: it used the capacity of its battery, after 2.5 s
    """

    type: ClassVar[str] = "battery"
    status: ClassVar[Status] = Status.BATTERY
    looks_at_energy: ClassVar[bool] = True

    capacity: Any = number((), "J", above=0.0)

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        # Where the account lies is filled in with the rows of the memory.
        return Packed({"capacity": numbers["capacity"], "account_row": 0})


@dataclass(frozen=True, eq=False, kw_only=True)
class Outside(Event):
    """Stop where the body's origin leaves the grid of a `current_field`, or sinks below its last level.

    A field with `outside = "stop"` brings it along; a scene has it for no other field. Along an axis of one node, and above
    the first level, nothing stops.

    Args:
        field: Name of the field; "current_field" by default.

    Examples:
        >>> import lgvi_warp as lw
        >>> import numpy as np
        >>> field = lw.terms.CurrentField(velocities=np.zeros((3, 3, 1, 3)), spacing=[50.0, 50.0, 1.0], outside="stop")
        >>> scene = lw.Scene.named("sphere", terms=[field], start={"position": [50.0, 90.0, 5.0], "velocity": [0.0, 1.5, 0.0]})
        >>> result = lw.solve(scene, "rk4", h=0.05, t1=20.0)
        >>> result.status.counts(), float(np.round(result.position[-1, 0, 1], 6))
        ({'outside': 1}, 100.0)
    """

    type: ClassVar[str] = "outside"
    status: ClassVar[Status] = Status.OUTSIDE
    device: ClassVar[Any] = "box"

    field: str = text("is no name", "give the name of a current_field", "current_field")

    @classmethod
    def lanes(cls) -> tuple[tuple[str, int], ...] | None:
        return Box.lanes()

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        origin, spacing = (context.parameters[f"{self.field}.{name}"] for name in ("origin", "spacing"))
        # Nodes along north, east and depth.
        counts = np.array(context.parameters[f"{self.field}.velocities"].shape[3:6])
        upper = np.where(counts > 1, origin + (counts - 1.0) * spacing, FAR)
        lower = np.where((counts > 1) & np.array([True, True, False]), origin, -FAR)
        return Packed({"lower": lower, "upper": upper})


# Farther away than any field reaches [m].
FAR = 1e9

TYPES = Event.kinds


def from_list(entries: Any) -> tuple[Event, ...]:
    """Build the events of a scene."""
    entries = check_list("events", entries, "write [[events]] and type = ... below, or events=[lw.events.Surface()]")
    faults, events = Faults(), list[Event]()
    for i, entry in enumerate(entries):
        with faults.including():
            if isinstance(entry, Event):
                events.append(entry)
                continue
            word = entry.get("type", "") if isinstance(entry, Mapping) else entry
            kind = TYPES.get(word) if isinstance(entry, Mapping) and isinstance(word, str) else None
            if kind is None:
                faults.add(f"events[{i}].type", word, "is not known", closest(str(word), TYPES))
            else:
                events.append(build(f"events[{i}]", kind, entry))
    faults.raise_if_any()
    return tuple(events)
