# SPDX-License-Identifier: Apache-2.0
"""The verb warm: compile the kernels of a scene before its runs."""

from __future__ import annotations

import argparse
import time
from typing import Any

from lgvi_warp.cli.output import Part, say, tell
from lgvi_warp.cli.settings import load_scene
from lgvi_warp.cli.verb import SHARED, add_shared, as_verb
from lgvi_warp.common import machine


def warm_arguments(verb: Any) -> None:
    """Add the arguments of the verb warm."""
    add_shared(verb, "scene --methods", methods="names of methods, such as psi_s,rk4 (default: the scene's method)")
    names = SHARED["--methods"] | {"help": "any of float64, float32, float32_compensated (default: the scene's dtype)"}
    verb.add_argument("--dtypes", **names)
    add_shared(verb, "--step --duration --set --threads", threads="number of processes (default: all cores)")


@as_verb("warm", "compile the kernels of a scene before its runs, several at a time", warm_arguments, reads=True)
def warm(chosen: argparse.Namespace, *, compile_plans: Part = None) -> int:
    """Run the verb warm: compile the kernels for a scene's runs, and print the time of each phase."""
    from lgvi_warp.calls import warm as kernels

    begun = time.perf_counter()
    scene = load_scene(chosen)
    plans = kernels.plans_of(scene, chosen.methods or (), chosen.dtypes or ())
    compiled, total = [], 0.0
    for plan, phases in (compile_plans or kernels.warm)(plans, chosen.threads or machine.thread_count()):
        total += sum(phases)
        compiled.append({"method": plan.method.name, "dtype": plan.dtype, "seconds": phases._asdict()})
        say(chosen, f"{plan.method.name} {plan.dtype}: {phases}{'' if phases.clang else ' (was in the cache)'}")
    seconds = time.perf_counter() - begun
    tell(chosen, lambda: {"kernels": compiled, "seconds": seconds},
         lambda: f"kernels: {len(plans)}, in {seconds:.2f} s; one after another their phases take {total:.2f} s")  # fmt: skip
    return 0
