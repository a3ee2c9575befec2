# SPDX-License-Identifier: Apache-2.0
"""Processor time to compile a kernel over the 10 s that none may take: with an empty cache, and with Clang's header in it."""

import os
import shutil
import tempfile
import time
from pathlib import Path

import lgvi_warp as lw
from benchmarks import own_process, problems
from lgvi_warp.common import warp_setup
from lgvi_warp.runs.settle import make_plan

MOST = 10.0
# The default method where it takes the vehicle's inertia; the dearest last.
KERNELS = (
    ("sphere", "psi_s"),
    ("nordkvist_sanyal", "psi_s"),
    ("torpedo", "psi_s"),
    ("bluerov2_heavy", "psi_s"),
    ("remus_100", "psi_x"),
    ("remus_100", "rk8"),
    ("all terms", "rk8"),
)


def processor_seconds(vehicle, method, cache):
    """Processor time of this process from the plan to a loaded kernel [s]."""
    os.environ["WARP_CACHE_PATH"] = cache
    warp_setup.start()
    scene = problems.all_terms(noise=False) if vehicle == "all terms" else lw.Scene.named(vehicle)
    plan = make_plan(lw.Ensemble(scene), method, h=0.01, t1=1.0)
    before = time.process_time()
    plan.compile()
    return time.process_time() - before


def run(quick):
    for vehicle, method in KERNELS[:1] if quick else KERNELS:
        with tempfile.TemporaryDirectory() as cache:
            first = own_process.call(processor_seconds, vehicle, method, cache)
            for kernel in Path(cache).glob("*/wp_*"):
                shutil.rmtree(kernel)
            later = own_process.call(processor_seconds, vehicle, method, cache)
        yield {
            "vehicle": vehicle,
            "method": method,
            "first_over_limit": round(first / MOST, 3),
            "later_over_limit": round(later / MOST, 3),
        }
