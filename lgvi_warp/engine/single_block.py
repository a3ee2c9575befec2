# SPDX-License-Identifier: Apache-2.0
"""A run of few members as one block in the calling thread: no executor, no keepers, the same bits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.going_on import left_by
from lgvi_warp.engine.keepers.memory import empty_samples
from lgvi_warp.engine.outcome import MemberStatus
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.work import at_start, unpacked

Rows = dict[str, np.ndarray]


def fits(plan: Plan, blocks: Sequence[Block]) -> bool:
    """Whether a run can be made in one block, without a Python function and without data gathered at ticks."""
    return len(blocks) == 1 and not (
        plan.spec.tangents or plan.launches.has_callback or plan.launches.gathered or plan.layout.signals
    )


def run_single_block(
    plan: Plan, names: Sequence[str], warned: bool, advanced: Callable[[Block, int], None], final: bool = False
) -> tuple[dict[str, np.ndarray], MemberStatus, Rows]:
    """Advance all members; returns their samples (k, n, ...) by field, their outcome, and the final rows of packets.

    names: of the samples to keep. warned: whether warnings are evaluated. advanced: called with the vehicle-steps so far.
    final: whether to return the final rows of the packets; otherwise they are empty.
    """
    samples, packets = _advanced(plan, names, advanced, warned)
    with np.errstate(invalid="ignore", over="ignore"):
        outcome = packets.outcome(warned)
        rows = left_by(packets) if final else {}
    packets.leave()
    return samples, outcome, rows


def run_for_samples(plan: Plan) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """Advance all members; returns their samples, and their status (n,), or None if all reached the end."""
    samples, packets = _advanced(plan, plan.fields, lambda block, steps: None, False)
    status = None if packets.untroubled else packets.outcome(warned=False).status
    packets.leave()
    return samples, status


def _advanced(
    plan: Plan, names: Sequence[str], advanced: Callable[[Block, int], None], warned: bool
) -> tuple[dict[str, np.ndarray], Packets]:
    """Advance all members; returns their samples, and their packets at the end."""
    n = plan.ensemble.members
    block = Block(0, n)
    # As in `run_block`.
    with np.errstate(invalid="ignore", over="ignore"):
        members = plan.ensemble.select(0, n)
        plan.check_block(block, members)
        packets = Packets.of(plan, members)
        samples = empty_samples(plan, names, n)
        _keep(samples, slice(0, 1), at_start(plan, members, packets))
        for k0, k1 in plan.launches.segments(n):
            raw = packets.advance(k0, k1)[:, :n]
            when = slice(*plan.launches.samples_due(k0, k1))
            if when.start < when.stop and names:
                _keep(samples, when, unpacked(plan.layout.sizes, raw, packets.frame, plan.layout.table))
            if warned:
                packets.look_at_depth(k1, when, samples["position"][when] if "position" in samples else None)
            advanced(block, n * (k1 - plan.grid.first))
    return samples, packets


def _keep(samples: dict[str, np.ndarray], when: slice, values: Any) -> None:
    for name, place in samples.items():
        place[when] = values[name]
