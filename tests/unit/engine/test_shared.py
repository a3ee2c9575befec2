# SPDX-License-Identifier: Apache-2.0
"""The inputs of a computation decide whether its result is shared by all members."""

import copy

import numpy as np
import pytest

from lgvi_warp.engine.shared import FRAME, MEMBERS, SEED, SharedResultsCache, TrackedParameters, context
from lgvi_warp.scene.slices import AT_ONCE

NUMBERS = {"a.x": np.ones((1, 3)), "b.y": np.zeros(5)}
WAYS = {
    "an item": lambda n: n["b.y"], "get": lambda n: n.get("b.y"), "a loop": lambda n: [name for name in n],
    "keys": lambda n: list(n.keys()), "values": lambda n: list(n.values()), "items": lambda n: list(n.items()),
    "a dict": lambda n: dict(n)["b.y"], "unpacked": lambda n: {**n}["b.y"], "a copy": lambda n: n.copy()["b.y"],
    "joined": lambda n: (n | {})["b.y"], "joined from the right": lambda n: ({} | n)["b.y"],
    "a copy of the module": lambda n: copy.copy(dict(n))["b.y"],
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_every_way_to_read_is_noted(way):
    reads = TrackedParameters(NUMBERS)
    WAYS[way](reads)
    assert "b.y" in reads.names


@pytest.mark.parametrize("way", WAYS)
def test_what_varies_is_computed_each_time_and_nothing_else(way):
    shared, calls = SharedResultsCache({"b.y"}), []

    def compute(numbers):
        calls.append(1)
        WAYS[way](numbers)
        return len(calls)

    assert [shared("sum", NUMBERS, compute) for _ in range(3)] == [1, 2, 3]
    assert not shared.keeps("sum")
    kept = [shared("x", NUMBERS, lambda n: n["a.x"].sum() + len(calls)) for _ in range(2)]
    calls.append(1)
    assert kept == [6.0, 6.0] == [shared("x", NUMBERS, lambda n: 0.0)] * 2
    assert shared.keeps("x")


@pytest.mark.parametrize(("name", "field"), [(FRAME, "frame"), (MEMBERS, "members"), (SEED, "seed")])
def test_a_context_notes_what_it_is_asked_for(name, field):
    reads = TrackedParameters(NUMBERS)
    asked = context(reads, "frame", np.arange(5), 7, 0.01, True)
    assert asked.h == 0.01
    assert not reads.names
    getattr(asked, field)
    assert reads.names == {name}
    reads.names.clear()
    assert vars(asked)[field] is not None
    assert name in reads.names
    assert type(context(NUMBERS, "frame", np.arange(5), 7, 0.01, True)).__name__ == "PackingContext"


@pytest.mark.parametrize(("members", "remembers"), [(1, True), (AT_ONCE, True), (AT_ONCE + 1, False)])
def test_what_follows_from_members_of_a_block_is_remembered(members, remembers):
    shared, mass = SharedResultsCache({"vehicle.mass", MEMBERS}), np.ones(members)
    numbers = {"vehicle.mass": mass, "vehicle.buoyancy": np.ones(1)}
    assert shared.completed(numbers) is None
    with_frame = numbers | {FRAME: "frame", MEMBERS: np.arange(members)}
    shared.remember(numbers, with_frame)
    assert shared.completed(dict(numbers)) is (with_frame if remembers else None)
    assert shared.completed(numbers | {"vehicle.mass": mass.copy()}) is None
    calls = []

    def total(numbers):
        calls.append(numbers["vehicle.mass"])
        return numbers["vehicle.mass"].sum() + len(calls)

    # Once for the members that are remembered, and each time for others and for what is keyed by members.
    once = [shared("total", with_frame, total) for _ in range(3)]
    assert once == [members + 1.0] * 3 if remembers else [members + 1.0, members + 2.0, members + 3.0]
    assert shared("total", dict(numbers), total) == members + len(calls)
    of_members = [shared("of members", with_frame, lambda n: total(n) + n[MEMBERS][0]) for _ in range(2)]
    assert of_members[1] == of_members[0] + 1
    shared.remember({"vehicle.mass": 2.0 * mass}, {"vehicle.mass": 2.0 * mass})
    assert shared.completed(numbers) is None
