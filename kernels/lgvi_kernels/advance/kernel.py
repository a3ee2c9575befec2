# SPDX-License-Identifier: Apache-2.0
"""The kernel: a launch makes the steps k0 to k1, in chunks between two looks at the alarms, and writes the samples due.

A chunk with an alarm is made again from its start, one step at a time. So healthy steps pay one test a chunk, and a failing
lane is frozen at its last good state; the other lanes repeat their bits.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.advance.events import FIRST
from lgvi_kernels.advance.gathering import make_note_actuators, make_signals
from lgvi_kernels.advance.retry import make_retry
from lgvi_kernels.advance.rows import make_rows, make_sample
from lgvi_kernels.advance.spec import CHUNK, Types, make_types
from lgvi_kernels.advance.stepping import make_stepping
from lgvi_kernels.advance.watching import make_watching
from lgvi_kernels.lanes.arithmetic import add, any_positive, div, mul, neg, ones, positive, sub  # noqa: F401
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_kernels.lanes.packet import failures, renormalise, turned_too_far
from lgvi_kernels.lanes.subnormals import flush_subnormals, put_back
from lgvi_kernels.lanes.sums import at_rest, choose
from lgvi_kernels.maps.bounded import bounded_spec
from lgvi_kernels.maps.compose import superpose

# Where every step is a sample, steps between two looks at the energy: this is how late a failure may be seen.
SINGLE_LOOKS = 8


class Advance(NamedTuple):
    """A kernel and its types."""

    kernel: Any
    types: Types


@functools.cache
def make_advance(spec):
    """Build (without compiling) the kernel for this Spec."""
    spec = bounded_spec(spec)
    width, real, checked = spec.width, spec.real, spec.checked
    types, stepping, watching, retry = make_types(spec), make_stepping(spec), make_watching(spec), make_retry(spec)
    Lane, Number, Ints, Alarm, Monitor = types.Lane, types.Number, types.Ints, types.Alarm, types.Monitor
    Constants, DragFlow, Inertia, Params, Events = (
        types.Constants,
        types.DragFlow,
        types.Inertia,
        types.Params,
        types.Events,
    )
    prepare, at_step, opened = stepping.method.prepare, stepping.at_step, stepping.opened
    one_step, stepped = stepping.one_step, stepping.stepped
    begin, note, energy_alarm = watching.begin, watching.note, watching.energy_alarm
    retried, arrival = retry.retried, retry.arrival
    watched, dragged, remembers, turned = spec.watched, spec.dragged, spec.memory, spec.turned
    renormalised, composed, paced, apart = real == wp.float32, spec.composed, spec.paced, spec.explicit is None
    lead_coefficient = spec.lead[1] if spec.lead is not None else 0.0
    energetic, substepped, stills, warned = spec.energy, spec.substep, spec.still, bool(spec.looks)
    looking = warned or energetic
    controlled, feed, respond, held = spec.control is not None, stepping.feed, stepping.respond, stepping.held
    asked = controlled and spec.control.asked
    nearest, spacing = (stepping.watch.nearest, stepping.watch.spacing) if watched else (stepping.method.step,) * 2
    water_velocity = stepping.method.water_velocity
    read, write, back_up = make_rows(Lane, types.State, paced, spec.compensated)
    drifts = superpose(spec.laws, "flow") is not None
    sample = make_sample(Lane, spec.compensated, stepping.method, drifts, stills)

    keep_signals, sample_signals = make_signals(Lane)
    reports = controlled and spec.control.reports
    note_actuators = make_note_actuators(spec, types.View, at_step) if reports else stepping.method.step

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def advance(
        # vehicles, laws and events, one entry (shared) or one a packet
        inertia: wp.array(dtype=Inertia),
        params: wp.array(dtype=Params),
        events: wp.array(dtype=Events),
        table: wp.array2d(dtype=Number),
        tolerance: real,
        force_tolerance: real,
        # method: length of each stage [s], in pairs where it has two halves; of the lead after each, and before the first
        h: wp.float64,
        stage_h: wp.array(dtype=real),
        lead_h: wp.array(dtype=real),
        # time: this launch makes the steps k0 to k1, and writes the samples due after the steps sample_step[s0:]
        k0: int,
        k1: int,
        s0: int,
        sample_step: wp.array(dtype=int),
        # in and out
        state: wp.array2d(dtype=Lane),
        memory: wp.array2d(dtype=Lane),
        status: wp.array(dtype=Ints),
        failed_step: wp.array(dtype=Ints),
        failed_size: wp.array(dtype=Lane),
        # limits and results of looks
        monitor: Monitor,
        # out: numbers of a sample, and the column of each of SAMPLE_FIELDS among them, -1 if not saved
        numbers: int,
        columns: wp.vec4i,
        out: wp.array2d(dtype=Lane),
    ):
        mode = flush_subnormals()
        i = wp.tid()
        c = Constants()
        c.inertia = inertia[i % inertia.shape[0]]
        c.params = params[i % params.shape[0]]
        c.tolerance = tolerance
        c.force_tolerance = force_tolerance
        c.table = table
        c.memory = memory
        c.packet = i
        c.entry = i % table.shape[0]
        if wp.static(watched):
            c.events = events[i % events.shape[0]]
        if wp.static(controlled):
            c.loop = monitor.loop[i % monitor.loop.shape[0]]
        if wp.static(dragged):
            c.drag = prepare(DragFlow(), c.params.own, real(h))
        stages = lead_h.shape[0] - 1
        # Times 1: a plain assignment would be a reference into the array, read anew in each step.
        first_h = real(1.0) * stage_h[0]
        opening = real(1.0) * lead_h[stages]
        if wp.static(not composed):
            # Computed from first_h, the compiler keeps one number in a register for the stage and its leads.
            opening = real(wp.static(lead_coefficient)) * first_h
        x = read(state, i)
        unity = ones(x.b.x)
        zero = unity - unity
        frozen = zero
        any_frozen = bool(False)
        if wp.static(checked):
            for j in range(wp.static(width)):
                # Positive in the lanes that an earlier launch froze.
                frozen[j] = real(status[i][j])
            any_frozen = any_positive(frozen)
        # kept: the last good state of frozen lanes, which rest at the origin meanwhile and raise no further alarm.
        kept = x
        if any_frozen:
            x = choose(frozen, at_rest(x), x)
        # Lanes that end before their first step, by their code.
        early = zero
        if wp.static(watched):
            if k0 == 0:
                distance, margin, beyond = nearest(x, c, real(h), spacing(x, x, c, real(h)))
                early = positive(margin - distance, positive(frozen, zero, beyond), zero)
                if wp.static(stills):
                    still_start = water_velocity(x, c, real(h))
                    for j in range(wp.static(width)):
                        if early[j] > real(0.0):
                            monitor.still[i, 0][j] = still_start.x[j]
                            monitor.still[i, 1][j] = still_start.y[j]
                            monitor.still[i, 2][j] = still_start.z[j]
        if k0 == 0:
            if wp.static(looking):
                begin(x, c, monitor, h, frozen)
            if wp.static(controlled):
                x.alarm = Alarm()
                if wp.static(not asked):
                    x.alarm = feed(x, c, monitor, 0, h, real(0.0))
            x = opened(x, c, opening)
        if wp.static(asked):
            # A launch without steps measures alone: so the host sees the start. Such a kernel has no lead.
            x.alarm = Alarm()
            if k1 > k0:
                x.alarm = respond(x, c, monitor, k0, h)
            else:
                x.alarm = feed(x, c, monitor, k0, h, real(0.0))
        if wp.static(controlled):
            if k0 == 0:
                if wp.static(reports):
                    note_actuators(x, c, h, 0)
                for j in range(monitor.signals.shape[0]):
                    monitor.first_signals[i, j] = memory[i, monitor.signals[j]]
        if wp.static(controlled and checked):
            if wp.static(asked) or k0 == 0:
                failed = failures(x, frozen)
                early = positive(failed, failed, early)
        if wp.static(watched or (controlled and checked)):
            if any_positive(early):
                for j in range(wp.static(width)):
                    if early[j] > real(0.0):
                        status[i][j] = int(early[j])
                        failed_step[i][j] = k0
                if wp.static(controlled):
                    keep_signals(memory, i, monitor, 0, early)
                kept = choose(early, x, kept)
                frozen = frozen + early
                any_frozen = True
                x = choose(frozen, at_rest(x), x)
        k = k0
        s = s0
        if wp.static(looking):
            suspects = zero
            # sample_step ends with a step that no run reaches, which saves a test for its end.
            last = sample_step[sample_step.shape[0] - 2]
        # singles: steps still to be made one at a time, after an alarm.
        singles = int(0)
        while k < k1:
            # Chunks end at multiples of CHUNK whatever the launches are: looks and renormalisation do not depend on them.
            n = wp.min(wp.static(CHUNK) - k % wp.static(CHUNK), wp.min(k1, sample_step[s]) - k)
            if singles > 0:
                n = 1
            good = x
            if wp.static(reports and checked):
                if singles > 0:
                    # Where a lane fails in this step, its actuators are those of the step's start.
                    note_actuators(x, c, h, k)
            if wp.static(remembers and checked):
                back_up(memory, i, 0, 1)
            x.alarm = Alarm()
            if wp.static(paced):
                # A lane with a code does not count when the packet chooses its step.
                x.alarm.code = frozen
            if wp.static(controlled):
                x = held(x, c, monitor, k, n, h, stage_h, lead_h, first_h, opening)
            elif wp.static(apart):
                x = stepped(x, c, monitor, k, n, h, stage_h, lead_h, first_h, opening)
            else:
                for j in range(n):
                    x = one_step(x, c, monitor, k + j, h, stage_h, lead_h, first_h, opening)
            repeat = int(0)
            if wp.static(checked):
                if wp.static(turned):
                    x.alarm = turned_too_far(x.alarm)
                if wp.static(energetic):
                    if singles > 0:
                        # In a chunk that is made again, only the lanes whose alarm made it necessary are looked at.
                        x.alarm = energy_alarm(x, c, monitor, k + n, h, opening, suspects)
                    elif n > 1 or (k + n) % wp.static(SINGLE_LOOKS) == 0 or k + n == last:
                        x.alarm = energy_alarm(x, c, monitor, k + n, h, opening, unity - frozen)
                code = failures(x, frozen)
                if wp.static(substepped):
                    if n == 1 and any_positive(code):
                        code_whole = code
                        x, code = retried(good, x, code_whole, c, k, h, stage_h, lead_h, opening)
                        for j in range(wp.static(width)):
                            if code[j] != code_whole[j]:
                                monitor.substeps[i][j] = monitor.substeps[i][j] + 1
                                x.alarm.size[j] = real(0.0)
                if any_positive(code):
                    if n > 1:
                        repeat = n
                        if wp.static(looking):
                            suspects = code
                    else:
                        landed = good
                        if wp.static(watched):
                            # Failed lanes keep their last good state; lanes that an event stops get the state at the event.
                            begun = at_step(good, k, h)
                            landed, code, part, still = arrival(begun, x, code, c, k, h, stage_h, lead_h, opening)
                            for j in range(wp.static(width)):
                                if code[j] >= real(wp.static(float(FIRST))):
                                    x.alarm.size[j] = part[j] * part[j]
                                if wp.static(stills):
                                    if code[j] > real(0.0):
                                        monitor.still[i, 0][j] = still.x[j]
                                        monitor.still[i, 1][j] = still.y[j]
                                        monitor.still[i, 2][j] = still.z[j]
                            if wp.static(remembers):
                                # The search left the memory of a part: make the step once more for the lanes that go on.
                                back_up(memory, i, 1, 0)
                                if wp.static(controlled):
                                    begun = held(begun, c, monitor, k, 1, h, stage_h, lead_h, first_h, opening)
                                else:
                                    begun = one_step(begun, c, monitor, k, h, stage_h, lead_h, first_h, opening)
                        for j in range(wp.static(width)):
                            if code[j] > real(0.0):
                                status[i][j] = int(code[j])
                                failed_step[i][j] = k
                                failed_size[i][j] = x.alarm.size[j]
                        if wp.static(controlled):
                            keep_signals(memory, i, monitor, memory.shape[1] // 2, code)
                        kept = choose(code, landed, kept)
                        frozen = frozen + code
                        any_frozen = True
                if any_frozen:
                    x = choose(frozen, at_rest(x), x)
            if repeat > 0:
                x = good
                singles = repeat
                if wp.static(remembers and checked):
                    back_up(memory, i, 1, 0)
            else:
                k += n
                if singles > 0:
                    singles -= 1
                if wp.static(warned):
                    if k % wp.static(CHUNK) == 0 or k == last:
                        note(x, c, monitor, k, h, opening, frozen)
                if wp.static(renormalised):
                    if k % wp.static(CHUNK) == 0:
                        x = renormalise(x, tolerance)
                if k == sample_step[s]:
                    y = x
                    if any_frozen:
                        y = choose(frozen, kept, x)
                    # Backward over its length, the lead of the next step is undone.
                    y = opened(at_step(y, k, h), c, -opening)
                    sample(out, i, (s - s0) * numbers, columns, y, c, real(h), monitor, frozen)
                    if wp.static(controlled):
                        if wp.static(reports):
                            note_actuators(x, c, h, k)
                        sample_signals(out, i, (s - s0 + 1) * numbers, memory, monitor, frozen)
                    s += 1
        if any_frozen:
            x = choose(frozen, kept, x)
        write(state, i, x)
        put_back(mode)

    return Advance(advance, types)
