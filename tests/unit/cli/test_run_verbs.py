# SPDX-License-Identifier: Apache-2.0
"""The verbs run, resume and predict: what their arguments reach, and how they end. No kernel runs."""

import dataclasses
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
from tests.support.verbs import Study, main

PAPER = str(ROOT / "examples" / "paper.toml")


def result_of(members=6, planned=6, status=Status.OK):
    """A result of a few members that all ended alike."""
    result = made(np.ones((3, members, 3)), status=np.full(members, status))
    return dataclasses.replace(result, provenance=result.provenance | {"ensemble": {"members": planned, "seed": 1}})


class Report:
    """Stands for what writes a run's files and its summary: keeps what it is given, and returns its failures."""

    def __init__(self, faults=()):
        self.calls, self.faults = [], list(faults)

    def __call__(self, result, out, chosen, begun, failures, address=None):
        # The libraries of pictures are loaded before they are drawn.
        assert not any(thread.name == "imports" for thread in threading.enumerate())
        self.calls.append((result, out, list(failures), address))
        return [*self.faults, *failures]


def test_arguments_of_a_run(tmp_path):
    result = result_of()
    solve, report = Study(result), Report()
    verb = ["run", PAPER, "--out", str(tmp_path)]
    assert main([*verb, "-q"], simulate=solve, finish=report) == 0
    more = ["--threads", "3", "--width", "4", "--executor", "dask", "--scheduler", "tcp://x", "--store", "zarr"]
    assert main([*verb, "--members", "9", *more, "--blocks", "1:2"], simulate=solve, finish=report) == 0
    ((scene,), plain), ((other,), named) = solve.calls
    assert scene.run.step == 0.01
    assert other.ensemble_settings.members == 9
    assert plain == {"threads": None, "width": None, "progress": None, "store": None, "executor": "threads",
                     "scheduler": None, "blocks": None, "on_block": None, "start": None}  # fmt: skip
    assert named.pop("progress") is not None
    assert named.pop("store").path == tmp_path / "run.zarr"
    assert named == {"threads": 3, "width": 4, "executor": "dask", "scheduler": "tcp://x", "blocks": range(1, 2),
                     "on_block": None, "start": None}  # fmt: skip
    assert report.calls == [(result, tmp_path, [], None)] * 2


def test_libraries_are_imported_until_one_is_missing():
    libraries = ["matplotlib.figure", "matplotlib.backends.backend_agg", "rerun", "rerun.blueprint"]
    for absent, tried in (("", libraries), ("rerun", libraries[:3])):
        names = []

        def load(name, absent=absent, names=names):
            names.append(name)
            if name == absent:
                raise ImportError(name)

        thread = runs.import_in_background(load)
        thread.join()
        assert names == tried
        assert thread.daemon


@pytest.mark.parametrize(("outcome", "faults", "code", "output"), [
    (result_of(), ["a"], 1, ["a"]), (result_of(status=Status.NON_FINITE), [], 1, []),
    (result_of(status=Status.FLOOR), [], 0, []),
    (MembersFailed("2 members failed", result_of()), [], 1, ["2 members failed"]),
])  # fmt: skip
def test_exit_codes_of_a_run(tmp_path, capsys, outcome, faults, code, output):
    report = Report(faults)
    assert main(["run", PAPER, "--out", str(tmp_path), "-q"], simulate=Study(outcome), finish=report) == code
    assert capsys.readouterr() == ("", "".join(f"lgvi-warp: {fault}\n" for fault in output))
    ((result, _, failures, _),) = report.calls
    assert result is getattr(outcome, "result", outcome)
    assert failures == (output if isinstance(outcome, MembersFailed) else [])


def test_an_interrupted_run_says_what_is_saved(tmp_path, capsys):
    solve = Study(Interrupted("stopped", result_of(2)))
    go_on = "a run with --store zarr can go on where it stopped"
    for name in ("result.npz", "result_part.npz", "result_part.npz"):
        path = tmp_path / name
        assert main(["run", PAPER, "--out", str(tmp_path), "-q"], simulate=solve) == 130
        words = f"interrupted; the first 2 of 6 members are saved in {path}; {go_on}"
        assert capsys.readouterr().err == f"lgvi-warp: {words}\n"
        assert lw.Result.load(path).members == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["result.npz", "result_part.npz"]


def test_what_an_interrupt_leaves_of_a_run_that_ended(tmp_path):
    whole = result_of(1000, 1000)
    assert runs.rescued(whole, tmp_path) == f"the run is finished: its 1,000 members are saved in {tmp_path}/result.npz"
    stored = dataclasses.replace(whole, store=tmp_path / "a" / "run.zarr")
    text = f"the run is finished: its pictures are made by lgvi-warp resume {tmp_path}/a"
    assert runs.rescued(stored, tmp_path) == text
    provenance = {"ensemble": {"members": 1000}}
    for error, words in ((OSError(28, "No space"), "No space"), (OSError("full"), "full")):
        lost = f"the first 6 of 1,000 members are lost: {tmp_path}/result_part.npz: {words}"
        result = SimpleNamespace(store=None, members=6, provenance=provenance, save=Study(error))
        assert runs.rescued(result, tmp_path) == lost


def test_an_interrupt_among_the_files_says_what_is_saved(tmp_path, capsys):
    saved = tmp_path / "result.npz"
    for said, text in ((f"written: {saved}", f"written: {saved}"),
                       ("", f"the run is finished: its 6 members are saved in {saved}")):  # fmt: skip
        parts = {"simulate": Study(result_of()), "finish": Study(runs.Ended(said))}
        assert main(["run", PAPER, "--out", str(tmp_path), "-q"], **parts) == 130
        assert capsys.readouterr().err == f"lgvi-warp: interrupted; {text}\n"


def test_a_live_run_hands_over_its_blocks(tmp_path):
    solve, report = Study(result_of()), Report()
    viewer, live = Study("rerun+http://a"), Study(SimpleNamespace(add="takes"))
    verb = ["run", PAPER, "--out", str(tmp_path), "-q", "--live"]
    for options in ([], ["--viewer", "rerun+http://b"]):
        assert main([*verb, *options], simulate=solve, finish=report, viewer=viewer, live=live) == 0
    assert [given for given, _ in viewer.calls] == [(None,), ("rerun+http://b",)]
    assert [settings["on_block"] for _, settings in solve.calls] == ["takes", "takes"]
    assert [given[1] for given, _ in live.calls] == ["rerun+http://a"] * 2
    assert live.calls[0][0][0] is solve.calls[0][0][0]
    assert [address for *_, address in report.calls] == ["rerun+http://a"] * 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--live"], "pip install '.[viz]'"),
        (["--viewer", "x"], "has no effect without --live. Add --live"),
        (["--live", "--keep", "none"], "--live shows members as they are done, and the run keeps none. Add --keep all"),
        (["--live", "--keep", "1,2"], "--live shows members as they are done, and the run keeps none. Add --keep all"),
    ],
)  # fmt: skip
def test_a_live_run_needs_its_library_and_what_it_shows(tmp_path, capsys, options, words):
    solve, viewer = Study(result_of()), Study(MissingExtra("recordings", "rerun-sdk", "viz"))
    verb = ["run", PAPER, "--out", str(tmp_path / "out"), "-q", *options]
    assert main(verb, simulate=solve, viewer=viewer) == 2
    fault = capsys.readouterr().err
    assert words in fault
    assert fault.count("\n") == 1
    assert solve.calls == []
    assert not (tmp_path / "out").exists()


class Suggestion:
    """Suggestion as --error uses it."""

    of, unit, error = "speed", "m/s", 0.5
    settings = {"h": 0.25, "dtype": "float32"}  # noqa: RUF012

    def __str__(self):
        return "suggested   a step"


def test_a_run_with_an_error_takes_what_is_suggested_and_checks_it(tmp_path, capsys):
    result = result_of()
    solve, report = Study(result), Report()
    suggest, verified = Study(Suggestion()), Study([(0.5, 7), (0.51, 7), (np.nan, 7)])
    parts = {"simulate": solve, "finish": report, "suggest": suggest, "verify": verified}
    verb = ["run", PAPER, "--out", str(tmp_path), "--error", "0.5"]
    again = "asked 0.5 (7 members again at half the step, those with the largest errors among them)"
    assert main(verb, **parts) == 0
    said = capsys.readouterr()
    assert said.out == f"suggested   a step\nchecked     error of speed 5.0e-01 m/s, {again}\n"
    for options, number in ((["-q", "--method", "rk4", "--of", "depth", "--threads", "2"], "5.1e-01"), (["-q"], "nan")):
        assert main([*verb, *options], **parts) == 1
        text = f"error of speed {number} m/s, {again}: missed. Ask for a smaller one"
        assert capsys.readouterr() == ("", f"lgvi-warp: {text}\n")
        assert report.calls[-1][2] == [text]
    (first, settings), (_, named), _ = suggest.calls
    assert settings.pop("progress") is not None
    assert first[1:] == (0.5, "position")
    assert settings == {"methods": None, "threads": None}
    assert suggest.calls[1][0][1:] == (0.5, "depth")
    assert named == {"methods": ["rk4"], "threads": 2, "progress": None}
    assert all(settings["h"] == 0.25 and settings["dtype"] == "float32" for _, settings in solve.calls)
    (ensemble, checked, suggested), _ = verified.calls[0]
    assert isinstance(ensemble, lw.Ensemble)
    assert checked is result
    assert isinstance(suggested, Suggestion)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--of", "depth"], "--of depth has no effect without --error. Add --error 1e-3."),
        (["--error", "0.01", "--step", "0.5"], "--step 0.5 is what --error chooses. Leave out --step or --error."),
        (["--error", "1", "--dtype", "float32"], "--dtype float32 is what --error chooses. Leave out --dtype or --error."),
        (["--error", "0.01", "--keep", "3"],
         '--error 0.01 is checked on samples of all members. Give run.keep="all", no run.until.'),
        (["--error", "0.01", "--keep", "none"],
         '--error 0.01 is checked on samples of all members. Give run.keep="all", no run.until.'),
    ],
)  # fmt: skip
def test_what_contradicts_an_error_is_refused(tmp_path, capsys, options, text):
    assert cli.main(["run", PAPER, "--out", str(tmp_path), "-q", *options]) == 2
    assert capsys.readouterr().err == f"lgvi-warp: {text}\n"


def test_arguments_of_resume(tmp_path, capsys):
    result = dataclasses.replace(result_of(), store=tmp_path / "there" / "run.zarr")
    failed = dataclasses.replace(result_of(status=Status.NON_FINITE), store=result.store)
    study = Study([result, result, MembersFailed("all failed", result), failed])
    report = Report()
    assert main(["resume", str(tmp_path), "-q"], simulate=study, finish=report) == 0
    options = ["--threads", "2", "--executor", "processes", "--scheduler", "tcp://x", "--force"]
    assert main(["resume", str(tmp_path), *options], simulate=study, finish=report) == 0
    ends = [main(["resume", str(tmp_path), "-q"], simulate=study, finish=report) for _ in range(2)]
    assert ends == [1, 1]
    assert capsys.readouterr().err.endswith("lgvi-warp: all failed\n")
    (place, plain), (_, named), *_ = study.calls
    common = {"executor": "threads", "threads": None, "scheduler": None, "progress": None, "force": False}
    assert place == (tmp_path,)
    assert plain == common
    assert named.pop("progress") is not None
    assert named == {"executor": "processes", "threads": 2, "scheduler": "tcp://x", "force": True}
    assert [given[:3] for given in report.calls] == [(result, tmp_path / "there", [])] * 2 + [
        (result, tmp_path / "there", ["all failed"]), (failed, tmp_path / "there", [])]  # fmt: skip


def test_arguments_of_predict(tmp_path, capsys):
    study = Study(SimpleNamespace(seconds=3.0, members=4))
    options = f"--threads 2 --store zarr --store-dtype float32 --out {tmp_path} --members 3"
    assert main(["predict", PAPER, "-q"], study=study) == 0
    assert main(["predict", PAPER, *options.split()], study=study) == 0
    (_, plain), ((scene,), named) = study.calls
    assert plain == {"threads": None, "store": None}
    assert scene.ensemble_settings.members == 3
    assert named["threads"] == 2
    assert (named["store"].path, named["store"].dtype) == (Path(tmp_path) / "run.zarr", "float32")
    assert capsys.readouterr().out == f"{study.result}\n"
