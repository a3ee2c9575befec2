# SPDX-License-Identifier: Apache-2.0
"""A custom design: points of the unit cube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.labelled import columns_by_name, is_labelled, match
from lgvi_warp.common.real_numbers import settle
from lgvi_warp.sampling.designs.base import Drawn, Sampling
from lgvi_warp.sampling.designs.designs import salib_problem
from lgvi_warp.sampling.designs.space import Space


@dataclass(frozen=True, eq=False)
class UnitCubePoints(Sampling):
    """Custom design: given points in the open unit cube, one for each member.

    `ensemble.space` lists the columns of the cube. An entry that varies independently has one column with its name; a
    joint distribution has several, "start.attitude 0" and so on. By default, the number of members is the number of
    points; with fewer members, the first points are used.

    Args:
        points: Coordinates (n, dimensions) in (0, 1) of n points, with columns in the order of the cube. A data frame, a
            mapping of columns, a structured array or an xarray Dataset may have the named columns in any order.
        names: Names of an array's columns, if they are not in the order of the cube.

    Raises:
        SceneError: If points are outside the cube, or do not fit the names. The message lists every fault.
    """

    points: Any = None
    names: Sequence[str] | None = None
    kind: ClassVar[str] = "levels"
    fewer: ClassVar[bool] = True

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.levels.")
        settle(self, "names")
        points = self.points
        if is_labelled(points):
            points = self._by_name(faults)
            faults.raise_if_any()
        array = faults.finite("points", points)
        if array is not None and (array.ndim != 2 or not len(array)):
            faults.add("points", array, f"has shape {array.shape}", "give an array of shape (members, dimensions)")
        elif array is not None and not np.all((array > 0.0) & (array < 1.0)):
            faults.add("points", array, "has points outside the open unit cube", "give levels above 0 and below 1")
        elif array is not None and self.names is not None and len(self.names) != array.shape[1]:
            faults.add("names", self.names, f"do not name {array.shape[1]} columns", "give one for each column")
        faults.raise_if_any()
        object.__setattr__(self, "points", array)

    def _by_name(self, faults: Faults) -> np.ndarray | None:
        """Concatenate the named columns, and keep their names."""
        if self.names is not None:
            faults.add("names", self.names, "are given beside points that have names", "leave them out")
        columns = columns_by_name(faults, "points", self.points)
        checked = [faults.finite(f'points["{name}"]', column) for name, column in columns.items()]
        arrays = [array for array in checked if array is not None]
        if faults:
            return None
        if len({array.shape for array in arrays}) != 1 or arrays[0].ndim != 1:
            faults.add("points", "...", "has columns of other shapes than one (n,)", "give one number for each member")
            return None
        object.__setattr__(self, "names", list(columns))
        return np.column_stack(arrays)

    def arrays(self) -> dict[str, np.ndarray]:
        # The points, by the name "points".
        return {"points": self.points}

    def own_members(self, space: Space) -> int:
        return len(self.points)

    def check(self, faults: Faults, space: Space, members: int) -> None:
        # Also a fault where the columns are not those of the cube.
        if self.points.shape[1] != space.dimensions:
            remedy = f"give {space.dimensions}, of {', '.join(space.keys) or 'nothing'}"
            faults.add("sampling.levels.points", "...", f"has {self.points.shape[1]} columns", remedy)
        elif self.names is not None:
            match(faults, "sampling.levels.points", self.names, salib_problem(space)["names"])
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        # The points as given, with columns in the order of the cube.
        if self.names is None:
            return space.split(self.points[members])
        order = [list(self.names).index(name) for name in salib_problem(space)["names"]]
        return space.split(self.points[members][:, order])

    def to_dict(self) -> Any:
        # The points as a scene file has them, as nested lists, with their names where given.
        names = {} if self.names is None else {"names": list(self.names)}
        return {self.kind: {"points": self.points.tolist(), **names}}
