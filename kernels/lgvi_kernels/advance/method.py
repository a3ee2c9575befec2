# SPDX-License-Identifier: Apache-2.0
"""A method's step, made of its sub-maps and the scene's laws: which law acts in which map, and how velocities follow."""

import functools
from typing import Any, NamedTuple

import warp as wp

from lgvi_kernels.advance.spec import make_types
from lgvi_kernels.lanes.arithmetic import add, div, mul, sub, vec3  # noqa: F401
from lgvi_kernels.lanes.matrix3 import apply, factor_struct, transpose_times
from lgvi_kernels.lanes.rotations import rotation_struct
from lgvi_kernels.lanes.state import damping_struct, flow_struct, matrix3_struct, view_struct, wrench_struct
from lgvi_kernels.lanes.view import to_body
from lgvi_kernels.laws import drag, drag_directions
from lgvi_kernels.maps import turns
from lgvi_kernels.maps.accounting import make_kick_account, make_map_account
from lgvi_kernels.maps.collocation import make_G
from lgvi_kernels.maps.compose import superpose, superpose_loads
from lgvi_kernels.maps.coupled import make_W
from lgvi_kernels.maps.dense_inertia import make_dense_velocities
from lgvi_kernels.maps.dissipation import make_loaded_V, make_V
from lgvi_kernels.maps.explicit import make_explicit
from lgvi_kernels.maps.forces import make_forces
from lgvi_kernels.maps.paper import make_phi
from lgvi_kernels.maps.rates import in_body
from lgvi_kernels.maps.solve import make_solve
from lgvi_kernels.maps.submaps import (
    Ap,
    anisotropic_velocity,
    fold,
    fold_pair,
    isotropic_velocity,
    look,
    make_Ab,
    make_D,
    make_K,
    make_T,
    rotate,
)
from lgvi_kernels.maps.two_part import make_A, make_B
from lgvi_kernels.maps.water import acceleration_wrench, make_shear, make_water_wrench


class Step(NamedTuple):
    """Functions of a method.

    step: one stage without its lead; lead: the sub-map that opens a step (see Spec); velocities: (inertia, p, pi) -> (nu, Om)
    at the origin of the state, velocities_of_forces: at that of the forces; prepare: makes the constants of E;
    water_velocity: R^T u; momentum: p of a state that holds R p in its place, or None.
    """

    step: Any
    lead: Any
    velocities: Any
    prepare: Any
    water_velocity: Any
    velocities_of_forces: Any
    momentum: Any = None


@wp.func
def direct_velocity(inertia: Any, p: Any):
    """nu = M^-1 p for diagonal M. Methods that ask many times a step save a product: the sums leave the loop over steps."""
    A = inertia.anisotropy
    mean = inertia.mean
    return vec3((mean + A.x) * p.x, (mean + A.y) * p.y, (mean + A.z) * p.z)


@wp.func
def divided(inertia: Any, pi: Any):
    """J^-1 pi."""
    return pi / inertia.J


@wp.func
def multiplied(inertia: Any, pi: Any):
    """J^-1 pi without a division, for methods that ask many times a step."""
    return inertia.inverse_J * pi


def make_velocities(velocity, turning, coupled):
    """Two functions (inertia, p, pi) -> (nu, Om): at the origin of the state, and at that of the forces.

    velocity: M^-1 p; turning: J^-1 of a vector.
    """
    if not coupled:

        @wp.func
        def velocities(inertia: Any, p: Any, pi: Any):
            """nu = M^-1 p, Om = J^-1 pi."""
            return velocity(inertia, p), turning(inertia, pi)

        return velocities, velocities

    @wp.func
    def velocities_of_state(inertia: Any, p: Any, pi: Any):
        """Om = Js^-1 (pi - E^T p), nu = M^-1 p - E Om."""
        Om = turning(inertia, pi - transpose_times(inertia.E, p))
        return velocity(inertia, p) - apply(inertia.E, Om), Om

    @wp.func
    def velocities_of_forces(inertia: Any, p: Any, pi: Any):
        """The same at the origin of the forces."""
        Om = turning(inertia, pi - transpose_times(inertia.E_forces, p))
        return velocity(inertia, p) - apply(inertia.E_forces, Om), Om

    return velocities_of_state, velocities_of_forces


def make_damping(damping, shear, loads):
    """D of the damping laws, and of water that varies in space. None if there is neither, nor loads, which have their own."""
    if damping is None and shear is None and loads is None:
        return None

    @wp.func
    def total(D: Any, view: Any, water: Any, c: Any):
        if wp.static(damping is not None):
            D = damping(D, view, c.params)
        if wp.static(shear is not None):
            D = shear(D, view, c.inertia, water)
        return D

    return total


def make_resistance(damping, loads, Wrench):
    """D of all that resists: of damping laws, of water that varies, and of laws that look at the water."""

    @wp.func
    def resistance(D: Any, view: Any, water: Any, c: Any):
        D, unused = loads(damping(D, view, water, c), Wrench(), view, c.params)
        return D

    return resistance


def make_exact_drag(spec, velocities_of_forces):
    """(prepare, E) of drag by its exact flow; None for both where the Spec has none."""
    if not spec.dragged:
        return None, None
    if spec.laws[0] is drag:
        prepare, exact = drag.make_E(spec.drag, spec.compensated)
    else:
        prepare, exact = drag_directions.make_E(spec.drag, velocities_of_forces)

    @wp.func
    def E(x: Any, c: Any, h: Any):
        """Drag by its exact flow. c.drag has the constants for the whole step h; for another length they are made here."""
        if h == c.drag.h:
            x = exact(x, c.drag, c)
        else:
            x = exact(x, prepare(c.drag, c.params.own, h), c)
        return x

    return prepare, E


def maps_of(spec, letters):
    """The maps of a step after its lead, with their coefficients."""
    pitched = spec.coupling[3:]
    maps = []
    for i, (letter, coefficient) in enumerate(spec.maps):
        if letter[0] == "R":
            # The axes of the turns from here on, over the end of the step into the next one.
            axes = [int(name[1]) - 1 for name, _ in (*spec.maps[i:], *spec.maps[:i]) if name[0] == "R"]
            following = next((axis for axis in axes if axis != axes[0]), axes[0])
            watched = spec.checked and not any(name[0] == "R" for name, _ in spec.maps[i + 1 :])
            turn = turns.make_turn(axes[0], pitched[axes[0]], following, spec.compensated, watched)
            maps.append((turn, coefficient))
        else:
            maps.append((letters[letter], coefficient))
    return tuple(maps)


def make_method(spec):
    """The functions of a method for this Spec."""
    width, real = spec.lanes, spec.real
    View = view_struct(width, real, spec.shared_rows)
    Wrench, Flow, Damping = (make(width, real) for make in (wrench_struct, flow_struct, damping_struct))
    coupled, shifted = "coupled" in spec.parts, "origin" in spec.parts
    velocity = isotropic_velocity if spec.mass == "isotropic" else anisotropic_velocity
    if spec.explicit and spec.mass == "diagonal":
        velocity = direct_velocity
    turning = multiplied if spec.explicit else divided
    velocities, velocities_of_forces = make_velocities(velocity, turning, coupled)
    if spec.inverse:
        velocities = velocities_of_forces = make_dense_velocities(spec.inverse)
    laws = spec.laws
    law, laws_damping, flow, evolve = (superpose(laws, role) for role in ("law", "damping", "flow", "evolve"))
    varies, lever = spec.flow in ("uniform", "varying"), "lever" in spec.parts
    shear, water_wrench = None, acceleration_wrench if varies else None
    if "shear" in spec.parts:
        shear, water_wrench = make_shear(matrix3_struct(width, real), lever, shifted), make_water_wrench(lever, shifted)
    loads = superpose_loads(laws)
    damping = make_damping(laws_damping, shear, loads)
    prepare, E = make_exact_drag(spec, velocities_of_forces)

    @wp.func
    def water_velocity(x: Any, c: Any, h: Any):
        """R^T u where the vehicle is."""
        view = look(View(), x, c, h)
        if wp.static(shifted):
            view.b = view.b + rotate(x, c.inertia.user_origin)
        return to_body(view, flow(Flow(), view, c.params).velocity)

    if spec.explicit is not None:
        wrenches = superpose(laws, "settled_push"), superpose(laws, "matrix")
        law = superpose(laws, "settled_law")
        rest = superpose_loads(laws, without_push=True)
        resistance = damping if loads is None else make_resistance(damping, loads, Wrench)
        acting = (View, Wrench, Flow, Damping, law, *wrenches, resistance, flow, water_wrench, shifted, velocities)
        everything, _, _, slope = make_forces(*acting, rest)
        step = make_explicit(spec, make_types(spec), everything, velocities, slope)
        momentum = in_body if spec.inertial else None
        return Step(step, step, velocities, prepare, water_velocity, velocities_of_forces, momentum)
    V = None
    if damping is not None and spec.averages is None:
        Factor = factor_struct(width, real)
        if loads is None:
            V = make_V(damping, velocities_of_forces, Damping, Factor, coupled)
        else:
            V = make_loaded_V(damping, loads, velocities_of_forces, Damping, Wrench, Factor, coupled)
    solve, solve_within = make_solve(real, spec.solver, spec.iterations, spec.adaptive, spec.checked, spec.tangents)
    used = {letter for letter, _ in spec.maps} | ({spec.lead[0]} if spec.lead else set())
    letters = {
        "Ab": make_Ab(velocity, spec.timed),
        "Ap": Ap,
        "T": make_T(spec.timed, spec.compensated),
        "D": make_D(rotation_struct(width, real), solve, spec.compensated),
    }
    if "K" in used:
        kick_account = make_kick_account(laws, velocities_of_forces) if spec.accounted else None
        make_kick = functools.partial(
            make_K, View, Wrench, Flow, law, evolve, flow, varies, shifted, E, V, kick_account
        )
        letters["K"] = make_kick()
    if "W" in used:
        letters["W"] = make_W(rotation_struct(width, real), rotate, spec.iterations, spec.adaptive, spec.checked)
    if "modified" in spec.parts:
        drift = letters["Ab"] if spec.mass == "isotropic" else letters["T"]
        letters["A"] = make_A(rotation_struct(width, real), solve_within, View, Wrench, law)
        letters["B"] = make_B(drift, View, Wrench, law)
    if spec.gauss:
        functions = (View, Wrench, law, velocities)
        letters["G"] = make_G(spec.gauss, *functions, spec.iterations, spec.adaptive, spec.checked, spec.timed)
    U12, U13, U23 = spec.coupling[:3]
    for letter in used:
        if letter[0] == "h":
            letters[letter] = turns.make_hop(int(letter[1]) - 1, int(letter[2]) - 1, U12, U13, U23, spec.compensated)
    if spec.averages is not None:
        force, potential = superpose(laws, "force"), superpose(laws, "potential")
        acting = (
            View,
            Wrench,
            Flow,
            Damping,
            force,
            None,
            laws_damping,
            damping,
            flow,
            water_wrench,
            shifted,
            velocities,
        )
        _, forces, current, _ = make_forces(*acting, loads)
        maps = (letters["Ab"], None if spec.mass == "isotropic" else Ap, letters["D"])
        functions = (View, Wrench, potential, forces, current, evolve, velocities)
        account = make_map_account(View, laws, velocities_of_forces) if spec.accounted else None
        letters["Phi"], letters["Phi*"] = make_phi(maps, functions, *spec.averages, account)
    maps = maps_of(spec, letters)
    if evolve is not None and len(maps) > 1 and spec.maps[0][0] == spec.maps[-1][0] == "K":
        maps = ((make_kick(0.5), maps[0][1]), *maps[1:-1], (make_kick(-0.5), maps[-1][1]))
    step = fold_pair(maps) if spec.paired else fold(maps)
    # Without a lead, step stands in its place, and is called nowhere.
    lead = letters[spec.lead[0]] if spec.lead else step
    return Step(step, lead, velocities, prepare, water_velocity, velocities_of_forces)
