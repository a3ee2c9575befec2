# SPDX-License-Identifier: Apache-2.0
"""The core's limit: independent chains of fused multiply-adds and nothing else, to hold a kernel's speed against."""

import functools

import warp as wp

from lgvi_kernels.lanes.arithmetic import add, lane, mul  # noqa: F401
from lgvi_kernels.lanes.flags import CPU_FLAGS

# More chains than latency times throughput of any current core asks for, and no more than the registers hold.
CHAINS = 12


@functools.cache
def make_peak(width, real):
    """(kernel, Lane): x[0] and x[1] are multiplier and addend, x[2 + j] the chains, the last takes their sum."""
    Lane = lane(width, real)

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": CPU_FLAGS})
    def peak(x: wp.array(dtype=Lane), loops: int):
        # A local for each chain: an array of chains would lie in memory, not in registers.
        m = x[0]
        c = x[1]
        a0 = m * x[2]
        a1 = m * x[3]
        a2 = m * x[4]
        a3 = m * x[5]
        a4 = m * x[6]
        a5 = m * x[7]
        b0 = m * x[8]
        b1 = m * x[9]
        b2 = m * x[10]
        b3 = m * x[11]
        b4 = m * x[12]
        b5 = m * x[13]
        for _ in range(loops):
            a0 = a0 * m + c
            a1 = a1 * m + c
            a2 = a2 * m + c
            a3 = a3 * m + c
            a4 = a4 * m + c
            a5 = a5 * m + c
            b0 = b0 * m + c
            b1 = b1 * m + c
            b2 = b2 * m + c
            b3 = b3 * m + c
            b4 = b4 * m + c
            b5 = b5 * m + c
        x[wp.static(CHAINS) + 2] = a0 + a1 + a2 + a3 + a4 + a5 + b0 + b1 + b2 + b3 + b4 + b5

    return peak, Lane
