"""What every sampling is, and designs that may be drawn several times."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.common.random import seed_words
from lgvi_warp.sampling.designs.space import Space

# A block has as many members, or a multiple: it holds as many points of each replicate.
MOST_REPLICATES = 64

Drawn = dict[str, np.ndarray]


@dataclass(frozen=True)
class Sampling:
    """How the unit cube is filled. Raises SceneError naming every fault."""

    kind: ClassVar[str] = ""
    # Whether the first so many of the members that it has may be taken.
    fewer: ClassVar[bool] = False

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Numbers in (0, 1) by key, each (n, size), of the members (n,) by index."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def laws(self) -> dict[str, Any]:
        """Laws that the sampling itself brings, by name."""
        return {}

    def own_values(self) -> dict[str, np.ndarray]:
        """Values of every member that the sampling itself brings, by name."""
        return {}

    def arrays(self) -> dict[str, np.ndarray]:
        """What it was given as arrays, by name, a row for each member: a store keeps them as such."""
        return {}

    def own_members(self, space: Space) -> int | None:
        """How many members it has, if that follows from itself."""
        return None

    def group_size(self, space: Space) -> int:
        """Members come in whole groups of so many."""
        return 1

    def replicates_of_members(self) -> int:
        """Independent replicates of the design, R: member i is point i // R of replicate i mod R. 1: it has none."""
        return 1

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """Note what is wrong with a number of members or with what varies."""
        own, group = self.own_members(space), self.group_size(space)
        if own is not None and self.fewer and members > own:
            what = f"are more than the {own} of the {self.kind}"
            faults.add("members", members, what, f"give {own} or less, or leave members out")
        elif own is not None and not self.fewer and members != own:
            faults.add("members", members, f"is not the {own} of the {self.kind}", f"give {own}, or leave members out")
        elif members % group:
            low = members // group * group
            near = f"{low} or {low + group}" if low else f"{group}"
            what = f"is no whole number of groups of {group}, which {self.kind} is made of here"
            faults.add("members", members, what, f"give {near}")

    def to_dict(self) -> Any:
        """As in a scene file: the name, or { name = { ... } }."""
        values = {
            item.name: getattr(self, item.name) for item in fields(self) if getattr(self, item.name) != item.default
        }
        return {self.kind: values} if values else self.kind


def generator(space: Space, name: str) -> np.random.Generator:
    """Random numbers that depend on the seed and a name only."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed_words(space.seed, name))))


def inside(cube: np.ndarray) -> np.ndarray:
    """The same within (0, 1), where quantiles are finite."""
    cube = np.clip(cube, 2.0**-54, 1.0 - 2.0**-53)
    cube.setflags(write=False)
    return np.asarray(cube)


@dataclass(frozen=True)
class Replicated(Sampling):
    """A design that may be drawn R times, independently: member i is point i // R of replicate i mod R.

    replicates: R, a power of two from 1 to 64; members must be a multiple of it. Each replicate's estimate of a statistic
    is independent of the others', and their spread is the error of their mean: intervals then follow from it (L'Ecuyer,
    Nakayama, Owen & Tuffin 2023, Winter Simulation Conference). Raises SceneError.
    """

    replicates: int = field(default=1, kw_only=True)

    def __post_init__(self) -> None:
        R = self.replicates
        faults = Faults(f"ensemble.sampling.{self.kind}.")
        whole = isinstance(R, int | np.integer) and not isinstance(R, bool)
        if not whole or not 1 <= R <= MOST_REPLICATES or R & (R - 1):
            faults.add("replicates", R, f"is no power of two from 1 to {MOST_REPLICATES}", "give 8, 16, 32 or 64")
        self.check_own(faults)
        faults.raise_if_any()
        object.__setattr__(self, "replicates", int(R))

    def check_own(self, faults: Faults) -> None:
        """Note what is wrong with its other settings."""

    def replicates_of_members(self) -> int:
        """As given."""
        return self.replicates

    def group_size(self, space: Space) -> int:
        """One point of each replicate."""
        return self.replicates

    def dealt(self, members: np.ndarray) -> Iterator[tuple[int, np.ndarray | slice, np.ndarray]]:
        """(replicate, which of the members are its own, the indices of their points) of each that has any."""
        if self.replicates == 1:
            yield 0, slice(None), members
            return
        point, replicate = np.divmod(members, self.replicates)
        for r in np.unique(replicate):
            own = replicate == r
            yield int(r), own, point[own]

    def name(self, replicate: int) -> str:
        """What the replicate's random numbers are drawn by; one alone is the design without replicates."""
        return self.kind if self.replicates == 1 else f"{self.kind} {replicate}"
