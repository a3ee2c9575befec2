# SPDX-License-Identifier: Apache-2.0
"""Vehicles from the usual forms of hydrodynamic coefficients, and the vehicles that come with the package.

Every importer returns a dict in the form of the scene file, {"vehicle": {...}, "environment": {...}, "terms": [...]}. Its
numbers are about the body origin, in body axes x ahead, y to starboard, z down, with linear before angular components. All
faults are reported together, in one SceneError.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import extensions
from lgvi_warp.common.arguments import name_set
from lgvi_warp.common.errors import Faults, SceneError, closest
from lgvi_warp.common.reading import MOST_BYTES, MOST_OTHERS, file_text
from lgvi_warp.common.sentences import capital
from lgvi_warp.common.toml_text import parsed
from lgvi_warp.physics.notation import hat
from lgvi_warp.physics.terms.quadratic_form import FORCES, VELOCITIES
from lgvi_warp.physics.vehicle import LITTLE, ROUND_OFF, shortage

STANDARD_GRAVITY = 9.80665  # m/s2, ISO 80000-3
# x ahead, y to port, z up (SDF, ROS) <-> x ahead, y to starboard, z down: half a turn about x.
HALF_TURN = np.array([1.0, -1.0, -1.0])
HALF_TURN_6 = np.tile(HALF_TURN, 2)
RELATIVE = 1e-6  # how far two printed values of one number, or a sum of them, may differ


# The vehicles of the package ----------------------------------------------------------------------------------------


def vehicle_names() -> list[str]:
    """Return the names of the vehicles that come with the package.

    Returns:
        Names in alphabetical order.

    Examples:
        >>> import lgvi_warp as lw
        >>> lw.vehicles.names()[:6]
        ['bluerov2_heavy', 'dsrv', 'eca_a9', 'girona_500', 'lauv', 'nordkvist_sanyal']
    """
    return sorted({*_own_vehicles(), *extensions.words("vehicles")})


def _own_vehicles() -> dict[str, Path]:
    """The files of the vehicles of the core, without those of extensions, by name."""
    folder = Path(str(resources.files("lgvi_warp.vehicles")))
    return {path.stem: path for path in folder.glob("*.toml")}


def vehicle_file(name: str) -> Path:
    """Return the path of a vehicle's TOML file in the scene file's form, with a table [source]."""
    path = _own_vehicles().get(name) or extensions.file("vehicles", name)
    if path is None:
        raise SceneError([f"vehicle file {name!r} is not known. {capital(closest(name, vehicle_names()))}"])
    return path


def vehicle_tables(name: str) -> dict[str, Any]:
    """Read a vehicle's file."""
    return parsed(file_text(vehicle_file(name), "scene file"), name)


# What every form becomes --------------------------------------------------------------------------------------------


@dataclass
class Coefficients:
    """Coefficients that an importer has read, before checks.

    Drag is force_i = -(l_ij + q_ij |v_j|) v_j - u f_ij v_j, where u is the forward speed.

    mass [kg]; inertia (3, 3) [kg m2] about the centre of gravity; both centres (3,) [m] from the body origin; both forces [N].
    added_mass: (6, 6) [kg, kg m, kg m2], positive. Added mass, drag and current are zero by default.
    linear: l (6, 6) [N s/m, N s, N m s]. quadratic, forward: q and f (6, 6) [N s2/m2, N s2/m, N s2, N m s2].
    current: Velocity (3,) [m/s] of the water, north, east, down.
    gravity: Acceleration of free fall [m/s2] for which the forces hold. water_density: [kg/m3]. Both are None if unknown.
    """

    mass: float | None
    inertia: np.ndarray | None
    center_of_gravity: np.ndarray | None
    center_of_buoyancy: np.ndarray | None
    weight: float | None
    buoyancy: float | None
    added_mass: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    linear: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    quadratic: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    forward: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    current: np.ndarray = field(default_factory=lambda: np.zeros(3))
    gravity: float | None = None
    water_density: float | None = None
    warnings: list[str] = field(default_factory=list)

    def to_dict(self, faults: Faults) -> dict[str, Any]:
        """Return the tables of a scene file, after the checks that need all numbers."""
        faults.raise_if_any()
        assert self.mass is not None
        assert self.inertia is not None
        assert self.center_of_gravity is not None
        rigid = rigid_body_matrix(self.mass, self.inertia, self.center_of_gravity)
        for key, matrix in (("rigid_body_mass_matrix", rigid), ("total mass matrix", rigid + self.added_mass)):
            if np.linalg.eigvalsh(matrix)[0] <= 0.0:
                remedy = "check mass, inertia (and about which point it is given), centre of gravity and added mass"
                faults.add(key, matrix, "is not positive definite", remedy)
        faults.raise_if_any()
        vehicle = {"rigid_body_mass_matrix": rigid, "added_mass_matrix": self.added_mass}
        vehicle |= {
            name: getattr(self, name) for name in ("weight", "center_of_gravity", "buoyancy", "center_of_buoyancy")
        }
        tables: dict[str, Any] = {"vehicle": {key: as_lists(value) for key, value in vehicle.items()}}
        water = {"gravity": self.gravity, "water_density": self.water_density}
        tables["environment"] = {key: float(value) for key, value in water.items() if value is not None}
        tables["terms"] = self.terms()
        if ROUND_OFF < float(shortage(rigid[None])[0]) <= LITTLE:
            tables["vehicle"]["inertia_tolerance"] = LITTLE
        warnings = [*self.warnings, *self.unstable()]
        if warnings:
            tables["vehicle"]["warnings"] = warnings
        return tables

    def unstable(self) -> list[str]:
        """Return a warning if the centre of gravity is above the centre of buoyancy, so that the vehicle would capsize."""
        assert self.center_of_gravity is not None
        assert self.center_of_buoyancy is not None
        above = float(self.center_of_buoyancy[2] - self.center_of_gravity[2])
        if not self.buoyancy or above <= RELATIVE:
            return []
        problem = f"the centre of gravity is {above:.3g} m above the centre of buoyancy"
        return [f"{problem}: the vehicle turns upside down; check both, and that z is down"]

    def terms(self) -> list[dict[str, Any]]:
        """The nonzero terms: "drag" for diagonal matrices, else "drag_matrix"; lift and current."""
        terms: list[dict[str, Any]] = []
        pair = (self.linear, self.quadratic)
        if any(np.any(matrix) for matrix in pair):
            diagonal = all(np.array_equal(matrix, np.diag(np.diag(matrix))) for matrix in pair)
            values = [as_lists(np.diag(matrix) if diagonal else matrix) for matrix in pair]
            kind = "drag" if diagonal else "drag_matrix"
            terms.append({"type": kind, "linear": values[0], "quadratic": values[1]})
        if np.any(self.forward):
            terms.append({"type": "body_lift", "matrix": as_lists(self.forward)})
        if np.any(self.current):
            terms.append({"type": "current", "velocity": as_lists(self.current)})
        return terms


def as_lists(value: Any) -> Any:
    """Convert an array to nested lists of floats, with 0.0 in place of -0.0."""
    return (np.asarray(value) + 0.0).tolist()


def rigid_body_matrix(mass: float, inertia: np.ndarray, center: np.ndarray) -> np.ndarray:
    """M_RB (6, 6) [kg, kg m, kg m2] about the body origin; inertia is about the centre (3,) [m]."""
    S = hat(center)
    return np.block([[mass * np.eye(3), -mass * S], [mass * S, inertia - mass * S @ S]])


def symmetric(faults: Faults, key: str, matrix: np.ndarray) -> np.ndarray:
    """Return the symmetric part of a matrix that is symmetric up to the rounding of its digits."""
    if np.abs(matrix - matrix.T).max() > RELATIVE * np.abs(matrix).max():
        remedy = "added mass of a body in unbounded water is symmetric: correct the pair"
        faults.add(key, matrix, "is not symmetric", remedy)
    return 0.5 * (matrix + matrix.T)


def rigid_body(
    faults: Faults,
    mass: Any,
    inertia: Any,
    center_of_gravity: Any,
    center_of_buoyancy: Any,
    weight: Any,
    buoyancy: Any,
    gravity: Any,
) -> Coefficients:
    """Check mass [kg], inertia (3,) or (3, 3) [kg m2] about the centre of gravity, centres (3,) [m] and forces [N] of a body.

    weight: None for mass times gravity. buoyancy: None for the weight.
    Returns: The body without added mass and drag; invalid values are None.
    """
    mass, gravity = faults.positive("mass", mass, "kg"), faults.number("gravity", gravity, "m/s2", least=0.0)
    inertia = faults.symmetric("inertia", inertia, "kg m2")
    center_of_gravity = faults.finite("center_of_gravity", center_of_gravity, (3,), "m")
    center_of_buoyancy = faults.finite("center_of_buoyancy", center_of_buoyancy, (3,), "m")
    if weight is not None:
        weight = faults.number("weight", weight, "N", least=0.0)
    elif mass is not None and gravity is not None:
        weight = mass * gravity
    buoyancy = weight if buoyancy is None else faults.number("buoyancy", buoyancy, "N", least=0.0)
    return Coefficients(mass, inertia, center_of_gravity, center_of_buoyancy, weight, buoyancy, gravity=gravity)


# Fossen's names -----------------------------------------------------------------------------------------------------

_DOT = re.compile(r"^(?:dot([uvwpqr])|d([uvwpqr])|([uvwpqr])dot)$")
_ABS = re.compile(r"^(?:([uvwpqr])\|([uvwpqr])\||\|([uvwpqr])\|([uvwpqr])|([uvwpqr])abs([uvwpqr]))$")
_NAMES = "X_udot (or Xudot, X_du, X_{\\dot u}), X_u, X_uu (or X_u|u|, X_{u|u|}, Xuabsu) for X Y Z K M N and u v w p q r"


@dataclass(frozen=True)
class Name:
    """The name of a coefficient, as read."""

    kind: str
    row: int
    columns: tuple[int, ...]


def read_name(name: str) -> Name | None:
    """Parse the name of a hydrodynamic derivative in a usual spelling ("X_udot", "Xuu", "X_{u|u|}"); None for others."""
    text = re.sub(r"[\s_{}\\$,()*]", "", str(name))
    if len(text) < 2 or text[0] not in FORCES:
        return None
    row, tail = FORCES.index(text[0]), text[1:].lower()
    if match := _DOT.match(tail):
        return Name("dot", row, (VELOCITIES.index("".join(filter(None, match.groups()))),))
    if match := _ABS.match(tail):
        first, second = (VELOCITIES.index(letter) for letter in filter(None, match.groups()))
        return Name("quadratic" if first == second else "modulus", row, (first, second))
    if not 1 <= len(tail) <= 2 or any(letter not in VELOCITIES for letter in tail):
        return None
    columns = tuple(VELOCITIES.index(letter) for letter in tail)
    if len(columns) == 1:
        return Name("linear", row, columns)
    if columns[0] != columns[1]:
        return Name("product", row, columns)
    # X_qq q^2, unlike X_|q|q, is the same for +q and -q. Symmetry requires it of X in w, q and of X, Z, M in v, p, r.
    even = (text[0] in "XZM" and tail[0] in "vpr") or (text[0] == "X" and tail[0] in "wq")
    return Name("even" if even else "quadratic", row, columns)


def from_fossen(
    coefficients: Mapping[str, float],
    *,
    mass: float,
    inertia: Any,
    center_of_gravity: Sequence[float] = (0.0, 0.0, 0.0),
    center_of_buoyancy: Sequence[float] = (0.0, 0.0, 0.0),
    inertia_about: str = "origin",
    weight: float | None = None,
    buoyancy: float | None = None,
    gravity: float = STANDARD_GRAVITY,
    ignore: Iterable[str] = (),
) -> dict[str, Any]:
    """Build a vehicle and its drag from hydrodynamic derivatives in Fossen's (SNAME) names and signs.

    One coefficient of a symmetric pair, such as Y_rdot and N_vdot, is enough. These coefficients are refused:

    * X_qq and similar coefficients, whose force is even in the velocity and therefore is not drag;
    * products (Y_uv, X_wq). Products due to added mass (its Coriolis terms) follow from the added mass matrix. Products
      with u are a hull's lift: use the term body_lift. The term quadratic_form accepts any product;
    * second-order moduli such as Y_|v|r (Fossen 2021, nonlinear damping). They are cross-flow drag due to sway and yaw
      together, which a drag matrix cannot represent. The term cross_flow computes this drag along the hull.

    Args:
        coefficients: Values by name: X_udot ... N_rdot [kg, kg m, kg m2], X_u ... N_r [N s/m, N m s],
            X_uu ... N_rr [N s2/m2, N m s2], in any usual spelling. Diagonal terms, such as X_u and K_p, are negative.
        mass: Mass [kg].
        inertia: Inertia (3,) or (3, 3) [kg m2], about the point that `inertia_about` names.
        center_of_gravity: Position (3,) [m] from the body origin; by default the origin.
        center_of_buoyancy: Position (3,) [m] from the body origin; by default the origin.
        inertia_about: Reference point of `inertia`: the body's "origin" (default), or the centre of "gravity".
        weight: Weight [N]; by default mass times gravity.
        buoyancy: Buoyancy [N]; by default the weight.
        gravity: Acceleration of free fall [m/s2]; by default 9.80665.
        ignore: Names of coefficients to leave out; by default none.

    Returns:
        The tables "vehicle", "environment" and "terms" of a scene file.

    Raises:
        SceneError: If a coefficient or another argument is invalid; the message lists every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> derivatives = {"X_udot": -1.0, "Y_vdot": -35.0, "Z_wdot": -35.0, "X_uu": -1.6}
        >>> tables = lw.vehicles.from_fossen(derivatives, mass=30.0, inertia=[0.2, 3.5, 3.5])
        >>> float(lw.Scene.from_dict(tables).vehicle.mass_matrix[0, 0])
        31.0
    """
    faults = Faults()
    body = rigid_body(faults, mass, inertia, center_of_gravity, center_of_buoyancy, weight, buoyancy, gravity)
    about_gravity(faults, body, inertia_about)
    add_derivatives(faults, body, coefficients, ignore)
    return body.to_dict(faults)


def about_gravity(faults: Faults, body: Coefficients, inertia_about: str) -> None:
    """Shift an inertia about the body origin to the centre of gravity, in place."""
    known = faults.choice("inertia_about", inertia_about, ("origin", "gravity"))
    if not known or inertia_about == "gravity" or body.mass is None or body.inertia is None:
        return
    if body.center_of_gravity is not None:
        S = hat(body.center_of_gravity)
        body.inertia = body.inertia + body.mass * S @ S


def add_derivatives(faults: Faults, body: Coefficients, values: Mapping[str, Any], ignore: Iterable[str] = ()) -> None:
    """Add derivatives to the body's matrices of added mass and drag, with the opposite sign."""
    if not isinstance(values, Mapping):
        faults.add("coefficients", values, "is not a map of names", 'write {"X_udot": -30.0, "X_u": -4.0, ...}')
        values = {}
    ignore = name_set("ignore", ignore)
    matrices = {"dot": np.zeros((6, 6)), "linear": np.zeros((6, 6)), "quadratic": np.zeros((6, 6))}
    keys: dict[tuple[str, int, int], str] = {}
    for key, value in values.items():
        if key in ignore:
            continue
        name = read_name(key)
        if name is None or name.kind not in matrices:
            refuse_name(faults, key, value, name)
            continue
        number = faults.number(key, value)
        place = (name.kind, name.row, name.columns[0])
        if place in keys:
            faults.add(key, value, f"is given twice, also as {keys[place]}", "leave one out")
        keys[place] = key
        if number is not None:
            refuse_sign(faults, key, number, name)
            matrices[name.kind][name.row, name.columns[0]] = -number
    body.added_mass = with_partners(faults, matrices["dot"], keys, values)
    body.linear, body.quadratic = matrices["linear"], matrices["quadratic"]


def refuse_name(faults: Faults, key: str, value: Any, name: Name | None) -> None:
    """Add a fault with the reason why a coefficient is refused; `name` is None if it is not a coefficient's name."""
    if name is None:
        faults.add(key, value, "is not a coefficient's name", f"known: {_NAMES}")
    elif name.kind == "even":
        bars = f"{key[0]}_|{VELOCITIES[name.columns[0]]}|{VELOCITIES[name.columns[0]]}"
        remedy = f"leave it out (ignore=) if it comes from the added mass, or write {bars} if it is drag"
        faults.add(key, value, "is the same for either sign of the velocity, so it is no drag", remedy)
    elif name.kind == "modulus":
        problem = "is the product of one velocity and the modulus of another, drag of the flow across the hull"
        remedy = (
            "give the hull's cross-flow drag as a term cross_flow, or a term quadratic_form, and leave it out (ignore=)"
        )
        faults.add(key, value, problem, remedy)
    else:
        remedy = (
            "leave it out (ignore=) if it comes from the added mass, which implies it, or give a term quadratic_form"
        )
        lift = "; lift with the speed ahead is a term body_lift, lift of fins a term fins" if 0 in name.columns else ""
        faults.add(key, value, "is a product of two velocities", remedy + lift)


def refuse_sign(faults: Faults, key: str, number: float, name: Name) -> None:
    """Add a fault for a positive diagonal derivative, which would be negative added mass or negative drag."""
    if name.row == name.columns[0] and number > 0.0:
        problem = "is positive; the sign convention is Fossen's, in which this derivative is negative"
        faults.add(key, number, problem, f"write {-number:g} if it is meant as added mass or drag")


def with_partners(
    faults: Faults, matrix: np.ndarray, keys: Mapping[tuple[str, int, int], str], coefficients: Mapping[str, Any]
) -> np.ndarray:
    """Added mass (6, 6), completed by symmetry; adds a fault for a pair of entries that differ."""
    full = matrix.copy()
    for row, column in combinations(range(6), 2):
        upper, lower = keys.get(("dot", row, column)), keys.get(("dot", column, row))
        if upper is None:
            full[row, column] = matrix[column, row]
        elif lower is None:
            full[column, row] = matrix[row, column]
        elif abs(matrix[row, column] - matrix[column, row]) > RELATIVE * abs(matrix[row, column]):
            problem = f"differs from its partner {lower} = {coefficients[lower]}"
            faults.add(
                upper,
                coefficients[upper],
                f"{problem}, and the added mass matrix is symmetric",
                "correct one or leave it out",
            )
        else:
            full[column, row] = full[row, column]
    return full


# Signs of data that may be derivatives or magnitudes ----------------------------------------------------------------


def as_positive(faults: Faults, key: str, matrix: np.ndarray) -> np.ndarray:
    """Return a matrix of added mass or drag that is positive on its diagonal, from either sign convention."""
    diagonal = np.diag(matrix)
    if np.any(diagonal > 0.0) and np.any(diagonal < 0.0):
        remedy = "give all as derivatives (Fossen's signs, negative) or all as magnitudes (positive)"
        faults.add(key, diagonal, "has both signs on its diagonal", remedy)
    return matrix if np.any(diagonal > 0.0) else -matrix


PAIRS = ("xx", "xy", "xz", "yy", "yz", "zz")


def inertia_from_names(named: Mapping[str, Any]) -> np.ndarray:
    """Inertia matrix (3, 3) [kg m2] from ixx, ixy, ixz, iyy, iyz, izz; missing entries are 0."""
    xx, xy, xz, yy, yz, zz = (named.get(f"i{pair}", 0.0) for pair in PAIRS)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def turned(value: Any, axes: np.ndarray) -> Any:
    """Multiply a vector (3,) by the sign of each axis; any other value is returned unchanged, for a later check."""
    checked = Faults().finite("", value, (3,))
    return value if checked is None else axes * checked


def read_text(source: str | os.PathLike[str], is_text: bool, format_name: str) -> str:
    """Return `source` itself if it is a text, or else the content of the file that it names."""
    if is_text:
        text = str(source)
        if len(text) > (most := MOST_BYTES.get(format_name, MOST_OTHERS)):
            raise SceneError([f"{format_name}: a text of {len(text):,} characters. Give at most {most:,}"])
        return text
    return file_text(source, format_name)
