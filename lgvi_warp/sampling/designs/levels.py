"""Points of the unit cube that the user gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.labelled import columns_by_name, is_labelled, match
from lgvi_warp.sampling.designs.base import Drawn, Sampling
from lgvi_warp.sampling.designs.designs import salib_problem
from lgvi_warp.sampling.designs.space import Space


@dataclass(frozen=True, eq=False)
class Levels(Sampling):
    """A design of your own: points (n, dimensions) in the open unit cube, whose columns are in the order of the names.

    `ensemble.space` says which column is what: an entry that varies by itself has one column of its name, a joint law
    several, "start.attitude 0" and so on. points may be a data frame, a mapping of columns, a structured array or an xarray
    Dataset with these names, in any order. names: of the columns of an array, where they are not in that order. The number
    of members is that of the points, or less: the first ones. Raises SceneError.
    """

    points: Any = None
    names: Sequence[str] | None = None
    kind: ClassVar[str] = "levels"
    fewer: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.levels.")
        points = self.points
        if is_labelled(points):
            points = self._by_name(faults)
            faults.raise_if_any()
        array = faults.finite("points", points)
        if array is not None and (array.ndim != 2 or not len(array)):
            faults.add("points", array, f"has shape {array.shape}", "give an array of shape (members, dimensions)")
        elif array is not None and not np.all((array > 0.0) & (array < 1.0)):
            faults.add("points", array, "leaves the open unit cube", "give levels above 0 and below 1")
        elif array is not None and self.names is not None and len(self.names) != array.shape[1]:
            faults.add("names", self.names, f"do not name {array.shape[1]} columns", "give one for each column")
        faults.raise_if_any()
        object.__setattr__(self, "points", array)

    def _by_name(self, faults: Faults) -> np.ndarray | None:
        """The columns side by side; keeps their names."""
        if self.names is not None:
            faults.add("names", self.names, "are given beside points that have names", "leave them out")
        columns = columns_by_name(faults, "points", self.points)
        given = [faults.finite(f'points["{name}"]', column) for name, column in columns.items()]
        arrays = [array for array in given if array is not None]
        if faults:
            return None
        if len({array.shape for array in arrays}) != 1 or arrays[0].ndim != 1:
            faults.add("points", "...", "has columns of other shapes than one (n,)", "give one number for each member")
            return None
        object.__setattr__(self, "names", list(columns))
        return np.column_stack(arrays)

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
        elif self.names is not None:
            match(faults, "sampling.levels.points", self.names, salib_problem(space)["names"])
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """As given."""
        if self.names is None:
            return space.split(self.points[members])
        order = [list(self.names).index(name) for name in salib_problem(space)["names"]]
        return space.split(self.points[members][:, order])

    def to_dict(self) -> Any:
        """As in a scene file."""
        names = {} if self.names is None else {"names": list(self.names)}
        return {self.kind: {"points": self.points.tolist(), **names}}
