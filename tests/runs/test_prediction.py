# SPDX-License-Identifier: Apache-2.0
"""Predictions of `lgvi-warp predict` before a run: sizes by arithmetic, so nearly exact; time from a trial, so roughly."""

import os
import subprocess
import sys

import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.calls import predict as prediction
from lgvi_warp.calls.sizes import sizes
from lgvi_warp.engine.block import blocks
from lgvi_warp.engine.keepers.observation import observe
from lgvi_warp.engine.keepers.statistics import Gathered
from lgvi_warp.results import member_fields
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.store.block_files import BlockFiles
from lgvi_warp.store.folder import Folder
from tests.conftest import ROOT
from tests.support.refusals import says
from tests.support.stores import SETTINGS, STATISTICS, fleet, tree


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(prediction, "TRIAL_SECONDS", 0.05)
    monkeypatch.setattr(prediction, "PROBE_BYTES", 4_000_000)


@pytest.mark.ci
def test_the_disk_is_that_of_the_run(tmp_path):
    path = tmp_path / "run.zarr"
    found = lw.predict(fleet(), **SETTINGS, store=path)
    assert list(tmp_path.iterdir()) == []
    assert found.blocks == 4
    lw.solve(fleet(), **SETTINGS, store=path)
    # Apart from the digits of sizes and checksums in markers and lists of files.
    assert found.disk == pytest.approx(sum(map(len, tree(path).values())), rel=1e-3)


@pytest.mark.ci
def test_a_step_that_does_not_fit_is_said_to_be_shortened():
    found = lw.predict(fleet(), **{**SETTINGS, "h": 0.9 * SETTINGS["h"]})
    (message,) = found.messages
    assert message.startswith("step shortened from")
    assert f"note        {message}" in str(found)
    assert lw.predict(fleet(), **SETTINGS).messages == ()


@pytest.mark.ci
def test_the_memory_of_a_result_is_counted():
    plan = make_plan(fleet(), **SETTINGS)
    result = lw.solve(fleet(), **SETTINGS)
    arrays = [*result.samples.values(), result.parameters["vehicle.mass"]]
    arrays += [getattr(result, one.name) for one in member_fields.present(plan)]
    assert prediction.result_bytes(plan) == sum(x.nbytes for x in arrays)
    small, large = (prediction.memory([prediction.Sized(make_plan(fleet(n), **SETTINGS))], 1) for n in (20_000, 24_000))
    # Blocks at work are of one size in both.
    assert large - small == 4 * prediction.result_bytes(make_plan(fleet(1000), **SETTINGS))


def test_a_store_needs_no_memory_for_samples():
    store = lw.Store("run.zarr")
    runs = [[prediction.Sized(make_plan(fleet(n), **SETTINGS), store)] for n in (2000, 6000)]
    small, large = (prediction.memory(one, 1) for one in runs)
    assert large - small == 4000 * (1 + 8 + 8 + 2 + 8 + 8 + 8)


@pytest.mark.parametrize(("members", "threads", "rounds"), [(300, 4, 1), (1003, 2, 2), (20480, 4, 10), (65536, 4, 8)])
def test_costs_are_those_of_a_machine_that_keeps_its_word(monkeypatch, members, threads, rounds):
    """Blocks side by side that take 5 ms and 3 us a step: the run is as many rounds of them as its blocks are."""

    def seconds(plan, steps, chosen, threads, observed):
        assert len(chosen) <= threads
        return 0.005 + 3e-6 * steps

    monkeypatch.setattr(prediction, "_seconds", seconds)
    plan = make_plan(fleet(members), **{**SETTINGS, "t1": 3000.0, "save": lw.SaveAt(every=1.0)})
    assert prediction.costs(plan, blocks(members), threads) == pytest.approx((0.005 * rounds, 3e-6 * rounds), rel=1e-9)


@pytest.mark.slow
def test_a_run_takes_about_what_was_said():
    """Within a factor of 4 either way on a busy machine; benchmarks/tables/large.py prints the ratio."""
    settings = {**SETTINGS, "t1": 40.0}
    prediction.TRIAL_SECONDS = 0.3
    lw.solve(fleet(20000), **{**settings, "t1": 1.0})
    ratios = []
    for _ in range(3):
        found = lw.predict(fleet(20000), **settings)
        ratios.append(found.seconds / lw.solve(fleet(20000), **settings).run_seconds)
    assert 0.25 < sorted(ratios)[1] < 4.0


@pytest.mark.ci
def test_the_command(tmp_path, capsys):
    arguments = ["predict", str(ROOT / "examples" / "paper.toml"), "--members", "500", "--duration", "2",
                 "--set", "run.save_every=0.5", "--store", "zarr", "--out", str(tmp_path / "x")]  # fmt: skip
    assert cli.main(arguments) == 0
    out = capsys.readouterr().out
    assert all(word in out for word in ("500 in 2 blocks, 200 steps", "time  ", "memory  ", "disk  ", "kernel loaded"))
    assert list(tmp_path.iterdir()) == []


def test_too_little_room_is_said():
    given = dict(members=1, steps=1, blocks=1, threads=1, compile=0.0, set_up=1.0, advance=7300.0, write=10.0)
    text = str(prediction.Prediction(**given, memory=10**10, disk=10**12, free_memory=10**10, free_disk=10**11))
    says(text, "2.0 h", "100% of the memory", "Use --store zarr", "more than the disk holds")


@pytest.mark.ci
def test_statistics_without_samples_take_little(tmp_path):
    own = {"statistics": [lw.statistics.Mean("position")], "keep": "none"}
    path = tmp_path / "run.zarr"
    found = lw.predict(fleet(), **SETTINGS, **own, store=path)
    assert found.advance > 0.0
    assert lw.predict(fleet(), **SETTINGS, **own).disk < 100_000
    lw.solve(fleet(), **SETTINGS, **own, store=path)
    assert found.disk == pytest.approx(sum(map(len, tree(path).values())), rel=0.02)


@pytest.mark.ci
def test_statistics_and_kept_members_are_counted(tmp_path):
    own = {"statistics": STATISTICS, "keep": range(0, 1003, 5)}
    path = tmp_path / "run.zarr"
    with_all, without = (lw.predict(fleet(), **SETTINGS, **one, store=path) for one in (own, {"keep": "none"}))
    result = lw.solve(fleet(), **SETTINGS, **own, store=path)
    disk = sum(map(len, tree(path).values()))
    assert with_all.disk == pytest.approx(disk, rel=0.02)
    assert without.disk < 0.2 * disk
    # The trees of all parts are at least what is joined at the end, the estimates what was read from them.
    statistics = observe(fleet(), STATISTICS).statistics
    found = sizes(make_plan(fleet(), **SETTINGS), statistics)
    gathered = gathered_of(Folder(path), statistics)
    assert gathered <= found.joined <= 3 * gathered
    assert found.estimates == sum(
        one.nbytes for estimate in result.statistics.values() for one in estimate.arrays.values()
    )


def gathered_of(folder, statistics):
    """Bytes of the parts that a run has joined at its end."""
    keeper = Gathered(folder.group()["time"][:], folder.members, statistics)
    for block in folder.runs:
        keeper.merge(block, *BlockFiles(folder.path, ()).parts(block, [keeper]))
    return sum(array.nbytes for tree in keeper.trees for part in tree.parts() for array in part.values())


def test_members_that_are_kept_take_their_share_of_the_time(monkeypatch):
    monkeypatch.setattr(prediction, "costs", lambda plan, runs, threads, observed: (0.0, 1e-3))
    few, many = (lw.predict(fleet(), **SETTINGS, keep=range(n)) for n in (1, 1003))
    assert many.advance / few.advance == pytest.approx(2 * 1003 / 1004)
    assert many.disk > 3 * few.disk


MEASURED = """
import sys
import lgvi_warp as lw
from tests.support.stores import fleet
own = {"statistics": [lw.statistics.Mean("position"), lw.statistics.Quantiles("position"),
                          lw.statistics.Covariance(["position", "velocity"])]}
own |= {"keep": range(0, 2000, 2), "method": "psi_s", "h": 0.01, "t1": 3.0, "save": lw.SaveAt(every=0.01), "threads": 2}
lw.solve(fleet(64), "psi_s", h=0.01, t1=3.0, save=lw.SaveAt(every=0.01))
store = sys.argv[2] if len(sys.argv) > 2 else None
if sys.argv[1] == "predict":
    print(lw.predict(fleet(5000), **own, store=store).memory)
else:
    lw.solve(fleet(5000), **own, store=store)
    # Of this process alone: ru_maxrss would begin with what the one that started it held.
    peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
    print(int(peak.split()[1]) * 1024)
"""


@pytest.mark.slow
@pytest.mark.parametrize("where", [[], ["run.zarr"]], ids=["memory", "store"])
def test_the_memory_of_statistics_is_that_of_the_run(where, tmp_path):
    """Peaks of 400 to 500 MB, of which Python and Warp are half: within a quarter."""
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}

    def said(what):
        arguments = [sys.executable, "-c", MEASURED, what, *where]
        return int(subprocess.run(arguments, capture_output=True, text=True, check=True, env=env, cwd=tmp_path).stdout)

    assert 0.75 < said("predict") / said("run") < 1.25
