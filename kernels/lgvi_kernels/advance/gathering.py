# SPDX-License-Identifier: Apache-2.0
"""What is gathered at a controller's ticks, and the signals that samples write."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, mul, positive, sub  # noqa: F401
from lgvi_kernels.maps.compose import superpose
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


def make_gather(spec, types, at_step):
    """(x, c, monitor, k, h): write the signals after a tick, where something is gathered at all of them."""
    State, Constants, Monitor, reports = types.State, types.Constants, types.Monitor, spec.control.reports
    note_actuators = make_note_actuators(spec, types, at_step)

    @wp.func(inline=False)
    def gather_signals(c: wp.ref[Constants], monitor: wp.ref[Monitor], tick: int):
        """Write the signals at a tick behind its motion."""
        count = monitor.signals.shape[0]
        start = ((tick - monitor.first_tick) % monitor.slots + 1) * monitor.numbers - count
        for j in range(count):
            monitor.ticks[start + j, c.packet] = c.memory[c.packet, monitor.signals[j]]

    @wp.func
    def gather(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64):
        if monitor.slots > 0:
            if wp.static(reports):
                note_actuators(x, c, h, k)
            gather_signals(c, monitor, k // monitor.every)

    return gather


@functools.cache
def make_note_actuators(spec, types, at_step):
    """(x, c, h, k): the actuators write where they are into the bus (role `report` of their laws); nothing where none does."""
    State, Constants, View, real = types.State, types.Constants, types.View, spec.real
    report = superpose(spec.laws, "report")

    @wp.func(inline=False)
    def note_actuators(x: wp.ref[State], c: wp.ref[Constants], h: wp.float64, k: int):
        if wp.static(report is not None):
            view = look(View(), at_step(x, k, h), c, real(h))
            view = report(view, view, c.params)

    return note_actuators


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
