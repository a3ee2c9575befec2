# SPDX-License-Identifier: Apache-2.0
"""The method that a run takes for which no one names one: by what acts, by the step, and told."""

import dataclasses
import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.cli import main
from lgvi_warp.cli.report import members_line
from lgvi_warp.methods import limits
from lgvi_warp.reference.terms import View
from lgvi_warp.results.provenance import messages, provenance
from lgvi_warp.runs import default_method, step_error
from lgvi_warp.runs.measured_error import measured_error
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.settings import RunSettings
from lgvi_warp.store.create import create
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.solve import request_of
from tests.laws.cases import CASES

DRAG = lw.terms.Drag(linear=[5.0, 10.0, 10.0, 0.5, 2.0, 2.0])
MATRIX = lw.terms.DragMatrix(linear=np.diag(DRAG.linear))
AHEAD = lw.Start(position=[0.0, 0.0, 10.0], velocity=[1.5, 0.0, 0.0])
REMUS = lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, start={"velocity": [1.5, 0.0, 0.0]})


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def derivative(law, nu):
    """The wrench of a law's damping, derived by the velocity (6, 6)."""

    def wrench(nu):
        return law.damping(View(np.eye(3), np.zeros(3), nu[:3], nu[3:], memory=law.start())) @ nu

    return np.array([(wrench(nu + 1e-6 * e) - wrench(nu - 1e-6 * e)) / 2e-6 for e in np.eye(6)]).T


def torpedo(*terms, run=None, start=AHEAD):
    named = lw.Scene.named("torpedo")
    return dataclasses.replace(named, terms=list(terms), start=start, run=run or RunSettings())


def planned(scene, h=0.1, **settings):
    return make_plan(lw.Ensemble(scene, 2), h=h, t1=10.0 * h, **settings)


def chosen(*terms, h=0.1, start=AHEAD, **settings):
    return planned(torpedo(*terms, start=start), h, **settings).method.name


def test_remus_takes_runge_kutta_methods_by_its_step():
    steps = {"rk4": (0.01, 0.05, 0.1), "rk8": (0.2, 0.25, 0.4, 0.5, 0.75), "rkw3": (5.0,)}
    for name, those in steps.items():
        assert {planned(REMUS, h).method.name for h in those} == {name}


def test_what_is_not_damped_keeps_its_method_and_bits(scene):
    """Whatever drives it, and where a term brakes by nothing; psi_x where the inertia refuses psi_s."""
    assert chosen() == chosen(lw.terms.Wrench(force=[1.0, 0.0, 0.0])) == chosen(lw.terms.Drag()) == "psi_s"
    assert chosen(lw.terms.BodyLift(matrix=0.1 * np.ones((6, 6)))) == "psi_s"
    coupled = dataclasses.replace(lw.Scene.named("remus_100"), terms=[])
    assert planned(coupled).method.name == "psi_x"
    bare = dataclasses.replace(scene, run=RunSettings())
    a, b = (lw.solve(lw.Ensemble(bare, 2), method, h=0.1, t1=1.0) for method in (None, "psi_s"))
    assert all(np.array_equal(a.samples[name], b.samples[name]) for name in a.samples)


def test_what_runge_kutta_methods_do_not_take():
    noise = lw.terms.GaussMarkovCurrent(standard_deviation=[0.1, 0.1, 0.0], time_constant=20.0)
    assert chosen(DRAG, noise) == chosen(DRAG, dtype="float32_compensated") == "psi_x"
    assert chosen(DRAG, on_failure="substep") == "psi_s"
    spinning = dataclasses.replace(AHEAD, angular_velocity=[8.0, 0.0, 0.0])
    assert [chosen(DRAG, start=spinning, h=h) for h in (0.01, 0.1, 0.2, 0.5)] == ["rk4", "rk8", "rk8", "psi_s"]


@pytest.mark.parametrize(("strength", "name"), [(1.0, "rk4"), (1e3, "rkw3"), (1e6, "psi_x")])
def test_strong_damping(strength, name):
    assert chosen(lw.terms.DragMatrix(linear=strength * MATRIX.linear)) == name


def test_a_law_that_does_not_tell_how_it_brakes_is_advanced_implicitly(monkeypatch):
    assert chosen(MATRIX) == "rk4"
    monkeypatch.setattr(lw.terms.DragMatrix, "braking", lw.laws.Term.braking)
    assert chosen(MATRIX) == "rkw3"


def test_what_is_named_is_never_changed():
    assert planned(torpedo(DRAG, run=RunSettings(method="psi"))).method == lw.Method("psi")
    assert planned(torpedo(DRAG), method="psi_x").method == lw.Method("psi_x")
    # Options of a method are those of psi_s, as before.
    assert planned(torpedo(DRAG, run=RunSettings(solver="newton"))).method == lw.Method("psi_s", "newton")
    assert not planned(torpedo(DRAG), method="psi_x").method.reason


def test_psi_s_and_psi_x_bear_oscillations_no_longer():
    """So no oscillation that they resolve forbids the other methods."""
    for table in (limits.MUNK, limits.RESTORING):
        assert max(table[name] for name in default_method.OTHERWISE) < min(
            table[name] for name in default_method.DAMPED
        )


LIFTING = ("fins", "control fins", "control fins with rates", "cross-flow", "body lift")
DRAGS = ("linear drag", "quadratic drag", "drag", "drag matrix")


@pytest.mark.parametrize("name", LIFTING)
def test_braking_bounds_the_twin(name, rng):
    """Largest rate of the wrench's derivative by the velocity: never above that of `braking`."""
    (term,), (law,) = CASES[name].terms, CASES[name].laws
    numbers = {key: np.asarray(value)[None] for key, value in term.parameters().items()}
    density = np.array([getattr(law, "density", 1000.0)])
    inertia = np.diag([30.0, 65.0, 65.0, 0.3, 8.0, 8.0])

    def rate(matrix):
        return np.abs(np.linalg.eigvals(np.linalg.solve(inertia, matrix))).max()

    for nu in rng.normal(size=(20, 6)) * [1.0, 0.2, 0.2, 0.2, 0.2, 0.2]:
        bound = rate(term.braking(numbers, np.abs(nu)[None], density)[0])
        assert rate(derivative(law, nu)) <= bound * (1.0 + 1e-6)


@pytest.mark.parametrize("name", [*LIFTING, *DRAGS, "polar"])
def test_braking_takes_numbers_that_vary_alone(name):
    """One number of three members, all others shared: as if all were given for each member."""
    (term,) = CASES[name].terms
    shared = {key: np.asarray(value)[None] for key, value in term.parameters().items()}
    speeds, density = np.arange(1.0, 19.0).reshape(3, 6), np.full(1, 1025.0)
    for key, value in shared.items():
        numbers = shared | {key: value * np.array([1.0, 1.01, 1.02]).reshape(3, *(1,) * (value.ndim - 1))}
        every = {each: np.broadcast_to(values, (3, *values.shape[1:])) for each, values in numbers.items()}
        np.testing.assert_array_equal(
            term.braking(numbers, speeds, density), term.braking(every, speeds, np.full(3, 1025.0))
        )


@pytest.mark.parametrize("name", [*DRAGS, "polar"])
def test_braking_of_drag_is_the_derivative(name, rng):
    (term,), (law,) = CASES[name].terms, CASES[name].laws
    numbers = {key: np.asarray(value)[None] for key, value in term.parameters().items()}
    for nu in rng.uniform(0.1, 1.0, (5, 6)):
        here = term.braking(numbers, nu[None], np.ones(1))[0]
        assert np.allclose(here, derivative(law, nu), rtol=0.0, atol=1e-6)


def test_terminal_speeds_balance(rng):
    force, linear, quadratic = rng.uniform(0.0, 5.0, (3, 4, 6))
    linear[0], quadratic[1] = 0.0, 0.0
    speed = step_error.terminal_speeds(force, linear, quadratic)
    assert np.allclose(linear * speed + quadratic * speed**2, force, rtol=1e-12)
    assert not step_error.terminal_speeds(force, 0.0 * linear, 0.0 * quadratic).any()


def test_a_drive_brings_speed_where_a_start_has_none():
    """From rest quadratic drag has no rate; under thrust it has."""
    drag = lw.terms.Drag(quadratic=[5.0, 5.0, 5.0, 1.0, 1.0, 1.0])
    rest = lw.Start(position=[0.0, 0.0, 10.0])
    pushed = [chosen(drag, lw.terms.Wrench(force=[x, 0.0, 0.0]), start=rest, h=1.0) for x in (1.0, 100.0, 1000.0)]
    assert pushed == ["rk4", "rk8", "rkw3"]


def test_it_is_told_and_kept(tmp_path):
    plan = planned(torpedo(DRAG))
    told = provenance(plan)
    assert told["method"]["name"] == "rk4"
    assert "method" not in told["scene"]["run"]
    assert members_line(2, told).endswith("\nmethod      rk4, chosen since the scene is damped")
    assert "chosen" not in provenance(planned(torpedo(DRAG), method="rk4"))["method"]
    create(lw.Store(tmp_path / "run.zarr"), plan, told, messages(plan))
    folder = Folder(tmp_path / "run.zarr")
    again = request_of(folder).plan()
    assert again.method == plan.method
    assert again.method.reason == plan.method.reason
    # A store from before has no reason in its recipe.
    del folder.recipe["method"]["reason"]
    assert request_of(folder).plan().method == lw.Method("rk4")


@pytest.mark.ci
def test_a_prepared_run_chooses_once():
    """Also for members that would choose another method by themselves."""
    slow, fast = (
        dataclasses.replace(AHEAD, velocity=[0.5, 0.1, 0.0], angular_velocity=[x, 0.0, 0.0]) for x in (0.1, 20.0)
    )
    run = lw.prepare(torpedo(MATRIX, start=slow), ["start.angular_velocity[0]"], of="position[1]", h=0.1, t1=0.5)
    assert planned(torpedo(MATRIX, start=fast)).method.name == "rk8"
    expected = lw.solve(torpedo(MATRIX, start=fast), "rk4", h=0.1, t1=0.5).position[-1, 0, 1]
    assert run([[20.0]]) == expected != run([[1.0]])


def test_drag_beyond_float64_leaves_what_is_stable_for_any():
    fins = lw.Scene.named("remus_100").terms[1].to_dict()
    scene = lw.Scene.named("remus_100", terms=[fins | {"drag": [0.0, 1e308]}])
    assert step_error.rates(lw.Ensemble.from_scene(scene)).drag == np.inf
    assert next(default_method.choices(lw.Ensemble.from_scene(scene), 0.01)).name in default_method.OTHERWISE


# Errors of steps


def turning_remus(angular_velocity=(0.0, 0.0, 0.0)):
    """REMUS 100 under way with its rudder at 4 degrees, four members a little apart."""
    zero, n = np.zeros((4, 3)), 4
    held = {"control_fins.command": np.full((n, 2), [np.radians(4.0), 0.0])}
    rate = np.asarray(angular_velocity) + 0.05 * np.random.default_rng(0).normal(size=(n, 3))
    level, nu = np.tile(np.eye(3), (n, 1, 1)), np.tile([1.5, 0.0, 0.0], (n, 1))
    return lw.Ensemble.from_states(REMUS, zero, level, nu, rate, held), 30.0


def driven_bluerov():
    """A BlueROV2 whose thrusters push unevenly."""
    states = np.tile([0.0, 0.0, 10.0], (4, 1)), np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3)), np.full((4, 3), 0.2)
    command = np.tile([0.4, 0.5, 0.45, 0.4, 0.1, 0.1, 0.1, 0.1], (4, 1))
    return lw.Ensemble.from_states(lw.Scene.named("bluerov2_heavy"), *states, {"thrusters.command": command}), 10.0


def spinning_bluerov():
    """A BlueROV2 whose thrusters turn it: at 0.5 s its damping is 6 % below the limit of rk8, and rkw3 is off by the path."""
    states = np.tile([0.0, 0.0, 50.0], (4, 1)), np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3)), np.zeros((4, 3))
    start = np.random.default_rng(3).normal(0.0, 0.05, (2, 4, 3))
    command = np.tile([0.6, -0.6, 0.6, -0.6, 0.2, 0.2, -0.1, 0.2], (4, 1))
    nu = [0.1, 0.0, 0.0], [0.0, 0.0, 0.2]
    states = *states[:2], *(rest + away + by for rest, away, by in zip(states[2:], nu, start, strict=True))
    return lw.Ensemble.from_states(lw.Scene.named("bluerov2_heavy"), *states, {"thrusters.command": command}), 10.0


def torpedo_in_a_turn():
    push = lw.terms.Wrench(force=[8.0, 0.0, 0.0], torque=[0.0, 0.0, 0.5])
    drag = lw.terms.Drag(linear=[1.0, 4.0, 4.0, 0.2, 1.0, 1.0], quadratic=[2.0, 15.0, 15.0, 0.5, 3.0, 3.0])
    vary = {
        "start.velocity": lw.distributions.Normal(std=0.1),
        "start.angular_velocity": lw.distributions.Normal(std=0.1),
    }
    return lw.Ensemble(torpedo(drag, push), 4, 1, vary), 20.0


FLEETS = {"REMUS": turning_remus, "REMUS that rolls": lambda: turning_remus((0.1, 0.2, 0.3)),
          "BlueROV2": driven_bluerov, "torpedo": torpedo_in_a_turn}  # fmt: skip


def length_of(result):
    """The length of each member's path (n,) [m], by its samples."""
    return np.linalg.norm(np.diff(result.position, axis=0), axis=2).sum(axis=0)


def measured(fleet, t1, method, steps):
    """Largest error in position over the length of the path, for each number of steps; the truth: rk8 at steps of 1/160 s."""
    save = lw.SaveAt(every=t1 / 4)
    truth = lw.solve(fleet, "rk8", h=1.0 / 160.0, t1=t1, save=save)
    path = length_of(truth)
    errors = []
    for n in steps:
        result = lw.solve(fleet, method, h=t1 / n, t1=t1, save=save)
        with np.errstate(all="ignore"):
            apart = np.linalg.norm(result.position - truth.position, axis=2).max(axis=0) / path
        errors.append(float(np.where(np.isfinite(apart), apart, np.inf).max()))
    return errors


@pytest.mark.kernel
@pytest.mark.slow
@pytest.mark.parametrize("name", FLEETS)
def test_the_method_is_chosen_by_its_error_at_the_step(name):
    """A method off by little, or no more than twice as far as the best.

    The estimate is right to a factor of five: told is a step that is off by more than five times 1 % of the path, and none
    that is off by less than a fifth of it.
    """
    fleet, t1 = FLEETS[name]()
    counts = [4 * round(t1 / h / 4) for h in (0.5, 0.375, 0.25, 0.15, 0.1, 0.05)]
    errors = {method: measured(fleet, t1, method, counts) for method in ("rk4", "rk8", "rkw3")}
    length = length_of(lw.solve(fleet, "rk8", h=1.0 / 160.0, t1=t1, save=lw.SaveAt(every=t1 / 4))).max()
    for i, n in enumerate(counts):
        plan = make_plan(fleet, h=t1 / n, t1=t1)
        own, best = errors[plan.method.name][i], min(errors[method][i] for method in errors)
        told = any("off by more than 1 % of the path" in text for text in plan.grid.messages)
        assert own <= 0.05 or own <= 2.0 * best or told, (n, plan.method.name, own, best)
        assert own * length <= 0.3 or own <= 20.0 * best, (n, plan.method.name, own * length, best * length)
        if own > 0.05:
            assert told, (n, plan.method.name, own)
        if own < 0.002:
            assert not told, (n, plan.method.name, own)


@pytest.mark.slow
@pytest.mark.kernel
def test_remus_in_a_turn_is_not_off_by_metres():
    fleet, t1 = FLEETS["REMUS that rolls"]()
    plan = make_plan(fleet, h=0.375, t1=t1)
    (lost, kept) = (measured(fleet, t1, method, [80])[0] for method in ("rk4", "rk8"))
    assert lost > 0.1
    assert kept < 1e-3
    assert plan.method.name == "rk8"


STEPS = (0.5, 0.375, 0.25, 0.2, 0.15, 0.1, 0.05, 0.02)


@pytest.mark.parametrize("name", [*FLEETS, *lw.vehicles.names()])
def test_the_choice_is_off_by_a_thousandth_of_the_path_or_least(name):
    """By the estimate, of all steps; cheaper methods go before those that are off by less."""
    start = {"position": [0.0, 0.0, 20.0], "velocity": [1.0, 0.1, 0.0]}
    fleet = FLEETS[name]()[0] if name in FLEETS else lw.Ensemble(lw.Scene.named(name, start=start), 4, 1)
    found = step_error.rates(fleet)
    for h in STEPS if default_method.is_damped(fleet) else ():
        numbers = default_method.h_rates(found, h)
        errors = {
            method: step_error.path_error(lw.Method(method), found, h, 30.0)
            for method in default_method.DAMPED
            if default_method.stable(lw.Method(method), numbers)
        }
        good = [method for method in errors if errors[method] <= 0.001]
        taken = make_plan(fleet, h=h, t1=30.0 * h).method.name
        if good:
            assert taken == good[0], (h, errors)
        elif taken in errors:
            assert errors[taken] == min(errors.values()), (h, errors)


@pytest.mark.ci
@pytest.mark.kernel
def test_remus_in_a_turn_is_off_by_millimetres_at_a_coarse_step():
    """At 0.25 s rk4 is off by more than a quarter of a metre of 40 m, rk8 by less than 1 mm."""
    fleet, t1 = turning_remus()
    plan = make_plan(fleet, h=0.25, t1=t1)
    (taken,), (cheap,) = (measured(fleet, t1, method, [120]) for method in (plan.method.name, "rk4"))
    assert plan.method.name == "rk8"
    assert taken < 1e-4
    assert cheap > 20.0 * taken


REMUS_IN_A_CURRENT = """
[vehicle]
name = "remus_100"
[start]
position = [0, 0, 20.0]
velocity = [1.5, 0, 0]
[[terms]]
type = "current"
velocity = [0, 0.3, 0]
[run]
step = 0.5
duration = 30.0
"""


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("h", [0.5, 0.375, 0.3, 0.25, 0.05])
def test_check_and_a_run_state_the_error_that_a_run_has(h, tmp_path, capsys):
    """Near the limit of rk8 the rates at the start tell a thousandth of it; far from it a run measures nothing."""
    file, command = tmp_path / "turn.toml", {"control_fins.command": [0.0698, 0.0]}
    file.write_text(REMUS_IN_A_CURRENT)
    fleet = lw.Ensemble.from_scene(lw.Scene.load(file, command))
    steps = round(30.0 / h)
    (true,) = measured(fleet, 30.0, make_plan(fleet, h=h, t1=30.0).method.name, [steps])
    assert main(["check", str(file), "--set", "control_fins.command=[0.0698,0.0]", "--step", str(h)]) == 0
    stated = float(re.search(r"off by about (\S+) % of the path in 30 s", capsys.readouterr().out)[1]) / 100.0
    assert stated == pytest.approx(true, rel=0.6)
    told = lw.solve(fleet, h=h, t1=30.0).messages
    assert [text.startswith(f"step h = {h:g} s: rk8 is off by about ") for text in told] == [True] * (true > 0.001)
    assert lw.solve(fleet, "rk8", h=h, t1=30.0).messages == ()


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("step", [{}, {"noise_step": 0.5}])
def test_the_path_of_noise_is_no_error(step):
    """Half the step draws other noise: the difference is not taken for an error."""
    noise = lw.terms.WrenchNoise(force=[1.0] * 3, torque=[0.1] * 3, **step)
    scene = lw.Scene.named(
        "remus_100", start={"position": [0.0, 0.0, 20.0], "velocity": [1.5, 0.0, 0.0]}, terms=[noise]
    )
    assert measured_error(make_plan(lw.Ensemble(scene, 4), h=0.5, t1=5.0)) is None
    assert lw.solve(lw.Ensemble(scene, 4), h=0.5, t1=5.0).messages == ()


@pytest.mark.ci
@pytest.mark.kernel
def test_an_error_is_measured_in_a_bounded_number_of_steps():
    fleet, _ = turning_remus()
    assert measured_error(make_plan(fleet, h=0.25, t1=500.0), 2000)[1] == 166.5
    first = lw.solve(fleet, h=0.25, t1=1.0)
    assert measured_error(make_plan(fleet.going_on(first.final), h=0.25, t1=2.0)) is None


@pytest.mark.ci
@pytest.mark.kernel
def test_check_says_what_the_choice_costs(tmp_path, capsys):
    file = tmp_path / "scene.toml"
    file.write_text('[vehicle]\nname = "remus_100"\n[start]\nposition = [0, 0, 20]\nvelocity = [1.5, 0, 0]\n'
                    '[run]\nstep = 0.25\nduration = 5.0\n')  # fmt: skip
    assert main(["check", str(file)]) == 0
    (line,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("method"))
    assert "rk8, chosen since the scene is damped and the step long: off by about" in line
    assert line.endswith("a step costs 3 times one of rk4, which by its rates would be off by about 0.8 % of the path")
    assert main(["check", str(file), "--step", "0.05"]) == 0
    assert (
        "rk4, chosen since the scene is damped: off by about 5e-05 % of the path in 5 s, by" in capsys.readouterr().out
    )
    assert main(["check", str(file), "--method", "rk4"]) == 0
    assert "\nmethod" not in capsys.readouterr().out


@pytest.mark.ci
@pytest.mark.kernel
def test_near_its_limit_a_method_is_taken_before_one_that_is_off_by_more():
    for (fleet, t1), h in ((spinning_bluerov(), 0.5), (turning_remus((0.3, 0.2, 0.1)), 0.375)):
        plan = make_plan(fleet, h=h, t1=t1)
        (taken,), (other,) = (measured(fleet, t1, method, [round(t1 / h)]) for method in (plan.method.name, "rkw3"))
        assert plan.method.name == "rk8"
        assert taken < 0.01
        assert other > 4.0 * taken
    fleet, t1 = spinning_bluerov()
    (text,) = make_plan(fleet, h=0.5, t1=t1).grid.messages
    assert "rk8 may be off by more than 1 % of the path" in text


def test_the_choice_does_not_depend_on_the_length_of_the_run_or_the_number_of_members():
    fleet, _ = turning_remus()
    assert len({make_plan(fleet, h=0.25, t1=t1).method.name for t1 in (0.25, 1.0, 30.0, 300.0)}) == 1
    same = lw.Ensemble(REMUS, 1000, 1)
    assert make_plan(same, h=0.3, t1=3.0).method == make_plan(same.subset(range(40)), h=0.3, t1=3.0).method


def test_a_long_step_is_told_and_a_method_that_is_named_is_not_looked_at():
    fleet, t1 = turning_remus((0.1, 0.2, 0.3))
    (text,) = make_plan(fleet, h=1.5, t1=t1).grid.messages
    assert text.startswith("step h = 1.5 s is long for this motion: by its rates ")
    assert "lw.suggest" in text
    assert make_plan(fleet, "rk4", h=1.5, t1=t1).grid.messages == ()
    assert make_plan(fleet, h=0.1, t1=t1).grid.messages == ()


def test_of_rates_whose_squares_exceed_floating_point_numbers_the_step_is_told_to_be_long():
    (text,) = planned(torpedo(lw.terms.Drag(linear=[1e200] * 6))).grid.messages
    assert "is long for this motion" in text


@pytest.mark.parametrize(("name", "order"), [("rk4", 4), ("rk8", 8)])
def test_the_error_of_an_oscillator_is_the_methods_own(name, order):
    """A pendulum of rate w: after n steps the phase is off by n |R(ihw) - exp(ihw)|, which is of the method's order."""
    found = step_error.Rates(np.full((1, 10), 2.0j), 0.0, 0.0)
    a, b = (step_error.path_error(lw.Method(name), found, h, 10.0) for h in (0.4, 0.2))
    assert np.log2(a / b) == pytest.approx(order, abs=0.3)
    if name == "rk4":
        z = 0.4j
        made = abs(1 + z + z**2 / 2 + z**3 / 6 + z**4 / 24 - np.exp(z))
        assert b == pytest.approx(50 * made, rel=1e-2)


def test_the_modes_are_those_of_the_motion():
    """By hand: a sphere without drag that hangs below its centre of buoyancy swings at sqrt(m g c / J); drag dies at l / m."""
    swings = lw.Vehicle(mass=10.0, inertia=[2.0, 2.0, 2.0], added_mass=[5.0] * 3, buoyancy=10.0 * 9.8,
                        center_of_buoyancy=[0.0, 0.0, -0.05])  # fmt: skip
    scene = lw.Scene(swings, lw.Environment(gravity=9.8), start=lw.Start(position=[0.0, 0.0, 10.0]))
    found = step_error.rates(lw.Ensemble.from_scene(scene))
    assert np.abs(found.modes).max() == pytest.approx(np.sqrt(10.0 * 9.8 * 0.05 / 2.0))
    assert found.drag == 0.0
    braked = dataclasses.replace(scene, terms=[lw.terms.Drag(linear=[30.0] * 3 + [0.0] * 3)])
    found = step_error.rates(lw.Ensemble.from_scene(braked))
    assert found.modes.real.min() == pytest.approx(-30.0 / 15.0)
    assert found.drag == pytest.approx(2.0)


def test_a_drive_is_that_of_the_members_own_commands():
    """Thrusters that push against each other drive nothing; commands that vary are each member's."""
    scene = lw.Scene.named("bluerov2_heavy")
    (term,) = (term for term in scene.terms if term.key == "thrusters")
    fleet, _ = driven_bluerov()
    numbers = fleet.own(term, fleet.select(0, 4).parameters)
    own = step_error.drive(term, numbers)
    assert own.shape == (4, 6)
    assert (own[0] == own[1]).all()
    assert own[0].max() > 1.0
    assert not term.drive().any()
    ahead = np.sign(term.direction[:, 0]) * (abs(term.direction[:, 2]) < 0.5)
    held = dataclasses.replace(term, command=0.5 * ahead, times=None, command_schedule=None)
    against = dataclasses.replace(term, command=0.5 * abs(ahead), times=None, command_schedule=None)
    assert held.drive()[0] > 10.0 * max(against.drive()[0], 1e-9)
