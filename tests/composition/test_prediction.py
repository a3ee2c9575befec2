"""What `lgvi-warp plan` says before a run: sizes by arithmetic, so nearly exact; time from a trial, so roughly."""

import pytest

import lgvi_warp as lw
from lgvi_warp import cli, member_fields, prediction
from lgvi_warp.solving import make_plan
from tests.conftest import ROOT
from tests.stores import SETTINGS, fleet, tree


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(prediction, "TRIAL_SECONDS", 0.05)
    monkeypatch.setattr(prediction, "PROBE_BYTES", 4_000_000)


def test_the_disk_is_that_of_the_run(tmp_path):
    path = tmp_path / "run.zarr"
    found = lw.predict(fleet(), **SETTINGS, store=path)
    assert list(tmp_path.iterdir()) == [] and found.blocks == 4
    lw.solve(fleet(), **SETTINGS, store=path)
    chunks = sum(len(data) for name, data in tree(path).items() if "/c." in name)
    # Apart from the times and steps, which belong to no block.
    assert found.disk == chunks - 2 * (31 * 8 + 4)


def test_the_memory_of_a_result_is_counted():
    plan = make_plan(fleet(), **SETTINGS)
    result = lw.solve(fleet(), **SETTINGS)
    arrays = [*result.samples.values(), result.parameters["vehicle.mass"]]
    arrays += [getattr(result, one.name) for one in member_fields.present(plan)]
    assert prediction._result_bytes(plan) == sum(x.nbytes for x in arrays)
    small, large = (prediction.memory(make_plan(fleet(n), **SETTINGS), 1, None) for n in (1000, 5000))
    assert large - small == 4 * prediction._result_bytes(make_plan(fleet(1000), **SETTINGS))


def test_a_store_needs_no_memory_for_samples():
    store = lw.Store("run.zarr")
    small, large = (prediction.memory(make_plan(fleet(n), **SETTINGS), 1, store) for n in (2000, 6000))
    assert large - small == 4000 * (1 + 8 + 8 + 2 + 8 + 8 + 8)


@pytest.mark.parametrize(("members", "threads", "rounds"), [(300, 4, 1), (1003, 2, 2), (20480, 4, 10), (65536, 4, 8)])
def test_costs_are_those_of_a_machine_that_keeps_its_word(monkeypatch, members, threads, rounds):
    """Blocks side by side that take 5 ms and 3 us a step: the run is as many rounds of them as its blocks are."""

    def seconds(plan, steps, chosen, threads, observed):
        assert len(chosen) <= threads
        return 0.005 + 3e-6 * steps

    monkeypatch.setattr(prediction, "_seconds", seconds)
    plan = make_plan(fleet(members), **{**SETTINGS, "t1": 3000.0, "save": lw.SaveAt(every=1.0)})
    assert prediction.costs(plan, threads) == pytest.approx((0.005 * rounds, 3e-6 * rounds), rel=1e-9)


@pytest.mark.slow
def test_a_run_takes_about_what_was_said():
    """Within a factor of 4 either way on a busy machine; benchmarks/large_table.py prints the ratio."""
    settings = {**SETTINGS, "t1": 40.0}
    prediction.TRIAL_SECONDS = 0.3
    lw.solve(fleet(20000), **{**settings, "t1": 1.0})
    ratios = []
    for _ in range(3):
        found = lw.predict(fleet(20000), **settings)
        ratios.append(found.seconds / lw.solve(fleet(20000), **settings).run_seconds)
    assert 0.25 < sorted(ratios)[1] < 4.0


def test_the_command(tmp_path, capsys):
    arguments = ["plan", str(ROOT / "examples" / "paper.toml"), "--members", "500", "--duration", "2",
                 "--set", "run.save_every=0.5", "--store", "zarr", "--out", str(tmp_path / "x")]  # fmt: skip
    assert cli.main(arguments) == 0
    out = capsys.readouterr().out
    assert all(word in out for word in ("500 in 2 blocks, 200 steps", "time  ", "memory  ", "disk  ", "kernel loaded"))
    assert list(tmp_path.iterdir()) == []


def test_too_little_room_is_said():
    given = dict(members=1, steps=1, blocks=1, threads=1, compile=0.0, set_up=1.0, advance=7300.0, write=10.0)
    text = str(prediction.Prediction(**given, memory=10**10, disk=10**12, free_memory=10**10, free_disk=10**11))
    assert "2.0 h" in text and "100% of the memory" in text
    assert "use --store zarr" in text and "more than the disk holds" in text


def test_statistics_without_samples_take_little(tmp_path):
    own = {"statistics": [lw.Mean("position")], "keep": "none"}
    path = tmp_path / "run.zarr"
    found = lw.predict(fleet(), **SETTINGS, **own, store=path)
    assert found.advance > 0.0 and lw.predict(fleet(), **SETTINGS, **own).disk < 100_000
    lw.solve(fleet(), **SETTINGS, **own, store=path)
    chunks = sum(len(data) for name, data in tree(path).items() if "/c." in name)
    # Apart from the times and steps again, and from the parts of statistics, which are no chunks.
    assert found.disk == chunks - 2 * (31 * 8 + 4)
