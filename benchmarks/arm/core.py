# SPDX-License-Identifier: Apache-2.0
"""An emulated ARM core (the package unicorn) that runs a kernel in place of this machine, on the memory of this process.

Pointers stand for themselves: a page of this process is mapped at its own address when the core first asks for it. So a launch
needs no copies, and all that the product does before and after it is the product's own.
"""

import contextlib
import ctypes
import struct
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import warp._src.context as context

PAGE = 4096
# Apart from the image and from what Linux allocates.
STACK, STACK_BYTES, RETURN = 0x20000000, 1 << 26, 0x30000000
# Of an ELF segment: its kind, and the right to execute it.
LOADED, EXECUTABLE = 1, 1


def segments(elf, rights=0):
    """(address, bytes) of each part of an ELF file that is loaded with these rights at least."""
    (table,) = struct.unpack_from("<Q", elf, 32)
    size, count = struct.unpack_from("<HH", elf, 54)
    for i in range(count):
        kind, given, begin, address, _, held, whole, _ = struct.unpack_from("<IIQQQQQQ", elf, table + i * size)
        if kind == LOADED and given & rights == rights:
            yield address, elf[begin : begin + held].ljust(whole, b"\0")


def pages(address, size):
    """First address and length of the pages that hold some bytes."""
    first = address // PAGE * PAGE
    return first, -(-(address + size - first) // PAGE) * PAGE


def is_of_this_process(address):
    """Whether this process may read and write an address."""
    for line in Path("/proc/self/maps").read_text().splitlines():
        bounds, rights, *_ = line.split()
        first, stop = (int(text, 16) for text in bounds.split("-"))
        if first <= address < stop:
            return rights.startswith("rw")
    return False


class Core:
    """Runs the kernel of an image when it is called as Warp calls a kernel.

    visits: (address, bytes) of a block of instructions -> how often it began.
    """

    def __init__(self, elf):
        import unicorn
        from unicorn import arm64_const as names

        self._names, self._failed, self.visits = names, None, Counter()
        self._core = unicorn.Uc(unicorn.UC_ARCH_ARM64, unicorn.UC_MODE_ARM)
        self._core.ctl_set_cpu_model(names.UC_CPU_ARM64_MAX)
        self._core.reg_write(names.UC_ARM64_REG_CPACR_EL1, 0xF << 18)  # floating-point numbers are not trapped
        (self._entry,) = struct.unpack_from("<Q", elf, 24)
        for address, content in segments(elf):
            self._core.mem_map(*pages(address, len(content)))
            self._core.mem_write(address, content)
        self._core.mem_map(STACK, STACK_BYTES)
        self._core.mem_map(RETURN, PAGE)
        self._core.hook_add(unicorn.UC_HOOK_MEM_READ_UNMAPPED | unicorn.UC_HOOK_MEM_WRITE_UNMAPPED, self._map)
        self._core.hook_add(unicorn.UC_HOOK_BLOCK, self._count)

    def _map(self, core, access, address, size, value, _):
        """Map the pages of this process that the core asks for."""
        first, length = pages(address, size)
        for page in range(first, first + length, PAGE):
            if not is_of_this_process(page):
                return False
            with contextlib.suppress(self._unicorn_error):
                core.mem_map_ptr(page, PAGE, 3, page)
        return True

    @property
    def _unicorn_error(self):
        from unicorn import UcError

        return UcError

    def _count(self, core, address, size, _):
        self.visits[address, size] += 1

    def __call__(self, bounds, arguments):
        """Launch: both are what ctypes.byref gives."""
        names, first, second = self._names, *(ctypes.addressof(pointer._obj) for pointer in (bounds, arguments))
        values = {"X0": first, "X1": second, "SP": STACK + STACK_BYTES - PAGE, "LR": RETURN}
        for name, value in values.items():
            self._core.reg_write(getattr(names, f"UC_ARM64_REG_{name}"), value)
        self._core.emu_start(self._entry, RETURN)

    def mode(self):
        """The register that says how numbers are rounded, and whether subnormal ones are taken as zero."""
        return self._core.reg_read(self._names.UC_ARM64_REG_FPCR)

    def read(self, address, size):
        """Bytes of the image."""
        return bytes(self._core.mem_read(address, size))


@contextlib.contextmanager
def in_place_of_this_machine(core):
    """Let a core run what is launched on the CPU meanwhile; kernels are not compiled for this machine."""
    hooks = context.KernelHooks(core, None)
    loaded = SimpleNamespace(get_kernel_hooks=lambda kernel: hooks)
    with mock.patch.object(context.Module, "load", lambda *_, **__: loaded):
        yield
