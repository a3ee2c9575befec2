# SPDX-License-Identifier: Apache-2.0
"""Stores, results, studies and sweeps of somebody else's, through every verb and reader: nothing is executed, nothing hangs,
nothing of the user's is read or replaced, and a line says what is wrong. The table is tests/support/hostile.py."""

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
from lgvi_warp.accuracy.stability.map import StabilityMap
from lgvi_warp.accuracy.tradeoff import Tradeoff
from lgvi_warp.common import files, machine, safe_files
from lgvi_warp.robustness.sweeps import record as records
from lgvi_warp.store import folder as store
from lgvi_warp.store.solve import request_of
from lgvi_warp.store.state import state
from lgvi_warp.uncertainty.sensitivity.indices import Indices
from tests.conftest import ROOT
from tests.support import hostile
from tests.support.made import straight
from tests.support.stores import SETTINGS, STATISTICS, differing, fleet
from tests.unit.cli.test_terminal import region, sobol
from tests.unit.measuring.test_cost import found as tradeoff_of

# A second or two each, and memory [MB]; other work on the machine may take its part.
SECONDS, SECONDS_TO_DRAW, MEGABYTES = 10.0, 20.0, 300
DRAWING = ("plot", "report", "view")
# What fails where one may fail: of the verbs, and Python's functions.
READING = ("info", "export", "merge", "lw.resume", "read")
VERBS = ("info", "info --json", *DRAWING, "export", "merge", "resume", "lw.resume", "read", "sweep", "run")
LEFT_OUT = {"store": ("resume", "sweep", "run")}  # Python's resume draws no pictures
READERS = {
    "store": ("", lw.open_run),
    "result": ("result.npz", lw.Result.load),
    "tradeoff": ("tradeoff.json", Tradeoff.load),
    "sensitivity": ("sensitivity.json", Indices.load),
    "stability": ("stability.json", StabilityMap.load),
}
SCENE = ROOT / "examples" / "paper.toml"
SWEEP = f"""
scene = "{SCENE}"
members = 5
metrics = ["max(norm(velocity))"]
run = {{ duration = 0.5 }}
[[cases]]
name = "light"
set = {{ "vehicle.mass" = 120.0 }}
"""


def flown():
    """A result, as a run gives it."""
    result = straight([[0.0, 1.0, 5.0], [2.0, 0.0, 9.0]])
    result.provenance["machine"] = machine.describe()
    return result


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A good folder of each kind, with statistics and kept members; no test changes them."""
    folder = tmp_path_factory.mktemp("good")
    for found, name in ((tradeoff_of(4.0), "tradeoff"), (sobol(), "sensitivity"), (region(), "stability")):
        found.save(folder / name)
        (folder / name / "x.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (folder / "sweep" / records.FOLDER).mkdir(parents=True)
    (folder / "sweep" / "sweep.json").write_text('{"cells": []}')
    (folder / "sweep" / "summary.md").write_text("# Sweep\n")
    (folder / "result").mkdir()
    lw.solve(fleet(300), **SETTINGS, statistics=STATISTICS).save(folder / "result" / "result.npz")
    lw.solve(fleet(300), **SETTINGS, statistics=STATISTICS, keep=[3, 299], store=folder / "store" / "run.zarr")
    return folder


@pytest.fixture
def theirs(good, tmp_path):
    """Copies a good folder."""
    return lambda base: shutil.copytree(good / base, tmp_path / base)


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A user's folder, and on Python's path a module that leaves a trace when it is imported."""
    for name, text in (("notes.txt", "mine"), ("secret", "S" * 260), (".ssh/config", "Host"), ("work/c.0", "mine")):
        path = tmp_path / "home" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    os.mkfifo(tmp_path / "home" / "pipe")
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
    signal.alarm(120)
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


@contextlib.contextmanager
def harmless(home):
    """Work inside takes nothing of the user's, changes nothing of it, and runs nothing."""
    before = snapshot(home)
    yield
    assert snapshot(home) == before
    assert "evil_module" not in sys.modules


def peak():
    """Largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@contextlib.contextmanager
def bounded(seconds):
    """Work inside ends soon, in little memory."""
    memory, begun = peak(), time.perf_counter()
    yield
    assert time.perf_counter() - begun < seconds
    assert peak() - memory < MEGABYTES


def code_of(call, path):
    """Exit code like a verb's: 2 where a function refuses."""
    try:
        call(path)
    except lw.SceneError as error:
        assert len(error.faults) <= 20
        return 2
    except OSError:  # as the system tells of a link that leads nowhere, or to itself
        assert path.is_symlink()
        return 2
    return 0


def call(verb, path, out):
    """The exit code of a verb, or of a function of Python's, with a folder."""
    if verb == "lw.resume":
        return code_of(lw.resume, path)
    if verb == "read":
        name, reader = READERS.get(path.name, ("", None))
        return code_of(reader, path / name) if reader else 2
    if verb == "sweep":
        (out / "sweep.toml").write_text(SWEEP)
    arguments = {
        "view": [path, "--out", out / "fleet.rrd"],
        "export": [path, "--to", "netcdf", "--out", out / "run.nc"],
        "merge": [path, "--out", out / "merged"],
        "sweep": [out / "sweep.toml", "--plan"],
        "run": [SCENE, "--out", path, "--members", 4, "--duration", 0.5],
    }
    return cli.main([*verb.split(), *map(str, arguments.get(verb.split()[0], [path]))])


def read(path):
    """All bytes of the plain files of a folder that are not huge, nor below folders without an end."""
    found = []
    with contextlib.suppress(lw.SceneError):
        for name, entry in safe_files.entries(path):
            if entry.is_file(follow_symlinks=False) and entry.stat().st_size < 10**8:
                found.append((path / name).read_bytes())
    return b"".join(found)


def special(folder):
    """Entries of a folder that are no plain files.

    Name -> its number on the disk, and where it leads or of which kind it is.
    """
    found = {}
    for name in os.listdir(folder):
        path = folder / name
        if path.is_symlink() or not path.is_file():
            found[name] = (path.lstat().st_ino, os.readlink(path) if path.is_symlink() else path.lstat().st_mode)
    return found


# A few of each kind in the quick tests: the doors are the same for all.
@pytest.mark.ci
@pytest.mark.slow_but(
    "store: created names an*", "store: marker names an abs*", "store: a chunk is a*", "store: an array is a link*",
    "store: kept is a link*", "store: the root is a*", "store: the root has 50*", "store: codec p*",
    "store: parts with a p*", "store: parts of 10^15 n*", "store: a shape*", "store: other members*",
    "store: a term of a module*", "store: a table*", "store: an array a*", "store: a distribution of*",
    "store: statistics of*", "store: the store is a link*", "store: a marker is a*", "store: messages that write*",
    "tradeoff: a link to a*", "tradeoff: the table is*", "tradeoff: a picture is*", "sweep: *", "result: a link*",
    "result: a part*", "result: a pipe", "result: a folder", "result: a s*", "result: a term*",
    "result: provenance that*", "sensitivity: 10*", "stability: a pipe", "stability: nested*",
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
@pytest.mark.parametrize("name", hostile.ROWS)
def test_a_hostile_folder_is_refused_in_a_line_by_every_verb(name, good, theirs, home, tmp_path, capsys):
    base, harm, says = hostile.ROWS[name]
    path, out, codes = theirs(base), tmp_path / "out", {}
    out.mkdir()
    harm(path, home)
    odd = special(path)
    for verb in (one for one in VERBS if one not in LEFT_OUT.get(base, ())):
        computes = verb in ("run", "sweep")
        with harmless(home), contextlib.nullcontext() if computes else bounded(
            SECONDS_TO_DRAW if verb in DRAWING else SECONDS
        ):  # fmt: skip
            codes[verb] = code = call(verb, path, out)
        text = capsys.readouterr()
        assert code in (0, 1, 2), verb
        assert "Traceback" not in text.err, verb
        assert not set("\x1b\x07\x9b") & set(text.out + text.err), verb
        assert text.err.count("\n") <= (1 if code == 2 else 3), (verb, text.err)
        if verb == "info" and says is not None:
            assert code != 0
            assert says in text.out + text.err
        if base != "store" and verb in ("export", "merge", "resume"):
            assert code == 2
            assert text.err.count("\n") == 1
        assert special(path).items() >= odd.items(), verb
    assert b"S" * 200 not in read(out) + read(path)
    assert b"UzNTU1NT" not in read(out) + read(path)
    if base == "store":
        assert any(codes[verb] for verb in READING)
    # What is not refused ends as the bytes of the run.
    if base == "store" and says is not None:
        for verb, copy in (("lw.resume", path), ("merge", out / "merged")):
            assert codes[verb] != 0 or differing(good / "store" / "run.zarr", copy / "run.zarr") == []


@pytest.mark.parametrize("name", hostile.RESULTS)
def test_a_hostile_result_is_refused_in_a_line(name, theirs, home):
    """The path is the user's, who may name a link: it is followed."""
    harm, says = hostile.RESULTS[name]
    path = theirs("result") / "result.npz"
    harm(path, home)
    says = {"a link to a secret": hostile.TORN, "a link to zeros": "device"}.get(name, says)
    with harmless(home), bounded(SECONDS):
        if says is None:
            lw.Result.load(path)
        else:
            with pytest.raises(lw.SceneError) as refused:
                lw.Result.load(path)
            assert says in str(refused.value)
            assert str(path) in str(refused.value)
            assert "\n" not in str(refused.value)


# Any value of the metadata may be another -------------------------------------------------------------------------------

STRANGE = (
    None, True, -1, 10**18, float("nan"), "", "../../x", "evil_module.run", [], {}, [[]], "\x1b[31m", [3, 299, 4000],
)  # fmt: skip


def leaves(value, path=()):
    """Paths of the values of nested tables and lists."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield from leaves(inner, (*path, key))


def mutated(complete, seed, count):
    """Copies of nested tables, in each of which one value is another, at so many of all places."""
    dice, places = np.random.default_rng(seed), [path for path in leaves(complete) if path]
    for _ in range(count):
        table = content = json.loads(json.dumps(complete))
        *keys, last = places[dice.integers(len(places))]
        for key in keys:
            table = table[key]
        table[last] = STRANGE[dice.integers(len(STRANGE))]
        yield content


@pytest.mark.slow_but("0")
@pytest.mark.parametrize("seed", range(4))
def test_any_value_of_its_metadata_may_be_another(seed, theirs, home):
    """All that goes wrong is a SceneError."""
    path = theirs("store") / "run.zarr"
    with harmless(home):
        for content in mutated(hostile.said(path), seed, 30):
            if not isinstance(content["attributes"], dict):
                continue
            hostile.say(path, content)
            for look in (lw.open_run, state, lambda path: request_of(store.Folder(path)).plan()):
                with contextlib.suppress(lw.SceneError, OSError):
                    look(path)


@pytest.mark.parametrize("kind", [Tradeoff, StabilityMap, Indices])
@pytest.mark.parametrize("seed", range(3))
def test_any_value_of_a_study_may_be_another(kind, seed, good, tmp_path):
    """Accepted content can be summarised and written."""
    name = {Tradeoff: "tradeoff", StabilityMap: "stability", Indices: "sensitivity"}[kind]
    whole, taken = json.loads((good / name / f"{name}.json").read_text()), 0
    for content in mutated(whole, seed, 60):
        (tmp_path / "study.json").write_text(json.dumps(content))
        with contextlib.suppress(lw.SceneError):
            found = kind.load(tmp_path / "study.json")
            taken += 1
            found.save(tmp_path / "again"), list(found.rows()), str(found)
    assert taken < 60


# Links ------------------------------------------------------------------------------------------------------------------


def replace_by_link(path, name, to):
    path.joinpath(name).rename(path.parent / name)
    path.joinpath(name).symlink_to(to)


def test_a_link_that_is_put_there_meanwhile_is_not_followed(theirs, home):
    """The folder of an array is a link by the time that its chunks are read, or written, or a chunk gets its name."""
    path = theirs("store") / "run.zarr"
    folder, begun = store.Folder(path), store.durable.Files(path)
    begun.write("status/c.0", b"theirs")
    replace_by_link(path, "status", home / "work")
    with pytest.raises(lw.SceneError, match="status is a link"):
        folder.group()["status"][:]
    with pytest.raises(lw.SceneError, match="status is a link"):
        store.durable.Files(path).write("status/c.0", b"theirs")
    with pytest.raises((lw.SceneError, OSError)):
        begun.finish()
    assert (home / "work" / "c.0").read_text() == "mine"
    assert os.listdir(home / "work") == ["c.0"]


@pytest.mark.ci
def test_the_user_may_name_a_link_himself(good, theirs, tmp_path):
    """A run may lie on another disk, as on clusters."""
    disk, link = theirs("store") / "run.zarr", tmp_path / "mine.zarr"
    link.symlink_to(disk)
    (link / "blocks" / "000000000.json").unlink()
    assert lw.resume(link).members == 300
    assert link.is_symlink()
    assert differing(good / "store" / "run.zarr", disk) == []


def test_a_link_within_the_folder_is_followed(theirs, home):
    """A file that lies in the folder under another name."""
    path = theirs("tradeoff")
    hostile.moved_beside(path / "tradeoff.json", home)
    assert [cli.main([verb, str(path)]) for verb in ("info", "plot", "report")] == [0, 0, 0]
    assert (path / "tradeoff.json").is_symlink()
    assert (path / "tradeoff.png").is_file()


@pytest.mark.parametrize("name", ["x.png", "tradeoff.csv"])
def test_what_a_report_may_not_read_is_not_in_it(name, theirs, home, capsys):
    path, page = theirs("tradeoff"), home.parent / "page.html"
    hostile.link("secret")(path / name, home)
    assert cli.main(["report", str(path), "--out", str(page)]) == 2
    assert hostile.OUT in capsys.readouterr().err
    assert not page.exists()


def test_names_that_no_folder_may_have_are_refused_before_the_run():
    for name in ("../x", "/abs", "a\\b", "C:x", "a\0b", ".hidden", "end.", "x" * 300, "", "a*b", "\x1b[0m"):
        assert not store.store_check.is_name(name)
    for name in ("position", "vehicle.mass", "Strömung 1.velocity", "drag.quadratic"):
        assert store.store_check.is_name(name)


# What is written into a folder ------------------------------------------------------------------------------------------


def left_alone(write, path, kind, home, capsys):
    """An object in the place of a written file is reported in a line, and stays. Returns: the line."""
    hostile.PLACES[kind](path, home)
    odd = special(path.parent)
    with harmless(home):
        assert write() in (1, 2)
    text = capsys.readouterr().err
    assert path.name in text
    assert text.count("\n") == 1
    assert special(path.parent).items() >= odd.items()
    return text


def remove(path):
    shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink(missing_ok=True)


STUDIES = {
    "tradeoff": ["--members", 4, "--duration", 0.1, "--methods", "psi_s"],
    "sensitivity": ["--of", "position", "--samples", 8, "--duration", 0.1],
    "stability": ["--points", 2, "--duration", 0.1, "--methods", "psi_s"],
}
# What writes a file under a name of its own into a folder: the command before its name, a good folder or "", and the file.
WRITES = {
    "plot of a study": (["plot"], "tradeoff", "tradeoff.png"),
    "plot of a result": (["plot"], "result", "fleet.png"),
    "report on a study": (["report"], "tradeoff", "report.html"),
    "report on a result": (["report"], "result", "report.html"),
    "run": (["run", SCENE, "--members", 4, "--duration", 0.5, "--out"], "result", "result.npz"),
} | {
    f"{verb}.{ending}": ([verb, SCENE, *settings, "--quiet", "--out"], "", f"{verb}.{ending}")
    for verb, settings in STUDIES.items()
    for ending in ("json", "csv", "png")
}


@pytest.mark.slow_for("tradeoff.*", "sensitivity.*", "stability.*")
@pytest.mark.parametrize("kind", hostile.PLACES)
@pytest.mark.parametrize("name", WRITES)
def test_verbs_replace_nothing_but_plain_files_of_the_folder(name, kind, theirs, home, capsys):
    command, base, file = WRITES[name]
    path = theirs(base) if base else home.parent / "study"
    path.mkdir(exist_ok=True)
    (path / "x.png").unlink(missing_ok=True)
    (path / file).unlink(missing_ok=True)
    text = left_alone(lambda: cli.main([*map(str, command), str(path)]), path / file, kind, home, capsys)
    assert "not replaced" in text or hostile.OUT in text
    assert list(special(path)) == [file]


@pytest.mark.parametrize("verb", ["view", "merge"])
@pytest.mark.parametrize("kind", ["a link to a device", "a pipe", "a socket"])
def test_the_place_is_told_and_not_the_run(verb, kind, good, home, capsys):
    run, name = (good / "result", "a.rrd") if verb == "view" else (good / "store" / "run.zarr", "a")
    out = home.parent / name
    text = left_alone(lambda: cli.main([verb, str(run), "--out", str(out)]), out, kind, home, capsys)
    assert text.startswith(f"lgvi-warp: {out} is a ")


WRITERS = {
    "a result": lambda path: flown().save(path),
    "a table": lambda path: tradeoff_of(4.0).to_csv(path),
    "a picture": lambda path: lw.plots.summary(flown(), path=path.with_suffix(".png")),
    "a report": lambda path: lw.report(flown(), path),
    "a recording": lambda path: lw.record(flown(), path),
    "a text": lambda path: files.write_text(path, "x"),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_writer_follows_the_links_of_the_user_and_replaces_plain_files_alone(name, tmp_path):
    """One rule: the link stays, and the file that it leads to is written; a device, a pipe and a folder are left alone."""
    ending = ".png" if name == "a picture" else ".file"
    real, path = tmp_path / "real" / f"a{ending}", tmp_path / f"link{ending}"
    real.parent.mkdir()
    real.write_text("old")
    path.symlink_to(real)
    WRITERS[name](path)
    assert path.is_symlink()
    assert real.read_bytes() != b"old"
    assert os.listdir(real.parent) == [real.name]
    real.unlink()
    WRITERS[name](path)  # a link that leads nowhere yet
    assert path.is_symlink()
    assert real.is_file()
    assert not real.is_symlink()
    path.unlink()
    for harm, words in (
        (hostile.pipe, "is a named pipe"),
        (hostile.folder, "is a folder"),
        (hostile.bound, "is a socket"),
        (hostile.link(os.devnull), "is a device"),
        (hostile.to_itself, "is a link"),
    ):
        harm(path, tmp_path)
        before = path.lstat()
        with pytest.raises(lw.SceneError, match=words) as refused:
            WRITERS[name](path)
        assert str(path) in str(refused.value)
        assert path.lstat().st_ino == before.st_ino
        remove(path)
    assert os.listdir(tmp_path) == ["real"]


def test_a_device_is_not_replaced(tmp_path):
    """With root's rights the null device of a container would become a plain file."""
    node = tmp_path / "null"
    try:
        os.mknod(node, 0o600 | 0o020000, os.makedev(1, 3))
    except OSError as error:
        pytest.skip(f"no device can be made here: {error}")
    for write in WRITERS.values():
        with contextlib.suppress(lw.SceneError):
            write(node)
            assert node.with_suffix(".png").is_file()  # the picture has an ending of its own
            node.with_suffix(".png").unlink()
    assert node.is_char_device()
    assert os.listdir(tmp_path) == ["null"]


@pytest.mark.parametrize("answer", [tradeoff_of(4.0), sobol(), region()], ids=["tradeoff", "sensitivity", "stability"])
def test_a_study_is_saved_into_its_folder_alone(answer, home):
    """The two or three files of a study have names of their own: none of them is a way out of its folder."""
    folder = home.parent / "study"
    for path in list(answer.save(folder)):
        path.unlink()
        path.symlink_to(home / "notes.txt")
        with harmless(home), pytest.raises(lw.SceneError, match=hostile.OUT):
            answer.save(folder)
        path.unlink()


def test_a_run_is_not_stored_behind_a_link(home, capsys):
    out = home.parent / "out"
    out.mkdir()
    (out / "run.zarr").symlink_to(home / "work")
    for more in ([], ["--overwrite"], ["--resume"]):
        with harmless(home):
            assert cli.main(["run", str(SCENE), "--store", "zarr", "--members", "4", "--out", str(out), *more]) == 2
        assert hostile.OUT in capsys.readouterr().err


# Cells of sweeps --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A finished sweep; no test changes it."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "sweep.toml").write_text(SWEEP)
    assert sweep(folder, folder / "out") == 0
    return folder


def sweep(folder, out):
    return cli.main(["sweep", str(folder / "sweep.toml"), "--out", str(out)])


def the_cell(folder):
    (path,) = (folder / records.FOLDER).iterdir()
    return path


@pytest.mark.ci
@pytest.mark.slow_but("torn at 0.5", "a status nobody*", "numbers of NaN", "other messages", "73 TiB", "words nested*")
@pytest.mark.parametrize("name", hostile.CELLS)
def test_a_damaged_cell_runs_anew(name, swept, home, capsys):
    out = shutil.copytree(swept / "out", home.parent / "out")
    hostile.CELLS[name](the_cell(out), home)
    with harmless(home):
        assert sweep(swept, out) == 0
    assert "Traceback" not in capsys.readouterr().err
    for file in ("sweep.json", "table.csv", "worst.csv", "summary.md", the_cell(out).relative_to(out)):
        assert (out / file).read_bytes() == (swept / "out" / file).read_bytes(), file


def test_a_cell_of_another_is_not_taken(swept, home):
    """A file has the checksum of its own name: a cell with the numbers of another one runs anew."""
    path = the_cell(swept / "out")
    other = home.parent / path.name.replace(path.name[0], "0" if path.name[0] != "0" else "1", 1)
    shutil.copy(path, other)
    asked = (["max(norm(velocity))", "time_to_failure"], 5)
    assert records.Record.load(path, *asked) is not None
    assert records.Record.load(other, *asked) is None


@pytest.mark.parametrize("kind", hostile.PLACES)
@pytest.mark.parametrize("place", ["a cell", "the folder of cells", "the summary"])
def test_a_sweep_replaces_nothing_but_plain_files_of_its_folder(place, kind, swept, home, capsys):
    out = shutil.copytree(swept / "out", home.parent / "out")
    places = {"a cell": the_cell(out), "the folder of cells": out / records.FOLDER, "the summary": out / "summary.md"}
    remove(places[place])
    if (place, kind) != ("the folder of cells", "a folder"):
        left_alone(lambda: sweep(swept, out), places[place], kind, home, capsys)
