# SPDX-License-Identifier: Apache-2.0
"""Events: conditions that stop a member. Each has a status of its own, and the run records the time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.common.status import Status
from lgvi_warp.physics.terms.base import Numbers, Term, build, check_list, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Event(Term):
    """A condition that stops a member as soon as its distance, positive while the member goes on, is 0 or below.

    Class attributes: `device` is the name of a module of lgvi_kernels.stops, or any object with `distance(view, p)`;
    `status` is the status of a member that it stopped. Distances look at the position of the body's origin, in inertial axes.

    Args:
        name: Name of the event in parameters ("name.field"); by default its type.
    """

    status: ClassVar[Status] = Status.CONDITION
    kinds: ClassVar[dict[str, Any]] = {}
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
class Floor(Event):
    """Stop where the body's origin sinks to the sea floor.

    Args:
        depth: Depth of the floor [m].

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.Scene.named("remus_100", events=[lw.events.Floor(depth=40.0)]).parameters()["floor.depth"]
        array(40.)
    """

    type: ClassVar[str] = "floor"
    status: ClassVar[Status] = Status.FLOOR

    depth: Any = number((), "m")


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


TYPES = Event.kinds


def from_list(entries: Any) -> tuple[Event, ...]:
    """Build the events of a scene."""
    check_list("events", entries, "write [[events]] and type = ... below, or events=[lw.events.Surface()]")
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
