# SPDX-License-Identifier: Apache-2.0
"""A kernel cache that is damaged, full, unwritable or left torn: compiled anew, or told; never loaded."""

import contextlib
import errno
import functools
import hashlib
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from types import SimpleNamespace
from unittest import mock

import pytest
import warp as wp

from lgvi_warp.common import warp_setup
from lgvi_warp.engine import kernel_cache
from tests.conftest import ROOT
from tests.support import hostile
from tests.support.disks import files_of_at_most


@wp.kernel(module="unique", enable_backward=False)
def doubled(values: wp.array(dtype=wp.float64)):
    i = wp.tid()
    values[i] = values[i] + values[i]


MODULE = doubled.module


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache, and a process that has loaded nothing."""
    warp_setup.start()
    folder = tmp_path / "cache"
    folder.mkdir()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(folder))
    forget()
    yield folder
    forget()


def forget():
    """Forget loaded kernels, like a new process."""
    kernel_cache.loaded.discard(MODULE)
    MODULE.unload()


def works():
    """Load the kernel and run it."""
    kernel_cache.load(MODULE)
    values = wp.array([1.5, 2.5], dtype=wp.float64, device="cpu")
    wp.launch(doubled, dim=2, inputs=[values], device="cpu")
    return values.numpy().tolist() == [3.0, 5.0]


def only(cache, end):
    (path,) = cache.glob(f"wp_*/*{end}")
    return path


def truncated(cache):
    os.truncate(only(cache, ".o"), 200)


def emptied(cache):
    os.truncate(only(cache, ".o"), 0)


def flipped(cache):
    hostile.flipped(only(cache, ".o"), None)


def without_code(cache):
    only(cache, ".o").unlink()


def without_sums(cache):
    only(cache, ".sha256").unlink()


def torn_sums(cache):
    os.truncate(only(cache, ".sha256"), 20)


def sums_of_nothing(cache):
    only(cache, ".sha256").write_text("{}")


def torn_meta(cache):
    os.truncate(only(cache, ".meta"), 1)


def without_meta(cache):
    only(cache, ".meta").unlink()


def a_file_for_a_folder(cache):
    (folder,) = cache.glob("wp_*")
    for path in folder.iterdir():
        path.unlink()
    folder.rmdir()
    folder.write_text("")


DAMAGES = [truncated, emptied, flipped, without_code, without_sums, torn_sums, sums_of_nothing, torn_meta, without_meta,
           a_file_for_a_folder]  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: damage.__name__)
def test_what_is_damaged_is_compiled_anew(cache, damage):
    assert works()
    code, whole = only(cache, ".o"), only(cache, ".o").read_bytes()
    damage(cache)
    assert not kernel_cache.is_whole(code)
    forget()
    assert works()
    assert code.read_bytes() == whole
    assert kernel_cache.is_whole(code)
    assert sorted(path.name for path in cache.iterdir()) == sorted(
        [kernel_cache.LOCKS, kernel_cache.HEADERS, code.parent.name]
    )


@pytest.mark.ci
def test_phases(cache):
    begun = time.perf_counter()
    phases = kernel_cache.load(MODULE)
    seconds = time.perf_counter() - begun
    # Times of files are as fine as the system's clock: 1/100 s.
    assert min(phases) >= 0.0
    assert phases.clang > 0.01
    assert abs(sum(phases) - seconds) < 0.03
    assert kernel_cache.load(MODULE) == (0.0, 0.0, 0.0)
    forget()
    phases = kernel_cache.load(MODULE)
    assert phases.clang == 0.0 < phases.load
    assert "Clang 0.00 s" in str(phases)


@pytest.fixture
def header(cache):
    """The precompiled header that the first kernel of a process leaves, seen by the next process, which has to compile."""
    folders = warp_setup.header_folders()
    before = dict(folders)
    folders.clear()
    assert works()
    (kept,) = (cache / kernel_cache.HEADERS).glob("*/*.pch")
    warp_setup.end()
    only(cache, ".o").unlink()
    forget()
    yield kept
    folders.update(before)


def headers_while_it_compiles():
    """Count of precompiled headers that Clang finds."""
    found, load_module = [], wp.load_module

    def load(*requested, **named):
        found.extend(warp_setup.header_folder().glob("*.pch"))
        return load_module(*requested, **named)

    with mock.patch.object(wp, "load_module", load):
        assert works()
    return len(found)


@pytest.mark.ci
def test_a_precompiled_header_serves_the_next_process(header, capfd):
    assert headers_while_it_compiles() == 1
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_damaged_header_is_made_anew(header, capfd):
    header.write_bytes(header.read_bytes()[:-1000] + bytes(1000))
    assert headers_while_it_compiles() == 0
    assert capfd.readouterr() == ("", "")
    assert kernel_cache.is_whole(header)


@pytest.mark.slow
def test_a_header_that_clang_refuses_is_not_kept(header):
    header.write_bytes(bytes(1000))
    sums = {header.name: hashlib.sha256(bytes(1000)).hexdigest()}
    header.with_name(header.name + kernel_cache.SUMS).write_text(json.dumps(sums))
    assert headers_while_it_compiles() == 1
    assert not kernel_cache.is_whole(header)


def test_functions_for_gradients_of_structs_are_private(cache):
    template = kernel_cache.codegen.struct_template
    visible = "CUDA_CALLABLE void adj_atomic_add({name}* p, {name} t)"
    assert template.count(visible) == 1  # else Warp writes them in another way, and kernels compile as long as before
    with kernel_cache.private_gradients():
        assert kernel_cache.codegen.struct_template == template.replace(visible, f"static {visible}")
    assert kernel_cache.codegen.struct_template is template


@pytest.mark.ci
def test_what_is_whole_is_not_compiled(cache):
    assert works()
    written = only(cache, ".o").stat().st_mtime_ns
    forget()
    assert works()
    assert only(cache, ".o").stat().st_mtime_ns == written


@pytest.mark.ci
def test_code_of_other_processors_stays(cache):
    assert works()
    other = only(cache, ".o").with_name("other.cpu12345678.o")
    other.write_bytes(b"code")
    (own,) = (path for path in cache.glob("wp_*/*.o") if path != other)
    os.truncate(own, 10)
    forget()
    assert works()
    assert other.read_bytes() == b"code"


@pytest.mark.ci
def test_a_full_disk_is_told_before_llvm_ends_the_process(cache):
    no_room = r"has no room for a new kernel.*WARP_CACHE_PATH"
    with files_of_at_most(100_000), pytest.raises(OSError, match=no_room) as caught:
        works()
    assert caught.value.errno == errno.EFBIG
    assert caught.value.filename == str(cache)
    assert [path.name for path in cache.iterdir()] == [kernel_cache.LOCKS]
    # In the same process, when there is room again.
    assert works()


@pytest.mark.parametrize(("files", "remaining", "full"), [(1000, 3, True), (1000, 900, False), (0, 0, False)])
def test_no_files_left_is_no_room(tmp_path, files, remaining, full):
    fields = list(os.statvfs(tmp_path))[:10]
    fields[5], fields[7] = files, remaining
    system = SimpleNamespace(statvfs=lambda path: os.statvfs_result(fields), posix_fallocate=os.posix_fallocate)
    with pytest.raises(OSError, match="No files left") if full else contextlib.nullcontext():
        kernel_cache.seek_room(tmp_path, system=system)


def test_room_is_looked_for_by_writing_where_nothing_else_tells(tmp_path):
    def unknown(*arguments):
        raise OSError(errno.EOPNOTSUPP, "not supported")

    system = SimpleNamespace(posix_fallocate=unknown)
    kernel_cache.seek_room(tmp_path, 1000, system=system)
    for one in (system, SimpleNamespace()):
        with pytest.raises(OSError, match="not supported"):
            kernel_cache.seek_room(tmp_path, 1000, system=one, write=unknown)


def test_an_unwritable_cache_is_named(cache, monkeypatch):
    (cache / "file").write_text("")
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(cache / "file"))
    with pytest.raises(OSError, match=r"cannot be written.*WARP_CACHE_PATH to another folder") as caught:
        works()
    assert caught.value.filename == str(cache / "file")


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes anywhere")
def test_a_cache_that_is_only_read_serves_what_it_has(cache):
    assert works()
    only(cache, ".o").parent.chmod(0o500)
    cache.chmod(0o500)
    forget()
    assert works()


@pytest.mark.ci
def test_a_temporary_folder_without_room_is_not_needed(cache, monkeypatch, capfd):
    """Clang writes its precompiled header there, and would say on stderr that it cannot."""
    folders = warp_setup.header_folders()
    monkeypatch.setattr(warp_setup, "header_folders", lambda: folders)
    before = dict(folders)
    folders.clear()
    monkeypatch.setattr(kernel_cache, "temporary_room", lambda: False)
    made = []
    load_module = wp.load_module
    monkeypatch.setattr(wp, "load_module", lambda *given, **named: made.append(
        [folder.name for folder in folders.values()]) or load_module(*given, **named))  # fmt: skip
    assert works()
    assert capfd.readouterr() == ("", "")
    ((folder,),) = made
    assert folder.startswith(f"{cache}/{kernel_cache.SCRATCH}")
    assert not folders
    folders.update(before)


def test_the_temporary_folder_is_looked_at(tmp_path, monkeypatch):
    assert kernel_cache.temporary_room()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    assert not kernel_cache.temporary_room()


@pytest.mark.ci
def test_what_killed_processes_left_is_swept(cache):
    assert works()
    name = only(cache, ".o").parent.name
    dead, mine = cache / f"{name}_p4_t5", cache / f"{kernel_cache.SCRATCH}dead"
    old, new, users = (cache / f"wp_{name}_p4_t5" for name in ("make_old_1", "make_new_1", "of_a_user"))
    for path in (dead, mine, old, new, users):
        path.mkdir()
        (path / "some.cpp").write_text("")
    then = time.time() - 2.0 * kernel_cache.OLD
    for path in (old, users):
        os.utime(path, (then, then))
    truncated(cache)
    forget()
    with kernel_cache.scratch_folder(cache) as alive:
        assert works()
        assert [path.exists() for path in (dead, mine, old, new, users, alive)] == [False] * 3 + [True] * 3
    assert not alive.exists()


@pytest.mark.ci
def test_threads_compile_once(cache):
    compiled = mock.Mock(side_effect=kernel_cache.compile_module)
    load = functools.partial(kernel_cache.load, MODULE, compiled_by=compiled)
    threads = [threading.Thread(target=load) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert compiled.call_count == 1
    assert works()


def test_threads_that_start_warp_leave_stderr_as_it_was(monkeypatch):
    def slow():
        time.sleep(0.1)

    before = os.fstat(2).st_ino
    monkeypatch.setattr(wp, "init", slow)
    monkeypatch.setattr(warp_setup, "_has_cuda_driver", lambda: False)
    warp_setup.start_once.cache_clear()
    threads = [threading.Thread(target=warp_setup.start) for _ in range(3)]
    for i, thread in enumerate(threads):
        time.sleep(0.04 * i)
        thread.start()
    for thread in threads:
        thread.join()
    assert os.fstat(2).st_ino == before


def run(arguments, cache, **settings):
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "WARP_CACHE_PATH": str(cache)}
    return subprocess.run([sys.executable, "-m", "lgvi_warp.cli", *arguments], env=env, cwd=ROOT, capture_output=True,
                          text=True, timeout=120, **settings)  # fmt: skip


def test_the_command_names_a_cache_that_it_cannot_write(tmp_path):
    (tmp_path / "file").write_text("")
    done = run(["info"], tmp_path / "file")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert str(tmp_path / "file") in done.stderr
    assert "WARP_CACHE_PATH" in done.stderr


@pytest.mark.slow
def test_the_command_leaves_a_full_disk_as_it_was(tmp_path):
    done = run(["info"], tmp_path, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000)))
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "WARP_CACHE_PATH" in done.stderr
    assert not list(tmp_path.rglob("wp_*"))
    assert not list(tmp_path.rglob(f"{kernel_cache.SCRATCH}*"))


@pytest.mark.slow
def test_one_that_is_killed_while_it_compiles_leaves_nothing_for_long(tmp_path):
    run = "lw.solve(lw.Ensemble(speed.example(), 4), h=0.01, t1=0.1)"
    code = f"import lgvi_warp as lw; from lgvi_warp.studies import speed; {run}"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "WARP_CACHE_PATH": str(tmp_path)}
    process = subprocess.Popen([sys.executable, "-c", code], env=env)
    while not list(tmp_path.rglob("*.cpp")):
        time.sleep(0.01)
    process.kill()
    process.wait()
    assert list(tmp_path.rglob(f"{kernel_cache.SCRATCH}*"))
    subprocess.run([sys.executable, "-c", code], env=env, check=True, timeout=120)
    (cache,) = tmp_path.iterdir()
    names = {path.name for path in cache.iterdir()}
    assert len(names) == 3
    assert {kernel_cache.LOCKS, kernel_cache.HEADERS} < names
    assert [kernel_cache.is_whole(path) for path in cache.rglob("*.o")] == [True]
