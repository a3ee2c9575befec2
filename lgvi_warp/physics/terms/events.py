# SPDX-License-Identifier: Apache-2.0
"""Events: conditions that stop a member. Each has its own status, and the run records the time."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common import registry
from lgvi_warp.common.declared import text
from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.common.status import Status
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, build, check_list, number


@dataclass(frozen=True, eq=False, kw_only=True)
class Event(Term):
    """Base class of events: a condition that stops a member as soon as a distance function is 0 or negative.

    Distances depend on the position of the body's origin, in inertial axes.

    Args:
        name: Name of the event in parameters ("name.field"); by default its type.

    Attributes:
        device: Name of a module of lgvi_kernels.stops, or any object with `distance(view, p)`.
        status: Status of a member that the event stopped.
    """

    status: ClassVar[Status] = Status.CONDITION
    kinds: ClassVar[registry.Kinds] = registry.Kinds("lgvi_warp.physics.terms", {}, "events")
    acts: ClassVar[bool] = False

    @property
    def follows(self) -> str:
        """Key of the part of the controller that the event watches; by default "", for none."""
        return ""

    def wired(self, bus: Any) -> Any:
        """Give the event the rows of memory of the controller's part that it watches.

        Args:
            bus: Rows of the controller's memory; None in a scene without a controller.

        Returns:
            A copy, or the event itself if it watches no part, which is the default.

        Raises:
            SceneError: If the controller has no such part.
        """
        return self


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface(Event):
    """Stop a member when the body's origin rises to a depth.

    Args:
        depth: Depth at which members stop [m]; 0 by default, the surface.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.Scene.named("remus_100", events=[lw.events.Surface(depth=0.5)]).parameters()["surface.depth"]
        array(0.5)
    """

    type: ClassVar[str] = "surface"
    status: ClassVar[Status] = Status.SURFACE
    looks_at_surface: ClassVar[bool] = True

    depth: Any = number((), "m", 0.0)


@dataclass(frozen=True, eq=False, kw_only=True)
class Box(Event):
    """Stop a member when the body's origin leaves a box.

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
        at: Time at which members stop [s], at least 0.

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
    """Stop a member when the energy that it has used reaches the capacity of its battery.

    The scene must account the energy used with a term `lw.terms.EnergyUse`.

    Args:
        capacity: Energy that the battery can deliver [J]; 3.6e6 is 1 kWh.

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
class MissionDone(Event):
    """Stop a member at the tick at which it has reached its last waypoint and completed the circles requested there.

    If `at_end` is "loiter" and the last point has no turns or time, the mission is done when the circle begins. If the
    mission is done at the last tick of a run, the member ends as "ok".

    Args:
        guidance: Name of the guidance `lw.control.Waypoints`; "waypoints" by default. Its `at_end` must not be "go_on".

    Raises:
        SceneError: If a number is invalid (see `Term`). A scene refuses the event if it has no such guidance.

    Examples:
        >>> import lgvi_warp as lw
        >>> way = dict(points=[[0.0, 0.0, 2.0], [8.0, 0.0, 2.0]], speed=1.0, look_ahead=2.0, radius=1.0)
        >>> laws = [lw.control.SpeedPID(kp=40.0, drag=20.0), lw.control.HeadingPID(kp=30.0, kd=40.0)]
        >>> controller = lw.Controller(period=0.1, guidance=[lw.control.Waypoints(**way)], laws=laws)
        >>> push = lw.terms.ControlWrench(limit=[60.0] * 6)
        >>> scene = lw.Scene.named(
        ...     "sphere",
        ...     terms=[push],
        ...     start={"velocity": [1.0, 0.0, 0.0]},
        ...     controller=controller,
        ...     events=[lw.events.MissionDone()],
        ... )
        >>> lw.solve(scene, "psi_s", h=0.05, t1=30.0).status.counts()
        {'mission_done': 1}
    """

    type: ClassVar[str] = "mission_done"
    status: ClassVar[Status] = Status.MISSION_DONE
    timed: ClassVar[bool] = True
    # First of the rows in which that guidance tells that it is done; set for an event of a scene.
    row: ClassVar[int] = 0

    guidance: str = text("is not a name", "give the name of guidance of the type waypoints", "waypoints")

    @property
    def follows(self) -> str:
        return self.guidance

    def wired(self, bus: Any) -> Any:
        if bus is None or self.guidance not in bus.done:
            problem = "is the name of no guidance that ends"
            remedy = 'give [[controller.guidance]] type = "waypoints" whose at_end is "stop" or "loiter"'
            raise refusal(f"{self.key}.guidance", self.guidance, problem, remedy)
        event = copy.copy(self)
        object.__setattr__(event, "row", bus.done[self.guidance])
        return event

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        return Packed({"done": self.row})


@dataclass(frozen=True, eq=False, kw_only=True)
class Outside(Event):
    """Stop a member when the body's origin leaves the grid of a `current_field`, or sinks below its last level.

    A field with `outside = "stop"` adds this event to its scene; a scene refuses the event for any other field. Along an
    axis with only one node, and above the first level, members do not stop.

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

    field: str = text("is not a name", "give the name of a current_field", "current_field")

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
