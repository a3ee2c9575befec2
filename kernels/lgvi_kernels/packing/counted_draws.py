# SPDX-License-Identifier: Apache-2.0
"""The standard normals that the counters of members give, written out: those that a kernel would draw on its way."""

import functools

import warp as wp

from lgvi_kernels.lanes.arithmetic import int_lane, lane, set_element
from lgvi_kernels.lanes.flags import CPU_FLAGS
from lgvi_kernels.lanes.functions import normals, quarter


@functools.cache
def make_counted_draws(width, real):
    """The kernel that writes the normals of one stream, one packet a thread.

    counter: number of draws, channel, the halves of the seed; part: the first of the four normals of a draw that are wanted,
    and how many are. out: (packets, draws times numbers of a draw).
    """
    Lane, Ints = lane(width, real), int_lane(width)

    # Not inlined: each normal is rounded before it is used, whatever it is used for.
    @wp.func(inline=False)
    def normals_of(like: Lane, member: Ints, draw: int, counter: wp.vec4i):
        return normals(like, member, draw, counter[1], counter[2], counter[3])

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def counted_draws(member: wp.array(dtype=Ints), counter: wp.vec4i, part: wp.vec2i, out: wp.array2d(dtype=Lane)):
        i = wp.tid()
        for draw in range(counter[0]):
            four = normals_of(Lane(), member[i], draw, counter)
            for k in range(part[1]):
                set_element(out, i, draw * part[1] + k, 0, quarter(four, part[0] + k))

    return counted_draws
