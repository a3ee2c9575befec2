"""What this machine can do: SIMD width, threads, peak of fused multiply-adds; and provenance of the software."""

from __future__ import annotations

import math
import os
import platform
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import container

# What a run's dtype may be -> the type of the kernel's numbers. Compensated: a state of sums of two numbers.
DTYPES = {"float64": "float64", "float32": "float32", "float32_compensated": "float32"}

REGISTER_BYTES = {"avx512": 64, "avx2": 32, "other": 16}


def simd() -> str:
    """The widest SIMD extension: "avx512", "avx2" or "other"."""
    from numpy._core._multiarray_umath import __cpu_features__ as features

    if features.get("AVX512F"):
        return "avx512"
    return "avx2" if features.get("AVX2") else "other"


def default_width(dtype: str, *, chained: bool = False) -> int:
    """Vehicles per packet: one SIMD register of this dtype ("float64": 8 on AVX-512, 4 on AVX2, 2 elsewhere).

    chained: a step whose operations mostly wait for one another takes two registers, where there are enough of them
    (AVX-512), so that one vehicle's operation is made while another's waits.
    """
    registers = 2 if chained and simd() == "avx512" else 1
    return registers * REGISTER_BYTES[simd()] // np.dtype(DTYPES[dtype]).itemsize


def affinity() -> int:
    """Cores that this process may run on, as os.process_cpu_count has it from Python 3.13 on."""
    if hasattr(os, "process_cpu_count"):
        return os.process_cpu_count() or 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def thread_count() -> int:
    """Threads that a run has by default: a core each, and no more than a container's quota of CPU time keeps busy."""
    quota = container.cpu_quota()
    return affinity() if quota is None else max(1, min(affinity(), math.ceil(quota)))


def cpu_name() -> str:
    """The processor's name, as the system tells it."""
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def physical_memory() -> int | None:
    """Of the machine [bytes]; None where the system does not tell."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


def memory_bytes() -> int | None:
    """Memory that there is for this process: of the machine, or what a container leaves of it; None if neither tells."""
    known = [size for size in (physical_memory(), container.memory_limit()) if size is not None]
    return min(known, default=None)


def versions() -> dict[str, str]:
    """Versions of what a result depends on."""
    names = ("lgvi-warp", "warp-lang", "numpy", "scipy")
    return {"python": platform.python_version()} | {name: metadata.version(name) for name in names}


def kind() -> dict[str, str]:
    """What the same inputs give the same bits on: processor, SIMD extension, versions of what computes."""
    return {"cpu": cpu_name(), "simd": simd()} | {name: v for name, v in versions().items() if name != "python"}


def describe() -> dict[str, Any]:
    """The machine, for provenance."""
    return {"cpu": cpu_name(), "simd": simd(), "threads": thread_count(), "system": platform.system()}
