"""What the numbers of all members ask of a kernel, looked at so many members at a time that memory stays small."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.methods.method import Method, middle_axis
from lgvi_warp.physics import inertia, terms, vehicle
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.terms.base import Setting
from lgvi_warp.physics.terms.drag import Drag, has_exact_flow
from lgvi_warp.scene.ensemble import Ensemble, over_members
from lgvi_warp.scene.oddities import Oddities
from lgvi_warp.scene.plausibility import of_numbers

Parameters = Mapping[str, np.ndarray]

# Off-diagonal elements below this fraction of the largest element are the round-off of turning the axes.
DIAGONAL = 1e-14
# A coupling norm below this is the round-off of moving the origin.
UNCOUPLED = 1e-9

# By rank: a kernel for one does for those before it.
SHAPES_OF_MASS = ("isotropic", "diagonal", "full")
# Which of the matrix U of psi_x a kernel may have.
COUPLINGS = ((0, 1), (0, 2), (1, 2), (0, 0), (1, 1), (2, 2))


def shape_of_mass(M: np.ndarray) -> str:
    """ "isotropic", "diagonal" or "full": the simplest that holds every matrix of M (n, 3, 3)."""
    off = np.abs(M[:, ~np.eye(3, dtype=bool)]).max(axis=1)
    diagonal = np.einsum("nii->ni", M)
    if np.any(off > DIAGONAL * np.abs(diagonal).max(axis=1)):
        return "full"
    return "isotropic" if np.all(diagonal == diagonal[:, :1]) else "diagonal"


def frame_of(method: Method, parameters: Parameters) -> tuple[Frame, np.ndarray, np.ndarray]:
    """The frame that the method wants, U (n, 3, 3) of the turns (zero without), and the coupling (n,) that it cannot have."""
    I6 = vehicle.inertia6(parameters)
    left = np.zeros(len(I6))
    if method.turns:
        return *inertia.turns_frame(I6, middle_axis(method.program)), left
    if method.base == "psi_w":
        frame = inertia.symmetric_frame(I6)
    elif method.tableau:
        frame = _explicit_frame(I6)
    else:
        frame, left = inertia.uncoupled_frame(I6)
    return frame, np.zeros_like(frame.M), left


def _explicit_frame(I6: np.ndarray) -> Frame:
    """Where E is symmetric, so that a vehicle without coupling has none in the kernel."""
    frame = inertia.symmetric_frame(I6)
    left = inertia.uncoupled_frame(I6)[1]
    E = np.where(left[:, None, None] > UNCOUPLED, frame.E, 0.0)
    return replace(frame, E=E, E_forces=E)


@dataclass(frozen=True)
class Survey:
    """What is so for some member of a run, and largest values.

    turned: axes that are not the user's, or forces about another origin (see Setting.aligned); bent: no exact flow of drag
    along the kernel's axes; mass: rank among SHAPES_OF_MASS; coupled: velocities and rates; moved, forces_moved: the
    origins of the state and of the forces are not the user's; apart: nor the same; couplings: indices among COUPLINGS of
    what U has; left: the largest coupling norm that the method cannot have.
    felt: keys of the terms; drag: parts of the exact flow; rising: keys of currents with a vertical velocity.
    weightless: no gravity; buoyant: buoyancy. odd: what is, of the members' numbers.
    """

    turned: bool
    bent: bool
    mass: int
    coupled: bool
    moved: bool
    forces_moved: bool
    apart: bool
    couplings: frozenset[int]
    left: float
    felt: frozenset[str]
    drag: frozenset[str]
    rising: frozenset[str]
    weightless: bool
    buoyant: bool
    odd: Oddities

    def joined(self, other: Survey) -> Survey:
        """Of the members of both."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Survey(*(a | b if isinstance(a, frozenset | Oddities) else max(a, b) for a, b in pairs))


def survey(ensemble: Ensemble, method: Method, h: float) -> Survey:
    """Look at all members; at one alone where no number of the vehicle, the water or the laws varies."""

    def look(first: int, stop: int) -> Survey:
        # A member too large for its arithmetic gets its status, or its fault, elsewhere; NumPy need not remark.
        with np.errstate(over="ignore", invalid="ignore"):
            return _look(ensemble, method, h, first, stop)

    return functools.reduce(Survey.joined, over_members(look, ensemble.members if ensemble.varied() else 1))


def _look(ensemble: Ensemble, method: Method, h: float, first: int, stop: int) -> Survey:
    p = ensemble.parameters(first, stop)
    frame, U, left = frame_of(method, p)
    setting = Setting(p, frame, ensemble.indices_of(first, stop), ensemble.seed, h, frame.aligned)
    implied = {t.key for t in terms.IMPLIED if any(np.any(v) for v in t.packed({}, setting).values.values())}
    own = {term.key: (term, ensemble.own(term, p)) for term in ensemble.scene.terms}
    return Survey(
        turned=not frame.aligned,
        bent=not has_exact_flow(frame),
        mass=SHAPES_OF_MASS.index(shape_of_mass(frame.M)),
        coupled=frame.coupled,
        moved=bool(np.any(frame.origin)),
        forces_moved=bool(np.any(frame.forces)),
        apart=bool(np.any(frame.origin != frame.forces)),
        couplings=frozenset(i for i, at in enumerate(COUPLINGS) if np.any(U[:, *at])),
        left=float(left.max()),
        felt=frozenset(implied | {key for key, (term, numbers) in own.items() if term.present(numbers)}),
        drag=frozenset(
            part for term, numbers in own.values() if isinstance(term, Drag) for part in term.parts(numbers)
        ),
        rising=frozenset(
            key for key, (term, numbers) in own.items() if term.type == "current" and np.any(numbers["velocity"][:, 2])
        ),
        weightless=bool(np.any(p["environment.gravity"] == 0.0)),
        buoyant=bool(np.any(p["vehicle.buoyancy"])),
        odd=of_numbers(ensemble.scene, p, first, stop),
    )
