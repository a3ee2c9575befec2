# SPDX-License-Identifier: Apache-2.0
"""Keepers that hold their results in memory: the outcome of every member, and every sample."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.outcome import MemberStatus
from lgvi_warp.engine.plan import Plan
from lgvi_warp.sampling.members import Members
from lgvi_warp.statistics.values.samples import Fields


class Outcomes:
    """Keeps the outcome of every member, in the run's own process; it is pickled without its contents."""

    def __init__(self, plan: Plan):
        self.all = MemberStatus.clear(plan.ensemble.members, 2 if plan.method.adaptive else 0)

    def __getstate__(self) -> dict[str, Any]:
        return {}

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockOutcome:
        """The keeper of a block's outcome."""
        return _BlockOutcome()

    def merge(self, block: Block, part: MemberStatus) -> None:
        """Copy a block's outcome into its place."""
        if block.count == len(self.all.status):
            self.all = part
            return
        at = slice(block.first, block.stop)
        for field in dataclasses.fields(part):
            values = getattr(part, field.name)
            # Untouched pages of zeros take no memory, so runs without faults need none for their outcomes.
            if np.any(values):
                getattr(self.all, field.name)[at] = values


class _BlockOutcome:
    def take(self, when: slice, samples: Fields) -> None:
        """Ignore the samples, which do not affect the outcome."""

    def close(self, outcome: MemberStatus) -> MemberStatus:
        """Return the outcome unchanged."""
        return outcome


class Samples:
    """Keeps every sample of every member, by name (k times, n members, ...); threads of this process write into it.

    Other processes return a block's samples as its result; there `fields` is None. names: None for those of the plan.
    """

    fields: dict[str, np.ndarray] | None = None

    def __init__(self, plan: Plan, fields: Sequence[str] | None = None):
        self.names = tuple(plan.fields if fields is None else fields)
        self.fields = empty_samples(plan, self.names, plan.ensemble.members)

    @classmethod
    def elsewhere(cls, names: Sequence[str]) -> Samples:
        """The keeper for another process, without memory for all members."""
        samples = cls.__new__(cls)
        samples.names = tuple(names)
        return samples

    def __getstate__(self) -> dict[str, Any]:
        return {"names": self.names}

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockSamples:
        """The keeper of a block's samples."""
        if self.fields is None:
            return _BlockSamples(empty_samples(plan, self.names, block.count), sent=True)
        return _BlockSamples({name: values[:, block.first : block.stop] for name, values in self.fields.items()})

    def merge(self, block: Block, part: dict[str, np.ndarray] | None) -> None:
        """Copy samples (k, members of the block, ...) from another process; None if they are already in their places."""
        assert self.fields is not None
        for name, values in (part or {}).items():
            self.fields[name][:, block.first : block.stop] = values


def empty_samples(plan: Plan, names: Sequence[str], members: int) -> dict[str, np.ndarray]:
    """Uninitialised arrays for all samples of this many members, by field."""
    k, real = len(plan.grid.times), machine.DTYPES[plan.dtype]
    fields = {name: np.empty((k, members, *plan.layout.table[name].shape), real) for name in names}
    if plan.spec.compensated and "position" in fields:
        fields["position"] = np.empty((k, members, 3))
    return fields


@dataclass
class _BlockSamples:
    places: dict[str, np.ndarray]
    sent: bool = False

    def take(self, when: slice, samples: Fields) -> None:
        """Write the samples into their places."""
        for name, place in self.places.items():
            place[when] = samples[name]

    def close(self, outcome: MemberStatus) -> dict[str, np.ndarray] | None:
        """Return the samples if only this process has them, else None."""
        return self.places if self.sent else None
