# SPDX-License-Identifier: Apache-2.0
"""Number of vehicles in a packet: from a table for each kind of processor, or as measured on this machine.

Measured widths are stored next to Warp's kernel caches, in CACHE/lgvi_warp_widths.json: machine and versions -> HASHES
-> hash of a kernel -> its width.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
from pathlib import Path
from typing import Any, NamedTuple

from lgvi_warp.common import files, machine, safe_files
from lgvi_warp.common.errors import SceneError

# Widths that kernels have, as lgvi_kernels knows them.
WIDTHS = (1, 2, 4, 8, 16, 32)
# Kinds of kernels. plain: sub-maps, of which each has independent operations; single: psi_1, with one free rotation a step;
# chained: turns, iterations and the stages of two-part
# splittings, of which each waits for the one before; dense: damping laws with their implicit step V;
# explicit: stages of explicit and collocation methods.
KINDS = ("plain", "single", "chained", "dense", "explicit")
# Compensated kernels are of one kind, whatever the method: their sums fill the registers by themselves.
KERNELS = (*(f"{kind} {real}" for kind in KINDS for real in ("float64", "float32")), "float32_compensated")

# Kind of processor -> SIMD registers that one number of a packet fills, by kernel; otherwise one. With two, one vehicle's
# operation runs while another's waits, where registers abound. AMD: `python -m benchmarks run widths` on an EPYC.
# Intel: psi_s, a server core of two 512-bit units: float64 22.0 ns at 8 lanes and 16.0 at 16, float32 9.9 at 16 and 7.4 at 32.
CHAINED = {"chained float64": 2, "chained float32": 2}
REGISTERS = {
    "Intel, avx512": dict.fromkeys(("plain float64", "plain float32", "single float64", "single float32"), 2) | CHAINED,
    "avx512": {"plain float64": 2} | CHAINED,
    # 64-bit ARM, not measured: cores have up to four units for fused multiply-adds, and a register holds two float64. One
    # register a number leaves too few independent operations to keep four units at work.
    "neon": dict.fromkeys((kernel for kernel in KERNELS if kernel != "float32_compensated"), 2),
}

FILE, MOST_BYTES, HASHES = "lgvi_warp_widths.json", 1_000_000, "kernels"
# Single kernels of one machine that the file keeps.
MOST_HASHES = 1_000


class Width(NamedTuple):
    """Vehicles in a packet, and the reason: "asked for", "measured", or "table" and the kind of processor."""

    lanes: int
    source: str


def parts(kernel: str) -> tuple[str, str]:
    """Split one of KERNELS into kind ("plain" if kinds make no difference) and dtype."""
    kind, _, dtype = kernel.rpartition(" ")
    return kind or "plain", dtype


def kernel_kind(kind: str, dtype: str) -> str:
    """Name the kind and dtype for which a width is chosen."""
    return dtype if dtype == "float32_compensated" else f"{kind} {dtype}"


def of_table(kind: str, dtype: str, *, cpu: str | None = None, simd: str | None = None) -> Width:
    """Look up the width of a kernel for this processor, or for another name and SIMD extension."""
    simd = simd or machine.simd()
    processor = f"Intel, {simd}" if "Intel" in (cpu or machine.cpu_name()) else simd
    processor = processor if processor in REGISTERS else simd
    registers = REGISTERS.get(processor, {}).get(kernel_kind(kind, dtype), 1)
    return Width(registers * machine.register_width(dtype, simd), f"table: {processor}")


def path() -> Path:
    """Path of the file of measured widths."""
    return _path(os.environ.get("WARP_CACHE_PATH"))


@functools.cache
def _path(folder: str | None) -> Path:
    from warp._src.thirdparty import appdirs

    return Path(folder or appdirs.user_cache_dir(appname="warp", appauthor="NVIDIA")) / FILE


def measured() -> dict[str, int]:
    """Read the widths that were measured for kernels on this machine, by the kernel's hash."""
    return read_hashes(path())


@functools.cache
def read_hashes(file: Path) -> dict[str, int]:
    """Read the widths of kernels in a file once per process."""
    return {name: width for name, width in _hashes(_content(file)).items() if type(width) is int and width in WIDTHS}


def keep_measured(kernel: str, width: int) -> None:
    """Save the width of one kernel, given by its hash, for this machine and these versions; other entries are kept."""
    file = path()
    file.parent.mkdir(parents=True, exist_ok=True)
    with files.locked(file.parent, wait=True):
        content = _content(file)
        others = [(key, value) for key, value in _hashes(content).items() if key != kernel]
        # The newest last: of a full file the oldest go.
        content[this_machine()] = {HASHES: dict([*others[1 - MOST_HASHES :], (kernel, width)])}
        files.write_whole(file, json.dumps(content, indent=1).encode())
    read_hashes.cache_clear()


def _hashes(content: dict[str, Any]) -> dict[str, Any]:
    known = content.get(this_machine())
    hashes = known.get(HASHES) if isinstance(known, dict) else None
    return hashes if isinstance(hashes, dict) else {}


def this_machine() -> str:
    """Name this machine and the versions for which widths are measured."""
    versions = machine.versions()
    return f"{machine.cpu_name()}, {machine.simd()}, lgvi-warp {versions['lgvi-warp']}, Warp {versions['warp-lang']}"


def _content(file: Path) -> dict[str, Any]:
    """Content of a file of measured widths; empty for any other file."""
    with contextlib.suppress(OSError, ValueError, SceneError):
        content = safe_files.parsed(safe_files.read(file.parent, file.name, MOST_BYTES))
        return content if isinstance(content, dict) else {}
    return {}
