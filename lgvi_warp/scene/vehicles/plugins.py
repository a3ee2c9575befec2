"""What the plugins of a robot description say of one link: gz-sim's Hydrodynamics, and uuv_simulator's underwater object."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.scene.vehicles.fossen import HALF_TURN_6, Coefficients, as_positive, symmetric
from lgvi_warp.scene.vehicles.links import carried
from lgvi_warp.scene.vehicles.poses import Pose
from lgvi_warp.scene.vehicles.robot_xml import floats, is_true, number, numbers_in, plugin_name, text_of

_TERM = re.compile(r"^([xyzkmn])(Dot)?([UVWPQR])(abs)?([UVWPQR])?$")
# Plugins that push a vehicle and that are not read: in whose name one of these stands, and what takes their place here.
UNREAD = {
    "thruster": (("thruster",), "give a term thrusters"),
    "lift and drag": (("liftdrag", "lift-drag"), "give a term fins or control_fins"),
    "buoyancy engine": (("buoyancyengine", "buoyancy-engine"), "taken at the neutral volume"),
    "other hydrodynamics": (("hydrodynamics",), "give drag and added mass"),
}


@dataclass
class Hydrodynamics:
    """Of one link, in axes x ahead, y to starboard, z down, about its origin: all (6, 6) and positive as in Coefficients.

    volume [m3], volume_center (3,) [m] (link's own axes, z up): of uuv_simulator, which does not look at shapes.
    current: velocity (3,) [m/s] of the water, north, east, down.
    """

    link: str
    added_mass: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    linear: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    quadratic: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    forward: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    density: float | None = None
    volume: float | None = None
    volume_center: np.ndarray = field(default_factory=lambda: np.zeros(3))
    neutral: bool = False
    current: np.ndarray = field(default_factory=lambda: np.zeros(3))


def is_hydrodynamics(plugin: Element) -> bool:
    """Whether a plugin has the coefficients of Gazebo's Hydrodynamics, or its name and a link. Others have that name too,
    and a controller's gain may be called kP as a drag is."""
    named = "hydrodynamics" in plugin_name(plugin) and plugin.find("link_name") is not None
    return named or any(_TERM.match(child.tag) and child.tag[0] in "xyz" for child in plugin)


def is_underwater_object(plugin: Element) -> bool:
    """Whether a plugin is uuv_simulator's: it holds links with a hydrodynamic model or a volume."""
    return any(link.find("hydrodynamic_model") is not None for link in plugin.findall("link"))


def unread(plugins: Sequence[Element]) -> list[str]:
    """A line about each kind of plugin that pushes the vehicle and is not read."""
    lines = []
    for kind, (parts, remedy) in UNREAD.items():
        count = sum(any(part in plugin_name(plugin) for part in parts) and not is_read(plugin) for plugin in plugins)
        if count:
            lines.append(f"plugins that are not read: {kind} ({count}); {remedy}")
    return lines


def is_read(plugin: Element) -> bool:
    """Whether a plugin is one whose numbers are read."""
    return is_hydrodynamics(plugin) or is_underwater_object(plugin)


# gz-sim -------------------------------------------------------------------------------------------------------------


def read_hydrodynamics(faults: Faults, warnings: list[str], plugin: Element, link: str) -> Hydrodynamics:
    """The coefficients of gz-sim's Hydrodynamics, of either sign convention."""
    found = Hydrodynamics(link, density=plugin_density(faults, plugin))
    matrices = {"added mass": np.zeros((6, 6)), "linear drag": np.zeros((6, 6)), "quadratic drag": np.zeros((6, 6))}
    even = []
    for child in plugin:
        if not (match := _TERM.match(child.tag)):
            continue
        force, dot, first, bars, second = match.groups()
        row, column = "xyzkmn".index(force), "UVWPQR".index(first)
        value = float(numbers_in(faults, f"<{child.tag}>", text_of(child) or "0", 1)[0])
        if dot and not second:
            matrices["added mass"][row, column] = value
        elif second is None and not bars and not dot:
            matrices["linear drag"][row, column] = value
        elif first == second and not dot and (bars or row == column):
            matrices["quadratic drag"][row, column] += value
            even += [child.tag] if value and not bars else []
        elif value != 0.0:
            remedy = "only |v| v of one velocity is a drag: leave it out, or add a term of your own"
            faults.add(f"<{child.tag}>", value, "is a product of velocities", remedy)
    if even:
        told = ", ".join(f"<{tag}>" for tag in even)
        warnings.append(
            f"{told}: read as |v| v, as older versions of Gazebo do; newer ones take v v, which drives astern"
        )
    if is_true(plugin.findtext("disable_added_mass")):
        matrices["added mass"] = np.zeros((6, 6))
    elif is_true(plugin.findtext("disable_coriolis")) and np.any(matrices["added mass"]):
        warnings.append("disable_coriolis is not followed: added mass always comes with its Coriolis forces here")
    frd = [
        HALF_TURN_6[:, None] * as_positive(faults, f"plugin's {key}", matrix) * HALF_TURN_6
        for key, matrix in matrices.items()
    ]
    found.added_mass = symmetric(faults, "plugin's added mass", frd[0])
    found.linear, found.quadratic = frd[1], frd[2]
    if text_of(plugin.find("default_current")):
        east, north, up = numbers_in(faults, "<default_current>", text_of(plugin.find("default_current")), 3)
        found.current = np.array([north, east, -up])
    if any(child.tag.startswith("lookup_current") for child in plugin):
        warnings.append("lookup_current is not read: give the water's velocity as a term current_profile")
    return found


def plugin_density(faults: Faults, plugin: Element) -> float | None:
    """The water density [kg/m3] that a plugin names, if it does."""
    for tag in ("water_density", "waterDensity", "fluid_density"):
        if text_of(plugin.find(tag)):
            return faults.positive(f"<{tag}>", number(faults, "", plugin, tag, "1"), "kg/m3")
    return None


# uuv_simulator ------------------------------------------------------------------------------------------------------


def read_underwater_object(faults: Faults, warnings: list[str], plugin: Element) -> list[Hydrodynamics]:
    """The links of uuv_simulator's plugin. Its matrices are in axes x ahead, y to starboard, z down already."""
    density = plugin_density(faults, plugin)
    density = 1028.0 if density is None else density  # kg/m3: the plugin's default
    return [read_underwater_link(faults, warnings, link, density) for link in plugin.findall("link")]


def read_underwater_link(faults: Faults, warnings: list[str], link: Element, density: float) -> Hydrodynamics:
    """Volume, centre and matrices of one link."""
    name = link.get("name", "")
    found = Hydrodynamics(name, density=density, neutral=is_true(link.findtext("neutrally_buoyant")))
    found.volume = number(faults, f"{name} ", link, "volume", "0")
    if text_of(link.find("center_of_buoyancy")):
        found.volume_center = numbers_in(
            faults, f"{name} <center_of_buoyancy>", text_of(link.find("center_of_buoyancy")), 3
        )
    model = link.find("hydrodynamic_model")
    if model is None:
        return found
    kind = text_of(model.find("type")) or "fossen"
    if kind != "fossen":
        remedy = 'its numbers follow from shape and speed: give added mass and damping as type "fossen"'
        faults.add(f"{name} <type>", kind, "is not read", remedy)
        return found
    matrices = {
        tag: block_matrix(faults, f"{name} <{tag}>", text_of(model.find(tag)))
        for tag in ("added_mass", "linear_damping", "linear_damping_forward_speed", "quadratic_damping")
    }
    found.added_mass = symmetric(faults, f"{name} <added_mass>", matrices["added_mass"])
    found.linear = as_positive(faults, f"{name} <linear_damping>", matrices["linear_damping"])
    found.forward = as_positive(
        faults, f"{name} <linear_damping_forward_speed>", matrices["linear_damping_forward_speed"]
    )
    quadratic = as_positive(faults, f"{name} <quadratic_damping>", matrices["quadratic_damping"])
    found.quadratic = by_diagonal(warnings, quadratic)
    return found


def block_matrix(faults: Faults, key: str, text: str) -> np.ndarray:
    """(6, 6) from 36 numbers or the 6 of a diagonal; zeros if there are none."""
    if not text:
        return np.zeros((6, 6))
    values = floats(text)
    if values is not None and len(values) == 6:
        return np.diag(numbers_in(faults, key, text, 6))
    return numbers_in(faults, key, text, 36).reshape(6, 6)


def by_diagonal(warnings: list[str], quadratic: np.ndarray) -> np.ndarray:
    """The diagonal of a quadratic damping matrix: the rest uuv_simulator reads and does not use."""
    diagonal = np.diag(np.diag(quadratic))
    if not np.array_equal(quadratic, diagonal):
        warnings.append("quadratic damping: read by its diagonal, as uuv_simulator does; what is beside it is left out")
    return diagonal


# Into one body ------------------------------------------------------------------------------------------------------


def add_to(faults: Faults, body: Coefficients, found: Hydrodynamics, pose: Pose) -> None:
    """Add a link's coefficients to a body's, where the link has that pose (axes z up) in the body."""
    X = HALF_TURN_6[:, None] * carried(pose) * HALF_TURN_6
    for name in ("added_mass", "linear"):
        setattr(body, name, getattr(body, name) + X.T @ getattr(found, name) @ X)
    body.current = body.current + found.current
    for name in ("quadratic", "forward"):
        matrix = getattr(found, name)
        if np.any(matrix) and not np.allclose(X, np.eye(6), atol=1e-12):
            remedy = f"it has no such form about another point: pass link={found.link!r}, or leave that plugin out"
            faults.add(f"{name} drag of the link", found.link, "is about another point than the vehicle's", remedy)
        else:
            setattr(body, name, getattr(body, name) + matrix)
