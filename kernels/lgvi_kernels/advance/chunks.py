# SPDX-License-Identifier: Apache-2.0
"""A launch's steps in chunks between two looks at the alarms; one with an alarm is made again, one step at a time.

The parts of the kernel here, in alarms.py and in beginning.py that every chunk needs are inlined before all else
(`inline=True`). Left to do so later, the compiler joins other products with other sums, and the bits of results are others.
All others are functions of their own that take references: Warp passes a struct by value as a copy, made for every call.
"""

import warp as wp

from lgvi_kernels.advance.alarms import make_examined, make_failed, make_resting
from lgvi_kernels.advance.beginning import make_begun
from lgvi_kernels.advance.gathering import make_note_actuators, make_signals
from lgvi_kernels.advance.rows import make_rows, make_sample
from lgvi_kernels.advance.spec import CHUNK, make_types
from lgvi_kernels.advance.stepping import make_stepping
from lgvi_kernels.advance.watching import make_watching
from lgvi_kernels.lanes.arithmetic import add, any_positive, mul, neg, ones, sub  # noqa: F401
from lgvi_kernels.lanes.packet import renormalise
from lgvi_kernels.maps.compose import superpose


def make_inspected(spec):
    """(x, c, monitor, k, last, h, opening, frozen): x after k steps; now and then it is noted, and made a rotation again."""
    types, note, real = make_types(spec), make_watching(spec).note, spec.real
    State, Constants, Monitor, Lane = types.State, types.Constants, types.Monitor, types.Lane

    @wp.func(inline=True)
    def inspected(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, last: int, h: wp.float64,
                  opening: real, frozen: Lane):  # fmt: skip
        """last: the step of the last sample."""
        if wp.static(bool(spec.warning_rows)):
            if k % wp.static(CHUNK) == 0 or k == last:
                note(x, c, monitor, k, h, opening, frozen)
        if wp.static(real == wp.float32):
            if k % wp.static(CHUNK) == 0:
                x = renormalise(x, c.tolerance)

    return inspected


def make_sampled(spec):
    """The function that writes a launch's sample of this number, after k steps."""
    types, stepping, real = make_types(spec), make_stepping(spec), spec.real
    State, Constants, Monitor, Lane = types.State, types.Constants, types.Monitor, types.Lane
    at_step, opened, controlled = stepping.at_step, stepping.opened, spec.control is not None
    reports = controlled and spec.control.reports
    sample = make_sample(Lane, spec.compensated, stepping.method, superpose(spec.laws, "flow") is not None, spec.still)
    note_actuators = make_note_actuators(spec, types, stepping.method, at_step, opened)
    _, sample_signals, _ = make_signals(types)

    @wp.func(inline=False)
    def sampled(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: real,
                frozen: Lane, number: int, numbers: int, columns: wp.vec4i, out: wp.array2d(dtype=Lane)):  # fmt: skip
        """x: with the last good state of frozen lanes."""
        first = number * numbers
        # Backward over its length, the lead of the next step is undone.
        y = opened(at_step(x, k, h), c, -opening)
        sample(out, c.packet, first, columns, y, c, real(h), monitor, frozen)
        if wp.static(spec.signalled):
            if wp.static(reports):
                note_actuators(x, c, monitor, h, k, opening)
            sample_signals(out, first + numbers, c, monitor, frozen)

    return sampled


def make_chunk(spec):
    """The function that makes the steps k to k + n; it returns n, or 0 where they are to be made again."""
    types, stepping, real = make_types(spec), make_stepping(spec), spec.real
    State, Constants, Monitor, Lane, Ints = types.State, types.Constants, types.Monitor, types.Lane, types.Ints
    Alarm, steps = types.Alarm, stepping.held if spec.control is not None else stepping.stepped
    examined, failed, (_, _, rest) = make_examined(spec), make_failed(spec), make_resting(spec)
    _, _, back_up = make_rows(Lane, State, spec.paced, spec.compensated)

    @wp.func(inline=True)
    def chunk(x: wp.ref[State], frozen: wp.ref[Lane], suspects: wp.ref[Lane], c: wp.ref[Constants], monitor: wp.ref[Monitor],
              k: int, n: int, singles: wp.ref[int], last: int, h: wp.float64, stage_h: wp.array(dtype=real),
              lead_h: wp.array(dtype=real), first_h: real, opening: real, state: wp.array2d(dtype=Lane),
              status: wp.array(dtype=Ints), failed_step: wp.array(dtype=Ints),
              failed_size: wp.array(dtype=Lane)):  # fmt: skip
        """singles: steps still to be made one at a time, after an alarm of these lanes, `suspects`."""
        good = x
        if wp.static(spec.memory and spec.checked):
            back_up(c.memory, c.packet, 0, 1)
        x.alarm = Alarm()
        if wp.static(spec.paced):
            # A lane with a code does not count when the packet chooses its step.
            x.alarm.code = frozen
        steps(x, c, monitor, k, n, h, stage_h, lead_h, first_h, opening)
        again = int(0)
        if wp.static(spec.checked):
            codes = examined(x, c, monitor, k, n, singles, last, h, opening, frozen, suspects)
            if any_positive(codes):
                again = failed(good, x, frozen, suspects, codes, c, monitor, k, n, h, stage_h, lead_h, first_h, opening,
                               state, status, failed_step, failed_size)  # fmt: skip
        if wp.static(spec.checked or spec.watched):
            if any_positive(frozen):
                rest(x, frozen)
        singles = wp.where(again > 0, again, wp.max(singles - 1, 0))
        return wp.where(again > 0, 0, n)

    return chunk


def make_chunks(spec):
    """The function that makes the steps k0 to k1 of a packet, from its state to its state.

    Frozen lanes rest at the origin, without alarms, and end as they froze.
    """
    types, stepping, real = make_types(spec), make_stepping(spec), spec.real
    State, Constants, Monitor, Lane, Ints = types.State, types.Constants, types.Monitor, types.Lane, types.Ints
    chunk, inspected, sampled, freezes = (
        make_chunk(spec),
        make_inspected(spec),
        make_sampled(spec),
        spec.checked or spec.watched,
    )
    reports = spec.control is not None and spec.checked and spec.control.reports
    note_actuators = make_note_actuators(spec, types, stepping.method, stepping.at_step, stepping.opened)
    _, show, rest = make_resting(spec)
    begun, (read, write, _) = make_begun(spec), make_rows(Lane, State, spec.paced, spec.compensated)

    @wp.func(inline=True)
    def chunks(c: wp.ref[Constants], monitor: wp.ref[Monitor], k0: int, k1: int, s0: int, begins: int,
               sample_step: wp.array(dtype=int), h: wp.float64, stage_h: wp.array(dtype=real),
               lead_h: wp.array(dtype=real), first_h: real, opening: real, state: wp.array2d(dtype=Lane),
               status: wp.array(dtype=Ints), failed_step: wp.array(dtype=Ints), failed_size: wp.array(dtype=Lane),
               numbers: int, columns: wp.vec4i, out: wp.array2d(dtype=Lane)):  # fmt: skip
        x = State()
        read(x, state, c.packet)
        frozen = Lane()
        begun(x, frozen, c, monitor, k0, k1, begins, h, opening, state, status, failed_step)
        k = k0
        s = s0
        suspects = ones(frozen) - ones(frozen)
        singles = int(0)
        last = int(0)
        if wp.static(bool(spec.warning_rows) or spec.energy):
            # sample_step ends with a step that no run reaches, which saves a test for its end.
            last = sample_step[sample_step.shape[0] - 2]
        while k < k1:
            # Chunks end at multiples of CHUNK whatever the launches are: looks and renormalisation do not depend on them.
            n = wp.min(wp.static(CHUNK) - k % wp.static(CHUNK), wp.min(k1, sample_step[s]) - k)
            if singles > 0:
                n = 1
                if wp.static(reports):
                    # Where a lane fails in this step, its actuators are those of the step's start.
                    note_actuators(x, c, monitor, h, k, opening)
            n = chunk(x, frozen, suspects, c, monitor, k, n, singles, last, h, stage_h, lead_h, first_h, opening, state,
                      status, failed_step, failed_size)  # fmt: skip
            k += n
            if n > 0:
                inspected(x, c, monitor, k, last, h, opening, frozen)
                if k == sample_step[s]:
                    if wp.static(freezes):
                        if any_positive(frozen):
                            show(x, c, frozen, state)
                    sampled(x, c, monitor, k, h, opening, frozen, s - s0, numbers, columns, out)
                    if wp.static(freezes):
                        if any_positive(frozen):
                            rest(x, frozen)
                    s += 1
        if wp.static(freezes):
            if any_positive(frozen):
                show(x, c, frozen, state)
        write(state, c.packet, x)

    return chunks
