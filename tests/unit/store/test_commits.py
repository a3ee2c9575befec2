# SPDX-License-Identifier: Apache-2.0
"""Blocks become durable in groups: files before markers, each folder synced once, and what fails is told of its block."""

import errno
import pickle
import threading

import pytest

from lgvi_warp.common import files as durable
from lgvi_warp.store.commits import Commits
from tests.support.disks import Disk, full, refused


@pytest.fixture
def root(tmp_path):
    for name in ("chunks", "blocks"):
        (tmp_path / name).mkdir()
    return tmp_path


def grouped():
    """Commits whose group waits until the end of the context."""
    return Commits(period=60.0)


def add(to, root, i, size=10):
    files = durable.Files(root)
    files.write(f"chunks/{i}", bytes(size))
    to.add(files, root / "blocks" / f"{i}", b"safe")


def there(root, folder):
    return sorted(path.name for path in (root / folder).iterdir())


def marked(root):
    """Names of the markers that are in their places."""
    return [name for name in there(root, "blocks") if durable.UNFINISHED not in name]


def test_a_group_is_synced_named_and_then_marked(root):
    with grouped() as own, Disk() as disk:
        for i in range(3):
            add(own, root, i)
        assert all(what == "created" for what, _ in disk.done)
        own.__exit__(None)
    assert there(root, "chunks") == there(root, "blocks") == list("012")
    order = [(what, path.relative_to(root).as_posix()) for what, path in disk.done if what != "created"]
    for start, name in ((0, "chunks"), (7, "blocks")):
        part = order[start : start + 7]
        assert part[-1] == ("synced", name)
        assert all(part.index(("synced", f"{name}/{i}")) < part.index(("named", f"{name}/{i}")) for i in range(3))
    assert len(order) == 14


def test_large_files_are_on_their_way_before_their_block_is_handed_over(root):
    synced = threading.Event()
    with Disk(lambda what, path: synced.set() if what == "synced" else None):
        files = durable.Files(root)
        files.write("chunks/small", bytes(durable.EARLY_BYTES - 1))
        assert not synced.wait(0.05)
        files.write("chunks/large", bytes(durable.EARLY_BYTES))
        assert synced.wait(10.0)
        files.finish()
    assert there(root, "chunks") == ["large", "small"]


@pytest.mark.parametrize(
    ("fault", "output", "others"),
    [
        (full(("synced", "chunks/2")), "No space left", ["0", "1", "3"]),
        (full(("synced", "blocks/2")), "No space left", ["0", "1", "3"]),
        (full(("created", "blocks/1")), r"No space left.*blocks/1'", ["0", "2", "3"]),
        (refused(errno.EIO, ("synced", "chunks")), "Input/output error", []),
    ],
    ids=["a file", "a marker", "no room for a marker", "a folder"],
)
def test_a_block_that_fails_is_not_marked_and_the_others_are(root, fault, output, others):
    with pytest.raises(OSError, match=output), Disk(fault), grouped() as own:
        for i in range(4):
            add(own, root, i)
    assert marked(root) == others


def test_the_next_block_is_told_that_the_disk_is_full(root):
    own = Commits(period=0.0)
    with Disk(full(("synced", "chunks/0"))):
        add(own, root, 0)
        with pytest.raises(OSError, match="No space left"), own:
            for i in range(1, 10_000):
                add(own, root, i)
    assert 0 < len(there(root, "blocks")) < 9_999


def test_an_interrupt_waits_for_the_blocks_that_are_written(root):
    with pytest.raises(KeyboardInterrupt), grouped() as own:
        add(own, root, 0)
        raise KeyboardInterrupt
    assert there(root, "blocks") == ["0"]


def test_a_copy_in_another_process_waits_for_each_block(root):
    own = pickle.loads(pickle.dumps(grouped()))
    add(own, root, 0)
    assert there(root, "blocks") == ["0"]
    with Disk(full(("synced", "chunks/1"))), pytest.raises(OSError, match="No space left"):
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


def behind(gate):
    """A disk that syncs nothing until the gate is opened."""
    return Disk(lambda what, path: gate.wait(10.0) if what == "synced" else None)


def test_blocks_wait_for_a_disk_that_is_behind(root):
    gate = threading.Event()
    with behind(gate), Commits(most=2) as own:
        for i in range(3):
            add(own, root, i)  # two are at the disk or on the way to it
        assert waits(lambda: [add(own, root, i) for i in range(3, 6)], gate)
    assert len(there(root, "blocks")) == 6


def test_large_files_wait_for_a_disk_that_is_behind(root):
    gate, most = threading.Event(), durable.MOST_WAITING
    files = durable.Files(root)
    with behind(gate):
        for i in range(most):
            files.write(f"chunks/{i}", bytes(durable.EARLY_BYTES))
        assert waits(lambda: files.write(f"chunks/{most}", bytes(durable.EARLY_BYTES)), gate)
        files.finish()
    assert len(there(root, "chunks")) == most + 1
