# SPDX-License-Identifier: Apache-2.0
"""How near each member came to an event of the scene."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, closest, refusal
from lgvi_warp.statistics.metrics.metric import Metric, State, Ticks
from lgvi_warp.statistics.values.quantity import Quantity

if TYPE_CHECKING:
    from lgvi_warp.sampling.members import Members
    from lgvi_warp.statistics.values.samples import Fields

# What is left of a distance that is used up, where the event has not stopped the member.
LEAST = float(np.nextafter(0.0, 1.0))


def _above_floor(b: np.ndarray, number: Callable[[str], np.ndarray]) -> np.ndarray:
    return np.asarray(number("depth") - b[..., 2])


def _below_surface(b: np.ndarray, number: Callable[[str], np.ndarray]) -> np.ndarray:
    return np.asarray(b[..., 2] - number("depth"))


def _inside_box(b: np.ndarray, number: Callable[[str], np.ndarray]) -> np.ndarray:
    return np.asarray(np.minimum(b - number("lower"), number("upper") - b).min(axis=-1))


# Type of an event -> its distance (k, n) [m] at positions (k, n, 3), as lgvi_kernels.stops has it.
DISTANCES: Mapping[str, Callable[..., np.ndarray]] = {
    "floor": _above_floor,
    "surface": _below_surface,
    "box": _inside_box,
}


@dataclass(frozen=True, eq=False)
class Nearest(Metric):
    """The least distance of each member to an event over its path [m], 0 where the event stopped it; then statistics of it.

    It looks at every tick of the controller; in a scene without one, at the times of samples. A member that something else
    stopped, or that failed, has the distance of its time under way.

    Args:
        of: name of an event of the scene, "floor".
        then: A statistic, or a list, without `of`: lw.statistics.Mean(), the default, lw.statistics.Quantiles(), ...
        kind: type of the event, "floor", "surface" or "box"; by default its name.

    Raises:
        SceneError: where the event is of another type; and as a run begins, where the scene has no such event.

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
        if self.measured:
            faults.add(
                "measured", self.measured, "has no meaning for an event, which looks at the truth", "leave it out"
            )

    def meant(self) -> Quantity:
        name, kind = self.of, self.of if self.kind is None else self.kind
        if not isinstance(name, str) or not name:
            raise refusal("nearest.of", name, "is no name", 'give the name of an event, "floor"')
        if kind not in DISTANCES:
            remedy = f"say what it is: kind=..., {closest(str(kind), DISTANCES)}"
            raise refusal("nearest.of", name, "is of no type whose distance is known", remedy)
        distance = DISTANCES[kind]

        def distances(samples: Fields, members: Members) -> np.ndarray:
            return distance(
                samples["position"].astype(np.float64, copy=False), lambda field: members.parameters[f"{name}.{field}"]
            )

        return Quantity(name, distances, "m", ("position",), needs_limit=True)

    @property
    def outcomes(self) -> tuple[str, ...]:
        return (self.of,)

    def begin(self, x: np.ndarray) -> State:
        return {"least": x[0].copy()}

    def follow(self, state: State, ticks: Ticks) -> State:
        return {"least": np.minimum(state["least"], ticks.of_living(ticks.x[:, 0], np.inf).min(axis=0))}

    def finish(self, state: State) -> np.ndarray:
        return np.where(state["ended_so"], 0.0, np.maximum(state["least"], LEAST))


def named(event: Any) -> Nearest:
    """The metric of an event of a scene."""
    return Nearest(event.key, kind=None if event.key == event.type else event.type)
