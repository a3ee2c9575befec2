# SPDX-License-Identifier: Apache-2.0
"""The vehicle: a rigid body with added mass, weight and buoyancy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from typing import Any

import numpy as np

from lgvi_warp.common import summaries
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.declared import array, checked, positive, read, real, symmetric, text
from lgvi_warp.common.errors import Faults
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.physics import inertia as inertias
from lgvi_warp.physics import notation
from lgvi_warp.physics.shape import shape_from

Numbers = Mapping[str, np.ndarray]

# The two forms of a vehicle: uncoupled about the centre of gravity, or 6x6 about any origin.
SIMPLE = ("mass", "added_mass", "inertia", "buoyancy", "center_of_buoyancy")
FULL = ("rigid_body_mass_matrix", "added_mass_matrix", "weight", "center_of_gravity", "buoyancy", "center_of_buoyancy")
# The smallest mass or inertia that has an inverse in float64.
LEAST = float(np.finfo(np.float64).tiny)
# The fraction of the third principal inertia by which the other two may sum to less than it: by round-off, and as
# published numbers do (those of the ECA A9 by 0.126).
ROUND_OFF, LITTLE = 1e-6, 0.15
SYMMETRIC = ("added_mass", "inertia", "rigid_body_mass_matrix", "added_mass_matrix")


class RepeatedWarning(str):
    """A warning about a vehicle's own numbers; a vehicle rebuilt from the fields of another one finds it again."""


def _are_texts(value: Any) -> bool:
    """Whether a value is a list of texts."""
    items = items_of(value)
    return items is not None and all(isinstance(text, str) for text in items)


@dataclass(frozen=True, eq=False, repr=False)
class Vehicle(Summarized):
    """A rigid body in water, in body axes (x ahead, y to starboard, z down), described in one of two forms.

    The simple form has `mass`, `inertia` and `added_mass`, about the centre of gravity. The 6x6 form, about any origin of
    the body, has `rigid_body_mass_matrix`, `added_mass_matrix`, `weight` and `center_of_gravity`. A diagonal (3,) is stored
    as a full matrix. All arguments but `mass` are keyword-only, so that inertia and added mass are not confused.

    Args:
        mass: Dry mass [kg]. Simple form.
        inertia: Inertia about the centre of gravity, including added inertia, (3,) or (3, 3) [kg m2]. Simple form.
        added_mass: Added mass of translation, (3,) or symmetric (3, 3) [kg]; 0 by default. Simple form.
        buoyancy: Weight of the displaced water [N]; 0 by default.
        center_of_buoyancy: Point at which buoyancy acts, (3,) [m] from the origin; by default the origin.
        rigid_body_mass_matrix: Mass matrix of the dry body, (6, 6) [kg, kg m, kg m2], linear part first. 6x6 form.
        added_mass_matrix: Added mass, (6, 6) [kg, kg m, kg m2], positive: minus Fossen's X_udot and so on; 0 by default.
            6x6 form.
        weight: Weight [N]; by default mass times gravity. 6x6 form.
        center_of_gravity: Point at which the weight acts, (3,) [m] from the origin; by default it follows from the rigid
            body's mass matrix. 6x6 form.
        inertia_tolerance: Allowed violation of the triangle inequality of the principal inertias, as a fraction of the
            largest inertia. 6x6 form. With 0, the default, a matrix that no rigid body can have is refused. Importers set
            the tolerance for published numbers.
        warnings: Texts about unusual but allowed numbers, such as the texts that importers write. The vehicle adds its own
            warnings; a run shows all of them in its messages.
        shape: Drawn shape of the vehicle, a table with `length` and `diameter` [m] or with `mesh`, the path of a .glb file; by
            default a hull of the displaced volume. It has no effect on the motion.
        title: Name of the vehicle in summaries and reports; by default its name in the package, if the package has it.

    Raises:
        SceneError: If a number is not finite, not positive, of the wrong shape, not symmetric or not positive definite.
            The message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.Vehicle(mass=10.0, inertia=[0.1, 0.1, 0.1], added_mass=[5.0, 5.0, 5.0], buoyancy=98.0)
        Vehicle, simple form
          mass                10 kg
          added_mass          diagonal [5, 5, 5] kg
          inertia             diagonal [0.1, 0.1, 0.1] kg m2
          buoyancy            98 N
          center_of_buoyancy  [0, 0, 0] m
    """

    mass: float | None = positive(None, unit="kg")
    _: KW_ONLY
    inertia: Any = symmetric(None, unit="kg m2")
    added_mass: Any = symmetric(None, unit="kg")
    buoyancy: float = real(0.0, unit="N", least=0.0)
    center_of_buoyancy: Any = array((0.0, 0.0, 0.0), shape=(3,), unit="m")
    rigid_body_mass_matrix: Any = symmetric(None, unit="kg, kg m, kg m2", size=6)
    added_mass_matrix: Any = symmetric(None, unit="kg, kg m, kg m2", size=6)
    weight: float | None = real(None, unit="N", least=0.0)
    center_of_gravity: Any = array(None, shape=(3,), unit="m")
    inertia_tolerance: float = real(0.0, unit="1", least=0.0)
    warnings: Sequence[str] = checked(_are_texts, "is not a list of texts", 'give ["..."], or leave it out', ())
    shape: Any = None
    title: str | None = text("is not a text", 'give title = "my glider", or leave it out', None)

    def __post_init__(self) -> None:
        faults = Faults("vehicle.")
        values = read(self, faults, "buoyancy", "center_of_buoyancy", "warnings", "inertia_tolerance")
        object.__setattr__(self, "inertia_tolerance", values["inertia_tolerance"] or 0.0)
        user_warnings = (warning for warning in values["warnings"] or () if not isinstance(warning, RepeatedWarning))
        values |= self._full(faults) if self.full else self._simple(faults)
        values["warnings"] = (*user_warnings, *map(RepeatedWarning, values["warnings"]))
        with faults.including():
            values["shape"] = shape_from(self.shape)
        values |= read(self, faults, "title")
        faults.raise_if_any()
        for name, value in values.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        # The numbers with their units, and the warnings.
        rows = [("title", self.title)] if self.title else []
        rows += [(name, summaries.few_digits(value, UNITS[name])) for name, value in self.parameters().items()]
        rows += [("warning", str(text)) for text in self.warnings]
        return f"Vehicle, {'6x6' if self.full else 'simple'} form", rows

    @property
    def full(self) -> bool:
        """Whether the vehicle is given in the 6x6 form."""
        return self.rigid_body_mass_matrix is not None or self.added_mass_matrix is not None

    def _simple(self, faults: Faults) -> dict[str, Any]:
        for name in ("weight", "center_of_gravity"):
            if getattr(self, name) is not None:
                faults.add(name, getattr(self, name), "belongs to the 6x6 form", "give rigid_body_mass_matrix as well")
        for name in ("mass", "inertia"):
            if getattr(self, name) is None:
                faults.add(name, None, "is missing", f"give it [{UNITS[name]}]")
        if self.added_mass is None:
            object.__setattr__(self, "added_mass", (0.0, 0.0, 0.0))
        values = read(self, faults, "mass", "added_mass", "inertia")
        mass, added, inertia = values.values()
        if mass is not None and mass < LEAST:
            faults.add("mass", self.mass, "has no inverse in float64", f"give a mass from {LEAST:.3g} kg")
        if inertia is not None and not _definite(inertia):
            faults.add("inertia", self.inertia, "is not positive definite", "give principal inertias above 0 [kg m2]")
        if mass is not None and added is not None and not _definite(added, mass * np.eye(3)):
            faults.add("added_mass", self.added_mass, "with the mass is not positive definite", SIGN)
        return values | {"warnings": unusual("inertia", inertia) if inertia is not None else ()}

    def _full(self, faults: Faults) -> dict[str, Any]:
        for name in ("mass", "inertia", "added_mass"):
            if getattr(self, name) is not None:
                faults.add(name, getattr(self, name), "repeats what the 6x6 matrices say", "keep one of the two forms")
        warnings: tuple[str, ...] = ()
        if self.rigid_body_mass_matrix is None:
            unit = UNITS["rigid_body_mass_matrix"]
            faults.add("rigid_body_mass_matrix", None, "is missing", f"give it beside added_mass_matrix [{unit}]")
        if self.added_mass_matrix is None:
            object.__setattr__(self, "added_mass_matrix", np.zeros((6, 6)))
        values = read(self, faults, "rigid_body_mass_matrix", "added_mass_matrix", "weight", "center_of_gravity")
        rigid, added, _, center = values.values()
        if rigid is not None:
            center, warnings = self._rigid(faults, rigid, center)
            if _definite(rigid):
                warnings += self._triangle(faults, rigid)
        if rigid is not None and added is not None and _definite(rigid) and not _definite(added, rigid):
            faults.add(
                "added_mass_matrix", self.added_mass_matrix, "with the rigid body's is not positive definite", SIGN
            )
        return values | {"center_of_gravity": center, "warnings": warnings}

    def _triangle(self, faults: Faults, rigid: np.ndarray) -> tuple[str, ...]:
        """Add a fault for principal inertias that no rigid body can have; return warnings for those within the tolerance."""
        short = float(shortage(rigid[None])[0])
        if short <= ROUND_OFF:
            return ()
        moments = ", ".join(f"{moment:.6g}" for moment in np.linalg.eigvalsh(about_center(rigid[None])[0]))
        fault = f"has principal inertias {moments} kg m2, two of which sum to less than the third"
        amount = f"by {100.0 * short:.2g} % of it"
        if short <= self.inertia_tolerance:
            return (f"vehicle.rigid_body_mass_matrix: {fault}, {amount}: no rigid body has; taken as it is",)
        remedy = "give the rigid body's own inertia here, and added inertia in added_mass_matrix"
        remedy += f"; or allow it: inertia_tolerance = {short * 1.01:.2g}" if short <= LITTLE else ""
        remedy = f"it misses {amount}. {capital(remedy)}"
        faults.add("rigid_body_mass_matrix", rigid[3:, 3:], f"{fault}: no rigid body has", remedy)
        return ()

    def _rigid(self, faults: Faults, rigid: np.ndarray, center: Any) -> tuple[np.ndarray | None, tuple[str, ...]]:
        """Check that the matrix is that of a rigid body: m I, -m hat(r), a positive inertia. Return r and the warnings."""
        remedy = "give [[m I, -m hat(r_g)], [m hat(r_g), inertia about the origin]]"
        m = rigid[0, 0]
        if not _definite(rigid):
            faults.add("rigid_body_mass_matrix", rigid, "is not positive definite", remedy)
            return None, ()
        implied = -inertias.vee(rigid[:3, 3:]) / m
        size = np.abs(rigid).max()
        if np.abs(rigid[:3, :3] - m * np.eye(3)).max() > 1e-6 * size:
            faults.add("rigid_body_mass_matrix", rigid[:3, :3], "does not have m I as its upper left block", remedy)
        if np.abs(rigid[:3, 3:] + m * notation.hat(implied)).max() > 1e-6 * size:
            fault = "does not have -m hat(r_g) as its upper right block"
            faults.add("rigid_body_mass_matrix", rigid[:3, 3:], fault, remedy)
        if center is None:
            return implied, ()
        if np.abs(center - implied).max() > 1e-3 * max(np.abs(center).max(), np.sqrt(np.trace(rigid[3:, 3:]) / m)):
            places = f"{center.tolist()} m, where the rigid body's matrix has it at {implied.tolist()} m"
            return center, (f"vehicle.center_of_gravity {places}: weight acts at the first, inertia at the second",)
        return center, ()

    @property
    def mass_matrix(self) -> np.ndarray:
        """Mass and added mass of translation, (3, 3) [kg]."""
        if self.full:
            return np.asarray(self.rigid_body_mass_matrix + self.added_mass_matrix)[:3, :3]
        return np.asarray(np.asarray(self.mass) * np.eye(3) + self.added_mass)

    def parameters(self) -> dict[str, np.ndarray]:
        """The numbers that may vary by member.

        Returns:
            {name: number}, as float64 arrays, each in its own shape. The weight of a vehicle in the 6x6 form is included only
            if it was given.
        """
        names = [name for name in (FULL if self.full else SIMPLE) if getattr(self, name) is not None]
        return {name: np.asarray(getattr(self, name), dtype=np.float64) for name in names}

    def to_dict(self) -> dict[str, Any]:
        """The vehicle as a table of a scene file.

        Returns:
            Numbers by name, with diagonal 3x3 matrices given by their diagonal; the user's warnings, without the warnings that
            the vehicle adds; and the shape and the title, if given.
        """
        content = {}
        for name, value in self.parameters().items():
            full = name in ("rigid_body_mass_matrix", "added_mass_matrix")
            content[name] = compact(value) if value.shape == (3, 3) and not full else value.tolist()
        user_warnings = [text for text in self.warnings if not isinstance(text, RepeatedWarning)]
        content |= {"inertia_tolerance": self.inertia_tolerance} if self.inertia_tolerance else {}
        content |= {"warnings": user_warnings} if user_warnings else {}
        content |= {"shape": self.shape.to_dict()} if self.shape else {}
        return content | ({"title": self.title} if self.title else {})


# Of each number of a vehicle.
UNITS = {item.name: item.metadata["arguments"]["unit"] for item in fields(Vehicle) if item.name in (*SIMPLE, *FULL)}
SIGN = "added mass is positive here: minus Fossen's X_udot, Y_vdot, Z_wdot ..."


def _definite(matrix: np.ndarray, added: Any = 0.0) -> bool:
    """Whether the sum of two matrices is positive definite; False if it overflows."""
    with np.errstate(over="ignore"):
        total = matrix + added
    return bool(np.isfinite(total).all() and np.linalg.eigvalsh(total)[0] >= LEAST)


def compact(matrix: np.ndarray) -> list[Any]:
    """A 3x3 matrix in the form of a scene file."""
    diagonal = np.diag(matrix)
    return (diagonal if np.array_equal(matrix, np.diag(diagonal)) else matrix).tolist()


def unusual(name: str, inertia: Any) -> tuple[str, ...]:
    """Warnings for principal inertias [kg m2] that no dry rigid body has (J_i + J_j < J_k); added inertia may explain them."""
    small, middle, large = np.linalg.eigvalsh(inertia)
    if small >= large * (1.0 - 1e-12) - middle:
        return ()
    text = f"vehicle.{name}: principal inertias {small:.6g} + {middle:.6g} < {large:.6g} [kg m2]"
    return (text + ": no rigid body has these; that is right only if added inertia makes the difference",)


def about_center(rigid: np.ndarray) -> np.ndarray:
    """Inertia (n, 3, 3) [kg m2] about the centre of gravity, from rigid-body mass matrices (n, 6, 6) about any origin."""
    m = rigid[:, :1, :1]
    H = notation.hat(-inertias.vee(rigid[:, :3, 3:]) / m[:, 0])
    return np.asarray(rigid[:, 3:, 3:] + m * (H @ H))


def shortage(rigid: np.ndarray) -> np.ndarray:
    """1 - (J_1 + J_2) / J_3 (n,) of the rising principal inertias; a rigid body cannot have a value above 0."""
    small, middle, large = np.linalg.eigvalsh(about_center(rigid)).T
    return np.asarray(1.0 - (small + middle) / large)


def impossible(rigid: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
    """Mask (n,) of mass matrices (n, 6, 6) that no rigid body has: two principal inertias sum to less than the third."""
    return shortage(rigid) > max(tolerance, ROUND_OFF)


def inertia_blocks(p: Numbers) -> inertias.Blocks:
    """Blocks of the mass matrix of body and added mass about the user's origin, each of 1 or n members."""
    if "vehicle.rigid_body_mass_matrix" in p:
        return inertias.blocks(p["vehicle.rigid_body_mass_matrix"] + p["vehicle.added_mass_matrix"])
    return inertias.Blocks(mass_matrix(p), np.zeros((1, 3, 3)), p["vehicle.inertia"])


def mass_matrix(p: Numbers) -> np.ndarray:
    """Mass and added mass (n, 3, 3) [kg] of a vehicle whose mass matrix has no coupling."""
    mass, added = p["vehicle.mass"], p["vehicle.added_mass"]
    diagonal = notation.only_diagonal(added)
    if diagonal is not None:
        # The same numbers in a quarter of the time.
        matrices = np.zeros((max(len(mass), len(added)), 3, 3))
        matrices.reshape(-1, 9)[:, ::4] = mass[:, None] + diagonal
        return matrices
    body = mass[:, None, None] * notation.EYE
    return np.asarray(np.add(body, added, out=body if len(added) <= len(body) else None))


def inertia6(p: Numbers) -> np.ndarray:
    """Mass matrix (n, 6, 6) [kg, kg m, kg m2] of body and added mass about the user's origin, linear part first.

    docs/theory/coupled.md, (X1).
    """
    return inertias.joined(*inertia_blocks(p))


def dry_mass(p: Numbers) -> np.ndarray:
    """Mass (n,) [kg] of the rigid body."""
    if "vehicle.rigid_body_mass_matrix" in p:
        return np.asarray(p["vehicle.rigid_body_mass_matrix"][:, 0, 0])
    return np.asarray(p["vehicle.mass"])


def weight(p: Numbers) -> np.ndarray:
    """Weight (n,) [N] of the vehicle: as given, or mass times gravity."""
    if "vehicle.weight" in p:
        return np.asarray(p["vehicle.weight"])
    return dry_mass(p) * p["environment.gravity"]


def displaced_mass(p: Numbers) -> np.ndarray:
    """Mass (n,) [kg] of the displaced water: buoyancy divided by gravity; without gravity, that of a neutral vehicle."""
    g = p["environment.gravity"]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(g > 0.0, p["vehicle.buoyancy"] / g, dry_mass(p))


def center_of_mass(p: Numbers) -> np.ndarray:
    """Centre of mass (n, 3) [m] of the rigid body from the user's origin; zero, (1, 3), for the simple form."""
    if "vehicle.rigid_body_mass_matrix" in p:
        rigid = p["vehicle.rigid_body_mass_matrix"]
        return np.asarray(-inertias.vee(rigid[:, :3, 3:]) / rigid[:, 0, 0, None])
    return np.zeros((1, 3))


def added_blocks(p: Numbers) -> inertias.Blocks:
    """Added mass about the user's origin, as blocks of (1 or n, 3, 3).

    The blocks of the coupling and of the rotation are zero for a vehicle in the simple form.
    """
    if "vehicle.rigid_body_mass_matrix" in p:
        return inertias.blocks(p["vehicle.added_mass_matrix"])
    return inertias.Blocks(p["vehicle.added_mass"], np.zeros((1, 3, 3)), np.zeros((1, 3, 3)))


def lopsided(p: Numbers) -> bool:
    """Whether some member's centre of mass is off the user's origin, or added mass couples velocities and rates there."""
    return bool(np.any(center_of_mass(p)) or np.any(added_blocks(p).C))
