# SPDX-License-Identifier: Apache-2.0
"""A survey of all members: the kernel features that their numbers require, read in slices to limit memory."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.engine.block import Block
from lgvi_warp.engine.shared import AXES, FRAME, MEMBERS, SharedResultsCache, context
from lgvi_warp.methods.method import Method, middle_axis
from lgvi_warp.physics import inertia, notation, terms, vehicle
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.terms.base import Term
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.oddities import Oddities
from lgvi_warp.scene.plausibility import of_numbers
from lgvi_warp.scene.slices import AT_ONCE, over_members

Parameters = Mapping[str, np.ndarray]

# Off-diagonal elements below this fraction of the largest element are round-off from turning the axes.
DIAGONAL = 1e-14
# A coupling norm below this is round-off from moving the origin.
UNCOUPLED = 1e-9

# By rank: a kernel for one shape also serves those before it.
SHAPES_OF_MASS = ("isotropic", "diagonal", "full")
# Entries of the matrix U of psi_x that a kernel may hold.
COUPLINGS = ((0, 1), (0, 2), (1, 2), (0, 0), (1, 1), (2, 2))


def shape_of_mass(M: np.ndarray) -> str:
    """Simplest shape that fits every mass matrix (n, 3, 3) [kg]."""
    diagonal = np.einsum("nii->ni", M)
    if notation.only_diagonal(M) is None:
        off = notation.off_diagonal(M)
        if (np.abs(off).max(axis=1) > DIAGONAL * np.abs(diagonal).max(axis=1)).any():
            return "full"
    return "isotropic" if (diagonal == diagonal[:, :1]).all() else "diagonal"


def frame_of(method: Method, parameters: Parameters, user_axes: bool = False) -> tuple[Frame, np.ndarray, np.ndarray]:
    """Axes and origins of a method. user_axes: whether they are the user's (see SharedResultsCache).

    Returns: (frame, U, coupling): U (n, 3, 3) of the turns of psi_x, zero for other methods; and the norm (n,) of the
        coupling that remains in this frame and that the method does not support.
    """
    return _frame_of(method, user_axes, vehicle.inertia_blocks(parameters))


def _frame_of(method: Method, user_axes: bool, body: inertia.Blocks) -> tuple[Frame, np.ndarray, np.ndarray]:
    coupling = np.zeros(1)
    if user_axes:
        return inertia.user_frame(body), np.zeros((1, 3, 3)), coupling
    if method.turns:
        return *inertia.turns_frame(body, middle_axis(method.program)), coupling
    if method.base == "psi_w":
        frame = inertia.symmetric_frame(body)
    elif method.tableau:
        frame = _explicit_frame(body)
    else:
        frame, coupling = inertia.uncoupled_frame(body)
    return frame, np.zeros((1, 3, 3)), coupling


def _explicit_frame(body: inertia.Blocks) -> Frame:
    """Frame about the origin at which E is symmetric, with E set to zero for members without coupling."""
    frame = inertia.symmetric_frame(body)
    coupling = inertia.uncoupled_frame(body)[1]
    E = np.where(coupling[:, None, None] > UNCOUPLED, frame.E, 0.0)
    return replace(frame, E=E, E_forces=E)


@dataclass(frozen=True)
class Survey:
    """Features that at least one member has, and the largest values."""

    turned: bool  # axes other than the user's, or forces about another origin (see `PackingContext.aligned`)
    bent: bool  # drag acts and has no exact flow along the kernel's axes
    mass: int  # rank of the mass matrix among SHAPES_OF_MASS
    coupled: bool  # velocities and angular velocities are coupled
    moved: bool  # the origin of the state is not the user's
    forces_moved: bool  # the origin of the forces is not the user's
    apart: bool  # the two origins differ
    couplings: frozenset[int]  # indices among COUPLINGS of the non-zero entries of U
    residual_coupling: float  # largest coupling norm that the method cannot treat
    felt: frozenset[str]  # keys of the terms that act
    drag: frozenset[str]  # parts of the exact flow of drag
    rising: frozenset[str]  # keys of currents with a vertical velocity
    weightless: bool  # gravity is zero
    buoyant: bool  # buoyancy is not zero
    odd: Oddities  # what is odd about the members' numbers
    delayed: bool = False  # the commands of a controller are delayed
    turned_axes: bool = False  # axes other than the user's, even if only in their order or sense
    features: frozenset[str] = frozenset()  # what the device code of a controller's parts must have, as "key.feature"
    # Entries of the inverse inertia beside its diagonal, in the user's axes.
    inverse: frozenset[tuple[int, int]] = frozenset()
    lever: bool = False  # the dry body's centre is off the user's origin, or added mass couples there

    @property
    def decisive(self) -> tuple[Any, ...]:
        """Everything that determines a kernel's contents: surveys that are equal in it lead to one kernel."""
        facts = vars(self) | {"odd": None, "residual_coupling": self.residual_coupling > UNCOUPLED}
        return tuple(facts.values())

    def covers(self, other: Survey) -> bool:
        """Whether a kernel chosen by this survey also serves the members of the other survey."""
        return self.joined(other).decisive == self.decisive

    def joined(self, other: Survey) -> Survey:
        """The survey of the members of both."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Survey(*(a | b if isinstance(a, frozenset | Oddities) else max(a, b) for a, b in pairs))


def survey(
    ensemble: Ensemble,
    method: Method,
    shared: SharedResultsCache | None = None,
    odd: bool = True,
    most: int | None = None,
) -> Survey:
    """Survey the first `most` members (None: all), or one member if no number of vehicle, water or laws varies."""
    known = SharedResultsCache({*ensemble.varied_names, MEMBERS}) if shared is None else shared

    def look(first: int, stop: int) -> Survey:
        # Members that overflow get their status, or their fault, elsewhere: no warning from NumPy.
        with np.errstate(over="ignore", invalid="ignore"):
            return _survey_of_slice(ensemble.parameters(first, stop), ensemble, method, known, odd, first, stop)

    count = min(ensemble.members, most or ensemble.members) if ensemble.varied() else 1
    if not odd and count <= AT_ONCE:
        return _again(ensemble, method, known, count) or look(0, count)
    return functools.reduce(Survey.joined, over_members(look, count))


class _Asked(NamedTuple):
    """A survey, and its questions whose answers may vary: (key, function of numbers, answer)."""

    scene: Any
    method: Method
    questions: tuple[tuple[Any, Callable[[Any], Any], Any], ...]
    survey: Survey


def _again(ensemble: Ensemble, method: Method, shared: SharedResultsCache, count: int) -> Survey | None:
    """Earlier survey, if these members give the same answers to all questions that may vary; else None."""
    last = shared.surveyed
    if last is None or last.scene is not ensemble.scene or last.method is not method:
        return None
    with np.errstate(over="ignore", invalid="ignore"):
        p = framed(method, ensemble.parameters(0, count), shared)
        same = all(shared(key, p, ask) == answer for key, ask, answer in last.questions)
    survey: Survey = last.survey
    return survey if same else None


def survey_of(
    parameters: Parameters, ensemble: Ensemble, method: Method, shared: SharedResultsCache, block: Block
) -> Survey:
    """Survey the members of one block, whose parameters are already drawn."""
    return _survey_of_slice(parameters, ensemble, method, shared, False, block.first, block.stop)


def framed(method: Method, parameters: Parameters, shared: SharedResultsCache) -> dict[str, Any]:
    """Parameters with the frame of `frame_of` under FRAME; under AXES the same frame without its mass matrix."""
    completed: dict[str, Any] | None = shared.completed(parameters)
    if completed is not None:
        return completed
    p: dict[str, Any] = dict(parameters)
    user_axes = shared.user_axes
    if "vehicle.mass" in p:
        # Without coupling the axes do not depend on the mass.
        nothing = np.eye(3)[None], np.zeros((1, 3, 3))
        p[AXES] = shared(
            AXES, p, lambda n: _frame_of(method, user_axes, inertia.Blocks(*nothing, n["vehicle.inertia"]))
        )
        if not shared.keeps(AXES):
            shared.varied.add(AXES)
        mass = shared("mass", p, _mass_in_axes)
        frame = p[AXES][0].with_mass(mass)
        if user_axes:
            frame = inertia.user_frame_with_mass(p[AXES][0], mass, p["vehicle.inertia"])
        p[FRAME] = frame, *p[AXES][1:]
        if not (shared.keeps(AXES) and shared.keeps("mass")):
            shared.varied.add(FRAME)
    else:
        p[AXES] = p[FRAME] = shared(FRAME, p, functools.partial(frame_of, method, user_axes=user_axes))
        if not shared.keeps(FRAME):
            shared.varied.update((FRAME, AXES))
    shared.remember(parameters, p)
    return p


def _mass_in_axes(numbers: Any) -> np.ndarray:
    """Mass matrices (n, 3, 3) in the kernel's axes, for a vehicle whose mass does not change these axes."""
    axes, matrices = numbers[AXES][0], vehicle.mass_matrix(numbers)
    return inertia.in_axes(axes.Q, matrices) if axes.turned else matrices


def _survey_of_slice(
    parameters: Parameters,
    ensemble: Ensemble,
    method: Method,
    shared: SharedResultsCache,
    odd: bool,
    first: int,
    stop: int,
) -> Survey:
    p = framed(method, parameters, shared)
    scene, numbers_of = ensemble.scene, ensemble.own
    questions: list[tuple[Any, Callable[[Any], Any], Any]] = []

    def ask(key: Any, compute: Callable[[Any], Any]) -> Any:
        answer = shared(key, p, compute)
        if not shared.keeps(key):
            questions.append((key, compute, answer))
        return answer

    aligned = ask("aligned", lambda numbers: numbers[AXES][0].aligned)

    def is_felt(term: Term, numbers: Any) -> bool:
        if term not in terms.IMPLIED:
            return term.present(numbers_of(term, numbers))
        # Weight and buoyancy depend neither on the step nor on which members these are.
        run = ensemble.indices_of(first, stop), ensemble.seed, math.nan, aligned

        def pack(own: Any) -> Any:
            frame = dict.__getitem__(own, FRAME)[0]  # the context notes whether it is read
            return term.packed({}, context(own, frame, *run))

        packed = shared(("implied", term.key), numbers, pack)
        return any(value.any() for value in packed.values.values())

    def parts(term: Any, numbers: Any) -> frozenset[str]:
        return frozenset(term.parts(numbers_of(term, numbers)))

    def rises(term: Term, numbers: Any) -> bool:
        term_numbers = numbers_of(term, numbers)
        count = max(map(len, term_numbers.values()))
        water = term.water(term_numbers, np.zeros((1, count, 3)), np.zeros(1), numbers)
        return water is not None and bool(np.any(water[..., 2]))

    def of_each(name: str, compute: Any, laws: Iterable[Term]) -> dict[str, Any]:
        return {t.key: ask((name, t.key), functools.partial(compute, t)) for t in laws}

    felt = of_each("felt", is_felt, (*terms.IMPLIED, *scene.terms))
    drags = of_each("drag", parts, (term for term in scene.terms if term.exact_flow))
    rising = of_each("rises", rises, (term for term in scene.terms if term.carries))
    parts_of_control = scene.controller.parts if scene.controller else ()
    features = of_each("features", lambda part, numbers: part.features(numbers_of(part, numbers)), parts_of_control)
    if shared.user_axes:
        matrices = (term for term in scene.terms if term.pattern_device)
        features |= of_each("entries", lambda term, numbers: term.entries(numbers_of(term, numbers)), matrices)
    of_axes = ask("facts of axes", lambda numbers: _facts(*numbers[AXES]))
    mass = ask("shape of mass", lambda numbers: SHAPES_OF_MASS.index(shape_of_mass(numbers[FRAME][0].M)))
    found = Survey(
        **of_axes,
        mass=mass,
        bent=bool(drags) and not ask("exact flow", lambda numbers: numbers[FRAME][0].principal),
        felt=frozenset(key for key, yes in felt.items() if yes),
        drag=frozenset().union(*drags.values()),
        rising=frozenset(key for key, yes in rising.items() if yes),
        weightless=ask("weightless", lambda numbers: bool(np.any(numbers["environment.gravity"] == 0.0))),
        buoyant=ask("buoyant", lambda numbers: bool(np.any(numbers["vehicle.buoyancy"]))),
        delayed="controller.delay" in p
        and ask("delayed", lambda numbers: bool(np.any(numbers["controller.delay"] > 0.0))),
        lever=ask("lever", vehicle.lopsided),
        inverse=ask("inverse", lambda numbers: _entries_beside(numbers[FRAME][0])),
        features=frozenset(f"{key}.{word}" for key, words in features.items() for word in words),
        odd=of_numbers(scene, p, first, stop, shared) if odd else Oddities({}),
    )
    if not odd:
        shared.surveyed = _Asked(scene, method, tuple(questions), found)
    return found


def _entries_beside(frame: Frame) -> frozenset[tuple[int, int]]:
    """Off-diagonal entries (i, j) of the inverse of a whole inertia that are not zero for some member."""
    if frame.whole is None:
        return frozenset()
    size = np.sqrt(np.abs(np.einsum("nii->ni", frame.inverse)))
    found = (np.abs(frame.inverse) > DIAGONAL * size[:, :, None] * size[:, None, :]).any(axis=0)
    return frozenset((i, j) for i, j in np.argwhere(found).tolist() if i != j)


def _facts(frame: Frame, U: np.ndarray, coupling: np.ndarray) -> dict[str, Any]:
    """Survey of the axes and origins of some members."""
    return {
        "turned": not frame.aligned,
        "turned_axes": bool(np.any(notation.EYE != frame.Q)),
        "coupled": frame.coupled,
        "moved": bool(np.any(frame.origin)),
        "forces_moved": bool(np.any(frame.forces)),
        "apart": bool(np.any(frame.origin != frame.forces)),
        "couplings": frozenset(i for i, at in enumerate(COUPLINGS) if np.any(U[:, *at])),
        "residual_coupling": float(coupling.max()),
    }
