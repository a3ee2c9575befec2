# SPDX-License-Identifier: Apache-2.0
"""Mistakes of newcomers: every message names the key, the value and the remedy, and all faults come at once."""

import functools
import importlib.util
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.lanes.arithmetic import add, lane, mul  # noqa: F401
from lgvi_kernels.lanes.state import struct
from lgvi_warp.physics.terms import TYPES
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene.scene import from_dict
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.terms import Current, Drag, Weight
from tests.support.refusals import faults, says

NAN, INF = float("nan"), float("inf")
BODY = {"mass": 10.0, "inertia": [1.0, 2.0, 2.5]}
CREATES = np.diag([1.0, -1.0, 1.0, 1.0, 1.0, 1.0]).tolist()
LOPSIDED = (np.eye(6) + 3.0 * np.eye(6, k=1)).tolist()
DIAGONAL = np.diag([10.0, 10.0, 10.0, 1.0, 2.0, 2.5])
POINT, AHEAD = [[0.0, 0.0, 0.0]], [[1.0, 0.0, 0.0]]
THRUSTER = {"type": "thrusters", "position": POINT, "direction": AHEAD, "coefficient": [1.0]}
FIN = {"type": "fins", "position": POINT, "chord": AHEAD, "normal": [[0.0, 0.0, 1.0]], "area": 1.0, "lift_slope": 3.0,
       "drag": 0.1}  # fmt: skip
STEERED = FIN | {"type": "control_fins", "command": 0.1}
PROFILE = {"type": "current_profile", "depths": [0.0, 9.0], "velocities": [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]}
SCHEDULE = {"type": "wrench_schedule", "times": [0.0, 1.0], "force": [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]}
TIDE = {"type": "current_harmonics", "amplitudes": AHEAD, "periods": [10.0]}
WAVES = {"type": "waves", "amplitudes": [1.0], "periods": [5.0], "headings_deg": [0.0]}
WANDERING = {"type": "gauss_markov_current", "standard_deviation": [0.1, 0.1, 0.1], "time_constant": 10.0}
TETHER = {"type": "tether", "anchor": [0.0, 0.0, 0.0], "stiffness": 5.0}
HULL = {"type": "cross_flow", "stations": [-1.0, 1.0], "diameters": [0.1, 0.1], "drag_coefficient": 1.0}


def from_table(table, section="terms"):
    return from_dict({"vehicle": BODY, section: [table]})


# Tables of terms, what is changed in them -> words of the message.
TERMS = [
    # drag that creates energy, coefficients of the wrong sign
    ({"type": "drag_matrix", "linear": CREATES}, "drag_matrix.linear = [[1.0, 0.0", "creates energy", "minus Fossen's"),
    ({"type": "drag_matrix", "linear": LOPSIDED}, "drag_matrix.linear = [[1.0, 3.0", "at the velocity",
     "positive on the"),
    ({"type": "drag_matrix", "quadratic": CREATES}, "drag_matrix.quadratic", "creates energy", "minus Fossen's"),
    ({"type": "drag_matrix", "linear": [1.0] * 6}, "drag_matrix.linear", "shape (6,)", "Give numbers of shape (6, 6)"),
    ({"type": "drag", "linear": [-4, 0, 0, 0, 0, 0]}, "drag.linear = [-4, 0", "out of bounds", "from 0 [N s/m, N m s]"),
    ({"type": "drag", "quadratic": [NAN] * 6}, "drag.quadratic = [nan", "not finite", "(6,)"),
    (TETHER | {"stiffness": -5.0}, "tether.stiffness = -5.0", "out of bounds", "from 0 [N/m]"),
    (TETHER | {"rest_length": float("inf")}, "tether.rest_length = inf", "not finite", "[m]"),
    (TETHER | {"anchor": [0.0, 0.0]}, "tether.anchor = [0.0, 0.0]", "shape (2,)", "(3,) [m]"),
    ({key: value for key, value in THRUSTER.items() if key != "coefficient"}, "thrusters.coefficient = None",
     "is missing", "or a polynomial [N]"),
    (THRUSTER | {"polynomial": [[1.0]]}, "thrusters.polynomial = [[1.0]]", "has shape (1, 1)", "Give p numbers"),
    (THRUSTER | {"coefficient": [-1.0]}, "thrusters.coefficient = [-1.0]", "out of bounds", "from 0"),
    (THRUSTER | {"time_constant": -0.1}, "thrusters.time_constant", "out of bounds", "from 0 [s]"),
    (HULL | {"diameters": [0.1, -0.1]}, "cross_flow.diameters = [0.1, -0.1]", "out of bounds", "from 0 [m]"),
    (FIN | {"lift_slope": -3.0}, "fins.lift_slope", "out of bounds", "from 0 [1/rad]"),
    (WAVES | {"amplitudes": [-1.0]}, "waves.amplitudes = [-1.0]", "out of bounds", "from 0 [m]"),
    (WAVES | {"periods": [0.0]}, "waves.periods = [0.0]", "not positive", "above 0 [s]"),
    (TIDE | {"periods": [-2.0]}, "current_harmonics.periods = [-2.0]", "not positive", "above 0 [s]"),
    (WANDERING | {"time_constant": 0.0}, "gauss_markov_current.time_constant = 0.0", "not positive", "above 0 [s]"),
    ({"type": "wrench_noise", "force": [-1, 0, 0]}, "wrench_noise.force = [-1", "out of bounds", "from 0 [N s^1/2]"),
    # tables: not sorted, empty, of different lengths
    (PROFILE | {"depths": [9.0, 0.0]}, "current_profile.depths = [9.0, 0.0]", "not rising", "Sort the table"),
    (SCHEDULE | {"times": [1.0, 1.0]}, "wrench_schedule.times = [1.0, 1.0]", "not rising", "drop repetitions"),
    (HULL | {"stations": [1.0, -1.0]}, "cross_flow.stations = [1.0, -1.0]", "not rising", "Sort the table"),
    (HULL | {"stations": [1.0], "diameters": [1.0]}, "cross_flow.stations = [1.0]", "one station", "Give two or more"),
    (THRUSTER | {"times": [2.0, 1.0], "command_schedule": [[0.0], [1.0]]}, "thrusters.times = [2.0, 1.0]",
     "not rising"),
    (PROFILE | {"depths": []}, "current_profile.depths = []", "shape (0,)", "Give k numbers [m]"),
    (PROFILE | {"velocities": AHEAD}, "current_profile.velocities", "shape (1, 3)", "Give 2 x 3 numbers [m/s]"),
    (PROFILE | {"velocities": [[1.0], [2.0, 3.0]]}, "current_profile.velocities", "not numeric", "Give numbers [m/s]"),
    (TIDE | {"phases": [0.0, 1.0]}, "current_harmonics.phases = [0.0, 1.0]", "shape (2,)", "Give 1 numbers [rad]"),
    (SCHEDULE | {"interpolation": "cubic"}, "wrench_schedule.interpolation = 'cubic'", "Known: linear, steps"),
    (WANDERING | {"start": "warm"}, "gauss_markov_current.start = 'warm'", "Known: zero, stationary"),
    # directions and commands
    (THRUSTER | {"direction": POINT}, "thrusters.direction[0] = [0.0, 0.0, 0.0]", "zero length", "such as [1, 0, 0]"),
    (THRUSTER | {"command_schedule": 3.0, "times": [0.0]}, "thrusters.command_schedule = 3.0", "Give 1 x 1 numbers"),
    (THRUSTER | {"command_schedule": [[1.0, 2.0], [3.0]]}, "thrusters.command_schedule", "not numeric", "Give numbers"),
    (THRUSTER | {"command": [[1.0], [2.0, 3.0]]}, "thrusters.command = [[1.0], [2.0, 3.0]]", "not numeric",
     "Give numbers"),
    (THRUSTER | {"limit": [[1.0, 2.0], [3.0]]}, "thrusters.limit = [[1.0, 2.0], [3.0]]", "not numeric", "Give numbers"),
    (THRUSTER | {"command": [1.0], "times": [0.0], "command_schedule": [[2.0]]}, "thrusters.command",
     "Keep one of them"),
    (FIN | {"chord": POINT}, "fins.chord[0] = [0.0, 0.0, 0.0]", "zero length", "trailing to leading edge"),
    (FIN | {"normal": AHEAD}, "fins.normal[0] = [1.0, 0.0, 0.0]", "along the chord", "across the fin's plane"),
    (FIN | {"drag": [0.1, 0.2]}, "fins.drag = [0.1, 0.2]", "shape (2,)", "Give 1 numbers [1]"),
    (STEERED | {"rate_limit": INF}, "control_fins.rate_limit", "not finite", "Give numbers [rad/s]"),
    (STEERED | {"times": [0.0], "command_schedule": [[0.3]]}, "control_fins.command", "Keep one of"),
    ({"type": "body_lift", "matrix": [[NAN] * 6] * 6}, "body_lift.matrix", "not finite", "shape (6, 6)"),
    # names and types
    ({"type": "dragg"}, "terms[0].type = 'dragg'", "not known", "Did you mean 'drag'?"),
    ({"type": ["drag"]}, "terms[0].type = ['drag']", "not known", "Did you mean 'drag'?"),
    ({"linear": [1.0] * 6}, "terms[0].type = ''", "Known: ", "body_lift, "),
    ({"type": "weight"}, "terms[0].type = 'weight'", "follows from the vehicle"),
    ({"type": "drag", "quad": 1.0}, "terms[0].quad = 1.0", "unknown key", "Did you mean 'quadratic'?"),
    ({"type": "tether"}, "terms[0].anchor", "is missing", "Give it [m]"),
    ({"type": "drag", "name": 3}, "name = 3", "not a text", "Give a name"),
    ({"type": "drag", "name": "vehicle"}, "terms = 'vehicle'", "section of the scene", 'name = "vehicle_term"'),
    (3, "terms[0] = 3", "is not a term", "Write a table with type"),
]  # fmt: skip


@pytest.mark.parametrize(("table", "words"), [(row[0], row[1:]) for row in TERMS])
def test_a_term_of_a_scene_file(table, words):
    (fault,) = (one for one in faults(from_table, table) if words[0] in one)
    assert all(word in fault for word in words), fault


def from_python(table):
    """The same with keyword arguments; Python itself refuses what it does not know."""
    return TYPES[table["type"]](**{key: value for key, value in table.items() if key != "type"})


@pytest.mark.parametrize(("table", "words"), [(row[0], row[1:]) for row in TERMS if not row[1].startswith("terms")])
def test_the_same_from_python(table, words):
    (fault,) = (one for one in faults(from_python, table) if words[0] in one)
    assert all(word in fault for word in words), fault


EVENTS = [
    (
        {"type": "box", "lower": [0, 0, 9], "upper": [1, 1, 1]},
        "box.upper = [1.0, 1.0, 1.0]",
        "not above lower",
        "upper >",
    ),
    ({"type": "time", "at": -1.0}, "time.at = -1.0", "out of bounds", "from 0 [s]"),
    ({"type": "floor", "depth": NAN}, "floor.depth = nan", "not finite", "[m]"),
    ({"type": "floor"}, "events[0].depth", "is missing", "Give it [m]"),
    ({"type": "flor"}, "events[0].type = 'flor'", "not known", "Did you mean 'floor'?"),
    ({"type": "surface", "deep": 1.0}, "events[0].deep = 1.0", "unknown key", "Did you mean 'depth'?"),
]


LISTS = [
    ([Drag(), Drag()], "terms = 'drag'", "name of 2 terms", 'name = "drag_2"'),
    ([Drag(name="current"), Current(velocity=[1, 0, 0])], "terms = 'current'", "name of 2 terms", "current_2"),
    ([Current(velocity=[1, 0, 0], name="environment")], "terms = 'environment'", "environment_term"),
    ([lw.events.Surface()], "terms[0] = 'surface'", "is an event", "events=[...]"),
    ([Weight()], "terms[0] = 'weight'", "acts already", "Leave it out"),
    ([Drag], "terms[0] = <class", "is not a term", "lw.terms.Drag(quadratic=...)"),
    (Drag(), "terms = Drag", "is not a list", "terms=[lw.terms.Drag(...)]"),
]


# Key, values of it that are refused, and words of what is said of each, the remedy among them.
SIX = [0.0, -0.01, NAN, INF, "soon", True]
SIZES = ["heavy", True, [None], [[1.0, 2.0], [3.0]], [True, 1.0, 1.0], [1.0, 2.0]]
TURNED = [[5.0, 0.1, 0.0], [0.0, 6.0, 0.0], [0.0, 0.0, 7.0]]
SETTINGS = [
    ("environment.gravity", [-9.8, NAN, True], "[m/s2]"),
    ("environment.water_density", [0.0], "not positive", "above 0 [kg/m3]"),
    ("start.position", [(1.0, 2.0), (1.0, NAN, 2.0)], "(3,) [m]"),
    ("start.velocity", ["fast"], "not numeric", "(3,) [m/s]"),
    ("start.angular_velocity", [1.0], "has shape ()", "(3,) [rad/s]"),
    ("start.euler_deg", [(0.0, INF, 0.0)], "not finite", "(3,) [deg]"),
    ("start.quaternion_wxyz", [np.zeros(4)], "is zero", "that is not"),
    ("start.quaternion_wxyz", [(1.0, 0.0, 0.0)], "has shape (3,)", "(4,) [1]"),
    *((f"run.{name}", SIX, "Give a number", "[s]") for name in ("step", "duration", "save_every")),
    ("run.dtype", ["float16", "double", np.float64, 64], "is not known", "float"),
    ("run.method", [3], "is not a text", 'such as "psi_s"'),
    ("run.save_fields", [3, "position"], "is not a list of names", "Give one"),
    ("run.save_fields", [["positoin"]], "= 'positoin' is not known", "Did you mean 'position'?"),
    ("run.save_fields", [[[1]]], "= [1] is not known", "Known: "),
    ("run.solver", ["cayly"], "is not known", "Did you mean 'cayley'"),
    ("run.iterations", [-1], "from 0 to 100", 'or None to iterate'),
    ("run.tolerance", [2.0], "between 0 and 1", "such as 1e-12"),
    ("run.atol", [1e-9], "is given alone", "Give both"),
    ("run.checks", ["some"], "is not known", "safe"),
    ("run.on_failure", ["panic"], "is not known", "substep"),
    ("run.device", ["cuda", "cuda:0", "CPU", 0, None], "runs are on CPU cores", 'Leave it out, or give "cpu"'),
    ("ensemble.members", [0, -3, 1.5, True, "4"], "whole number from 1", "Give 1 or more"),
    ("ensemble.members", [2.0], "whole number from 1", "Write 2,"),
    ("ensemble.members", [2**31 + 1], "more members than the 2147483648", "or less"),
    ("ensemble.seed", [-1, 0.5, False, "x", None], "whole number from 0", "Give 0 or more"),
    ("vehicle.mass", [0.0, -1.0], "not positive", "above 0 [kg]"),
    ("vehicle.buoyancy", [-1.0], "below 0", "from 0"),
    *((f"vehicle.{name}", [NAN, INF], "not finite", unit) for name, unit in (("mass", "[kg]"), ("buoyancy", "[N]"))),
    *((f"vehicle.{name}", [(1.0, NAN, 1.0), (1.0, INF, 1.0)], "not finite", unit)
      for name, unit in (("inertia", "[kg m2]"), ("added_mass", "[kg]"), ("center_of_buoyancy", "[m]"))),
    *((f"vehicle.{name}", SIZES, ". Give") for name in ("mass", "buoyancy", "inertia", "added_mass", "center_of_buoyancy")),
    *((f"vehicle.{name}", [TURNED], "not symmetric", "Give a symmetric matrix") for name in ("inertia", "added_mass")),
    ("vehicle.inertia", [(1.0, 0.0, 1.0)], "not positive definite", "above 0 [kg m2]"),
    # Positive diagonal, yet eigenvalues 3 and -1 in the plane of x and y.
    ("vehicle.inertia", [[[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]], "not positive definite", "[kg m2]"),
    ("vehicle.added_mass", [[-11.0, 0.0, 0.0]], "not positive definite", "minus Fossen's X_udot"),
]  # fmt: skip
SECTIONS = {"vehicle": lw.Vehicle, "environment": lw.Environment, "start": lw.Start, "run": RunSettings,
            "ensemble": EnsembleSettings}  # fmt: skip


@pytest.mark.parametrize(("key", "value", "words"), [(row[0], value, row[2:]) for row in SETTINGS for value in row[1]])
def test_a_setting_of_a_section(key, value, words):
    section, _, name = key.partition(".")
    good = BODY if section == "vehicle" else {}
    of_python = faults(SECTIONS[section], **good | {name: value})
    (fault,) = faults(from_dict, {"vehicle": BODY} | {section: good | {name: value}})
    assert of_python == (fault,)
    assert fault.startswith(f"{key} = ")
    assert all(word in fault for word in words), fault


STARTS = [
    (
        {"velocity": (1, 0, 0), "velocity_inertial": (1, 0, 0)},
        "start.velocity and velocity_inertial = ",
        "Keep one of them",
    ),
    (
        {"rotation_vector": (1, 0, 0), "euler_deg": (1, 0, 0)},
        "start.rotation_vector and euler_deg = ",
        "Keep one of them",
    ),
]


def full(rigid=DIAGONAL, **more):
    return {"rigid_body_mass_matrix": rigid} | more


VEHICLES = [
    ({}, "vehicle.mass = None", "is missing", "[kg]"),
    (BODY | {"weight": 98.0}, "vehicle.weight = 98.0", "6x6 form", "Give rigid_body_mass_matrix"),
    (full(DIAGONAL + np.eye(6, k=1)), "vehicle.rigid_body_mass_matrix", "not symmetric", "Give a symmetric matrix"),
    (full(-DIAGONAL), "vehicle.rigid_body_mass_matrix", "not positive definite", "[[m I, -m hat(r_g)]"),
    (full(np.diag([1.0, 2, 3, 1, 1, 1])), "vehicle.rigid_body_mass_matrix", "not have m I as its upper left block",
     "[[m I"),
    (full(np.eye(3)), "vehicle.rigid_body_mass_matrix", "shape (3, 3)", "symmetric 6x6 matrix"),
    (full(added_mass_matrix=-2.0 * DIAGONAL), "vehicle.added_mass_matrix", "not positive definite", "X_udot"),
    ({"added_mass_matrix": DIAGONAL}, "vehicle.rigid_body_mass_matrix = None", "is missing",
     "beside added_mass_matrix"),
    (full(mass=10.0), "vehicle.mass = 10.0", "repeats what", "Keep one of the two forms"),
    (full(weight=NAN), "vehicle.weight = nan", "not finite", "[N]"),
    (full(center_of_gravity=[1.0]), "vehicle.center_of_gravity = [1.0]", "shape (1,)", "(3,) [m]"),
]  # fmt: skip


@pytest.mark.parametrize(("values", "words"), [(row[0], row[1:]) for row in VEHICLES])
def test_a_vehicle(values, words):
    fault = next(one for one in faults(lw.Vehicle, **values) if words[0] in one)
    assert all(word in fault for word in words), fault


FOSSEN = [
    ({"X_udot": 5.0}, "X_udot = 5.0", "is positive", "Write -5"),
    ({"X_u|u|": 5.0}, "X_u|u| = 5.0", "is positive", "Write -5"),
    (
        {"Y_rdot": -1.0, "N_vdot": -2.0},
        "Y_rdot = -1.0",
        "from its partner N_vdot = -2.0",
        "Correct one or leave it out",
    ),
    ({"X_u": -1.0, "Xu": -2.0}, "Xu = -2.0", "given twice", "Leave one out"),
    ({"X_udot": -1.0, "Xdu": -1.0}, "Xdu = -1.0", "also as X_udot", "Leave one out"),
    ({"Y_uv": -1.0}, "Y_uv = -1.0", "product of two velocities", "ignore="),
    ({"X_qq": -1.0}, "X_qq = -1.0", "no drag", "X_|q|q"),
    ({"Q_u": -1.0}, "Q_u = -1.0", "not a coefficient's name", "Known: X_udot"),
    ({3: -1.0}, "3 = -1.0", "not a coefficient's name", "Known: X_udot"),
    ({"X_u": NAN}, "X_u = nan", "not finite", "Give a number"),
    ([1.0], "coefficients = [1.0]", "not a map", "X_udot"),
    ({"X_qdot": -1e3}, "total mass matrix", "not positive definite", "Check mass"),
]
ENERGY = [({"X_u": -1.0, "X_v": -100.0, "Y_v": -1.0}, "drag_matrix.linear", "creates energy", "minus Fossen's")]


PATHS = [(path, str(path), "Give the path of a TOML file") for path in ("missing.toml", None)]
FAR, NEAR = lw.distributions.Normal(std=100.0), lw.distributions.Uniform(0.1, 0.2)
VARIED = [(PROFILE, "current_profile.depths"), (SCHEDULE, "wrench_schedule.times"),
          (THRUSTER | {"times": [0.0, 1.0], "command_schedule": [[0.0], [1.0]]}, "thrusters.times"),
          (HULL, "cross_flow.stations"), (THRUSTER, "thrusters.coefficient"),
          ({"type": "drag_matrix", "linear": np.eye(6).tolist()}, "drag_matrix.linear"),
          (WAVES, "waves.periods")]  # fmt: skip


NAMES = [({"type": "drag"}, "drag.quadrtic", "Did you mean 'drag.quadratic'?"),
         ({"type": "drag", "name": "hull"}, "drag.quadratic", "Did you mean 'hull.quadratic'?")]  # fmt: skip


SCHEDULED = THRUSTER | {"times": [0.0, 1.0], "command_schedule": [[0.0], [1.0]]}
IDLE = [
    (SCHEDULED, "thrusters.command", "Vary thrusters.command_schedule"),
    (THRUSTER, "thrusters.command_schedule", "Vary thrusters.command"),
    (THRUSTER, "thrusters.polynomial", "Give thrusters.polynomial in the scene"),
    (THRUSTER, "thrusters.time_constant", "Give thrusters.time_constant above 0 [s] in the scene"),
    (STEERED, "control_fins.times", "Vary control_fins.command"),
    (STEERED, "control_fins.rate_limit", "Give control_fins.rate_limit below 1e+06 rad/s in the scene"),
]


NOISE = {"type": "wrench_noise", "force": [1.0, 1.0, 1.0]}
MATRIX = {"type": "drag_matrix", "linear": np.eye(6).tolist()}
RUNS = [
    (MATRIX, {"method": "kl6(psi_s)"}, "method = 'kl6(psi_s)'", "a damping matrix prevents that", "Use psi_s"),
    (MATRIX, {"method": "tj4(psi_x)"}, "method = 'tj4(psi_x)'", "keeps its order only if a step of -h undoes",
     "Use psi_x"),
    (TIDE, {"method": "su4(psi_s)"}, "method = 'su4(psi_s)'", "water that varies prevents that", "Use psi_s"),
    (NOISE, {"method": "psi"}, "method = 'psi'", "noise more than once a step", "Use psi_s"),
    ({"type": "drag", "linear": [0.0, 0.0, 3e5, 0.0, 0.0, 0.0]}, {"method": "kl6(psi_s)"}, "goes backward by",
     "drag number up to", "Use psi_s, or a step"),
    (MATRIX, {"method": "psi_q"}, "method = 'psi_q'", "not known", "Did you mean 'psi_"),
    (MATRIX, {"method": "kl6(phi)"}, "method = 'kl6(phi)'", "not symmetric", "Compose psi_s"),
    (MATRIX, {"dtype": "float16"}, "dtype = 'float16'", "Did you mean 'float64'?"),
    (MATRIX, {"device": "cuda:0"}, "device = 'cuda:0'", "runs are on CPU cores", 'Leave it out, or give "cpu"'),
    (MATRIX, {"h": NAN}, "h = nan", "not finite", "[s]"),
    (MATRIX, {"t1": -1.0}, "t1 = -1.0", "not positive", "above 0 [s]"),
    (MATRIX, {"h": "a"}, "h = 'a'", "not numeric", "[s]"),
    (MATRIX, {"t1": [1.0]}, "t1 = [1.0]", "shape", "[s]"),
    (MATRIX, {"save": 0.1}, "save = 0.1", "is not a SaveAt", "lw.SaveAt("),
]  # fmt: skip


def of_terms(terms):
    return lw.Scene(lw.Vehicle(**BODY), terms=terms)


def varied(inputs):
    """Members of the scene with a term of this table, of which one number has this distribution."""
    table, name, law, members = inputs
    return lw.Ensemble(from_table(table), members, 0, {name: law})


def planned(inputs):
    return make_plan(lw.Ensemble(from_table(inputs[0])), **({"h": 0.01, "t1": 0.1} | inputs[1]))


# What is given wrongly, and how: rows of what is given, and words of the one fault that is said.
ONE_FAULT = [
    (lambda table: from_table(table, "events"), EVENTS),
    (of_terms, LISTS + [(one, "terms = ", "is not a list") for one in ("drag", 3, None, {"type": "drag"})]),
    (lambda values: lw.Start(**values), STARTS),
    (lambda given: lw.vehicles.from_fossen(given, **BODY), FOSSEN),
    (lambda given: from_dict(lw.vehicles.from_fossen(given, **BODY)), ENERGY),
    (lw.Scene.load, PATHS),
    (varied, [((*row, FAR, 50), row[1], "unphysical", "of 50 members", "smaller spread") for row in VARIED]),
    (
        varied,
        [
            ((*row[:2], NEAR, 5), f'ensemble.vary."{row[1]}"', "does not name what the scene has", row[2])
            for row in NAMES
        ],
    ),
    (varied, [((*row[:2], NEAR, 5), row[1], "does not act: the scene has", row[2]) for row in IDLE]),
    (planned, [(row[:2], *row[2:]) for row in RUNS]),
]


@pytest.mark.parametrize(
    ("make", "inputs", "words"), [(make, row[0], row[1:]) for make, rows in ONE_FAULT for row in rows]
)
def test_what_is_wrong_is_one_fault(make, inputs, words):
    says(*faults(make, inputs), *words)


# A user's law.


@functools.cache
def pull_params(width, real):
    return struct("Pull", k=lane(width, real))


@wp.func
def pull_law(w: Any, view: Any, p: Any):
    w.force = w.force + p.k * view.down
    return w


@wp.func
def pull_short(w: Any, view: Any):
    return w


@wp.func
def pull_silent(w: Any, view: Any, p: Any):
    w.force = w.force + p.k * view.down


def pull_plain(w, view, p):
    return w


def device(**functions):
    return type("Device", (), {"params": staticmethod(pull_params)} | functions)


@dataclass(frozen=True, eq=False, kw_only=True)
class Pull(lw.laws.Term):
    type: ClassVar[str] = "pull"
    device: ClassVar[Any] = device(law=pull_law)

    k: Any = lw.laws.number((), "N")


class Packs(Pull):
    what: ClassVar[Any] = None

    def packed(self, numbers, context):
        return self.what


LAWS = [
    (device(law=pull_short), "pull.law = '(w, view)'", "takes 2 arguments", "Write law(w, view, p)"),
    (device(law=pull_plain), "pull.law", "not a Warp function", "@wp.func"),
    (device(), "pull.device", "has none of law, damping, push, flow, evolve, follow", "add_a_force.md"),
    (device(law=pull_law, follow=pull_law), "pull.device", "has follow and no evolve", "add_a_force.md"),
    (device(push=pull_law), "pull.device", "has push and no damping", "add_a_force.md"),
    ("pull", "pull.device = 'pull'", "not known", "Give a module"),
]


@pytest.mark.parametrize(("built", "words"), [(row[0], row[1:]) for row in LAWS])
def test_a_users_law(built, words):
    term = type("Bad", (Pull,), {"device": built, "__annotations__": {}})(k=1.0)
    fleet = lw.Ensemble(lw.Scene(lw.Vehicle(**BODY), terms=[term]))
    for check in (lambda: lw.laws.check_law(term), lambda: make_plan(fleet, h=0.01, t1=0.1)):
        (fault,) = faults(check)
        assert all(word in fault for word in words), fault


@dataclass(frozen=True, eq=False, kw_only=True)
class Wide(Pull):
    row: Any = lw.laws.number((6,), "N", (1.0,) * 6)


def test_a_law_without_a_struct_whose_numbers_make_none():
    bare = type("Bare", (Wide,), {"device": device(law=pull_law, params=None), "__annotations__": {}})
    (fault,) = faults(lw.laws.check_law, bare(k=1.0))
    assert all(word in fault for word in ("pull.device", "has no params(width, real)", "add_a_force.md")), fault


@pytest.mark.ci
@pytest.mark.kernel
def test_a_law_that_returns_nothing():
    term = type("Bad", (Packs,), {"device": device(law=pull_silent), "__annotations__": {}})(k=1.0)
    (fault,) = faults(lw.laws.check_law, term)
    says(fault, "pull.device", "does not compile", "Return what the role adds to")


@pytest.mark.kernel
@pytest.mark.parametrize("inputs", [None, {"k": np.ones(1)}], ids=["nothing", "a dict"])
def test_packed_that_returns_something_else(inputs):
    report = lw.laws.check_law(type("Bad", (Packs,), {"what": inputs, "__annotations__": {}})(k=1.0))
    assert not report.ok
    says(str(report), "packed() returns", "lw.laws.Packed({name: numbers})")


@pytest.mark.kernel
def test_packed_left_out():
    # Numbers and vectors are packed as they are declared; a number of another shape is not.
    assert next(check for check in lw.laws.check_law(Pull(k=1.0)).checks if check.name == "numbers").ok
    report = lw.laws.check_law(Wide(k=1.0))
    assert not report.ok
    says(str(report), "NotImplementedError", "Write packed(self, numbers, context)")


@pytest.mark.kernel
def test_numbers_of_the_wrong_shape():
    wrong = type("Bad", (Packs,), {"what": lw.laws.Packed({"k": np.ones((1, 3))}), "__annotations__": {}})
    report = lw.laws.check_law(wrong(k=1.0))
    assert not report.ok
    says(str(report), "packed() fails", "Give arrays (1,), (1, 3)")


def test_what_is_no_fleet():
    for make in (lw.solve, lw.Ensemble):
        (fault,) = faults(make, lw.Vehicle(1.0, inertia=1.0 * np.ones(3), added_mass=np.ones(3), buoyancy=0.0))
        assert "Give lw.Scene(" in fault
    (fault,) = faults(lw.Ensemble, from_table(MATRIX), 5, 0, [1])
    says(fault, "vary = [1]", "lw.distributions.Normal")


def test_two_events_of_one_name():
    events = [lw.events.Floor(depth=1.0), lw.events.Floor(depth=2.0)]
    (fault,) = faults(lw.Scene, from_table(MATRIX).vehicle, events=events)
    says(fault, "events = 'floor'", 'name = "floor_2"')
    second = lw.events.Floor(depth=2.0, name="lower")
    assert len(lw.Scene(from_table(MATRIX).vehicle, events=[events[0], second]).events) == 2


def test_a_quadratic_matrix_of_members_that_creates_energy():
    scene = from_table({"type": "drag_matrix", "quadratic": np.eye(6).tolist()})
    (fault,) = faults(lw.Ensemble, scene, 2000, 0, {"drag_matrix.quadratic": lw.distributions.Normal(std=1.0)})
    says(fault, "drag_matrix.quadratic of member", "unphysical")
    lw.Ensemble(scene, 2000, 0, {"drag_matrix.quadratic": lw.distributions.Uniform(relative=0.3)})


@pytest.mark.ci
@pytest.mark.kernel
def test_a_broken_law_in_solve():
    broken = device(law=pull_silent)
    Broken = type("Broken", (Pull,), {"device": broken})
    with pytest.raises(lw.SceneError, match=r"(?s)law pull: .*does not compile.*lw.laws.check_law"):
        lw.solve(lw.Scene(from_table(MATRIX).vehicle, terms=[Broken(k=1.0)]), h=0.01, t1=0.1)
    wavy = type("Wavy", (Pull,), {"device": device(law=pull_law, FLOW="wavy")})
    (fault,) = faults(lw.solve, lw.Scene(from_table(MATRIX).vehicle, terms=[wavy(k=1.0)]), h=0.01, t1=0.1)
    says(fault, "pull.FLOW = 'wavy'", "varying")


NOTEBOOK_CELL = """
import functools
from typing import Any
import warp as wp
from lgvi_kernels.lanes.arithmetic import add, lane, mul
from lgvi_kernels.lanes.state import struct

@functools.cache
def params(width, real):
    return struct("Lift", k=lane(width, real))

@wp.func
def law(w: Any, view: Any, p: Any):
    w.force = w.force + p.k * view.down
    return w
"""


@pytest.mark.ci
@pytest.mark.kernel
def test_a_law_defined_twice_as_in_a_notebook(tmp_path):
    results = []
    for i in range(2):
        path = tmp_path / f"cell_{i}.py"
        path.write_text(NOTEBOOK_CELL)
        spec = importlib.util.spec_from_file_location("cell", path)
        cell = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(cell)
        Lift = type(
            "Lift", (Pull,), {"device": cell, "packed": lambda self, numbers, context: lw.laws.Packed(dict(numbers))}
        )
        results.append(lw.solve(lw.Scene(from_table(MATRIX).vehicle, terms=[Lift(k=1.0)]), h=0.01, t1=0.1).position)
    assert np.array_equal(*results)
