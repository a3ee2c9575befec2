# SPDX-License-Identifier: Apache-2.0
"""The numbers of a block's members in the kernel's form: inertia, laws, events and state, one member per lane.

Numbers that all members share are computed and written once for a run; each block or call writes only varied numbers.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from lgvi_kernels import built_in
from lgvi_kernels.maps.collocation import SLOPE_FIELDS
from lgvi_warp.control.gain_tables import packed_with_tables
from lgvi_warp.engine.arrays import memory_rows, row_count
from lgvi_warp.engine.shared import AXES, FRAME, context
from lgvi_warp.engine.states import Starts
from lgvi_warp.engine.survey import framed
from lgvi_warp.methods import modified_inertia
from lgvi_warp.physics import inertia, notation, terms, vehicle
from lgvi_warp.physics.inertia import Frame
from lgvi_warp.physics.terms.base import Packed, PackingContext, Term
from lgvi_warp.physics.terms.surface_level import with_level
from lgvi_warp.sampling.final import MEMORY, Final
from lgvi_warp.sampling.members import Members
from lgvi_warp.scene.draws import KEPT
from lgvi_warp.scene.ensemble import Ensemble

Fields = dict[str, Any]
# A Plan, whose module imports this one.
Plan = Any


class Packing:
    """Numbers of some members in the kernel's frame and units.

    U: (1 or m, 3, 3), matrix of the turns of psi_x; zero for other methods.
    scale: (1 or m,) [kg m^2], divisor of momenta in the kernel; 1 for methods without scaling.
    """

    def __init__(self, plan: Plan, members: Members):
        self.plan, self.members = plan, members
        self.numbers: Any = self._framed()
        self.frame, self.U, _ = self.numbers[FRAME]
        self.scale = self._shared("scale", lambda numbers: self._scale(numbers[AXES][0]))

    def _framed(self) -> dict[str, Any]:
        """The members' numbers with their frame."""
        return framed(self.plan.method, self.members.parameters, self.plan.shared)

    def _shared(self, key: Any, compute: Callable[[Any], Any]) -> Any:
        return self.plan.shared(key, self.numbers, compute)

    def _scale(self, frame: Frame) -> np.ndarray:
        largest = frame.J.max(axis=1)
        return largest if self.plan.spec.scaled else np.ones_like(largest)

    def _context(self, numbers: Mapping[str, np.ndarray]) -> PackingContext:
        m, plan = self.members, self.plan
        aligned, start = plan.kernel_choice.aligned, float(plan.grid.times[0])
        return context(numbers, self.frame, m.indices, m.seed, plan.grid.h, aligned, start, None, m.given)

    def inertia(self) -> Fields:
        """The fields of the kernel's Inertia."""
        fields: Fields = self._shared("inertia", self._inertia)
        return fields

    def _inertia(self, numbers: Any) -> Fields:
        frame, U, _ = numbers[FRAME]
        parts, scale = self.plan.spec.parts, self._scale(frame)
        diagonal = frame.mass_diagonal
        fields: Fields = {"J": frame.J / scale[:, None], "inverse_scale": 1.0 / scale}
        if diagonal is not None:
            # The same bits as below, without the zeros.
            inverse = 1.0 / diagonal * scale[:, None]
            mean = (inverse[:, 0] + inverse[:, 1] + inverse[:, 2]) / 3.0
            deviation = inverse - mean[:, None], np.zeros((1, 3))
        else:
            matrix = np.linalg.inv(frame.M) * scale[:, None, None]
            mean = np.einsum("nii->n", matrix) / 3.0
            deviation = symmetric(matrix - mean[:, None, None] * np.eye(3))
        fields["mean"] = mean
        if self.plan.spec.mass == "diagonal":
            fields["anisotropy"] = deviation[0]
        elif self.plan.spec.mass == "full":
            fields["anisotropy"] = deviation
        if "rates" in parts:
            fields["inverse_J"] = scale[:, None] / frame.J
        if "inverse" in parts:
            A, B, C = inertia.blocks(frame.inverse * scale[:, None, None])
            fields |= {"inverse_mass": A, "inverse_coupling": B, "inverse_inertia": C}
        if "turns" in parts:
            fields["half_over_J"] = 0.5 * scale[:, None] / frame.J
        if "x" in parts:
            fields["pitch"] = np.einsum("nii->ni", U)
            fields |= {f"U{i + 1}{j + 1}": U[:, i, j] for i, j in ((0, 1), (0, 2), (1, 2))}
        if "w" in parts:
            fields["S"] = symmetric(frame.E)
        if "coupled" in parts:
            fields |= {"E": frame.E, "E_forces": frame.E_forces}
        if "dense" in parts:
            Md, C, Jd = (block / scale[:, None, None] for block in inertia.blocks(frame.inertia_at(frame.E_forces)))
            fields |= {"M": symmetric(Md), "C": C, "J_forces": symmetric(Jd)}
        if "modified" in parts:
            fields |= modified_inertia.fields(frame.J / scale[:, None])
        if "water" in parts:
            fields |= _water(numbers, frame)
        if "shear" in parts:
            fields |= _shear(numbers, frame, self.plan.spec.mass == "full", "lever" in parts)
        if "axes" in parts:
            fields["axes"] = frame.Q
        if "origin" in parts:
            fields["user_origin"] = -frame.vector(frame.origin)
            fields["user_origin_forces"] = -frame.vector(frame.forces)
        return fields

    def laws(self) -> list[Packed]:
        """The numbers of each law."""
        each = enumerate(self.plan.kernel_choice.laws)
        return [self._shared(("law", i), functools.partial(self._law, i, term, module)) for i, (term, module) in each]

    def _law(self, i: int, term: Any, module: Any, numbers: Any) -> Packed:
        parameters = Ensemble.own(term, numbers)
        packed: Packed
        if term in terms.IMPLIED:  # packed when the kernel was chosen; neither depends on the step
            packed = self.plan.shared(("implied", term.key), numbers, lambda own: term.packed({}, self._context(own)))
        elif i > 0 or not self.plan.spec.drag:
            packed = self._with_rows(term, numbers, term.packed(parameters, self._context(numbers)))
        elif module is built_in("laws", term.exact_flow[0]):
            frame = numbers[FRAME][0]
            packed = term.packed_exact(parameters, frame, self._scale(frame))
        else:
            packed = term.packed_directions(parameters, self._context(numbers))
        return packed

    def _with_rows(self, term: Term, numbers: Any, packed: Packed) -> Packed:
        """Packed numbers of a term, with the rows of its surface and of given normals."""
        packed = with_level(term, packed, numbers)
        if self.members.given is None or self.members.given.rows(term.key) is None:
            return packed  # and stays shared, if it was
        given = self._context(numbers).given
        assert given is not None
        return packed._replace(normals=given.rows(term.key))

    def control(self) -> list[Packed]:
        """The numbers of each part of the controller."""
        return self._packed("part", (part for part, _ in self.plan.kernel_choice.parts_of_control))

    def events(self) -> list[Packed]:
        """The numbers of each event."""
        return self._packed("event", (event for event, _ in self.plan.kernel_choice.events))

    def _packed(self, kind: str, terms: Iterable[Term]) -> list[Packed]:
        def pack(term: Term, numbers: Any) -> Packed:
            packed = packed_with_tables(term, Ensemble.own(term, numbers), self._context(numbers))
            return self._with_rows(term, numbers, packed)

        return [self._shared((kind, i), functools.partial(pack, term)) for i, term in enumerate(terms)]

    def scratch(self, laws: Sequence[Packed], bus: int = 0) -> int:
        """Number of memory rows for the method itself."""
        spec = self.plan.spec
        if spec.memory and spec.explicit is not None and spec.explicit.goes_back:
            return bus + sum(memory_rows(law) for law in laws)
        # Gauss collocation: the slopes of the last step, and room for their extrapolation.
        return 2 * len(spec.gauss[1]) * SLOPE_FIELDS if spec.gauss else 0

    def starts(self) -> Starts:
        """Numbers from which the members' states are built."""
        m, frame, axes = self.members, self.frame, self.numbers[AXES][0]
        attitude, velocity, rate = (_once(x) for x in (m.attitude, m.velocity, m.angular_velocity))
        mass = self._shared("diagonal mass", lambda numbers: _diagonal_mass(numbers[FRAME][0]))
        inertia = None if mass is not None else self._shared("inertia of the state", _inertia_of_state)
        return Starts(
            attitude, m.position, velocity, rate,
            water=self.water,
            axes=frame.Q if axes.turned else None,
            origin=frame.origin if axes.shifted else None,
            mass=mass,
            moments=frame.J,
            inertia=inertia,
            scale=self.scale,
            inertial=self.plan.spec.inertial,
        )  # fmt: skip

    @functools.cached_property
    def water(self) -> np.ndarray | None:
        """R^T u (m, 3) [m/s]: velocity of the water in the user's body axes at each start; None without water motion."""
        m = self.members
        total: Any = None
        for term, _ in self.plan.kernel_choice.laws:
            kind = type(term)
            if kind.water is Term.water and kind.water_at_start is Term.water_at_start:
                continue
            known = replace(self._context(m.parameters), remembered=remembered_by("law", term, m.final))
            flow = term.water_at_start(Ensemble.own(term, m.parameters), m.position, known)
            total = flow if total is None else total + flow
        return None if total is None else notation.rotate_into(m.attitude, total)


# Half of the fastest cache of common processors [bytes]: a smaller table is as fast with a copy for each lane.
LARGE_TABLE = 16_384


@np.errstate(invalid="ignore", over="ignore")
def rows_shared(plan: Plan) -> bool:
    """Whether all members share the rows of laws, controller parts and events, and these rows are many.

    Few rows are copied for each lane even if shared, so that one kernel serves scenes in which other numbers vary.
    """
    if plan.kernel_choice.given:  # rows that members own
        return False
    # What few members need is packed once, here.
    members = plan.ensemble.members
    packing = Packing(plan, plan.ensemble.select(0, members if members <= KEPT else 1))
    each = (("law", packing.laws()), ("part", packing.control()), ("event", packing.events()))
    sizes = {(kind, i): row_count(law) for kind, packed in each for i, law in enumerate(packed) if law.rows is not None}
    number = 8 if plan.spec.real == wp.float64 else 4
    return sum(sizes.values()) * plan.spec.width * number > LARGE_TABLE and all(map(plan.shared.keeps, sizes))


def name_of(kind: str, term: Term) -> str:
    """Name of the memory of a law, a controller part or an event in the final states of a run."""
    return f"{MEMORY}{kind} {term.key} {type(term).__name__}"


def remembered_by(kind: str, term: Term, final: Final | None) -> np.ndarray | None:
    """Memory of a law, part or event from the continued run, (m, rows); None without one."""
    return None if final is None else final.lanes.get(name_of(kind, term))


def _once(values: np.ndarray) -> np.ndarray:
    """Reduce values (m, ...) of members to one entry if they are one value repeated without copies."""
    return values[:1] if values.strides[0] == 0 else values


def _diagonal_mass(frame: Frame) -> np.ndarray | None:
    """Diagonals (n, 3) of the mass matrices, if momenta are their products with velocities alone; else None."""
    return None if frame.whole is not None or np.any(frame.E) else frame.mass_diagonal


def _inertia_of_state(numbers: Any) -> np.ndarray:
    """Mass matrices (n, 6, 6) about the origin of the state, in the kernel's axes."""
    frame = numbers[FRAME][0]
    return np.asarray(frame.inertia_at(frame.E))


def _water(numbers: Any, frame: Frame) -> Fields:
    """Masses on which accelerating water acts: displaced mass minus dry mass, and its lever arm."""
    displaced, dry = vehicle.displaced_mass(numbers), vehicle.dry_mass(numbers)
    center = numbers["vehicle.center_of_buoyancy"]
    lever = displaced[:, None] * center - (dry[:, None] * vehicle.center_of_mass(numbers))
    excess = displaced - dry
    return {"excess": excess, "excess_lever": frame.vector(lever - excess[:, None] * frame.forces)}


def _shear(numbers: Any, frame: Frame, full: bool, lever: bool) -> Fields:
    """Masses on which spatially varying water acts: the body's own mass and the added mass, about the user's origin."""
    dry, added = vehicle.dry_mass(numbers), vehicle.added_blocks(numbers)
    M = symmetric(inertia.in_axes(frame.Q, added.M))
    fields: Fields = {"dry": dry, "added": M if full else M[0]}
    if lever:
        fields["dry_lever"] = frame.vector(dry[:, None] * vehicle.center_of_mass(numbers))
        fields["added_coupling"] = inertia.in_axes(frame.Q, added.C)
    return fields


def symmetric(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Symmetric matrices (n, 3, 3) in the kernel's form: diagonal (n, 3), and entries 23, 31, 12 (n, 3)."""
    off = np.stack([matrix[:, 1, 2], matrix[:, 2, 0], matrix[:, 0, 1]], axis=1)
    return np.einsum("nii->ni", matrix), off
