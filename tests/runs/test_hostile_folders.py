# SPDX-License-Identifier: Apache-2.0
"""Folders of somebody else's, of studies, sweeps and results, through every verb that takes one: nothing hangs, nothing of the
user's is read or replaced, and a line says what is wrong. The table is tests/support/hostile.py, that of stores is in
test_hostile_stores.py."""

import contextlib
import json
import os
import shutil
import time

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.common import files, machine
from lgvi_warp.studies.sensitivity import Indices
from lgvi_warp.studies.stability.map import StabilityMap
from lgvi_warp.studies.sweeps import record as records
from lgvi_warp.studies.tradeoff import Tradeoff
from tests.conftest import ROOT
from tests.runs.test_hostile_stores import MEGABYTES, STRANGE, good, home, leaves, peak, snapshot, soon  # noqa: F401
from tests.support import hostile
from tests.support.made import straight
from tests.unit.cli.test_terminal import region, sobol
from tests.unit.studies.test_cost import found as tradeoff_of

# A picture takes a second or two; other work on the machine may take its part.
SECONDS = 20.0
VERBS = ("info", "info --json", "plot", "report", "view", "export", "merge", "resume", "sweep", "run")
# What verbs write into a folder, or under a name that is given.
DRAWN = {
    "tradeoff": "tradeoff.png",
    "sensitivity": "sensitivity.png",
    "stability": "stability.png",
    "result": "fleet.png",
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
def bases(tmp_path_factory):
    """A good folder of each kind; no test changes them."""
    folder = tmp_path_factory.mktemp("bases")
    for found, name in ((tradeoff_of(4.0), "tradeoff"), (sobol(), "sensitivity"), (region(), "stability")):
        found.save(folder / name)
        (folder / name / "x.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (folder / "sweep" / records.FOLDER).mkdir(parents=True)
    (folder / "sweep" / "sweep.json").write_text('{"cells": []}')
    (folder / "sweep" / "summary.md").write_text("# Sweep\n")
    (folder / "result").mkdir()
    flown().save(folder / "result" / "result.npz")
    return folder


@pytest.fixture
def theirs(bases, tmp_path):
    """Copies a base."""
    return lambda base: shutil.copytree(bases / base, tmp_path / "theirs" / base)


def call(verb, path, out):
    """The exit code of a verb with a folder."""
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
    """All bytes of the plain files of a folder."""
    plain = (one for one in path.rglob("*") if one.is_file() and not one.is_symlink() and one.stat().st_size < 10**8)
    return b"".join(one.read_bytes() for one in plain)


def special(folder):
    """Names and kinds of what is no plain file in a folder, and where links lead."""
    found = {}
    for name in os.listdir(folder):
        path = folder / name
        if path.is_symlink() or not path.is_file():
            found[name] = os.readlink(path) if path.is_symlink() else path.lstat().st_mode
    return found


# A few of each kind in the quick tests: the doors are the same for all.
@pytest.mark.slow_but("tradeoff: a link to a*", "tradeoff: the table is*", "tradeoff: a picture is*", "sweep: *", "result: *",
                      "sensitivity: 10*", "stability: a pipe", "stability: nested*")  # fmt: skip
@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
@pytest.mark.parametrize("name", hostile.FOLDERS)
def test_a_hostile_folder_is_refused_in_a_line_by_every_verb(name, theirs, home, tmp_path, capsys):  # noqa: F811
    base, harm, said = hostile.FOLDERS[name]
    path, out = theirs(base), tmp_path / "out"
    out.mkdir()
    harm(path, home)
    before, odd, memory = snapshot(home), special(path), peak()
    for verb in VERBS:
        begun = time.perf_counter()
        code = call(verb, path, out)
        text = capsys.readouterr()
        assert verb in ("run", "sweep") or (time.perf_counter() - begun < SECONDS and peak() - memory < MEGABYTES), verb
        assert code in (0, 1, 2), verb
        assert "Traceback" not in text.err, verb
        assert not set("\x1b\x07\x9b") & set(text.out + text.err), verb
        assert text.err.count("\n") <= 4, text.err
        if verb == "info" and said is not None:
            assert code != 0
            assert said in text.out + text.err
        if verb in ("export", "merge", "resume"):
            assert code == 2
            assert text.err.count("\n") == 1
        assert snapshot(home) == before, verb
        assert special(path).items() >= odd.items(), verb
        memory = max(memory, peak() if verb in ("run", "sweep") else 0)
    assert b"S" * 200 not in read(out) + read(path)
    assert b"UzNTU1NT" not in read(out) + read(path)


def test_a_link_within_the_folder_is_followed(theirs, home, capsys):  # noqa: F811
    """A file that lies in the folder under another name."""
    path = theirs("tradeoff")
    hostile.beside_itself("tradeoff.json")(path, home)
    assert cli.main(["info", str(path)]) == cli.main(["plot", str(path)]) == cli.main(["report", str(path)]) == 0
    assert (path / "tradeoff.json").is_symlink()
    assert (path / "tradeoff.png").is_file()


def test_what_a_report_may_not_read_is_not_in_it(theirs, home, capsys):  # noqa: F811
    for i, harm in enumerate((hostile.link("x.png", "secret"), hostile.link("tradeoff.csv", "secret"))):
        path = theirs("tradeoff").rename(home.parent / f"again{i}")
        harm(path, home)
        assert cli.main(["report", str(path), "--out", str(home.parent / "page.html")]) == 2
        assert hostile.OUT in capsys.readouterr().err
        assert not (home.parent / "page.html").exists()


@pytest.mark.parametrize("name", hostile.STORES)
@pytest.mark.slow_but("a chunk is a link", "the root is a pipe", "messages that write*")
@pytest.mark.filterwarnings("ignore:numpy.ndarray size changed")
def test_a_hostile_store_is_drawn_by_no_verb_with_harm(name, good, home, tmp_path, capsys):  # noqa: F811
    """The verbs beside those of test_hostile_stores: what they do not notice they draw, and nothing else."""
    path, out = tmp_path / "theirs" / "run.zarr", tmp_path / "out"
    shutil.copytree(good / "run.zarr", path)
    out.mkdir()
    hostile.STORES[name][0](path, home)
    before = snapshot(home)
    for verb in ("info --json", "plot", "report", "view"):
        begun = time.perf_counter()
        code = call(verb, path.parent, out)
        text = capsys.readouterr()
        assert code in (0, 1, 2), (verb, text.err)
        assert "Traceback" not in text.err, (verb, text.err)
        assert text.err.count("\n") <= 4, (verb, text.err)
        assert time.perf_counter() - begun < SECONDS, verb
        assert not set("\x1b\x07") & set(text.out + text.err), verb
        assert snapshot(home) == before, verb
    page = path.parent / "report.html"
    assert b"S" * 200 not in read(out) + (page.read_bytes() if page.is_file() else b"")


@pytest.mark.parametrize("name", hostile.RESULTS)
@pytest.mark.slow_but("a pipe", "a term*", "provenance that*")
def test_a_hostile_result_is_refused_by_the_verbs(name, good, home, tmp_path, capsys):  # noqa: F811
    path, out = tmp_path / "theirs", tmp_path / "out"
    path.mkdir()
    out.mkdir()
    shutil.copy(good / "result.npz", path)
    hostile.RESULTS[name][0](path / "result.npz", home)
    before = snapshot(home)
    for verb in ("info", "plot", "report", "view"):
        code = call(verb, path, out)
        text = capsys.readouterr()
        assert code in (0, 1, 2), (verb, text.err)
        assert "Traceback" not in text.err, (verb, text.err)
        assert text.err.count("\n") <= 4, (verb, text.err)
        assert not set("\x1b\x07") & set(text.out + text.err), verb
        assert snapshot(home) == before, verb


# What is written into a folder ------------------------------------------------------------------------------------------


def occupied(path, kind, home):  # noqa: F811
    """Put something in the place of a file that will be written."""
    how, what, _ = hostile.PLACES[kind]
    if what == "pipe":
        os.mkfifo(home / "pipe")
    how(path.name, what)(path.parent, home)


@pytest.mark.parametrize("kind", hostile.PLACES)
@pytest.mark.parametrize("base", ["tradeoff", "result"])
def test_verbs_replace_nothing_but_plain_files_of_the_folder(base, kind, theirs, home, capsys):  # noqa: F811
    """plot, report and run write names of their own: what is no plain file there is left alone, and told in a line."""
    path = theirs(base)
    (path / "x.png").unlink(missing_ok=True)
    verbs = {"plot": DRAWN[base], "report": "report.html"} | ({"run": "result.npz"} if base == "result" else {})
    for verb, name in verbs.items():
        (path / name).unlink(missing_ok=True)
        occupied(path / name, kind, home)
        before, odd = snapshot(home), special(path)
        assert call(verb, path, path) in (1, 2)
        text = capsys.readouterr().err
        assert name in text
        assert text.count("\n") == 1
        assert "not replaced" in text or hostile.OUT in text
        assert snapshot(home) == before
        assert special(path) == odd
        if (home / "pipe").exists():
            (home / "pipe").unlink()
        if verb == "run":
            break
        shutil.rmtree(path / name) if odd[name] and (path / name).is_dir() else (path / name).unlink()


STUDIES = {
    "tradeoff": ["--members", 4, "--duration", 0.1, "--methods", "psi_s"],
    "sensitivity": ["--samples", 8, "--duration", 0.1],
    "stability": ["--points", 2, "--duration", 0.1, "--methods", "psi_s"],
}


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("kind", hostile.PLACES)
@pytest.mark.parametrize("verb", STUDIES)
def test_a_study_that_is_run_replaces_nothing_but_plain_files_of_its_folder(verb, kind, home, capsys):  # noqa: F811
    out, asked = home.parent / "study", [verb, SCENE, *STUDIES[verb], "--quiet", "--out"]
    out.mkdir()
    for ending in ("json", "csv", "png"):
        name = f"{verb}.{ending}"
        occupied(out / name, kind, home)
        before, odd = snapshot(home), special(out)
        assert cli.main([*map(str, asked), str(out)]) in (1, 2)
        text = capsys.readouterr().err
        assert name in text
        assert text.count("\n") == 1
        assert "not replaced" in text or hostile.OUT in text
        assert snapshot(home) == before
        assert special(out) == odd
        shutil.rmtree(out)
        out.mkdir()
        (home / "pipe").unlink(missing_ok=True)


@pytest.mark.parametrize("verb", ["view", "merge"])
@pytest.mark.parametrize("kind", ["a link to a device", "a pipe", "a socket"])
def test_the_place_is_told_and_not_the_run(verb, kind, theirs, good, home, capsys):  # noqa: F811
    run, out = (theirs("result"), home.parent / "a.rrd") if verb == "view" else (good / "run.zarr", home.parent / "a")
    occupied(out, kind, home)
    before = out.lstat()
    assert cli.main([verb, str(run), "--out", str(out)]) == 2
    text = capsys.readouterr().err
    assert text.startswith(f"lgvi-warp: {out}: is a ")
    assert text.count("\n") == 1
    assert out.lstat().st_ino == before.st_ino


WRITERS = {
    "a result": lambda path: flown().save(path),
    "a table": lambda path: tradeoff_of(4.0).to_csv(path),
    "a picture": lambda path: lw.plot(flown(), path.with_suffix(".png")),
    "a report": lambda path: lw.report(flown(), path),
    "a recording": lambda path: lw.log_rerun(flown(), path),
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
    for make, words in (
        (os.mkfifo, "is a named pipe"),
        (os.mkdir, "is a folder"),
        (hostile.bound, "is a socket"),
        (lambda one: one.symlink_to(os.devnull), "is a device"),
        (lambda one: one.symlink_to(one), "is a link"),
    ):
        make(path)
        before = path.lstat()
        with pytest.raises(lw.SceneError, match=words) as refused:
            WRITERS[name](path)
        assert str(path) in str(refused.value)
        assert path.lstat().st_ino == before.st_ino
        path.rmdir() if words == "is a folder" else path.unlink()
    assert os.listdir(tmp_path) == ["real"]


def test_a_device_is_not_replaced(tmp_path):
    """As root, the null device of a container would become a plain file."""
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


@pytest.mark.parametrize("found", [tradeoff_of(4.0), sobol(), region()], ids=["tradeoff", "sensitivity", "stability"])
def test_a_study_is_saved_into_its_folder_alone(found, home):  # noqa: F811
    """The two or three files of a study have names of their own: none of them is a way out of its folder."""
    folder = home.parent / "study"
    names = [path.name for path in found.save(folder)]
    for name in names:
        (folder / name).unlink()
        (folder / name).symlink_to(home / "notes.txt")
        with pytest.raises(lw.SceneError, match=hostile.OUT):
            found.save(folder)
        assert (home / "notes.txt").read_text() == "mine"
        (folder / name).unlink()


@pytest.mark.parametrize("kind", [Tradeoff, StabilityMap, Indices])
@pytest.mark.parametrize("seed", range(3))
def test_any_value_of_a_study_may_be_another(kind, seed, bases, tmp_path):
    """What is not refused can be told and written: 60 places a test."""
    name = {Tradeoff: "tradeoff", StabilityMap: "stability", Indices: "sensitivity"}[kind]
    whole = json.loads((bases / name / f"{name}.json").read_text())
    dice, places, taken = np.random.default_rng(seed), [path for path in leaves(whole) if path], 0
    for _ in range(60):
        content, keys = json.loads(json.dumps(whole)), places[dice.integers(len(places))]
        table = content
        for key in keys[:-1]:
            table = table[key]
        table[keys[-1]] = STRANGE[dice.integers(len(STRANGE))]
        (tmp_path / "study.json").write_text(json.dumps(content))
        with contextlib.suppress(lw.SceneError):
            found = kind.load(tmp_path / "study.json")
            taken += 1
            found.save(tmp_path / "again"), list(found.rows()), str(found)
    assert taken < 60


# Cells of sweeps --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A finished sweep; no test changes it."""
    folder = tmp_path_factory.mktemp("swept")
    (folder / "sweep.toml").write_text(SWEEP)
    assert cli.main(["sweep", str(folder / "sweep.toml"), "--out", str(folder / "out"), "--quiet"]) == 0
    return folder


def the_cell(folder):
    (path,) = (folder / records.FOLDER).iterdir()
    return path


@pytest.mark.slow_but("torn at 0.5", "a status nobody*", "numbers of NaN", "other messages", "73 TiB", "words nested*")
@pytest.mark.parametrize("name", hostile.CELLS)
def test_a_damaged_cell_runs_anew(name, swept, home, capsys):  # noqa: F811
    out = shutil.copytree(swept / "out", home.parent / "out")
    hostile.CELLS[name](the_cell(out), home)
    before = snapshot(home)
    assert cli.main(["sweep", str(swept / "sweep.toml"), "--out", str(out)]) == 0
    assert "Traceback" not in capsys.readouterr().err
    assert snapshot(home) == before
    for file in ("sweep.json", "table.csv", "worst.csv", "summary.md"):
        assert (out / file).read_bytes() == (swept / "out" / file).read_bytes(), file
    assert the_cell(out).read_bytes() == the_cell(swept / "out").read_bytes()


def test_a_cell_of_another_is_not_taken(swept, home, capsys):  # noqa: F811
    """A file has the checksum of its own name: a cell with the numbers of another one runs anew."""
    path = the_cell(swept / "out")
    other = home.parent / path.name.replace(path.name[0], "0" if path.name[0] != "0" else "1", 1)
    shutil.copy(path, other)
    asked = (["max(norm(velocity))", "time_to_failure"], 5)
    assert records.Record.load(path, *asked) is not None
    assert records.Record.load(other, *asked) is None


@pytest.mark.parametrize("kind", hostile.PLACES)
@pytest.mark.parametrize("place", ["a cell", "the folder of cells", "the summary"])
def test_a_sweep_replaces_nothing_but_plain_files_of_its_folder(place, kind, swept, home, capsys):  # noqa: F811
    out = shutil.copytree(swept / "out", home.parent / "out")
    path = {"a cell": the_cell(out), "the folder of cells": out / records.FOLDER, "the summary": out / "summary.md"}[
        place
    ]
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    if (place, kind) == ("the folder of cells", "a folder"):
        return
    occupied(path, kind, home)
    before = snapshot(home)
    assert cli.main(["sweep", str(swept / "sweep.toml"), "--out", str(out)]) in (1, 2)
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert path.name in text
    assert snapshot(home) == before


def test_a_run_is_not_stored_behind_a_link(home, capsys):  # noqa: F811
    out = home.parent / "out"
    out.mkdir()
    (out / "run.zarr").symlink_to(home / "work")
    before = snapshot(home)
    for more in ([], ["--overwrite"], ["--resume"]):
        assert cli.main(["run", str(SCENE), "--store", "zarr", "--members", "4", "--out", str(out), *more]) == 2
        assert hostile.OUT in capsys.readouterr().err
        assert snapshot(home) == before
