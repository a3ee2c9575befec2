"""What a run keeps in memory: the outcome of every member, and every sample."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lgvi_warp import machine
from lgvi_warp.blocks import SHAPES, Block, Fields
from lgvi_warp.ensemble import Members
from lgvi_warp.packets import Outcome
from lgvi_warp.plan import Plan


class Outcomes:
    """What became of every member: the fields of Outcome, of all n."""

    def __init__(self, plan: Plan):
        n = plan.ensemble.members
        self.status, self.failed_step, self.failed_size = np.zeros(n, np.uint8), np.zeros(n, np.int64), np.zeros(n)
        self.chosen = np.zeros((n, 2 if plan.method.adaptive else 0), np.int64)
        self.warnings, self.warning_step = np.zeros(n, np.uint16), np.zeros(n, np.int64)
        self.warning_value, self.substeps = np.zeros(n), np.zeros(n, np.int64)

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockOutcome:
        """Nothing to prepare."""
        return _BlockOutcome()

    def merge(self, block: Block, part: Outcome) -> None:
        """Put a block's outcome into its place."""
        at = slice(block.first, block.stop)
        for field in dataclasses.fields(part):
            getattr(self, field.name)[at] = getattr(part, field.name)


class _BlockOutcome:
    def take(self, when: slice, samples: Fields) -> None:
        """Samples say nothing about the outcome."""

    def close(self, outcome: Outcome) -> Outcome:
        """The outcome itself."""
        return outcome


class Samples:
    """Every sample of every member: fields (k, n, ...), which blocks in threads of one process write into."""

    def __init__(self, plan: Plan, fields: Sequence[str] | None = None):
        n, k = plan.ensemble.members, len(plan.grid.times)
        real = machine.DTYPES[plan.dtype]
        names = plan.fields if fields is None else fields
        self.fields = {name: np.empty((k, n, *SHAPES[name]), real) for name in names}
        if plan.spec.compensated and "position" in self.fields:
            self.fields["position"] = np.empty((k, n, 3))

    def open(self, plan: Plan, block: Block, members: Members) -> _BlockSamples:
        """A view of the block's places."""
        return _BlockSamples({name: values[:, block.first : block.stop] for name, values in self.fields.items()})

    def merge(self, block: Block, part: None) -> None:
        """The samples are in their places already."""


@dataclass
class _BlockSamples:
    places: dict[str, np.ndarray]

    def take(self, when: slice, samples: Fields) -> None:
        """Put samples into their places."""
        for name, place in self.places.items():
            place[when] = samples[name]

    def close(self, outcome: Outcome) -> None:
        """Nothing is left to do."""
