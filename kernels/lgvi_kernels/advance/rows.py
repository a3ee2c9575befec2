# SPDX-License-Identifier: Apache-2.0
"""A packet's state and its samples as rows of lanes in arrays."""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, mul, ones, positive, vec3  # noqa: F401
from lgvi_kernels.lanes.packet import put

# Numbers of a packet's state in `state[packet, field]`: R row by row, b, p (or R p, see Spec.inertial), pi; with compensated
# sums as many low parts more, or those of its pace (see pace_struct).
STATE_FIELDS = 18
PACE_FIELDS = 4

# Sampled quantity -> numbers per sample, in the order they are written.
SAMPLE_FIELDS = {"position": 3, "attitude": 9, "velocity": 3, "angular_velocity": 3}
# Columns at the end of a packet's samples where the fields go that are not saved.
WASTE = 9


@functools.cache
def make_rows(Lane, State, paced, compensated):
    """(read, write, back_up) of the state and of the laws' memory. paced: a packet chooses its steps."""

    @wp.func(inline=True)
    def read(x: wp.ref[State], state: wp.array2d(dtype=Lane), i: int):
        x.R0 = vec3(state[i, 0], state[i, 1], state[i, 2])
        x.R1 = vec3(state[i, 3], state[i, 4], state[i, 5])
        x.R2 = vec3(state[i, 6], state[i, 7], state[i, 8])
        x.b = vec3(state[i, 9], state[i, 10], state[i, 11])
        x.p = vec3(state[i, 12], state[i, 13], state[i, 14])
        x.pi = vec3(state[i, 15], state[i, 16], state[i, 17])
        if wp.static(paced):
            x.pace.stride = state[i, 18][0]
            x.pace.before = state[i, 19][0]
            x.pace.made = state[i, 20][0]
            x.pace.tried = state[i, 21][0]
        if wp.static(compensated):
            x.R0_low = vec3(state[i, 18], state[i, 19], state[i, 20])
            x.R1_low = vec3(state[i, 21], state[i, 22], state[i, 23])
            x.R2_low = vec3(state[i, 24], state[i, 25], state[i, 26])
            x.b_low = vec3(state[i, 27], state[i, 28], state[i, 29])
            x.p_low = vec3(state[i, 30], state[i, 31], state[i, 32])
            x.pi_low = vec3(state[i, 33], state[i, 34], state[i, 35])

    @wp.func
    def write(state: wp.array2d(dtype=Lane), i: int, x: Any):
        put(state, i, 0, x.R0)
        put(state, i, 3, x.R1)
        put(state, i, 6, x.R2)
        put(state, i, 9, x.b)
        put(state, i, 12, x.p)
        put(state, i, 15, x.pi)
        if wp.static(paced):
            unity = ones(x.b.x)
            state[i, 18] = x.pace.stride * unity
            state[i, 19] = x.pace.before * unity
            state[i, 20] = x.pace.made * unity
            state[i, 21] = x.pace.tried * unity
        if wp.static(compensated):
            put(state, i, 18, x.R0_low)
            put(state, i, 21, x.R1_low)
            put(state, i, 24, x.R2_low)
            put(state, i, 27, x.b_low)
            put(state, i, 30, x.p_low)
            put(state, i, 33, x.pi_low)

    @wp.func
    def back_up(memory: wp.array2d(dtype=Lane), i: int, source: int, target: int):
        """Copy one half of the memory to the other: half 0 is in use, half 1 keeps that of the start of a chunk."""
        rows = memory.shape[1] // 2
        for j in range(rows):
            memory[i, target * rows + j] = memory[i, source * rows + j]

    return read, write, back_up


def make_sample(Lane, compensated, method, drifts, still):
    """The function that writes one sample.

    method: see Step; drifts: the water moves; still: a frozen lane keeps the velocity of the water in which it stopped.
    """
    momentum, velocities, water_velocity = method.momentum, method.velocities, method.water_velocity

    @wp.func
    def sample(out: wp.array2d(dtype=Lane), i: int, first: int, columns: wp.vec4i, x: Any, c: Any, h: Any, monitor: Any,
               frozen: Lane):  # fmt: skip
        """Write b, R, nu (that of the water added) and Om from `first` on, at their columns or, without one, at the row's end.

        The code has no branches, whatever is saved: so the compiler joins the same products with the same sums.
        """
        waste = out.shape[1] - wp.static(WASTE)
        o = wp.where(columns[0] < 0, waste, first + columns[0])
        put(out, i, o, x.b)
        if wp.static(compensated):
            put(out, i, o + 3, x.b_low)
        o = wp.where(columns[1] < 0, waste, first + columns[1])
        put(out, i, o, x.R0)
        put(out, i, o + 3, x.R1)
        put(out, i, o + 6, x.R2)
        if wp.static(momentum is not None):
            x.p = momentum(x)
        nu, Om = velocities(c.inertia, x.p, x.pi)
        if wp.static(drifts):
            water = water_velocity(x, c, h)
            if wp.static(still):
                kept = vec3(monitor.still[i, 0], monitor.still[i, 1], monitor.still[i, 2])
                water = positive(frozen, kept, water)
            nu = nu + water
        put(out, i, wp.where(columns[2] < 0, waste, first + columns[2]), nu)
        put(out, i, wp.where(columns[3] < 0, waste, first + columns[3]), Om)

    return sample
