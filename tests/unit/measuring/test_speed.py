# SPDX-License-Identifier: Apache-2.0
"""What is told of a kernel's speed, from times that are given here."""

import json
from types import SimpleNamespace
from unittest import mock

import lgvi_warp as lw
from lgvi_warp.measuring import speed


def test_times_are_by_vehicle_and_step():
    """400 vehicles of 50 steps in 0.4 ms are 20 ns a vehicle and step, next to the peak of the same precision."""
    asked = []
    prepare = lambda plan: asked.append((plan.ensemble.members, plan.grid.steps, plan.dtype))  # noqa: E731
    peak = {"float64": 50e9, "float32": 100e9}.get
    lines = speed.measure(400, 50, prepare=prepare, timed=lambda calls: [4e-4 for _ in calls], peak_of=peak)
    found = [json.loads(line) for line in lines]
    assert asked == [(400, 50, "float64"), (400, 50, "float32")]
    assert [(one["dtype"], one["ns_per_vehicle_step"], one["peak_gfma"]) for one in found] == [
        ("float64", 20.0, 50.0), ("float32", 20.0, 100.0)
    ]  # fmt: skip


def test_readings_are_medians_in_turn():
    """Each call is made once before it counts; then all take turns, and of each the median time is told."""
    calls = []
    now, lengths = 0.0, {"a": iter([9.0, 1.0, 5.0, 2.0]), "b": iter([9.0, 30.0, 10.0, 20.0])}

    def call(name):
        nonlocal now
        calls.append(name)
        now += next(lengths[name])

    readings = speed.interleaved([lambda: call("a"), lambda: call("b")], rounds=3, clock=lambda: now)
    assert readings == [2.0, 20.0]
    assert calls == ["a", "b"] * 4


def test_the_least_reading_counts_without_a_first_call():
    clock = SimpleNamespace(time=0.0)
    lengths = {"a": iter([3.0, 1.0, 2.0]), "b": iter([5.0, 6.0, 4.0])}
    calls = []

    def call(name):
        calls.append(name)
        clock.time += next(lengths[name])

    assert speed.least([lambda: call("a"), lambda: call("b")], 3, clock=lambda: clock.time) == [1.0, 4.0]
    assert calls == ["a", "b"] * 3


def test_speeds_beside_the_peak_of_the_core():
    record = speed.record(SimpleNamespace(name="psi_s", iterations=2, adaptive=False), "float64", 8, 1e-8, 5e10)
    assert record == {"method": "psi_s", "dtype": "float64", "width": 8, "ns_per_vehicle_step": 10.0,
                      "operations": 459 + 2 * (2 * 15 - 9), "peak_gfma": 50.0,
                      "part_of_peak": round(501 / 1e-8 / 10e10, 3)}  # fmt: skip
    for name, adaptive in (("rk8", True), ("psy", False)):
        other = speed.record(SimpleNamespace(name=name, iterations=None, adaptive=adaptive), "float64", 8, 1e-8, 5e10)
        assert other["operations"] is None
        assert other["part_of_peak"] is None
    assert (speed.operations("phi"), speed.operations("phi", 1)) == (269, 269 + 15 - 9)
    assert (speed.operations("psi_x", 5), speed.operations("su4(psi_x)"), speed.operations("bm4(psi_x)")) == (
        299,
        1519,
        1851,
    )
    example = speed.fleet(5, lw.terms.Drag(linear=[1.0] * 6))
    assert (example.members, example.seed) == (5, 1)
    assert [term.key for term in example.scene.terms] == ["drag"]
    assert example.vary["start.angular_velocity"].relative == 0.1
    assert example.scene.vehicle.mass == 123.8
    packets, plan = mock.Mock(), mock.Mock()
    plan.grid.steps = 100
    call = speed.stepper(plan, make=packets)
    plan.compile.assert_called_once_with()
    assert packets.call_args.args[0] is plan
    call()
    packets.return_value.advance.assert_called_once_with(0, 100)
