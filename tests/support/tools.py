# SPDX-License-Identifier: Apache-2.0
"""Tools of several tests: vehicles, one-scene ensembles, states of results and of the reference."""

from pathlib import Path
from unittest import mock

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
import lgvi_warp.physics.notation
from benchmarks.problems import difference as difference
from benchmarks.problems import random_states as random_states
from benchmarks.problems import slope as slope
from lgvi_warp.reference.submaps import Body, State
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight

METHODS = ("phi", "phi_adjoint", "psi", "psi_s", "psi_1")
SOLVERS = ("quartic", "cayley", "newton")


def chosen(rows, kept):
    """Parameters of a test: those that are kept in the short tests as they are, the others left to the long ones."""
    return [row if kept(*row) else pytest.param(*row, marks=pytest.mark.slow) for row in rows]


# The methods' sub-map D is the same code: psi_s has every solver in the short tests, the others one of them.
PAIRS = chosen(
    [(method, solver) for solver in SOLVERS for method in METHODS],
    lambda method, solver: method == "psi_s" or solver == "quartic",
)
GRAVITY = 9.8

# Equal masses but for the last digit: as a kernel for masses that differ has them.
EQUAL = (2.0, 2.0, 2.0 + 2.0**-50)

# A turn of the body axes that is no symmetry of anything.
TURN = lw.notation.matrix_from_rotation_vector(np.array([0.4, -0.7, 0.2]))


def vehicle(M=(1.0, 2.0, 3.0), J=(1.0, 2.0, 2.5), net=0.0, moment=(0.0, 0.0, 0.0)):
    """A scene's vehicle with mass matrix M, inertia J (3-vectors or matrices), net weight [N] and B r [N m]."""
    M = np.diag(M) if np.ndim(M) == 1 else np.asarray(M)
    mass = 0.5 * np.linalg.eigvalsh(M)[0]
    buoyancy = mass * GRAVITY - net
    center = np.asarray(moment) / buoyancy if np.any(moment) else (0.0, 0.0, 0.0)
    return lw.Vehicle(mass, inertia=J, added_mass=M - mass * np.eye(3), buoyancy=buoyancy, center_of_buoyancy=center)


def scene_of(*arguments, **named):
    """A scene with that vehicle."""
    return lw.Scene(vehicle(*arguments, **named), lw.Environment(gravity=GRAVITY))


def free_scene(M=(1.0, 2.0, 3.0), J=(1.0, 2.0, 2.5)):
    """A scene with forces far below round-off: the body moves freely, by the same kernel as that of `scene_of`."""
    heavy = vehicle(M, J)
    free = lw.Vehicle(
        heavy.mass, inertia=J, added_mass=heavy.added_mass, buoyancy=3e-30 * heavy.mass,
        center_of_buoyancy=(0.0, 0.0, -1e-3),
    )  # fmt: skip
    return lw.Scene(free, lw.Environment(gravity=1e-30))


def body_of(scene):
    """The reference's body for a scene."""
    v, g = scene.vehicle, scene.environment.gravity
    terms = (Weight(net=v.mass * g - v.buoyancy), Restoring(moment=v.buoyancy * v.center_of_buoyancy))
    return Body(v.mass_matrix, v.inertia, terms)


def one(scene, b=(0.0, 0.0, 0.0), R=None, nu=(0.0, 0.0, 0.0), Om=(0.0, 0.0, 0.0), parameters=None):
    """An ensemble of one member, or of as many as the arrays, and those of varied parameters, hold."""
    R = np.eye(3) if R is None else R
    states = [np.reshape(np.asarray(x, dtype=float), (-1, *shape)) for x, shape in zip((b, R, nu, Om), SHAPES)]
    n = max(len(x) for x in (*states, *(parameters or {}).values()))
    return lw.Ensemble.from_states(scene, *(np.broadcast_to(x, (n, *x.shape[1:])) for x in states), parameters)


SHAPES = ((3,), (3, 3), (3,), (3,))


def last(result, member=0):
    """b, R, nu, Om of the last sample of a member."""
    fields = (result.position, result.attitude, result.velocity, result.angular_velocity)
    return tuple(np.asarray(field[-1, member], dtype=np.float64) for field in fields)


def to_state(body, b, R, nu, Om):
    """The reference's state."""
    return State(np.asarray(b), np.asarray(R), body.M @ nu, body.J @ Om)


def from_state(body, x):
    """b, R, nu, Om of the reference's state."""
    return x.b, x.R, np.linalg.solve(body.M, x.p), np.linalg.solve(body.J, x.pi)


def expected(entry):
    """b, R, nu, Om of an entry of paper_example.json."""
    return tuple(np.array(entry[key]) for key in ("b", "R", "nu", "Omega"))


def generated(plan, folder):
    """The C++ that Warp generates for a plan's kernel, which nothing compiles."""
    with mock.patch("warp._src.build.build_cpu", lambda path, *_, **__: Path(path).touch()):
        wp.compile_aot_module(plan.kernel.advance.kernel.module, device="cpu", module_dir=str(folder))
    (path,) = Path(folder).glob("*.cpp")
    return path.read_text()
