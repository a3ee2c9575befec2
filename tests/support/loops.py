# SPDX-License-Identifier: Apache-2.0
"""Closed loops of the twin, from the scene of a closed loop of the package."""

import dataclasses
import importlib

import numpy as np

from lgvi_warp.control.pose_pid import PosePID
from lgvi_warp.control.pose_smc import PoseSMC
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.reference import advance
from lgvi_warp.reference.control.loop import Loop, closed_loop
from lgvi_warp.reference.control.policy import Policy
from lgvi_warp.reference.control.pseudo_inverse import PseudoInverse
from lgvi_warp.reference.submaps import Body, start
from lgvi_warp.reference.terms.drag import Drag
from lgvi_warp.reference.terms.driven import ControlWrench
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight


def twin_of(part, numbers, scene):
    """The twin's part for a part of a scene.

    numbers: {name: value} of the member, by which the part's own are replaced.
    """
    kind = getattr(importlib.import_module(f"lgvi_warp.reference.control.{part.type}"), type(part).__name__)
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
    return twin


def twin_loop(scene, numbers, every):
    """(body, loop) of a vehicle in the simple form with drag and an ideal actuator, whose allocation is the pseudo-inverse."""
    vehicle, terms = scene.vehicle, {term.type: term for term in scene.terms}
    actuator = ControlWrench(limit=np.array(terms["control_wrench"].limit), time_constant=np.zeros(6))
    net = vehicle.mass * scene.environment.gravity - vehicle.buoyancy
    laws = [Weight(net=net), Restoring(moment=vehicle.buoyancy * np.array(vehicle.center_of_buoyancy, float)), actuator]
    if "drag" in terms:
        laws.append(Drag(linear=np.array(terms["drag"].linear), quadratic=np.array(terms["drag"].quadratic)))
    parts = [twin_of(part, numbers, scene) for part in (*scene.controller.guidance, *scene.controller.laws)]
    allocation = PseudoInverse(to="control_wrench", effect=np.eye(6))
    return Body(vehicle.mass_matrix, vehicle.inertia, tuple(laws)), Loop(
        [*parts, allocation], {"control_wrench": actuator}, every
    )


def twin_states(scene, numbers, state, every, h, steps):
    """Positions (k, 3) and attitudes (k, 3, 3) of one member at its looks, by psi_s.

    state: position, attitude, velocity, angular velocity at the start.
    """
    body, loop = twin_loop(scene, numbers, every)
    b, R, nu, Om = state
    loop.begin()
    x = start(body, b, R, body.M @ nu, body.J @ Om)
    states = closed_loop(x, body, loop, lambda x, body, h: advance.step(x, body, PROGRAMS["psi_s"], h), h, steps)
    return np.array([s.b for s in states[::every]]), np.array([s.R for s in states[::every]])
