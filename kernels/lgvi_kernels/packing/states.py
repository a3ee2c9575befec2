# SPDX-License-Identifier: Apache-2.0
"""The states at which members start, in the axes, about the origin and in the units of the kernel that advances them.

lgvi_warp/engine/states.py is the twin: both have the same order of operations, and no multiplication is joined with an
addition here, so both have the same bits.
"""

import functools
from typing import Any

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, cross, div, dot, lane, mul, positive, sub, vec3  # noqa: F401

# As those of the other kernels, but for what would change bits.
EXACT_FLAGS = "-march=native -mprefer-vector-width=512 -mllvm=-inline-threshold=100000 -ffp-contract=off -mstackrealign"

# Rows of `places`: where each kind of numbers lies in memory, and the bytes from member to member and from number to number.
# An address of 0: there are none. MASS: of translation, where inertia is diagonal; INERTIA: 6x6, where it is not. RUN holds
# the number of members, whether p is R p, and whether each number has a low part.
PLACES = (
    "attitude", "position", "velocity", "angular_velocity", "water", "axes", "origin", "mass", "moments", "inertia", "scale",
    "run",
)  # fmt: skip
ATTITUDE, POSITION, VELOCITY, RATE, WATER, AXES, ORIGIN, MASS, MOMENTS, INERTIA, SCALE, RUN = range(len(PLACES))

# What is looked at for warnings, squares of sizes: momentum p [N2 s2], rate [rad2/s2], distance over speed [s2], and velocity
# relative to the water [m2/s2].
PEAKS = 4


def _number(width):
    """C++ that reads the number `at` of a kind for each lane; lanes beyond the last member read that of the last one."""
    V = f"wp::vec_t<{width}, wp::float64>"
    # A function that is called: a copy at each of some eighty places would take seconds to compile.
    return f"""
    struct Read {{
        static __attribute__((noinline)) {V} numbers(const char* begin, wp::int64 step, wp::int64 first, wp::int64 members) {{
            {V} r;
            if (step == 0) {{
                wp::float64 shared;
                memcpy(&shared, begin, sizeof(shared));
                return {V}(shared);
            }}
            if (first + {width} <= members) {{
                begin += first * step;
                for (int j = 0; j < {width}; ++j) memcpy(&r[j], begin + j * step, sizeof(wp::float64));
                return r;
            }}
            for (int j = 0; j < {width}; ++j)
                memcpy(&r[j], begin + (first + j < members ? first + j : members - 1) * step, sizeof(wp::float64));
            return r;
        }}
    }};
    const wp::int64* place = (const wp::int64*)places.data + 3 * kind;
    return Read::numbers((const char*)place[0] + at * place[2], place[1], (wp::int64)packet * {width}, members);
    """


def _put(width, real):
    """C++ that writes lanes into a field of the state, and what is left of them into that of the low part."""
    number = f"wp::{real.__name__}"
    return f"""
    wp::vec_t<{width}, {number}>* row = (wp::vec_t<{width}, {number}>*)state.data + (wp::int64)packet * state.shape[1];
    for (int j = 0; j < {width}; ++j) row[field][j] = ({number})value[j];
    if (low > 0)
        for (int j = 0; j < {width}; ++j) {{
            const wp::float64 left = value[j] - (wp::float64)({number})value[j];
            row[field + low][j] = left - left == 0.0 ? ({number})left : ({number})0.0;
        }}
    """


@wp.func
def across(Q0: Any, Q1: Any, Q2: Any, v: Any):
    """Q^T v for a matrix of rows."""
    return v.x * Q0 + v.y * Q1 + v.z * Q2


@wp.func
def along(R0: Any, R1: Any, R2: Any, v: Any):
    """R v for a matrix of rows."""
    return vec3(dot(R0, v), dot(R1, v), dot(R2, v))


@functools.cache
def make_pack_states(width, real):
    """The kernel that packs the states of members, one packet a thread."""
    Lane, Wide = lane(width, real), lane(width, wp.float64)
    Places, State = wp.array2d(dtype=wp.int64), wp.array2d(dtype=Lane)

    @wp.func_native(_number(width))
    def number(places: Places, kind: int, at: int, packet: int, members: wp.int64) -> Wide: ...

    @wp.func_native(_put(width, real))
    def put(state: State, packet: int, field: int, low: int, value: Wide): ...

    @wp.func
    def vector(places: Places, kind: int, at: int, packet: int, members: wp.int64):
        return vec3(
            number(places, kind, at, packet, members),
            number(places, kind, at + 1, packet, members),
            number(places, kind, at + 2, packet, members),
        )

    @wp.func
    def row_times(places: Places, row: int, packet: int, members: wp.int64, nu: Any, Om: Any):
        """A row of the inertia times (nu; Om)."""
        a = vector(places, wp.static(INERTIA), 6 * row, packet, members)
        b = vector(places, wp.static(INERTIA), 6 * row + 3, packet, members)
        return a.x * nu.x + a.y * nu.y + a.z * nu.z + b.x * Om.x + b.y * Om.y + b.z * Om.z

    @wp.func
    def put3(state: State, packet: int, field: int, low: int, v: Any):
        put(state, packet, field, low, v.x)
        put(state, packet, field + 1, low, v.y)
        put(state, packet, field + 2, low, v.z)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": EXACT_FLAGS})
    def pack_states(places: Places, state: State, peaks: wp.array2d(dtype=Wide)):
        i = wp.tid()
        none = wp.int64(0)
        m = places[wp.static(RUN), 0]
        inertial = places[wp.static(RUN), 1]
        low = int(places[wp.static(RUN), 2])
        R0 = vector(places, wp.static(ATTITUDE), 0, i, m)
        R1 = vector(places, wp.static(ATTITUDE), 3, i, m)
        R2 = vector(places, wp.static(ATTITUDE), 6, i, m)
        b = vector(places, wp.static(POSITION), 0, i, m)
        nu = vector(places, wp.static(VELOCITY), 0, i, m)
        Om = vector(places, wp.static(RATE), 0, i, m)
        peaks[i, 1] = dot(Om, Om)
        way = dot(nu, nu)
        peaks[i, 2] = positive(way, dot(b, b) / way, Wide())
        water = vec3(Wide(), Wide(), Wide())
        if places[wp.static(WATER), 0] != none:
            water = vector(places, wp.static(WATER), 0, i, m)
        relative = nu - water
        peaks[i, 3] = dot(relative, relative)
        if places[wp.static(ORIGIN), 0] != none:
            origin = vector(places, wp.static(ORIGIN), 0, i, m)
            nu = nu + cross(Om, origin)
            b = b + along(R0, R1, R2, origin)
        nu = nu - water
        if places[wp.static(AXES), 0] != none:
            Q0 = vector(places, wp.static(AXES), 0, i, m)
            Q1 = vector(places, wp.static(AXES), 3, i, m)
            Q2 = vector(places, wp.static(AXES), 6, i, m)
            R0 = across(Q0, Q1, Q2, R0)
            R1 = across(Q0, Q1, Q2, R1)
            R2 = across(Q0, Q1, Q2, R2)
            nu = across(Q0, Q1, Q2, nu)
            Om = across(Q0, Q1, Q2, Om)
        p = nu
        pi = Om
        if places[wp.static(MASS), 0] != none:
            p = vector(places, wp.static(MASS), 0, i, m) * nu
            pi = vector(places, wp.static(MOMENTS), 0, i, m) * Om
        else:
            p = vec3(
                row_times(places, 0, i, m, nu, Om),
                row_times(places, 1, i, m, nu, Om),
                row_times(places, 2, i, m, nu, Om),
            )
            pi = vec3(
                row_times(places, 3, i, m, nu, Om),
                row_times(places, 4, i, m, nu, Om),
                row_times(places, 5, i, m, nu, Om),
            )
        peaks[i, 0] = dot(p, p)
        if inertial != none:
            p = along(R0, R1, R2, p)
        scale = number(places, wp.static(SCALE), 0, i, m)
        scales = vec3(scale, scale, scale)
        put3(state, i, 0, low, R0)
        put3(state, i, 3, low, R1)
        put3(state, i, 6, low, R2)
        put3(state, i, 9, low, b)
        put3(state, i, 12, low, p / scales)
        put3(state, i, 15, low, pi / scales)
        if low == 0:
            for field in range(18, state.shape[1]):
                put(state, i, field, 0, Wide())

    return pack_states
