# SPDX-License-Identifier: Apache-2.0
"""Whatever is done with files, and however it ends, no descriptor stays open and no unfinished file lies about."""

import contextlib
import gc
import os

import pytest

from lgvi_warp.common import files, reading, safe_files, write_lock
from lgvi_warp.common.errors import SceneError
from tests.support import disks
from tests.support.disks import Disk

DESCRIPTORS = "/proc/self/fd"


@pytest.fixture(scope="module")
def collected():
    """Close the files of other tests, to which nothing refers any more."""
    gc.collect()


@pytest.fixture
def root(tmp_path):
    """A folder with a file, a folder with a file, a link, a pipe, and a folder that a run may replace."""
    root = tmp_path / "root"
    (root / "inner").mkdir(parents=True)
    (root / "file").write_bytes(b"content")
    (root / "inner" / "deep").write_bytes(b"deep")
    (root / "link").symlink_to(root / "file")
    (root / "away").symlink_to(tmp_path)
    os.mkfifo(root / "pipe")
    (root / "new").mkdir()
    return root


def write_files(root):
    group = files.Files(root)
    group.write("inner/a", b"1" * 100)
    group.write("inner/b", b"2" * 5_000_000)
    try:
        group.finish()
    finally:
        group.drop()


def place(root):
    with files.placed(root / "placed") as beside:
        beside.write_bytes(b"3")


def hold(root):
    with files.locked(root / "inner") as had, write_lock.write_lock(root / "store"):
        assert had


def hold_twice(root):
    with write_lock.write_lock(root / "store"), write_lock.write_lock(root / "store"):
        pass


def create(root):
    with safe_files.created(root, root / "inner" / "c") as file:
        file.write(b"4")


def fail_within(root):
    with files.placed(root / "placed") as beside:
        beside.write_bytes(b"5")
        raise KeyError


ACTIONS = {
    "sync a file": lambda root: files.sync_file(root / "file", root / "file"),
    "sync a folder": lambda root: files.sync_folder(root),
    "write several": write_files,
    "write one": lambda root: files.write_whole(root / "one", b"6"),
    "place": place,
    "place and fail": fail_within,
    "put a folder": lambda root: files.put_folder(root / "new", root / "inner"),
    "locks": hold,
    "a lock that is held": hold_twice,
    "create": create,
    "create below a link": lambda root: contextlib.ExitStack().enter_context(safe_files.created(root, root / "away" / "x")),
    **{f"read {name}": lambda root, name=name: safe_files.read(root, name, 100)
       for name in ("file", "inner/deep", "link", "away/x", "pipe", "inner", "none")},
    "read too much": lambda root: safe_files.read(root, "file", 3),
    "names": lambda root: safe_files.names(root, "inner"),
    "names below a link": lambda root: safe_files.names(root, "away"),
    "entries": lambda root: list(safe_files.entries(root / "inner")),
    **{f"a scene's {name}": lambda root, name=name: reading.file_bytes(root / name, "a scene")
       for name in ("file", "pipe", "inner", "none")},
}  # fmt: skip


def act(action, root):
    with contextlib.suppress(OSError, SceneError, ValueError, KeyError):
        action(root)


def open_files():
    """Descriptors of this process with what each leads to; other threads may close some meanwhile."""
    links = set()
    for name in os.listdir(DESCRIPTORS):
        with contextlib.suppress(OSError):
            links.add((name, os.readlink(f"{DESCRIPTORS}/{name}")))
    return links


@pytest.mark.skipif(not os.path.isdir(DESCRIPTORS), reason="the system does not list open files")
@pytest.mark.parametrize("full", [False, True], ids=["", "full disk"])
@pytest.mark.parametrize("name", ACTIONS)
def test_no_descriptor_stays_open(name, full, root, collected):
    write_files(root)  # threads and locks that are made once
    for beside in (root / "inner" / "a", root / "inner" / "b"):
        beside.unlink()
    before = open_files()
    with Disk(disks.full(("synced", ""))) if full else contextlib.nullcontext():
        act(ACTIONS[name], root)
    files.syncs().submit(int).result()
    assert not open_files() - before
    assert not list(root.rglob(f"*{files.UNFINISHED}"))
