# SPDX-License-Identifier: Apache-2.0
"""One language: each door that takes the name of a quantity reads the same expressions, and refuses with the same words."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.cli.command import main
from lgvi_warp.measuring.distance import compared_in
from lgvi_warp.physics import notation
from lgvi_warp.physics.fields import FIELDS, TABLE
from lgvi_warp.results.quantities import quantities
from lgvi_warp.statistics.paths.path import followed
from lgvi_warp.statistics.until import watch
from lgvi_warp.statistics.values.values import Values
from tests.conftest import ROOT

K, N = 7, 5
PAPER = ROOT / "examples" / "paper.toml"
# Text -> (unit, components): at each time, and over the path.
AT_EACH_TIME = {
    "position": ("m", 3), "position[2]": ("m", 1), "depth": ("m", 1), "speed": ("m/s", 1), "euler[1]": ("rad", 1),
    "position - position": ("m", 3), "depth - position[0]": ("m", 1),
    "norm(velocity) - speed": ("m/s", 1), "horizontal(position)": ("m", 1), "euler[2] - euler[0]": ("rad", 1),
    "attitude[0, 1]": ("1", 1), "norm(velocity)": ("m/s", 1), "energy": ("J", 1), "quaternion_wxyz[3]": ("1", 1),
}  # fmt: skip
OVER_PATH = {
    "max(depth)": ("m", 1), "min(position)": ("m", 3), "mean(velocity)": ("m/s", 3), "range(euler[2])": ("rad", 1),
    "max(norm(angular_velocity))": ("rad/s", 1), "norm(max(velocity))": ("m/s", 1), "max(position)[1]": ("m", 1),
    "norm(mean(norm(velocity)))": ("m/s", 1), "mean( attitude [1, 0] )": ("1", 1),
}  # fmt: skip
SAME = {
    "max(depth)": lw.statistics.PathMaximum("depth"), "min(position)": lw.statistics.PathMinimum("position"),
    "mean(velocity)": lw.statistics.PathMean("velocity"), "range(euler[2])": lw.statistics.PathRange("euler[2]"),
    "max(norm(angular_velocity))": lw.statistics.PathMaximum("norm(angular_velocity)"),
    "max(position)[1]": lw.statistics.PathMaximum("position[1]"),
}  # fmt: skip
REFUSED = {
    "deph": "is not known. Did you mean 'depth'?", "max(deph)": "is not known. Did you mean 'depth'?",
    "speed[0]": "speed has one component. Give 'speed'",
    "position[3]": "position has the components position[0], position[1], position[2]. Give one of them",
    "median(speed)": "has a function 'median' that is not known. Did you mean 'mean'?",
    "max(min(depth))": "is taken over the path twice. Keep one of max, min, mean, range",
    "max(position)[3]": "max(position) has 3 components. Give one of them from 0, or max(position) alone",
    "max(speed": 'is not a quantity. Write "position[2]", "depth", "norm(velocity)", "max(depth)" or "measured_depth - depth"',
    "max(depth) - depth": "max(depth) is taken over the whole path, and has no difference. Give a difference of quantities at",
    "depth - speed": "depth has 1 x [m] and speed has 1 x [m/s]. Give quantities of one unit and size",
    "position - depth": "position has 3 x [m] and depth has 1 x [m]. Give quantities of one unit and size",
    "depth - deph": "is not known. Did you mean 'depth'?",
    "horizontal(depth)": "has a horizontal length of what is not a vector in inertial axes. Write horizontal(",
    "horizontal(max(position))": "has a horizontal length of what is not a vector in inertial axes",
}  # fmt: skip


@pytest.fixture(scope="module")
def result(scene):
    """Samples of random states, at times that are not evenly spaced."""
    random = np.random.default_rng(3)
    samples = {name: random.normal(size=(K, N, *TABLE[name].shape)) for name in FIELDS}
    samples["attitude"] = notation.matrix_from_rotation_vector(random.normal(size=(K, N, 3)))
    none, status = np.full(N, np.nan), np.zeros(N, np.uint8)
    parameters = {name: value[None] for name, value in scene.parameters().items()}
    time = np.array([0.0, 0.1, 0.3, 0.4, 1.0, 1.5, 3.0])
    return lw.Result(time, samples, status, none, none, status, none, none, status, parameters, (), {})


def estimated(statistic, result):
    """The one estimate that a statistic gathers from the samples of a result, taken in two pieces."""
    statistic = followed(statistic)
    samples = type("Samples", (dict,), {"time": result.time, "terms": ()})(result.samples)
    x = statistic.quantity(samples, SimpleNamespace(parameters=result.parameters, count=N))
    gathers = statistic.open(result.time, N)
    for when in (slice(0, 3), slice(3, K)):
        gathers.take(Values(x[when]), when)
    (estimate,) = statistic.estimates([gathers.close()], result.time)
    return estimate


def by_hand(text, result):
    """The numbers (members, components) of an expression over the path, from NumPy."""
    v, b, R, t = result.velocity, result.position, result.attitude, result.time
    yaw = np.arctan2(R[..., 1, 0], R[..., 0, 0])
    values = {
        "max(depth)": b[..., 2].max(axis=0), "min(position)": b.min(axis=0),
        "mean(velocity)": np.trapezoid(v, t, axis=0) / 3.0, "range(euler[2])": np.ptp(yaw, axis=0),
        "max(norm(angular_velocity))": np.linalg.norm(result.angular_velocity, axis=-1).max(axis=0),
        "norm(max(velocity))": np.linalg.norm(v.max(axis=0), axis=-1), "max(position)[1]": b[..., 1].max(axis=0),
        "norm(mean(norm(velocity)))": np.trapezoid(np.linalg.norm(v, axis=-1), t, axis=0) / 3.0,
        "mean( attitude [1, 0] )": np.trapezoid(R[..., 1, 0], t, axis=0) / 3.0,
    }[text]  # fmt: skip
    return values.reshape(N, -1)


@pytest.mark.parametrize("text", [*AT_EACH_TIME, *OVER_PATH])
def test_each_door_gives_the_same_numbers(result, text):
    unit, size = (AT_EACH_TIME | OVER_PATH)[text]
    (interest,) = quantities(text)
    values = interest.values(result)
    assert values.shape == (N, size)
    assert len(interest.labels(size)) == size
    extremes, mean = (estimated(kind(text), result) for kind in (lw.statistics.Extremes, lw.statistics.Mean))
    assert extremes["maximum"][-1].tolist() == values.max(axis=0).tolist()
    assert extremes["minimum"][-1].tolist() == values.min(axis=0).tolist()
    np.testing.assert_allclose(mean.value[-1], values.mean(axis=0), rtol=1e-13, atol=1e-15)
    assert mean.unit == unit
    assert len(mean.coordinates["component"]) == size
    watched = watch(lw.Until(f"mean {text}", 1.0), (), result.time)
    assert watched.name == mean.name
    if text in AT_EACH_TIME:
        compared = compared_in(text)
        np.testing.assert_array_equal(compared.values(result)[-1], values)
        # Attitudes as a whole are compared by an angle; no entry of one is.
        assert compared.unit == unit
        assert mean.value.shape == (K, size)
    else:
        np.testing.assert_allclose(values, by_hand(text, result), rtol=1e-13, atol=1e-15)
        assert mean.time.tolist() == [3.0]
        assert mean.name == f"mean {text.replace(' ', '')}"


@pytest.mark.parametrize("text", SAME)
def test_an_expression_over_the_path_has_the_bits_of_the_statistic_of_paths(result, text):
    expression, of_path = estimated(lw.statistics.Mean(text), result), estimated(SAME[text], result)
    assert expression.arrays.keys() == of_path.arrays.keys()
    assert all(expression[name].tobytes() == of_path[name].tobytes() for name in expression.arrays)


def test_names_and_labels_of_paths(result):
    covariance = estimated(lw.statistics.Covariance("max(velocity)", stopped="left_out", confidence=0.5), result)
    assert (covariance.name, covariance.unit) == ("covariance max(velocity)", "(m/s)^2")
    assert covariance.confidence == 0.5
    assert covariance.coordinates["component"].tolist() == [f"max(velocity)[{i}]" for i in range(3)]
    settings = {"type": "covariance", "of": "max(velocity)", "stopped": "left_out", "confidence": 0.5}
    assert (
        covariance.settings
        == lw.statistics.Covariance("max(velocity)", stopped="left_out", confidence=0.5).to_dict()
        == settings
    )
    assert estimated(lw.statistics.Mean("max(depth)", name="deepest"), result).name == "deepest"


def test_only_whole_paths_count(result):
    gathers = followed(lw.statistics.Mean("max(position)[1]")).open(result.time, N)
    good = np.ones((K, N), bool)
    good[4:, 0] = False
    gathers.take(Values(np.moveaxis(result.position, 1, 2), good), slice(0, K))
    (found,) = followed(lw.statistics.Mean("max(position)[1]")).estimates([gathers.close()], result.time)
    assert found.count.tolist() == [N - 1]
    np.testing.assert_allclose(found.value, result.position[:, 1:, 1].max(axis=0).mean(), rtol=1e-14)


def said_by(door, capsys):
    """Refusal of a door, in one line."""
    if isinstance(door, list):
        assert main(door) == 2
        return capsys.readouterr().err.strip()
    with pytest.raises(lw.SceneError) as caught:
        door()
    return str(caught.value)


@pytest.mark.parametrize("text", REFUSED)
def test_each_door_refuses_with_the_same_words(scene, text, tmp_path, capsys):
    vary = {"start.position": lw.distributions.Normal(std=1.0)}
    settings = {"h": 0.02, "t1": 0.1}
    doors = {
        "statistics": lambda: lw.statistics.Mean(text),
        "a list of quantities": lambda: lw.statistics.Covariance(["depth", text]),
        "until": lambda: watch(lw.Until(f"mean {text}", 1.0), (), np.zeros(1)),
        "sensitivity": lambda: lw.uq.sobol(scene, text, vary=vary, samples=8, **settings),
        "tradeoff": lambda: lw.tradeoff(scene, ["psi_s"], of=text),
        "suggest": lambda: lw.suggest(scene, error=1e-3, of=text),
        "stability": lambda: lw.stability_map(scene, of=text),
        **{f"command {verb}": [verb, str(PAPER), "--of", text, "--out", str(tmp_path / "out")]
           for verb in ("sensitivity", "tradeoff", "stability")},
    }  # fmt: skip
    for name, door in doors.items():
        message = said_by(door, capsys)
        assert REFUSED[text] in message, name
        assert repr(text) in message, name
        assert "\n" not in message, name


def test_what_has_no_number_at_each_time_is_refused_with_a_remedy(scene, capsys):
    text = "range(norm(velocity))"
    wanted = (
        f"of = {text!r} is taken over the whole path, and errors are of a quantity at each time. Give 'norm(velocity)'"
    )
    for door in (lambda: lw.tradeoff(scene, ["psi_s"], of=text), lambda: lw.suggest(scene, error=1e-3, of=text),
                 lambda: lw.stability_map(scene, of=text), ["tradeoff", str(PAPER), "--of", text]):  # fmt: skip
        assert wanted in said_by(door, capsys)


@pytest.mark.parametrize(("make", "words"), [
    (lambda: lw.statistics.FirstPassage("max(depth)", above=1.0),
     "is of samples in time, and max(depth) is one number of each member"),
    (lambda: lw.statistics.PathMean("max(depth)"), "max(depth) is one number of each member. Ask for its mean"),
    (lambda: lw.statistics.Mean("max(depth)", at="floor"),
     "mean.at = 'floor' says when, and max(depth) has no time. Leave it out"),
    (lambda: lw.statistics.Mean(["speed", "max(depth)"]), "mean.of[1] = 'max(depth)' is taken over the whole path, and a"),
    (lambda: lw.statistics.Exceedance("max(depth)"), "max(depth) is compared with nothing. Give above=... or below=... [m]"),
    (lambda: lw.statistics.PathMaximum("depth", lw.statistics.Mean("max(depth)")), "is given already"),
])  # fmt: skip
def test_what_a_statistic_of_one_number_cannot_do(make, words, capsys):
    assert words in said_by(make, capsys)


@pytest.mark.parametrize(("statistics", "name", "words"), [
    ([lw.statistics.Mean("max(depth)")], "mean max(deph)", "Did you mean 'mean max(depth)'?"),
    ([lw.statistics.Quantiles("max(depth)")], "quantiles max(deph) 0.95", "Did you mean 'quantiles max(depth) 0.95'?"),
    ([lw.statistics.Quantiles("speed")], "wholly else", "Known: quantiles speed"),
    ([], "median depth", 'Give a mean, such as "mean depth", or statistics'),
])  # fmt: skip
def test_what_is_watched_is_one_of_the_statistics_or_a_mean(statistics, name, words, capsys):
    message = said_by(lambda: watch(lw.Until(name, 1.0), statistics, np.zeros(1)), capsys)
    assert f"until.statistic = {name!r} is not a statistic of the run. {words}" in message


def test_a_watched_name_may_have_other_spaces():
    statistic = lw.statistics.Quantiles(["attitude[0, 1]", "norm(velocity)"], (0.5,))
    for name in ("quantiles attitude[0,1],norm( velocity ) 0.5", "quantiles attitude[0, 1], norm(velocity) 0.5"):
        assert watch(lw.Until(name, 1.0), [statistic], np.zeros(1)).statistic is statistic
    mean = lw.statistics.Mean("attitude[0, 1]")
    assert watch(lw.Until("mean attitude[0,1]", 1.0), [mean], np.zeros(1)).statistic is mean


def test_the_table_of_fields_is_the_only_one():
    """No other file of the host writes the shape or the unit of an angular velocity into a table of its own."""
    pattern = re.compile(r"""["']angular_velocity["']\s*[:,]\s*\(?\s*(\(3,\)|["']rad[ /])""")
    files = [file for file in (ROOT / "lgvi_warp").rglob("*.py") if "reference" not in file.parts]
    assert [file.name for file in files if pattern.search(file.read_text())] == ["fields.py"]
    assert TABLE["angular_velocity"].attributes == {"units": "rad s-1", "long_name": "angular velocity in body axes"}
    assert (TABLE["attitude"].labels[5], TABLE["energy"].labels) == ("attitude[1, 2]", ("energy",))
