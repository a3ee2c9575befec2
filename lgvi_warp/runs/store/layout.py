"""The arrays of a store and their chunks: every block of members is a column of chunks in each."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.engine.block import SHAPES, Block, blocks
from lgvi_warp.runs import member_fields
from lgvi_warp.runs.result import MEANINGS, UNITS

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan

# The dimension of members, and that of members that are kept after all: their coordinate is their index in the run.
MEMBER, KEPT_MEMBER = "realization", "member"
# The last dimensions of an array, by their sizes; others are named after the array.
TAILS = {(): (), (3,): ("component",), (3, 3): ("row", "column")}


class Chunking(Protocol):
    """What decides the chunks of a store: see Store, which has it."""

    @property
    def fields(self) -> Sequence[str] | None:
        """Samples that are kept; None: all."""

    @property
    def dtype(self) -> str | None:
        """Of samples; None: that of the run."""

    @property
    def chunk_bytes(self) -> int:
        """At most so many."""

    @property
    def along(self) -> str:
        """The dimension of members."""


@dataclass(frozen=True)
class Column:
    """One array of the store: (k, n, *tail), or (n, *tail) without times.

    length: members in a chunk, those of a block; times: samples in a chunk, 0 without times. along: the name of the
    members' dimension.
    """

    name: str
    tail: tuple[int, ...]
    dtype: str
    length: int
    times: int
    attributes: dict[str, Any]
    along: str = MEMBER

    @property
    def chunk(self) -> tuple[int, ...]:
        """Shape of a chunk."""
        return (*((self.times,) if self.times else ()), self.length, *self.tail)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions."""
        own = tuple(f"{self.name}_{i}" for i in range(len(self.tail)))
        return (*(("time",) if self.times else ()), self.along, *TAILS.get(self.tail, own))

    @property
    def fill(self) -> float | int:
        """What stands in a chunk beyond the last member or time."""
        return np.nan if np.dtype(self.dtype).kind == "f" else 0

    def shape(self, samples: int, members: int) -> tuple[int, ...]:
        """Of the whole array."""
        return (*((samples,) if self.times else ()), members, *self.tail)

    def key(self, block: Block, time: int = 0) -> str:
        """The chunk's file, below the store's root."""
        index = (*((time,) if self.times else ()), block.first // self.length, *(0,) * len(self.tail))
        return f"{self.name}/c." + ".".join(map(str, index))

    def keys(self, block: Block, samples: int) -> list[str]:
        """The block's chunks."""
        return [self.key(block, time) for time in range(-(-samples // self.times) if self.times else 1)]

    @property
    def bytes(self) -> int:
        """Of a chunk's file: its numbers and their checksum."""
        return int(np.prod(self.chunk)) * np.dtype(self.dtype).itemsize + 4


def columns(plan: Plan, store: Chunking) -> tuple[Column, ...]:
    """The arrays that a run of this plan fills, block by block, with the store's dtype, fields and size of chunks."""
    length = blocks(plan.ensemble.members)[0].count
    found = (
        *_samples(plan, length, store),
        Column(MEMBER, (), "<i8", length, 0, {"standard_name": "realization", "long_name": "member of the ensemble"}),
        *(Column(one.name, (), one.dtype, length, 0, one.attributes) for one in member_fields.present(plan)),
        *_parameters(plan, length),
    )
    return tuple(dataclasses.replace(one, along=store.along) for one in found)


def _samples(plan: Plan, length: int, store: Chunking) -> list[Column]:
    real = np.dtype(machine.DTYPES[plan.dtype])
    k = len(plan.grid.times)
    found = []
    for name in (name for name in plan.fields if store.fields is None or name in store.fields):
        own = np.dtype("f8") if plan.spec.compensated and name == "position" else real
        stored = np.dtype(store.dtype) if store.dtype else own
        row = length * int(np.prod(SHAPES[name])) * stored.itemsize
        # Equal chunks: the last of the times is nearly full as well.
        pieces = -(-k // max(1, store.chunk_bytes // row))
        attributes = {"units": UNITS[name], "long_name": MEANINGS[name]}
        found.append(Column(name, SHAPES[name], stored.newbyteorder("<").str, length, -(-k // pieces), attributes))
    return found


def _parameters(plan: Plan, length: int) -> list[Column]:
    ensemble = plan.ensemble
    one = ensemble.parameters(0, 1)
    units = parameter_units(ensemble.scene)
    return [
        Column(name, one[name].shape[1:], "<f8", length, 0, {"long_name": f"parameter {name}", "units": units[name]})
        for name in ensemble.varied()
    ]


def parameter_units(scene: Any) -> dict[str, str]:
    """Units of the scene's parameters, by name; "1" where none are known."""
    from lgvi_warp.physics import vehicle

    known = {f"vehicle.{name}": unit for name, unit in vehicle.UNITS.items()}
    known |= {"environment.gravity": "m s-2", "environment.water_density": "kg m-3"}
    for one in (*scene.terms, *scene.events):
        known |= {
            f"{one.key}.{item.name}": item.metadata["unit"]
            for item in dataclasses.fields(one)
            if "unit" in item.metadata
        }
    return {name: known.get(name) or "1" for name in scene.parameters()}


def size(plan: Plan, store: Chunking) -> int:
    """Bytes of the chunks of the whole run."""
    k, runs = len(plan.grid.times), len(blocks(plan.ensemble.members))
    each = sum(one.bytes * len(one.keys(Block(0, one.length), k)) for one in columns(plan, store))
    return each * runs
