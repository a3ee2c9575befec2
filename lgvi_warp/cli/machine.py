"""The verbs info, of this machine, and bench."""

from __future__ import annotations

import argparse

from lgvi_warp.cli.stores import info_of_run


def info(chosen: argparse.Namespace) -> int:
    """lgvi-warp info."""
    if chosen.dir is not None:
        return info_of_run(chosen.dir)
    from lgvi_warp import machine

    described, memory = machine.describe(), machine.memory_bytes()
    print(f"cpu         {described['cpu']}, {described['simd']}, {described['threads']} threads")
    if memory:
        print(f"memory      {memory / 2**30:.1f} GiB")
    print("versions    " + ", ".join(f"{name} {version}" for name, version in machine.versions().items()))
    for dtype in ("float64", "float32"):
        peak = machine.fma_peak(dtype)
        print(
            f"{dtype}     {machine.default_width(dtype)} vehicles per packet; one core's peak {peak / 1e9:.1f} GFMA/s"
        )
    return 0


def bench(chosen: argparse.Namespace) -> int:
    """lgvi-warp bench."""
    from lgvi_warp.speed import measure

    for line in measure(chosen.members, chosen.steps):
        print(line, flush=True)
    return 0
