# SPDX-License-Identifier: Apache-2.0
"""Measurements of a controller along given motions: the parts of a scene on the device, without steps."""

from typing import Any

import numpy as np
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.lanes.arithmetic import lane, vec3
from lgvi_kernels.lanes.state import table_number
from lgvi_kernels.lanes.tick import measurement_struct
from lgvi_kernels.maps.in_turn import in_turn
from lgvi_warp.engine.packets import Packets
from lgvi_warp.runs.settle import make_plan
from tests.support.loops import torpedo

# Position, attitude row by row, velocity, velocity through the water, angular velocity.
FIELDS = 21


def scene(sensors, faults=(), period=0.1, events=(), **law):
    """A vehicle with these sensors and a law that needs nothing of them."""
    laws, guidance = [lw.control.HeadingPID(**{"kp": 1.0} | law)], [lw.control.SetPoint(heading=0.0)]
    controller = lw.Controller(period=period, sensors=sensors, guidance=guidance, laws=laws, faults=faults)
    vehicle, water = torpedo(196.0, (0.0, 0.0, -0.02)), lw.Environment(9.8)
    return lw.Scene(vehicle, water, [lw.terms.ControlWrench()], controller=controller, events=events)


def measured(ensemble, truth, h=0.02, dtype="float64", width=4, bus=None):
    """Measurements at each tick, (ticks, members, FIELDS), of motions truth (ticks, members or 1, FIELDS).

    bus: a list that gets the memory (rows, members) as the last tick leaves it, the rows of the bus first.
    """
    controller = ensemble.scene.controller
    plan = make_plan(ensemble, "psi_s", h, 1.0, dtype=dtype, width=width)
    n, ticks = ensemble.members, len(truth)
    packets = Packets(plan, ensemble.select(0, n))
    spec = plan.spec
    kernel = _kernel(spec.control.parts, plan.kernel.advance.types.Loop, width, spec.real, spec.shared_rows)
    every, kind = controller.every(h), np.float64 if dtype == "float64" else np.float32
    lanes = np.zeros((packets.count * width, ticks, FIELDS))
    lanes[:n] = np.broadcast_to(truth, (ticks, n, FIELDS)).transpose(1, 0, 2)
    rows = np.ascontiguousarray(lanes.reshape(packets.count, width, ticks, FIELDS).transpose(0, 2, 3, 1), kind)
    rows = rows.reshape(packets.count, ticks * FIELDS, width)
    given = wp.array(rows, dtype=lane(width, plan.spec.real), device="cpu")
    out = wp.zeros((packets.count, ticks * FIELDS), dtype=lane(width, plan.spec.real), device="cpu")
    inputs = [given, packets.laws.structs[1].array, packets.laws.table.array, packets.memory, every, h, ticks, out]
    wp.launch(kernel, dim=packets.count, inputs=inputs, device="cpu")
    if bus is not None:
        rows_left = packets.laws.memory.view
        bus.append(rows_left.transpose(1, 0, 2).reshape(rows_left.shape[1], -1)[:, :n].copy())
    seen = out.numpy().reshape(packets.count, ticks, FIELDS, width).transpose(1, 0, 3, 2)
    return seen.reshape(ticks, -1, FIELDS)[:, :n]


_kernels = {}


def _kernel(parts, Loop, width, real, shared):
    """Kept: a Warp kernel for each set of parts."""
    key = parts, Loop, width, real, shared
    if key not in _kernels:
        _kernels[key] = _make(in_turn(parts, "measure"), Loop, width, real, shared)
    return _kernels[key]


def _make(measure, Loop, width, real, shared):
    Lane, Measurement = lane(width, real), measurement_struct(width, real, shared)
    Number = table_number(width, real, shared)

    @wp.func
    def three(rows: wp.array2d(dtype=Lane), i: int, at: int):
        return vec3(rows[i, at], rows[i, at + 1], rows[i, at + 2])

    @wp.func
    def put(rows: wp.array2d(dtype=Lane), i: int, at: int, v: Any):
        rows[i, at] = v.x
        rows[i, at + 1] = v.y
        rows[i, at + 2] = v.z

    @wp.kernel(module="unique", enable_backward=False)
    def run(supplied: wp.array2d(dtype=Lane), loop: wp.array(dtype=Loop), table: wp.array2d(dtype=Number),
            memory: wp.array2d(dtype=Lane), every: int, h: wp.float64, ticks: int, out: wp.array2d(dtype=Lane)):  # fmt: skip
        i = wp.tid()
        p = loop[i % loop.shape[0]]
        for k in range(ticks):
            at = k * wp.static(FIELDS)
            y = Measurement()
            y.position = three(supplied, i, at)
            y.north = three(supplied, i, at + 3)
            y.east = three(supplied, i, at + 6)
            y.down = three(supplied, i, at + 9)
            y.velocity = three(supplied, i, at + 12)
            y.water_velocity = three(supplied, i, at + 15)
            y.angular_velocity = three(supplied, i, at + 18)
            y.h = real(h)
            y.step = k * every
            y.tick = k
            y.t = real(wp.float64(y.step) * h)
            y.period = real(wp.float64(every) * h)
            y.table = table
            y.entry = i % table.shape[0]
            y.memory = memory
            y.packet = i
            y = measure(y, y, y, p)
            put(out, i, at, y.position)
            put(out, i, at + 3, y.north)
            put(out, i, at + 6, y.east)
            put(out, i, at + 9, y.down)
            put(out, i, at + 12, y.velocity)
            put(out, i, at + 15, y.water_velocity)
            put(out, i, at + 18, y.angular_velocity)

    return run
