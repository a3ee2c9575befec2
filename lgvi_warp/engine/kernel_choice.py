# SPDX-License-Identifier: Apache-2.0
"""The kernel's contents: the laws that act and their form, and the method's program for them.

They are chosen once for a run from a survey of all members; the members' own numbers follow later, block by block.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.control.base import Part
from lgvi_warp.control.controller import Controller
from lgvi_warp.engine.survey import COUPLINGS, SHAPES_OF_MASS, UNCOUPLED, Survey
from lgvi_warp.methods.method import FORCED, Method, Program, divided, merged, simplified, with_hops
from lgvi_warp.physics import terms, vehicle
from lgvi_warp.physics.terms.base import Term, word_of
from lgvi_warp.physics.terms.noisy import NoisyTerm
from lgvi_warp.scene.ensemble import SURVEYED, Ensemble
from lgvi_warp.scene.oddities import Oddities
from lgvi_warp.scene.slices import over_members


@dataclass(frozen=True)
class KernelChoice:
    """Contents of the kernel of a run."""

    aligned: bool  # the kernel's axes are the user's but for order and sense (see `PackingContext`)
    moved: bool  # the state's origin differs from the user's
    laws: tuple[tuple[Term, Any], ...]  # with their device code; drag by its exact flow comes first
    events: tuple[tuple[Any, Any], ...]  # with their device code
    mass: str  # shape of the mass matrix, one of SHAPES_OF_MASS
    drag: tuple[str, ...]  # parts of drag that are treated by its exact flow
    flow: str  # how the water moves, one of FLOWS
    parts: tuple[str, ...]  # what the inertia holds besides mass and moments of inertia
    inverse: tuple[tuple[int, int], ...]  # entries of the inverse inertia that are not zero; none where it is diagonal
    user_axes: bool  # the kernel's axes and origin are the user's (see SharedResultsCache)
    coupling: tuple[bool, ...]  # (6,), which of U12, U13, U23 and of the three pitches some member has
    timed: bool  # a law or an event depends on the time
    memory: bool  # a law or the method remembers numbers from step to step
    program: Program  # sub-maps of one stage, as (letter, coefficient)
    lead: tuple[str, float] | None  # sub-map that opens a step and merges with the end of the previous one
    averages: tuple[float, float] | None  # alpha and beta of equations (15) and (16); None for conservative sub-maps
    conservative: bool  # no force creates energy and the kernel knows the potential of every force
    steady: bool  # forces are constant in inertial axes
    odd: Oddities  # what the user should know about the members' numbers
    controller: Controller | None = None  # as it is for these members
    parts_of_control: tuple[tuple[Part, Any], ...] = ()  # with their device code, as they act
    given: bool = False  # the call gives the standard normals that noise and sensors take
    resisted: bool = False  # a matrix of damping acts, of laws or of water that varies

    @property
    def account(self) -> int | None:
        """Number of the law that accounts for the energy used; None if there is none."""
        return next((i for i, (term, _) in enumerate(self.laws) if term.accounts), None)

    @property
    def has_callback(self) -> bool:
        """Whether a Python function answers each tick."""
        return self.controller is not None and self.controller.callback is not None


def choose_kernel(
    ensemble: Ensemble,
    method: Method,
    facts: Survey,
    built_in: Callable[[str, str], Any],
    checks: str = "safe",
    user_axes: bool = False,
) -> KernelChoice:
    """Choose the contents of a run's kernel.

    built_in: function of (folder, name) that returns built-in device code of the folder "laws" or "stops", or None.
    """
    explicit = method.tableau is not None
    controller = _controller(ensemble, facts)
    parts, given = list[Part](), ensemble.given is not None
    if controller:
        words = {f"{part.key}.given" for part in controller.sensors} if given else frozenset[str]()
        parts = [part.with_features(facts.features | words) for part in controller.acting_parts]
    control = tuple(
        (part, with_tables(part, device_module(part, part.device_in(not facts.turned), built_in))) for part in parts
    )
    acting = _acting(ensemble, facts, built_in, controller, user_axes)
    events = tuple(
        (event, device_module(event, event.device_in(not facts.turned), built_in)) for event in ensemble.scene.events
    )
    damping = any(resists(module) for term, module in acting if not term.exact_flow)
    flow = _flow(acting)
    drags = [term for term, _ in acting if term.exact_flow]
    others = [module for term, module in acting if not (term.carries or term.accounts)]
    # Laws change the inertia: velocities are those of a matrix of each stage.
    carried = any(hasattr(module, "carried_inertia") for _, module in acting)
    forced = method.base in FORCED and not all(getattr(module, "POTENTIAL", False) for module in others)
    if explicit:
        # Along the kernel's axes drag is six numbers and no matrix.
        exact = len(drags) == 1 and not facts.bent and not method.linearly_implicit and not carried
    else:
        exact = len(drags) == 1 and not damping and flow != "varying" and not forced
    drag: tuple[str, ...] = ()
    if exact:
        term = drags[0]
        drag = tuple(sorted(facts.drag))
        module = built_in("laws", term.exact_flow[facts.bent])
        acting = [(term, module), *((t, m) for t, m in acting if t is not term)]
    dense = damping or (bool(drags) and not exact) or flow == "varying"
    # An explicit method adds wrenches; a warning about strong drag still compares a matrix with the inertia.
    whole = carried or (dense and (not explicit or method.linearly_implicit or checks == "all"))
    memory = any(term.memory for term, _ in acting)
    # The account of the energy used acts on nothing: no method loses its order by it.
    remembers = any(term.memory and not term.accounts for term, _ in acting)
    _check(method, facts, dense=dense, flow=flow, memory=remembers, acting=acting)
    mass, coupled = SHAPES_OF_MASS[facts.mass], facts.coupled and not user_axes
    inverse = tuple(sorted(facts.inverse | {(i, i) for i in range(6)})) if facts.inverse else ()
    program = FORCED[method.base] if forced else simplified(method.program, mass == "isotropic" and not coupled)
    # Events, and the host between launches, read states, which must not be those in the middle of a lead.
    states_read = bool(events) or (controller is not None and controller.callback is not None)
    halved = method.halved and (bool(drag) or flow != "none")
    lead, maps = _merged_program(method, program, acting, coupled, halved, states_read)
    conservative = checks != "none" and _conservative(facts, acting)
    # Events, water and the potential are evaluated at the user's origin, or at that of the forces.
    elsewhere = controller is not None or bool(events) or flow != "none" or (conservative and facts.apart)
    contents = {"rates": explicit and not inverse, "inverse": bool(inverse),
                "turns": method.turns, "x": method.turns and coupled, "w": method.base == "psi_w", "coupled": coupled,
                "modified": method.two_part, "dense": whole, "water": flow in ("uniform", "varying"),
                "shear": flow == "varying", "lever": flow == "varying" and facts.lever,
                "origin": bool(elsewhere and (facts.moved or facts.forces_moved)),
                "axes": controller is not None and facts.turned_axes}  # fmt: skip
    return KernelChoice(
        aligned=not facts.turned,
        moved=facts.moved,
        laws=tuple(acting),
        events=events,
        mass="full" if coupled and mass == "isotropic" else mass,
        drag=drag,
        flow=flow,
        inverse=inverse,
        user_axes=user_axes,
        parts=tuple(name for name, wanted in contents.items() if wanted),
        coupling=tuple(i in facts.couplings for i in range(len(COUPLINGS))),
        timed=any(term.timed or term.surface_level for term, _ in (*acting, *events)) or facts.delayed,
        memory=memory or method.gauss > 0,
        program=maps,
        lead=lead,
        averages=(method.alpha, method.beta) if forced else None,
        conservative=conservative,
        odd=facts.odd,
        steady=not drag and flow in ("none", "steady") and all(_steady(module) for _, module in acting),
        controller=controller,
        parts_of_control=control,
        given=given,
        resisted=dense,
    )


def _merged_program(
    method: Method, program: Program, acting: list[tuple[Term, Any]], coupled: bool, halved: bool, states_read: bool
) -> tuple[tuple[str, float] | None, Program]:
    """The sub-map that opens a step and merges with the end of the previous one (None for none), and those of a stage.

    halved: K with drag or water is symmetric but no flow, so each half has its own K. states_read: whether states
        between two steps are read.
    """
    if method.two_part:
        # B merges with that of the next step exactly, A up to the order of the method.
        return (None, method.program) if states_read else (method.program[0], method.program[1:])
    if not acting:
        program = tuple((letter, coefficient) for letter, coefficient in program if letter != "K")
    if method.turns and coupled:
        program = with_hops(program)
    if halved:
        program = divided(program)
    lead, maps = merged(program) if program else (None, ())
    # A kick that is no flow must not be split between two steps, nor the state at which events are evaluated.
    undone = all(getattr(module, "POTENTIAL", False) for _, module in acting)
    if states_read or (lead is not None and lead[0] == "K" and not undone):
        return None, program
    return lead, maps


def _controller(ensemble: Ensemble, facts: Survey) -> Controller | None:
    """The scene's controller, with a delay if a member has one."""
    controller: Controller | None = ensemble.scene.controller
    if controller is None or controller.bus is None:
        return None
    return controller.on(controller.bus._replace(delayed=facts.delayed))


def _steady(module: Any) -> bool:
    """Whether a law's force is constant in inertial axes."""
    return hasattr(module, "steady_force") or not any(
        hasattr(module, role) for role in ("law", "damping", "evolve", "seeing", "carried_inertia")
    )


def resists(module: Any) -> bool:
    """Whether a law's force depends on the velocities, so that a splitting applies it in a step of its own."""
    return hasattr(module, "damping") or hasattr(module, "seeing")


def _conservative(facts: Survey, acting: list[tuple[Term, Any]]) -> bool:
    """Whether no law creates energy, and the device code of each potential computes its energy.

    The kinetic energy is relative to the water.
    """
    anchored = any(term.anchored for term, _ in acting)
    for term, module in acting:
        if term.carries:
            # A uniform current does work against a tether, and its vertical part against weight.
            passive = not anchored and term.key not in facts.rising
        else:
            dissipates = term.dissipative or not hasattr(module, "damping")
            bounded = hasattr(module, "supply") or hasattr(module, "steady_size")
            known_potential = getattr(module, "POTENTIAL", False) and hasattr(module, "energy") and bounded
            blind = not any(hasattr(module, role) for role in ("flow", "seeing", "carried_inertia"))
            passive = blind and dissipates and (known_potential or not hasattr(module, "law"))
        if not passive:
            return False
    return True


# A backward stage accelerates a damped vehicle, and at a drag number of 1 without bound.
MOST_BACKWARD_DRAG = 0.5


def check_backward_drag(ensemble: Ensemble, choice: KernelChoice, method: Method, h: float) -> None:
    """Refuse drag that is too strong for the backward stages of a composition with steps h [s], at the members' starts."""
    if not choice.drag:
        return
    back = -h * min(0.0, *method.stages)
    if back == 0.0:
        return
    term: Any = choice.laws[0][0]

    def largest(first: int, stop: int) -> float:
        members = ensemble.select(first, stop)
        numbers = ensemble.own(term, members.parameters)
        speeds = np.abs(np.concatenate([members.velocity, members.angular_velocity], axis=1))
        # Acceleration per unit force along each of the user's axes, the other axes being free.
        mobilities = np.einsum("nii->ni", np.linalg.inv(vehicle.inertia6(members.parameters)))
        return float((back * term.per_speed(numbers, speeds) * mobilities).max())

    number = max(over_members(largest, min(ensemble.members, SURVEYED)))
    if number > MOST_BACKWARD_DRAG:
        faults = Faults()
        problem = f"goes backward by {back:.3g} s, where {term.key} has a drag number up to {number:.3g}"
        remedy = f"use {method.base}, or a step {number / MOST_BACKWARD_DRAG:.2g} times shorter"
        faults.add("method", method.name, problem, remedy)
        faults.raise_if_any()


# Classes of terms with the names of built-in device code that was found to suit them.
suitable: set[tuple[type, str]] = set()


def device_module(term: Term, device: Any, built_in: Callable[[str, str], Any]) -> Any:
    """Load the module of a term's device code, and check what a kernel needs of it; built_in: as in `choose_kernel`."""
    folder, roles = _folder_and_roles(term)
    page = f"see docs/develop/add_a_{'controller' if isinstance(term, Part) else 'force'}.md"
    module = built_in(folder, device) if isinstance(device, str) else device
    if isinstance(device, str) and (type(term), device) in suitable:
        return _below(term, module, built_in)
    faults = Faults()
    if module is None:
        faults.add(f"{term.key}.device", device, "is not known", "give a module, or the name of a built-in one")
    elif getattr(module, "params", None) is None and term.lanes() is None:
        faults.add(f"{term.key}.device", module, "has no params(width, real)", page)
    elif not any(hasattr(module, role) for role in (*roles, "seeing")):
        faults.add(f"{term.key}.device", module, f"has none of {', '.join(roles)}", page)
    else:
        for role in roles:
            _check_signature(faults, term, module, role)
        if hasattr(module, "seeing"):
            _check_seeing(faults, term, _functions_of(module.seeing), page)
        if hasattr(module, "follow") and not hasattr(module, "evolve"):
            faults.add(f"{term.key}.device", module, "has follow and no evolve", page)
        if hasattr(module, "push") and not hasattr(module, "damping"):
            faults.add(f"{term.key}.device", module, "has push and no damping, which splittings need", page)
        if isinstance(term, NoisyTerm) and not getattr(module, "NOISE", False):
            faults.add(f"{term.key}.device", module, "does not say that it is noise", "write NOISE = True")
        has = hasattr(module, "carried_inertia")
        if has != term.carried:
            fault = f"its device code has {'' if has else 'no '}carried_inertia"
            faults.add(f"{term.key}.carried", term.carried, fault, f"write carried = {has} in {type(term).__name__}")
        elif not has and (hasattr(module, "carried_momentum") or hasattr(module, "depart")):
            faults.add(f"{term.key}.device", module, "has carried_momentum or depart and no carried_inertia", page)
        flow = getattr(module, "FLOW", "none")
        if flow not in FLOWS:
            faults.add(f"{term.key}.FLOW", flow, "is not known", closest(str(flow), FLOWS))
    faults.raise_if_any()
    if isinstance(device, str):
        suitable.add((type(term), device))
    return _below(term, module, built_in)


def _below(term: Term, module: Any, built_in: Callable[[str, str], Any]) -> Any:
    """Device code of a term that acts below the scene's surface; a sensor reads its height itself."""
    if term.surface_level is None or isinstance(term, Part):
        return module
    return built_in("laws", term.surface_level.device).in_tide(module)


def with_tables(part: Any, module: Any) -> Any:
    """Device code of a part whose numbers may be tables, made from code without tables."""
    tables = getattr(part, "gain_tables", None)
    if not tables:
        return module
    kinds = {word_of(item): 3 if item.metadata["shape"] == (3,) else 1 for item in part.number_fields()}
    fields = ((field, kinds[name], table.over) for name, table in tables.items() for field in part.device_fields(name))
    return _tabled(module, part.lanes(), tuple(fields))


@functools.cache
def _tabled(module: Any, lanes: Any, fields: tuple[tuple[str, int, str], ...]) -> Any:
    """The module of `with_tables`, cached, since device code is part of a kernel's key. lanes: see `Term.lanes`."""
    # Where a scene has tables, here: other runs do without this code.
    from lgvi_kernels.laws.control.gain_table import tabled
    from lgvi_kernels.maps.compose import numbers_struct

    of_numbers = functools.partial(numbers_struct, module, lanes)
    return tabled(module, getattr(module, "params", of_numbers), fields)


def _folder_and_roles(term: Term) -> tuple[str, Sequence[str]]:
    """Folder of the built-in device code of a term, an event or a controller part, and the roles that it may define."""
    if isinstance(term, Part):
        return "laws.control", tuple(ARGUMENTS)
    return ("laws", ROLES) if term.acts else ("stops", ("distance",))


def is_built_in(module: Any) -> bool:
    """Whether device code belongs to this package."""
    return str(getattr(module, "__name__", "")).startswith(("lgvi_kernels.", "lgvi_warp."))


def declared(term: Term, module: Any, given: bool = False) -> tuple[tuple[str, Any], ...]:
    """Fields (name, kind) of a term's device struct that its module does not define.

    They are its numbers, unless the module defines `params`, and a noisy term's key (see lgvi_kernels.maps.compose).
    given: as in KernelChoice.
    """
    numbers = (getattr(module, "params", None) is None and term.lanes()) or ()
    if term.driver is not None:
        return (*numbers, ("commands", "delayed" if term.driver.delayed else "held"))
    if isinstance(term, NoisyTerm):
        return (*numbers, ("key", "given" if given else "step" if term.noise_step is None else "grid"))
    return numbers


def seeing_roles(module: Any) -> tuple[str, ...]:
    """Names of the functions that a law with access to the water makes."""
    return tuple(_functions_of(module.seeing)) if hasattr(module, "seeing") else ()


@functools.cache
def _functions_of(seeing: Callable[[Any], Any]) -> Any:
    """Functions of a law with access to the water; cached, since each plan needs them."""
    return seeing(_no_water)


def _no_water(view: Any, point: Any, sea: Any) -> Any:
    """Placeholder for the water while functions are inspected and not called."""


def _check_seeing(faults: Faults, term: Term, functions: Any, page: str) -> None:
    """Add a fault unless a law with access to the water makes the functions that the kernel needs."""
    if not isinstance(functions, dict) or "load" not in functions or set(functions) - set(SEEING):
        faults.add(f"{term.key}.seeing", functions, "is not a dict with load, and push if you like", page)
        return
    for role, function in functions.items():
        _check_function(faults, term, role, function, SEEING[role])


def _check_signature(faults: Faults, term: Term, module: Any, role: str) -> None:
    """Add a fault unless a role is a Warp function with as many arguments as the kernel passes."""
    function = getattr(module, role, None)
    if function is not None:
        arguments = ARGUMENTS.get(role, "view, p" if role == "distance" else "w, view, p")
        _check_function(faults, term, role, function, arguments)


def _check_function(faults: Faults, term: Term, role: str, function: Any, arguments: str) -> None:
    wanted = arguments.count(",") + 1
    names = list(getattr(function, "input_types", {}))
    if not names:
        faults.add(f"{term.key}.{role}", function, "is not a Warp function", "decorate it with @wp.func")
    elif len(names) != wanted:
        remedy = f"write {role}({arguments})"
        faults.add(f"{term.key}.{role}", f"({', '.join(names)})", f"takes {len(names)} arguments", remedy)


ROLES = ("law", "damping", "push", "flow", "evolve", "follow", "carried_inertia", "carried_momentum", "depart", "power")
# What a law makes that looks at the water, with the arguments.
SEEING = {"load": "D, w, view, p, sea", "push": "w, view, p, sea"}
# Roles of a controller's parts, with their arguments.
ARGUMENTS = {"measure": "y, p", "guide": "r, y, p", "control": "w, r, y, p", "allocate": "w, y, p", "send": "y, p"}
# How water may move, the most special first.
FLOWS = ("none", "steady", "uniform", "varying")


def _acting(
    ensemble: Ensemble,
    facts: Survey,
    built_in: Callable[[str, str], Any],
    controller: Controller | None,
    user_axes: bool,
) -> list[tuple[Term, Any]]:
    """Terms that affect at least one member, with their device code, in a fixed order."""

    def device_of(term: Term) -> Any:
        entries = [word.removeprefix(f"{term.key}.") for word in facts.features if word.startswith(f"{term.key}.")]
        if user_axes and term.pattern_device and entries:
            return f"{term.pattern_device}:{','.join(sorted(entries))}"
        return term.device_in(not facts.turned)

    acting = [(term, built_in("laws", term.device)) for term in terms.IMPLIED]
    listed = [term.driven_by(controller.bus) if term.driver and controller else term for term in ensemble.scene.terms]
    acting += [(term, device_module(term, device_of(term), built_in)) for term in listed]
    return [(term, module) for term, module in acting if term.key in facts.felt]


def _flow(acting: list[tuple[Term, Any]]) -> str:
    """Kind of the water's motion: the most general FLOW of the laws."""
    return max((getattr(module, "FLOW", "none") for _, module in acting), key=FLOWS.index, default="none")


def _check(
    method: Method, facts: Survey, *, dense: bool, flow: str, memory: bool, acting: list[tuple[Term, Any]]
) -> None:
    """Raise SceneError, with the reason, if the method does not support the scene."""
    faults = Faults()
    if facts.residual_coupling > UNCOUPLED:
        k = f"coupling norm up to {facts.residual_coupling:.3g} at the best origin"
        remedy = "use psi_x, psi_x8 or psi_w, which take any 6x6 inertia"
        faults.add("method", method.name, f"cannot advance an inertia that couples velocities and rates ({k})", remedy)
    composed = len(method.stages) > 1
    noisy = any(getattr(module, "NOISE", False) for _, module in acting)
    undone = not (dense or flow in ("uniform", "varying") or memory or noisy)
    # One that takes what this method does not.
    plain = "psi_x" if facts.residual_coupling > UNCOUPLED else "psi_s"
    if composed and not method.two_part and not undone:
        causes = {"a damping matrix": dense, "water that varies": flow in ("uniform", "varying"), "noise": noisy}
        cause = next((cause for cause, present in causes.items() if present), "a term that remembers")
        faults.add("method", method.name, f"keeps its order only if a step of -h undoes one of h, and {cause} prevents that",
                   f"use {method.base}")  # fmt: skip
    for term, module in acting:
        if method.two_part and not getattr(module, "SEPARABLE", False):
            remedy = "use ss6_13(psi_x), or bm6(psi_x)" if undone else f"use {plain}"
            problem = f"needs potentials of position plus those of attitude; {term.key} has none such"
            faults.add("method", method.name, problem, remedy)
        if method.gauss and ([role for role in ROLES if hasattr(module, role) and role != "power"] != ["law"]
                             or term.exact_flow or getattr(module, "NOISE", False) or hasattr(module, "seeing")):  # fmt: skip
            problem = f"takes forces of position and time only, which {term.key} is not"
            faults.add("method", method.name, problem, f"use {plain}")
    moving = [term.key for term, module in acting if hasattr(module, "carried_inertia")]
    if moving and method.tableau is None:
        problem = f"takes one inertia for all times, which {' and '.join(moving)} changes"
        faults.add(
            "method", method.name, problem, "use a Runge-Kutta method, such as rk4, or inertia = false of a mass"
        )
    for term, module in acting:
        if method.tableau is None or not term.memory or term.accounts:
            continue
        if not (hasattr(module, "follow") or hasattr(module, "depart")):
            problem = f"cannot advance {term.key}, a term that remembers what is not known between steps"
            faults.add("method", method.name, problem, "use psi_s, psi_x or psi_w")
        elif min(method.tableau.c) < 0.0:
            problem = f"has a stage before the step's start, where it is not known what {term.key} remembers"
            faults.add("method", method.name, problem, "use rkmk4")
    if method.adaptive and noisy:
        why = "cannot choose its steps where noise is drawn once a step"
        faults.add("method", method.name, why, "leave out rtol and atol")
    kicks = sum(letter in ("K", "Phi", "Phi*") for letter, _ in method.program)
    if noisy and not composed and not method.tableau and kicks != 1:
        faults.add("method", method.name, "would draw noise more than once a step", "use psi_s, psi_x or psi_w")
    if flow in ("uniform", "varying") and facts.weightless and facts.buoyant:
        faults.add("environment.gravity", 0.0, "leaves the displaced mass unknown, on which accelerating water pushes",
                   "give gravity, or buoyancy = 0")  # fmt: skip
    faults.raise_if_any()
