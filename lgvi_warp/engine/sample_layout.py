# SPDX-License-Identifier: Apache-2.0
"""Layout of samples and of gathered ticks in the kernel: fields of the motion, then signals of the controller."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from lgvi_kernels.advance.noting import ASKED_NOTES, NOTED, bit
from lgvi_kernels.advance.rows import SAMPLE_FIELDS
from lgvi_warp.control.signals import ENERGY_USED, NAVIGATION_ERROR, SIGNALS, row_of, saved_fields
from lgvi_warp.engine.kernel_choice import KernelChoice
from lgvi_warp.physics.fields import Field

# Stands for the row of the energy used, which is known once the laws are packed.
ACCOUNT_ROW = -1


@dataclass(frozen=True, eq=False)
class SampleLayout:
    """Position of each number in a sample.

    fields: in the order in which they are saved. compensated: whether a position consists of two numbers.
    read_at_ticks: numbers that statistics read at ticks by field of the motion, () for all; None: all of all fields.
    """

    choice: KernelChoice
    fields: tuple[str, ...]
    compensated: bool
    read_at_ticks: Mapping[str, tuple[int, ...]] | None

    @functools.cached_property
    def table(self) -> dict[str, Field]:
        """The fields that the run may save, by name."""
        return saved_fields(self.choice.controller, self.choice.account is not None)

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals among the fields: those of the controller, and the energy used."""
        return tuple(name for name in self.fields if name in SIGNALS)

    @functools.cached_property
    def sizes(self) -> dict[str, int]:
        """Numbers per sample that the kernel writes, by field: of saved fields, and of fields from which others follow.

        Returns: Numbers per sample by field, in order; a compensated position is b, then b_low. Signals come last.
        """
        needed = {*self.fields, *(("position",) if NAVIGATION_ERROR in self.fields else ())}
        if self.choice.moved:
            needed |= {"attitude"} if "position" in needed else set()
            needed |= {"angular_velocity"} if "velocity" in needed else set()
        numbers = {name: size for name, size in SAMPLE_FIELDS.items() if name in needed}
        if self.compensated and "position" in numbers:
            numbers["position"] = 6
        return numbers | {name: math.prod(self.table[name].shape) for name in self.signals}

    @functools.cached_property
    def tick_fields(self) -> dict[str, int]:
        """Number of values of each field that the kernel gathers at a tick, in the user's axes.

        All values of a signal are gathered, as in samples.
        """
        entries = self.tick_entries
        return {name: len(entries.get(name, ())) or size for name, size in self.sizes.items() if self._reads(name)}

    @functools.cached_property
    def tick_entries(self) -> dict[str, tuple[int, ...]]:
        """For fields of the motion that are gathered only partly at ticks: indices of the gathered numbers by field."""
        entries = {name: numbers for name, numbers in (self.read_at_ticks or {}).items() if numbers}
        if self.compensated or NAVIGATION_ERROR in self.fields:  # a place is a pair of sums, or taken off whole
            entries.pop("position", None)
        return entries

    def _reads(self, name: str) -> bool:
        """Whether a field is gathered at ticks: a signal always, the motion if a statistic or Python function reads it."""
        if name == "position" and NAVIGATION_ERROR in self.fields:
            return True
        return name in self.fields and (name in SIGNALS or self.read_at_ticks is None or name in self.read_at_ticks)

    @property
    def noted_bits(self) -> int:
        """Bits of the signals that ticks record (see noting.py): the saved ones, and all if a Python function controls."""
        noted = [signal for name in self.signals if (signal := SIGNALS[name]).group in NOTED]
        return sum({bit(signal.group, signal.row) for signal in noted}) | ASKED_NOTES * self.choice.has_callback

    @functools.cached_property
    def noted_rows(self) -> dict[str, range]:
        """Rows of the memory that ticks write, by their name in NOTED."""
        controller = self.choice.controller
        if controller is None:
            return {}
        firsts = accumulate(NOTED.values(), initial=controller.bus.rows)
        return {name: range(first, first + size) for (name, size), first in zip(NOTED.items(), firsts, strict=False)}

    @functools.cached_property
    def signal_rows(self) -> tuple[int, ...]:
        """Rows of the memory that are saved with each sample, for one signal after the other."""
        controller = self.choice.controller
        bus: Any = None if controller is None else controller.bus
        noted = {name: rows.start for name, rows in self.noted_rows.items()}

        def begin(name: str) -> int:
            return ACCOUNT_ROW if name == ENERGY_USED else row_of(name, bus, noted)

        begins = ((begin(name), self.sizes[name]) for name in self.signals)
        return tuple(row + i for row, size in begins for i in range(size))
