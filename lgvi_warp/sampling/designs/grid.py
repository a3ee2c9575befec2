# SPDX-License-Identifier: Apache-2.0
"""A full grid: every combination of given values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.real_numbers import plain
from lgvi_warp.sampling.designs.base import Drawn, Sampling
from lgvi_warp.sampling.designs.random import Random
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.sampling.distributions.basic import Choice


@dataclass(frozen=True, eq=False)
class Grid(Sampling):
    """Full grid: every combination of the values of all names; the last name changes fastest.

    The number of members is the number of combinations. Names of `vary` that the grid does not contain are drawn at
    random.

    Args:
        axes: By name, a list of values or a number of levels. A name is an entry, such as "start.position[2]", or a
            whole quantity. With a number of levels, the distribution of the name in `vary` is divided into this number
            of equally probable parts, whose medians are the values. For a vector, each entry has this number of levels.

    Raises:
        SceneError: If an axis is neither a list of values nor a number of levels. The message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> grid = lw.designs.Grid({"start.velocity[0]": [1.0, 1.5, 2.0], "vehicle.buoyancy": [307.0, 308.0]})
        >>> fleet = lw.Ensemble(scene, sampling=grid)
        >>> fleet.members, fleet.select(0, 6).velocity[:, 0].tolist()
        (6, [1.0, 1.0, 1.5, 1.5, 2.0, 2.0])
    """

    axes: Mapping[str, Any] = field(default_factory=dict)
    kind: ClassVar[str] = "grid"

    def __post_init__(self) -> None:
        if not isinstance(self.axes, Mapping) or not self.axes:
            remedy = 'write grid = { "vehicle.mass" = [100.0, 110.0] }'
            raise refusal("ensemble.sampling.grid.axes", self.axes, "names nothing", remedy)
        object.__setattr__(self, "axes", {name: plain(axis) for name, axis in self.axes.items()})
        faults = Faults("ensemble.sampling.grid.")
        for name, axis in self.axes.items():
            if isinstance(axis, int | np.integer) and not isinstance(axis, bool):
                if axis < 1:
                    faults.add(f'"{name}"', axis, "is not a whole number from 1", "give a number of levels, or values")
                continue
            values = faults.finite(f'"{name}"', axis)
            if values is not None and (values.ndim == 0 or not len(values)):
                faults.add(
                    f'"{name}"', axis, "is not a list of values", "give [value, value, ...] or a number of levels"
                )
        faults.raise_if_any()

    def distributions(self) -> dict[str, Any]:
        # A `Choice` among the values, for each name that has a list of them.
        return {name: Choice(axis) for name, axis in self.axes.items() if not isinstance(axis, int | np.integer)}

    def _radices(self, space: Space) -> tuple[Space, list[int]]:
        """The part of the cube with the grid, and the number of levels of each of its columns."""
        inner = space.of(self.axes)
        numbers = []
        for key, size in zip(inner.keys, inner.sizes, strict=True):
            axis = self.axes[key]
            numbers += [int(axis) if isinstance(axis, int | np.integer) else len(axis)] * size
        return inner, numbers

    def own_members(self, space: Space) -> int:
        return math.prod(self._radices(space)[1])

    def check(self, faults: Faults, space: Space, members: int) -> None:
        # Also a fault for a number of levels without a distribution in `vary`.
        for name in self.axes:
            if name not in space.keys:
                fault = "is a number of levels of what has no distribution"
                remedy = "give it a distribution in vary, or a list of values"
                faults.add(f'sampling.grid."{name}"', self.axes[name], fault, remedy)
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        # Levels from the digits of the member's index, written with the axes' lengths as radices.
        inner, numbers = self._radices(space)
        radices = np.array(numbers, dtype=np.int64)
        places = np.ones(len(radices), dtype=np.int64)
        places[:-1] = np.cumprod(radices[:0:-1])[::-1]
        digits = members[:, None] // places % radices
        others = [key for key in space.keys if key not in self.axes]
        return inner.split((digits + 0.5) / radices) | Random().draw(space.of(others), members)

    def to_dict(self) -> Any:
        return {self.kind: {name: np.asarray(axis).tolist() for name, axis in self.axes.items()}}
