# SPDX-License-Identifier: Apache-2.0
"""The base class of all samplings, and of designs with independent replicates."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common import registry
from lgvi_warp.common.arguments import explained
from lgvi_warp.common.documented import Documented
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.real_numbers import is_whole, settles_first
from lgvi_warp.sampling.designs.space import Space

# A block's members are a multiple of this, so that it has equally many points of each replicate.
MOST_REPLICATES = 64

Drawn = dict[str, np.ndarray]


@explained
@dataclass(frozen=True)
class Sampling(Documented):
    """Arrangement of the members' points in the unit cube.

    Class attributes: `kind` is the name in a scene file. `fewer` is True if a run may use fewer members than the
    sampling contains; it then uses the first ones.

    Raises:
        SceneError: If a setting is wrong. The message lists every fault.
    """

    kind: ClassVar[str] = ""
    # Classes by their kind in a scene file.
    kinds: ClassVar[MutableMapping[str, Any]] = registry.Kinds(
        "lgvi_warp.sampling.designs",
        {
            "sequences": ("sobol", "halton"),
            "designs": ("saltelli", "morris"),
            "random": ("random",),
            "grid": ("grid",),
            "hypercube": ("latin_hypercube",),
            "levels": ("levels",),
            "table": ("table",),
        },
    )
    fewer: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        settles_first(cls)
        if cls.__module__.startswith(__package__.partition(".")[0]):
            explained(cls)
        registry.add(cls.kinds, cls, "kind")

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Levels in (0, 1) of members (n,) by key, each (n, size). All samplings must define this."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def distributions(self) -> dict[str, Any]:
        """Distributions that the sampling itself contains, by the name of the quantity."""
        return {}

    def own_values(self) -> dict[str, np.ndarray]:
        """Values (members, ...) that the sampling itself contains, by the name of the quantity."""
        return {}

    def own_weights(self) -> np.ndarray | None:
        """Weights of the members (members,) in statistics, with mean 1; None for equal weights."""
        return None

    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays of the sampling with a row for each member, which a store keeps as arrays."""
        return {}

    def own_members(self, space: Space) -> int | None:
        """The number of members that the sampling itself fixes; None if the user chooses it."""
        return None

    def group_size(self, space: Space) -> int:
        """Group size: the number of members must be a multiple of it."""
        return 1

    def replicates_of_members(self) -> int:
        """Number R of independent replicates of the design: member i is point i // R of replicate i mod R."""
        return 1

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """Add a fault if the number of members, or the varied names, do not suit the sampling."""
        fixed, group = self.own_members(space), self.group_size(space)
        if fixed is not None and self.fewer and members > fixed:
            fault = f"are more than the {fixed} of the {self.kind}"
            faults.add("members", members, fault, f"give {fixed} or less, or leave members out")
        elif fixed is not None and not self.fewer and members != fixed:
            remedy = f"give {fixed}, or leave members out"
            faults.add("members", members, f"is not the {fixed} of the {self.kind}", remedy)
        elif members % group:
            low = members // group * group
            near = f"{low} or {low + group}" if low else f"{group}"
            fault = f"is not a whole number of groups of {group}, which {self.kind} is made of here"
            faults.add("members", members, fault, f"give {near}")

    def to_dict(self) -> Any:
        """Convert to the form of a scene file: the name, or { name: settings } if a setting differs from its default."""
        values = {item.name: (getattr(self, item.name), item.default) for item in fields(self)}
        changed = {name: value for name, (value, default) in values.items() if value != default}
        return {self.kind: changed} if changed else self.kind


def inside(cube: np.ndarray) -> np.ndarray:
    """Levels clipped to the open interval (0, 1), in which quantiles are finite; read-only."""
    cube = np.clip(cube, 2.0**-54, 1.0 - 2.0**-53)
    cube.setflags(write=False)
    return np.asarray(cube)


def check_replicates(faults: Faults, replicates: Any) -> None:
    """Add a fault unless a number of replicates is a power of two from 1 to 64."""
    if not is_whole(replicates, 1, MOST_REPLICATES) or replicates & (replicates - 1):
        remark = f"is not a power of two from 1 to {MOST_REPLICATES}"
        faults.add("replicates", replicates, remark, "give 8, 16, 32 or 64")


@dataclass(frozen=True)
class Replicated(Sampling):
    """A design with R independent replicates: member i is point i // R of replicate i mod R.

    The replicates' estimates of a statistic are independent. Their spread gives the error of their mean, and so the
    intervals (L'Ecuyer, Nakayama, Owen & Tuffin 2023, Winter Simulation Conference).

    Args:
        replicates: Number R of replicates, a power of two from 1 to 64; 1 by default. The number of members must be a
            multiple of R.

    Raises:
        SceneError: If a setting is wrong. The message lists every fault.
    """

    replicates: int = field(default=1, kw_only=True)

    def __post_init__(self) -> None:
        R = self.replicates
        faults = Faults(f"ensemble.sampling.{self.kind}.")
        check_replicates(faults, R)
        self.check_own(faults)
        faults.raise_if_any()
        object.__setattr__(self, "replicates", int(R))

    def check_own(self, faults: Faults) -> None:
        """Add a fault for each wrong setting of a derived class; by default there are no further settings."""

    def replicates_of_members(self) -> int:
        return self.replicates

    def group_size(self, space: Space) -> int:
        # One point of each replicate, R members.
        return self.replicates

    def dealt(self, members: np.ndarray) -> Iterator[tuple[int, np.ndarray | slice, np.ndarray]]:
        """Assign members (n,) to replicates: number of each replicate, mask of its members, and indices of their points."""
        if self.replicates == 1:
            yield 0, slice(None), members
            return
        point, replicate = np.divmod(members, self.replicates)
        for r in np.unique(replicate):
            mask = replicate == r
            yield int(r), mask, point[mask]

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        levels = np.empty((len(members), space.dimensions))
        for replicate, mask, indices in self.dealt(members):
            levels[mask] = self.points(space, replicate, indices)
        return space.split(levels)

    def points(self, space: Space, replicate: int, indices: np.ndarray) -> np.ndarray:
        """Points (n, dimensions) of a replicate's sequence; a design without sequences overrides `draw` instead."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def name(self, replicate: int) -> str:
        """Name of a replicate's stream of random numbers: kind and number, from 0; with R = 1 only the kind."""
        return self.kind if self.replicates == 1 else f"{self.kind} {replicate}"
