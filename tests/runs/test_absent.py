# SPDX-License-Identifier: Apache-2.0
"""Absent parts leave no code: asserted on the source that Warp generates; and varying compiles nothing."""

import dataclasses
import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels.laws import current
from lgvi_warp.physics import terms
from lgvi_warp.physics.given_draws import DrawLayout, GivenDraws
from lgvi_warp.runs.settle import make_plan
from tests.laws.cases import CASES
from tests.laws.test_parity import STATE, VEHICLE, scene_of
from tests.support.tools import generated, one

# What the generated source holds if a scene has this term, and only then.
MARKS = {
    "drag": r"make_E__locals__slowed", "drag matrix": r"add_three",
    "current": rf"\b{current.flow.native_func}\(", "tether": r"rest_length",
    "wrench": r"numbers_wrench", "thrusters": r"Thrusters_", "waves": r"Waves", "fins": r"Fins",
}  # fmt: skip
# Functions that some scenes need, and a bare one does not.
NOT_THERE = ("kicked", "look", "factorise", "exponential", r"(?<!sub)normals", "passage", "R_i", "back_up", "decay3",
             "to_body")  # fmt: skip
BARE = lw.Vehicle(20.0, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=20.0 * 9.8)


def source(scene, folder, method="psi_s", dtype="float64", **settings):
    """The C++ that Warp generates for a scene."""
    plan = make_plan(one(scene, **STATE), method, h=0.01, t1=0.1, dtype=dtype, **settings)
    return generated(plan, folder)


def laws_in(text):
    """Functions of law modules that the source holds."""
    return set(re.findall(r"^static \S+ (\w*(?:law|damping|flow|evolve)\w*)\(", text, re.MULTILINE))


def test_a_bare_scene_has_no_law_at_all(tmp_path):
    text = source(lw.Scene(BARE, lw.Environment(gravity=9.8)), tmp_path)
    assert laws_in(text) == set()
    for mark in NOT_THERE:
        assert not re.search(rf"^static (?!.*adj_).*{mark}\w*\(", text, re.MULTILINE), mark


@pytest.mark.slow_for("psi_x")
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_compensation_is_there_only_if_asked_for(method, tmp_path):
    scene = lw.Scene(VEHICLE, lw.Environment(gravity=9.8), terms=list(CASES["drag"].terms))
    for dtype, there in (("float64", False), ("float32", False), ("float32_compensated", True)):
        (tmp_path / dtype).mkdir()
        text = source(scene, tmp_path / dtype, method, dtype)
        for mark in ("_low", "carried", "settled", "CompensatedState"):
            assert (mark in text) == there, (mark, dtype)


@pytest.mark.slow
def test_memory_in_stages_is_there_only_where_it_is_followed(tmp_path):
    # A method that goes back in time keeps a copy of the memory; actuators without lag follow nothing.
    lagging = scene_of(CASES["thrusters"])
    held = terms.Thrusters(position=[(0.0, 0.0, 0.0)], direction=[(1.0, 0.0, 0.0)], coefficient=[5.0], command=[0.5])
    walk = "make_scheduled__locals__walk"
    cases = (("rk4", lagging, {walk}), ("rk8", lagging, {walk, "copy_memory"}), ("psi_s", lagging, {walk}),
             ("rk8", lw.Scene(VEHICLE, lw.Environment(gravity=9.8), terms=[held]), set()))  # fmt: skip
    for i, (method, scene, marks) in enumerate(cases):
        (tmp_path / str(i)).mkdir()
        text = source(scene, tmp_path / str(i), method)
        assert {mark for mark in (walk, "copy_memory") if mark in text} == marks, (method, marks)


# Functions of the kernel that a level of checks, or a fallback, brings with it.
LEVELS = {
    "solve_within": ("none", "safe", "all"), "raise_alarm": ("safe", "all"), "failures": ("safe", "all"),
    "energy_alarm": ("safe", "all"), "growth": ("safe", "all"), "look_at": ("all",), "warn": ("all",), "noted": ("all",),
}  # fmt: skip


@pytest.mark.parametrize("checks", ["none", "safe", "all"])
def test_a_level_of_checks_brings_its_code_and_no_other(checks, tmp_path):
    text = source(lw.Scene(BARE, lw.Environment(gravity=9.8)), tmp_path, checks=checks)
    for function, levels in LEVELS.items():
        there = bool(re.search(rf"^static (?!.*adj_).*{function}_\d+\(", text, re.MULTILINE))
        assert there == (checks in levels), function
    for absent in ("retried", "in_parts", "drag_back", "backward"):
        assert not re.search(rf"^static (?!.*adj_).*{absent}\w*\(", text, re.MULTILINE), absent
    assert ("NoMonitor" in text) == (checks == "none")
    assert ("warned_step" in text) == (checks == "all")


def test_steps_are_divided_only_if_asked_for(tmp_path):
    text = source(lw.Scene(BARE, lw.Environment(gravity=9.8)), tmp_path, on_failure="substep")
    assert re.search(r"^static (?!.*adj_).*retried_\d+\(", text, re.MULTILINE)
    assert "substeps" in text


def test_energy_is_not_looked_at_where_forces_create_it(tmp_path):
    wrench = list(CASES["wrench"].terms)
    text = source(lw.Scene(BARE, lw.Environment(gravity=9.8), terms=wrench), tmp_path)
    assert "energy_alarm" not in text
    assert "NoMonitor" in text


@pytest.mark.parametrize(("name", "present"), [("current harmonics", False), ("waves", True)])
def test_water_that_is_the_same_everywhere_has_no_code_for_its_slopes(name, present, tmp_path):
    text = source(lw.Scene(BARE, lw.Environment(gravity=9.8), terms=list(CASES[name].terms)), tmp_path)
    assert bool(re.search(r"^static (?!.*adj_).*slopes_in_body_\d+\(", text, re.MULTILINE)) == present
    # A force at the origin gives no torque: nothing is said of where the centre of mass is.
    assert "dry_lever" not in text


@pytest.mark.ci
@pytest.mark.parametrize("name", MARKS)
def test_a_term_adds_its_code_and_no_other(name, tmp_path):
    text = source(lw.Scene(BARE, lw.Environment(gravity=9.8), terms=list(CASES[name].terms)), tmp_path)
    for other, mark in MARKS.items():
        assert bool(re.search(mark, text)) == (other == name), other


def test_a_term_of_zeros_is_absent():
    zeros = [terms.Drag(), terms.Current(velocity=(0.0, 0.0, 0.0)), terms.Wrench(), terms.DragMatrix()]
    plain = make_plan(one(lw.Scene(VEHICLE), **STATE), h=0.01, t1=0.1)
    asked = make_plan(one(lw.Scene(VEHICLE, terms=zeros), **STATE), h=0.01, t1=0.1)
    assert asked.spec == plain.spec
    assert asked.kernel.advance is plain.kernel.advance


def test_a_grid_of_noise_is_there_only_if_asked_for(tmp_path):
    for noise_step, there in ((None, False), (0.005, True)):
        (tmp_path / str(there)).mkdir()
        noise = [
            terms.WrenchNoise(force=(1.0, 1.0, 1.0), noise_step=noise_step),
            terms.GaussMarkovCurrent(standard_deviation=(0.1, 0.1, 0.1), time_constant=2.0, noise_step=noise_step),
        ]
        text = source(lw.Scene(BARE, lw.Environment(gravity=9.8), terms=noise), tmp_path / str(there))
        assert ("StepKey" in text, "GridKey" in text, "key.draws" in text) == (not there, there, there)


def test_given_draws_are_there_only_if_asked_for(tmp_path):
    noise = [
        terms.WrenchNoise(force=(1.0, 1.0, 1.0)),
        terms.GaussMarkovCurrent(standard_deviation=(0.1, 0.1, 0.1), time_constant=2.0),
    ]
    scene = lw.Scene(BARE, lw.Environment(gravity=9.8), terms=noise)
    for given in (None, GivenDraws(DrawLayout(()), np.empty((1, 0)))):
        (tmp_path / str(given is None)).mkdir()
        plan = make_plan(one(scene, **STATE).with_given(given), "psi_s", h=0.01, t1=0.1)
        text = generated(plan, tmp_path / str(given is None))
        marks = ("GivenKey", "StepKey", "normals3")
        assert [mark in text for mark in marks] == [given is not None, given is None, given is None]


def test_a_polynomial_is_there_only_if_asked_for(tmp_path):
    plain = CASES["thrusters"].terms[0]
    numbers = {one.name: getattr(plain, one.name) for one in plain.number_fields()}
    scenes = {
        name: lw.Scene(VEHICLE, terms=[terms.Thrusters(**numbers | {"polynomial": curve})])
        for name, curve in (("none", None), ("square", (0.0, 1.0)), ("cubic", (0.0, 0.0, 1.0)))
    }
    plans = {name: make_plan(one(scene, **STATE), h=0.01, t1=0.1) for name, scene in scenes.items()}
    assert plans["none"].spec == plans["square"].spec != plans["cubic"].spec
    assert plans["none"].kernel.advance is plans["square"].kernel.advance
    for name in ("none", "cubic"):
        (tmp_path / name).mkdir()
        assert ("polynomial_curve" in source(scenes[name], tmp_path / name)) == (name == "cubic")
    assert "polynomial" not in plain.to_dict()


VARIED = {"vehicle.mass": lw.distributions.Normal(relative=0.01), "vehicle.inertia": lw.distributions.Normal(relative=0.01),
          "drag_matrix.linear": lw.distributions.Normal(relative=0.01),
          "drag_matrix.quadratic": lw.distributions.Normal(relative=0.01),
          "current.velocity": lw.distributions.Normal(std=0.1), "tether.anchor": lw.distributions.Normal(std=0.1),
          "tether.stiffness": lw.distributions.LogNormal(sigma=0.1),
          "wrench.force": lw.distributions.Normal(std=(0.1, 0.0, 0.0)),
          "thrusters.coefficient": lw.distributions.Uniform(relative=0.1),
          "thrusters.position": lw.distributions.Normal(std=0.01),
          "environment.gravity": lw.distributions.Uniform(low=9.78, high=9.83)}  # fmt: skip


def scene():
    """Several terms at once."""
    chosen = [CASES[name].terms[0] for name in ("drag matrix", "current", "tether", "wrench", "thrusters")]
    return lw.Scene(VEHICLE, lw.Environment(gravity=9.8), terms=chosen, start=lw.Start(velocity=(1.0, 0.0, 0.0)))


def test_any_parameter_varies_and_compiles_nothing():
    shared = make_plan(lw.Ensemble(scene(), 20), h=0.01, t1=0.1)
    for name, law in VARIED.items():
        varied = make_plan(lw.Ensemble(scene(), 20, 1, {name: law}), h=0.01, t1=0.1)
        assert varied.kernel.advance is shared.kernel.advance, name
    everything = make_plan(lw.Ensemble(scene(), 20, 1, VARIED), h=0.01, t1=0.1)
    assert everything.kernel.advance is shared.kernel.advance


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_s", "psi_x"])
def test_a_varied_member_is_as_if_alone_with_its_numbers(method):
    fleet = lw.Ensemble(scene(), 20, 1, VARIED)
    together = lw.solve(fleet, method, h=0.02, t1=0.4)
    p = fleet.parameters(0, 20)
    for member in (0, 7, 19):
        alone = lw.solve(fleet.subset([member]), method, h=0.02, t1=0.4)
        for name in ("position", "attitude", "velocity", "angular_velocity"):
            assert getattr(alone, name)[:, 0].tobytes() == getattr(together, name)[:, member].tobytes()
        # And as a scene that has these numbers, to round-off: diagonal matrices are told in another way.
        own = {
            term.key: type(term)(**{
                name: p[f"{term.key}.{name}"][member % len(p[f"{term.key}.{name}"])] for name in term.parameters()
            })
            for term in scene().terms
        }  # fmt: skip
        vehicle = lw.Vehicle(
            p["vehicle.mass"][member], inertia=p["vehicle.inertia"][member], added_mass=VEHICLE.added_mass,
            buoyancy=VEHICLE.buoyancy, center_of_buoyancy=VEHICLE.center_of_buoyancy,
        )  # fmt: skip
        by_hand = lw.Scene(
            vehicle, lw.Environment(gravity=p["environment.gravity"][member]), list(own.values()), scene().start
        )
        expected = lw.solve(by_hand, method, h=0.02, t1=0.4).position[-1, 0]
        np.testing.assert_allclose(together.position[-1, member], expected, atol=1e-12)


def test_unphysical_members_are_counted():
    with pytest.raises(lw.SceneError, match=r"tether.stiffness of member \d+.*unphysical \(\d+ of 50"):
        lw.Ensemble(scene(), 50, 1, {"tether.stiffness": lw.distributions.Normal(relative=2.0)})
    with pytest.raises(lw.SceneError, match=r"Did you mean 'current\.velocity'"):
        lw.Ensemble(scene(), 50, 1, {"current.velocty": lw.distributions.Normal(std=0.1)})


@pytest.mark.ci
def test_a_controller_that_is_absent_is_no_code(tmp_path):
    wanted = lw.Controller(
        period=0.1, guidance=[lw.control.SetPoint(heading=0.5)], laws=[lw.control.HeadingPID(kp=1.0)]
    )
    (fins,) = CASES["control fins"].terms
    driven = dataclasses.replace(fins, command=None, command_schedule=None, times=None)
    scenes = {"plain": lw.Scene(BARE, terms=[fins]), "steered": lw.Scene(BARE, terms=[driven], controller=wanted)}
    texts = {}
    for name, scene in scenes.items():
        (tmp_path / name).mkdir()
        texts[name] = source(scene, tmp_path / name)
    for word in ("feed", "held_command", "Measurement", "heading_error", "signals"):
        assert word not in texts["plain"], word
        assert word in texts["steered"], word
