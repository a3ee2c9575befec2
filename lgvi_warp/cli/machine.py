"""The verbs info, of this machine, and bench."""

from __future__ import annotations

import argparse

from lgvi_warp.cli.stores import info_of_run
from lgvi_warp.engine.peak import fma_peak


def info(chosen: argparse.Namespace) -> int:
    """lgvi-warp info."""
    if chosen.dir is not None:
        return info_of_run(chosen.dir)
    from lgvi_warp.common import machine

    described = machine.describe()
    print(f"cpu         {described['cpu']}, {described['simd']}, {described['threads']} threads{_of_quota()}")
    if memory := machine.memory_bytes():
        print(f"memory      {memory / 2**30:.1f} GiB{_of_limit(memory)}")
    print("versions    " + ", ".join(f"{name} {version}" for name, version in machine.versions().items()))
    for dtype in ("float64", "float32"):
        peak = fma_peak(dtype)
        print(
            f"{dtype}     {machine.default_width(dtype)} vehicles per packet; one core's peak {peak / 1e9:.1f} GFMA/s"
        )
    return 0


def _of_quota() -> str:
    """What a container's quota leaves of the cores, where it does."""
    from lgvi_warp.common import container, machine

    quota, cores = container.cpu_quota(), machine.affinity()
    if quota is None or quota >= cores:
        return ""
    return f" (a quota of {quota:g} CPUs; {cores} cores)"


def _of_limit(memory: int) -> str:
    """What a container's limit leaves of the memory, where it does."""
    from lgvi_warp.common import machine

    physical = machine.physical_memory()
    if physical is None or physical <= memory:
        return ""
    return f" (the container's limit; {physical / 2**30:.1f} GiB in the machine)"


def bench(chosen: argparse.Namespace) -> int:
    """lgvi-warp bench."""
    from lgvi_warp.studies.speed import measure

    for line in measure(chosen.members, chosen.steps):
        print(line, flush=True)
    return 0
