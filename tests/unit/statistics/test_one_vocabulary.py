# SPDX-License-Identifier: Apache-2.0
"""One vocabulary for quantities: what one door knows, all do, by the same words and with the same numbers."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.measuring.distance import QUANTITIES, compared_in
from lgvi_warp.physics import notation
from lgvi_warp.results.quantities import quantities
from lgvi_warp.statistics.base import Statistic
from lgvi_warp.statistics.values.functional import functional, quantity
from lgvi_warp.statistics.values.quantity import KNOWN
from tests.support.refusals import refused, says

K, N = 4, 3
AT_EACH_TIME = [*KNOWN, "position[2]", "attitude[0,1]", "attitude[0, 1]", "norm(velocity)", "norm(position)",
                "euler[2]"]  # fmt: skip
OVER_PATH = ["max(depth)", "range(position)", "norm(max(velocity))", "max(norm(velocity))", "max(position)[2]",
             "mean(energy)"]  # fmt: skip
UNKNOWN = ["deph", "position[3]", "attitude[0]", "median(speed)", "speed[0]", "max(speed", "norm()", "", "a b"]


@pytest.fixture(scope="module")
def result(scene):
    """Made-up samples, as a run has them."""
    random = np.random.default_rng(1)
    R = notation.matrix_from_rotation_vector(random.normal(size=(K, N, 3)))
    samples = {"position": random.normal(size=(K, N, 3)), "attitude": R, "velocity": random.normal(size=(K, N, 3)),
               "angular_velocity": random.normal(size=(K, N, 3))}  # fmt: skip
    none = np.full(N, np.nan)
    status = np.zeros(N, np.uint8)
    parameters = {name: value[None] for name, value in scene.parameters().items()} | {"floor.depth": np.full(1, 9.0)}
    made_of = {"scene": {"events": [{"type": "floor", "depth": 9.0}]}}
    return lw.Result(
        np.arange(float(K)), samples, status, none, none, status, none, none, status, parameters, (), made_of
    )


def other(result, change):
    """The same with its samples changed."""
    import dataclasses

    return dataclasses.replace(result, samples={**result.samples, **change})


@pytest.mark.parametrize("text", AT_EACH_TIME)
def test_every_door_knows_what_has_a_number_at_each_time(result, text):
    assert lw.statistics.Mean(text).quantity.size == functional("of", text).size
    (at_end,) = quantities(text)
    assert at_end.values(result).shape == (N, functional("of", text).size)
    asked = compared_in(text)
    assert asked.distance(result, result).shape == (K, N)
    assert not asked.distance(result, result).any()
    assert asked.name == text.replace(" ", "")
    assert asked.unit


@pytest.mark.parametrize("text", OVER_PATH)
def test_what_looks_over_the_path(result, text):
    (found,) = quantities(text)
    assert found.over_path
    assert len(found.values(result)) == N
    message = refused(compared_in, text)
    says(message, "is taken over the whole path", "largest error over the path")
    assert lw.statistics.Mean(text).key == f"mean {text}"


@pytest.mark.parametrize("text", UNKNOWN)
def test_what_is_not_known_is_known_nowhere(text):
    for make in (compared_in, quantities, lw.statistics.Mean, lambda of: functional("of", of)):
        message = refused(make, text)
        assert "of = " in message
        assert "Give" in message or "Write" in message or "Did you" in message or "Known" in message


def test_statistics_and_sensitivity_have_the_same_numbers(result):
    members = SimpleNamespace(parameters=result.parameters, count=N)
    known = {"time": result.time, "terms": (), "events": (lw.events.Floor(depth=9.0),)}
    samples = type("Samples", (dict,), known)(result.samples)
    for text in AT_EACH_TIME:
        values = quantity("of", text)(samples, members)
        np.testing.assert_array_equal(quantities(text)[0].values(result), values[-1].T, err_msg=text)


def test_numbers_of_the_language(result):
    v, b = result.velocity, result.position
    speed = np.sqrt((v**2).sum(axis=-1))
    for text, exact in {
        "norm(velocity)": speed[-1:].T, "max(norm(velocity))": speed.max(axis=0)[:, None],
        "norm(max(velocity))": np.sqrt((v.max(axis=0) ** 2).sum(axis=-1))[:, None],
        "range(depth)": np.ptp(b[..., 2], axis=0)[:, None],
        "max(position)[1]": b[..., 1].max(axis=0)[:, None], "speed": speed[-1:].T,
    }.items():  # fmt: skip
        np.testing.assert_allclose(quantities(text)[0].values(result), exact, rtol=1e-15, err_msg=text)


def test_distances_of_what_is_asked(result):
    moved = other(result, {"position": result.position + np.array([3.0, 4.0, -12.0])})
    for text, exact in {
        "depth": 12.0,
        "position[2]": 12.0,
        "position": 13.0,
        "norm(position)": None,
        "speed": 0.0,
    }.items():
        apart = compared_in(text).distance(moved, result)
        exact = (
            np.linalg.norm(moved.position, axis=-1) - np.linalg.norm(result.position, axis=-1)
            if exact is None
            else exact
        )
        np.testing.assert_allclose(apart, np.abs(exact) * np.ones((K, N)), rtol=1e-13, atol=1e-13, err_msg=text)


def test_the_error_of_a_mean_is_its_bias_and_two_standard_errors(result):
    n = result.members
    shift = np.random.default_rng(3).normal(size=(n, 3))
    moved = other(result, {"position": result.position + shift})
    mean, spread = shift.mean(axis=0), 2.0 * shift.std(axis=0, ddof=1) / np.sqrt(n)
    asked = compared_in("mean position[0]")
    assert (asked.name, asked.unit, asked.mean) == ("mean position[0]", "m", True)
    apart = asked.distance(moved, result)
    np.testing.assert_allclose(apart, (abs(mean[0]) + spread[0]) * np.ones((K, N)), rtol=1e-12)
    whole = compared_in("mean position").distance(moved, result)
    np.testing.assert_allclose(whole, np.linalg.norm(np.abs(mean) + spread) * np.ones((K, N)), rtol=1e-12)
    # Members that all move alike have no spread: the bias alone is left, which no largest error of a member shows smaller.
    together = other(result, {"position": result.position + 0.5})
    np.testing.assert_allclose(asked.distance(together, result), 0.5, rtol=1e-12)
    single = lambda r: r.part(np.array([0]))  # noqa: E731
    np.testing.assert_allclose(asked.distance(single(moved), single(result)), abs(shift[0, 0]), rtol=1e-12)
    for text in ("mean attitude", "mean mean depth", "mean max(depth)", "mean nothing"):
        refused(compared_in, text)


def test_angles_go_the_short_way_round(result):
    yaw = np.deg2rad(179.9)
    there, here = (notation.matrix_from_rotation_vector(np.broadcast_to([0.0, 0.0, a], (K, N, 3))) for a in (yaw, -yaw))
    a, b = other(result, {"attitude": there}), other(result, {"attitude": here})
    for text in ("euler", "euler[2]"):
        np.testing.assert_allclose(compared_in(text).distance(a, b), np.deg2rad(0.2), rtol=1e-9)


def test_the_five_keep_their_own_distances():
    for name, unit in QUANTITIES.items():
        assert (compared_in(name).unit, compared_in(name).functional) == (unit, None)


def test_a_quantity_of_the_users_may_be_asked_for_everywhere(result):
    own = lw.statistics.Quantity(
        "sunk", lambda samples, members: samples["position"][..., 2] - members.position[None, :, 2], "m", ("position",)
    )
    sunk = result.position[..., 2] - result.position[0, :, 2]
    np.testing.assert_array_equal(quantities(own)[0].values(result)[:, 0], sunk[-1])
    asked = compared_in(own)
    assert (asked.name, asked.unit) == ("sunk", "m")
    np.testing.assert_array_equal(asked.values(result)[..., 0], sunk)
    assert lw.statistics.Mean(own).quantity is own


@pytest.mark.parametrize(("of", "labels"), [
    ("position", ("position[0]", "position[1]", "position[2]")),
    ("max(position)", ("max(position)[0]", "max(position)[1]", "max(position)[2]")),
    ("max(position)[1]", ("max(position)[1]",)), ("max(position[1])", ("max(position[1])",)),
    ("norm(velocity)", ("norm(velocity)",)), ("range(norm(velocity))", ("range(norm(velocity))",)),
])  # fmt: skip
def test_each_component_is_named_by_an_expression_for_it(of, labels):
    assert functional("of", of).labels == labels
    for label in labels:
        assert functional("of", label).labels == (label,)
        assert functional("of", label).size == 1


def test_help_describes_every_argument_of_a_statistic():
    """Arguments that a base describes stand in the docstring of each class that a user calls."""
    doors = [getattr(door, name) for door in (lw.statistics, lw.metrics) for name in door.__all__]
    kinds = [kind for kind in doors if isinstance(kind, type) and issubclass(kind, Statistic)]
    assert len(kinds) > 30
    missing = [
        f"{kind.__name__}.{argument.name}"
        for kind in kinds
        for argument in dataclasses.fields(kind)
        if f"\n    {argument.name}: " not in kind.__doc__
    ]
    assert missing == []
