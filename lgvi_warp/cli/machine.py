# SPDX-License-Identifier: Apache-2.0
"""The verbs bench, and info on a folder or on this machine."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from lgvi_warp.cli.folders import info_of_folder
from lgvi_warp.cli.output import Part, say, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.verb import as_verb
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.common.summaries import listed
from lgvi_warp.engine import widths
from lgvi_warp.engine.peak import fma_peak


def info_arguments(verb: Any) -> None:
    """Add the arguments of the verb info."""
    verb.add_argument("dir", nargs="?", metavar="DIR", type=Path, help="a folder that a verb wrote, or a store")
    verb.set_defaults(scene=None)


@as_verb(
    "info",
    "describe a folder that a verb wrote, or this machine: versions and the core's peak speed",
    info_arguments,
    reads=True,
)
def info(chosen: argparse.Namespace, *, peak_of: Callable[[str], float] = fma_peak, describe: Part = None) -> int:
    """Run the verb info: describe a folder, or this machine."""
    if chosen.dir is not None:
        return info_of_folder(chosen, describe)
    from lgvi_warp.cli import installed
    from lgvi_warp.common import container, machine

    with progress_bar(chosen.quiet, "measuring"):
        peaks = {dtype: peak_of(dtype) for dtype in ("float64", "float32")}
    packets = {kernel: widths.of_table(*widths.parts(kernel)) for kernel in widths.KERNELS}
    document = {
        "machine": machine.describe(),
        "memory": machine.memory_bytes(),
        "versions": machine.versions(),
        "peak": peaks,
        "packets": {kernel: {"vehicles": width.lanes, "source": width.source} for kernel, width in packets.items()},
        "extras": installed.missing_by_extra(),
        "cache": installed.kernel_cache(),
        "viewer": installed.viewer(),
    }
    limits = container.cpu_quota(), machine.affinity(), machine.physical_memory()
    tell(chosen, lambda: document, lambda: "\n".join(machine_lines(document, *limits)))
    return 0


def machine_lines(document: dict[str, Any], quota: float | None, cores: int, physical: int | None) -> Iterator[str]:
    """Lines of text for the document of info, with the limits of a container.

    quota: CPU time of the container [CPUs]; None without one. physical: memory of the machine [bytes]; None if unknown.
    """
    described, memory = document["machine"], document["memory"]
    of_quota = "" if quota is None or quota >= cores else f" (a quota of {quota:g} CPUs; {cores} cores)"
    yield f"cpu         {described['cpu']}, {described['simd']}, {described['threads']} threads{of_quota}"
    if memory:
        of_machine = f" (the container's limit; {(physical or 0) / 2**30:.1f} GiB in the machine)"
        of_limit = "" if physical is None or physical <= memory else of_machine
        yield f"memory      {memory / 2**30:.1f} GiB{of_limit}"
    yield "versions    " + ", ".join(f"{name} {version}" for name, version in document["versions"].items())
    for dtype, peak in document["peak"].items():
        yield f"{dtype}     one core's peak {peak / 1e9:.1f} GFMA/s"
    by_source: dict[str, list[str]] = {}
    for kernel, width in document["packets"].items():
        by_source.setdefault(width["source"], []).append(f"{kernel} {width['vehicles']}")
    for source, texts in by_source.items():
        yield f"packets     vehicles, {source}: {', '.join(texts)}"
    for extra, missing in document["extras"].items():
        yield f"extra       {extra}: {f'without {listed(missing)}' if missing else 'installed'}"
    cache = document["cache"]
    yield f"cache       {cache['path']}, {cache['bytes'] / 2**20:.1f} MiB of kernels"
    yield f"viewer      {document['viewer'] or 'not found; it comes with the extra viz'}"


def bench_arguments(verb: Any) -> None:
    """Add the arguments of the verb bench."""
    verb.add_argument("--members", type=int, default=4096, help="number of vehicles (default 4096)")
    verb.add_argument("--steps", type=int, default=1000, help="number of steps (default 1000)")


@as_verb(
    "bench", "measure the kernel's speed on this machine, compared with the core's peak", bench_arguments, reads=True
)
def bench(chosen: argparse.Namespace, *, measure: Part = None) -> int:
    """Run the verb bench: measure the kernel's speed on this machine."""
    from lgvi_warp.measuring import speed

    readings = []
    for line in (measure or speed.measure)(chosen.members, chosen.steps):
        readings.append(parsed(line))
        say(chosen, line)
    tell(chosen, lambda: {"readings": readings}, str)
    return 0
