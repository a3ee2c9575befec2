# SPDX-License-Identifier: Apache-2.0
"""Capabilities of this machine (SIMD width, threads, memory), and the software's versions for provenance."""

from __future__ import annotations

import functools
import math
import os
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import container

# A run's dtype -> type of the kernel's numbers. Compensated: each number of the state is a sum of two.
DTYPES = {"float64": "float64", "float32": "float32", "float32_compensated": "float32"}

# SIMD extension, the widest first -> what NumPy calls it.
FEATURES = {"avx512": "AVX512F", "avx2": "AVX2", "neon": "ASIMD"}
REGISTER_BYTES = {"avx512": 64, "avx2": 32, "neon": 16, "other": 16}


def simd() -> str:
    """Widest SIMD extension of the processor."""
    from numpy._core._multiarray_umath import __cpu_features__ as features

    return next((name for name, feature in FEATURES.items() if features.get(feature)), "other")


def register_width(dtype: str, extension: str | None = None) -> int:
    """Number of vehicles for which one number each fills a SIMD register; extension: as in `simd`, default this one."""
    return REGISTER_BYTES[extension or simd()] // np.dtype(DTYPES[dtype]).itemsize


def affinity() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "process_cpu_count"):
        return os.process_cpu_count() or 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_count() -> int:
    """Default number of threads of a run."""
    return threads_of(affinity(), container.cpu_quota())


def threads_of(cores: int, quota: float | None) -> int:
    """Number of threads that a quota of CPU time keeps busy; quota: [CPUs], None without a quota."""
    return cores if quota is None else max(1, min(cores, math.ceil(quota)))


@functools.cache
def cpu_name() -> str:
    """Name of the processor."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def physical_memory() -> int | None:
    """Memory of the machine [bytes]; None if unknown."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def memory_bytes() -> int | None:
    """Memory available to this process [bytes]: the machine's, or the limit of its container; None if neither is known."""
    return least_known(physical_memory(), container.memory_limit())


def least_known(*sizes: int | None) -> int | None:
    """Smallest of the known sizes; None if no size is known."""
    return min((size for size in sizes if size is not None), default=None)


def resident() -> int:
    """Resident memory of this process [bytes]; 0 if unknown."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError):
        return 0


def versions() -> dict[str, str]:
    """Versions of the software on which a result depends."""
    return dict(_versions())


@functools.cache
def _versions() -> tuple[tuple[str, str], ...]:
    """Read the versions once: the modules of a process do not change, and reading takes milliseconds."""
    from importlib import metadata

    names = ("lgvi-warp", "warp-lang", "numpy", "scipy")
    return ("python", platform.python_version()), *((name, metadata.version(name)) for name in names)


def kind() -> dict[str, str]:
    """Processor, SIMD extension and versions: if these are equal, the same inputs give the same bits."""
    return {"cpu": cpu_name(), "simd": simd()} | {name: v for name, v in versions().items() if name != "python"}


def describe() -> dict[str, Any]:
    """Describe the machine for a result's provenance."""
    return {"cpu": cpu_name(), "simd": simd(), "threads": thread_count(), "system": platform.system()}


def thread_seconds() -> float:
    """CPU time of this thread [s], which includes kernels on the CPU but no other programs.

    Windows counts it in ticks of 16 ms, too coarse for a launch; time.perf_counter is used there.
    """
    return time.perf_counter() if os.name == "nt" else time.thread_time()
