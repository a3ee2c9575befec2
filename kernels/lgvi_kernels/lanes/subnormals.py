# SPDX-License-Identifier: Apache-2.0
"""Numbers too small for the normal format, below 1e-38 in float32 and 2e-308 in float64, taken as zero by the processor.

A damped body that comes to rest carries rates whose products are that small, and most processors then need many times as
long for an operation. They have a mode that puts zero in their place, in what is read and in what is written: bits FTZ and
DAZ of the register MXCSR (x86), FZ of FPCR (64-bit ARM). The mode belongs to the calling thread, which is Python's, so a
kernel puts back the mode that it met. On CUDA and on other processors these functions do nothing.
"""

import warp as wp


def _by_processor(x86, arm):
    """C++ of one function for each processor."""
    return f"""
#if defined(__CUDA_ARCH__)
    return 0;
#elif defined(__x86_64__)
    {x86}
#elif defined(__aarch64__)
    {arm}
#else
    return 0;
#endif
"""


@wp.func_native(
    _by_processor(
        "wp::uint32 mode = __builtin_ia32_stmxcsr(); __builtin_ia32_ldmxcsr(mode | 0x8040u); return mode;",
        'wp::uint64 mode = __builtin_arm_rsr64("fpcr"); __builtin_arm_wsr64("fpcr", mode | 0x1000000u); return mode;',
    )
)
def flush_subnormals() -> wp.uint64:
    """Take subnormal numbers as zero in this thread from here on; the mode until then."""
    ...


@wp.func_native(
    _by_processor(
        "__builtin_ia32_ldmxcsr((wp::uint32)mode); return mode;",
        '__builtin_arm_wsr64("fpcr", mode); return mode;',
    )
)
def put_back(mode: wp.uint64) -> wp.uint64:
    """Put back the mode that `flush_subnormals` met."""
    ...
