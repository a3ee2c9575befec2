# SPDX-License-Identifier: Apache-2.0
"""Kernels in Warp's cache: compiled once for all processes, and loaded only if their checksums match.

    CACHE/wp_NAME_HASH/NAME.cpuTARGET.o          code of one kind of processor
    CACHE/wp_NAME_HASH/NAME.cpuTARGET.o.sha256   checksums of that file and of its .meta, written last
    CACHE/lgvi_warp_headers/KEY/NAME.pch         Clang's precompiled header, with its checksum, for later processes
    CACHE/lgvi_warp_locks/                       locks held while a kernel is compiled
    CACHE/lgvi_warp_scratch_RANDOM/              a kernel being compiled, locked by the process that compiles it

Damaged code would crash the process, so code is loaded only if its checksums match. LLVM aborts the process if it
cannot write, so free disk space is checked before it starts.
"""

from __future__ import annotations

import contextlib
import errno
import functools
import hashlib
import json
import os
import re
import shutil
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import warp as wp
import warp._src.codegen as codegen

from lgvi_warp.common import files as durable
from lgvi_warp.common import warp_setup
from lgvi_warp.common.phases import Phases
from lgvi_warp.common.warp_setup import build_lock

# Source, code and header of a kernel are a few 100 kB; Clang's precompiled header is 5 MB.
ROOM_BYTES, ROOM_FILES = 16_000_000, 16
# CPU kernels are launched with one thread a block: a variant of the module of its own.
BLOCK_DIM = 1
LOCKS, SCRATCH, SUMS = "lgvi_warp_locks", "lgvi_warp_scratch_", ".sha256"
HEADERS, HEADER = "lgvi_warp_headers", "builtin_*.pch"
# Folders that Warp leaves when it is killed while it compiles, and the age at which they belong to no process [s].
TORN, OURS, OLD = re.compile(r"(\w+)_p\d+_t\d+"), "wp_make_", 86_400.0

loaded: weakref.WeakSet[Any] = weakref.WeakSet()


def load(module: Any, *, compiled_by: Callable[..., tuple[float, float]] | None = None) -> Phases:
    """Load a kernel's code, and compile it first if the cache has no undamaged code."""
    warp_setup.start()
    with build_lock:
        if module in loaded:
            return Phases()
        begun = time.time()
        cache = Path(wp.config.kernel_cache_dir)
        folder = cache / module.get_module_identifier(BLOCK_DIM)
        code = folder / module._get_compile_output_name(wp.get_device("cpu"), block_dim=BLOCK_DIM)
        with one_at_a_time(module.get_module_hash().hex()):
            hashed = time.time()
            if is_whole(code):
                wp.load_module(module, device="cpu")
                written = compiled = hashed
            else:
                written, compiled = (compiled_by or compile_module)(module, cache, code)
        loaded.add(module)
        return Phases(written - begun, compiled - written, time.time() - compiled)


@contextlib.contextmanager
def one_at_a_time(kernel: str) -> Iterator[None]:
    """Let one process compile a kernel while other processes that need it wait for the result in the cache.

    Kernels whose hashes begin with the same two digits share a lock, so that there are at most 256 files to lock.
    """
    path = Path(wp.config.kernel_cache_dir) / LOCKS / kernel[:2]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    except OSError:  # a cache that is only read
        yield
        return
    with durable.locked(path, wait=True):
        yield


def is_whole(code: Path) -> bool:
    """Whether a kernel's code, and all files named in its checksums, are unchanged."""
    try:
        sums = json.loads(code.with_name(code.name + SUMS).read_bytes())
        return code.name in sums and all(_sha256(code.with_name(name)) == value for name, value in sums.items())
    except (OSError, ValueError, TypeError):
        return False


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def compile_module(module: Any, cache: Path, code: Path) -> tuple[float, float]:
    """Compile and load a kernel in a scratch folder, then put its files into the cache, checksums last.

    Returns: Times at which its source and its code were written, as of time.time() [s].
    """
    try:
        sweep(cache, code.parent)
        seek_room(cache)
        with (
            scratch_folder(cache) as scratch,
            _clang_headers(scratch),
            kept_header(cache, scratch),
            private_gradients(),
        ):
            wp.config.kernel_cache_dir = str(scratch)
            try:
                wp.load_module(module, device="cpu")
            except BaseException:
                module.mark_modified()  # Warp would repeat the error without trying again
                raise
            finally:
                wp.config.kernel_cache_dir = str(cache)
            files = scratch / code.parent.name
            times = [path.stat().st_mtime for path in (*files.glob("*.cpp"), files / code.name)]
            _move(files, code)
            return times[0], times[-1]
    except OSError as error:
        raise warp_setup.unusable(cache, error) from error


def _move(compiled: Path, code: Path) -> None:
    """Move a compiled kernel's files into the cache; existing files are damaged, or for other processors."""
    names = [code.name, *(path.name for path in compiled.glob("*.meta"))]
    (compiled / (code.name + SUMS)).write_text(json.dumps({name: _sha256(compiled / name) for name in names}))
    if code.parent.exists() and not code.parent.is_dir():
        code.parent.unlink()
    code.parent.mkdir(exist_ok=True)
    last = code.name + SUMS
    code.with_name(last).unlink(missing_ok=True)
    for path in sorted(compiled.iterdir(), key=lambda path: path.name == last):
        path.replace(code.with_name(path.name))


@contextlib.contextmanager
def scratch_folder(cache: Path) -> Iterator[Path]:
    """A temporary folder of this process, which `sweep` does not remove while the process lives."""
    with contextlib.ExitStack() as stack:
        with one_at_a_time(SCRATCH):
            path = Path(tempfile.mkdtemp(prefix=SCRATCH, dir=cache))
            stack.callback(shutil.rmtree, path, ignore_errors=True)
            stack.enter_context(durable.locked(path))
        yield path


@contextlib.contextmanager
def _clang_headers(scratch: Path) -> Iterator[None]:
    """Make Clang store its precompiled header in the scratch folder if the system's temporary folder is full."""
    folders, thread = warp_setup.header_folders(), threading.get_ident()
    if thread in folders or temporary_room():
        yield
        return
    with tempfile.TemporaryDirectory(prefix="wp_pch_", dir=scratch) as folder:
        folders[thread] = SimpleNamespace(name=folder, cleanup=lambda: None)
        try:
            yield
        finally:
            del folders[thread]


@contextlib.contextmanager
def kept_header(cache: Path, scratch: Path) -> Iterator[None]:
    """Give this thread the precompiled header of an earlier process, or save the one that Clang writes now.

    Clang needs longer for it than for a plain kernel, and Warp would make it again in every process.
    """
    folder = warp_setup.header_folder()
    if folder is None:
        yield
        return
    kept = cache / HEADERS / header_key()
    for path in kept.glob(HEADER):
        if not (folder / path.name).exists() and is_whole(path):
            with contextlib.suppress(OSError):
                shutil.copyfile(path, folder / path.name)
    before = {path.name for path in folder.glob(HEADER)}
    yield
    after = {path.name for path in folder.glob(HEADER)}
    with contextlib.suppress(OSError):
        for name in before - after:  # Warp removes one that Clang refuses
            (kept / (name + SUMS)).unlink(missing_ok=True)
        for name in after:
            if not is_whole(kept / name):
                kept.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(folder / name, scratch / name)
                (scratch / (name + SUMS)).write_text(json.dumps({name: _sha256(scratch / name)}))
                (scratch / name).replace(kept / name)
                (scratch / (name + SUMS)).replace(kept / (name + SUMS))


@functools.cache
def header_key() -> str:
    """Key of a precompiled header: the processor, and the content of Warp's own headers."""
    native = Path(wp.__file__).parent / "native"
    files = [(path.name, path.stat().st_size, path.stat().st_mtime_ns) for path in sorted(native.glob("*.h"))]
    content = json.dumps([wp.get_cpu_kernel_cache_key(), str(native), files])
    return hashlib.sha256(content.encode()).hexdigest()[:16]


@contextlib.contextmanager
def private_gradients() -> Iterator[None]:
    """Make Clang omit the gradient functions that Warp writes for each struct.

    No kernel here calls them. Clang omits them if they are static; otherwise they take up to two fifths of its time.
    """
    template = codegen.struct_template
    visible = "CUDA_CALLABLE void adj_atomic_add("
    codegen.struct_template = template.replace(visible, f"static {visible}")
    try:
        yield
    finally:
        codegen.struct_template = template


def temporary_room() -> bool:
    """Whether the system's folder for temporary files has space for a precompiled header."""
    try:
        seek_room(Path(tempfile.gettempdir()))
    except OSError:
        return False
    return True


def seek_room(
    folder: Path, wanted: int = ROOM_BYTES, *, system: Any = os, write: Callable[..., None] = durable.write_all
) -> None:
    """Check by a trial that a folder has space for some bytes and files, since quotas and limits cannot be read.

    system: module with the functions of os that report on files.
    """
    if hasattr(system, "statvfs"):
        room = system.statvfs(folder)
        # A system that has no fixed number of files says 0.
        if room.f_files and room.f_favail < ROOM_FILES:
            raise OSError(errno.ENOSPC, "No files left on device")
    with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
        try:
            system.posix_fallocate(file.fileno(), 0, wanted)
        except (AttributeError, OSError) as error:
            if getattr(error, "errno", None) not in (None, errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS):
                raise
            write(file, memoryview(bytes(wanted)))


def sweep(cache: Path, folder: Path) -> None:
    """Remove the remains of killed processes from the cache: their scratch folders, and Warp's unfinished folders.

    Unfinished folders are removed if they are old, or belong to the kernel of `folder`, which only this process may
    compile.
    """
    with one_at_a_time(SCRATCH):
        for path in cache.glob(f"{SCRATCH}*"):
            if _is_abandoned(path):
                shutil.rmtree(path, ignore_errors=True)
    for path in cache.glob("wp_*_p*_t*"):
        torn = TORN.fullmatch(path.name)
        if torn and (torn[1] == folder.name or (torn[1].startswith(OURS) and _is_old(path))):
            shutil.rmtree(path, ignore_errors=True)


def _is_old(path: Path) -> bool:
    try:
        return time.time() - path.stat().st_mtime > OLD
    except OSError:
        return False


def _is_abandoned(path: Path) -> bool:
    """Whether no process uses a scratch folder; False also if the file system has no locks."""
    try:
        import fcntl

        descriptor = os.open(path, os.O_RDONLY)
    except (ImportError, OSError):
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return True
