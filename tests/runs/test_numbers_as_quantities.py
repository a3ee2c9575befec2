# SPDX-License-Identifier: Apache-2.0
"""Numbers of the scene and of the start where a quantity is asked for: against what was drawn, and the normal distribution."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np
import pytest

import lgvi_warp as lw

RUN = dict(h=0.1, t1=0.5)
NAMES = ["vehicle.buoyancy", "start.position[2]", "drag_matrix.quadratic[2,2]"]


@pytest.fixture(scope="module")
def fleet():
    normal = lw.distributions.Normal(std=1.0)
    vary = {"vehicle.buoyancy": normal, "start.position[2]": normal, "drag_matrix.quadratic[2,2]": normal}
    return lw.Ensemble(lw.Scene.named("remus_100"), members=200, seed=3, vary=vary)


def drawn(fleet):
    numbers = fleet.numbers(0, fleet.members)
    return [numbers["vehicle.buoyancy"], numbers["start.position"][:, 2], numbers["drag_matrix.quadratic"][:, 2, 2]]


def of_members(result, name):
    return np.asarray(lw.gather(result, [lw.statistics.Mean(name)])[f"mean {name}"].value).ravel()[-1]


@pytest.mark.ci
@pytest.mark.parametrize("kept", ["memory", "file", "store"])
def test_means_are_those_of_what_was_drawn(fleet, tmp_path, kept):
    if kept == "store":
        lw.solve(fleet, store=tmp_path / "run.zarr", **RUN)
        result = lw.open_run(tmp_path / "run.zarr")
    else:
        result = lw.solve(fleet, save=lw.SaveAt(every=0.1), **RUN)
        if kept == "file":
            result.save(tmp_path / "run.npz")
            result = lw.Result.load(tmp_path / "run.npz")
    for name, numbers in zip(NAMES, drawn(fleet), strict=True):
        np.testing.assert_allclose(of_members(result, name), numbers.mean(), rtol=1e-12, err_msg=name)
    found = lw.uq.given_data(result, [*NAMES, "start.position[2] - depth"])
    assert set(found.factors) == {"vehicle.buoyancy", "start.position[2]", "drag_matrix.quadratic[2, 2]"}
    # After 0.5 s the vehicle has hardly moved from its depth at the start.
    expected = [*(each.mean() for each in drawn(fleet))]
    np.testing.assert_allclose(found.mean[:3], expected, rtol=1e-12, atol=1e-12)
    ends = result.position[-1][:, 2] if kept != "store" else np.asarray(result.position[-1])[:, 2]
    np.testing.assert_allclose(found.mean[3], (drawn(fleet)[1] - ends).mean(), rtol=1e-12, atol=1e-12)


@pytest.mark.ci
def test_an_estimate_and_a_probability_follow_the_normal_distribution(fleet):
    weight = lw.Scene.named("remus_100").parameters()["vehicle.buoyancy"]
    far = NormalDist(float(weight), 1.0)
    found = lw.estimate(fleet, f"vehicle.buoyancy above {weight + 1.0}", error=0.01, **RUN)
    assert found.interval[0] <= 1.0 - far.cdf(weight + 1.0) <= found.interval[1]
    rare = lw.rare_event(fleet, f"vehicle.buoyancy above {weight + 3.5}", **RUN)
    assert rare.interval[0] <= 1.0 - far.cdf(weight + 3.5) <= rare.interval[1]


@pytest.mark.ci
def test_a_derivative_by_itself_is_one(fleet):
    found = lw.derivatives(fleet.subset(np.arange(8)), ["vehicle.buoyancy"], by=["vehicle.buoyancy"], **RUN)
    np.testing.assert_allclose(found.jacobian, 1.0, rtol=1e-9)


@pytest.mark.ci
def test_a_set_point_is_taken_from_a_depth():
    scene = lw.Scene.load("example:remus_100_autopilot")
    fleet = lw.Ensemble(scene, members=20, vary={"set_point.depth": lw.distributions.Uniform(5.0, 8.0)})
    result = lw.solve(fleet, t1=0.5)
    found = lw.uq.given_data(result, "depth - set_point.depth")
    depth = result.samples["position"][-1][:, 2]
    np.testing.assert_allclose(found.mean, (depth - fleet.numbers(0, 20)["set_point.depth"]).mean(), rtol=1e-12)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("of", "words"),
    [
        ("vehicle.buoyanci", ["not a number of this scene", "vehicle.buoyancy"]),
        ("control_fins.position", ["not a single number", "(2, 3)", "control_fins.position[0,0]"]),
        ("drag_matrix.linear[6,0]", ["not a single number", "drag_matrix.linear[5,5]"]),
        ("vehicle.buoyancy[0]", ["not a single number", "Give 'vehicle.buoyancy'"]),
        ("start.velocity[0]", ["does not vary"]),
        ("controller.sensors[0].bias", ["names a part by its place"]),
        ("depth - vehicle.buoyancy", ["[m]", "[N]", "one unit"]),
        ("vehicle.buoyancy - environment.gravity", ["[N]", "[m/s2]"]),
        ("horizontal(velocity)", ["not a vector in inertial axes", "velocity_inertial"]),
    ],
)
def test_what_names_no_number_is_told_with_the_remedy(fleet, of, words):
    with pytest.raises(lw.SceneError) as refused:
        lw.uq.evaluate(fleet, of, **RUN)
    assert not [word for word in words if word not in str(refused.value)], refused.value


@pytest.mark.ci
def test_a_function_of_a_result_has_the_samples_that_the_user_chose(fleet):
    kept = []

    def north(result):
        kept.append(tuple(result.samples))
        return result.position[-1, :, 0]

    lw.uq.evaluate(fleet, north, save=lw.SaveAt(fields=("position",)), **RUN)
    assert set(kept) == {("position",)}
