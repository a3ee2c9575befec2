# SPDX-License-Identifier: Apache-2.0
"""A kernel's C++ compiled for another processor, by the Clang of the package ziglang, with the flags of the product."""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from unittest import mock

import warp as wp

from lgvi_warp.engine.kernel_cache import BLOCK_DIM

NEEDED = ("ziglang", "unicorn", "capstone")
REMEDY = "pip install 'lgvi-warp[arm]'"
PROCESSORS = ("neoverse_n1", "neoverse_v2", "apple_m1")
# What Clang takes by default where Warp calls it, and not where a user does; the folder of Warp's headers is put in front.
AS_WARP = (
    "-std=c++17", "-O2", "-DNDEBUG", "-fms-extensions", "-fdeclspec", "-fno-exceptions", "-fno-rtti", "-fno-math-errno",
    "-fno-stack-protector", "-fno-unwind-tables", "-fno-asynchronous-unwind-tables", "-fno-sanitize=all", "-w",
)  # fmt: skip
# What Clang calls by itself for large copies; the image has no other library.
COPIES = """
typedef unsigned long size;
void* memcpy(void* to, const void* from, size n) { for (size i = 0; i < n; ++i) ((char*)to)[i] = ((char*)from)[i]; return to; }
void* memset(void* to, int value, size n) { for (size i = 0; i < n; ++i) ((char*)to)[i] = (char)value; return to; }
void* memmove(void* to, const void* from, size n) {
  if (to < from) return memcpy(to, from, n);
  while (n--) ((char*)to)[n] = ((char*)from)[n];
  return to;
}
"""
# Where the image lies: far from where Linux puts what a process allocates.
BASE = "0x10000000"


def missing():
    """Packages that are needed here and not installed."""
    return [name for name in NEEDED if importlib.util.find_spec(name) is None]


def flags(processor, of_product):
    """The flags of the product for another processor, as the compiler's own driver takes them."""
    found = ["-target", "aarch64-linux-musl", f"-mcpu={processor}", *AS_WARP]
    for flag in of_product.split():
        if flag.startswith("-mllvm="):
            found += ["-mllvm", flag.removeprefix("-mllvm=")]
        elif flag != "-march=native":
            found += ["-Xclang", flag]
    return found


def tool(folder, *arguments):
    """Run one of the tools of ziglang, with its cache in a folder."""
    caches = {name: str(folder / "zig") for name in ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR")}
    command = [sys.executable, "-m", "ziglang", *map(str, arguments)]
    done = subprocess.run(command, env=os.environ | caches, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)


def image(plan, processor, folder):
    """Compile the kernel of a plan for a processor.

    Args:
        plan: Its kernel; nothing is compiled for this machine.
        processor: As -mcpu of Clang has it, such as "neoverse_n1".
        folder: Where files may be left.

    Returns:
        The path of an ELF file without outside references, whose entry is the kernel.
    """
    built = []

    def build(_, source, *, extra_flags="", **__):
        built.append(linked(Path(source), flags(processor, extra_flags), folder))

    folder.mkdir(parents=True, exist_ok=True)
    module = plan.kernel.advance.kernel.module
    options = module.resolve_options(wp.config, block_dim=BLOCK_DIM)
    with mock.patch("warp._src.build.build_cpu", build):
        module._compile(wp.get_device("cpu"), str(folder / "source"), options=options)
    return built[0]


def linked(source, options, folder):
    """Compile and link one file of C++."""
    (entry,) = set(re.findall(r"void (\w+_cpu_forward)\(", source.read_text()))
    headers = Path(wp.__file__).parent / "native"
    copies, code, found = folder / "copies.c", folder / "kernel.o", folder / "kernel"
    copies.write_text(COPIES)
    tool(folder, "c++", *options, "-I", headers, "-c", source, "-o", code)
    tool(
        folder,
        "cc",
        "-target",
        "aarch64-linux-musl",
        "-O1",
        "-fno-builtin",
        "-c",
        copies,
        "-o",
        copies.with_suffix(".o"),
    )
    tool(folder, "ld.lld", "-static", "-e", entry, f"--image-base={BASE}", "--gc-sections", code, copies.with_suffix(".o"),
         "-o", found)  # fmt: skip
    return found
