# SPDX-License-Identifier: Apache-2.0
"""Report of a kernel's speed, from given times."""

import json

from benchmarks.timing import interleaved
from lgvi_warp.measuring import speed


def test_times_are_by_vehicle_and_step():
    """400 vehicles of 50 steps in 0.4 ms are 20 ns a vehicle and step, next to the peak of the same precision."""
    asked = []
    prepare = lambda plan: asked.append((plan.ensemble.members, plan.grid.steps, plan.dtype))  # noqa: E731
    peak = {"float64": 50e9, "float32": 100e9}.get
    lines = speed.measure(400, 50, prepare=prepare, timed=lambda calls: [4e-4 for _ in calls], peak_of=peak)
    found = [json.loads(line) for line in lines]
    assert asked == [(400, 50, "float64"), (400, 50, "float32")]
    assert all(one["part_of_peak"] == round(459 / (20e-9 * 2e9 * one["peak_gfma"]), 3) for one in found)
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

    readings = interleaved([lambda: call("a"), lambda: call("b")], rounds=3, clock=lambda: now)
    assert readings == [2.0, 20.0]
    assert calls == ["a", "b"] * 4
