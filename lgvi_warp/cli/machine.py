"""The verbs info, without a folder about this machine, bench and tune."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from lgvi_warp.cli.stores import info_of_run
from lgvi_warp.engine import widths
from lgvi_warp.engine.peak import fma_peak


def info(chosen: argparse.Namespace) -> int:
    """Run the verb info: describe a stored run, or this machine.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 1 for a run that is not complete, otherwise 0.
    """
    if chosen.dir is not None:
        return info_of_run(chosen.dir)
    from lgvi_warp.common import machine

    described = machine.describe()
    print(f"cpu         {described['cpu']}, {described['simd']}, {described['threads']} threads{_of_quota()}")
    if memory := machine.memory_bytes():
        print(f"memory      {memory / 2**30:.1f} GiB{_of_limit(memory)}")
    print("versions    " + ", ".join(f"{name} {version}" for name, version in machine.versions().items()))
    for dtype in ("float64", "float32"):
        print(f"{dtype}     one core's peak {fma_peak(dtype) / 1e9:.1f} GFMA/s")
    print("\n".join(_widths()))
    return 0


def _widths() -> Iterator[str]:
    """Vehicles per packet of each kind of kernel, one line for each thing that chose."""
    chosen: dict[str, list[str]] = {}
    for kernel in widths.KERNELS:
        kind, dtype = widths.parts(kernel)
        width = widths.default_width(kind, dtype)
        chosen.setdefault(width.source, []).append(f"{kernel} {width.lanes}")
    for source, texts in chosen.items():
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


def bench(chosen: argparse.Namespace) -> int:
    """Run the verb bench: measure the kernel's speed on this machine.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0.
    """
    from lgvi_warp.studies.speed import measure

    for line in measure(chosen.members, chosen.steps):
        print(line, flush=True)
    return 0


def tune(chosen: argparse.Namespace) -> int:
    """Run the verb tune: measure the widths of packets on this machine, and keep the best ones for later runs.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0.
    """
    from lgvi_warp.studies import tuning

    best = {}
    for kernel, ns, of_table, fastest in tuning.tune():
        speeds = ", ".join(f"{width}: {one:.2f} ns" for width, one in ns.items())
        remark = "as by the table" if fastest == of_table else f"{of_table} by the table"
        print(f"{kernel:19} {speeds}: {fastest}, {remark}", flush=True)
        best[kernel] = fastest
    print(f"kept in {widths.keep(best)}, for runs from now on; without that file the table counts")
    return 0
