# SPDX-License-Identifier: Apache-2.0
"""Scene files drawn from the schema, right, odd and wrong: each is taken, or refused with a message."""

import warnings

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.scene.schema import schema
from tests.conftest import ROOT
from tests.support.drawn_scenes import drawn_scene

SCHEMA = schema()


def taken(content):
    """Whether a scene is taken, up to the numbers of its first members."""
    try:
        fleet = lw.Ensemble.from_scene(lw.Scene.from_dict(content))
        fleet.select(0, min(4, fleet.members))
    except lw.SceneError as error:
        assert str(error).isprintable() or "\n" in str(error)
        return False
    return True


def drawn_and_taken(count, seed):
    """Number of accepted scenes out of so many; any other error than a refusal shows."""
    found = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for i in range(count):
            content = drawn_scene(SCHEMA, np.random.default_rng([seed, i]))
            try:
                found += taken(content)
            except Exception as error:
                error.add_note(f"scene {i} of seed {seed}: {content!r:.2000}")
                raise
    return found


def test_a_drawn_scene_is_taken_or_refused():
    # Some fit, most do not.
    assert 10 < drawn_and_taken(300, 1) < 150


@pytest.mark.slow
def test_twelve_thousand_drawn_scenes():
    assert 500 < drawn_and_taken(12_000, 77) < 6_000


BODY = {"mass": 20.0, "inertia": [1.5, 4.0, 4.5]}


@pytest.mark.parametrize(("content", "key"), [
    (None, "scene"),
    ([], "scene"),
    ("vehicle", "scene"),
    ({"vehicle": {"name": "remus_100"}, "terms": [{"type": {"a": 1}}]}, "type = {'a': 1}"),
    ({"vehicle": {"name": "remus_100"}, "terms": [{"type": ["drag"]}]}, "type = ['drag']"),
    ({"vehicle": BODY, "run": {"method_options": {"tolerance": [[1]]}}}, "tolerance"),
    ({"vehicle": BODY, "run": {"method_options": {"rtol": {}, "atol": 1e-9}}}, "rtol"),
    ({"vehicle": BODY, "run": {"keep": [1.0, [2.0]]}}, "keep"),
    ({"vehicle": BODY, "controller": {"period": 0.1, "laws": [
        {"type": "policy", "file": "none.npz", "inputs": [["a"]], "outputs": ["X"]}]}}, "inputs[0]"),
])  # fmt: skip
def test_what_once_ended_in_a_traceback_is_refused_by_name(content, key):
    with pytest.raises(lw.SceneError) as caught:
        lw.Scene.from_dict(content)
    assert key in str(caught.value)


@pytest.mark.parametrize("odd", [1, True, "x", ["vehicle"], 10**400, b"x", np.zeros(3), object, {1: 2}, {"": 1}])
def test_what_is_given_in_the_place_of_a_table_or_a_name_is_refused_by_its_key(odd):
    with pytest.raises(lw.SceneError, match=r"overrides|1|names no|empty|is not a dotted key"):
        lw.Scene.load(ROOT / "examples" / "paper.toml", odd)
    for content, key in (
        ({"vehicle": BODY, "terms": [{"type": odd}]}, r"terms\[0\].type"),
        ({"vehicle": {"name": odd}}, "vehicle"),
        ({"vehicle": BODY, "events": [{"type": odd}]}, r"events\[0\].type"),
        ({"vehicle": BODY, "controller": {"period": 0.1, "laws": [{"type": odd}]}}, "laws"),
    ):
        with pytest.raises(lw.SceneError, match=key):
            lw.Scene.from_dict(content)


def test_a_path_of_bytes_is_refused_though_its_file_is_there():
    with pytest.raises(lw.SceneError, match="is not a path"):
        lw.Scene.load(bytes(ROOT / "examples" / "paper.toml"))


@pytest.mark.parametrize("large", [2**63, 2**70, -(2**70)])
@pytest.mark.parametrize(
    "distribution", [{"lognormal": {"sigma": 0.0, "median": 1}}, {"uniform": {"low": 0, "high": 1}}]
)
def test_whole_numbers_of_any_size_are_numbers(distribution, large):
    ((kind, numbers),) = distribution.items()
    last = list(numbers)[-1]
    given = {kind: numbers | {last: large} | ({"low": 2 * large} if kind == "uniform" and large < 0 else {})}
    scene = lw.Scene.from_dict({"vehicle": BODY, "ensemble": {"members": 3, "vary": {"start.position[0]": given}}})
    values = lw.Ensemble.from_scene(scene).select(0, 3).position[:, 0]
    # The same as with the number nearest to it.
    nearest = {kind: {name: float(number) for name, number in given[kind].items()}}
    same = lw.Scene.from_dict({"vehicle": BODY, "ensemble": {"members": 3, "vary": {"start.position[0]": nearest}}})
    np.testing.assert_array_equal(values, lw.Ensemble.from_scene(same).select(0, 3).position[:, 0])
