# SPDX-License-Identifier: Apache-2.0
"""The look of a controller: from the state to the commands of its actuators, and the signals that are saved.

Commands are rows of the memory that a look writes and that every step until the next one reads: so a hold of order zero is
exact, whatever the method. The first rows of the memory are the bus of the controller (lgvi_warp/control/base.py).
"""

from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    add,
    any_positive,
    cross,
    element,
    lane,
    mul,
    neg,
    ones,
    positive,
    set_element,
    sub,
    vec3,
)
from lgvi_kernels.lanes.functions import arctangent2
from lgvi_kernels.lanes.look import measurement_struct, reference_struct
from lgvi_kernels.lanes.matrix3 import apply
from lgvi_kernels.lanes.state import wrench_struct
from lgvi_kernels.lanes.sums import place
from lgvi_kernels.lanes.view import remember, remembered
from lgvi_kernels.maps.compose import superpose
from lgvi_kernels.maps.in_turn import ROLES, in_turn
from lgvi_kernels.maps.submaps import look, rotate

CONTROL_NON_FINITE = 8

# What each look notes in rows of the memory, in this order, and how many it takes: the demand X Y Z K M N; the measurement:
# position, attitude row by row, velocities over ground and through the water, angular velocity, heading; the reference:
# position, attitude, velocity, angular velocity, heading, speed, angular acceleration.
NOTED = {"demand": 6, "measured": 22, "reference": 23}
# Each of these vectors where any of it is saved, or the host is asked: bits of a number of the launch say so, so that what is
# saved changes no code, and with it no bit. For each row of what is noted, the number of its bit.
BITS_OF_ROWS = {
    "demand": (0,) * 6,
    "measured": (1,) * 3 + (2,) * 9 + (3,) * 3 + (4,) * 3 + (5,) * 3 + (6,),
    "reference": (7,) * 3 + (8,) * 9 + (9,) * 3 + (10,) * 3 + (11,) + (12,) + (13,) * 3,
}
ALL_NOTES = (1 << 14) - 1


def bit(group, row):
    """The bit that says whether a look notes the vector in which this row of a group is."""
    return 1 << BITS_OF_ROWS[group][row]


MEASURED_ROW = NOTED["demand"]
REFERENCE_ROW = MEASURED_ROW + NOTED["measured"]


def make_feed(spec, types, method, at_step, opened):
    """(feed, respond): the alarm after a look at the state after k steps.

    Where the host is asked, feed only measures and guides; respond, at the start of the next launch, does the rest with what
    the host has written into the memory. method: see Step; at_step, opened: see Stepping.
    """
    width, real, control = spec.width, spec.real, spec.control
    State, Constants, Monitor, Alarm = types.State, types.Constants, types.Monitor, types.Alarm
    Measurement, Reference = measurement_struct(width, real, spec.shared_rows), reference_struct(width, real)
    Wrench, Lane = wrench_struct(width, real), types.Lane
    measure, guide, act, allocate, send = (in_turn(control.parts, role) for role in ROLES)
    velocities, momentum, water_velocity = method.velocities, method.momentum, method.water_velocity
    drifts = superpose(spec.laws, "flow") is not None
    turned, moved, checked = "axes" in spec.parts, "origin" in spec.parts, spec.checked
    compensated, reports = spec.compensated, control.reports
    note_actuators = make_note_actuators(spec, types.View, at_step)

    @wp.func
    def put3(memory: wp.array2d(dtype=Lane), i: int, row: int, v: Any):
        set_element(memory, i, row, 0, v.x)
        set_element(memory, i, row, 1, v.y)
        set_element(memory, i, row, 2, v.z)

    @wp.func
    def get3(memory: wp.array2d(dtype=Lane), i: int, row: int):
        return vec3(element(memory, i, row, 0), element(memory, i, row, 1), element(memory, i, row, 2))

    @wp.func
    def truth(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64):
        """The motion in the user's axes, about his origin."""
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
        y.look = k // monitor.every
        y.table = c.table
        y.memory = c.memory
        y.packet = c.packet
        y.entry = c.entry
        return y

    @wp.func
    def upright(like: Lane):
        """No wish: at rest, upright, heading north."""
        r = Reference()
        zero = ones(like) - ones(like)
        r.north = vec3(ones(like), zero, zero)
        r.east = vec3(zero, ones(like), zero)
        r.down = vec3(zero, zero, ones(like))
        return r

    # Not inlined: what more is computed of what is noted must not change how the compiler joins products and sums before.
    @wp.func(inline=False)
    def put_heading(memory: wp.array2d(dtype=Lane), i: int, attitude: int, row: int):
        """The heading of an attitude of which the rows are noted."""
        north = element(memory, i, attitude, 0)
        set_element(memory, i, row, 0, arctangent2(element(memory, i, attitude + 3, 0), north))

    @wp.func
    def put_attitude(a: Any, memory: wp.array2d(dtype=Lane), i: int, row: int):
        put3(memory, i, row, a.north)
        put3(memory, i, row + 3, a.east)
        put3(memory, i, row + 6, a.down)

    @wp.func
    def put_heading_of(a: Any, memory: wp.array2d(dtype=Lane), i: int, attitude: int, row: int):
        set_element(memory, i, attitude, 0, a.north.x)
        set_element(memory, i, attitude + 3, 0, a.east.x)
        put_heading(memory, i, attitude, row)

    @wp.func
    def put_measured(y: Any, memory: wp.array2d(dtype=Lane), i: int, row: int, noting: int):
        if (noting & wp.static(bit("measured", 0))) != 0:
            put3(memory, i, row, y.position)
        if (noting & wp.static(bit("measured", 3))) != 0:
            put_attitude(y, memory, i, row + 3)
        if (noting & wp.static(bit("measured", 12))) != 0:
            put3(memory, i, row + 12, y.velocity)
        if (noting & wp.static(bit("measured", 15))) != 0:
            put3(memory, i, row + 15, y.water_velocity)
        if (noting & wp.static(bit("measured", 18))) != 0:
            put3(memory, i, row + 18, y.angular_velocity)
        if wp.static(control.headings):
            if (noting & wp.static(bit("measured", 21))) != 0:
                put_heading_of(y, memory, i, row + 3, row + 21)

    @wp.func
    def put_reference(r: Any, memory: wp.array2d(dtype=Lane), i: int, row: int, noting: int):
        if (noting & wp.static(bit("reference", 0))) != 0:
            put3(memory, i, row, r.position)
        if (noting & wp.static(bit("reference", 3))) != 0:
            put_attitude(r, memory, i, row + 3)
        if (noting & wp.static(bit("reference", 12))) != 0:
            put3(memory, i, row + 12, r.velocity)
        if (noting & wp.static(bit("reference", 15))) != 0:
            put3(memory, i, row + 15, r.angular_velocity)
        if wp.static(control.headings):
            if (noting & wp.static(bit("reference", 18))) != 0:
                put_heading_of(r, memory, i, row + 3, row + 18)
        if (noting & wp.static(bit("reference", 19))) != 0:
            set_element(memory, i, row + 19, 0, r.speed)
        if (noting & wp.static(bit("reference", 20))) != 0:
            put3(memory, i, row + 20, r.angular_acceleration)

    @wp.func
    def put_look(monitor: Monitor, start: int, j: int, i: int, v: Any):
        """Write those of numbers j to j + 2 of the motion that are gathered."""
        if monitor.columns[j] >= 0:
            monitor.looks[start + monitor.columns[j], i] = v.x
        if monitor.columns[j + 1] >= 0:
            monitor.looks[start + monitor.columns[j + 1], i] = v.y
        if monitor.columns[j + 2] >= 0:
            monitor.looks[start + monitor.columns[j + 2], i] = v.z

    @wp.func
    def gather_motion(y: Any, x: State, c: Constants, monitor: Monitor):
        """Write the motion at a look into the look's rows."""
        start = (y.look % monitor.slots) * monitor.numbers
        put_look(monitor, start, 0, c.packet, y.position)
        if wp.static(compensated):
            low = (x.b - y.position) + x.b_low
            if wp.static(moved):
                low = low + rotate(x, c.inertia.user_origin)
            # A pair of sums is gathered whole, three numbers and three more.
            put_look(monitor, start + 3, 0, c.packet, low)
        put_look(monitor, start, 3, c.packet, y.north)
        put_look(monitor, start, 6, c.packet, y.east)
        put_look(monitor, start, 9, c.packet, y.down)
        put_look(monitor, start, 12, c.packet, y.velocity)
        put_look(monitor, start, 15, c.packet, y.angular_velocity)

    @wp.func(inline=False)
    def gather_signals(memory: wp.array2d(dtype=Lane), i: int, monitor: Monitor, look: int):
        """Write the signals at a look behind its motion."""
        count = monitor.signals.shape[0]
        start = (look % monitor.slots + 1) * monitor.numbers - count
        for j in range(count):
            monitor.looks[start + j, i] = memory[i, monitor.signals[j]]

    @wp.func
    def gather(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64):
        """Write the signals after a look, where something is gathered at all of them."""
        if monitor.slots > 0:
            if wp.static(reports):
                note_actuators(x, c, h, k)
            gather_signals(c.memory, c.packet, monitor, k // monitor.every)

    @wp.func
    def seen(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, opening: real):
        """What is measured and what is wanted after k steps, both noted."""
        z = opened(at_step(x, k, h), c, -opening)
        if wp.static(momentum is not None):
            z.p = momentum(z)
        y = truth(z, c, monitor, k, h)
        if monitor.slots > 0:
            gather_motion(y, z, c, monitor)
        r = upright(y.position.x)
        if wp.static(measure is not None):
            y = measure(y, r, y, c.loop)
        # Each as soon as it is known, so that what is noted alone need not be kept in registers.
        put_measured(y, c.memory, c.packet, monitor.bus + wp.static(MEASURED_ROW), monitor.noting)
        if wp.static(guide is not None):
            r = guide(r, r, y, c.loop)
        put_reference(r, c.memory, c.packet, monitor.bus + wp.static(REFERENCE_ROW), monitor.noting)
        return y, r

    @wp.func
    def noted(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64):
        """The measurement and the wanted motion that the last look noted."""
        y = truth(x, c, monitor, k, h)
        row = monitor.bus + wp.static(MEASURED_ROW)
        y.position = get3(c.memory, c.packet, row)
        y.north = get3(c.memory, c.packet, row + 3)
        y.east = get3(c.memory, c.packet, row + 6)
        y.down = get3(c.memory, c.packet, row + 9)
        y.velocity = get3(c.memory, c.packet, row + 12)
        y.water_velocity = get3(c.memory, c.packet, row + 15)
        y.angular_velocity = get3(c.memory, c.packet, row + 18)
        r = Reference()
        row = monitor.bus + wp.static(REFERENCE_ROW)
        r.position = get3(c.memory, c.packet, row)
        r.north = get3(c.memory, c.packet, row + 3)
        r.east = get3(c.memory, c.packet, row + 6)
        r.down = get3(c.memory, c.packet, row + 9)
        r.velocity = get3(c.memory, c.packet, row + 12)
        r.angular_velocity = get3(c.memory, c.packet, row + 15)
        r.speed = element(c.memory, c.packet, row + 19, 0)
        r.angular_acceleration = get3(c.memory, c.packet, row + 20)
        return y, r

    @wp.func
    def acted(alarm: Alarm, y: Any, r: Any, c: Constants, monitor: Monitor):
        """Control, allocate and send; the alarm with that of lanes whose commands are no numbers."""
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
            alarm.code = positive(alarm.code, alarm.code, bad)
        return alarm

    @wp.func(inline=False)
    def feed(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, opening: real):
        """Measure, guide, control, allocate, send."""
        y, r = seen(x, c, monitor, k, h, opening)
        alarm = acted(x.alarm, y, r, c, monitor)
        gather(x, c, monitor, k, h)
        return alarm

    @wp.func(inline=False)
    def ask(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, opening: real):
        """Measure and guide."""
        y, r = seen(x, c, monitor, k, h, opening)
        gather(x, c, monitor, k, h)
        return x.alarm

    @wp.func(inline=False)
    def respond(x: State, c: Constants, monitor: Monitor, k: int, h: wp.float64):
        """Control, allocate and send, with what the last look noted and the host's answer."""
        y, r = noted(x, c, monitor, k, h)
        alarm = acted(x.alarm, y, r, c, monitor)
        gather(x, c, monitor, k, h)
        return alarm

    return (ask, respond) if control.asked else (feed, method.step)


def make_note_actuators(spec, View, at_step):
    """(x, c, h, k): the actuators write where they are into the bus (role `report` of their laws); nothing where none does."""
    report = superpose(spec.laws, "report")

    # It takes a view and the laws' numbers alone: all constants of a packet would take longer to pass than to use.
    @wp.func(inline=False)
    def write_report(view: View, params: Any):
        if wp.static(report is not None):
            view = report(view, view, params)

    @wp.func
    def note_actuators(x: Any, c: Any, h: wp.float64, k: int):
        write_report(look(View(), at_step(x, k, h), c, x.b.x.dtype(h)), c.params)

    return note_actuators


def make_signals(Lane):
    """(keep_signals, sample_signals): of lanes that freeze the signals are kept, and samples write them."""

    @wp.func(inline=False)
    def keep_signals(memory: wp.array2d(dtype=Lane), i: int, monitor: Any, half: int, code: Lane):
        """half: where the memory's half begins that holds the signals of lanes with a code."""
        for j in range(monitor.signals.shape[0]):
            held = memory[i, half + monitor.signals[j]]
            memory[i, monitor.kept + j] = positive(code, held, memory[i, monitor.kept + j])

    @wp.func(inline=False)
    def sample_signals(
        out: wp.array2d(dtype=Lane), i: int, end: int, memory: wp.array2d(dtype=Lane), monitor: Any, frozen: Lane
    ):
        """Write the signals as the last numbers of a sample, which ends before the column `end`."""
        count = monitor.signals.shape[0]
        for j in range(count):
            live = memory[i, monitor.signals[j]]
            out[i, end - count + j] = positive(frozen, memory[i, monitor.kept + j], live)

    return keep_signals, sample_signals
