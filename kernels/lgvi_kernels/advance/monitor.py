# SPDX-License-Identifier: Apache-2.0
"""Checks beside the alarms of each step: rows of warnings, energy that must not grow, strong drag.

A look sees the state at the end of a step, once in so many steps: its code lies outside the loop over the steps, whose
registers it would take. A kernel has only the checks that it is asked for. Values are squares, as those of alarms are.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import (  # noqa: F401
    absolute,
    add,
    cross,
    div,
    dot,
    int_lane,
    lane,
    mul,
    neg,
    ones,
    positive,
    sub,
    vec3,
)
from lgvi_kernels.lanes.functions import greatest
from lgvi_kernels.lanes.matrix3 import apply
from lgvi_kernels.lanes.state import struct
from lgvi_kernels.maps.compose import superpose
from lgvi_kernels.maps.submaps import look, rotate

ENERGY_GREW = 6
BACKWARD_DRAG = 7

# Row -> the bit of its warning; of two that a member has, the higher is the more serious.
BITS = {
    "precision": 1,
    "orthogonality": 2,
    "munk_coarse": 3,
    "rotation": 5,
    "drag": 6,
    "munk_unstable": 7,
    "energy": 9,
}

# Energy created, over the energy that could be exchanged, beyond which the member has failed.
MOST_ENERGY = 100.0
# Drag number of the stages that go backward beyond which the member has failed: at 1 drag alone has no past.
MOST_BACKWARD_DRAG = 0.5

# T and U at the start, and the energy that both could give from there.
ENERGY_FIELDS = 3
EPSILON = {wp.float64: 2.0**-52, wp.float32: 2.0**-23}
# Round-off of energies that cancel, in units of EPSILON: as large as that of a float32 attitude between two renormalisations.
ROUND_OFF = 1e4


@functools.cache
def limits_struct(width, real, rows):
    """The numbers that rows compare with. munk: (h w)^2 per |p|^2; step: h [s]; the rest are the limits, squared."""
    fields = {f"{row}_limit": real for row in rows}
    if "munk_coarse" in rows:
        fields["munk"] = lane(width, real)
    if "precision" in rows or "rotation" in rows or "drag" in rows:
        fields["step"] = real
    return struct("Limits", **fields) if fields else struct("NoLimits", unused=wp.uint8)


@functools.cache
def seen_struct(width, real):
    """Per lane: the bits of the rows that are crossed, as a number, and the square of the most serious one's value."""
    Lane = lane(width, real)
    return struct("Seen", bits=Lane, size=Lane)


@functools.cache
def monitor_struct(width, real, rows, energy, backward, substep, still, loop=None, accounted=False):
    """The kernel's argument: limits, one entry or one a packet, and the results of looks, by packet.

    warned: bits; warned_step and warned_size: steps made at the first crossing of the most serious row, and its square.
    energy: rows of ENERGY_FIELDS. backward: the part of h that stages go back at once. substeps: steps that were divided.
    still: R^T u where and when a lane was frozen, three rows.
    loop: of a controller, the struct given, one entry or one a packet; every: steps between its ticks; start: the step of the
    first one; commands: how many are in the first rows of the memory; bus: the first row of what ticks note; noting: bits of
    what they do; parts, part_rows: rows that the parts remember, put aside from `spare` on while they note. signals: rows of
    the memory that are saved with a sample; kept: the first of as many rows, what frozen lanes save; first_signals: what they
    are at the first sample.
    ticks: what is gathered at ticks, (slots times numbers, packets), `numbers` rows for each; slots: how many ticks it holds,
    0 for none gathered; first_tick: the number of the one in the first slot; columns: for each number of SAMPLE_FIELDS in turn
    its row of a tick, -1 if it is not gathered.
    account: of a scene that sums the energy used, its row of the memory (see maps/accounting.py).
    """
    Lane, Ints = lane(width, real), int_lane(width)
    fields = {}
    if rows:
        fields["limits"] = wp.array(dtype=limits_struct(width, real, rows))
        fields |= {"warned": wp.array(dtype=Ints), "warned_step": wp.array(dtype=Ints)}
        fields["warned_size"] = wp.array(dtype=Lane)
    if energy:
        fields["energy"] = wp.array2d(dtype=Lane)
    if backward:
        fields["backward"] = real
    if substep:
        fields["substeps"] = wp.array(dtype=Ints)
    if still:
        fields["still"] = wp.array2d(dtype=Lane)
    if loop is not None:
        fields |= {"loop": wp.array(dtype=loop), "every": wp.int32, "commands": wp.int32, "bus": wp.int32}
        fields |= {"noting": wp.int32, "kept": wp.int32, "start": wp.int32}
        fields |= dict.fromkeys(("parts", "part_rows", "spare"), wp.int32)
        fields |= {"signals": wp.array(dtype=wp.int32), "first_signals": wp.array2d(dtype=Lane)}
        fields |= {"ticks": wp.array2d(dtype=Lane), "slots": wp.int32, "first_tick": wp.int32, "numbers": wp.int32}
        fields["columns"] = wp.array(dtype=wp.int32)
    elif accounted:
        fields |= {"kept": wp.int32, "signals": wp.array(dtype=wp.int32), "first_signals": wp.array2d(dtype=Lane)}
    if accounted:
        fields["account"] = wp.int32
    return struct("Monitor", **fields) if fields else struct("NoMonitor", unused=wp.uint8)


@wp.func
def size3(v: Any):
    """The sizes of three components."""
    return vec3(absolute(v.x), absolute(v.y), absolute(v.z))


@wp.func
def largest(v: Any):
    """The greatest of three numbers."""
    return greatest(v.x, greatest(v.y, v.z))


def make_drag_rate(by_directions, parts, velocities, factor):
    """(x, c) -> the largest (l + factor q|v|) / I over the axes of drag [1/s], where the first law is drag along axes."""
    linear_force, linear_torque, quadratic_force, quadratic_torque = (
        part in parts for part in ("linear_force", "linear_torque", "quadratic_force", "quadratic_torque")
    )

    @wp.func
    def drag_rate(x: Any, c: Any):
        p = c.params.own
        along = x.p
        about = x.pi
        if wp.static(by_directions):
            nu, Om = velocities(c.inertia, x.p, x.pi)
            about = apply(p.turn, Om)
            along = apply(p.turn, nu) - cross(about, p.origin)
        f = along.x.dtype(wp.static(factor))
        force = along - along
        torque = force
        if wp.static(linear_force):
            force = p.linear_force
        if wp.static(quadratic_force):
            force = force + f * (p.quadratic_force * size3(along))
        if wp.static(linear_torque):
            torque = p.linear_torque
        if wp.static(quadratic_torque):
            torque = torque + f * (p.quadratic_torque * size3(about))
        return greatest(largest(force), largest(torque))

    return drag_rate


def make_matrix_rate(View, Damping, damping, velocities):
    """The same for damping matrices, by their diagonals: D of twice the velocities has l + 2 q|v| there."""

    @wp.func
    def matrix_rate(x: Any, c: Any):
        view = look(View(), x, c, x.b.x.dtype(0.0))
        nu, Om = velocities(c.inertia, x.p, x.pi)
        view.nu = nu + nu
        view.Om = Om + Om
        D = damping(Damping(), view, c.params)
        M = c.inertia.M.diagonal
        J = c.inertia.J_forces.diagonal
        force = size3(vec3(D.force_velocity.row0.x, D.force_velocity.row1.y, D.force_velocity.row2.z) / M)
        torque = size3(vec3(D.torque_rate.row0.x, D.torque_rate.row1.y, D.torque_rate.row2.z) / J)
        return c.inertia.inverse_scale * greatest(largest(force), largest(torque))

    return matrix_rate


def make_sum(unity, damping):
    """The sum of two rates: of drag along axes, and of damping matrices beside it."""

    @wp.func
    def rate(x: Any, c: Any):
        return unity(x, c) + damping(x, c)

    return rate


def make_backward(drag_rate):
    """The alarm of each step whose method has stages that go backward.

    Backward in time drag makes a vehicle faster, and where the drag number is 1 or more, infinitely fast within the stage.
    """

    @wp.func
    def backward(x: Any, c: Any, length: Any):
        n = length * drag_rate(x, c)
        unity = ones(n)
        over = n - length.dtype(wp.static(MOST_BACKWARD_DRAG)) * unity
        code = positive(over, length.dtype(wp.static(float(BACKWARD_DRAG))) * unity, unity - unity)
        x.alarm.size = positive(x.alarm.code, x.alarm.size, positive(over, n * n, x.alarm.size))
        x.alarm.code = positive(x.alarm.code, x.alarm.code, code)
        return x

    return backward


def make_energy(laws, real, View, velocities, shifted):
    """Functions (energies, supplies, growth) of states: T and U; what they can give; the energy created, over that.

    Energies are divided by max J, as momenta are.

    shifted: the forces have another origin than the state.
    """
    potential, supply, steady_size = (superpose(laws, role) for role in ("energy", "supply", "steady_size"))

    @wp.func
    def energies(x: Any, c: Any):
        """(T, U)."""
        nu, Om = velocities(c.inertia, x.p, x.pi)
        T = real(0.5) * (dot(x.p, nu) + dot(x.pi, Om))
        U = T - T
        if wp.static(potential is not None):
            view = look(View(), x, c, real(0.0))
            if wp.static(shifted):
                view.b = view.b + rotate(x, c.inertia.user_origin - c.inertia.user_origin_forces)
            U = c.inertia.inverse_scale * potential(U, view, c.params)
        return T, U

    @wp.func
    def supplies(x: Any, c: Any, T: Any):
        """The kinetic energy, and what potentials with a least value can give from here."""
        s = T - T
        if wp.static(supply is not None):
            s = c.inertia.inverse_scale * supply(s, look(View(), x, c, real(0.0)), c.params)
        return T + s

    @wp.func
    def growth(x: Any, c: Any, t: Any, T0: Any, U0: Any, S0: Any):
        """(E - E0) over the energy that could be exchanged. The round-off of U is added to it, and so raises no alarm.

        A steady force F gives in the time t no more than (F t)^2 / (2 M), whatever else acts; 3 `mean` is above all 1 / M.
        """
        T, U = energies(x, c)
        S = S0 + real(wp.static(ROUND_OFF * EPSILON[real])) * (absolute(U) + absolute(U0))
        if wp.static(steady_size is not None):
            impulse = t * (c.inertia.inverse_scale * steady_size(T - T, look(View(), x, c, real(0.0)), c.params))
            S = S + real(1.5) * (c.inertia.mean * impulse * impulse)
        return ((T - T0) + (U - U0)) / S

    return energies, supplies, growth


@wp.func
def noted(crossings: Any, excess: Any, number: Any, square: Any):
    """Add a row where its excess is positive; rows come in the order of their bits, so that the last one's value stays."""
    crossings.bits = crossings.bits + positive(excess, number * ones(excess), ones(excess) - ones(excess))
    crossings.size = positive(excess, square, crossings.size)
    return crossings


def make_look(rows, width, real, velocities, drag_rate):
    """(x, c, limits, growth) -> Seen: the rows that this state crosses. drag_rate: of drag that a method treats explicitly."""
    Seen = seen_struct(width, real)
    number = {row: float(2 ** BITS[row]) for row in BITS}

    @wp.func
    def look_at(x: Any, c: Any, limits: Any, growth: Any):
        crossings = Seen()
        unity = ones(x.b.x)
        zero = unity - unity
        nu, Om = velocities(c.inertia, x.p, x.pi)
        if wp.static("precision" in rows):
            step = limits.step * limits.step
            # At rest, where moved is 0, no digit of a motion is lost.
            moved = step * dot(nu, nu)
            lost = real(wp.static(EPSILON[real] ** 2)) * dot(x.b, x.b)
            excess = positive(moved, lost - limits.precision_limit * moved, zero - unity)
            crossings = noted(crossings, excess, real(wp.static(number["precision"])), lost / moved)
        if wp.static("orthogonality" in rows):
            d = largest(size3(vec3(dot(x.R0, x.R0) - unity, dot(x.R1, x.R1) - unity, dot(x.R2, x.R2) - unity)))
            d = greatest(d, largest(size3(vec3(dot(x.R0, x.R1), dot(x.R1, x.R2), dot(x.R2, x.R0)))))
            excess = d * d - limits.orthogonality_limit * unity
            crossings = noted(crossings, excess, real(wp.static(number["orthogonality"])), d * d)
        if wp.static("munk_coarse" in rows):
            w = limits.munk * dot(x.p, x.p)
            crossings = noted(
                crossings, w - limits.munk_coarse_limit * unity, real(wp.static(number["munk_coarse"])), w
            )
        if wp.static("rotation" in rows):
            turn = (limits.step * limits.step) * dot(Om, Om)
            crossings = noted(
                crossings, turn - limits.rotation_limit * unity, real(wp.static(number["rotation"])), turn
            )
        if wp.static("drag" in rows):
            d = limits.step * drag_rate(x, c)
            crossings = noted(crossings, d * d - limits.drag_limit * unity, real(wp.static(number["drag"])), d * d)
        if wp.static("munk_unstable" in rows):
            w = limits.munk * dot(x.p, x.p)
            crossings = noted(
                crossings, w - limits.munk_unstable_limit * unity, real(wp.static(number["munk_unstable"])), w
            )
        if wp.static("energy" in rows):
            g = greatest(growth, zero)
            crossings = noted(crossings, g * g - limits.energy_limit * unity, real(wp.static(number["energy"])), g * g)
        return crossings

    return look_at
