# SPDX-License-Identifier: Apache-2.0
"""The tick of a controller: from the state to the commands of its actuators.

Commands are rows of the memory that a tick writes and that every step until the next one reads: so a hold of order zero is
exact, whatever the method. The first rows of the memory are the bus of the controller (lgvi_warp/control/base.py).
"""

from typing import Any

import warp as wp

from lgvi_kernels.advance.gathering import make_gather, make_gather_motion
from lgvi_kernels.advance.noting import (
    MEASURED_ROW,
    REFERENCE_ROW,
    SEEN_NOTES,
    bit,
    make_put_measured,
    make_put_reference,
    measured_of,
    put3,
    wanted_of,
)
from lgvi_kernels.lanes.arithmetic import add, any_positive, cross, mul, neg, ones, positive, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply
from lgvi_kernels.lanes.state import wrench_struct
from lgvi_kernels.lanes.sums import place
from lgvi_kernels.lanes.tick import measurement_struct, reference_struct
from lgvi_kernels.lanes.view import remember, remembered
from lgvi_kernels.maps.compose import superpose
from lgvi_kernels.maps.in_turn import in_turn
from lgvi_kernels.maps.submaps import rotate

CONTROL_NON_FINITE = 8


def make_feed(spec, types, method, at_step, opened):
    """(feed, respond, recall): a tick at the state after k steps, which gets its alarm.

    docs/theory/control_loop.md, (C1).

    Where the host is asked, feed only measures and guides; respond, at the start of the next launch, does the rest with what
    the host has written into the memory. recall gathers the tick at which a run goes on, and which was made before.
    method: see Step; at_step, opened: see Stepping.
    """
    State, Constants, Monitor = types.State, types.Constants, types.Monitor
    Reference, truth = reference_struct(spec.lanes, spec.real), make_truth(spec, types, method)
    plain, noted = (make_seen(spec, types, method, truth, at_step, opened, notes) for notes in (False, True))
    acted, gather = make_acted(spec, types), make_gather(spec, types, method, at_step, opened)
    keep_motion, real = make_keep_motion(spec, types, method, truth, at_step, opened), spec.real

    # Not inlined, and before the tick itself: what is noted costs the tick no register, and no bit.
    @wp.func(inline=False)
    def note(
        x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: spec.real
    ):
        """Measure and guide for the notes alone: what the parts remember is put back."""
        for j in range(monitor.part_rows):
            c.memory[c.packet, monitor.spare + j] = c.memory[c.packet, monitor.parts + j]
        y, r = noted(x, c, monitor, k, h, opening)
        for j in range(monitor.part_rows):
            c.memory[c.packet, monitor.parts + j] = c.memory[c.packet, monitor.spare + j]

    @wp.func(inline=False)
    def feed(
        x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: spec.real
    ):
        """Measure, guide, control, allocate, send."""
        if monitor.slots > 0:
            keep_motion(x, c, monitor, k, h, opening)
        if (monitor.noting & wp.static(SEEN_NOTES)) != 0:
            note(x, c, monitor, k, h, opening)
        y, r = plain(x, c, monitor, k, h, opening)
        acted(x, y, r, c, monitor)
        gather(x, c, monitor, k, h, opening)

    @wp.func(inline=False)
    def ask(
        x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: spec.real
    ):
        """Measure and guide."""
        if monitor.slots > 0:
            keep_motion(x, c, monitor, k, h, opening)
        y, r = noted(x, c, monitor, k, h, opening)
        gather(x, c, monitor, k, h, opening)

    @wp.func(inline=False)
    def respond(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64):
        """Control, allocate and send, with what the last tick noted and the host's answer."""
        y = measured_of(truth(x, c, monitor, k, h), c.memory, c.packet, monitor.bus + wp.static(MEASURED_ROW))
        r = wanted_of(Reference(), c.memory, c.packet, monitor.bus + wp.static(REFERENCE_ROW))
        acted(x, y, r, c, monitor)
        gather(x, c, monitor, k, h, real(0.0))

    @wp.func(inline=False)
    def recall(
        x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: spec.real
    ):
        """Gather the motion at this tick, and what the memory has of it."""
        keep_motion(x, c, monitor, k, h, opening)
        gather(x, c, monitor, k, h, opening)

    return (ask, respond, recall) if spec.control.asked else (feed, method.step, recall)


def make_truth(spec, types, method):
    """(x, c, monitor, k, h) -> the motion in the user's axes, about his origin, as a Measurement."""
    State, Constants, Monitor, real = types.State, types.Constants, types.Monitor, spec.real
    Measurement = measurement_struct(spec.lanes, real, spec.shared_rows)
    velocities, water_velocity = method.velocities, method.water_velocity
    drifts = superpose(spec.laws, "flow") is not None
    turned, moved = "axes" in spec.parts, "origin" in spec.parts

    @wp.func
    def truth(x: State, c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64):
        y = Measurement()
        nu, Om = velocities(c.inertia, x.p, x.pi)
        through = nu
        if wp.static(moved):
            through = nu + cross(Om, c.inertia.user_origin)
        over = through
        if wp.static(drifts):
            over = through + water_velocity(x, c, real(h))
        y.position = place(x)
        if wp.static(moved):
            y.position = place(x) + rotate(x, c.inertia.user_origin)
        y.b = y.position
        if wp.static(turned):
            y.north = apply(c.inertia.axes, x.R0)
            y.east = apply(c.inertia.axes, x.R1)
            y.down = apply(c.inertia.axes, x.R2)
            y.velocity = apply(c.inertia.axes, over)
            y.water_velocity = apply(c.inertia.axes, through)
            y.angular_velocity = apply(c.inertia.axes, Om)
        else:
            y.north = x.R0
            y.east = x.R1
            y.down = x.R2
            y.velocity = over
            y.water_velocity = through
            y.angular_velocity = Om
        y.t = real(wp.float64(k) * h)
        y.h = real(h)
        y.period = real(wp.float64(monitor.every) * h)
        y.step = k
        y.tick = k // monitor.every
        y.start = monitor.start
        y.table = c.table
        y.memory = c.memory
        y.packet = c.packet
        y.entry = c.entry
        return y

    return truth


def make_keep_motion(spec, types, method, truth, at_step, opened):
    """(x, c, monitor, k, h, opening): gather the motion after k steps."""
    State, Constants, Monitor, real = types.State, types.Constants, types.Monitor, spec.real
    gather_motion, momentum = make_gather_motion(spec.compensated, "origin" in spec.parts), method.momentum

    @wp.func(inline=False)
    def keep_motion(
        x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: real
    ):
        z = opened(at_step(x, k, h), c, -opening)
        if wp.static(momentum is not None):
            z.p = momentum(z)
        gather_motion(truth(z, c, monitor, k, h), z, c, monitor)

    return keep_motion


def make_seen(spec, types, method, truth, at_step, opened, notes):
    """(x, c, monitor, k, h, opening) -> what is measured and what is wanted after k steps; notes: both are noted.

    docs/theory/control_loop.md, (C2).
    """
    State, Constants, Monitor, real = types.State, types.Constants, types.Monitor, spec.real
    Reference, momentum = reference_struct(spec.lanes, real), method.momentum
    measure, guide = (in_turn(spec.control.parts, role) for role in ("measure", "guide"))
    put_measured, put_reference = make_put_measured(spec.control.headings), make_put_reference(spec.control.headings)

    @wp.func
    def upright(like: Any):
        """No wish: at rest, upright, heading north."""
        r = Reference()
        zero = ones(like) - ones(like)
        r.north = vec3(ones(like), zero, zero)
        r.east = vec3(zero, ones(like), zero)
        r.down = vec3(zero, zero, ones(like))
        return r

    @wp.func
    def seen(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: real):
        z = opened(at_step(x, k, h), c, -opening)
        if wp.static(momentum is not None):
            z.p = momentum(z)
        y = truth(z, c, monitor, k, h)
        r = upright(y.position.x)
        if wp.static(measure is not None):
            y = measure(y, r, y, c.loop)
        if wp.static(notes):
            put_measured(y, c.memory, c.packet, monitor.bus + wp.static(MEASURED_ROW), monitor.noting)
        if wp.static(guide is not None):
            r = guide(r, r, y, c.loop)
        if wp.static(notes):
            put_reference(r, c.memory, c.packet, monitor.bus + wp.static(REFERENCE_ROW), monitor.noting)
        return y, r

    foresee, ticks = (
        in_turn(spec.control.parts, "foresee"),
        max(getattr(part, "AHEAD", 0) for part in spec.control.parts),
    )
    if foresee is None or guide is None:
        return seen

    @wp.func
    def seen_ahead(
        x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: real
    ):
        """Measure and guide; tell laws that look ahead what guidance will want at the next ticks."""
        y, r = seen(x, c, monitor, k, h, opening)
        later = y
        # A number that is no constant: Warp would unroll a short loop, and mix the types of its number.
        last = int(wp.static(ticks))
        for j in range(1, last + 1):
            later.t = y.t + real(j) * y.period
            later.step = y.step + j * monitor.every
            later.tick = y.tick + j
            later.start = j
            s = upright(y.position.x)
            s = guide(s, s, later, c.loop)
            s = foresee(s, r, later, c.loop)
        return y, r

    return seen_ahead


def make_acted(spec, types):
    """(x, y, r, c, monitor): control, allocate and send; x gets the alarm of lanes whose commands are no numbers.

    docs/theory/control_loop.md, (C2).
    """
    State, Constants, Monitor, real, checked = types.State, types.Constants, types.Monitor, spec.real, spec.checked
    Wrench, Reference = wrench_struct(spec.lanes, real), reference_struct(spec.lanes, real)
    Measurement = measurement_struct(spec.lanes, real, spec.shared_rows)
    act, allocate, send = (in_turn(spec.control.parts, role) for role in ("control", "allocate", "send"))

    @wp.func
    def acted(x: wp.ref[State], y: Measurement, r: Reference, c: wp.ref[Constants], monitor: wp.ref[Monitor]):
        w = Wrench()
        if wp.static(act is not None):
            w = act(w, r, y, c.loop)
        if (monitor.noting & wp.static(bit("demand", 0))) != 0:
            put3(c.memory, c.packet, monitor.bus, w.force)
            put3(c.memory, c.packet, monitor.bus + 3, w.torque)
        # An allocation may lose what is no number: a limit is a comparison.
        v = w.force + w.torque
        total = v.x + v.y + v.z
        if wp.static(allocate is not None):
            w = allocate(w, r, y, c.loop)
        # What was not delivered lies behind the commands.
        put3(c.memory, c.packet, monitor.commands, w.force)
        put3(c.memory, c.packet, monitor.commands + 3, w.torque)
        if wp.static(send is not None):
            y = send(y, r, y, c.loop)
        if wp.static(checked):
            unity = ones(y.position.x)
            zero = unity - unity
            for j in range(monitor.commands):
                total = total + remembered(y, j)
            # 1 where demand and commands are finite; where one is not it is NaN, and positive() takes its last argument.
            well = unity - (total - total)
            bad = positive(well, zero, real(wp.static(float(CONTROL_NON_FINITE))) * unity)
            if any_positive(bad):
                for j in range(monitor.commands):
                    remember(y, j, positive(bad, zero, remembered(y, j)))
            x.alarm.code = positive(x.alarm.code, x.alarm.code, bad)

    return acted
