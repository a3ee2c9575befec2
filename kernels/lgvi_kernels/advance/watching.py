# SPDX-License-Identifier: Apache-2.0
"""Looks at a packet now and then: is its energy plausible, and is the step short enough for its motion.

Looks are rare, so their functions are not inlined: mixed with the loop over the steps they would change its schedule and its
registers, which costs a fifth of the speed.
"""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.advance import monitor as monitors
from lgvi_kernels.advance.spec import make_types
from lgvi_kernels.advance.stepping import make_stepping
from lgvi_kernels.lanes.arithmetic import add, any_positive, div, mul, neg, ones, positive, sub  # noqa: F401
from lgvi_kernels.lanes.state import damping_struct, wrench_struct
from lgvi_kernels.laws import drag_directions
from lgvi_kernels.maps.compose import superpose, superpose_loads


class Watching(NamedTuple):
    """begin: looks at the start; note: looks after k steps; energy_alarm: the alarm, after k steps, where energy explodes."""

    begin: Any
    note: Any
    energy_alarm: Any


@functools.cache
def make_watching(spec):
    """The looks of this Spec; functions that it does not ask for are called nowhere."""
    types, stepping, real, width = make_types(spec), make_stepping(spec), spec.real, spec.width
    Lane, State, Constants, Monitor = types.Lane, types.State, types.Constants, types.Monitor
    at_step, opened, momentum = stepping.at_step, stepping.opened, stepping.method.momentum
    energetic, warned = spec.energy, bool(spec.warning_rows)
    look_at, energies, supplies, growth = _looks(spec, stepping.method)

    @wp.func
    def closed(x: State, c: Constants, k: int, h: wp.float64, opening: real):
        """The state after k steps without the lead of the next, with p in body axes."""
        y = opened(at_step(x, k, h), c, -opening)
        if wp.static(momentum is not None):
            y.p = momentum(y)
        return y

    @wp.func
    def created(y: State, c: Constants, monitor: Monitor, t: real):
        """Energy created since the start, over the energy that could be exchanged (see monitor.make_energy)."""
        e = monitor.energy
        return growth(y, c, t, e[c.packet, 0], e[c.packet, 1], e[c.packet, 2])

    @wp.func(inline=False)
    def energy_alarm(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64,
                     opening: real, among: Lane):  # fmt: skip
        """Raise the alarm after k steps in the lanes, among these, whose energy explodes."""
        g = created(closed(x, c, k, h, opening), c, monitor, real(wp.float64(k) * h))
        unity = ones(g)
        over = positive(among, g - real(wp.static(monitors.MOST_ENERGY)) * unity, unity - unity)
        alarm = x.alarm
        alarm.size = positive(alarm.code, alarm.size, positive(over, g * g, alarm.size))
        grew = real(wp.static(float(monitors.ENERGY_GREW))) * unity
        alarm.code = positive(alarm.code, alarm.code, positive(over, grew, unity - unity))
        x.alarm = alarm

    @wp.func
    def warn(y: State, c: Constants, monitor: Monitor, k: int, h: wp.float64, frozen: Lane):
        """Note the rows that are crossed after k steps; for the most serious one, the first such k and its value."""
        # Any lane: no other row reads it.
        g = frozen
        if wp.static("energy" in spec.warning_rows):
            g = created(y, c, monitor, real(wp.float64(k) * h))
        crossings = look_at(y, c, monitor.limits[c.packet % monitor.limits.shape[0]], g)
        bits = positive(frozen, frozen - frozen, crossings.bits)
        if any_positive(bits):
            for j in range(wp.static(width)):
                old = monitor.warned[c.packet][j]
                new = int(bits[j]) & ~old
                if new > old:
                    monitor.warned_step[c.packet][j] = k
                    monitor.warned_size[c.packet][j] = crossings.size[j]
                monitor.warned[c.packet][j] = old | new

    @wp.func(inline=False)
    def begin(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, frozen: Lane):
        """Look at the start, whose energy later ones are compared with."""
        y = x
        if wp.static(momentum is not None):
            y.p = momentum(y)
        if wp.static(energetic):
            T, U = energies(y, c)
            monitor.energy[c.packet, 0] = T
            monitor.energy[c.packet, 1] = U
            monitor.energy[c.packet, 2] = supplies(y, c, T)
        if wp.static(warned):
            warn(y, c, monitor, k, h, frozen)

    @wp.func(inline=False)
    def note(x: wp.ref[State], c: wp.ref[Constants], monitor: wp.ref[Monitor], k: int, h: wp.float64, opening: real,
             frozen: Lane):  # fmt: skip
        """Look at the state after k steps, without the lead of the next."""
        warn(closed(x, c, k, h, opening), c, monitor, k, h, frozen)

    return Watching(begin, note, energy_alarm)


def make_resistance(damping, loads, Wrench):
    """(D, view, params) -> D of damping laws, and of laws that look at the water; None where there are none."""
    if loads is None:
        return damping

    @wp.func
    def resistance(D: Any, view: Any, p: Any):
        if wp.static(damping is not None):
            D = damping(D, view, p)
        D, unused = loads(D, Wrench(), view, p)
        return D

    return resistance


def _looks(spec, method):
    """(look_at, energies, supplies, growth) of monitor.py; the step stands in for those that a Spec does not ask for."""
    width, real, laws = spec.lanes, spec.real, spec.laws
    types = make_types(spec)
    directions = bool(laws) and laws[0] is drag_directions
    velocities, of_forces = method.velocities, method.velocities_of_forces
    look_at, energies, supplies, growth = (method.step,) * 4
    if spec.warning_rows:
        rates = []
        damping = make_resistance(superpose(laws, "damping"), superpose_loads(laws), wrench_struct(width, real))
        if "drag" in spec.warning_rows and spec.drag:
            rates.append(monitors.make_drag_rate(directions, spec.drag, of_forces, 2.0))
        if "drag" in spec.warning_rows and damping is not None:
            rates.append(monitors.make_matrix_rate(types.View, damping_struct(width, real), damping, of_forces))
        rate = monitors.make_sum(*rates) if len(rates) == 2 else (*rates, None)[0]
        look_at = monitors.make_look(spec.warning_rows, width, real, velocities, rate)
    if spec.energy:
        energies, supplies, growth = monitors.make_energy(laws, real, types.View, velocities, "origin" in spec.parts)
    return look_at, energies, supplies, growth
