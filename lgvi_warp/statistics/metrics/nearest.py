# SPDX-License-Identifier: Apache-2.0
"""Closest approach of each member to an event of the scene."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.arguments import flag
from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.physics.terms.floor import Floor
from lgvi_warp.statistics.metrics.metric import Metric, State, Ticks
from lgvi_warp.statistics.values.quantity import Quantity

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.values.samples import Fields

# A number of the event by its name; one of its sides: axis, sign and offset (n or 1,).
Number = Callable[[str], np.ndarray]
Side = tuple[int, float, np.ndarray]
# What is left of a distance that is used up, where the event has not stopped the member.
LEAST = float(np.nextafter(0.0, 1.0))


def _below_surface(number: Number) -> list[Side]:
    return [(2, 1.0, -number("depth"))]


def _inside_box(number: Number) -> list[Side]:
    sides = [(axis, 1.0, -number("lower")[:, axis]) for axis in range(3)]
    return [*sides, *((axis, -1.0, number("upper")[:, axis]) for axis in range(3))]


# Type of an event -> its sides: each has the distance (sign * position[axis] + offset) [m], as lgvi_kernels.stops has it.
SIDES: Mapping[str, Callable[[Number], list[Side]]] = {
    "surface": _below_surface,
    "box": _inside_box,
}
COUNTS = {Floor.type: 1, "surface": 1, "box": 6}


def distance(event: Any, position: np.ndarray, number: Number) -> np.ndarray:
    """The distance (...) [m] of positions (..., n, 3) to an event; number: event's numbers by name, (1 or n, ...)."""
    still = np.zeros_like(position)
    return np.asarray(functools.reduce(np.minimum, _distances_and_rates(event, position, still, number)[0]))


def _distances_and_rates(
    event: Any, position: np.ndarray, velocity: np.ndarray, number: Number
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The distances (..., n) [m] to the sides of an event, and their rates [m/s], for inertial velocities (..., n, 3)."""
    if isinstance(event, Floor):
        height, rate = event.height(position, velocity, {name: number(name) for name in event.parameters()})
        return [height], [rate]
    sides = SIDES[event.type](number)
    return (
        [sign * position[..., axis] + offset for axis, sign, offset in sides],
        [sign * velocity[..., axis] for axis, sign, _ in sides],
    )


def least_between(a: np.ndarray, b: np.ndarray, rate_a: np.ndarray, rate_b: np.ndarray) -> np.ndarray:
    """The smallest value of the cubic from a to b with given slopes at the ends of an interval of length 1."""
    rise = b - a
    cubic, square = rate_a + rate_b - 2.0 * rise, 3.0 * rise - 2.0 * rate_a - rate_b
    with np.errstate(all="ignore"):
        # The root of the slope where the curve is a valley, written so that it is that of a parabola, too.
        root = np.sqrt(square**2 - 3.0 * cubic * rate_a)
        at = np.where(square > 0.0, -rate_a / (square + root), (root - square) / (3.0 * cubic))
        inside = (at > 0.0) & (at < 1.0)
        valley = a + at * (rate_a + at * (square + at * cubic))
    ends = np.minimum(a, b)
    return np.where(inside, np.fmin(ends, valley), ends)


@dataclass(frozen=True, eq=False)
class Nearest(Metric):
    """Metric: smallest distance of a member to an event [m]; 0 if the event stopped the member.

    The distance is evaluated at every tick of the controller, or without a controller at the sample times. Between two
    of these times the path is the cubic through both positions and velocities, so the times may be several steps apart.
    For a member that failed, or that another event stopped, only the path up to its end counts.

    Args:
        of: name of an event of the scene, such as "floor".
        kind: type of the event, "floor", "surface" or "box"; by default `of` is also the type.

    Raises:
        SceneError: if the event has another type; or, at the start of a run, if the scene has no such event.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("sphere", start={"velocity": [0.0, 0.0, 0.5]}, events=[lw.events.Floor(depth=3.0)])
        >>> result = lw.solve(scene, "psi_x", h=0.1, t1=2.0, statistics=[lw.metrics.Nearest("floor")])
        >>> print(f"{result.statistics['mean nearest floor'].value[0, 0]:.2f} m")
        2.00 m
    """

    type: ClassVar[str] = "nearest"

    kind: str | None = None

    def check(self, faults: Faults) -> None:
        super().check(faults)
        if flag("nearest.measured", self.measured):
            faults.add(
                "measured", self.measured, "has no meaning for an event, which looks at the truth", "leave it out"
            )

    def meant(self) -> Quantity:
        name, kind = self.of, self.of if self.kind is None else self.kind
        if not isinstance(name, str) or not name:
            raise refusal("nearest.of", name, "is not a name", 'give the name of an event, "floor"')
        if kind not in COUNTS:
            remedy = f"say what it is: kind=..., {closest(str(kind), COUNTS)}"
            raise refusal("nearest.of", name, "is of no type whose distance is known", remedy)

        def distances(samples: Fields, members: Members) -> np.ndarray:
            place, v = (samples[field].astype(np.float64, copy=False) for field in ("position", "velocity"))
            event = next(event for event in samples.events if event.key == name)
            over_ground = np.stack([(samples["attitude"][..., axis, :] * v).sum(axis=-1) for axis in range(3)], axis=-1)
            rows, rates = _distances_and_rates(
                event, place, over_ground, lambda field: members.parameters[f"{name}.{field}"]
            )
            return np.moveaxis(np.stack(rows + rates, axis=1), 1, 2)

        labels = tuple(f"{what} {i} of {name}" for what in ("distance", "rate") for i in range(COUNTS[kind]))
        return Quantity(name, distances, "m", ("position", "attitude", "velocity"), labels, needs_limit=True)

    @property
    def outcomes(self) -> tuple[str, ...]:
        return (self.of,)

    def begin(self, x: np.ndarray) -> State:
        return {"least": x[: len(x) // 2].min(axis=0)}

    def follow(self, state: State, ticks: Ticks) -> State:
        count, before, dt = ticks.x.shape[1] // 2, ticks.before, ticks.dt[:, None, None]
        each = least_between(before[:, :count], ticks.x[:, :count], dt * before[:, count:], dt * ticks.x[:, count:])
        return {"least": np.minimum(state["least"], ticks.of_living(each.min(axis=1), np.inf).min(axis=0))}

    def finish(self, state: State) -> np.ndarray:
        return np.where(state["ended_so"], 0.0, np.maximum(state["least"], LEAST))


def named(event: Any) -> Nearest:
    """The metric of an event of a scene."""
    return Nearest(event.key, kind=None if event.key == event.type else event.type)
