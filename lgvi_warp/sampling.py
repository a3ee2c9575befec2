"""How the members' numbers are chosen: samplings of the unit cube, tables and grids.

A sampling gives any members by their indices, so that a member is the same in whatever run it is asked for, and alone.
Laws turn the cube's levels into values (distributions.py, joint_laws.py). The cube's columns are in the order of the names
that vary ("environment.gravity" before "vehicle.mass"), entries of a quantity one after the other.
"""

from __future__ import annotations

import copy
import csv
import functools
import hashlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.distributions import Choice, seed_words, uniforms_of
from lgvi_warp.errors import Faults
from lgvi_warp.variations import Space

# Of a Sobol sequence: a point is at the middle of one of 2^32 parts of each side, so that no level is 0 or 1.
SOBOL_BITS = 32
LARGEST_GROUP = 2**20
# A block has as many members, or a multiple: it holds as many points of each replicate.
MOST_REPLICATES = 64

Drawn = dict[str, np.ndarray]


@dataclass(frozen=True)
class Sampling:
    """How the unit cube is filled. Raises SceneError naming every fault."""

    kind: ClassVar[str] = ""

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Numbers in (0, 1) by key, each (n, size), of the members (n,) by index."""
        raise TypeError(f"{type(self).__name__} is abstract")

    def laws(self) -> dict[str, Any]:
        """Laws that the sampling itself brings, by name."""
        return {}

    def columns(self) -> dict[str, np.ndarray]:
        """Values of every member that the sampling itself brings, by name."""
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
        if own is not None and members != own:
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


@dataclass(frozen=True)
class Random(Sampling):
    """Every number by itself, from the seed, the member's index and the name. Members and names may be added."""

    kind: ClassVar[str] = "random"

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Philox counters keyed by seed and name, at the member's place."""
        return {
            key: uniforms_of(space.seed, key, members, size) for key, size in zip(space.keys, space.sizes, strict=True)
        }


def generator(space: Space, name: str) -> np.random.Generator:
    """Random numbers that depend on the seed and a name only."""
    return np.random.Generator(np.random.Philox(np.random.SeedSequence(seed_words(space.seed, name))))


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


@dataclass(frozen=True)
class LatinHypercube(Replicated):
    """Groups of `group` members, each a full Latin hypercube: every column has one member in each of `group` equal parts.

    Members are added group by group, and names may be added. group: 2 to 2^20; members must be a multiple of it. With
    replicates, as many groups are filled at once, a member of each in turn. McKay, Beckman & Conover (1979);
    scipy.stats.qmc.LatinHypercube.
    """

    group: int = 0
    kind: ClassVar[str] = "latin_hypercube"

    def check_own(self, faults: Faults) -> None:
        """The group must be stated."""
        group = self.group
        if isinstance(group, bool) or not isinstance(group, int | np.integer) or not 2 <= group <= LARGEST_GROUP:
            faults.add("group", group, f"is not a whole number from 2 to {LARGEST_GROUP}",
                       "give how many members make a hypercube: group = 256")  # fmt: skip

    def group_size(self, space: Space) -> int:
        """A hypercube for each replicate."""
        return int(self.group) * self.replicates

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """From the hypercube of each member's group; names by themselves, so that others do not change them."""
        R = self.replicates
        group, place = np.divmod(members, self.group * R)
        found = {}
        for key, size in zip(space.keys, space.sizes, strict=True):
            found[key] = np.empty((len(members), size))
            for g in np.unique(group):
                mine = group == g
                cubes = _hypercubes(space.seed, key, int(g) * R, R, int(self.group), size)
                found[key][mine] = cubes[place[mine]]
        return found


# A block of members lies in few groups: these are kept from one block to the next.
@functools.lru_cache(maxsize=64)
def _hypercubes(seed: int, key: str, first: int, number: int, size: int, columns: int) -> np.ndarray:
    """So many hypercubes from the first on, a point of each in turn: (size * number, columns)."""
    from scipy.stats import qmc

    cubes = np.empty((size, number, columns))
    for i in range(number):
        words = [*seed_words(seed, f"latin {key}"), first + i]
        rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(words)))
        cubes[:, i] = qmc.LatinHypercube(columns, rng=rng).random(size)
    return _inside(cubes.reshape(size * number, columns))


def _inside(cube: np.ndarray) -> np.ndarray:
    """The same within (0, 1), where quantiles are finite."""
    cube = np.clip(cube, 2.0**-54, 1.0 - 2.0**-53)
    cube.setflags(write=False)
    return np.asarray(cube)


@dataclass(frozen=True)
class Sobol(Replicated):
    """A scrambled Sobol sequence (linear matrix scramble and digital shift, scipy.stats.qmc.Sobol): member i is point i.

    Members may be added: powers of two are balanced. What varies is part of the design: another name, another sequence.
    At most 2^32 points. replicates: so many sequences, scrambled independently, a member of each in turn.
    """

    kind: ClassVar[str] = "sobol"

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Points by their indices."""
        found = np.empty((len(members), space.dimensions))
        for replicate, own, points in self.dealt(members):
            found[own] = sobol_points(space.seed, self.name(replicate), space.dimensions, points)
        return space.split(found)

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """There are 2^32 points."""
        super().check(faults, space, members)
        if members > self.replicates * 2**SOBOL_BITS:
            faults.add("members", members, f"are more than 2^{SOBOL_BITS} points", "use random sampling")


def sobol_points(seed: int, name: str, dimensions: int, indices: np.ndarray, scramble: bool = True) -> np.ndarray:
    """Points of a Sobol sequence in (0, 1), (n, dimensions), by their indices.

    A point is the exclusive or of one number for each bit of its index (and the first point): so any is had at once.
    """
    if not dimensions:
        return np.empty((len(indices), 0))
    bits = max(int(indices.max()).bit_length(), 1)
    bits = -(-bits // 4) * 4  # few distinct tables, however many members there come to be
    basis = _sobol_basis(seed, name, dimensions, min(bits, SOBOL_BITS), scramble)
    points = np.broadcast_to(basis[0], (len(indices), dimensions)).copy()
    for bit in range(min(bits, SOBOL_BITS)):
        points ^= np.where((indices >> bit & 1)[:, None] == 1, basis[bit + 1], np.uint64(0))
    return np.asarray((points.astype(np.float64) + 0.5) * 2.0**-SOBOL_BITS)


# Of every replicate, for a few numbers of bits.
@functools.lru_cache(maxsize=8 * MOST_REPLICATES)
def _sobol_basis(seed: int, name: str, dimensions: int, bits: int, scramble: bool) -> np.ndarray:
    """Point 0, and what each bit of an index changes in it: (bits + 1, dimensions), as whole numbers."""
    from scipy.stats import qmc

    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed_words(seed, name))))
    engine = qmc.Sobol(dimensions, scramble=scramble, bits=SOBOL_BITS, rng=rng)
    points, made = [], 0
    for index in (0, *(1 << bit for bit in range(bits))):
        if index > made:
            engine.fast_forward(index - made)
        points.append(engine.random(1)[0])
        made = index + 1
    whole = (np.array(points) * 2.0**SOBOL_BITS).astype(np.uint64)
    whole[1:] ^= whole[0]
    return whole


@dataclass(frozen=True)
class Halton(Replicated):
    """A scrambled Halton sequence (random permutations of digits, scipy.stats.qmc.Halton): member i is point i.

    Members may be added, any number of them. What varies is part of the design: another name, another sequence.
    replicates: so many sequences, scrambled independently, a member of each in turn.
    """

    kind: ClassVar[str] = "halton"

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """Points by their indices, neighbours together."""
        found = np.empty((len(members), space.dimensions))
        for replicate, own, wanted in self.dealt(members):
            ascending, place = np.unique(wanted, return_inverse=True)
            runs = np.split(ascending, np.flatnonzero(np.diff(ascending) > 1) + 1)
            points = np.concatenate([self._run(space, replicate, int(run[0]), len(run)) for run in runs])
            found[own] = _inside(points)[place.reshape(-1)]
        return space.split(found)

    def _run(self, space: Space, replicate: int, first: int, count: int) -> np.ndarray:
        if not space.dimensions:
            return np.empty((count, 0))
        engine = copy.copy(_halton(space.seed, self.name(replicate), space.dimensions))
        engine.num_generated = first
        return np.asarray(engine.random(count))


@functools.lru_cache(maxsize=2 * MOST_REPLICATES)
def _halton(seed: int, name: str, dimensions: int) -> Any:
    from scipy.stats import qmc

    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed_words(seed, name))))
    return qmc.Halton(dimensions, scramble=True, rng=rng)


@dataclass(frozen=True)
class Saltelli(Sampling):
    """The design for Sobol indices, in the order of SALib.sample.sobol: groups of 2 d + 2 members, or d + 2.

    d + 2: without second_order. d: factors, which are the entries that vary by themselves and each joint law. A group is a
    point A and a point B of one Sobol sequence, A with each factor of B, and B with each of A. Groups may be added; powers
    of two of them are balanced. Saltelli et al. (2010), Computer Physics Communications 181.
    """

    second_order: bool = True
    kind: ClassVar[str] = "saltelli"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.saltelli.")
        faults.choice("second_order", self.second_order, (True, False))
        faults.raise_if_any()

    def group_size(self, space: Space) -> int:
        """2 d + 2, or d + 2."""
        return (2 if self.second_order else 1) * len(space.factors) + 2

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """Something must vary."""
        if not space.factors:
            faults.add("sampling", self.kind, "has nothing that varies", "give [ensemble.vary]")
            return
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """A where a factor is of A, else B."""
        point, row = np.divmod(members, self.group_size(space))
        chosen, place = np.unique(point, return_inverse=True)
        D = space.dimensions
        AB = sobol_points(space.seed, "saltelli", 2 * D, chosen)[place.reshape(-1)]
        return space.split(np.where(self.rows(space)[row], AB[:, D:], AB[:, :D]))

    def rows(self, space: Space) -> np.ndarray:
        """(group, dimensions), whether a row of a group has its column from B."""
        own = np.zeros((len(space.factors), space.dimensions), dtype=bool)
        for number, (_, columns) in enumerate(space.factors):
            own[number, list(columns)] = True
        none = np.zeros((1, space.dimensions), dtype=bool)
        return np.concatenate([none, own, *([~own] if self.second_order else []), ~none])


@dataclass(frozen=True)
class Morris(Sampling):
    """The design of Morris' screening (SALib.sample.morris): paths of d + 1 members, each step moving one factor.

    levels: even, the parts of each side; a member is at the middle of a part, so that laws without bounds stay finite. Paths
    may be added. Morris (1991), Technometrics 33; Campolongo, Cariboni & Saltelli (2007). Needs SALib (extra: uq).
    """

    levels: int = 4
    kind: ClassVar[str] = "morris"

    def __post_init__(self) -> None:
        levels = self.levels
        faults = Faults("ensemble.sampling.morris.")
        if isinstance(levels, bool) or not isinstance(levels, int | np.integer) or levels < 4 or levels % 2:
            faults.add("levels", levels, "is not an even number from 4", "give 4, 6, 8 ...")
        faults.raise_if_any()

    def group_size(self, space: Space) -> int:
        """d + 1."""
        return len(space.factors) + 1

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """Something must vary."""
        if len(space.factors) < 2:
            faults.add("sampling", self.kind, f"has {len(space.factors)} factors to tell apart", "vary two or more")
            return
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """The middle of each part."""
        x = self.design(space, members)
        return space.split((x * (self.levels - 1) + 0.5) / self.levels)

    def design(self, space: Space, members: np.ndarray) -> np.ndarray:
        """SALib's numbers (n, dimensions): multiples of 1 / (levels - 1) from 0 to 1."""
        paths = int(members.max()) // self.group_size(space) + 1
        # A longer design begins with the shorter one; few lengths, for the cache.
        return _morris(space, int(self.levels), 1 << (paths - 1).bit_length())[members]


@functools.lru_cache(maxsize=8)
def _morris(space: Space, levels: int, paths: int) -> np.ndarray:
    try:
        from SALib.sample import morris
    except ImportError as error:
        raise ImportError("Morris' screening needs SALib: pip install 'lgvi-warp[uq]'") from error
    x = np.asarray(morris.sample(salib_problem(space), paths, num_levels=levels, seed=generator(space, "morris")))
    x.setflags(write=False)
    return x


def salib_problem(space: Space) -> dict[str, Any]:
    """The unit cube as SALib describes it: columns, and groups of them where a factor has several."""
    names = [
        label if len(columns) == 1 else f"{label} {i}" for label, columns in space.factors for i in range(len(columns))
    ]
    problem: dict[str, Any] = {"num_vars": len(names), "names": names, "bounds": [[0.0, 1.0]] * len(names)}
    if len(space.factors) < len(names):
        problem["groups"] = [label for label, columns in space.factors for _ in columns]
    return problem


@dataclass(frozen=True, eq=False)
class Grid(Sampling):
    """A full grid: every combination of the values of each name, the last name (in their order) fastest.

    axes: name -> a list of values (of an entry such as "start.position[2]", or of the whole quantity), or a number of levels:
    the middles of so many equal parts of the name's law in `vary`, for each of its entries. Names of `vary` that the grid does
    not have are drawn at random. The number of members follows. Raises SceneError naming every fault.
    """

    axes: Mapping[str, Any] = field(default_factory=dict)
    kind: ClassVar[str] = "grid"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.grid.")
        if not isinstance(self.axes, Mapping) or not self.axes:
            faults.add("axes", self.axes, "names nothing", 'write grid = { "vehicle.mass" = [100.0, 110.0] }')
            faults.raise_if_any()
        for name, axis in self.axes.items():
            if isinstance(axis, int | np.integer) and not isinstance(axis, bool):
                if axis < 1:
                    faults.add(f'"{name}"', axis, "is not a whole number from 1", "give a number of levels, or values")
                continue
            values = faults.finite(f'"{name}"', axis)
            if values is not None and (values.ndim == 0 or not len(values)):
                faults.add(f'"{name}"', axis, "is no list of values", "give [value, value, ...] or a number of levels")
        faults.raise_if_any()

    def laws(self) -> dict[str, Any]:
        """A choice among the values of each name that has them."""
        return {name: Choice(axis) for name, axis in self.axes.items() if not isinstance(axis, int | np.integer)}

    def _radices(self, space: Space) -> tuple[Space, np.ndarray]:
        """The cube's part that is a grid, and the levels of each of its columns."""
        inner = space.of(self.axes)
        numbers = []
        for key, size in zip(inner.keys, inner.sizes, strict=True):
            axis = self.axes[key]
            numbers += [int(axis) if isinstance(axis, int | np.integer) else len(axis)] * size
        return inner, np.array(numbers, dtype=np.int64)

    def own_members(self, space: Space) -> int:
        """Of all combinations."""
        numbers = [int(number) for number in self._radices(space)[1]]
        return functools.reduce(lambda a, b: a * b, numbers, 1)

    def check(self, faults: Faults, space: Space, members: int) -> None:
        """Every axis must vary something."""
        for name in self.axes:
            if name not in space.keys:
                what = "is a number of levels of what has no law"
                faults.add(
                    f'sampling.grid."{name}"', self.axes[name], what, "give it a law in vary, or a list of values"
                )
        super().check(faults, space, members)

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """The member's index as a number with these radices."""
        inner, radices = self._radices(space)
        places = np.ones(len(radices), dtype=np.int64)
        places[:-1] = np.cumprod(radices[:0:-1])[::-1]
        digits = members[:, None] // places % radices
        others = [key for key in space.keys if key not in self.axes]
        return inner.split((digits + 0.5) / radices) | Random().draw(space.of(others), members)

    def to_dict(self) -> Any:
        """As in a scene file."""
        return {self.kind: {name: np.asarray(axis).tolist() for name, axis in self.axes.items()}}


@dataclass(frozen=True, eq=False)
class Table(Sampling):
    """Members' own values: from a CSV file whose first line names the columns, or from arrays by name.

    file: its columns are numbers of the scene or entries of them, "vehicle.mass", "start.position[2]" (quote a name with a
    comma in it); values: name -> (n,) or (n, *shape). sha256: of the file as it must be, written by `to_dict`. Names of `vary`
    that the table does not have are drawn at random. The number of members is that of the lines; lines may be added.
    Raises SceneError naming every fault.
    """

    file: str | os.PathLike[str] | None = None
    values: Mapping[str, Any] | None = None
    sha256: str | None = None
    kind: ClassVar[str] = "table"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.table.")
        if isinstance(self.file, Mapping) and self.values is None:  # Table({...})
            object.__setattr__(self, "values", self.file)
            object.__setattr__(self, "file", None)
        if (self.file is None) == (self.values is None):
            faults.add("file", self.file, "is given beside values, or neither is", "give one of file and values")
            faults.raise_if_any()
        read = self._from_file(faults) if self.file is not None else self._from_values(faults)
        lengths = {len(column) for column in read.values()}
        if not faults and (len(lengths) != 1 or 0 in lengths):
            faults.add("values", sorted(lengths), "are the columns' lengths", "give columns of one length, 1 or more")
        faults.raise_if_any()
        object.__setattr__(self, "_columns", read)

    def _from_values(self, faults: Faults) -> dict[str, np.ndarray]:
        read = {}
        assert self.values is not None
        for name, column in self.values.items():
            array = faults.finite(f'"{name}"', column)
            if array is not None and array.ndim == 0:
                faults.add(f'"{name}"', column, "is no column", "give one value for each member")
            elif array is not None:
                read[name] = array
        return read

    def _from_file(self, faults: Faults) -> dict[str, np.ndarray]:
        assert self.file is not None
        path = Path(self.file)
        try:
            content = path.read_bytes()
            found = hashlib.sha256(content).hexdigest()
            if self.sha256 not in (None, found):
                faults.add(
                    "sha256", self.sha256, f"is not that of {path}, which has changed", "leave sha256 out to take it"
                )
            object.__setattr__(self, "sha256", found)
            lines = content.decode("utf-8-sig").splitlines()
            names = [name.strip() for name in next(csv.reader(lines[:1]))]
            numbers = np.loadtxt(lines[1:], delimiter=",", ndmin=2) if lines[1:] else np.empty((0, len(names)))
        except (OSError, UnicodeDecodeError, StopIteration, ValueError) as error:
            faults.add(
                "file",
                os.fspath(path),
                f"cannot be read ({error})",
                "give a CSV file: names in its first line, then numbers",
            )
            return {}
        if numbers.size and numbers.shape[1] != len(names):
            faults.add(
                "file", os.fspath(path), f"has {len(names)} names for {numbers.shape[1]} columns", "name every column"
            )
            return {}
        if len(set(names)) < len(names):
            faults.add("file", os.fspath(path), "names a column twice", "give each column a name of its own")
        if not np.all(np.isfinite(numbers)):
            line = int(np.argmin(np.isfinite(numbers).all(axis=1)))
            faults.add(
                "file", os.fspath(path), f"holds a number that is not finite (line {line + 2})", "mend that line"
            )
        return dict(zip(names, np.ascontiguousarray(numbers.T), strict=True)) if numbers.size else {}

    def columns(self) -> dict[str, np.ndarray]:
        """As read."""
        return dict(self._columns)  # type: ignore[attr-defined]

    def own_members(self, space: Space) -> int:
        """Lines."""
        return len(next(iter(self.columns().values())))

    def draw(self, space: Space, members: np.ndarray) -> Drawn:
        """At random, of what the table does not have."""
        return Random().draw(space, members)

    def to_dict(self) -> Any:
        """As in a scene file."""
        if self.file is not None:
            return {self.kind: {"file": os.path.abspath(self.file), "sha256": self.sha256}}
        return {self.kind: {"values": {name: column.tolist() for name, column in self.columns().items()}}}


@dataclass(frozen=True, eq=False)
class Levels(Sampling):
    """A design of your own: points (n, dimensions) in the open unit cube, whose columns are in the order of the names.

    `ensemble.space` says which column is what. The number of members is that of the points. Raises SceneError.
    """

    points: Any = None
    kind: ClassVar[str] = "levels"

    def __post_init__(self) -> None:
        faults = Faults("ensemble.sampling.levels.")
        array = faults.finite("points", self.points)
        if array is not None and (array.ndim != 2 or not len(array)):
            faults.add("points", array, f"has shape {array.shape}", "give an array of shape (members, dimensions)")
        elif array is not None and not np.all((array > 0.0) & (array < 1.0)):
            faults.add("points", array, "leaves the open unit cube", "give levels above 0 and below 1")
        faults.raise_if_any()
        object.__setattr__(self, "points", array)

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


KINDS: dict[str, type[Sampling]] = {
    one.kind: one for one in (Random, LatinHypercube, Sobol, Halton, Saltelli, Morris, Grid, Table, Levels)
}


def sampling_of(content: Any) -> Sampling:
    """A sampling from itself, its name, or { name = { ... } } as in a scene file. Raises SceneError naming every fault."""
    if isinstance(content, Sampling):
        return content
    faults = Faults("ensemble.")
    if isinstance(content, str):
        content = {content: {}}
    if not isinstance(content, Mapping) or len(content) != 1:
        remedy = 'write "sobol", or { latin_hypercube = { group = 256 } }'
        faults.add("sampling", content, "is not a sampling", remedy)
        faults.raise_if_any()
    kind, values = next(iter(content.items()))
    if kind not in KINDS:
        faults.choice("sampling", kind, KINDS)
    elif not isinstance(values, Mapping):
        faults.add(f"sampling.{kind}", values, "is not a table", f"write {{ {kind} = {{ ... }} }}")
    elif kind != "grid":
        faults.keys(f"sampling.{kind}", values, [item.name for item in fields(KINDS[kind])])
    faults.raise_if_any()
    return KINDS[kind](values) if kind == "grid" else KINDS[kind](**values)  # type: ignore[call-arg]
