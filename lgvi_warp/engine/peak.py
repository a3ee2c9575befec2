# SPDX-License-Identifier: Apache-2.0
"""The peak arithmetic rate of one core, measured by a kernel of fused multiply-adds."""

from __future__ import annotations

import time

import numpy as np

from lgvi_warp.common.machine import register_width

# Launches of the kernel, and passes of its loop in each.
ROUNDS, LOOPS = 5, 1_000_000


def fma_peak(dtype: str = "float64", width: int | None = None) -> float:
    """Measure the number of fused multiply-adds that one core makes per second.

    width: lanes of a packet; None (default): the width that suits this machine's registers.
    Returns: Fused multiply-adds per second of one core [1/s].
    """
    import warp as wp

    from lgvi_kernels.lanes.peak import CHAINS, make_peak
    from lgvi_warp.common import warp_setup
    from lgvi_warp.engine import kernel_cache

    warp_setup.start()
    real = wp.float64 if dtype == "float64" else wp.float32
    width = width or register_width(dtype)
    kernel, Lane = make_peak(width, real)
    values = np.full((CHAINS + 3, width), 0.5, dtype=dtype)
    data = wp.array(values, dtype=Lane, device="cpu")
    kernel_cache.load(kernel.module)
    command = wp.launch(kernel, dim=1, inputs=[data, LOOPS], device="cpu", record_cmd=True)
    best = 0.0
    for _ in range(ROUNDS):
        start = time.perf_counter()
        command.launch()
        best = max(best, CHAINS * width * LOOPS / (time.perf_counter() - start))
    return best
