# SPDX-License-Identifier: Apache-2.0
"""Consequences of alarms: lanes that fail, steps repeated in parts, and lanes at rest.

Alarms are rare. What follows is apart from the loop over chunks and takes references, so that chunks without one have no
trace of it: neither copies of states nor registers.
"""

import functools
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
from lgvi_kernels.lanes.sums import at_rest, choose
from lgvi_kernels.maps.accounting import account_of, put_account

# Where every step is a sample, steps between two looks at the energy: this is how late a failure may be seen.
SINGLE_LOOKS = 8


def make_examined(spec):
    """The function that gives the codes after a chunk, of the lanes that were not frozen before."""
    types, real, energy_alarm = make_types(spec), spec.real, make_watching(spec).energy_alarm
    State, Constants, Monitor, Lane = types.State, types.Constants, types.Monitor, types.Lane
    turned, energetic = spec.turned, spec.energy

    @wp.func(inline=True)
    def examined(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, n: int, singles: int, last: int,
                 h: wp.float64, opening: real, frozen: Lane, suspects: Lane):  # fmt: skip
        """x: after the steps k to k + n; singles: steps that are made again; last: that of the last sample."""
        if wp.static(turned):
            x.alarm = turned_too_far(x.alarm)
        if wp.static(energetic):
            if singles > 0:
                # In a chunk that is made again, only the lanes whose alarm made it necessary are looked at.
                energy_alarm(x, c, monitor, k + n, h, opening, suspects)
            elif n > 1 or (k + n) % wp.static(SINGLE_LOOKS) == 0 or k + n == last:
                energy_alarm(x, c, monitor, k + n, h, opening, ones(frozen) - frozen)
        return failures(x, frozen)

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


@functools.cache
def make_resting(spec):
    """Functions (keep, show, rest) of frozen lanes, whose last good states are kept in the kernel's array of states.

    keep: (x, c, code, state), those of lanes with a code; show: (x, c, frozen, state) puts them in place of the resting ones;
    rest: (x, frozen) puts frozen lanes to the origin, where they raise no alarms.
    """
    types = make_types(spec)
    State, Constants, Lane = types.State, types.Constants, types.Lane
    read, write, _ = make_rows(Lane, State, spec.paced, spec.compensated)

    @wp.func(inline=False)
    def keep(x: wp.ref[State], c: wp.ref[Constants], code: Lane, state: wp.array2d(dtype=Lane)):
        before = State()
        read(before, state, c.packet)
        write(state, c.packet, choose(code, x, before))

    @wp.func(inline=False)
    def show(x: wp.ref[State], c: wp.ref[Constants], frozen: Lane, state: wp.array2d(dtype=Lane)):
        kept = State()
        read(kept, state, c.packet)
        x = choose(frozen, kept, x)

    @wp.func(inline=False)
    def rest(x: wp.ref[State], frozen: Lane):
        x = choose(frozen, at_rest(x), x)

    return keep, show, rest


def make_stopped(spec):
    """The function by which lanes stop that fail in step k, in their last good state or at the event that stops them."""
    types, stepping, real, width = make_types(spec), make_stepping(spec), spec.real, spec.width
    State, Constants, Monitor, Lane, Ints = types.State, types.Constants, types.Monitor, types.Lane, types.Ints
    at_step, held, one_step, arrival = stepping.at_step, stepping.held, stepping.one_step, make_retry(spec).arrival
    watched, stills, remembers, controlled = spec.watched, spec.still, spec.memory, spec.control is not None
    accounted = spec.accounted
    fail, keep = make_fail(width), make_resting(spec)[0]
    keep_signals, _, _ = make_signals(types)
    _, _, back_up = make_rows(Lane, State, spec.paced, spec.compensated)

    @wp.func(inline=True)
    def stopped(good: wp.ref[State], x: wp.ref[State], codes: Lane, c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int,
                h: wp.float64, stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real), first_h: real, opening: real,
                state: wp.array2d(dtype=Lane), status: wp.array(dtype=Ints), failed_step: wp.array(dtype=Ints),
                failed_size: wp.array(dtype=Lane)):  # fmt: skip
        """good: the state before the step; codes: why lanes fail in it. Returns: the codes."""
        landed = good
        code = codes
        if wp.static(accounted):
            used, low = account_of(c, 0)
        if wp.static(watched):
            begun = at_step(good, k, h)
            begun.prepared = 0
            part, still = arrival(begun, x, landed, code, c, k, h, stage_h, lead_h, opening)
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
                    held(begun, c, monitor, k, 1, h, stage_h, lead_h, first_h, opening)
                else:
                    begun = one_step(begun, c, monitor, k, h, stage_h, lead_h, first_h, opening)
                if wp.static(accounted):
                    # That of the states that go on, of which some were made in parts.
                    put_account(c, 0, used, low)
        fail(code, k, c.packet, status, failed_step)
        for j in range(wp.static(width)):
            if code[j] > real(0.0):
                failed_size[c.packet][j] = x.alarm.size[j]
        if wp.static(spec.signalled):
            keep_signals(c, monitor, c.memory.shape[1] // 2, code)
        keep(landed, c, code, state)
        return code

    return stopped


def make_failed(spec):
    """The function that does what failed lanes ask for; it returns how many steps are to be made again, one at a time."""
    types, real, width = make_types(spec), spec.real, spec.width
    State, Constants, Monitor, Lane, Ints = types.State, types.Constants, types.Monitor, types.Lane, types.Ints
    retried, stopped, substepped = make_retry(spec).retried, make_stopped(spec), spec.substep
    _, _, back_up = make_rows(Lane, State, spec.paced, spec.compensated)

    @wp.func(inline=False)
    def failed(good: wp.ref[State], x: wp.ref[State], frozen: wp.ref[Lane], suspects: wp.ref[Lane], codes: Lane,
               c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, n: int, h: wp.float64, stage_h: wp.array(dtype=real),
               lead_h: wp.array(dtype=real), first_h: real, opening: real, state: wp.array2d(dtype=Lane),
               status: wp.array(dtype=Ints), failed_step: wp.array(dtype=Ints),
               failed_size: wp.array(dtype=Lane)):  # fmt: skip
        """good, x: before and after the steps k to k + n; codes: why lanes fail in them. A single step may be divided."""
        code = codes
        again = int(0)
        if n > 1:
            again = n
            suspects = code  # noqa: F841 (what a reference refers to)
            x = good
            if wp.static(spec.memory):
                back_up(c.memory, c.packet, 1, 0)
        else:
            if wp.static(substepped):
                retried(good, x, code, c, k, h, stage_h, lead_h, opening)
                for j in range(wp.static(width)):
                    if code[j] != codes[j]:
                        monitor.substeps[c.packet][j] = monitor.substeps[c.packet][j] + 1
                        x.alarm.size[j] = real(0.0)
            if any_positive(code):
                code = stopped(good, x, code, c, monitor, k, h, stage_h, lead_h, first_h, opening, state, status,
                               failed_step, failed_size)  # fmt: skip
                frozen = frozen + code
        return again

    return failed
