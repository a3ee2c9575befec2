# SPDX-License-Identifier: Apache-2.0
"""One factor for all entries of a number: the same bits by a file, by the class and by functions of a user's."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.refusals import refused

START = {"velocity": [1.5, 0.0, 0.0]}
REMUS = lw.Scene.named("remus_100", start=START)
NAME = "drag_matrix.quadratic"
LAWS = {
    "uniform": ({"uniform": {"low": 0.8, "high": 1.2}}, lw.distributions.Uniform(low=0.8, high=1.2)),
    "about 1": ({"normal": {"relative": 0.1}}, lw.distributions.Normal(std=0.1)),
    "scipy": ({"gamma": {"a": 50.0, "scale": 0.02}}, {"gamma": {"a": 50.0, "scale": 0.02}}),
}


def drawn(law, key=NAME, **more):
    return lw.Ensemble(REMUS, 64, seed=3, vary={key: law}, **more).parameters(0, 64)


@pytest.mark.parametrize("sampling", ["random", "sobol", "halton"])
@pytest.mark.parametrize("name", LAWS)
def test_a_file_says_what_functions_say(name, sampling):
    table, law = LAWS[name]
    (base,) = (term.quadratic for term in REMUS.terms if term.key == "drag_matrix")
    by_functions = drawn(lw.distributions.Derived({NAME: lambda k: k * base}, k=law), sampling=sampling)[NAME]
    for factor in (table, {"law": table}):
        scene = lw.Scene.from_dict(
            REMUS.to_dict()
            | {"ensemble": {"members": 64, "seed": 3, "sampling": sampling, "vary": {NAME: {"factor": factor}}}}
        )
        by_file = lw.Ensemble.from_scene(scene)
        np.testing.assert_array_equal(by_file.parameters(0, 64)[NAME], by_functions)
        again = lw.Ensemble.from_scene(lw.Scene.from_dict(scene.to_dict()))
        np.testing.assert_array_equal(again.parameters(0, 64)[NAME], by_functions)
    assert np.ptp(by_functions[:, 0, 0]) > 0.1


def test_numbers_that_are_named_together_get_one_factor():
    law = lw.distributions.Factor(lw.distributions.LogNormal(sigma=0.2))
    found = drawn(law, "vehicle.added_mass_matrix, vehicle.buoyancy")
    k = found["vehicle.buoyancy"] / REMUS.vehicle.buoyancy
    expected = k[:, None, None] * REMUS.vehicle.added_mass_matrix
    np.testing.assert_allclose(found["vehicle.added_mass_matrix"], expected, rtol=1e-14)


@pytest.mark.parametrize(
    "law", [{}, {"rotation_normal": {"std": 0.1}}, {"uniform": {"low": [0.8, 0.9], "high": 1.2}}, 3.0]
)
def test_what_is_no_distribution_of_a_number(law):
    assert "factor" in refused(lw.distributions.Factor, law)


def test_a_factor_of_nothing_varies_nothing():
    law = lw.distributions.Factor(lw.distributions.Uniform(low=0.8, high=1.2))
    assert "varies nothing" in refused(drawn, law, "drag_matrix.linear")
