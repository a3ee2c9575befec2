# SPDX-License-Identifier: Apache-2.0
"""The gate of a filter: which numbers it rejects, and what it does after many rejections in a row."""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import any_positive
from lgvi_kernels.law import *
from lgvi_warp.extensions.navigation.device.covariance import widened

# Sensors that a filter may have, in the order of the counts. Places of the first innovation of each but the first.
AIDS = ("dvl", "fix", "delayed_fix", "depth", "heading")
FIX, DELAYED_FIX, DEPTH, HEADING, SLOTS = 4, 7, 10, 11, 12


def gate_fields(width, real):
    """Fields of the filter's struct: gates of the sensors [sigma] and their mean squares; rows.

    most: rejections in a row. runs: first of twelve rows of the memory, from its first on, and of five counts behind them;
    rejected: first of five of the bus, which has these counts.
    """
    names = (f"{role}_{word}" for role in AIDS for word in ("gate", "share"))
    return dict.fromkeys((*names, "most_rejected"), lane(width, real)) | dict.fromkeys(("runs", "rejected"), wp.int32)


@wp.func
def chosen(kind: int, a: Any, b: Any, c: Any, d: Any, e: Any):
    """The number of a sensor."""
    v = a
    if kind == 1:
        v = b
    if kind == 2:
        v = c
    if kind == 3:
        v = d
    if kind == 4:
        v = e
    return v


def make_gate(reports):
    """(y, p, slot, innovation, seen, r, new): the function that decides which lanes take a number."""

    @wp.func
    def gate(y: Any, p: Any, slot: int, innovation: Any, seen: Any, r: Any, new: Any):
        """(kept, seen, share): the lanes that take the number, h P h, and the mean square of what passes, in variances.

        After `most_rejected` rejections in a row it takes one, once the covariance is so wide that the gate lets it pass.
        """
        kind = int(0)
        if slot >= wp.static(FIX):
            kind = 1
        if slot >= wp.static(DELAYED_FIX):
            kind = 2
        if slot >= wp.static(DEPTH):
            kind = 3
        if slot >= wp.static(HEADING):
            kind = 4
        unity = ones(r)
        zero = unity - unity
        half = unity.dtype(0.5) * unity
        width = chosen(kind, p.dvl_gate, p.fix_gate, p.delayed_fix_gate, p.depth_gate, p.heading_gate)
        share = chosen(kind, p.dvl_share, p.fix_share, p.delayed_fix_share, p.depth_share, p.heading_share)
        limit = width * width
        beyond = positive(new, positive(innovation * innovation - limit * (seen + r), unity, zero), zero)
        row = p.memory + p.runs + slot
        run = remembered(y, row)
        tired = positive(seen, positive(run + half - p.most_rejected, beyond, zero), zero)
        factor = unity
        if any_positive(tired):
            known = positive(tired, seen, unity)
            factor = positive(tired, (innovation * innovation / limit - r) / known, unity)
            widened(y.memory, y.packet, p.memory + p.covariance, p.memory + p.work, p.size, known, factor)
        lost = positive(tired, zero, beyond)
        kept = positive(lost, zero, new)
        remember(y, row, positive(lost, run + unity, positive(new, zero, run)))
        if wp.static(reports):
            # Counted in the filter's memory, which a tick that measures for the notes alone puts back.
            own = p.memory + p.runs + wp.static(SLOTS) + kind
            count = remembered(y, own) + lost
            remember(y, own, count)
            remember(y, p.rejected + kind, count)
        return kept, factor * seen, share

    return gate
