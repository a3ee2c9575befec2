# SPDX-License-Identifier: Apache-2.0
"""The verbs info, without a folder about this machine, bench and tune."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from lgvi_warp.cli.folders import info_of_folder
from lgvi_warp.cli.output import say, tell
from lgvi_warp.cli.progress import shown
from lgvi_warp.cli.verb import as_verb
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.engine import widths
from lgvi_warp.engine.peak import fma_peak


def info_arguments(verb: Any) -> None:
    """Add the arguments of the verb info."""
    verb.add_argument("dir", nargs="?", metavar="DIR", type=Path, help="a folder that a verb wrote, or a store")
    verb.set_defaults(scene=None)


@as_verb(
    "info",
    "say what is in a folder that a verb wrote; without one, the machine, versions, the core's peak",
    info_arguments,
    reads=True,
)
def info(chosen: argparse.Namespace) -> int:
    """Run the verb info: describe a stored run, or this machine."""
    if chosen.dir is not None:
        return info_of_folder(chosen)
    from lgvi_warp.common import machine

    with shown(chosen.quiet, "measuring"):
        peaks = {dtype: fma_peak(dtype) for dtype in ("float64", "float32")}
    packets = {kernel: widths.default_width(*widths.parts(kernel)) for kernel in widths.KERNELS}
    document = {
        "machine": machine.describe(),
        "memory": machine.memory_bytes(),
        "versions": machine.versions(),
        "peak": peaks,
        "packets": {kernel: {"vehicles": width.lanes, "source": width.source} for kernel, width in packets.items()},
    }
    tell(chosen, lambda: document, lambda: "\n".join(_machine_lines(document)))
    return 0


def _machine_lines(document: dict[str, Any]) -> Iterator[str]:
    """The document of info as lines of text."""
    described, memory = document["machine"], document["memory"]
    yield f"cpu         {described['cpu']}, {described['simd']}, {described['threads']} threads{_of_quota()}"
    if memory:
        yield f"memory      {memory / 2**30:.1f} GiB{_of_limit(memory)}"
    yield "versions    " + ", ".join(f"{name} {version}" for name, version in document["versions"].items())
    for dtype, peak in document["peak"].items():
        yield f"{dtype}     one core's peak {peak / 1e9:.1f} GFMA/s"
    by_source: dict[str, list[str]] = {}
    for kernel, width in document["packets"].items():
        by_source.setdefault(width["source"], []).append(f"{kernel} {width['vehicles']}")
    for source, texts in by_source.items():
        where = f" ({widths.path()})" if source == "tuned" else ""
        yield f"packets     vehicles, {source}{where}: {', '.join(texts)}"


def _of_quota() -> str:
    """Remark on a container's quota of CPU time, where it is smaller than the number of cores."""
    from lgvi_warp.common import container, machine

    quota, cores = container.cpu_quota(), machine.affinity()
    if quota is None or quota >= cores:
        return ""
    return f" (a quota of {quota:g} CPUs; {cores} cores)"


def _of_limit(memory: int) -> str:
    """Remark on a container's limit of memory, where it is smaller than the machine's memory."""
    from lgvi_warp.common import machine

    physical = machine.physical_memory()
    if physical is None or physical <= memory:
        return ""
    return f" (the container's limit; {physical / 2**30:.1f} GiB in the machine)"


def bench_arguments(verb: Any) -> None:
    """Add the arguments of the verb bench."""
    verb.add_argument("--members", type=int, default=4096, help="vehicles (default 4096)")
    verb.add_argument("--steps", type=int, default=1000, help="steps (default 1000)")


@as_verb("bench", "speed of the kernel on this machine, beside the core's peak", bench_arguments, reads=True)
def bench(chosen: argparse.Namespace) -> int:
    """Run the verb bench: measure the kernel's speed on this machine."""
    from lgvi_warp.studies.speed import measure

    readings = []
    for line in measure(chosen.members, chosen.steps):
        readings.append(parsed(line))
        say(chosen, line)
    tell(chosen, lambda: {"readings": readings}, str)
    return 0


@as_verb("tune", "measure how many vehicles a packet should hold on this machine, for runs from now on", reads=True)
def tune(chosen: argparse.Namespace) -> int:
    """Run the verb tune: measure the widths of packets on this machine, and keep the best ones for later runs.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0.
    """
    from lgvi_warp.studies import packet_width as tuning

    kernels: dict[str, dict[str, Any]] = {}
    for kernel, ns, of_table, fastest in tuning.tune():
        speeds = ", ".join(f"{width}: {result:.2f} ns" for width, result in ns.items())
        remark = "as by the table" if fastest == of_table else f"{of_table} by the table"
        say(chosen, f"{kernel:19} {speeds}: {fastest}, {remark}")
        kernels[kernel] = {"ns": ns, "table": of_table, "best": fastest}
    path = widths.keep({kernel: result["best"] for kernel, result in kernels.items()})
    tell(chosen, lambda: {"kernels": kernels, "file": path},
         lambda: f"kept in {path}, for runs from now on; without that file the table counts")  # fmt: skip
    return 0
