# SPDX-License-Identifier: Apache-2.0
"""Stores and results of somebody else's: whatever they hold, nothing is executed, nothing is written outside, and a line
says what is wrong, in little time and memory. The table is tests/support/hostile.py."""

import contextlib
import json
import os
import resource
import shutil
import signal
import sys
import time

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.common import safe_files
from lgvi_warp.store import folder as store
from lgvi_warp.store.state import state
from tests.support import hostile
from tests.support.stores import SETTINGS, STATISTICS, differing, fleet

# A second or two each; other work on the machine may take its part.
SECONDS, MEGABYTES = 10.0, 300
VERBS = ("info", "merge", "export", "resume", "open")


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A complete store with statistics and kept members, and a result; no test changes them."""
    folder = tmp_path_factory.mktemp("good")
    lw.solve(fleet(300), **SETTINGS, store=folder / "run.zarr", statistics=STATISTICS, keep=[3, 299])
    lw.solve(fleet(300), **SETTINGS, statistics=STATISTICS).save(folder / "result.npz")
    return folder


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A user's folder, and on Python's path a module that leaves a trace when it is imported."""
    for name, text in (("notes.txt", "mine"), ("secret", "S" * 260), (".ssh/config", "Host"), ("work/c.0", "mine")):
        path = tmp_path / "home" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    trace = f"open({str(tmp_path / 'home' / 'imported')!r}, 'w').close()\ndef run(*_): raise SystemExit('called')\n"
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "evil_module.py").write_text(trace)
    monkeypatch.syspath_prepend(tmp_path / "modules")
    monkeypatch.chdir(tmp_path / "home")
    yield tmp_path / "home"
    sys.modules.pop("evil_module", None)


@pytest.fixture(autouse=True)
def soon():
    """No test hangs."""

    def late(*_):
        raise AssertionError("it hangs")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(60)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def snapshot(folder):
    """Names and bytes of all in a folder; links are not followed."""
    found = {}
    for name, entry in safe_files.entries(folder):
        plain = entry.is_file(follow_symlinks=False) and not name.startswith("run.zarr/")
        found[name] = (folder / name).read_bytes() if plain else entry.stat(follow_symlinks=False).st_mode
    return found


def call(verb, path, out):
    """The exit code of a verb with a store; of Python's resume and open_run, which draw no pictures, 2 where they refuse."""
    if verb in ("resume", "open"):
        try:
            (lw.resume if verb == "resume" else lw.open_run)(path)
        except lw.SceneError as error:
            assert len(error.faults) <= 20
            return 2
        return 0
    arguments = {"merge": ["--out", str(out / "merged")], "export": ["--to", "netcdf", "--out", str(out / "run.nc")]}
    return cli.main([verb, str(path), *arguments.get(verb, [])])


def peak():
    """Largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@pytest.mark.slow_but(
    "created names a*",
    "marker names a*",
    "a chunk is a*",
    "an array is a link*",
    "kept is a link*",
    "the root is a*",
    "the root has 50*",
    "codec p*",
    "parts*",
    "a shape*",
    "other members*",
    "a term of a module*",
    "a table*",
    "an array a*",
    "a distribution of*",
    "statistics of*",
    "the store is a link*",
    "a marker is a*",
)
@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
@pytest.mark.parametrize("name", hostile.STORES)
def test_a_hostile_store_is_refused_in_a_line(name, good, home, tmp_path, capsys):
    harm, said = hostile.STORES[name]
    path, out = tmp_path / "theirs" / "run.zarr", tmp_path / "out"
    shutil.copytree(good / "run.zarr", path)
    out.mkdir()
    harm(path, home)
    before, memory = snapshot(home), peak()
    whole, codes = good / "run.zarr", []
    for verb in VERBS:
        begun = time.perf_counter()
        code = call(verb, path.parent, out)
        codes.append(code)
        text = capsys.readouterr()
        assert time.perf_counter() - begun < SECONDS
        assert peak() - memory < MEGABYTES
        assert "Traceback" not in text.err
        assert "\x1b" not in text.out + text.err
        assert text.err.count("\n") <= (1 if code == 2 else 3), text.err
        if verb == "info" and said is not None:
            assert code != 0
            assert said in text.out + text.err
        # What is not refused ends as the bytes of the run.
        if verb == "resume" and code == 0 and said is not None:
            assert differing(whole, path) == []
        if verb == "merge" and code == 0 and said is not None:
            assert differing(whole, out / "merged" / "run.zarr") == []
        assert snapshot(home) == before, verb
    assert any(codes)
    assert b"S" * 200 not in b"".join(one.read_bytes() for one in out.rglob("*") if one.is_file())
    assert "evil_module" not in sys.modules


@pytest.mark.parametrize("name", hostile.RESULTS)
def test_a_hostile_result_is_refused_in_a_line(name, good, home, tmp_path):
    harm, said = hostile.RESULTS[name]
    path = tmp_path / "theirs.npz"
    shutil.copy(good / "result.npz", path)
    harm(path, home)
    before, memory, begun = snapshot(home), peak(), time.perf_counter()
    if said is None:
        lw.Result.load(path)
    else:
        with pytest.raises(lw.SceneError) as refused:
            lw.Result.load(path)
        assert said in str(refused.value)
        assert str(path) in str(refused.value)
        assert "\n" not in str(refused.value)
    assert time.perf_counter() - begun < SECONDS
    assert peak() - memory < MEGABYTES
    assert snapshot(home) == before
    assert "evil_module" not in sys.modules


def leaves(value, path=()):
    """Where the values of nested tables and lists are."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from leaves(inner, (*path, key))


STRANGE = (
    None,
    True,
    -1,
    10**18,
    float("nan"),
    "",
    "../../x",
    "evil_module.run",
    [],
    {},
    [[]],
    "\x1b[31m",
    [3, 299, 4000],
)


@pytest.mark.slow_but("0")
@pytest.mark.parametrize("seed", range(4))
def test_any_value_of_its_metadata_may_be_another(seed, good, home, tmp_path):
    """All that goes wrong is a SceneError: 30 places a test, of all that there are."""
    dice, whole = np.random.default_rng(seed), hostile.said(good / "run.zarr")
    places = [path for path in leaves(whole) if path]
    path = tmp_path / "run.zarr"
    shutil.copytree(good / "run.zarr", path)
    before = snapshot(home)
    for _ in range(30):
        content, keys = json.loads(json.dumps(whole)), places[dice.integers(len(places))]
        table = content
        for key in keys[:-1]:
            table = table[key]
        table[keys[-1]] = STRANGE[dice.integers(len(STRANGE))]
        if not isinstance(content["attributes"], dict):
            continue
        hostile.say(path, content)
        for look in (lw.open_run, state, lambda path: store.Folder(path).plan()):
            with contextlib.suppress(lw.SceneError, OSError):
                look(path)
    assert snapshot(home) == before
    assert "evil_module" not in sys.modules


def test_a_link_that_is_put_there_meanwhile_is_not_followed(good, home, tmp_path, monkeypatch):
    """The folder of an array is a link by the time that its chunks are read, or written."""
    path = tmp_path / "run.zarr"
    shutil.copytree(good / "run.zarr", path)
    folder = store.Folder(path)
    (path / "status").rename(tmp_path / "status")
    (path / "status").symlink_to(home / "work")
    with pytest.raises(lw.SceneError, match="status: is a link"):
        folder.group()["status"][:]
    files = store.durable.Files(path)
    with pytest.raises(lw.SceneError, match="status: is a link"):
        files.write("status/c.0", b"theirs")
    assert (home / "work" / "c.0").read_text() == "mine"
    assert os.listdir(home / "work") == ["c.0"]


def test_a_link_that_is_put_there_before_a_file_is_named_is_not_followed(good, home, tmp_path):
    path = tmp_path / "run.zarr"
    shutil.copytree(good / "run.zarr", path)
    files = store.durable.Files(path)
    files.write("status/c.0", b"theirs")
    (path / "status").rename(tmp_path / "status")
    (path / "status").symlink_to(home / "work")
    with pytest.raises((lw.SceneError, OSError)):
        files.finish()
    assert (home / "work" / "c.0").read_text() == "mine"
    assert os.listdir(home / "work") == ["c.0"]


def test_the_user_may_name_a_link_himself(good, tmp_path):
    """As on clusters, where a run lies on another disk."""
    shutil.copytree(good / "run.zarr", tmp_path / "disk" / "run.zarr")
    link = tmp_path / "mine.zarr"
    link.symlink_to(tmp_path / "disk" / "run.zarr")
    (link / "blocks" / "000000000.json").unlink()
    assert lw.resume(link).members == 300
    assert link.is_symlink()
    assert differing(good / "run.zarr", tmp_path / "disk" / "run.zarr") == []


def test_names_that_no_folder_may_have_are_refused_before_the_run(tmp_path):
    for name in ("../x", "/abs", "a\\b", "C:x", "a\0b", ".hidden", "end.", "x" * 300, "", "a*b", "\x1b[0m"):
        assert not store.store_check.is_name(name)
    for name in ("position", "vehicle.mass", "Strömung 1.velocity", "drag.quadratic"):
        assert store.store_check.is_name(name)
