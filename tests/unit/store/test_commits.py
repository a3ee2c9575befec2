# SPDX-License-Identifier: Apache-2.0
"""Blocks become durable in groups: files before markers, each folder synced once, and what fails is told of its block."""

import errno
import os
import pickle
import threading

import pytest

from lgvi_warp.common import files as durable
from lgvi_warp.common import safe_files
from lgvi_warp.store import commits
from lgvi_warp.store.commits import Commits


@pytest.fixture
def root(tmp_path):
    for name in ("chunks", "blocks"):
        (tmp_path / name).mkdir()
    return tmp_path


@pytest.fixture
def slowly(monkeypatch):
    """A group waits until the end of the context."""
    monkeypatch.setattr(commits, "PERIOD", 60.0)


def add(to, root, i, size=10):
    files = durable.Files(root)
    files.write(f"chunks/{i}", bytes(size))
    to.add(files, root / "blocks" / f"{i}", b"safe")


def there(root, folder):
    return sorted(path.name for path in (root / folder).iterdir())


def full(of, before):
    """`before`, for a disk that is full when it comes to the file called so."""

    def limited(beside, target):
        if str(target).endswith(of):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        before(beside, target)

    return limited


def test_a_group_is_synced_named_and_then_marked(root, slowly, monkeypatch):
    order = []
    file, folder, rename = durable.sync_file, durable.sync_folder, safe_files.rename

    def told(what, call):
        def telling(*paths):
            call(*paths)
            order.append((what, paths[-1].relative_to(root).as_posix()))

        return telling

    monkeypatch.setattr(durable, "sync_file", told("synced", file))
    monkeypatch.setattr(durable, "sync_folder", told("synced", folder))
    monkeypatch.setattr(safe_files, "rename", told("named", rename))
    with Commits() as own:
        for i in range(3):
            add(own, root, i)
        assert order == []
    assert there(root, "chunks") == there(root, "blocks") == list("012")
    for start, name in ((0, "chunks"), (7, "blocks")):
        part = order[start : start + 7]
        assert part[-1] == ("synced", name)
        assert all(part.index(("synced", f"{name}/{i}")) < part.index(("named", f"{name}/{i}")) for i in range(3))
    assert len(order) == 14


def test_large_files_are_on_their_way_before_their_block_is_handed_over(root, monkeypatch):
    synced = threading.Event()
    sync = os.fsync
    monkeypatch.setattr(os, "fsync", lambda descriptor: (sync(descriptor), synced.set())[0])
    files = durable.Files(root)
    files.write("chunks/small", bytes(durable.EARLY_BYTES - 1))
    assert not synced.wait(0.05)
    files.write("chunks/large", bytes(durable.EARLY_BYTES))
    assert synced.wait(10.0)
    files.finish()
    assert there(root, "chunks") == ["large", "small"]


@pytest.mark.parametrize("at", ["chunks/2", "blocks/2"])
def test_a_block_that_fails_is_not_marked_and_the_others_are(root, slowly, monkeypatch, at):
    monkeypatch.setattr(durable, "sync_file", full(at, durable.sync_file))
    with pytest.raises(OSError, match="No space left"), Commits() as own:
        for i in range(4):
            add(own, root, i)
    assert [name for name in there(root, "blocks") if durable.UNFINISHED not in name] == ["0", "1", "3"]


def test_no_room_for_a_marker(root, slowly, monkeypatch):
    def limited(file, view, write=durable.write_all):
        if "/blocks/1" in file.name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(file, view)

    monkeypatch.setattr(durable, "write_all", limited)
    with pytest.raises(OSError, match=r"No space left.*blocks/1'"), Commits() as own:
        for i in range(3):
            add(own, root, i)
    assert [name for name in there(root, "blocks") if durable.UNFINISHED not in name] == ["0", "2"]


def test_a_folder_that_cannot_be_synced_marks_nothing(root, slowly, monkeypatch):
    def refused(path):
        raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))

    monkeypatch.setattr(durable, "sync_folder", refused)
    with pytest.raises(OSError, match="Input/output error"), Commits() as own:
        add(own, root, 0)
    assert there(root, "blocks") == []


def test_the_next_block_is_told_that_the_disk_is_full(root, monkeypatch):
    monkeypatch.setattr(commits, "PERIOD", 0.0)
    monkeypatch.setattr(durable, "sync_file", full("chunks/0", durable.sync_file))
    own = Commits()
    add(own, root, 0)
    with pytest.raises(OSError, match="No space left"), own:
        for i in range(1, 10_000):
            add(own, root, i)
    assert 0 < len(there(root, "blocks")) < 9_999


def test_an_interrupt_waits_for_the_blocks_that_are_written(root, slowly):
    with pytest.raises(KeyboardInterrupt), Commits() as own:
        add(own, root, 0)
        raise KeyboardInterrupt
    assert there(root, "blocks") == ["0"]


def test_a_copy_in_another_process_waits_for_each_block(root, slowly, monkeypatch):
    own = pickle.loads(pickle.dumps(Commits()))
    add(own, root, 0)
    assert there(root, "blocks") == ["0"]
    with monkeypatch.context() as patch:
        patch.setattr(durable, "sync_file", full("chunks/1", durable.sync_file))
        with pytest.raises(OSError, match="No space left"):
            add(own, root, 1)
    add(own, root, 2)
    assert there(root, "blocks") == ["0", "2"]


def waits(call, gate):
    """Whether a call goes on only when the gate is opened."""
    thread = threading.Thread(target=call)
    thread.start()
    thread.join(0.2)
    waited = thread.is_alive()
    gate.set()
    thread.join(10.0)
    return waited and not thread.is_alive()


def test_blocks_wait_for_a_disk_that_is_behind(root, monkeypatch):
    gate, sync = threading.Event(), durable.sync_file
    monkeypatch.setattr(commits, "MOST", 2)
    monkeypatch.setattr(durable, "sync_file", lambda beside, target: (gate.wait(10.0), sync(beside, target)))
    with Commits() as own:
        for i in range(3):
            add(own, root, i)  # two are at the disk or on the way to it
        assert waits(lambda: [add(own, root, i) for i in range(3, 6)], gate)
    assert len(there(root, "blocks")) == 6


def test_large_files_wait_for_a_disk_that_is_behind(root, monkeypatch):
    gate, sync = threading.Event(), os.fsync
    monkeypatch.setattr(durable, "_room", threading.BoundedSemaphore(2))
    monkeypatch.setattr(os, "fsync", lambda descriptor: (gate.wait(10.0), sync(descriptor)))
    files = durable.Files(root)
    for i in range(2):
        files.write(f"chunks/{i}", bytes(durable.EARLY_BYTES))
    assert waits(lambda: files.write("chunks/2", bytes(durable.EARLY_BYTES)), gate)
    files.finish()
    assert there(root, "chunks") == ["0", "1", "2"]
