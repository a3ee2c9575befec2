"""Vehicles from the `<fluid_added_mass>` block and the hydrodynamics plugin of an SDF file."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import Any
from xml.etree import ElementTree

import numpy as np

from lgvi_warp.coefficients import (
    HALF_TURN,
    HALF_TURN_6,
    PAIRS,
    STANDARD_GRAVITY,
    Coefficients,
    as_positive,
    cross,
    inertia_from_names,
    read_text,
    rigid_body,
    symmetric,
    turned,
)
from lgvi_warp.errors import Faults, SceneError, closest

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
