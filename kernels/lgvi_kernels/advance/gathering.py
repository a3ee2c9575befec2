# SPDX-License-Identifier: Apache-2.0
"""Values gathered at a controller's ticks, and signals that samples write."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.advance.noting import EXERTED_ROW, put3
from lgvi_kernels.lanes.arithmetic import add, cross, mul, neg, positive, sub  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply
from lgvi_kernels.lanes.state import damping_struct, view_struct, wrench_struct
from lgvi_kernels.maps.compose import superpose
from lgvi_kernels.maps.dissipation import damped_force, damped_torque
from lgvi_kernels.maps.submaps import look, rotate


@wp.func
def put_tick(monitor: Any, start: int, j: int, i: int, v: Any):
    """Write those of numbers j to j + 2 of the motion that are gathered."""
    if monitor.columns[j] >= 0:
        monitor.ticks[start + monitor.columns[j], i] = v.x
    if monitor.columns[j + 1] >= 0:
        monitor.ticks[start + monitor.columns[j + 1], i] = v.y
    if monitor.columns[j + 2] >= 0:
        monitor.ticks[start + monitor.columns[j + 2], i] = v.z


def make_gather_motion(compensated, moved):
    """(y, x, c, monitor): write the motion at a tick into the tick's rows; moved: see make_truth."""

    @wp.func
    def gather_motion(y: Any, x: Any, c: Any, monitor: Any):
        start = ((y.tick - monitor.first_tick) % monitor.slots) * monitor.numbers
        put_tick(monitor, start, 0, c.packet, y.position)
        if wp.static(compensated):
            low = (x.b - y.position) + x.b_low
            if wp.static(moved):
                low = low + rotate(x, c.inertia.user_origin)
            # A pair of sums is gathered whole, three numbers and three more.
            put_tick(monitor, start + 3, 0, c.packet, low)
        put_tick(monitor, start, 3, c.packet, y.north)
        put_tick(monitor, start, 6, c.packet, y.east)
        put_tick(monitor, start, 9, c.packet, y.down)
        put_tick(monitor, start, 12, c.packet, y.velocity)
        put_tick(monitor, start, 15, c.packet, y.angular_velocity)

    return gather_motion


def make_gather(spec, types, method, at_step, opened):
    """(x, c, monitor, k, h, opening): write the signals after a tick, where something is gathered at all of them."""
    State, Constants, Monitor, reports = types.State, types.Constants, types.Monitor, spec.control.reports
    note_actuators, real = make_note_actuators(spec, types, method, at_step, opened), spec.real

    @wp.func(inline=False)
    def gather_signals(c: wp.ref[Constants], monitor: wp.ref[Monitor], tick: int):
        """Write the signals at a tick behind its motion."""
        count = monitor.signals.shape[0]
        start = ((tick - monitor.first_tick) % monitor.slots + 1) * monitor.numbers - count
        for j in range(count):
            monitor.ticks[start + j, c.packet] = c.memory[c.packet, monitor.signals[j]]

    @wp.func
    def gather(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: real):
        if monitor.slots > 0:
            if wp.static(reports):
                note_actuators(x, c, monitor, h, k, opening)
            gather_signals(c, monitor, k // monitor.every)

    return gather


@functools.cache
def make_note_actuators(spec, types, method, at_step, opened):
    """(x, c, monitor, h, k, opening): the actuators write where they are into the bus (role `report` of their laws).

    Where it is saved also the wrench that they exert, at the motion x without the lead of its step.
    """
    State, Constants, Monitor, View, real = types.State, types.Constants, types.Monitor, types.View, spec.real
    report, exert = superpose(spec.laws, "report"), make_exert(spec, method)
    exerts = spec.control is not None and spec.control.exerts and report is not None
    momentum = method.momentum

    @wp.func(inline=False)
    def note_actuators(
        x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], h: wp.float64, k: int, opening: real
    ):
        if wp.static(report is not None):
            view = look(View(), at_step(x, k, h), c, real(h))
            view = report(view, view, c.params)
        if wp.static(exerts):
            z = opened(at_step(x, k, h), c, -opening)
            if wp.static(momentum is not None):
                z.p = momentum(z)
            exert(z, c, monitor, h)

    return note_actuators


def make_exert(spec, method):
    """(x, c, monitor, h): note the wrench of the actuators that report, in the user's axes and about his origin."""
    width, real = spec.lanes, spec.real
    View, Wrench, Damping = (
        view_struct(width, real, spec.shared_rows), wrench_struct(width, real), damping_struct(width, real)
    )  # fmt: skip
    law, push, matrix = (
        superpose(spec.laws, role) for role in ("law of actuators", "push of actuators", "matrix of actuators")
    )
    velocities, turned, moved = method.velocities, "axes" in spec.parts, "origin" in spec.parts

    @wp.func
    def exert(x: Any, c: Any, monitor: Any, h: Any):
        view = look(View(), x, c, real(h))
        nu, Om = velocities(c.inertia, x.p, x.pi)
        if wp.static(moved):
            # From the origin of the state to that of the forces.
            r = c.inertia.user_origin - c.inertia.user_origin_forces
            nu = nu + cross(Om, r)
            view.b = view.b + rotate(x, r)
        view.nu = nu
        view.Om = Om
        w = Wrench()
        if wp.static(law is not None):
            w = law(w, view, c.params)
        if wp.static(push is not None):
            w = push(w, view, c.params)
        if wp.static(matrix is not None):
            D = matrix(Damping(), view, c.params)
            w.force = w.force - damped_force(D, nu, Om)
            w.torque = w.torque - damped_torque(D, nu, Om)
        if wp.static(moved):
            w.torque = w.torque - cross(c.inertia.user_origin_forces, w.force)
        if wp.static(turned):
            w.force = apply(c.inertia.axes, w.force)
            w.torque = apply(c.inertia.axes, w.torque)
        put3(c.memory, c.packet, monitor.bus + wp.static(EXERTED_ROW), w.force)
        put3(c.memory, c.packet, monitor.bus + wp.static(EXERTED_ROW + 3), w.torque)

    return exert


@functools.cache
def make_signals(types):
    """(keep_signals, sample_signals, first_signals): of lanes that freeze the signals are kept, and samples write them."""
    Constants, Monitor, Lane = types.Constants, types.Monitor, types.Lane

    @wp.func(inline=False)
    def keep_signals(c: wp.ref[Constants], monitor: wp.ref[Monitor], half: int, code: Lane):
        """half: where the memory's half begins that holds the signals of lanes with a code."""
        for j in range(monitor.signals.shape[0]):
            held = c.memory[c.packet, half + monitor.signals[j]]
            c.memory[c.packet, monitor.kept + j] = positive(code, held, c.memory[c.packet, monitor.kept + j])

    @wp.func(inline=False)
    def sample_signals(
        out: wp.array2d(dtype=Lane), end: int, c: wp.ref[Constants], monitor: wp.ref[Monitor], frozen: Lane
    ):
        """Write the signals as the last numbers of a sample, which ends before the column `end`."""
        count = monitor.signals.shape[0]
        for j in range(count):
            live = c.memory[c.packet, monitor.signals[j]]
            out[c.packet, end - count + j] = positive(frozen, c.memory[c.packet, monitor.kept + j], live)

    @wp.func(inline=False)
    def first_signals(c: wp.ref[Constants], monitor: wp.ref[Monitor], frozen: Lane):
        """Write the signals of the first sample of a run."""
        for j in range(monitor.signals.shape[0]):
            live = c.memory[c.packet, monitor.signals[j]]
            held = c.memory[c.packet, monitor.kept + j]
            monitor.first_signals[c.packet, j] = positive(frozen, held, live)

    return keep_signals, sample_signals, first_signals
