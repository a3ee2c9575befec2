"""The verb warm: compile the kernels of a scene ahead."""

from __future__ import annotations

import argparse
import time

from lgvi_warp.cli.settings import load_scene
from lgvi_warp.common import machine


def warm(chosen: argparse.Namespace) -> int:
    """Run the verb warm: compile what runs of a scene need, and print how long each phase took.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0.

    Raises:
        SceneError: The scene cannot run, or refuses a method or precision.
    """
    from lgvi_warp.runs import warm as kernels

    begun = time.perf_counter()
    scene = load_scene(chosen)
    plans = kernels.plans_of(scene, chosen.methods or (), chosen.dtypes or ())
    total = 0.0
    for plan, phases in kernels.warm(plans, chosen.threads or machine.thread_count()):
        total += sum(phases)
        if not chosen.quiet:
            there = "" if phases.clang else " (was in the cache)"
            print(f"{plan.method.name} {plan.dtype}: {phases}{there}", flush=True)
    if not chosen.quiet:
        seconds = time.perf_counter() - begun
        print(f"kernels: {len(plans)}, in {seconds:.2f} s; one after another their phases take {total:.2f} s")
    return 0
