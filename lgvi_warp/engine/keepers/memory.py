"""What a run keeps in memory: the outcome of every member, and every sample."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.engine.block import SHAPES, Block
from lgvi_warp.engine.outcome import Outcome
from lgvi_warp.engine.plan import Plan
from lgvi_warp.sampling.members import Members
from lgvi_warp.statistics.samples import Fields


class _Unsent:
    """A keeper of which other processes get the class alone: what it gathers stays where it is gathered."""

    def __getstate__(self) -> dict[str, Any]:
        return {}


class Outcomes(_Unsent):
    """What became of every member: `all`, of all n."""

    def __init__(self, plan: Plan):
        self.all = Outcome.clear(plan.ensemble.members, 2 if plan.method.adaptive else 0)

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockOutcome:
        """Nothing to prepare."""
        return _BlockOutcome()

    def merge(self, block: Block, part: Outcome) -> None:
        """Put a block's outcome into its place."""
        at = slice(block.first, block.stop)
        for field in dataclasses.fields(part):
            values = getattr(part, field.name)
            # Memory that nothing is written into is none: runs without faults have no outcomes to hold.
            if np.any(values):
                getattr(self.all, field.name)[at] = values


class _BlockOutcome:
    def take(self, when: slice, samples: Fields) -> None:
        """Samples say nothing about the outcome."""

    def close(self, outcome: Outcome) -> Outcome:
        """The outcome itself."""
        return outcome


class Samples(_Unsent):
    """Every sample of every member: fields (k, n, ...), which blocks in threads of this process write into.

    From other processes a block's samples come as its part.
    """

    fields: dict[str, np.ndarray] | None = None

    def __init__(self, plan: Plan, fields: Sequence[str] | None = None):
        self.names = tuple(plan.fields if fields is None else fields)
        self.fields = _empty(plan, self.names, plan.ensemble.members)

    @classmethod
    def elsewhere(cls, names: Sequence[str]) -> Samples:
        """As another process has it: each block's samples are its part."""
        made = cls.__new__(cls)
        made.names = tuple(names)
        return made

    def __getstate__(self) -> dict[str, Any]:
        return {"names": self.names}

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockSamples:
        """A view of the block's places, or places of its own far from them."""
        if self.fields is None:
            return _BlockSamples(_empty(plan, self.names, block.count), sent=True)
        return _BlockSamples({name: values[:, block.first : block.stop] for name, values in self.fields.items()})

    def merge(self, block: Block, part: dict[str, np.ndarray] | None) -> None:
        """The samples are in their places already, unless they were sent here."""
        assert self.fields is not None
        for name, values in (part or {}).items():
            self.fields[name][:, block.first : block.stop] = values


def _empty(plan: Plan, names: Sequence[str], members: int) -> dict[str, np.ndarray]:
    """Room for all samples of so many members."""
    k, real = len(plan.grid.times), machine.DTYPES[plan.dtype]
    fields = {name: np.empty((k, members, *SHAPES[name]), real) for name in names}
    if plan.spec.compensated and "position" in fields:
        fields["position"] = np.empty((k, members, 3))
    return fields


@dataclass
class _BlockSamples:
    places: dict[str, np.ndarray]
    sent: bool = False

    def take(self, when: slice, samples: Fields) -> None:
        """Put samples into their places."""
        for name, place in self.places.items():
            place[when] = samples[name]

    def close(self, outcome: Outcome) -> dict[str, np.ndarray] | None:
        """The samples, if they lie where only this process sees them."""
        return self.places if self.sent else None
