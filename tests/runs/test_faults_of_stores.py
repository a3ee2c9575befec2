# SPDX-License-Identifier: Apache-2.0
"""Two at once, killed at any moment, a full or unwritable disk: what is left is whole, and nobody else's file is touched."""

import errno
import json
import os
import re
import shutil
import sys
import threading
import time

import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli import report
from lgvi_warp.common import files as durable
from lgvi_warp.common import safe_files, scratch, write_lock
from lgvi_warp.store import folder as store
from tests.conftest import ROOT
from tests.support import hostile
from tests.support.disks import Disk, full, refused
from tests.support.stores import MEMBERS, SETTINGS, differing, fleet, forked, tree


def together(path, mode, here):
    """Wait for the word, then run into a store."""
    (here / f"ready{os.getpid()}").touch()
    while not (here / "go").exists():
        time.sleep(0.001)
    try:
        lw.solve(fleet(), **SETTINGS, store=lw.Store(path, existing=mode))
    except lw.SceneError as error:
        (here / f"said{os.getpid()}").write_text(str(error))
        sys.exit(1)


def dying(path, place, count, exchange):
    """Overwrite a store, and die, as by a kill, on coming to a certain place the n-th time."""
    if exchange == "no":
        durable.exchanged = lambda one, other: False
    owner, name = {"rename": (durable.Path, "replace"), "sync": (durable, "sync_folder"),
                   "remove": (scratch, "remove_folder"), "write": (safe_files, "rename")}[place]  # fmt: skip
    call, left = getattr(owner, name), [count]

    def die(*arguments):
        left[0] -= 1
        if left[0] < 0:
            os._exit(9)
        return call(*arguments)

    setattr(owner, name, die)
    lw.solve(fleet(300), **SETTINGS, store=lw.Store(path, existing="overwrite"))


def saving(source, target, times):
    """Save a result again and again."""
    first = lw.Result.load(source)
    for _ in range(times):
        first.save(target)


def holding(path, sign):
    """Hold the lock of a store."""
    with write_lock.write_lock(path):
        sign.touch()
        time.sleep(60)


def at_once(*calls):
    """Threads that begin together, until all have ended."""
    threads = [threading.Thread(target=call) for call in calls]
    for one in threads:
        one.start()
    for one in threads:
        one.join()


@pytest.fixture(scope="module")
def complete(tmp_path_factory):
    """A complete store, which no test changes."""
    path = tmp_path_factory.mktemp("whole") / "run.zarr"
    lw.solve(fleet(), **SETTINGS, store=path)
    return path


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Two results, saved."""
    folder = tmp_path_factory.mktemp("results")
    return [lw.solve(fleet(n), **SETTINGS).save(folder / f"{n}.npz") for n in (20, 30)]


@pytest.mark.ci
@pytest.mark.parametrize(("mode", "count"), [("refuse", 2), ("refuse", 4), ("resume", 4), ("overwrite", 4)])
def test_runs_that_start_together(complete, tmp_path, mode, count):
    """One of them runs; the others are refused, or find it done."""
    path, here = tmp_path / "runs" / "run.zarr", tmp_path / "here"
    here.mkdir()
    processes = [forked(together, path, mode, here) for _ in range(count)]
    while len(list(here.iterdir())) < count:
        assert all(one.is_alive() for one in processes)
        time.sleep(0.005)
    (here / "go").touch()
    for one in processes:
        one.join(120)
    refused = [one for one in processes if one.exitcode != 0]
    assert len(refused) == count - 1 if mode == "refuse" else len(refused) < count
    for one in refused:
        text = (here / f"said{one.pid}").read_text()
        assert "another run is writing into it" in text or "holds a run already" in text
    assert differing(complete, path) == []
    assert [one.name for one in path.parent.iterdir()] == ["run.zarr"]


@pytest.mark.ci
def test_threads_of_one_process_are_kept_apart_as_well(complete, tmp_path):
    path, said = tmp_path / "run.zarr", []

    def run():
        try:
            lw.solve(fleet(), **SETTINGS, store=path)
        except lw.SceneError as error:
            said.append(str(error))

    at_once(run, run, run)
    assert len(said) == 2
    assert differing(complete, path) == []


@pytest.mark.slow
def test_processes_of_one_run_write_side_by_side(complete, tmp_path):
    """Workers are the run's own: they take no lock."""
    lw.solve(fleet(), **SETTINGS, store=tmp_path / "run.zarr", executor="processes", threads=2)
    assert differing(complete, tmp_path / "run.zarr") == []
    assert [one.name for one in tmp_path.iterdir()] == ["run.zarr"]


def test_the_holder_is_named(tmp_path):
    path = tmp_path / "run.zarr"
    with store.held(path), pytest.raises(lw.SceneError) as refused, store.held(path):
        pass
    text = str(refused.value)
    assert f"another run is writing into it (process {os.getpid()} on " in text
    assert "since 20" in text
    assert "Wait for it, or end it" in text
    assert list(tmp_path.iterdir()) == []


def test_a_lock_ends_with_its_process(tmp_path):
    path, sign = tmp_path / "run.zarr", tmp_path / "sign"
    process = forked(holding, path, sign)
    while not sign.exists():
        assert process.is_alive()
        time.sleep(0.005)
    with pytest.raises(lw.SceneError, match=f"process {process.pid} on"), store.held(path):
        pass
    process.kill()
    process.join()
    assert write_lock.lock_file(path).exists()
    with store.held(path):
        pass
    assert not write_lock.lock_file(path).exists()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.filterwarnings("ignore:This process.*is multi-threaded")
def test_a_fork_does_not_keep_the_lock(tmp_path):
    path = tmp_path / "run.zarr"
    read, send = os.pipe()
    with store.held(path):
        child = os.fork()
        if child == 0:
            os.close(send)
            os.read(read, 1)  # until the parent has ended with it
            os._exit(0)
    with store.held(path):
        pass
    os.close(send)
    os.waitpid(child, 0)
    os.close(read)


def test_a_file_of_the_users_is_not_taken_for_a_lock(tmp_path):
    path = write_lock.lock_file(tmp_path / "run.zarr")
    for make in (
        lambda: path.write_text("mine"),
        lambda: path.symlink_to(tmp_path / "other"),
        path.mkdir,
        lambda: os.mkfifo(path),
    ):
        make()
        with pytest.raises(lw.SceneError, match=r"is not a lock of lgvi-warp, but has its name. Move it away"):
            lw.solve(fleet(10), **SETTINGS, store=tmp_path / "run.zarr")
        assert not (tmp_path / "run.zarr").exists()
        assert not (tmp_path / "other").exists()
        path.rmdir() if path.is_dir() else path.unlink()


def test_without_locks_the_named_process_is_looked_for(tmp_path, monkeypatch):
    import fcntl

    def none(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", none)
    path = write_lock.lock_file(tmp_path / "run.zarr")
    with (
        store.held(tmp_path / "run.zarr"),
        pytest.raises(lw.SceneError, match="another run"),
        store.held(tmp_path / "run.zarr"),
    ):
        pass
    path.write_text(json.dumps({"pid": 2**22 + 5, "host": scratch.host(), "since": "then"}))
    with store.held(tmp_path / "run.zarr"):
        pass


@pytest.mark.ci
def test_two_who_save_into_one_file(results, tmp_path):
    """Each of the two, again and again: what is read meanwhile and afterwards is whole."""
    target = tmp_path / "result.npz"
    shutil.copy(results[0], target)
    processes = [forked(saving, one, target, 60) for one in results]
    while any(one.is_alive() for one in processes):
        assert lw.Result.load(target).members in (20, 30)
    assert [one.exitcode for one in processes] == [0, 0]
    assert lw.Result.load(target).members in (20, 30)
    assert [one.name for one in tmp_path.iterdir()] == ["result.npz"]


def test_two_threads_who_save_into_one_file(results, tmp_path):
    loaded, target = [lw.Result.load(one) for one in results], tmp_path / "result.npz"
    at_once(*[lambda one=one: [one.save(target) for _ in range(20)] for one in loaded])
    assert lw.Result.load(target).members in (20, 30)
    assert [one.name for one in tmp_path.iterdir()] == ["result.npz"]


def test_killed_while_it_saves(results, tmp_path):
    """The file that was there stays whole, and what the killed one left is removed by the next."""
    target = tmp_path / "result.npz"
    shutil.copy(results[0], target)
    for i in range(3):
        process = forked(saving, results[1], target, 10**6)
        while not list(tmp_path.glob("*.part")):
            assert process.is_alive()
        time.sleep(0.003 * i)
        process.kill()
        process.join()
        assert lw.Result.load(target).members in (20, 30)
    (tmp_path / "result.npz.part").write_text("the user's")
    (tmp_path / "result.npz.mine-1-notes.part").write_text("the user's")
    lw.Result.load(results[0]).save(target)
    names = ["result.npz", "result.npz.mine-1-notes.part", "result.npz.part"]
    assert sorted(one.name for one in tmp_path.iterdir()) == names


def test_a_file_of_another_machine_is_left_alone(results, tmp_path):
    others = tmp_path / f"result.npz.elsewhere-4026531836-{2**22 + 5}-0123abcd.part"
    dead = tmp_path / f"result.npz.{scratch.host()}-{2**22 + 5}-0123abcd.part"
    alive = tmp_path / f"result.npz.{scratch.host()}-{os.getpid()}-0123abcd.part"
    for one in (others, dead, alive):
        one.write_text("half")
    lw.Result.load(results[0]).save(tmp_path / "result.npz")
    assert [one.exists() for one in (others, dead, alive)] == [True, False, True]


def test_two_runs_that_end_together_leave_the_files_of_one(results, tmp_path):
    """Their files are written one after another."""
    loaded = [lw.Result.load(one) for one in results]
    with Disk(lambda what, path: time.sleep(0.05)) as disk:
        at_once(*[lambda one=one: report.write(one, None, tmp_path) for one in loaded])
    order = [what for what, path in disk.done if path == tmp_path / "result.npz"]
    assert order == ["synced", "named"] * 2
    assert [one.name for one in tmp_path.iterdir()] == ["result.npz"]
    assert lw.Result.load(tmp_path / "result.npz").members in (20, 30)


def test_a_saved_result_is_on_the_disk_before_it_has_its_name(results, tmp_path):
    target = tmp_path / "result.npz"
    with Disk() as disk:
        lw.Result.load(results[0]).save(target)
    order = [one for one in disk.done if one[0] != "created"]
    assert order == [("synced", target), ("named", target), ("synced", tmp_path)]


# What a folder called run.zarr may hold that no run wrote, and whether there is a run beside it.
NOTES = {
    "notes beside a run": ("notes.txt", True),
    "notes within an array": ("position/notes.txt", True),
    "a folder of notes": ("mine/notes.txt", True),
    "notes among the blocks": ("blocks/notes.json", True),
    "notes in the kept members' place": ("kept/notes.txt", True),
    "notes alone": ("notes.txt", False),
    "another zarr": ("temperature/c/0", False),
}


@pytest.mark.parametrize("name", NOTES)
@pytest.mark.parametrize("verb", ["run", "merge"])
def test_what_no_run_wrote_is_not_overwritten(complete, tmp_path, name, verb, capsys):
    notes, with_run = NOTES[name]
    path = tmp_path / "run.zarr"
    if with_run:
        shutil.copytree(complete, path)
    (path / notes).parent.mkdir(parents=True, exist_ok=True)
    (path / notes).write_text("mine")
    before = tree(tmp_path)
    arguments = {
        "run": [str(ROOT / "examples" / "paper.toml"), "--store", "zarr", "--members", "5"],
        "merge": [str(complete)],
    }[verb]
    assert cli.main([verb, *arguments, "--out", str(tmp_path), "--overwrite"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "not overwritten. Move it away, or give another folder" in said
    assert tree(tmp_path) == before


@pytest.mark.ci
def test_a_link_is_not_overwritten_but_what_it_leads_to(complete, tmp_path):
    """A run on another disk; a link within a run is no run's."""
    shutil.copytree(complete, tmp_path / "disk" / "run.zarr")
    (tmp_path / "run.zarr").symlink_to(tmp_path / "disk" / "run.zarr")
    lw.solve(fleet(), **SETTINGS, store=lw.Store(tmp_path / "run.zarr", existing="overwrite"))
    assert (tmp_path / "run.zarr").is_symlink()
    assert differing(complete, tmp_path / "disk" / "run.zarr") == []
    shutil.rmtree(tmp_path / "disk" / "run.zarr" / "status")
    (tmp_path / "notes").mkdir()
    (tmp_path / "disk" / "run.zarr" / "status").symlink_to(tmp_path / "notes")
    with pytest.raises(lw.SceneError, match="holds status, which no run wrote"):
        lw.solve(fleet(), **SETTINGS, store=lw.Store(tmp_path / "run.zarr", existing="overwrite"))


@pytest.mark.ci
def test_a_damaged_run_may_be_overwritten(complete, tmp_path):
    for name in ("zarr.json", "created.json"):
        path = shutil.copytree(complete, tmp_path / name / "run.zarr")
        (path / name).write_bytes(b"{")
        lw.solve(fleet(), **SETTINGS, store=lw.Store(path, existing="overwrite"))
        assert differing(complete, path) == []


@pytest.mark.ci
def test_an_empty_folder_is_taken(complete, tmp_path):
    (tmp_path / "run.zarr").mkdir()
    lw.solve(fleet(), **SETTINGS, store=tmp_path / "run.zarr")
    assert differing(complete, tmp_path / "run.zarr") == []


# Where an overwriting run dies: what it is doing, how often it has done that before, and whether folders can be exchanged.
DEATHS = [("rename", 0, "no"), ("rename", 1, "no"), ("sync", 20, "yes"), ("remove", 0, "yes"), ("write", 3, "yes")]


@pytest.mark.ci
@pytest.mark.parametrize(("place", "count", "exchange"), DEATHS)
def test_killed_while_it_overwrites(complete, tmp_path, place, count, exchange):
    """The old run is there, or the new one, which goes on; nothing is left of the other."""
    path = shutil.copytree(complete, tmp_path / "run.zarr")
    process = forked(dying, path, place, count, exchange)
    process.join(120)
    assert process.exitcode == 9
    with store.held(path):  # whoever comes next mends it
        assert path.exists()
    folder = store.Folder(path)
    assert folder.recipe["members"] in (300, MEMBERS)
    if folder.recipe["members"] == MEMBERS:
        assert differing(complete, path) == []
    else:
        assert lw.resume(path).members == 300
    assert [one.name for one in tmp_path.iterdir()] == ["run.zarr"]


def test_folders_are_exchanged_in_one_step(tmp_path):
    for name in "ab":
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    if not durable.exchanged(tmp_path / "a", tmp_path / "b"):
        pytest.skip("this system cannot")
    assert (os.listdir(tmp_path / "a"), os.listdir(tmp_path / "b")) == (["b"], ["a"])


@pytest.mark.ci
def test_nobody_elses_folder_beside_a_run_is_removed(complete, tmp_path):
    """The names that earlier versions took for their own, and one of ours that holds notes."""
    mark = f"{scratch.host()}-{2**22 + 5}-0123abcd"
    for name in ("run.zarr.new", "run.zarr.old", f"run.zarr.{mark}.new"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "notes.txt").write_text("mine")
    shutil.copytree(complete, tmp_path / f"run.zarr.{mark[:-1]}e.new")
    before = {name for name in os.listdir(tmp_path) if not name.endswith("e.new")}
    lw.solve(fleet(300), **SETTINGS, store=tmp_path / "run.zarr")
    lw.solve(fleet(300), **SETTINGS, store=lw.Store(tmp_path / "run.zarr", existing="overwrite"))
    assert set(os.listdir(tmp_path)) == before | {"run.zarr"}
    assert (tmp_path / "run.zarr.old" / "notes.txt").read_text() == "mine"


ROOM, WRITE = "Make room, then `lgvi-warp resume", "choose a folder that can be written"
# What the system says, of which file, and what a user reads.
FAULTS = [
    (errno.ENOSPC, "zarr.json", ROOM), (errno.ENOSPC, "created.json", ROOM), (errno.ENOSPC, "c.0.0.0", ROOM),
    (errno.ENOSPC, "c.0.2.0", ROOM), (errno.ENOSPC, "000000256.json", ROOM), (errno.EDQUOT, "c.0.1.0", ROOM),
    (errno.EFBIG, "c.0.1.0", ROOM), (errno.EACCES, "zarr.json", WRITE), (errno.EACCES, "000000000.json", WRITE),
    (errno.EROFS, "created.json", WRITE), (errno.EPERM, "c.0.3.0", WRITE), (errno.EIO, "c.0.3.0", "Input/output error"),
]  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize(("number", "file", "output"), FAULTS)
def test_a_disk_that_takes_no_more(complete, tmp_path, number, file, output):
    """A line says so, what was finished is kept, and the run goes on when there is room."""
    path = tmp_path / "run.zarr"
    with Disk(refused(number, ("created", f"/{file}"))), pytest.raises(OSError, match=output) as told:
        lw.solve(fleet(), **SETTINGS, store=path)
    assert "\n" not in str(told.value)
    assert file in str(told.value)
    assert not list(tmp_path.rglob("*.part"))
    assert {one.name for one in tmp_path.iterdir()} <= {"run.zarr"}
    lw.solve(fleet(), **SETTINGS, store=lw.Store(path, existing="resume"))
    assert differing(complete, path) == []


@pytest.mark.parametrize(("number", "output"), [(errno.EACCES, WRITE), (errno.EROFS, WRITE), (errno.ENOSPC, ROOM)])
def test_a_folder_that_takes_no_lock(tmp_path, number, output):
    name = write_lock.lock_file(tmp_path / "run.zarr").name
    with Disk(refused(number, ("created", name))), pytest.raises(OSError, match=output):
        lw.solve(fleet(10), **SETTINGS, store=tmp_path / "run.zarr")
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_does_not_undo_a_saved_result(results, tmp_path):
    target = shutil.copy(results[0], tmp_path / "result.npz")
    with Disk(full(("synced", "result.npz"))), pytest.raises(OSError, match="No space left"):
        lw.Result.load(results[1]).save(target)
    assert lw.Result.load(target).members == 20
    assert [one.name for one in tmp_path.iterdir()] == ["result.npz"]


def test_a_full_disk_does_not_undo_what_is_overwritten(complete, tmp_path):
    path = shutil.copytree(complete, tmp_path / "run.zarr")
    with Disk(full(("created", "created.json"))):
        with pytest.raises(OSError, match="No space left"):
            lw.solve(fleet(300), **SETTINGS, store=lw.Store(path, existing="overwrite"))
        with pytest.raises(OSError, match="No space left"):
            lw.merge([path], tmp_path, overwrite=True)
    assert differing(complete, path) == []
    assert [one.name for one in tmp_path.iterdir()] == ["run.zarr"]


def test_the_page_names_tests_that_there_are():
    """Each test and each store or result that docs/guide/what_files_can_do.md names for its sentences."""
    page = (ROOT / "docs" / "guide" / "what_files_can_do.md").read_text()
    text = page.partition("## Studies and sweeps")[2]
    files = ("test_hostile_folders.py", "test_faults_of_stores.py")
    source = "".join((ROOT / "tests" / "runs" / file).read_text() for file in files)
    tests = re.findall(r"`(test_\w+)`", text)
    named = re.findall(r'"([^"]+)"', " ".join(re.findall(r"\(`stores`:([^)]*)\)", text.replace("\n", " "))))
    assert len(tests) > 14
    assert [name for name in tests if f"def {name}(" not in source] == []
    rows = [*hostile.STORES, *hostile.RESULTS]
    assert len(named) > 25
    assert all(any(row.startswith(name.removesuffix(" ...")) for row in rows) for name in named)
