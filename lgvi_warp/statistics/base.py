"""What every statistic has: what it is of, its name, and how blocks' parts of it are made, joined and read."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import reduce
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, closest, shown
from lgvi_warp.statistics import intervals
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.estimate import Estimate
from lgvi_warp.statistics.functional import quantity
from lgvi_warp.statistics.quantity import Quantity, component
from lgvi_warp.statistics.tree import Part
from lgvi_warp.statistics.values import Values

STOPPED = ("held", "left_out")

# The types of a scene file.
TYPES: dict[str, type[Statistic]] = {}


class Gatherer:
    """What gathers a statistic of one block. Abstract."""

    def take(self, values: Values, when: slice) -> None:
        """Take in the values of these sample times: each time once, in order."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def end(self, ends: Ends, replicates: int) -> None:
        """Take in how and when the block's members ended, after the last sample; members are of so many replicates."""

    def close(self) -> Part:
        """The part of the block."""
        raise TypeError(f"{type(self).__name__} is abstract")


class Rows(Gatherer):
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
    at: an outcome ("floor", any event's name, "stopped"): the statistic is of the members that ended so, each in the state
    that it ended in, and has one row.

    Raises SceneError naming every fault.
    """

    type: ClassVar[str] = ""
    # Arrays of a part that have no row for each time.
    shared: ClassVar[frozenset[str]] = frozenset()
    # What it is of where nothing is said; None: it must be said.
    default: ClassVar[str | None] = None
    # Whether it is of numbers of members, one for each, whenever they are of.
    of_numbers: ClassVar[bool] = True
    # Whether it is of how members end, not of samples.
    of_ends: ClassVar[bool] = False

    of: Any = None
    name: str | None = field(default=None, kw_only=True)
    confidence: float = field(default=0.95, kw_only=True)
    stopped: str = field(default="held", kw_only=True)
    at: str | None = field(default=None, kw_only=True)

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls.type and cls.__module__.startswith(__package__):
            TYPES[cls.type] = cls

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
        if self.at is not None and (not isinstance(self.at, str) or not self.at):
            faults.add("at", self.at, "is no outcome", 'give "floor", the name of an event, or "stopped"')
        elif self.at is not None and not self.of_numbers:
            faults.add("at", self.at, "is one moment, and this is of all times", "leave it out, or ask for a mean")
        if self.of is not None:
            with faults.including():
                object.__setattr__(self, "_quantity", self.meant())
        self.check(faults)
        faults.raise_if_any()

    def __reduce__(self) -> tuple[Any, ...]:
        """Made anew in another process from what was said of it: functions are found by their names there."""
        return _made, (type(self), {one.name: getattr(self, one.name) for one in fields(self)})

    def check(self, faults: Faults) -> None:
        """Note what else is wrong."""

    def meant(self) -> Quantity:
        """The quantity that `of` means. Raises SceneError."""
        return quantity(f"{self.type}.of", self.of)

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
        return self.name or f"{self.type} {self.quantity.name}{self.at_text}"

    @property
    def at_text(self) -> str:
        """What comes last in its name: " at floor"."""
        return "" if self.at is None else f" at {self.at}"

    @property
    def at_end(self) -> bool:
        """Whether it is gathered when it is known how the members of a block ended."""
        return self.of_ends or self.at is not None

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of the outcomes that it is of."""
        return () if self.at is None else (self.at,)

    def at_ends(self, ends: Ends, last: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """Its numbers (1, d, n) at the members' ends, and which count (1, n).

        last: (1, d, n), its quantity at the last sample: where a stopped member stands from its event on.
        """
        assert self.at is not None and last is not None
        return last, ends.are(self.at)[None]

    def over(self, time: np.ndarray) -> Statistic:
        """The statistic for a run of these sample times (k,) [s], where that makes a difference."""
        return self

    def parts(self) -> tuple[Statistic, ...]:
        """The statistics that its estimates are of: itself, or those of what it makes of each member's path."""
        return (self,)

    def open(self, time: np.ndarray, count: int) -> Gatherer:
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


def from_list(given: Any, key: str = "statistics", *, whole: bool = True) -> tuple[Statistic, ...]:
    """Statistics from tables of a scene file or Statistic objects. Raises SceneError naming every fault.

    whole: each must say what it is of, and have a name of its own.
    """
    if isinstance(given, str | Mapping | Statistic) or not isinstance(given, Sequence):
        example = 'write [[run.statistics]] and type = "mean" below, or statistics=[lw.Mean("position")]'
        raise SceneError([f"{key} = {shown(given)}: is no list; {example}"])
    faults, found = Faults(), list[Statistic]()
    for i, one in enumerate(given):
        with faults.including():
            found.append(_one(f"{key}[{i}]", one))
    if whole and not faults:
        names: list[str] = []
        for one in found:
            with faults.including():
                names += [part.key for part in one.parts()]
        for name in sorted({name for name in names if names.count(name) > 1}):
            faults.add(
                key, name, f"is the name of {names.count(name)} statistics", "give each a name of its own: name=..."
            )
    faults.raise_if_any()
    return tuple(found)


def _one(where: str, given: Any) -> Statistic:
    """A statistic from its table, or as it is. Raises SceneError naming every fault."""
    if isinstance(given, Statistic):
        return given
    if not isinstance(given, Mapping):
        raise SceneError(
            [f'{where} = {shown(given)}: is no statistic; write type = "mean", or give lw.Mean("position")']
        )
    word = given.get("type", "")
    kind = TYPES.get(word) if isinstance(word, str) else None
    if kind is None:
        raise SceneError([f"{where}.type = {shown(word)}: is not known; {closest(str(word), TYPES)}"])
    faults = Faults()
    table = {name: value for name, value in given.items() if name != "type"}
    faults.keys(where, table, [one.name for one in dataclasses.fields(kind)])
    faults.raise_if_any()
    try:
        return kind(**table)
    except SceneError as error:
        raise error.prefixed(f"{where}: ") from None
