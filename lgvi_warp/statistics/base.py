# SPDX-License-Identifier: Apache-2.0
"""The base class of all statistics, and their tables in scene files.

A block of members is reduced to a part: named arrays that summarise these members. Parts of blocks are joined pairwise
(see `tree`), and the joined parts are read as estimates. Shapes: k sample times, d components of a quantity, n members,
R replicates of a sampling design.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import partial, reduce
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common import registry
from lgvi_warp.common.arguments import explained, items_of
from lgvi_warp.common.documented import Documented
from lgvi_warp.common.errors import Faults, SceneError, closest, refusal
from lgvi_warp.common.real_numbers import settle, settles_first
from lgvi_warp.statistics.ends import Ends
from lgvi_warp.statistics.estimates import intervals
from lgvi_warp.statistics.estimates.estimate import Estimate
from lgvi_warp.statistics.estimates.tree import Part
from lgvi_warp.statistics.values.functional import Functional, over_path, quantity
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.statistics.values.values import Values
from lgvi_warp.statistics.weighted import Weighted, both_measures, is_weighted

STOPPED = ("held", "left_out")

# Statistics by their type in a scene file; each class adds itself.
TYPES = registry.Kinds(
    "lgvi_warp.statistics",
    {
        "moments": ("mean", "covariance"),
        "angles": ("circular_mean", "mean_attitude"),
        "counts": ("histogram", "exceedance"),
        "passages": ("first_passage",),
        "paths.member_values": ("each",),
        "metrics.tracking_metrics": (
            *("overshoot", "undershoot", "peak_time", "peak", "rise_time", "settling_time", "steady_state_error"),
            *("max_error", "cross_track", "iae", "ise", "itae", "rms"),
        ),
        "metrics.nearest": ("nearest",),
        "metrics.navigation_error": ("navigation",),
        "metrics.dock_contact": ("dock_contact",),
        "metrics.actuator_metrics": (
            *("effort", "travel", "saturation_share", "energy", "electrical_energy", "time_to_failure", "own_metric"),
        ),
        "order": ("extremes", "quantiles"),
        "outcomes": ("outcome", "end_time"),
        "paths.path": ("path_maximum", "path_minimum", "path_range", "path_mean", "path_rms", "path_time"),
    },
    "statistics",
)


class Gatherer:
    """Reduces the samples of one block of members to a part. Abstract."""

    def take(self, values: Values, when: slice) -> None:
        """Process a quantity of the block's members at some of the run's sample times; each time comes once, in order."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def end(self, ends: Ends, replicates: int) -> None:
        """Process the ends of the block's members, after the last sample; member i belongs to replicate i mod R."""

    def close(self) -> Part:
        """Return the part that summarises the block."""
        raise TypeError(f"{type(self).__name__} is abstract")


class RowGatherer(Gatherer):
    """Gathers one row of each array for each sample time, as samples arrive."""

    def __init__(self, statistic: Statistic):
        self._statistic, self._rows = statistic, list[Part]()

    def take(self, values: Values, when: slice) -> None:
        self._rows.append(self._statistic.rows_of_any(values))

    def close(self) -> Part:
        first = self._rows[0]
        shared = self._statistic.shared
        joined = {key: np.concatenate([rows[key] for rows in self._rows]) for key in first.keys() - shared}
        return {key: joined.get(key, first[key]) for key in first}


@explained
@dataclass(frozen=True, eq=False)
class Statistic(Documented):
    """A statistic over members at every sample time. Abstract.

    A member that fails is left out after its failure.

    Args:
        of: A quantity, such as "depth" or "position[2]", a function of (samples, members), or a list of these
            (see lw.statistics.Quantity).
        name: Key of the estimate in the result; by default the type and the quantity, as in "mean position".
        confidence: Confidence level of the intervals, between 0 and 1; by default 0.95.
        stopped: After an event stopped a member, "held" (default) counts the member with its last state; "left_out"
            omits the member.
        at: An outcome, such as "floor": the statistic is over the members with this outcome, in their final state.
            None, the default: the statistic is over all members, at each sample time.

    Raises:
        SceneError: if arguments are faulty; the message lists all faults.
    """

    type: ClassVar[str] = ""
    # Names of a part's arrays that are the same for all sample times.
    shared: ClassVar[frozenset[str]] = frozenset()
    # Names of a part's arrays that parts of an earlier version lack; these cannot be read.
    since: ClassVar[frozenset[str]] = frozenset()
    # Value of `of` where none is given; None: it must be given.
    default: ClassVar[str | None] = None
    # Whether it reads one number of each member at one time, so that it can follow a path or an end.
    of_numbers: ClassVar[bool] = True
    # Whether it reads how members end instead of samples.
    of_ends: ClassVar[bool] = False
    # Whether it takes the samples at all ticks of a controller, and not only those that are kept.
    ticks: ClassVar[bool] = False
    # Whether it is of what a controller tracks, which some guidance has to want.
    tracks: ClassVar[bool] = False

    of: Any = None
    name: str | None = field(default=None, kw_only=True)
    confidence: float = field(default=0.95, kw_only=True)
    stopped: str = field(default="held", kw_only=True)
    at: str | None = field(default=None, kw_only=True)

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        settles_first(cls)
        if cls.type:
            cls.__doc__ = with_arguments(cls)
        if cls.__module__.startswith(__package__.partition(".")[0]):
            explained(cls)
        registry.add(TYPES, cls)

    def __post_init__(self) -> None:
        settle(self)
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
            faults.add("at", self.at, "is not an outcome", 'give "floor", the name of an event, or "stopped"')
        elif self.at is not None and not self.of_numbers:
            fault = "is one moment, and this statistic is of all times"
            faults.add("at", self.at, fault, "leave it out, or ask for a mean")
        if self.of is not None:
            with faults.including():
                object.__setattr__(self, "_quantity", self.meant())
                if self.path is not None:
                    self.check_one_number(faults, "", self.path.label)
        self.check(faults)
        faults.raise_if_any()

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle only the arguments: the other process builds the statistic again, and finds functions by name."""
        return partial(type(self), **{argument.name: getattr(self, argument.name) for argument in fields(self)}), ()

    def check(self, faults: Faults) -> None:
        """Add faults in the arguments that the class defines."""

    def meant(self) -> Quantity:
        """Return the quantity that `of` names; SceneError if there is none."""
        return quantity(f"{self.type}.of", self.of)

    @property
    def quantity(self) -> Quantity:
        """The quantity of the statistic; SceneError if `of` was not given."""
        meaning: Quantity | None = getattr(self, "_quantity", None)
        if meaning is None:
            door = "metrics" if self.ticks else "statistics"
            remedy = f"say what it is of: lw.{door}.{type(self).__name__}('depth')"
            raise refusal(f"{self.type}.of", None, "is missing", remedy)
        return meaning

    @property
    def path(self) -> Functional | None:
        """The expression of the statistic, if it reduces the members' paths; else None."""
        return over_path(self.quantity)

    def check_one_number(self, faults: Faults, where: str, number: str) -> None:
        """Add a fault if the statistic cannot be taken of one number of each member.

        where: place of the statistic, such as "then[0].".
        number: text of the number, such as "a path_maximum".
        """
        if not self.of_numbers:
            remark = f"is of samples in time, and {number} is one number of each member"
            faults.add(f"{where}type", self.type, remark, "ask for its mean, quantiles, or an exceedance")
        elif self.at is not None:
            faults.add(f"{where}at", self.at, f"says when, and {number} has no time", "leave it out")

    @property
    def key(self) -> str:
        """The name of the estimate in the result."""
        return self.name or f"{self.type} {self.quantity.name}{self.at_text}"

    @property
    def at_text(self) -> str:
        """The end of the name with the outcome: " at floor", or ""."""
        return "" if self.at is None else f" at {self.at}"

    @property
    def at_end(self) -> bool:
        """True if it is gathered only when the ends of a block's members are known."""
        return self.of_ends or self.at is not None

    @property
    def outcomes(self) -> tuple[str, ...]:
        """Names of the outcomes that the statistic refers to."""
        return () if self.at is None else (self.at,)

    def at_ends(self, ends: Ends, last: np.ndarray | None) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the numbers (1, d, n) from the members' ends, and a mask (1, n) of members that count; None if all do.

        last: (1, d, n), the quantity at the last sample time, at which a stopped member holds its state; None if not
            needed.
        """
        assert self.at is not None
        assert last is not None
        return last, ends.are(self.at)[None]

    def over(self, time: np.ndarray) -> Statistic:
        """Return the statistic with the settings that depend on the run's sample times (k,) [s]."""
        return self

    def parts(self) -> tuple[Statistic, ...]:
        """Return the statistics of its estimates: itself, or those in `then`."""
        return (self,)

    def open(self, time: np.ndarray, count: int) -> Gatherer:
        """Return the object that gathers one block of `count` members over all sample times (k,) [s] of the run."""
        return RowGatherer(self)

    def rows(self, values: Values) -> Part:
        """Return the part of a block at some sample times: arrays with one row for each time."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def rows_of_any(self, values: Values) -> Part:
        """Return `rows`; for weighted members, sums under the weights and under their squares (see Weighted)."""
        if values.weight is None:
            return self.rows(values)
        return self.weighted_rows(values)

    def weighted_rows(self, values: Values) -> Part:
        """Return the part of weighted members."""
        return both_measures(self.rows(values.under(1)), self.rows(values.under(2)), values.count)

    def join_any(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        """Return `join`, also of weighted members."""
        if not is_weighted(first):
            return self.join(first, second, place)
        return self.weighted_join(first, second, place)

    def weighted_join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        """Return the joined part of two sets of weighted members."""
        a, b = Weighted.of(first), Weighted.of(second)
        own, squares = self.join(a.own, b.own, place), self.join(a.squares, b.squares, place)
        return both_measures(own, squares, a.members + b.members)

    def read_any(self, part: Part, time: np.ndarray) -> Estimate:
        """Return `read`, also of weighted members."""
        if not is_weighted(part):
            return self.read(part, time)
        weighted = Weighted.of(part)
        return weighted.with_effective(self.weighted_read(weighted, time))

    def weighted_read(self, weighted: Weighted, time: np.ndarray) -> Estimate:
        """Return the statistic of weighted members with its interval."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def join(self, first: Part, second: Part, place: tuple[int, int]) -> Part:
        """Return the joined part of two neighbouring sets of members.

        place: (level, index) of the joined part in the tree of blocks; (-1, 0) outside the tree.
        """
        raise TypeError(f"{type(self).__name__} is abstract")

    def whole(self, parts: Sequence[Part]) -> Part:
        """Return the part of all members from parts in the order of the blocks; later parts have fewer members."""
        return reduce(lambda second, first: self.join_any(first, second, (-1, 0)), reversed(parts))

    def read(self, part: Part, time: np.ndarray) -> Estimate:
        """Return the statistic with its interval at each sample time (k,) [s], from the part of all members."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def estimates(self, parts: Sequence[Part], time: np.ndarray) -> list[Estimate]:
        """Return the estimates of `self.parts()` for independent members, from parts in the order of the blocks."""
        return [self.read_any(self.whole(parts), time)]

    # With R replicates each array of a part has R rows for each sample time, side by side.

    def of_replicate(self, part: Part, replicate: int, replicates: int) -> Part:
        """Return the part of the members of one replicate, counted from 0."""
        return {key: a if key in self.shared else a[replicate::replicates] for key, a in part.items()}

    def each_replicate(self, parts: Sequence[Part], replicates: int) -> list[list[Part]]:
        """Return, for each replicate, the parts of its members."""
        return [[self.of_replicate(part, r, replicates) for part in parts] for r in range(replicates)]

    def estimates_of_replicates(self, parts: Sequence[Part], time: np.ndarray, replicates: int) -> list[Estimate]:
        """Return the estimates of a run of independent replicates, with intervals from the replicates' spread."""
        each = self.each_replicate(parts, replicates)
        (overall,) = self.estimates(together(each), time)
        return [self.spread(overall, [self.estimates(replicate_parts, time)[0] for replicate_parts in each])]

    def spread(self, pooled: Estimate, each: Sequence[Estimate]) -> Estimate:
        """Return the estimate of all members, with Student's t interval from the replicates' estimates."""
        error, half = intervals.of_replicates(np.stack([replicate.value for replicate in each]), self.confidence)
        arrays = {"lower": pooled.value - half, "upper": pooled.value + half}
        arrays |= {"standard_error": error} if "standard_error" in pooled.arrays else {}
        return pooled.with_interval(f"Student's t of {len(each)} replicates", arrays)

    def to_dict(self) -> dict[str, Any]:
        """Return the table in a scene file: type, `of`, and settings that differ from the defaults; functions by name."""
        content: dict[str, Any] = {"type": self.type}
        for argument in fields(self):
            value = getattr(self, argument.name)
            default = None if argument.default is MISSING else argument.default
            if value is not None and as_toml(value) != as_toml(default):
                content[argument.name] = as_toml(value)
        return content


def together(each: Sequence[Sequence[Part]]) -> list[Part]:
    """Return the parts of all replicates in the order of the blocks."""
    return [part for parts in zip(*each, strict=True) for part in parts]


def as_toml(value: Any) -> Any:
    """Convert a value for TOML and JSON: lists for arrays, tables for statistics, names for functions."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [as_toml(item) for item in value]
    if isinstance(value, Statistic):
        return value.to_dict()
    if isinstance(value, Quantity):
        return value.name
    return getattr(value, "__name__", type(value).__name__) if callable(value) else value


def from_list(entries: Any, key: str = "statistics", *, unique_names: bool = True) -> tuple[Statistic, ...]:
    """Return statistics from tables of a scene file, from `Statistic` objects, or from a mix of both."""
    listed = items_of(entries)
    if listed is None:
        example = 'write [[run.statistics]] and type = "mean" below, or statistics=[lw.statistics.Mean("position")]'
        raise refusal(key, entries, "is not a list", example)
    faults, statistics = Faults(), list[Statistic]()
    for i, entry in enumerate(listed):
        with faults.including():
            statistics.append(from_table(f"{key}[{i}]", entry))
    if unique_names and not faults:
        names: list[str] = []
        for statistic in statistics:
            with faults.including():
                names += [inner.key for inner in statistic.parts()]
        for name in sorted({name for name in names if names.count(name) > 1}):
            fault = f"is the name of {names.count(name)} statistics"
            faults.add(key, name, fault, "give each a name of its own: name=...")
    faults.raise_if_any()
    return tuple(statistics)


def from_table(where: str, entry: Any) -> Statistic:
    """Return the statistic of a table, or the statistic itself."""
    if isinstance(entry, Statistic):
        return entry
    if not isinstance(entry, Mapping):
        raise refusal(where, entry, "is not a statistic", 'write type = "mean", or give lw.statistics.Mean("position")')
    word = entry.get("type", "")
    kind = TYPES.get(word) if isinstance(word, str) else None
    if kind is None:
        raise refusal(f"{where}.type", word, "is not known", closest(str(word), TYPES))
    faults = Faults()
    table = {name: value for name, value in entry.items() if name != "type"}
    faults.keys(where, table, [argument.name for argument in dataclasses.fields(kind)])
    faults.raise_if_any()
    try:
        return kind(**table)
    except SceneError as error:
        raise error.prefixed(f"{where}: ") from None


def with_arguments(kind: type) -> str | None:
    """The docstring of a class, with the arguments of its bases before its own."""
    if kind.__doc__ is None:
        return None
    blocks = inspect.cleandoc(kind.__doc__).split("\n\n")
    entries: dict[str, str] = {}
    for text in (*(base.__doc__ or "" for base in reversed(kind.__mro__[1:])), "\n\n".join(blocks)):
        for block in inspect.cleandoc(text).split("\n\n"):
            if block.startswith("Args:\n"):
                entries |= {entry.partition(":")[0]: entry for entry in re.split(r"\n    (?=\w)", block[5:])[1:]}
    rest = [block for block in blocks if not block.startswith("Args:\n")]
    place = next((i for i, block in enumerate(rest) if block.startswith(("Raises:", "Examples:"))), len(rest))
    return "\n\n".join([*rest[:place], "\n    ".join(["Args:", *entries.values()]), *rest[place:]])
