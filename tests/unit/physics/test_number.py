# SPDX-License-Identifier: Apache-2.0
"""Declared numbers: their bounds, for a scene and by member, and how they are packed where a term says nothing itself."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics.inertia import Frame

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False, kw_only=True)
class Buoys(lw.laws.Term):
    type: ClassVar[str] = "buoys"

    pull: Any = lw.laws.number((), "N", above=0.0, most=5.0)
    least_pull: Any = lw.laws.number((), "N", 2.0, above=1.0)
    anchor: Any = lw.laws.number((3,), "m", (1.0, 2.0, 3.0))
    side: Any = lw.laws.number((3,), "1", (1.0, 0.0, 0.0), axes="vector")
    knot: Any = lw.laws.number((3,), "m", (0.5, 0.0, 0.0), axes="point")


@dataclass(frozen=True, eq=False, kw_only=True)
class Row(Buoys):
    places: Any = lw.laws.number(("k",), "m", rising=True)


@pytest.mark.parametrize(("numbers", "words"), [
    ({"pull": 0.0}, "buoys.pull = 0.0 is not positive. Give numbers above 0 to 5 [N]"),
    ({"pull": 6.0}, "buoys.pull = 6.0 is out of bounds. Give numbers above 0 to 5 [N]"),
    ({"least_pull": 1.0}, "buoys.least_pull = 1.0 is out of bounds. Give numbers above 1 [N]"),
    ({"places": [0.0, 0.0]}, "buoys.places = [0.0, 0.0] is not rising. Sort the table and drop repetitions"),
])  # fmt: skip
def test_a_number_out_of_its_bounds(numbers, words):
    with pytest.raises(lw.SceneError) as error:
        Row(**{"pull": 1.0, "places": [0.0, 1.0]} | numbers)
    assert words in str(error.value)


def test_bounds_hold_for_each_member():
    numbers = {name: value[None] for name, value in Row(pull=1.0, places=[0.0, 1.0]).parameters().items()}
    numbers["pull"] = np.array([1.0, 0.0, 5.0, 5.1, np.nan])
    numbers["places"] = np.array([[0.0, 1.0], [1.0, 1.0], [2.0, 1.0], [0.0, np.inf], [-1.0, 0.0]])
    bad = Row(pull=1.0, places=[0.0, 1.0]).unphysical(numbers)
    assert bad.pop("pull").tolist() == [False, True, False, True, True]
    assert bad.pop("places").tolist() == [False, True, True, True, False]
    assert not any(mask.any() for mask in bad.values())


def context(origin):
    none = np.zeros((1, 3, 3))
    frame = Frame(TURN[None], origin[None], origin[None], np.eye(3)[None], np.ones((1, 3)), none, none)
    return lw.laws.PackingContext({}, frame, np.arange(1), 0, 0.1)


def test_numbers_are_packed_as_they_are_declared():
    term, origin = Buoys(pull=1.0), np.array([0.1, 0.2, 0.3])
    packed = term.packed({name: value[None] for name, value in term.parameters().items()}, context(origin))
    assert packed.rows is None
    assert packed.memory is None
    assert packed.work == 0
    expected = {"pull": 1.0, "least_pull": 2.0, "anchor": term.anchor, "side": TURN.T @ term.side,
                "knot": TURN.T @ (term.knot - origin)}  # fmt: skip
    assert packed.values.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_allclose(packed.values[name][0], value, rtol=1e-15)
    assert term.lanes() == (("pull", 1), ("least_pull", 1), ("anchor", 3), ("side", 3), ("knot", 3))


def test_a_number_of_another_shape_is_not_packed():
    term = Row(pull=1.0, places=[0.0, 1.0])
    assert term.lanes() is None
    with pytest.raises(NotImplementedError, match="Row must define packed"):
        term.packed({name: value[None] for name, value in term.parameters().items()}, context(np.zeros(3)))


def test_axes_that_are_not_known():
    with pytest.raises(ValueError, match=r"axes = 'body' is not known. Give 'vector', 'point' or None"):
        lw.laws.number((3,), "m", axes="body")
