# SPDX-License-Identifier: Apache-2.0
"""Readings of the machine by benchmarks: energy counters, nodes of memory, and the operations of instructions."""

import json
import os

import pytest

import lgvi_warp as lw
from benchmarks import counted
from benchmarks.arm.tally import Tally, of_one
from benchmarks.cases.energy import case as energy
from benchmarks.cases.operations import case as operations
from benchmarks.cases.threads import case as threads
from benchmarks.tables import roofline
from lgvi_warp.measuring import speed


def counter(folder, name, micro_joules, span=1_000_000):
    """A counter as Linux's powercap has it."""
    folder.mkdir(exist_ok=True)
    (folder / "name").write_text(f"{name}\n")
    (folder / "max_energy_range_uj").write_text(f"{span}\n")
    (folder / "energy_uj").write_text(f"{micro_joules}\n")


def test_joules_are_those_of_all_packages_and_counters_begin_again(tmp_path):
    counter(tmp_path / "intel-rapl:0", "package-0", 100_000)
    counter(tmp_path / "intel-rapl:1", "package-1", 900_000)
    counter(tmp_path / "intel-rapl:0:0", "core", 0)  # a part of the first
    counter(tmp_path / "intel-rapl-mmio:0", "package-0", 100_000)  # the first, another way
    meter = energy.Meter(tmp_path)

    def work():
        counter(tmp_path / "intel-rapl:0", "package-0", 350_000)
        counter(tmp_path / "intel-rapl:1", "package-1", 400_000)
        counter(tmp_path / "intel-rapl:0:0", "core", 70_000)
        counter(tmp_path / "intel-rapl-mmio:0", "package-0", 350_000)

    clock = iter([3.0, 5.0])
    joules, seconds = meter.joules(work, clock=lambda: next(clock))
    # 0.25 J, and 0.5 J past the counter's end at 1 J.
    assert joules == pytest.approx(0.75)
    assert seconds == 2.0


def test_a_processor_that_tells_no_energy_is_said_so(tmp_path):
    counter(tmp_path / "intel-rapl:0", "package-0", 0)
    (tmp_path / "intel-rapl:0" / "energy_uj").unlink()  # as for one who may not read it
    meter = energy.Meter(tmp_path)
    assert meter.packages == energy.Meter(tmp_path / "none").packages == []
    records = list(energy.run(True, meter))
    assert [one["scene"] for one in records] == ["paper", "remus_100"]
    assert {one["joules_per_vehicle_second"] for one in records} == {"not told by this processor"}


@pytest.mark.slow
def test_energy_is_what_a_run_takes_beyond_idling(tmp_path):
    """A counter that rises by 10 J in the run and by 4 J in as long a time after it, at each reading."""
    counter(tmp_path / "intel-rapl:0", "package-0", 0, span=10**9)

    class Rising(energy.Meter):
        def joules(self, call, clock=None):
            _, seconds = super().joules(call)
            self.readings = [*getattr(self, "readings", []), seconds]
            return (10.0, 4.0)[(len(self.readings) - 1) % 2], 2.0

    meter = Rising(tmp_path)
    records = list(energy.run(True, meter))
    assert len(meter.readings) == 4
    for record in records:
        assert (record["joules"], record["joules_idle"], record["seconds"]) == (10.0, 4.0, 2.0)
        assert record["joules_per_vehicle_second"] == pytest.approx(6.0 / (record["members"] * record["t1"]), rel=2e-3)


def test_cores_of_a_list():
    assert threads.cores_of("0-3,8,10-11\n") == [0, 1, 2, 3, 8, 10, 11]
    assert threads.cores_of("\n") == []


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="the system tells no cores")
def test_cores_are_taken_by_node(tmp_path):
    mine = sorted(os.sched_getaffinity(0))
    assert threads.cores_by_node(tmp_path) == [mine]
    for number, text in ((0, f"{mine[0]}"), (10, f"{mine[-1] + 1}"), (2, ",".join(map(str, mine[1:])))):
        (tmp_path / f"node{number}").mkdir()
        (tmp_path / f"node{number}" / "cpulist").write_text(f"{text}\n")
    # Node 10 has none that this process may use.
    assert threads.cores_by_node(tmp_path) == [part for part in (mine[:1], mine[1:]) if part]
    with threads.on_cores(mine[:1]):
        assert os.sched_getaffinity(0) == {mine[0]}
    assert sorted(os.sched_getaffinity(0)) == mine


def test_placements_of_threads():
    assert threads.placements([[]]) == {"free": None}
    assert threads.placements([[0, 1]]) == {"free": None, "compact": [0, 1]}
    assert threads.placements([[0, 1, 2], [4, 5]]) == {
        "free": None, "compact": [0, 1, 2, 4, 5], "spread": [0, 4, 1, 5, 2]}  # fmt: skip


@pytest.mark.parametrize(("mnemonic", "operands", "tally"), [
    ("fadd", "d0, d1, d2", Tally(1, 1, 0, 0, 1)), ("fmul", "v0.2d, v1.2d, v2.2d", Tally(2, 2, 0, 1, 0)),
    ("fmla", "v0.4s, v1.4s, v2.s[0]", Tally(8, 4, 0, 1, 0)), ("fmadd", "s0, s1, s2, s3", Tally(2, 1, 0, 0, 1)),
    ("fmla", "z0.d, p0/m, z1.d, z2.d", Tally(4, 2, 0, 1, 0)), ("fdiv", "v0.2d, v1.2d, v2.2d", Tally(0, 0, 2, 1, 0)),
    ("fsqrt", "d0, d1", Tally(0, 0, 1, 0, 1)), ("faddp", "d0, v1.2d", Tally(1, 1, 0, 0, 1)),
    ("fneg", "v0.2d, v1.2d", Tally()), ("fcmgt", "v0.2d, v1.2d, #0.0", Tally()), ("add", "x0, x1, x2", Tally()),
])  # fmt: skip
def test_operations_of_an_instruction(mnemonic, operands, tally):
    assert of_one(mnemonic, operands) == tally


def test_the_product_knows_the_operations_that_were_counted():
    rows = [one for one in json.loads(roofline.ROWS.read_text()) if one["scene"] == "paper"]
    assert {one["method"] for one in rows} == set(operations.METHODS)
    assert counted.operations(lw.Method("psi_s")) == pytest.approx(speed.OPERATIONS, rel=0.002)
    adaptive = lw.Method("rk5", rtol=1e-6, atol=1e-9)
    assert (counted.operations(adaptive), counted.operations(lw.Method("psi_s", iterations=2))) == (None, None)


def test_tallies_add_up():
    assert Tally(1, 2, 3, 4, 5).plus(Tally(1, 1, 1, 1, 1), 2) == (3, 4, 5, 6, 7)
    assert Tally(2, 4, 6, 8, 10).over(2) == (1, 2, 3, 4, 5)
