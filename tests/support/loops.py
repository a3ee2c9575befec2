# SPDX-License-Identifier: Apache-2.0
"""The vehicle of tests of closed loops, and the loops of the twin, from scenes of the package or from parts."""

import dataclasses
import importlib

import numpy as np

import lgvi_warp as lw
from lgvi_warp.control.pose_pid import PosePID
from lgvi_warp.control.pose_smc import PoseSMC
from lgvi_warp.methods.method import PROGRAMS, Method
from lgvi_warp.reference import advance, explicit
from lgvi_warp.reference.control.gain_tables import GainTables
from lgvi_warp.reference.control.loop import Fault, Loop, closed_loop
from lgvi_warp.reference.control.policy import Policy
from lgvi_warp.reference.control.pseudo_inverse import PseudoInverse
from lgvi_warp.reference.submaps import Body, start
from lgvi_warp.reference.terms.drag import Drag
from lgvi_warp.reference.terms.driven import ControlWrench
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight
from lgvi_warp.reference.terms.wrench import Wrench
from tests.laws import case


def torpedo(buoyancy, center_of_buoyancy, inertia=(1.5, 4.0, 4.5)):
    """A body of 20 kg, longer than wide, whose added mass turns the axes of kernels that reduce it."""
    return lw.Vehicle(20.0, inertia=inertia, added_mass=(5.0, 22.0, 25.0), buoyancy=buoyancy,
                      center_of_buoyancy=center_of_buoyancy)  # fmt: skip


def twin_body(vehicle, gravity, laws):
    """The twin's body of a vehicle in the simple form: its weight and buoyancy, and these laws."""
    moment = vehicle.buoyancy * np.array(vehicle.center_of_buoyancy, float)
    own = Weight(net=vehicle.mass * gravity - vehicle.buoyancy), Restoring(moment=moment)
    return Body(vehicle.mass_matrix, vehicle.inertia, (*own, *laws))


def twin_run(body, loop, method, h, steps, b=(0.0, 0.0, 0.0), R=None, nu=(0.0, 0.0, 0.0), Om=(0.0, 0.0, 0.0)):
    """Positions (steps + 1, 3) and attitudes (steps + 1, 3, 3) of the twin's loop."""
    loop.begin()
    x = start(body, np.array(b), np.eye(3) if R is None else R, body.M @ nu, body.J @ Om)
    if method in PROGRAMS:
        step = lambda x, body, h: advance.step(x, body, PROGRAMS[method], h)  # noqa: E731
    else:
        step = explicit.stepper(Method(method).tableau)
    states = closed_loop(x, body, loop, step, h, steps)
    return np.array([s.b for s in states]), np.array([s.R for s in states])


def twin_of(part, numbers, scene):
    """The twin's part for a part of a scene.

    numbers: {name: value} of the member, by which the part's own are replaced.
    """
    kind = getattr(importlib.import_module(case.twin_of(type(part).__module__)), type(part).__name__)
    values = {item.name: getattr(part, item.name) for item in dataclasses.fields(part) if item.name != "name"}
    for name in values:
        values[name] = numbers.get(f"{part.key}.{name.removesuffix('_')}", values[name])
    values = {name: value for name, value in values.items() if value is not None}
    if isinstance(part, (PosePID, PoseSMC)):
        vehicle, gravity = scene.vehicle, scene.environment.gravity
        values |= dict(weight=vehicle.mass * gravity, buoyancy=float(vehicle.buoyancy), center_of_mass=np.zeros(3))
        values |= dict(center_of_buoyancy=np.array(vehicle.center_of_buoyancy, float))
    twin = kind(**values)
    if isinstance(twin, Policy):
        twin.layers = vars(part)["layers"]
    tables = getattr(part, "gain_tables", {})
    if tables:
        names = {name.removesuffix("_"): name for name in values}
        nodes = {names[name]: (table.over, table.at, values[names[name]]) for name, table in tables.items()}
        return GainTables(law=twin, tables=nodes)
    return twin


def twin_loop(scene, numbers, every, h):
    """(body, loop) of a vehicle in the simple form with drag, a held wrench and an ideal actuator, with its delay and faults.

    Its allocation is the scene's matrix, or the pseudo-inverse.
    """
    loops, terms = scene.controller, {term.type: term for term in scene.terms}
    ideal = terms["control_wrench"]
    lag = np.broadcast_to(np.array(ideal.time_constant, float), 6)
    actuator, laws = ControlWrench(limit=np.array(ideal.limit), time_constant=lag), []
    for name, kind in (("drag", Drag), ("wrench", Wrench)):
        if name in terms:
            laws.append(kind(**{key: np.array(value) for key, value in terms[name].parameters().items()}))
    parts = [twin_of(part, numbers, scene) for part in (*loops.guidance, *loops.laws)]
    given = [twin_of(part, numbers, scene) for part in loops.allocation if part.type == "matrix"]
    parts += given or [PseudoInverse(to="control_wrench", effect=np.eye(6))]
    faults = [
        Fault(
            one.of, int(one.channel), kind=one.kind, **{name: float(value) for name, value in one.parameters().items()}
        )
        for one in loops.faults
    ]
    loop = Loop(parts, {"control_wrench": actuator}, every, round(float(loops.delay) / h), faults)
    return twin_body(scene.vehicle, scene.environment.gravity, [actuator, *laws]), loop


def twin_states(scene, numbers, state, every, h, steps, method="psi_s"):
    """Positions (k, 3) and attitudes (k, 3, 3) of one member at its ticks.

    state: position, attitude, velocity, angular velocity at the start.
    """
    body, loop = twin_loop(scene, numbers, every, h)
    return tuple(x[::every] for x in twin_run(body, loop, method, h, steps, *state))
