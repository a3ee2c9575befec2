"""What every statistic has: what it is of, its name, and how blocks' parts of it are made, joined and read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import reduce
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.errors import Faults, SceneError
from lgvi_warp.statistics import intervals
from lgvi_warp.statistics.estimate import Estimate
from lgvi_warp.statistics.quantity import Quantity, component, quantity
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values

STOPPED = ("held", "left_out")


class Rows:
    """Of a block: one row of each array for each sample time, made when the samples come."""

    def __init__(self, statistic: Statistic):
        self._statistic, self._rows = statistic, list[Part]()

    def take(self, values: Values, when: slice) -> None:
        """Make the rows of these times."""
        self._rows.append(self._statistic.rows(values))

    def close(self) -> Part:
        """The rows of all times."""
        first = self._rows[0]
        shared = self._statistic.shared
        return {
            key: first[key] if key in shared else np.concatenate([rows[key] for rows in self._rows]) for key in first
        }


@dataclass(frozen=True, eq=False)
class Statistic:
    """A statistic over members, at every sample time.

    of: a quantity (see lw.Quantity): "position", "position[2]", "depth", "speed", "euler[0]", "energy", ..., a function of
    (samples, members), or a list of these taken together. name: what the result calls it, by default its type and
    what it is of. confidence: of its intervals. stopped: whether a member that an event stopped counts with the state that
    it stopped in ("held"), or not from then on ("left_out"). Members that failed are left out from their failure on.

    Raises SceneError naming every fault.
    """

    type: ClassVar[str] = ""
    # Arrays of a part that have no row for each time.
    shared: ClassVar[frozenset[str]] = frozenset()
    # What it is of where nothing is said; None: it must be said.
    default: ClassVar[str | None] = None

    of: Any = None
    name: str | None = field(default=None, kw_only=True)
    confidence: float = field(default=0.95, kw_only=True)
    stopped: str = field(default="held", kw_only=True)

    def __post_init__(self) -> None:
        faults = Faults(f"{self.type}.")
        if self.of is None and self.default is not None:
            object.__setattr__(self, "of", self.default)
        level = faults.number("confidence", self.confidence, "1")
        if level is not None and not 0.0 < level < 1.0:
            faults.add("confidence", self.confidence, "is not between 0 and 1", "give 0.95")
        faults.choice("stopped", self.stopped, STOPPED)
        if self.name is not None and not isinstance(self.name, str):
            faults.add("name", self.name, "is not a text", "give a text, or leave it out")
        if self.of is not None:
            with faults.including():
                object.__setattr__(self, "_quantity", quantity(f"{self.type}.of", self.of))
        self.check(faults)
        faults.raise_if_any()

    def __reduce__(self) -> tuple[Any, ...]:
        """Made anew in another process from what was said of it: functions are found by their names there."""
        return _made, (type(self), {one.name: getattr(self, one.name) for one in fields(self)})

    def check(self, faults: Faults) -> None:
        """Note what else is wrong."""

    @property
    def quantity(self) -> Quantity:
        """What it is of. Raises SceneError where nothing was said."""
        found: Quantity | None = getattr(self, "_quantity", None)
        if found is None:
            raise SceneError(
                [f"{self.type}.of = None: is missing; say what it is of: lw.{type(self).__name__}('depth')"]
            )
        return found

    @property
    def key(self) -> str:
        """What the result calls it."""
        return self.name or f"{self.type} {self.quantity.name}"

    def parts(self) -> tuple[Statistic, ...]:
        """The statistics that its estimates are of: itself, or those of what it makes of each member's path."""
        return (self,)

    def open(self, time: np.ndarray, count: int) -> Any:
        """What gathers a block of `count` members over all sample times (k,) [s]."""
        return Rows(self)

    def rows(self, values: Values) -> Part:
        """Arrays with one row for each time of the values."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def join(self, left: Part, right: Part, place: tuple[int, int]) -> Part:
        """Of two runs of blocks, of both; place: level and number in the tree of blocks."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def whole(self, parts: Sequence[Part]) -> Part:
        """Of everything, from parts in the order of the blocks, the later ones of fewer members."""
        return reduce(lambda right, left: self.join(left, right, (-1, 0)), reversed(parts))

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """The statistic and its interval at each time (k,) [s]."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def estimates(self, parts: Sequence[Part], time: np.ndarray) -> list[Estimate]:
        """What it says."""
        return [self.read(self.whole(parts), time)]

    # Members of R replicates: each array of a part then has R rows for one, those of a time side by side.

    def of_replicate(self, part: Part, replicate: int, replicates: int) -> Part:
        """The part of one replicate's members."""
        return {key: a if key in self.shared else a[replicate::replicates] for key, a in part.items()}

    def each_replicate(self, parts: Sequence[Part], replicates: int) -> list[list[Part]]:
        """The parts of each replicate's members."""
        return [[self.of_replicate(part, r, replicates) for part in parts] for r in range(replicates)]

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        """What it says where members are of so many independent replicates: values of all, intervals from their spread."""
        each = self.each_replicate(parts, replicates)
        (whole,) = self.estimates(together(each), time)
        return [self.spread(whole, [self.estimates(own, time)[0] for own in each])]

    def spread(self, whole: Estimate, each: Sequence[Estimate]) -> Estimate:
        """The estimate of all members with the interval that the replicates' estimates give: Student's t."""
        error, half = intervals.of_replicates(np.stack([one.value for one in each]), self.confidence)
        found = {"lower": whole.value - half, "upper": whole.value + half}
        found |= {"standard_error": error} if "standard_error" in whole.arrays else {}
        return whole.with_interval(f"Student's t of {len(each)} replicates", found)

    def to_dict(self) -> dict[str, Any]:
        """As in a scene file: type, of, and what differs from the defaults; a function by its name."""
        content: dict[str, Any] = {"type": self.type}
        for one in fields(self):
            value = getattr(self, one.name)
            default = None if one.default is MISSING else one.default
            if value is not None and plain(value) != plain(default):
                content[one.name] = plain(value)
        return content

    def alone(self, i: int) -> Quantity:
        """One component of what it is of."""
        return component(self.quantity, i)


def together(each: Sequence[Sequence[Part]]) -> list[Part]:
    """The parts of all replicates, in the order of the blocks."""
    return [part for parts in zip(*each, strict=True) for part in parts]


def _made(kind: type[Statistic], given: dict[str, Any]) -> Statistic:
    return kind(**given)


def plain(value: Any) -> Any:
    """A value as TOML and JSON have it."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, Statistic):
        return value.to_dict()
    if isinstance(value, Quantity):
        return value.name
    return getattr(value, "__name__", type(value).__name__) if callable(value) else value
