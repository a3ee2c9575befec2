# SPDX-License-Identifier: Apache-2.0
"""Content of a folder: numbers, pictures and damage, as text and as a document; and its pictures drawn again."""

import json
from pathlib import Path
from unittest.mock import ANY

import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli import folders, view
from lgvi_warp.cli.arguments import parsed
from lgvi_warp.cli.folders import Content, contents
from lgvi_warp.cli.writing import Written
from tests.support.verbs import Study, main
from tests.unit.cli.test_run_summary import MACHINE, told
from tests.unit.measuring.test_cost import found as tradeoff_of


@pytest.fixture
def store(tmp_path):
    """Store of three blocks, two of them finished."""
    provenance = told().provenance | {"versions": {"lgvi-warp": "1.0"}, "scene": {"controller": {}}}
    return {
        "path": tmp_path / "run.zarr", "bytes": 1_260_000, "members": 1200, "provenance": provenance, "fields": ["position"],
        "samples": 5, "keepers": [], "kept": 0, "blocks": 3, "finished": 2, "complete": False, "damage": [],
    }  # fmt: skip


def lines_of(store, *options):
    """The lines about a store."""
    return list(folders.store_lines(store, parsed(["info", "a folder", *options])))


def test_lines_of_a_store(store, tmp_path):
    end = "blocks      2 of 3 finished; not complete: lgvi-warp resume a folder"
    head = [f"run         {tmp_path}/run.zarr (1.3 MB), lgvi-warp 1.0",
            "members     1,200, psi_s, float64, step 0.01 s, 100 steps"]  # fmt: skip
    assert lines_of(store) == [*head, "samples     5 times of position", end]
    more = store | {"fields": [], "keepers": ["mean", "failed"], "kept": 1500, "complete": True}
    assert lines_of(more)[2:] == ["samples     5 times, not of all members", "parts       mean, failed of each block",
                                  "kept        1,500 members' samples, run again",
                                  "blocks      2 of 3 finished; complete"]  # fmt: skip
    store["provenance"]["scene"]["controller"] = {"period": 0.5, "laws": [{"type": "pid"}]}
    said = lines_of(store, "-v")
    assert said[2] == "controller  acts every 0.5 s; laws pid"
    assert said[3].startswith("how         seed 1, checks safe")
    assert said[4] == "versions    lgvi-warp 1.0"
    assert len(said) == 7


@pytest.mark.parametrize(("options", "count", "shown", "more"), [
    ((), 20, 20, None), ((), 21, 20, 1), ((), 1221, 20, 1201), (("-v",), 1221, 1221, None), ((), 0, 0, None)])  # fmt: skip
def test_damage_is_listed_to_a_limit(store, options, count, shown, more):
    store["damage"] = [f"file {i}" for i in range(count)]
    said = [line for line in lines_of(store, *options) if line.startswith("damage")]
    expected = [f"damage      file {i}" for i in range(shown)]
    assert said == expected + ([f"damage      and {more:,} more files"] if more else [])


def test_contents_of_a_folder(tmp_path):
    names = {"result": ["result.npz", "result_part.npz"], "tradeoff": ["tradeoff.json"],
             "sensitivity": ["sensitivity.json"], "stability": ["stability.json", "stability_mass.json"],
             "sweep": ["sweep.json"], "rare": ["rare.json"], "derivatives": ["derivatives.json"],
             "margins": ["margins.json"], "worst_case": ["worst_case.json"],
             "estimate": ["estimate.json"], "footprint": ["footprint.json"],
             "tune_gains": ["tune_gains.json"], "trim": ["trim.json"],
             "assimilate": ["assimilate.json"]}  # fmt: skip
    expected = [Content(kind, tmp_path / name) for kind, found in names.items() for name in found]
    for content in expected:
        content.path.write_text("{}")
    (tmp_path / "other.json").write_text("{}")
    assert contents(tmp_path) == expected
    (tmp_path / "a.zarr").mkdir()
    assert contents(tmp_path) == [*expected, Content("store", tmp_path / "a.zarr")]
    alone = tmp_path / "b"
    (alone / "c.zarr").mkdir(parents=True)
    assert contents(alone) == [Content("store", alone / "c.zarr")]
    assert contents(tmp_path / "none.zarr") == [Content("store", tmp_path / "none.zarr")]
    for name, words in (("none", "is not there"), ("c.zarr/..", "contains no results of a command")):
        (tmp_path / "empty").mkdir(exist_ok=True)
        place = tmp_path / ("empty" if "results" in words else name)
        with pytest.raises(lw.SceneError) as caught:
            contents(place)
        assert str(caught.value) == f"{place} {words}. Give the folder of a run or of a study."


def test_info_of_a_folder_with_everything(store, tmp_path, capsys):
    result = told()
    result.save(tmp_path / "result.npz")
    tradeoff_of(4.0).save(tmp_path)
    (tmp_path / "sweep.json").write_text('{"seed": 3}')
    (tmp_path / "summary.md").write_text("# A sweep\n\n")
    for name in ("b.rrd", "a.png", "c.nc", "d.parquet", "e.html", "f.csv", "g.txt", "h.dat"):
        (tmp_path / name).write_text("x")
    (tmp_path / "run.zarr").mkdir()
    states = Study([store, store | {"complete": True}, store])
    assert main(["info", str(tmp_path)], describe=states) == 1
    text = capsys.readouterr().out
    said = [line.partition(" (")[0] for line in text.split("\n")]
    others = ["a.png", "b.rrd", "c.nc", "d.parquet", "e.html", "f.csv", "g.txt", "tradeoff.csv"]
    assert said[-9:] == [*(f"file        {tmp_path}/{name}" for name in others), ""]
    assert said[0] == f"file        {tmp_path}/result.npz"
    assert said[1].startswith("members     4, psi_s")
    places = [text.index(words) for words in ("tradeoff.json (", "# A sweep\nrun         ", "2 of 3 finished")]
    assert places == sorted(places)
    assert "how  " not in text
    assert main(["info", str(tmp_path), "--json"], describe=states) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["path"] == str(tmp_path)
    assert document["complete"] is True
    assert [held["kind"] for held in document["holds"]] == ["result", "tradeoff", "sweep", "store"]
    assert [held["path"] for held in document["holds"]] == [
        f"{tmp_path}/{name}" for name in ("result.npz", "tradeoff.json", "sweep.json", "run.zarr")]  # fmt: skip
    assert document["holds"][0]["members"] == 4
    assert document["holds"][2]["content"] == {"seed": 3}
    assert document["files"] == [f"{tmp_path}/{name}" for name in others]
    assert states.calls[0] == ((tmp_path / "run.zarr",), {})
    (tmp_path / "run.zarr" / "a.png").write_text("x")
    assert main(["info", str(tmp_path / "run.zarr"), "--json"], describe=states) == 1
    assert json.loads(capsys.readouterr().out)["files"] == []


def test_verbose_info_of_a_result_says_how(tmp_path, capsys):
    told().save(tmp_path / "result.npz")
    assert cli.main(["info", str(tmp_path), "-v"]) == 0
    assert f"how         seed 1, checks {MACHINE['checks']}" in capsys.readouterr().out


def test_pictures_are_drawn_again(tmp_path, capsys):
    told().save(tmp_path / "result.npz")
    (tmp_path / "sweep.json").write_text("{}")
    assert cli.main(["plot", str(tmp_path), "--out", str(tmp_path / "o"), "--json"]) == 0
    said = capsys.readouterr()
    document = json.loads(said.out)
    assert document["files"] == [f"{tmp_path}/o/{name}" for name in ("fleet.png", "fleet.rrd")]
    again = "its pictures are drawn again by the same lgvi-warp sweep, which runs nothing twice"
    assert document["notes"] == [f"{tmp_path}/sweep.json: {again}"]
    # Before it a slow machine says how long it draws.
    assert said.err.splitlines()[-1] == f"lgvi-warp: {tmp_path}/sweep.json: {again}"
    (tmp_path / "fleet.png").mkdir()
    assert cli.main(["plot", str(tmp_path)]) == 1
    said = capsys.readouterr()
    assert [line.partition(" (")[0] for line in said.out.split("\n")] == [f"file        {tmp_path}/fleet.rrd", ""]
    assert f"lgvi-warp: {tmp_path}/fleet.png was not written: " in said.err


def test_the_last_run_of_a_folder_is_viewed(tmp_path):
    (tmp_path / "sweep.json").write_text("{}")
    with pytest.raises(lw.SceneError, match=rf"^{tmp_path} holds a study, and no run. Give the folder of a run\.$"):
        view.run_in(tmp_path)
    (tmp_path / "result.npz").touch()
    assert view.run_in(tmp_path) == Content("result", tmp_path / "result.npz")
    (tmp_path / "run.zarr").mkdir()
    assert view.run_in(tmp_path) == Content("store", tmp_path / "run.zarr")
    assert view.run_in(Path("x.npz")) == Content("result", Path("x.npz"))


def test_members_to_view_are_a_list():
    assert view.indices(None) is None
    assert view.indices(" 3, 17") == [3, 17]
    for text in ("3,,4", "-1", "", "3;4"):
        with pytest.raises(lw.SceneError, match=r"is not a list of members. Write --members 3,17"):
            view.indices(text)


def test_a_viewed_run_says_its_file(tmp_path, capsys):
    told().save(tmp_path / "result.npz")
    shown, logged = Study(None), []
    log = lambda result, out, members: (logged.append((result.members, members)), out.write_bytes(b"x" * 200_000))  # noqa: E731
    assert main(["view", str(tmp_path), "--out", str(tmp_path / "a.rrd"), "--members", "1,2"], log=log) == 0
    assert capsys.readouterr().out == f"file        {tmp_path}/a.rrd (0.2 MB)\n"
    assert logged.pop() == (4, [1, 2])
    assert main(["view", str(tmp_path), "--out", str(tmp_path / "a.rrd"), "--json"], log=log) == 0
    assert json.loads(capsys.readouterr().out)["files"] == [f"{tmp_path}/a.rrd"]
    assert main(["view", str(tmp_path), "--json"], viewer=shown) == 0
    assert main(["view", str(tmp_path), "-q", "--members", "0"], viewer=shown) == 0
    assert [(result.members, named["members"]) for (result,), named in shown.calls] == [(4, None), (4, [0])]
    assert json.loads(capsys.readouterr().out)["files"] == []
    for error in (lw_error("no member."), OSError("no display")):
        assert main(["view", str(tmp_path), "-q"], viewer=Study(error)) == (2 if "member" in str(error) else 1)
        assert capsys.readouterr().err == f"lgvi-warp: {error}\n"


def lw_error(text):
    """A refusal of a picture."""
    from lgvi_warp.common.errors import NothingToDraw

    return NothingToDraw(text)


class Merged:
    """A store of three blocks."""

    runs = range(3)

    def __init__(self, path, missing, complete=False):
        self.path, self.missing, self.complete = path, missing, complete

    def unfinished(self):
        return range(self.missing)


def test_merging_says_what_is_missing(tmp_path, capsys):
    path = tmp_path / "run.zarr"
    path.mkdir()
    (path / "a").write_bytes(b"x" * 100_000)
    study = Study([Merged(path, 2), Merged(path, 0), Merged(path, 0, True), Merged(path, 1, True)])
    verb, line = ["merge", "a", "b", "--out", "c"], f"file        {path} (0.1 MB)"
    resume = f"lgvi-warp resume {path} runs them"
    for text in (f"2 of 3 blocks are in none of the folders. {resume}",
                 f"the members that it keeps are missing. {resume}, or says why not"):  # fmt: skip
        assert main(verb, join=study) == 1
        assert capsys.readouterr() == (f"{line}\n", f"lgvi-warp: {path}: {text}\n")
    assert main([*verb, "--overwrite"], join=study) == 0
    assert capsys.readouterr() == (f"{line}, complete\n", "")
    assert main([*verb, "--json"], join=study) == 0
    document = json.loads(capsys.readouterr().out)
    assert {name: document[name] for name in ("file", "complete", "blocks", "missing")} == {
        "file": str(path), "complete": True, "blocks": 3, "missing": 0}  # fmt: skip
    folders_given = ([Path("a"), Path("b")], Path("c"))
    assert [values for values, _ in study.calls] == [(*folders_given, False)] * 2 + [
        (*folders_given, True), (*folders_given, False)]  # fmt: skip


def test_a_run_is_exported_and_reported(tmp_path, capsys):
    for name in ("a.nc", "report.html", "b.html"):
        (tmp_path / name).write_bytes(b"x" * 100_000)
    write, page, opened = Study(tmp_path / "a.nc"), Study([tmp_path / "report.html", tmp_path / "b.html"]), []
    assert main(["export", "a", "--to", "netcdf", "--out", "b"], write=write) == 0
    assert capsys.readouterr().out == f"file        {tmp_path}/a.nc (0.1 MB)\n"
    settings = {"members": None, "origin": None, "start": None, "inputs": None, "overwrite": False, "progress": ANY}
    assert write.calls == [((Path("a"), "netcdf", Path("b")), settings)]
    assert main(["report", "a"], write=page, browse=opened.append) == 0
    assert opened == []
    assert capsys.readouterr().out == f"file        {tmp_path}/report.html (0.1 MB)\n"
    assert main(["report", "a", "--out", "b", "--open", "--json"], write=page, browse=opened.append) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["file"], document["bytes"]) == (f"{tmp_path}/b.html", 100_000)
    assert opened == [f"file://{tmp_path}/b.html"]
    assert [values for values, _ in page.calls] == [(Path("a"), Path("a/report.html")), (Path("a"), Path("b"))]
    assert main(["export", "a", "--to", "x", "-q"], write=write) == 0
    assert capsys.readouterr().out == ""


def test_files_that_were_written_and_why_not(tmp_path):
    written = Written()
    from lgvi_warp.common.errors import MissingExtra, install

    for name, study in (("a", Study(tmp_path / "a")), ("b", Study(ValueError("odd"))), ("c", Study(lw_error("nothing"))),
                        ("d", Study(MissingExtra("plots", "matplotlib", "viz"))), ("e", Study(ImportError("broken"))),
                        ("f", Study(MissingExtra("tables", "pandas", "io"))),
                        ("g", Study(MissingExtra("plots", "matplotlib", "viz")))):  # fmt: skip
        written.take(tmp_path / name, study)
    assert written.files == [tmp_path / "a"]
    assert written.empty == [f"{tmp_path}/c was not written: nothing"]
    assert written.faults == [f"{tmp_path}/{name}" for name in ("b was not written: odd", "e was not written: broken")]
    libraries = f"not made without matplotlib and pandas. To have pictures: {install('viz,io')}"
    assert written.note_lines() == [f"note        d, f, g: {libraries}"]
    assert Written().note_lines() == []
    with pytest.raises(KeyError):
        written.take(tmp_path / "h", Study(KeyError("a bug")))
    calls = []
    written.draw(lambda study, path: calls.append((study, path)), "numbers", tmp_path / "i")
    assert calls == [("numbers", tmp_path / "i")]
    assert written.files[-1] == tmp_path / "i"


@pytest.mark.ci
@pytest.mark.kernel
def test_what_rare_and_derivatives_wrote_is_shown_and_drawn(tmp_path, capsys):
    vary = {"start.velocity": lw.distributions.Normal(std=[0.0, 0.0, 0.1])}
    scene = lw.Scene.named("sphere", start={"position": [0.0, 0.0, 50.0]})
    settings = {"method": "psi_x", "h": 0.1, "t1": 1.0, "threads": 1}
    fleet = lw.Ensemble(scene, 100, 1, vary)
    lw.rare_event(fleet, "position[2] - 50.3", relative_error=0.3, seed=1, **settings).save(tmp_path)
    lw.derivatives(scene, "depth", "start.velocity[2]", **settings).save(tmp_path)
    assert cli.main(["info", str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert f"{tmp_path}/rare.json" in text
    assert "by start.velocity[2]" in text
    assert cli.main(["plot", str(tmp_path)]) == 0
    assert (tmp_path / "rare.png").stat().st_size > 1000
    assert "derivatives.json has no picture" in capsys.readouterr().err
    lw.report(tmp_path, tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert "Rare of " in page
    assert "start.velocity[2]" in page
