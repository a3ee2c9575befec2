"""A survey of all members: what their numbers require of a kernel, read in slices so that memory use stays small."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from lgvi_warp.methods.method import Method, middle_axis
from lgvi_warp.physics import inertia, terms, vehicle
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.terms.base import PackingContext
from lgvi_warp.physics.terms.drag import Drag, has_exact_flow
from lgvi_warp.scene.ensemble import Ensemble, over_members
from lgvi_warp.scene.oddities import Oddities
from lgvi_warp.scene.plausibility import of_numbers

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
    """The simplest shape that fits every mass matrix.

    Args:
        M: (n, 3, 3) [kg], mass matrices.

    Returns:
        "isotropic", "diagonal" or "full".
    """
    off = np.abs(M[:, ~np.eye(3, dtype=bool)]).max(axis=1)
    diagonal = np.einsum("nii->ni", M)
    if np.any(off > DIAGONAL * np.abs(diagonal).max(axis=1)):
        return "full"
    return "isotropic" if np.all(diagonal == diagonal[:, :1]) else "diagonal"


def frame_of(method: Method, parameters: Parameters) -> tuple[Frame, np.ndarray, np.ndarray]:
    """The axes and origins that a method works in.

    Args:
        method: the integration method.
        parameters: parameters of n members by name.

    Returns:
        (frame, U, coupling): the frame; U (n, 3, 3) of the turns of psi_x, zero for other methods; and the coupling
        norm (n,) that is left in this frame and that the method cannot treat.
    """
    I6 = vehicle.inertia6(parameters)
    coupling = np.zeros(len(I6))
    if method.turns:
        return *inertia.turns_frame(I6, middle_axis(method.program)), coupling
    if method.base == "psi_w":
        frame = inertia.symmetric_frame(I6)
    elif method.tableau:
        frame = _explicit_frame(I6)
    else:
        frame, coupling = inertia.uncoupled_frame(I6)
    return frame, np.zeros_like(frame.M), coupling


def _explicit_frame(I6: np.ndarray) -> Frame:
    """The frame about the origin where E is symmetric, with E set to zero for members without coupling."""
    frame = inertia.symmetric_frame(I6)
    coupling = inertia.uncoupled_frame(I6)[1]
    E = np.where(coupling[:, None, None] > UNCOUPLED, frame.E, 0.0)
    return replace(frame, E=E, E_forces=E)


@dataclass(frozen=True)
class Survey:
    """What holds for at least one member, and the largest values.

    Attributes:
        turned: axes other than the user's, or forces about another origin (see `PackingContext.aligned`).
        bent: drag has no exact flow along the kernel's axes.
        mass: rank of the mass matrix among SHAPES_OF_MASS.
        coupled: velocities and angular velocities are coupled.
        moved: the origin of the state is not the user's.
        forces_moved: the origin of the forces is not the user's.
        apart: the two origins differ.
        couplings: indices among COUPLINGS of the non-zero entries of U.
        left: largest coupling norm that the method cannot treat.
        felt: keys of the terms that act.
        drag: parts of the exact flow of drag.
        rising: keys of currents with a vertical velocity.
        weightless: gravity is zero.
        buoyant: buoyancy is not zero.
        odd: what is odd about the members' numbers.
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
        """The survey of the members of both.

        Args:
            other: survey of other members.

        Returns:
            The joint survey.
        """
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Survey(*(a | b if isinstance(a, frozenset | Oddities) else max(a, b) for a, b in pairs))


def survey(ensemble: Ensemble, method: Method, h: float) -> Survey:
    """Look at all members, or at one alone where no number of the vehicle, the water or the laws varies.

    Args:
        ensemble: the members.
        method: the integration method.
        h: step [s].

    Returns:
        What holds for at least one member, and the largest values.
    """

    def look(first: int, stop: int) -> Survey:
        # Members that overflow get their status, or their fault, elsewhere: no warning from NumPy.
        with np.errstate(over="ignore", invalid="ignore"):
            return _look(ensemble, method, h, first, stop)

    return functools.reduce(Survey.joined, over_members(look, ensemble.members if ensemble.varied() else 1))


def _look(ensemble: Ensemble, method: Method, h: float, first: int, stop: int) -> Survey:
    p = ensemble.parameters(first, stop)
    frame, U, coupling = frame_of(method, p)
    context = PackingContext(p, frame, ensemble.indices_of(first, stop), ensemble.seed, h, frame.aligned)
    implied = {t.key for t in terms.IMPLIED if any(np.any(v) for v in t.packed({}, context).values.values())}
    numbered = [(term, ensemble.own(term, p)) for term in ensemble.scene.terms]
    return Survey(
        turned=not frame.aligned,
        bent=not has_exact_flow(frame),
        mass=SHAPES_OF_MASS.index(shape_of_mass(frame.M)),
        coupled=frame.coupled,
        moved=bool(np.any(frame.origin)),
        forces_moved=bool(np.any(frame.forces)),
        apart=bool(np.any(frame.origin != frame.forces)),
        couplings=frozenset(i for i, at in enumerate(COUPLINGS) if np.any(U[:, *at])),
        left=float(coupling.max()),
        felt=frozenset(implied | {term.key for term, numbers in numbered if term.present(numbers)}),
        drag=frozenset(part for term, numbers in numbered if isinstance(term, Drag) for part in term.parts(numbers)),
        rising=frozenset(
            term.key for term, numbers in numbered if term.type == "current" and np.any(numbers["velocity"][:, 2])
        ),
        weightless=bool(np.any(p["environment.gravity"] == 0.0)),
        buoyant=bool(np.any(p["vehicle.buoyancy"])),
        odd=of_numbers(ensemble.scene, p, first, stop),
    )
