# SPDX-License-Identifier: Apache-2.0
"""The arrays of a store and their chunks: in each array, a block of members is one column of chunks."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.control.signals import SIGNALS
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.physics.fields import dims_of
from lgvi_warp.results import member_fields
from lgvi_warp.scene.start import Start

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan

# Dimension of the members of a run, and that of kept members, whose coordinate is their index in the run.
MEMBER, KEPT_MEMBER = "realization", "member"

# Array of the members' weights.
WEIGHT = "weight"


class Chunking(Protocol):
    """The settings of a `Store` that determine its chunks."""

    @property
    def fields(self) -> Sequence[str] | None:
        """Names of the fields whose samples are stored; None: all."""

    @property
    def dtype(self) -> str | None:
        """Number type of the stored samples; None: the type of the run."""

    @property
    def chunk_bytes(self) -> int:
        """Approximate largest size of a chunk [bytes]."""

    @property
    def along(self) -> str:
        """Name of the dimension of members."""


@dataclass(frozen=True)
class StoreArray:
    """One array of a store, of shape (k, n, *tail), or (n, *tail) without times.

    tail: Shape of one member's value at one time.
    dtype: NumPy's type string.
    length: Members in a chunk, as many as in a block.
    times: Samples in a chunk; 0 for an array without times.
    along: Name of the dimension of members.
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
        """Shape of one chunk of the array."""
        return (*((self.times,) if self.times else ()), self.length, *self.tail)

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the array's dimensions."""
        return (*(("time",) if self.times else ()), self.along, *dims_of(self.name, self.tail))

    @property
    def fill(self) -> float | int:
        """Value of a chunk's entries beyond the last member or time."""
        return np.nan if np.dtype(self.dtype).kind == "f" else 0

    def shape(self, samples: int, members: int) -> tuple[int, ...]:
        """Return the shape of the whole array: (k, n, *tail), or (n, *tail) without times."""
        return (*((samples,) if self.times else ()), members, *self.tail)

    def key(self, block: Block, time: int = 0) -> str:
        """Return the path of a chunk's file."""
        index = (*((time,) if self.times else ()), block.first // self.length, *(0,) * len(self.tail))
        return f"{self.name}/c." + ".".join(map(str, index))

    def keys(self, block: Block, samples: int) -> list[str]:
        """Return the paths of all chunks of a block."""
        return [self.key(block, time) for time in range(-(-samples // self.times) if self.times else 1)]

    @property
    def bytes(self) -> int:
        """Size of a chunk's file [bytes]: its numbers and their checksum."""
        return int(np.prod(self.chunk)) * np.dtype(self.dtype).itemsize + 4


def columns(plan: Plan, store: Chunking) -> tuple[StoreArray, ...]:
    """List the arrays that a run fills block by block."""
    length = blocks(plan.ensemble.members)[0].count
    index = {"standard_name": "realization", "long_name": "member of the ensemble"}
    arrays = (
        *_samples(plan, length, store),
        StoreArray(MEMBER, (), "<i8", length, 0, index),
        *(StoreArray(item.name, (), item.dtype, length, 0, item.attributes) for item in member_fields.present(plan)),
        *_parameters(plan, length),
    )
    if plan.ensemble.weights(0, 1) is not None:
        about = {"long_name": "what the member counts for in statistics", "units": "1"}
        arrays = (*arrays, StoreArray(WEIGHT, (), "<f8", length, 0, about))
    return tuple(dataclasses.replace(column, along=store.along) for column in arrays)


def _samples(plan: Plan, length: int, store: Chunking) -> list[StoreArray]:
    real = np.dtype(machine.DTYPES[plan.dtype])
    k = len(plan.grid.times)
    arrays = []
    for name in (name for name in plan.fields if store.fields is None or name in store.fields):
        computed = np.dtype("f8") if plan.spec.compensated and name == "position" else real
        field = plan.layout.table[name]
        stored = np.dtype(store.dtype) if store.dtype else computed
        row = length * int(np.prod(field.shape)) * stored.itemsize
        # Chunks of equal length along the times, so that the last one is nearly full as well.
        pieces = -(-k // max(1, store.chunk_bytes // row))
        kind = stored.newbyteorder("<").str
        arrays.append(StoreArray(name, field.shape, kind, length, -(-k // pieces), field.attributes))
    return arrays


def _parameters(plan: Plan, length: int) -> list[StoreArray]:
    ensemble = plan.ensemble
    first = ensemble.parameters(0, 1)
    units = parameter_units(ensemble.scene)
    arrays = []
    for name in ensemble.varied():
        attributes = {"long_name": f"parameter {name}", "units": units[name]}
        arrays.append(StoreArray(name, first[name].shape[1:], "<f8", length, 0, attributes))
    for name, values in ensemble.starts(0, 1).items():
        attributes = {"long_name": f"{name} of the member", "units": units[name]}
        arrays.append(StoreArray(name, values.shape[1:], "<f8", length, 0, attributes))
    return arrays


def units_of_numbers(scene: Any, names: Iterable[str]) -> dict[str, str]:
    """Look up the units of a scene's numbers and of their entries, such as "drag.linear[0]"; "1" if unknown."""
    known, units = parameter_units(scene), {}
    for name in names:
        base, _, entry = name.rstrip("]").partition("[")
        # Of six entries "N s/m, N m s" has the unit of three forces and of three moments.
        parts = known.get(base, "1").split(", ")
        units[name] = parts[int(entry) // 3] if entry.isdigit() and len(parts) == 2 else ", ".join(parts)
    return units


def parameter_units(scene: Any) -> dict[str, str]:
    """Look up the units of a scene's parameters and of its start."""
    from lgvi_warp.physics import vehicle
    from lgvi_warp.physics.terms.base import word_of

    def unit(item: Any) -> str | None:
        found: str | None = item.metadata.get("unit") or item.metadata.get("arguments", {}).get("unit")
        return found

    known: dict[str, str | None] = {f"vehicle.{name}": unit for name, unit in vehicle.UNITS.items()}
    known |= {"environment.gravity": "m s-2", "environment.water_density": "kg m-3"}
    for term in (*scene.parts, *([scene.controller] if scene.controller else [])):
        known |= {f"{term.key}.{word_of(item)}": unit(item) for item in dataclasses.fields(term)}
        # Numbers of a sensor are in the unit of what it reads.
        of = SIGNALS.get(f"measured_{getattr(term, 'of', '')}")
        known |= {name: word.replace("unit", of.field.unit, 1) for name, word in known.items()
                  if of and word and word.startswith("unit") and name.startswith(f"{term.key}.")}  # fmt: skip
    units = {name: known.get(name) or "1" for name in scene.parameters()}
    return units | {f"start.{item.name}": unit(item) or "1" for item in dataclasses.fields(Start)}


def size(plan: Plan, store: Chunking) -> int:
    """Compute the size of all chunks of a run [bytes]."""
    k, runs = len(plan.grid.times), len(blocks(plan.ensemble.members))
    each = sum(column.bytes * len(column.keys(Block(0, column.length), k)) for column in columns(plan, store))
    return each * runs
