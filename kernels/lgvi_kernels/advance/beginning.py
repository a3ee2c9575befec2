# SPDX-License-Identifier: Apache-2.0
"""Beginning of a launch before its first step: looks at the start, the controller's first commands, lanes that end there.

A run begins with its first launch, from states that start, or that go on from where another run ended. What goes on has its
memory, in which the last tick of its controller has been made.
"""

import warp as wp

from lgvi_kernels.advance.alarms import make_fail, make_resting
from lgvi_kernels.advance.gathering import make_note_actuators, make_signals
from lgvi_kernels.advance.spec import make_types
from lgvi_kernels.advance.stepping import make_stepping
from lgvi_kernels.advance.watching import make_watching
from lgvi_kernels.lanes.arithmetic import add, any_positive, mul, neg, ones, positive, sub  # noqa: F401
from lgvi_kernels.lanes.packet import failures

# How a launch begins: as the one before ended (0); with members that start; with states that go on without the lead of their
# first step, since somebody changed them; with states that go on as they were.
STARTS = 1
GOES_ON_WITHOUT_LEAD = 2
GOES_ON = 3


def make_constants(spec):
    """The function that puts together in c what is the same in every step of packet i."""
    types, stepping = make_types(spec), make_stepping(spec)
    Constants, DragFlow, Inertia, Params, Events = (
        types.Constants, types.DragFlow, types.Inertia, types.Params, types.Events
    )  # fmt: skip
    Lane, Number, Monitor, real, prepare = types.Lane, types.Number, types.Monitor, spec.real, stepping.method.prepare
    watched, dragged, controlled, accounted = spec.watched, spec.dragged, spec.control is not None, spec.accounted

    @wp.func(inline=True)
    def constants(c: wp.ref[Constants], i: int, inertia: wp.array(dtype=Inertia), params: wp.array(dtype=Params),
                  events: wp.array(dtype=Events), table: wp.array2d(dtype=Number), memory: wp.array2d(dtype=Lane),
                  tolerance: real, force_tolerance: real, monitor: wp.ref[Monitor], h: wp.float64):  # fmt: skip
        c.inertia = inertia[i % inertia.shape[0]]
        c.params = params[i % params.shape[0]]
        c.tolerance = tolerance
        c.force_tolerance = force_tolerance
        c.table = table
        c.memory = memory
        c.packet = i
        c.entry = i % table.shape[0]
        c.last_memory = memory.shape[1] // 4
        if wp.static(watched):
            c.events = events[i % events.shape[0]]
        if wp.static(controlled):
            c.loop = monitor.loop[i % monitor.loop.shape[0]]
            # Before them the bus and the spare rows, behind them those of the controller's parts.
            c.first_memory = monitor.spare + monitor.part_rows
            if monitor.parts > 0:
                c.last_memory = monitor.parts
        if wp.static(accounted):
            c.account = monitor.account
        if wp.static(dragged):
            c.drag = prepare(DragFlow(), c.params.own, real(h))

    return constants


def make_reached(spec):
    """(x, c, monitor, h, frozen): the codes of lanes that start beyond an event; the water where they are is kept."""
    types, stepping, real, width, stills = make_types(spec), make_stepping(spec), spec.real, spec.width, spec.still
    State, Constants, Monitor, Lane = types.State, types.Constants, types.Monitor, types.Lane
    nearest, spacing = stepping.watch.nearest, stepping.watch.spacing
    water_velocity = stepping.method.water_velocity

    @wp.func(inline=True)
    def reached(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], h: wp.float64, frozen: Lane):
        zero = ones(x.b.x) - ones(x.b.x)
        distance, margin, beyond = nearest(x, c, real(h), spacing(x, x, c, real(h)))
        early = positive(margin - distance, positive(frozen, zero, beyond), zero)
        if wp.static(stills):
            still_start = water_velocity(x, c, real(h))
            for j in range(wp.static(width)):
                if early[j] > real(0.0):
                    monitor.still[c.packet, 0][j] = still_start.x[j]
                    monitor.still[c.packet, 1][j] = still_start.y[j]
                    monitor.still[c.packet, 2][j] = still_start.z[j]
        return early

    return reached


def make_opening(spec):
    """(x, c, monitor, k0, k1, begins, ...): x gets the lead of its first step, after the looks at the start."""
    types, stepping, watching = make_types(spec), make_stepping(spec), make_watching(spec)
    State, Constants, Monitor, Alarm, Lane = types.State, types.Constants, types.Monitor, types.Alarm, types.Lane
    feed, respond, recall = stepping.feed, stepping.respond, stepping.recall
    opened, begin = stepping.opened, watching.begin
    real, looking, controlled = spec.real, bool(spec.warning_rows) or spec.energy, spec.control is not None
    asked, reports = controlled and spec.control.asked, controlled and spec.control.reports
    note_actuators = make_note_actuators(spec, types, stepping.method, stepping.at_step, opened)
    _, _, first_signals = make_signals(types)

    @wp.func(inline=True)
    def first_of(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k0: int, h: wp.float64, opening: real,
                 frozen: Lane):  # fmt: skip
        if wp.static(reports):
            note_actuators(x, c, monitor, h, k0, opening)
        first_signals(c, monitor, frozen)

    @wp.func(inline=True)
    def opening_of(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k0: int, k1: int, begins: int,
                   h: wp.float64, opening: real, frozen: Lane):  # fmt: skip
        if begins == wp.static(STARTS) or begins == wp.static(GOES_ON_WITHOUT_LEAD):
            if wp.static(looking):
                begin(x, c, monitor, k0, h, frozen)
            if wp.static(controlled):
                x.alarm = Alarm()
                if wp.static(not asked):
                    if begins == wp.static(STARTS):
                        feed(x, c, monitor, k0, h, real(0.0))
            x = opened(x, c, opening)
        if wp.static(asked):
            # A launch without steps measures alone: so the host sees the start. Such a kernel has no lead.
            x.alarm = Alarm()
            if k1 > k0:
                if begins > 0:
                    # A run that goes on starts with the signals that the part before left.
                    first_of(x, c, monitor, k0, h, opening, frozen)
                if k0 % monitor.every == 0:
                    respond(x, c, monitor, k0, h)
            else:
                feed(x, c, monitor, k0, h, real(0.0))
        if wp.static(controlled):
            if begins > 0:
                if k1 == k0 or wp.static(not asked):
                    first_of(x, c, monitor, k0, h, opening, frozen)
                if monitor.slots > 0:
                    if begins != wp.static(STARTS) and k0 == monitor.first_tick * monitor.every:
                        recall(x, c, monitor, k0, h, opening)
        if wp.static(spec.signalled and not controlled):
            if begins > 0:
                first_signals(c, monitor, frozen)

    return opening_of


def make_begun(spec):
    """The function that brings x before the step k0, with the lanes frozen that end before it."""
    types, stepping, real, width = make_types(spec), make_stepping(spec), spec.real, spec.width
    State, Constants, Monitor, Lane, Ints = types.State, types.Constants, types.Monitor, types.Lane, types.Ints
    checked, watched, controlled = spec.checked, spec.watched, spec.control is not None
    asked, opening_of, fail = controlled and spec.control.asked, make_opening(spec), make_fail(width)
    keep, _, rest = make_resting(spec)
    reached = make_reached(spec) if watched else stepping.method.step
    keep_signals, _, _ = make_signals(types)

    @wp.func(inline=True)
    def begun(x: wp.ref[State], frozen: wp.ref[Lane], c: wp.ref[Constants], monitor: wp.ref[Monitor], k0: int, k1: int,
              begins: int, h: wp.float64, opening: real, state: wp.array2d(dtype=Lane), status: wp.array(dtype=Ints),
              failed_step: wp.array(dtype=Ints)):  # fmt: skip
        """Frozen lanes rest at the origin."""
        if wp.static(checked):
            # Positive in the lanes that an earlier launch froze.
            frozen = Lane(status[c.packet])
            if any_positive(frozen):
                rest(x, frozen)
        # Lanes that end before their first step, by their code.
        early = ones(frozen) - ones(frozen)
        if wp.static(spec.timed):
            # The state is that of the time k0 h, before the lead of its step.
            if begins > 0:
                x.time = wp.float64(k0) * h
                x.step = k0
        if wp.static(watched):
            if begins == wp.static(STARTS) or begins == wp.static(GOES_ON_WITHOUT_LEAD):
                early = reached(x, c, monitor, h, frozen)
        opening_of(x, c, monitor, k0, k1, begins, h, opening, frozen)
        if wp.static(controlled and checked):
            if wp.static(asked) or begins == wp.static(STARTS):
                failed = failures(x, frozen)
                early = positive(failed, failed, early)
        if wp.static(watched or (controlled and checked)):
            if any_positive(early):
                fail(early, k0, c.packet, status, failed_step)
                if wp.static(spec.signalled):
                    keep_signals(c, monitor, 0, early)
                keep(x, c, early, state)
                frozen = frozen + early
                rest(x, frozen)

    return begun
