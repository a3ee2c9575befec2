"""Points of the unit cube that the user gives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.errors import Faults
from lgvi_warp.sampling.base import Drawn, Sampling
from lgvi_warp.variations import Space


@dataclass(frozen=True, eq=False)
class Levels(Sampling):
    """A design of your own: points (n, dimensions) in the open unit cube, whose columns are in the order of the names.

    `ensemble.space` says which column is what. The number of members is that of the points, or less: the first ones.
    Raises SceneError.
    """

    points: Any = None
    kind: ClassVar[str] = "levels"
    fewer: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.levels.")
        array = faults.finite("points", self.points)
        if array is not None and (array.ndim != 2 or not len(array)):
            faults.add("points", array, f"has shape {array.shape}", "give an array of shape (members, dimensions)")
        elif array is not None and not np.all((array > 0.0) & (array < 1.0)):
            faults.add("points", array, "leaves the open unit cube", "give levels above 0 and below 1")
        faults.raise_if_any()
        object.__setattr__(self, "points", array)

    def arrays(self) -> dict[str, np.ndarray]:
        """The points."""
        return {"points": self.points}

    def own_members(self, space: Space) -> int:
        """Of the points."""
        return len(self.points)

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """As many columns as the cube has."""
        if self.points.shape[1] != space.dimensions:
            remedy = f"give {space.dimensions}, of {', '.join(space.keys) or 'nothing'}"
            faults.add("sampling.levels.points", "...", f"has {self.points.shape[1]} columns", remedy)
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """As given."""
        return space.split(self.points[members])

    def to_dict(self) -> Any:
        """As in a scene file."""
        return {self.kind: {"points": self.points.tolist()}}
