# SPDX-License-Identifier: Apache-2.0
"""Driven vehicles of the peers' table: their equations beside the twin's laws, and lanes written by hand beside lw.solve."""

import dataclasses
import importlib

import numpy as np
import pytest

import lgvi_warp as lw
from benchmarks.peers import problem, reference, tableaus
from benchmarks.peers.body import body_of
from lgvi_warp.reference.rotation import cross
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.control_fins import ControlFins
from lgvi_warp.reference.terms.drag import Drag, DragMatrix
from lgvi_warp.reference.terms.lift import BodyLift
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.thrusters import Thrusters
from lgvi_warp.reference.terms.weight import Weight
from lgvi_warp.reference.terms.wrench import Wrench

# One more than fill a packet of 16 lanes.
MEMBERS, T1, H = 17, 2.0, 0.02
COMMANDS = (0.5, -0.3, 0.2, 1.4, -1.3, 0.05, 0.6, -0.7)


def commanded(scene, name, command):
    """The scene with other held commands of a term."""
    terms = [dataclasses.replace(term, command=command, command_schedule=None, times=None) if term.type == name else term
             for term in scene.terms]  # fmt: skip
    return dataclasses.replace(scene, terms=tuple(terms))


SCENES = {
    "remus_100": lambda: problem.driven_scene("remus_100"),
    "remus_100, fins turned": lambda: commanded(problem.driven_scene("remus_100"), "control_fins", (0.1, -0.4)),
    "bluerov2_heavy": lambda: problem.driven_scene("bluerov2_heavy"),
    "bluerov2_heavy, thrust": lambda: commanded(problem.driven_scene("bluerov2_heavy"), "thrusters", COMMANDS),
}


def numbers(term, *names):
    return {name: np.asarray(getattr(term, name)) for name in names}


def laws_of(scene):
    """The twin's laws for the scene's terms."""
    fins = ("position", "chord", "normal", "area", "lift_slope", "drag", "drag_normal", "limit")
    making = {
        "drag": lambda term: Drag(**numbers(term, "linear", "quadratic")),
        "drag_matrix": lambda term: DragMatrix(**numbers(term, "linear", "quadratic")),
        "body_lift": lambda term: BodyLift(**numbers(term, "matrix")),
        "wrench": lambda term: Wrench(**numbers(term, "force", "torque")),
        "control_fins": lambda term: ControlFins(
            **numbers(term, *fins), times=[0.0], command=[term.command], density=scene.environment.water_density
        ),
        "thrusters": lambda term: Thrusters(
            **numbers(term, "position", "direction", "dead_band", "limit", "polynomial", "polynomial_astern"),
            forward=term.coefficient, backward=term.coefficient_astern, times=[0.0], command=[term.command],
        ),
    }  # fmt: skip
    vehicle = scene.vehicle
    weight = vehicle.weight if vehicle.full else vehicle.mass * scene.environment.gravity
    moment = vehicle.buoyancy * vehicle.center_of_buoyancy
    moment = moment - weight * vehicle.center_of_gravity if vehicle.full else moment
    own = Weight(net=weight - vehicle.buoyancy), Restoring(moment=moment)
    return (*own, *(making[term.type](term) for term in scene.terms))


@pytest.mark.parametrize("name", SCENES)
def test_rates_are_those_of_the_twins_laws(name):
    # About 300 operations on forces up to 500 N, over a mass of 20 kg or an inertia of 0.2 kg m2.
    scene, rng = SCENES[name](), np.random.default_rng(3)
    velocity, rates = rng.normal(size=(MEMBERS, 3)), rng.normal(size=(MEMBERS, 3))
    R = problem.notation.matrix_from_rotation_vector(rng.normal(size=(MEMBERS, 3)))
    one = problem.of_states(name.split(",")[0], scene, T1, rng.normal(size=(MEMBERS, 3)), R, velocity, rates)
    quaternion = np.array(problem.make_rates(one)(tuple(one.state().T)))
    matrix = np.array(problem.make_matrix_rates(one)(tuple(one.matrix_state().T)))
    laws, I6 = laws_of(scene), body_of(scene).mass_matrix
    for i in range(MEMBERS):
        view, v = View(R[i], one.b[i], velocity[i], rates[i]), np.concatenate([velocity[i], rates[i]])
        p, pi = np.split(I6 @ v, 2)
        force = sum(np.concatenate(law.wrench(view)) - law.damping(view) @ v for law in laws)
        force = force + np.concatenate([cross(p, rates[i]), cross(pi, rates[i]) + cross(p, velocity[i])])
        expected = np.linalg.solve(I6, force)
        assert np.abs(quaternion[7:, i] - expected).max() < 1e-11 * max(1.0, np.abs(expected).max())
        assert np.abs(matrix[12:, i] - expected).max() < 1e-11 * max(1.0, np.abs(expected).max())
        assert np.abs(quaternion[:3, i] - R[i] @ velocity[i]).max() < 1e-13
        assert np.abs(matrix[:3, i] - R[i] @ velocity[i]).max() < 1e-13


def test_terms_that_the_peers_do_not_know_are_refused():
    scene = dataclasses.replace(problem.driven_scene("remus_100"), terms=(lw.terms.Current(velocity=[0.1, 0.0, 0.0]),))
    with pytest.raises(TypeError, match="no term 'current'"):
        body_of(scene)


@pytest.mark.parametrize("name", problem.DRIVEN)
def test_halved_steps_meet_the_reference_by_their_order(name):
    one = problem.make_problem(4, 1.0, name)
    rates, ends = problem.make_rates(one), []
    for steps in (25, 50, 200):
        y = tuple(one.state().T)
        for _ in range(steps):
            y = tableaus.step(rates, y, 1.0 / steps, tableaus.TABLEAUS["rk4"])
        ends.append(problem.end_of(np.array(y).T))
    coarse, fine = (problem.error(end, ends[2])["error_max"] for end in ends[:2])
    assert np.log2(coarse / fine) > 3.5


def compiler_or_skip(module):
    """Skip the test where a peer wants a compiler and there is none."""
    try:
        getattr(module, "ready", list)()
    except ModuleNotFoundError as error:
        pytest.skip(str(error))


def by_hand(first, method, dtype, *rates):
    """Position and attitude of lanes by hand, for each number of steps a second."""
    module = importlib.import_module("benchmarks.peers.peer_hand_lanes")
    compiler_or_skip(module)
    ends = []
    lanes = module.Lanes(first, method, dtype, module.LANES[dtype][0])
    for rate in rates:
        run = lanes.run(first, method, dtype, rate, 1, None)
        run.call()
        ends.append(run.end())
    return ends


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("method", ["rk4", "rk8"])
def test_lanes_by_hand_are_lw_solve(name, method):
    scene, which = SCENES[name](), name.split(",")[0]
    start = problem.make_problem(MEMBERS, T1, which)
    one = problem.of_states(which, scene, T1, start.b, start.R, start.nu, start.Om)
    result = lw.solve(one.ensemble, method, h=H, t1=T1, threads=1, save=lw.SaveAt(fields=("position", "attitude")))
    ours = result.position[-1], result.attitude[-1]
    same, half = by_hand(one, method, "float64", 1.0 / H, 2.0 / H)
    # Both leave out as much as the method does at this step: what half of it would mend.
    left_out = problem.error(half, same)["error_max"]
    apart = problem.error(same, ours)["error_max"]
    assert apart < max(left_out, 1e-12)
    assert apart < 1e-8
    # Some 100 steps, each of which rounds positions of 10 m to 1e-6 m.
    (single,) = by_hand(one, method, "float32", 1.0 / H)
    assert problem.error(single, same)["error_max"] < 1e-4


@pytest.mark.slow
def test_a_remus_by_hand_ends_where_lw_solve_does_to_eight_digits():
    scene = problem.driven_scene("remus_100")
    start = (problem.POSITION, np.eye(3), problem.VELOCITIES["remus_100"], problem.ANGULAR_VELOCITY)
    one = problem.of_states("remus_100", scene, T1, *(np.array([x]) for x in start))
    ours = lw.solve(one.ensemble, "rk4", h=H, t1=T1, threads=1).position[-1, 0]
    ((hand, _),) = by_hand(one, "rk4", "float64", 1.0 / H)
    assert np.abs(hand[0] - ours).max() < 1e-8


@pytest.mark.parametrize("name", problem.DRIVEN)
def test_the_reference_of_a_driven_vehicle_is_of_its_first_members(name):
    one = problem.make_problem(3, 0.02, name)
    b, R = reference.solve(one)
    assert np.abs(b - one.b - 0.02 * np.einsum("nij,nj->ni", one.R, one.nu)).max() < 1e-3
    assert problem.error((b, R), (b[:2], R[:2]))["error_max"] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("name", problem.DRIVEN)
@pytest.mark.parametrize(("peer", "package"), [
    ("hand_lanes", None), ("numba_simd", "numba"), ("heyoka", "heyoka"), ("diffrax", "diffrax"),
])  # fmt: skip
def test_a_peer_drives_the_vehicle(peer, package, name):
    if package is not None:
        pytest.importorskip(package)
    module = importlib.import_module(f"benchmarks.peers.peer_{peer}")
    compiler_or_skip(module)
    one = problem.make_problem(9, 0.5, name)
    truth, methods = reference.solve(one), {}
    for run in module.runs(one, threads=1):
        run.call()
        methods.setdefault((run.method, run.dtype), []).append(problem.error(run.end(), truth)["error_max"])
    # |v| v has a kink where v changes its sign: there a step of 1/128 s leaves out some 1e-7.
    for (_, dtype), errors in methods.items():
        assert min(errors) < (1e-6 if dtype == "float64" else 1e-4)
