# SPDX-License-Identifier: Apache-2.0
"""A launch's steps in chunks between two looks at the alarms; one with an alarm is made again, one step at a time.

The parts of the kernel here, in alarms.py and in beginning.py are inlined before all else (`inline=True`). Left to do so
later, the compiler joins other products with other sums, and the bits of results are others.
"""

import warp as wp

from lgvi_kernels.advance.alarms import make_examined, make_stopped
from lgvi_kernels.advance.gathering import make_note_actuators, make_signals
from lgvi_kernels.advance.rows import make_rows, make_sample
from lgvi_kernels.advance.spec import CHUNK, make_types
from lgvi_kernels.advance.stepping import make_stepping
from lgvi_kernels.advance.watching import make_watching
from lgvi_kernels.lanes.arithmetic import add, any_positive, mul, neg, ones, sub  # noqa: F401
from lgvi_kernels.lanes.packet import renormalise
from lgvi_kernels.lanes.sums import at_rest, choose
from lgvi_kernels.maps.compose import superpose


def make_inspected(spec):
    """(x, c, monitor, k, last, h, opening, frozen): x after k steps; now and then it is noted, and made a rotation again."""
    types, note, real = make_types(spec), make_watching(spec).note, spec.real
    State, Constants, Monitor, Lane = types.State, types.Constants, types.Monitor, types.Lane

    @wp.func(inline=True)
    def inspected(
        x: State, c: Constants, monitor: Monitor, k: int, last: int, h: wp.float64, opening: real, frozen: Lane
    ):
        """last: the step of the last sample."""
        if wp.static(bool(spec.warning_rows)):
            if k % wp.static(CHUNK) == 0 or k == last:
                note(x, c, monitor, k, h, opening, frozen)
        if wp.static(real == wp.float32):
            if k % wp.static(CHUNK) == 0:
                x = renormalise(x, c.tolerance)
        return x

    return inspected


def make_sampled(spec):
    """The function that writes a launch's sample of this number, after k steps."""
    types, stepping, real = make_types(spec), make_stepping(spec), spec.real
    State, Constants, Monitor, Lane = types.State, types.Constants, types.Monitor, types.Lane
    at_step, opened, controlled = stepping.at_step, stepping.opened, spec.control is not None
    reports = controlled and spec.control.reports
    sample = make_sample(Lane, spec.compensated, stepping.method, superpose(spec.laws, "flow") is not None, spec.still)
    note_actuators = make_note_actuators(spec, types.View, at_step)
    _, sample_signals = make_signals(Lane)

    @wp.func(inline=True)
    def sampled(x: State, kept: State, any_frozen: bool, c: Constants, monitor: Monitor, k: int, h: wp.float64, opening: real,
                frozen: Lane, number: int, numbers: int, columns: wp.vec4i, out: wp.array2d(dtype=Lane)):  # fmt: skip
        """kept: the last good state of frozen lanes."""
        y = x
        if any_frozen:
            y = choose(frozen, kept, x)
        first = number * numbers
        # Backward over its length, the lead of the next step is undone.
        y = opened(at_step(y, k, h), c, -opening)
        sample(out, c.packet, first, columns, y, c, real(h), monitor, frozen)
        if wp.static(controlled):
            if wp.static(reports):
                note_actuators(x, c, h, k)
            sample_signals(out, c.packet, first + numbers, c.memory, monitor, frozen)

    return sampled


def make_chunks(spec):
    """The function that makes the steps k0 to k1. Frozen lanes rest at the origin, without alarms, and end as `kept`."""
    types, stepping, real = make_types(spec), make_stepping(spec), spec.real
    State, Constants, Monitor, Lane, Ints = types.State, types.Constants, types.Monitor, types.Lane, types.Ints
    Alarm, one_step, stepped, held = types.Alarm, stepping.one_step, stepping.stepped, stepping.held
    examined, stopped, controlled = make_examined(spec), make_stopped(spec), spec.control is not None
    inspected, sampled = make_inspected(spec), make_sampled(spec)
    note_actuators = make_note_actuators(spec, types.View, stepping.at_step)
    _, _, back_up = make_rows(Lane, State, spec.paced, spec.compensated)

    @wp.func(inline=True)
    def chunks(x: State, kept: State, frozen: Lane, c: Constants, monitor: Monitor, k0: int, k1: int, s0: int,
               sample_step: wp.array(dtype=int), h: wp.float64, stage_h: wp.array(dtype=real), lead_h: wp.array(dtype=real),
               first_h: real, opening: real, status: wp.array(dtype=Ints), failed_step: wp.array(dtype=Ints),
               failed_size: wp.array(dtype=Lane), numbers: int, columns: wp.vec4i, out: wp.array2d(dtype=Lane)):  # fmt: skip
        any_frozen = bool(False)
        if wp.static(spec.checked or spec.watched):
            any_frozen = any_positive(frozen)
        k = k0
        s = s0
        suspects = ones(x.b.x) - ones(x.b.x)
        last = int(0)
        if wp.static(bool(spec.warning_rows) or spec.energy):
            # sample_step ends with a step that no run reaches, which saves a test for its end.
            last = sample_step[sample_step.shape[0] - 2]
        # singles: steps still to be made one at a time, after an alarm.
        singles = int(0)
        while k < k1:
            # Chunks end at multiples of CHUNK whatever the launches are: looks and renormalisation do not depend on them.
            n = wp.min(wp.static(CHUNK) - k % wp.static(CHUNK), wp.min(k1, sample_step[s]) - k)
            if singles > 0:
                n = 1
                if wp.static(controlled and spec.checked and spec.control.reports):
                    # Where a lane fails in this step, its actuators are those of the step's start.
                    note_actuators(x, c, h, k)
            good = x
            if wp.static(spec.memory and spec.checked):
                back_up(c.memory, c.packet, 0, 1)
            x.alarm = Alarm()
            if wp.static(spec.paced):
                # A lane with a code does not count when the packet chooses its step.
                x.alarm.code = frozen
            if wp.static(controlled):
                x = held(x, c, monitor, k, n, h, stage_h, lead_h, first_h, opening)
            elif wp.static(spec.explicit is None):
                x = stepped(x, c, monitor, k, n, h, stage_h, lead_h, first_h, opening)
            else:
                for j in range(n):
                    x = one_step(x, c, monitor, k + j, h, stage_h, lead_h, first_h, opening)
            repeat = int(0)
            if wp.static(spec.checked):
                x, code = examined(good, x, c, monitor, k, n, singles, last, h, stage_h, lead_h, opening, frozen,
                                   suspects)  # fmt: skip
                if any_positive(code):
                    if n > 1:
                        repeat = n
                        suspects = code
                    else:
                        kept, frozen = stopped(good, x, kept, frozen, code, c, monitor, k, h, stage_h, lead_h, first_h,
                                               opening, status, failed_step, failed_size)  # fmt: skip
                        any_frozen = True
                if any_frozen:
                    x = choose(frozen, at_rest(x), x)
            if repeat > 0:
                x = good
                singles = repeat
                if wp.static(spec.memory and spec.checked):
                    back_up(c.memory, c.packet, 1, 0)
            else:
                k += n
                singles = wp.max(singles - 1, 0)
                x = inspected(x, c, monitor, k, last, h, opening, frozen)
                if k == sample_step[s]:
                    sampled(x, kept, any_frozen, c, monitor, k, h, opening, frozen, s - s0, numbers, columns, out)
                    s += 1
        if any_frozen:
            x = choose(frozen, kept, x)
        return x

    return chunks
