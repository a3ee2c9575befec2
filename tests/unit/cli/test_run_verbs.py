# SPDX-License-Identifier: Apache-2.0
"""The verbs run, resume and predict: what their arguments reach, and how they end. No kernel runs."""

import dataclasses
import importlib
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli import runs
from lgvi_warp.common.errors import Interrupted, MembersFailed, MissingExtra
from lgvi_warp.common.status import Status
from tests.conftest import ROOT
from tests.support.made import made
from tests.unit.cli.test_study_verbs import Study

PAPER = str(ROOT / "examples" / "paper.toml")


def result_of(members=6, planned=6, status=Status.OK):
    """A result of a few members that all ended alike."""
    result = made(np.ones((3, members, 3)), status=np.full(members, status))
    return dataclasses.replace(result, provenance=result.provenance | {"ensemble": {"members": planned, "seed": 1}})


@pytest.fixture
def solved(monkeypatch):
    """A function that sets what a run ends with; it returns calls of solve, and of the report."""

    def ends_with(outcome):
        study, reports = Study(outcome), []

        def report(result, out, chosen, begun, failures, address=None):
            reports.append((result, out, list(failures), address))
            return failures

        monkeypatch.setattr("lgvi_warp.calls.solve.solve", study)
        monkeypatch.setattr(runs, "report", report)
        monkeypatch.setattr(runs, "_import_in_background", lambda: SimpleNamespace(join=lambda: None))
        return study.calls, reports

    return ends_with


def test_arguments_of_a_run(solved, tmp_path, monkeypatch):
    result = result_of()
    calls, reports = solved(result)
    out, joined = str(tmp_path), []
    thread = SimpleNamespace(join=lambda: joined.append(len(reports)))
    monkeypatch.setattr(runs, "_import_in_background", lambda: thread)
    assert cli.main(["run", PAPER, "--out", out, "-q"]) == 0
    more = ["--threads", "3", "--width", "4", "--executor", "dask", "--scheduler", "tcp://x", "--store", "zarr"]
    assert cli.main(["run", PAPER, "--out", out, "--members", "9", *more, "--blocks", "1:2"]) == 0
    ((scene,), plain), ((other,), named) = calls
    assert scene.run.step == 0.01
    assert other.ensemble_settings.members == 9
    assert plain == {"threads": None, "width": None, "progress": None, "store": None, "executor": "threads",
                     "scheduler": None, "only": None, "on_block": None}  # fmt: skip
    assert named.pop("progress") is not None
    assert named.pop("store").path == tmp_path / "run.zarr"
    assert named == {"threads": 3, "width": 4, "executor": "dask", "scheduler": "tcp://x", "only": range(1, 2),
                     "on_block": None}  # fmt: skip
    assert reports == [(result, tmp_path, [], None)] * 2
    assert joined == [0, 1]  # before the files are written


def test_libraries_are_imported_until_one_is_missing(monkeypatch):
    libraries = ["matplotlib.figure", "matplotlib.backends.backend_agg", "rerun", "rerun.blueprint"]
    for absent, tried in (("", libraries), ("rerun", libraries[:3])):
        names = []

        def import_module(name, absent=absent, names=names):
            names.append(name)
            if name == absent:
                raise ImportError(name)

        monkeypatch.setattr(importlib, "import_module", import_module)
        thread = runs._import_in_background()
        thread.join()
        assert names == tried
        assert isinstance(thread, threading.Thread)
        assert thread.daemon


@pytest.mark.parametrize(
    ("faults", "status", "code"), [(["a"], Status.OK, 1), ([], Status.NON_FINITE, 1), ([], Status.FLOOR, 0)]
)
def test_exit_codes_of_a_run(solved, monkeypatch, tmp_path, capsys, faults, status, code):
    solved(result_of(status=status))
    monkeypatch.setattr(runs, "report", lambda *_: faults)
    assert cli.main(["run", PAPER, "--out", str(tmp_path), "-q"]) == code
    assert capsys.readouterr() == ("", "".join(f"lgvi-warp: {fault}\n" for fault in faults))


def test_members_that_fail_are_reported_with_the_files(solved, tmp_path, capsys):
    result = result_of()
    _, reports = solved(MembersFailed("2 members failed", result))
    assert cli.main(["run", PAPER, "--out", str(tmp_path), "-q"]) == 1
    assert reports == [(result, tmp_path, ["2 members failed"], None)]
    assert capsys.readouterr().err == "lgvi-warp: 2 members failed\n"


def test_an_interrupted_run_says_what_is_saved(solved, tmp_path, capsys):
    solved(Interrupted("stopped", result_of(2)))
    path = tmp_path / "result.npz"
    go_on = "a run with --store zarr can go on where it stopped"
    for name in ("result.npz", "result_part.npz", "result_part.npz"):
        path = tmp_path / name
        assert cli.main(["run", PAPER, "--out", str(tmp_path), "-q"]) == 130
        words = f"interrupted; the first 2 of 6 members are saved in {path}; {go_on}"
        assert capsys.readouterr().err == f"lgvi-warp: {words}\n"
        assert lw.Result.load(path).members == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["result.npz", "result_part.npz"]


def test_what_an_interrupt_leaves_of_a_run_that_ended(tmp_path, monkeypatch):
    whole = result_of(1000, 1000)
    assert runs.rescued(whole, tmp_path) == f"the run is finished: its 1,000 members are saved in {tmp_path}/result.npz"
    stored = dataclasses.replace(whole, store=tmp_path / "a" / "run.zarr")
    text = f"the run is finished: its pictures are made by lgvi-warp resume {tmp_path}/a"
    assert runs.rescued(stored, tmp_path) == text
    for error, words in ((OSError(28, "No space"), "No space"), (OSError("full"), "full")):

        def save(self, path, error=error):
            raise error

        monkeypatch.setattr(lw.Result, "save", save)
        lost = f"the first 6 of 1,000 members are lost: {tmp_path}/result_part.npz: {words}"
        assert runs.rescued(result_of(6, 1000), tmp_path) == lost


def test_an_interrupt_among_the_files_says_what_is_saved(solved, tmp_path, monkeypatch, capsys):
    solved(result_of())
    saved = tmp_path / "result.npz"
    for said, text in ((f"written: {saved}", f"written: {saved}"),
                       ("", f"the run is finished: its 6 members are saved in {saved}")):  # fmt: skip

        def report(*_, said=said):
            raise runs.Ended(said)

        monkeypatch.setattr(runs, "report", report)
        assert cli.main(["run", PAPER, "--out", str(tmp_path), "-q"]) == 130
        assert capsys.readouterr().err == f"lgvi-warp: interrupted; {text}\n"


def test_a_live_run_hands_over_its_blocks(solved, tmp_path, monkeypatch):
    result = result_of()
    calls, reports = solved(result)
    asked, views = [], []
    monkeypatch.setattr(
        "lgvi_warp.views.recording.viewer.opened", lambda address: asked.append(address) or "rerun+http://a"
    )
    monkeypatch.setattr(
        "lgvi_warp.views.recording.live.live", lambda *given: views.append(given) or SimpleNamespace(add="takes")
    )
    for options, address in (([], None), (["--viewer", "rerun+http://b"], "rerun+http://b")):
        assert cli.main(["run", PAPER, "--out", str(tmp_path), "-q", "--live", *options]) == 0
        assert asked.pop() == address
    assert [settings["on_block"] for _, settings in calls] == ["takes", "takes"]
    assert [given[1] for given in views] == ["rerun+http://a"] * 2
    assert views[0][0] is calls[0][0][0]
    assert [address for *_, address in reports] == ["rerun+http://a"] * 2


def test_a_live_run_needs_its_library_and_what_it_shows(solved, tmp_path, monkeypatch, capsys):
    calls, _ = solved(result_of())
    monkeypatch.setattr(
        "lgvi_warp.views.recording.viewer.opened", Study(MissingExtra("recordings", "rerun-sdk", "viz"))
    )
    verb = ["run", PAPER, "--out", str(tmp_path / "out"), "-q"]
    cases = {("--live",): "pip install 'lgvi-warp[viz]'", ("--viewer", "x"): "has no effect without --live; add --live"}
    none = "--live: shows members as they are done, and the run keeps none; add --keep all"
    cases |= {("--live", "--keep", "none"): none, ("--live", "--keep", "1,2"): none}
    for options, words in cases.items():
        assert cli.main([*verb, *options]) == 2
        assert words in capsys.readouterr().err
    assert calls == []
    assert not (tmp_path / "out").exists()


class Suggestion:
    """What --error leads to."""

    of, unit, error = "speed", "m/s", 0.5
    settings = {"h": 0.25, "dtype": "float32"}  # noqa: RUF012

    def __str__(self):
        return "suggested   a step"


def test_a_run_with_an_error_takes_what_is_suggested_and_checks_it(solved, tmp_path, monkeypatch, capsys):
    result = result_of()
    calls, reports = solved(result)
    suggest, verified = Study(Suggestion()), Study([(0.5, 7), (0.51, 7), (np.nan, 7)])
    monkeypatch.setattr("lgvi_warp.studies.suggest.suggest", suggest)
    monkeypatch.setattr("lgvi_warp.studies.suggest.verified", verified)
    verb = ["run", PAPER, "--out", str(tmp_path), "--error", "0.5"]
    again = "asked 0.5 (7 members again at half the step, those with the largest errors among them)"
    assert cli.main(verb) == 0
    said = capsys.readouterr()
    assert said.out == f"suggested   a step\nchecked     error of speed 5.0e-01 m/s, {again}\n"
    for options, number in ((["-q", "--method", "rk4", "--of", "depth", "--threads", "2"], "5.1e-01"), (["-q"], "nan")):
        assert cli.main([*verb, *options]) == 1
        text = f"error of speed {number} m/s, {again}: missed; ask for a smaller one"
        assert capsys.readouterr() == ("", f"lgvi-warp: {text}\n")
        assert reports[-1][2] == [text]
    (first, settings), (_, named), _ = suggest.calls
    assert settings.pop("progress") is not None
    assert first[1:] == (0.5, "position")
    assert settings == {"methods": None, "threads": None}
    assert suggest.calls[1][0][1:] == (0.5, "depth")
    assert named == {"methods": ["rk4"], "threads": 2, "progress": None}
    assert all(settings["h"] == 0.25 and settings["dtype"] == "float32" for _, settings in calls)
    (ensemble, checked, suggested), _ = verified.calls[0]
    assert isinstance(ensemble, lw.Ensemble)
    assert checked is result
    assert isinstance(suggested, Suggestion)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--of", "depth"], "--of depth: has no effect without --error; add --error 1e-3"),
        (["--error", "0.01", "--step", "0.5"], "--step 0.5: is what --error chooses; leave out --step or --error"),
        (["--error", "1", "--dtype", "float32"], "--dtype float32: is what --error chooses; leave out --dtype or --error"),
        (["--error", "0.01", "--keep", "3"],
         '--error 0.01: is checked on samples of all members; give run.keep="all", no run.until'),
        (["--error", "0.01", "--keep", "none"],
         '--error 0.01: is checked on samples of all members; give run.keep="all", no run.until'),
    ],
)  # fmt: skip
def test_what_contradicts_an_error_is_refused(solved, tmp_path, capsys, options, text):
    solved(result_of())
    assert cli.main(["run", PAPER, "--out", str(tmp_path), "-q", *options]) == 2
    assert capsys.readouterr().err == f"lgvi-warp: {text}\n"


def test_arguments_of_resume(solved, tmp_path, monkeypatch, capsys):
    result = dataclasses.replace(result_of(), store=tmp_path / "there" / "run.zarr")
    _, reports = solved(result)
    failed = dataclasses.replace(result_of(status=Status.NON_FINITE), store=result.store)
    study = Study([result, result, MembersFailed("all failed", result), failed])
    monkeypatch.setattr("lgvi_warp.calls.resume.resume", study)
    assert cli.main(["resume", str(tmp_path), "-q"]) == 0
    options = ["--threads", "2", "--executor", "processes", "--scheduler", "tcp://x", "--force"]
    assert cli.main(["resume", str(tmp_path), *options]) == 0
    assert [cli.main(["resume", str(tmp_path), "-q"]) for _ in range(2)] == [1, 1]
    assert capsys.readouterr().err.endswith("lgvi-warp: all failed\n")
    (place, plain), (_, named), *_ = study.calls
    common = {"executor": "threads", "threads": None, "scheduler": None, "progress": None, "force": False}
    assert place == (tmp_path,)
    assert plain == common
    assert named.pop("progress") is not None
    assert named == {"executor": "processes", "threads": 2, "scheduler": "tcp://x", "force": True}
    assert [given[:3] for given in reports] == [(result, tmp_path / "there", [])] * 2 + [
        (result, tmp_path / "there", ["all failed"]), (failed, tmp_path / "there", [])]  # fmt: skip


def test_arguments_of_predict(tmp_path, monkeypatch, capsys):
    study = Study(SimpleNamespace(seconds=3.0, members=4))
    monkeypatch.setattr("lgvi_warp.calls.predict.predict", study)
    options = [
        "--threads",
        "2",
        "--store",
        "zarr",
        "--store-dtype",
        "float32",
        "--out",
        str(tmp_path),
        "--members",
        "3",
    ]
    assert cli.main(["predict", PAPER, "-q"]) == 0
    assert cli.main(["predict", PAPER, *options]) == 0
    (_, plain), ((scene,), named) = study.calls
    assert plain == {"threads": None, "store": None}
    assert scene.ensemble_settings.members == 3
    assert named["threads"] == 2
    assert (named["store"].path, named["store"].dtype) == (Path(tmp_path) / "run.zarr", "float32")
    assert capsys.readouterr().out == f"{study.result}\n"
