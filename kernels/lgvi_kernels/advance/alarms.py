# SPDX-License-Identifier: Apache-2.0
"""What follows from a step's alarms: which lanes fail, whether a step is made again in parts, and where a lane rests."""

from typing import Any

import warp as wp

from lgvi_kernels.advance.events import FIRST
from lgvi_kernels.advance.gathering import make_signals
from lgvi_kernels.advance.retry import make_retry
from lgvi_kernels.advance.rows import make_rows
from lgvi_kernels.advance.spec import make_types
from lgvi_kernels.advance.stepping import make_stepping
from lgvi_kernels.advance.watching import make_watching
from lgvi_kernels.lanes.arithmetic import add, any_positive, mul, ones, sub  # noqa: F401
from lgvi_kernels.lanes.packet import failures, turned_too_far
from lgvi_kernels.lanes.sums import choose

# Where every step is a sample, steps between two looks at the energy: this is how late a failure may be seen.
SINGLE_LOOKS = 8


def make_examined(spec):
    """(state, codes) after a chunk, of the lanes that were not frozen before; a single step without solution is divided."""
    types, real, width = make_types(spec), spec.real, spec.width
    State, Constants, Monitor, Lane = types.State, types.Constants, types.Monitor, types.Lane
    energy_alarm, retried = make_watching(spec).energy_alarm, make_retry(spec).retried
    turned, energetic, substepped = spec.turned, spec.energy, spec.substep

    @wp.func(inline=True)
    def examined(good: State, x: State, c: Constants, monitor: Monitor, k: int, n: int, singles: int, last: int, h: wp.float64,
                 stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), opening: real, frozen: Lane,
                 suspects: Lane):  # fmt: skip
        """good: before the steps k to k + n; singles: steps that are made again; last: that of the last sample."""
        if wp.static(turned):
            x.alarm = turned_too_far(x.alarm)
        if wp.static(energetic):
            if singles > 0:
                # In a chunk that is made again, only the lanes whose alarm made it necessary are looked at.
                x.alarm = energy_alarm(x, c, monitor, k + n, h, opening, suspects)
            elif n > 1 or (k + n) % wp.static(SINGLE_LOOKS) == 0 or k + n == last:
                x.alarm = energy_alarm(x, c, monitor, k + n, h, opening, ones(frozen) - frozen)
        code = failures(x, frozen)
        if wp.static(substepped):
            if n == 1 and any_positive(code):
                code_whole = code
                x, code = retried(good, x, code_whole, c, k, h, stage_h, lead_h, opening)
                for j in range(wp.static(width)):
                    if code[j] != code_whole[j]:
                        monitor.substeps[c.packet][j] = monitor.substeps[c.packet][j] + 1
                        x.alarm.size[j] = real(0.0)
        return x, code

    return examined


def make_fail(width):
    """(code, k, i, status, failed_step): note which lanes of packet i end in step k, and why."""

    @wp.func(inline=True)
    def fail(code: Any, k: int, i: int, status: Any, failed_step: Any):
        for j in range(wp.static(width)):
            if code[j] > code.dtype(0.0):
                status[i][j] = int(code[j])
                failed_step[i][j] = k

    return fail


def make_stopped(spec):
    """(kept, frozen) with the lanes that fail in step k, in their last good state or at the event that stops them."""
    types, stepping, real, width = make_types(spec), make_stepping(spec), spec.real, spec.width
    State, Constants, Monitor, Lane, Ints = types.State, types.Constants, types.Monitor, types.Lane, types.Ints
    at_step, held, one_step, arrival = stepping.at_step, stepping.held, stepping.one_step, make_retry(spec).arrival
    watched, stills, remembers, controlled = spec.watched, spec.still, spec.memory, spec.control is not None
    fail = make_fail(width)
    keep_signals, _ = make_signals(Lane)
    _, _, back_up = make_rows(Lane, State, spec.paced, spec.compensated)

    @wp.func(inline=True)
    def stopped(good: State, x: State, kept: State, frozen: Lane, code: Lane, c: Constants, monitor: Monitor, k: int,
                h: wp.float64, stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), first_h: real, opening: real,
                status: wp.array(dtype=Ints), failed_step: wp.array(dtype=Ints),
                failed_size: wp.array(dtype=Lane)):  # fmt: skip
        """good: the state before the step; code: why lanes fail in it."""
        landed = good
        if wp.static(watched):
            begun = at_step(good, k, h)
            landed, code, part, still = arrival(begun, x, code, c, k, h, stage_h, lead_h, opening)
            for j in range(wp.static(width)):
                if code[j] >= real(wp.static(float(FIRST))):
                    x.alarm.size[j] = part[j] * part[j]
                if wp.static(stills):
                    if code[j] > real(0.0):
                        monitor.still[c.packet, 0][j] = still.x[j]
                        monitor.still[c.packet, 1][j] = still.y[j]
                        monitor.still[c.packet, 2][j] = still.z[j]
            if wp.static(remembers):
                # The search left the memory of a part: make the step once more for the lanes that go on.
                back_up(c.memory, c.packet, 1, 0)
                if wp.static(controlled):
                    begun = held(begun, c, monitor, k, 1, h, stage_h, lead_h, first_h, opening)
                else:
                    begun = one_step(begun, c, monitor, k, h, stage_h, lead_h, first_h, opening)
        fail(code, k, c.packet, status, failed_step)
        for j in range(wp.static(width)):
            if code[j] > real(0.0):
                failed_size[c.packet][j] = x.alarm.size[j]
        if wp.static(controlled):
            keep_signals(c.memory, c.packet, monitor, c.memory.shape[1] // 2, code)
        return choose(code, landed, kept), frozen + code

    return stopped
