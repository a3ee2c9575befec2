"""Vehicles from the usual forms of hydrodynamic coefficients, and the vehicles that come with the package.

Every importer returns a plain dict in the scene file's form, {"vehicle": {...}, "terms": [...]}, about the body
origin, in body axes x ahead, y to starboard, z down, linear before angular. All faults come at once, as a SceneError.
"""

from __future__ import annotations

import importlib
import os
import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from itertools import combinations, combinations_with_replacement
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from lgvi_warp.errors import Faults, SceneError, closest

FORCES, VELOCITIES = "XYZKMN", "uvwpqr"
STANDARD_GRAVITY = 9.80665  # m/s2, ISO 80000-3
# x ahead, y to port, z up (SDF, ROS) <-> x ahead, y to starboard, z down: half a turn about x.
HALF_TURN = np.array([1.0, -1.0, -1.0])
HALF_TURN_6 = np.tile(HALF_TURN, 2)
RELATIVE = 1e-6  # how far two printed values of one number, or a sum of them, may differ


# The vehicles of the package ----------------------------------------------------------------------------------------


def vehicles() -> list[str]:
    """The names of the vehicles that come with the package."""
    folder = resources.files("lgvi_warp") / "vehicles"
    return sorted(entry.name.removesuffix(".toml") for entry in folder.iterdir() if entry.name.endswith(".toml"))


def vehicle_file(name: str) -> Path:
    """The path of a vehicle's TOML file: the scene file's form, and a table [source]. Raises SceneError if unknown."""
    if name not in (known := vehicles()):
        raise SceneError([f"vehicle file {name!r}: is not known; {closest(name, known)}"])
    return Path(str(resources.files("lgvi_warp") / "vehicles" / f"{name}.toml"))


def vehicle_source(name: str) -> dict[str, str]:
    """The table [source] of a vehicle's file: title, reference, what it was checked against, what is missing."""
    return tomllib.loads(vehicle_file(name).read_text(encoding="utf-8"))["source"]


# What every form becomes --------------------------------------------------------------------------------------------


@dataclass
class Coefficients:
    """What an importer has read, before it is checked.

    Mass [kg]; inertia (3, 3) about the centre of gravity [kg m2]; centres (3,) from the body origin [m]; weight and
    buoyancy [N]; added_mass (6, 6), positive; linear and quadratic drag (6, 6): force_i = -(l_ij + q_ij |v_j|) v_j.
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

    def to_dict(self, faults: Faults) -> dict[str, Any]:
        """The scene file's tables. Raises SceneError with every fault noted so far and those of the sums."""
        faults.raise_if_any()
        assert self.mass is not None and self.inertia is not None and self.center_of_gravity is not None
        rigid = rigid_body_matrix(self.mass, self.inertia, self.center_of_gravity)
        for key, matrix in (("rigid_body_mass_matrix", rigid), ("total mass matrix", rigid + self.added_mass)):
            if np.linalg.eigvalsh(matrix)[0] <= 0.0:
                remedy = "check mass, inertia (and about which point it is given), centre of gravity and added mass"
                faults.add(key, matrix, "is not positive definite", remedy)
        faults.raise_if_any()
        vehicle = {
            "rigid_body_mass_matrix": rigid,
            "added_mass_matrix": self.added_mass,
            "weight": self.weight,
            "center_of_gravity": self.center_of_gravity,
            "buoyancy": self.buoyancy,
            "center_of_buoyancy": self.center_of_buoyancy,
        }
        return {"vehicle": {key: plain(value) for key, value in vehicle.items()}, "terms": self.terms()}

    def terms(self) -> list[dict[str, Any]]:
        """The drag as one term: by axis where it is diagonal, as matrices where it is not, none where it is zero."""
        pair = (self.linear, self.quadratic)
        if not any(np.any(matrix) for matrix in pair):
            return []
        diagonal = all(np.array_equal(matrix, np.diag(np.diag(matrix))) for matrix in pair)
        values = [plain(np.diag(matrix) if diagonal else matrix) for matrix in pair]
        return [{"type": "drag" if diagonal else "drag_matrix", "linear": values[0], "quadratic": values[1]}]


def plain(value: Any) -> Any:
    """Lists and floats instead of arrays, 0.0 instead of -0.0."""
    return (np.asarray(value) + 0.0).tolist()


def cross(r: np.ndarray) -> np.ndarray:
    """The matrix r^ of r^ v = r x v."""
    x, y, z = r
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rigid_body_matrix(mass: float, inertia: np.ndarray, center: np.ndarray) -> np.ndarray:
    """M_RB about the body origin, (6, 6), from the inertia (3, 3) [kg m2] about the centre of gravity."""
    S = cross(center)
    return np.block([[mass * np.eye(3), -mass * S], [mass * S, inertia - mass * S @ S]])


def symmetric(faults: Faults, key: str, matrix: np.ndarray) -> np.ndarray:
    """The symmetric part of a matrix that is symmetric to the digits given; a fault if it is not."""
    if np.abs(matrix - matrix.T).max() > RELATIVE * np.abs(matrix).max():
        faults.add(
            key, matrix, "is not symmetric", "added mass of a body in unbounded water is symmetric: mend the pair"
        )
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
    """Mass, centres and forces, checked. Not given: weight is mass x gravity, buoyancy is the weight."""
    mass, gravity = faults.positive("mass", mass, "kg"), faults.positive("gravity", gravity, "m/s2")
    inertia = faults.symmetric("inertia", inertia, "kg m2")
    centers = [
        faults.finite(key, value, (3,), "m")
        for key, value in (("center_of_gravity", center_of_gravity), ("center_of_buoyancy", center_of_buoyancy))
    ]
    if weight is not None:
        weight = faults.number("weight", weight, "N", least=0.0)
    elif mass is not None and gravity is not None:
        weight = mass * gravity
    buoyancy = weight if buoyancy is None else faults.number("buoyancy", buoyancy, "N", least=0.0)
    return Coefficients(mass, inertia, centers[0], centers[1], weight, buoyancy)


# Fossen's names -----------------------------------------------------------------------------------------------------

_DOT = re.compile(r"^(?:dot([uvwpqr])|d([uvwpqr])|([uvwpqr])dot)$")
_ABS = re.compile(r"^(?:([uvwpqr])\|([uvwpqr])\||\|([uvwpqr])\|([uvwpqr])|([uvwpqr])abs([uvwpqr]))$")
_NAMES = "X_udot (or Xudot, X_du, X_{\\dot u}), X_u, X_uu (or X_u|u|, X_{u|u|}, Xuabsu) for X Y Z K M N and u v w p q r"


@dataclass(frozen=True)
class Name:
    """A coefficient's name, read: kind "dot", "linear", "quadratic", "even" or "product", and the row and columns."""

    kind: str
    row: int
    columns: tuple[int, ...]


def read_name(name: str) -> Name | None:
    """A hydrodynamic derivative's name in any of the usual spellings; None if it is none."""
    text = re.sub(r"[\s_{}\\$,()*]", "", str(name))
    if len(text) < 2 or text[0] not in FORCES:
        return None
    row, tail = FORCES.index(text[0]), text[1:].lower()
    if match := _DOT.match(tail):
        return Name("dot", row, (VELOCITIES.index("".join(filter(None, match.groups()))),))
    if match := _ABS.match(tail):
        first, second = (VELOCITIES.index(letter) for letter in filter(None, match.groups()))
        return Name("quadratic" if first == second else "product", row, (first, second))
    if not 1 <= len(tail) <= 2 or any(letter not in VELOCITIES for letter in tail):
        return None
    columns = tuple(VELOCITIES.index(letter) for letter in tail)
    if len(columns) == 1:
        return Name("linear", row, columns)
    if columns[0] != columns[1]:
        return Name("product", row, columns)
    # X_qq q^2, unlike X_|q|q, is the same for +q and -q: what symmetry asks of X in w, q and of X, Z, M in v, p, r.
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
    """A vehicle and its drag from hydrodynamic derivatives in Fossen's (SNAME) names and signs.

    coefficients: X_udot ... N_rdot [kg, kg m, kg m2], X_u ... N_r [N s/m, N m s], X_uu ... N_rr [N s2/m2, N m s2], in
    any spelling of read_name, negative on the diagonal. Of a pair such as Y_rdot, N_vdot one suffices. X_qq and the
    like, which are even, and products (Y_uv, X_wq) are refused: those of the added mass follow from its matrix, lift
    is for fins. `ignore` names the coefficients to leave out all the same.
    mass [kg]; inertia (3,) or (3, 3) [kg m2], about the body "origin" or the centre of "gravity" (inertia_about);
    centers (3,) from the body origin [m]; weight [N], mass x gravity [m/s2] if not given; buoyancy [N], the weight if
    not given.

    Raises SceneError naming every fault.
    """
    faults = Faults()
    body = rigid_body(faults, mass, inertia, center_of_gravity, center_of_buoyancy, weight, buoyancy, gravity)
    about_gravity(faults, body, inertia_about)
    add_derivatives(faults, body, coefficients, ignore)
    return body.to_dict(faults)


def about_gravity(faults: Faults, body: Coefficients, inertia_about: str) -> None:
    """Carry an inertia that is given about the body origin to the centre of gravity."""
    known = faults.choice("inertia_about", inertia_about, ("origin", "gravity"))
    if not known or inertia_about == "gravity" or body.mass is None or body.inertia is None:
        return
    if body.center_of_gravity is not None:
        S = cross(body.center_of_gravity)
        body.inertia = body.inertia + body.mass * S @ S


def add_derivatives(faults: Faults, body: Coefficients, given: Mapping[str, Any], ignore: Iterable[str] = ()) -> None:
    """Put derivatives, by name, into the matrices of the body: minus their values."""
    if not isinstance(given, Mapping):
        faults.add("coefficients", given, "is not a map of names", 'write {"X_udot": -30.0, "X_u": -4.0, ...}')
        given = {}
    ignore = {ignore} if isinstance(ignore, str) else set(ignore)
    matrices = {"dot": np.zeros((6, 6)), "linear": np.zeros((6, 6)), "quadratic": np.zeros((6, 6))}
    keys: dict[tuple[str, int, int], str] = {}
    for key, value in given.items():
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
    body.added_mass = with_partners(faults, matrices["dot"], keys, given)
    body.linear, body.quadratic = matrices["linear"], matrices["quadratic"]


def refuse_name(faults: Faults, key: str, value: Any, name: Name | None) -> None:
    """Why a name cannot be taken."""
    if name is None:
        faults.add(key, value, "is not a coefficient's name", f"known: {_NAMES}")
    elif name.kind == "even":
        bars = f"{key[0]}_|{VELOCITIES[name.columns[0]]}|{VELOCITIES[name.columns[0]]}"
        remedy = f"leave it out (ignore=) if it comes from the added mass, or write {bars} if it is drag"
        faults.add(key, value, "is the same for either sign of the velocity, so it is no drag", remedy)
    else:
        remedy = "leave it out (ignore=) if it comes from the added mass, which implies it; give lift as fins"
        faults.add(key, value, "is a product of two velocities", remedy)


def refuse_sign(faults: Faults, key: str, number: float, name: Name) -> None:
    """A diagonal derivative above zero would be negative added mass or drag that drives."""
    if name.row == name.columns[0] and number > 0.0:
        what = "is positive; the sign convention is Fossen's, in which this derivative is negative"
        faults.add(key, number, what, f"write {-number:g} if it is meant as added mass or drag")


def with_partners(
    faults: Faults, matrix: np.ndarray, keys: Mapping[tuple[str, int, int], str], given: Mapping[str, Any]
) -> np.ndarray:
    """The added mass matrix with the missing one of each pair filled in; two that differ are a fault."""
    full = matrix.copy()
    for row, column in combinations(range(6), 2):
        upper, lower = keys.get(("dot", row, column)), keys.get(("dot", column, row))
        if upper is None:
            full[row, column] = matrix[column, row]
        elif lower is None:
            full[column, row] = matrix[row, column]
        elif abs(matrix[row, column] - matrix[column, row]) > RELATIVE * abs(matrix[row, column]):
            what = f"differs from its partner {lower} = {given[lower]}"
            faults.add(upper, given[upper], what, "the added mass matrix is symmetric: mend one or leave it out")
        else:
            full[column, row] = full[row, column]
    return full


# Signs of data that may be derivatives or magnitudes ----------------------------------------------------------------


def as_positive(faults: Faults, key: str, matrix: np.ndarray) -> np.ndarray:
    """Added mass or drag, positive on its diagonal, from either sign convention; Fossen's if it is zero there."""
    diagonal = np.diag(matrix)
    if np.any(diagonal > 0.0) and np.any(diagonal < 0.0):
        remedy = "give all as derivatives (Fossen's signs, negative) or all as magnitudes (positive)"
        faults.add(key, diagonal, "has both signs on its diagonal", remedy)
    return matrix if np.any(diagonal > 0.0) else -matrix


# SDF ----------------------------------------------------------------------------------------------------------------

_PLUGIN = re.compile(r"^([xyzkmn])(Dot)?([UVWPQR])(abs)?([UVWPQR])?$")


def from_sdf(
    source: str | os.PathLike[str],
    *,
    link: str | None = None,
    buoyancy: float | None = None,
    volume: float | None = None,
    water_density: float | None = None,
    center_of_buoyancy: Sequence[float] | None = None,
    gravity: float = STANDARD_GRAVITY,
) -> dict[str, Any]:
    """A vehicle and its drag from an SDF file (Gazebo), given as a path or as text.

    Read are <inertial> (mass, pose, inertia, fluid_added_mass about the link's origin) of one link, and the
    coefficients xDotU ..., xU ..., xUabsU ... (older: xUU ...) of the Hydrodynamics plugin; signs are Fossen's or all
    positive. SDF's link axes are x ahead, y to port, z up: turned here to x ahead, y to starboard, z down.
    link: its name; if not given, that of the plugin, or the heaviest. SDF has no displaced volume: give buoyancy [N],
    or volume [m3] (water_density [kg/m3], or the plugin's); else the vehicle is neutral. center_of_buoyancy: (3,) [m]
    in SDF's link axes, the link's origin if not given. gravity [m/s2].

    Raises SceneError naming every fault.
    """
    faults = Faults()
    root = parse_xml(source)
    plugin = next((p for p in root.iter("plugin") if is_hydrodynamics(p)), None)
    found = find_link(root, plugin, link)
    inertial = found.find("inertial")
    if inertial is None:
        raise SceneError([f"SDF link {found.get('name')!r}: has no <inertial>; add mass, pose and inertia"])
    if buoyancy is None and volume is not None:
        density = water_density if water_density is not None else plugin_density(plugin)
        values = [faults.positive(*a) for a in (("volume", volume, "m3"), ("water_density", density, "kg/m3"))]
        values.append(faults.positive("gravity", gravity, "m/s2"))
        buoyancy = None if None in values else float(np.prod(np.array(values, dtype=float)))
    center, turn = read_pose(faults, inertial.find("pose"))
    inertia = HALF_TURN[:, None] * (turn @ read_inertia(faults, inertial.find("inertia")) @ turn.T) * HALF_TURN
    at = turned((0.0, 0.0, 0.0) if center_of_buoyancy is None else center_of_buoyancy, HALF_TURN)
    if not (inertial.findtext("mass") or "").strip():
        faults.add("<mass>", "", "is missing", "give the mass of the link [kg]")
    mass = numbers(faults, inertial.find("mass"), 1, "1")[0]
    body = rigid_body(faults, mass, inertia, HALF_TURN * center, at, None, buoyancy, gravity)
    body.added_mass = read_fluid_added_mass(faults, inertial.find("fluid_added_mass"))
    if plugin is not None:
        add_plugin(faults, body, plugin)
    return body.to_dict(faults)


def read_text(source: str | os.PathLike[str], is_text: bool, what: str) -> str:
    """The text itself, or that of the file it names."""
    if is_text:
        return str(source)
    try:
        return Path(source).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError, TypeError) as error:
        raise SceneError([f"{what} {source}: {error}; give the path of a file, or its text"]) from None


def parse_xml(source: str | os.PathLike[str]) -> ElementTree.Element:
    """The root of an SDF text or file."""
    text = read_text(source, isinstance(source, str) and source.lstrip().startswith("<"), "SDF file")
    try:
        return ElementTree.fromstring(text.lstrip())
    except ElementTree.ParseError as error:
        raise SceneError([f"SDF is not XML: {error}; mend that line"]) from None


def is_hydrodynamics(plugin: ElementTree.Element) -> bool:
    """Whether a plugin is Gazebo's Hydrodynamics, or has its coefficients."""
    named = "hydrodynamics" in (plugin.get("name", "") + plugin.get("filename", "")).lower()
    return named or any(_PLUGIN.match(child.tag) for child in plugin)


def plugin_density(plugin: ElementTree.Element | None) -> Any:
    """The plugin's water density [kg/m3]; its documented default is 998."""
    texts = [plugin.findtext(tag) for tag in ("water_density", "waterDensity")] if plugin is not None else []
    return next((as_number(text) for text in texts if text), 998.0)


def as_number(text: str | None) -> Any:
    """The number in a text, or the text itself for the check to refuse."""
    try:
        return float(text or 0.0)
    except ValueError:
        return text


def find_link(root: ElementTree.Element, plugin: ElementTree.Element | None, name: str | None) -> ElementTree.Element:
    """The link of that name, the plugin's link, or the heaviest. Raises SceneError if there is none."""
    links = {str(item.get("name")): item for item in root.iter("link")}
    if name is None and plugin is not None:
        name = (plugin.findtext("link_name") or "").strip() or None
    if name is not None and name not in links:
        raise SceneError([f"SDF link = {name!r}: is not in the file; {closest(name, links)}"])
    if not links:
        raise SceneError(["SDF link: the file has none; give an SDF model with a <link>"])
    if name is not None:
        return links[name]
    masses = {key: as_number(item.findtext("inertial/mass")) for key, item in links.items()}
    return links[max(masses, key=lambda key: masses[key] if isinstance(masses[key], float) else 0.0)]


def numbers(faults: Faults, element: ElementTree.Element | None, count: int, default: str) -> np.ndarray:
    """The numbers in an element's text; zeros after noting a fault."""
    text = default if element is None or element.text is None else element.text
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([])
    if values.shape == (count,) and np.all(np.isfinite(values)):
        return values
    faults.add(f"<{'' if element is None else element.tag}>", text, f"does not hold {count} finite numbers", "mend it")
    return np.zeros(count)


def read_pose(faults: Faults, pose: ElementTree.Element | None) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) [m] and rotation (3, 3) of the frame of the centre of mass in the link."""
    if pose is None:
        return np.zeros(3), np.eye(3)
    if pose.get("relative_to"):
        faults.add("<pose>", pose.get("relative_to"), "is relative to another frame", "give it relative to the link")
    if pose.get("rotation_format") == "quat_xyzw":
        values = numbers(faults, pose, 7, "")
        x, y, z, w = values[3:] / (np.linalg.norm(values[3:]) or 1.0)
        S = cross(np.array([x, y, z]))
        return values[:3], np.eye(3) + 2.0 * w * S + 2.0 * S @ S
    values = numbers(faults, pose, 6, "")
    angles = np.radians(values[3:]) if pose.get("degrees") in ("true", "1") else values[3:]
    return values[:3], rotation_from_rpy(angles)


def rotation_from_rpy(angles: np.ndarray) -> np.ndarray:
    """Rz(yaw) Ry(pitch) Rx(roll), (3, 3), from (roll, pitch, yaw) [rad]."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def read_inertia(faults: Faults, element: ElementTree.Element | None) -> np.ndarray:
    """The inertia (3, 3) [kg m2] of an SDF, URDF or YAML of six names; SDF's defaults where one is missing."""
    if element is None:
        faults.add("<inertia>", "", "is missing", "give ixx, iyy, izz [kg m2]")
        return np.eye(3)
    children = {f"i{pair}": element.find(f"i{pair}") for pair in PAIRS}
    default = {f"i{pair}": "1" if pair[0] == pair[1] else "0" for pair in PAIRS}
    named = {name: float(numbers(faults, child, 1, default[name])[0]) for name, child in children.items()}
    return inertia_from_names(named)


PAIRS = ("xx", "xy", "xz", "yy", "yz", "zz")


def inertia_from_names(named: Mapping[str, Any]) -> np.ndarray:
    """(3, 3) from ixx, ixy, ixz, iyy, iyz, izz; products of inertia are 0 if not given."""
    xx, xy, xz, yy, yz, zz = (named.get(f"i{pair}", 0.0) for pair in PAIRS)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def read_fluid_added_mass(faults: Faults, element: ElementTree.Element | None) -> np.ndarray:
    """<fluid_added_mass> xx, xy ... rr as (6, 6) in axes x ahead, y to starboard, z down."""
    matrix = np.zeros((6, 6))
    for row, column in combinations_with_replacement(range(6), 2):
        child = None if element is None else element.find("xyzpqr"[row] + "xyzpqr"[column])
        matrix[row, column] = matrix[column, row] = numbers(faults, child, 1, "0")[0]
    if np.any(np.diag(matrix) < 0.0):
        faults.add("<fluid_added_mass>", np.diag(matrix), "is negative on its diagonal", "SDF's added mass is positive")
    return HALF_TURN_6[:, None] * matrix * HALF_TURN_6


def add_plugin(faults: Faults, body: Coefficients, plugin: ElementTree.Element) -> None:
    """The coefficients of the Hydrodynamics plugin, of either sign convention."""
    matrices = {"added mass": np.zeros((6, 6)), "linear drag": np.zeros((6, 6)), "quadratic drag": np.zeros((6, 6))}
    for child in plugin:
        if not (match := _PLUGIN.match(child.tag)):
            continue
        force, dot, first, bars, second = match.groups()
        row, column = "xyzkmn".index(force), "UVWPQR".index(first)
        value = numbers(faults, child, 1, "0")[0]
        if dot:
            matrices["added mass"][row, column] = value
        elif second is None:
            matrices["linear drag"][row, column] = value
        elif first == second and (bars or row == column):
            matrices["quadratic drag"][row, column] = value
        elif value != 0.0:
            remedy = "only |v| v of one velocity is a drag: leave it out, or add a term of your own"
            faults.add(f"<{child.tag}>", value, "is a product of velocities", remedy)
    frd = [
        HALF_TURN_6[:, None] * as_positive(faults, f"plugin's {key}", matrix) * HALF_TURN_6
        for key, matrix in matrices.items()
    ]
    if np.any(frd[0]) and np.any(body.added_mass):
        faults.add("<fluid_added_mass>", "...", "and the plugin's xDotU ... both give added mass", "keep one of them")
    body.added_mass = body.added_mass + symmetric(faults, "plugin's added mass", frd[0])
    body.linear, body.quadratic = frd[1], frd[2]


# YAML ---------------------------------------------------------------------------------------------------------------

_ALIASES = {
    "mass": ("mass", "m"),
    "inertia": ("inertia", "inertial", "inertia_matrix", "moments_of_inertia"),
    "added_mass": ("added_mass", "Ma", "added_mass_matrix"),
    "linear": ("linear_damping", "linear_drag", "damping_linear"),
    "quadratic": ("quadratic_damping", "quad_damping", "quadratic_drag", "damping_quadratic"),
    "volume": ("volume",),
    "buoyancy": ("buoyancy",),
    "weight": ("weight",),
    "center_of_buoyancy": ("center_of_buoyancy", "cob", "centre_of_buoyancy"),
    "center_of_gravity": ("center_of_gravity", "center_of_mass", "cog", "com", "centre_of_gravity"),
    "density": ("density", "water_density", "fluid_density", "rho"),
    "gravity": ("gravity", "g"),
    "coefficients": ("coefficients", "hydrodynamics", "hydrodynamic_coefficients", "derivatives"),
}


def from_yaml(
    source: str | os.PathLike[str],
    *,
    position_axes: str = "flu",
    matrix_axes: str = "frd",
    ignore: Iterable[str] = (),
    **given: Any,
) -> dict[str, Any]:
    """A vehicle and its drag from a YAML file of a robotics package (uuv_simulator, Plankton), as a path or as text.

    Keys, at the top or one level below: mass, inertia (3, 3x3 or ixx ...) about the centre of gravity, volume (with
    density) or buoyancy, cog, cob, added_mass (6x6 or 6), linear_damping, quadratic_damping (6 or 6x6; derivatives or
    magnitudes), or a map `coefficients` of Fossen's names. Others are refused unless named in `ignore`; `given`
    (mass=..., density=...) adds or replaces.
    position_axes: axes of the centres and of the inertia, "flu" (x ahead, y to port, z up, as uuv_simulator has them)
    or "frd" (x ahead, y to starboard, z down). matrix_axes: those of added mass and damping, which uuv_simulator gives
    in "frd".

    Raises SceneError naming every fault; ImportError if PyYAML is not installed.
    """
    faults = Faults()
    for key, value in (("position_axes", position_axes), ("matrix_axes", matrix_axes)):
        faults.choice(key, value, ("flu", "frd"))
    ignore = {ignore} if isinstance(ignore, str) else set(ignore)
    read = by_meaning(faults, parse_yaml(source), ignore) | by_meaning(faults, given, set())
    positions = HALF_TURN if position_axes == "flu" else np.ones(3)
    matrices = HALF_TURN_6 if matrix_axes == "flu" else np.ones(6)
    body = yaml_body(faults, read, positions)
    for name in ("added_mass", "linear", "quadratic"):
        value = matrices[:, None] * matrix_6(faults, name, read.get(name)) * matrices
        setattr(body, name, symmetric(faults, name, value) if name == "added_mass" else value)
    if "coefficients" in read:
        for name in {"added_mass", "linear", "quadratic"} & set(read):
            faults.add(name, read[name], "is given besides coefficients by name", "keep one of them")
        if matrix_axes == "flu":
            faults.add("matrix_axes", "flu", "does not go with coefficients by name", "Fossen's names are for frd")
        add_derivatives(faults, body, read["coefficients"], ignore)
    return body.to_dict(faults)


def parse_yaml(source: str | os.PathLike[str]) -> Mapping[str, Any]:
    """The map of a YAML text or file."""
    try:
        yaml = importlib.import_module("yaml")
    except ImportError:
        raise ImportError("reading YAML needs PyYAML: pip install 'lgvi-warp[yaml]'") from None
    text = read_text(source, isinstance(source, str) and ("\n" in source or ": " in source), "YAML file")
    try:
        content = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise SceneError([f"YAML: {' '.join(str(error).split())}; mend that line"]) from None
    if not isinstance(content, Mapping):
        raise SceneError(["YAML: is not a map; write mass: ..., added_mass: ..."])
    return content


def by_meaning(faults: Faults, content: Mapping[str, Any], ignore: set[str]) -> dict[str, Any]:
    """The values by what they mean: aliases resolved, one level of tables opened, Fossen's names gathered."""
    meanings = {alias: name for name, aliases in _ALIASES.items() for alias in aliases}
    read: dict[str, Any] = {}
    for key, value in content.items():
        name = meanings.get(key)
        if key in ignore:
            continue
        if name in read and name != "coefficients":
            faults.add(key, value, f"is given twice, as another name of {name}", "keep one of them")
        elif name == "coefficients" and isinstance(value, Mapping):
            read[name] = read.get(name, {}) | dict(value)
        elif name is not None:
            read[name] = value
        elif isinstance(key, str) and read_name(key):
            read.setdefault("coefficients", {})[key] = value
        elif isinstance(value, Mapping):
            read |= by_meaning(faults, value, ignore)
        else:
            faults.add(key, value, "is an unknown key", f"{closest(key, meanings)}; or name it in ignore=")
    return read


def yaml_body(faults: Faults, read: Mapping[str, Any], positions: np.ndarray) -> Coefficients:
    """Mass, inertia, centres and forces of a YAML map."""
    inertia = read.get("inertia")
    if isinstance(inertia, Mapping):
        faults.keys("inertia", inertia, [f"i{pair}" for pair in PAIRS])
        inertia = inertia_from_names(inertia)
    gravity = read.get("gravity", STANDARD_GRAVITY)
    gravity = abs(gravity) if isinstance(gravity, int | float) else gravity
    for key in ("mass", "inertia"):
        if read.get(key) is None:
            faults.add(key, "", "is missing", f"add {key} to the file, or pass {key}=")
    square = Faults().symmetric("inertia", inertia, "") if inertia is not None else None
    if square is not None:
        inertia = positions[:, None] * square * positions
    buoyancy = read.get("buoyancy")
    if buoyancy is None and "volume" in read:
        numbers_ = [
            faults.positive("volume", read["volume"], "m3"),
            faults.positive("density", read.get("density", "not given"), "kg/m3 (with volume)"),
            faults.positive("gravity", gravity, "m/s2"),
        ]
        buoyancy = None if None in numbers_ else float(np.prod(np.array(numbers_, dtype=float)))
    zero = (0.0, 0.0, 0.0)
    gravity_at = turned(read.get("center_of_gravity", zero), positions)
    buoyancy_at = turned(read.get("center_of_buoyancy", zero), positions)
    mass = 1.0 if read.get("mass") is None else read["mass"]
    inertia = np.eye(3) if inertia is None else inertia
    return rigid_body(faults, mass, inertia, gravity_at, buoyancy_at, read.get("weight"), buoyancy, gravity)


def turned(value: Any, axes: np.ndarray) -> Any:
    """A vector in turned axes; left as it is if it is none, for the check to refuse."""
    checked = Faults().finite("", value, (3,))
    return value if checked is None else axes * checked


def matrix_6(faults: Faults, key: str, value: Any) -> np.ndarray:
    """6x6, 36 numbers or the 6 of a diagonal, positive on it, from either sign convention; zeros if not given."""
    if value is None:
        return np.zeros((6, 6))
    array = faults.finite(key, value)
    if array is None:
        return np.zeros((6, 6))
    if array.shape not in ((6,), (36,), (6, 6)):
        faults.add(key, value, f"has shape {array.shape}", "give 6 numbers or a 6x6 matrix")
        return np.zeros((6, 6))
    return as_positive(faults, key, np.diag(array) if array.shape == (6,) else array.reshape(6, 6))
