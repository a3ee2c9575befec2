# SPDX-License-Identifier: Apache-2.0
"""Members that are restarted in some lanes between two ticks, while the other members continue."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.engine.host_callback import CallbackInput, last_tick, write_answer
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.plan import Plan
from lgvi_warp.sampling.members import Members


class Episodes:
    """One block of members, each of which may be replaced by a new member after a tick; `steps` counts the steps done.

    New members are packed and evaluated in advance, many at once, in separate packets. To start one, its lane is copied. So a
    start costs little and changes no bit of the other members.
    """

    def __init__(self, plan: Plan, members: Members):
        assert plan.launches.has_callback
        assert plan.kernel_choice.controller is not None
        self.plan, self.packets, self.steps = plan, Packets(plan, members), 0
        self._controller = plan.kernel_choice.controller
        self.every = self._controller.every(plan.grid.h)
        # Packets by the number of their members, for a while.
        self._aside: dict[int, Packets] = {}
        self.begin(members)

    def begin(self, members: Members) -> None:
        """Start all members at t = 0, and discard prepared members."""
        self.packets.refill(members)
        self.packets.launch(0, 0)
        self.steps = 0
        self._lanes = _lanes_of(self.packets)
        # The others hold what all members share.
        width = self.plan.spec.width
        self._varied = [len(each) == self.packets.count and each.shape[-1] == width for each in self._lanes]
        self._next: Packets | None = None
        self._next_lanes: list[np.ndarray] = []

    def advance(self, values: np.ndarray) -> None:
        """Set the demands (m, 6) or commands (m, channels) of the last tick, and advance to the next tick."""
        write_answer(self.packets, values)
        self.packets.launch(self.steps, self.steps + self.every)
        self.steps += self.every

    def signals(self) -> tuple[CallbackInput, CallbackInput]:
        """The present (measured, wanted) values."""
        return last_tick(self.packets)

    def status(self) -> np.ndarray:
        """The status of each member (m,), 0 for members under way."""
        if not self.packets.status.numpy().any():
            return np.zeros(self.packets.members.count, np.uint8)
        return self.packets.ended()[0]

    def room_for(self, count: int) -> int:
        """Number of members to draw for `count` prepared ones: rounded up to few sizes, since packets are kept for each."""
        width = self.plan.spec.width
        return width << (-(-count // width) - 1).bit_length()

    def prepare(self, lanes: np.ndarray, members: Members) -> None:
        """Prepare the members that will start next in some lanes (r,) of the m lanes."""
        aside = self._aside_for(members.count, lambda count: members)
        aside.refill(members)
        if aside.laws.places != self.packets.laws.places:
            problem = "has members that remember more or fewer numbers than others, such as a delay that varies"
            raise refusal("fleet", "", problem, "let the same number of periods or ticks serve all members")
        aside.launch(0, 0)
        if self._next is None:
            self._next = Packets(self.plan, self.packets.members)
            self._next_lanes = _lanes_of(self._next)
        self._copy(_lanes_of(aside), np.arange(len(lanes)), self._next_lanes, lanes)

    def restart(self, lanes: np.ndarray) -> tuple[CallbackInput, CallbackInput]:
        """Start the prepared members.

        lanes: Indices (r,) among the m lanes. Returns: (measured, wanted) values of these members, (r, ...).
        """
        assert self._next is not None
        rehearsals = self._rehearsals()
        if not rehearsals:
            self._copy(self._next_lanes, lanes, self._lanes, lanes)
            return last_tick(self._next, lanes)
        places = np.arange(len(lanes))
        aside = self._aside_for(self.room_for(len(lanes)), self._any)
        self._copy(self._next_lanes, lanes, _lanes_of(aside), places)
        for k in rehearsals:
            aside.launch(k, k)
        self._copy(_lanes_of(aside), places, self._lanes, lanes)
        return last_tick(aside, places)

    def signals_of(self, lanes: np.ndarray) -> tuple[CallbackInput, CallbackInput]:
        """Measured and wanted values of ended members in their last state; the block itself no longer computes them.

        lanes: Indices (r,) among the m lanes. Returns: (measured, wanted) values, (r, ...).
        """
        places = np.arange(len(lanes))
        aside = self._aside_for(self.room_for(len(lanes)), self._any)
        self._copy(self._lanes, lanes, _lanes_of(aside), places)
        aside.status.zero_()
        aside.launch(self.steps, self.steps)
        return last_tick(aside, places)

    def _aside_for(self, count: int, members: Callable[[int], Members]) -> Packets:
        """Separate packets for `count` members."""
        if count not in self._aside:
            self._aside[count] = Packets(self.plan, members(count))
        return self._aside[count]

    def _any(self, count: int) -> Members:
        """Any `count` members of the run."""
        chosen = np.arange(count) % self.plan.ensemble.members
        return self.plan.ensemble.subset(chosen).select(0, count)

    def _rehearsals(self) -> range:
        """Further steps at which new members are evaluated, as needed by delayed readings and time-dependent guidance."""
        parts = (*self._controller.sensors, *self._controller.guidance)
        ticks = max((part.ticks_before for part in parts), default=0)
        last = self.steps // self.every
        return range(max(1, last + 1 - ticks) * self.every, self.steps + 1, self.every)

    def _copy(
        self, source: list[np.ndarray], source_lanes: np.ndarray, target: list[np.ndarray], target_lanes: np.ndarray
    ) -> None:
        """Copy lanes with all their data."""
        width = self.plan.spec.width
        p, i = np.divmod(source_lanes, width)
        q, j = np.divmod(target_lanes, width)
        for old, new, varied in zip(source, target, self._varied, strict=True):
            if varied:
                new[q, ..., j] = old[p, ..., i]


def _lanes_of(packets: Packets) -> list[np.ndarray]:
    """Arrays with numbers of lanes, (packets, ..., width), or (1, ..., width or 1) for numbers that members share."""
    laws = packets.laws
    lanes = [leaf for each in (packets.inertia, *laws.structs) for leaf in _leaves(each.view)]
    lanes += [each.view for each in (laws.table, laws.memory, packets.state_lanes)]
    return lanes + [each.numpy() for each in (packets.status, packets.failed_step, packets.failed_size)]


def _leaves(view: Any) -> Iterator[np.ndarray]:
    """The lanes in an array of structs."""
    for name in view.dtype.names or ():
        yield from _leaves(view[name])
    if not view.dtype.names and view.ndim > 1:
        yield view
