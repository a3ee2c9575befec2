# SPDX-License-Identifier: Apache-2.0
"""Plugins of a robot description that give the hydrodynamic coefficients of links: gz-sim's and uuv_simulator's."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from lgvi_warp.common.errors import Faults
from lgvi_warp.extensions.importers.links import carried
from lgvi_warp.extensions.importers.poses import Pose
from lgvi_warp.extensions.importers.robot_xml import floats, is_true, number, numbers_in, plugin_name, text_of
from lgvi_warp.vehicles.fossen import HALF_TURN_6, Coefficients, as_positive, symmetric

_TERM = re.compile(r"^([xyzkmn])(Dot)?([UVWPQR])(abs)?([UVWPQR])?$")
# Plugins that push a vehicle and are not read: parts of their names, and what to give here in their place.
UNREAD = {
    "thruster": (("thruster",), "give a term thrusters"),
    "lift and drag": (("liftdrag", "lift-drag"), "give a term fins or control_fins"),
    "buoyancy engine": (("buoyancyengine", "buoyancy-engine"), "taken at the neutral volume"),
    "other hydrodynamics": (("hydrodynamics",), "give drag and added mass"),
}


@dataclass
class Hydrodynamics:
    """Hydrodynamic coefficients of one link, in axes x ahead, y to starboard, z down, about its origin.

    density: Density of the water [kg/m3]. current: Velocity (3,) [m/s] of the water, north, east, down. Both are None if the
    plugin does not give them. volume: Displaced volume [m3] in uuv_simulator; None for gz-sim. volume_center: Its centre
    (3,) [m], in the link's own axes (z up).
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
    current: np.ndarray | None = None


def is_hydrodynamics(plugin: Element) -> bool:
    """Return whether a plugin is Gazebo's Hydrodynamics: it holds a coefficient, or has that name and names a link.

    Other plugins have that name too, and a controller's gain may have the name kP, like a drag coefficient.
    """
    named = "hydrodynamics" in plugin_name(plugin) and plugin.find("link_name") is not None
    return named or any(_TERM.match(child.tag) and child.tag[0] in "xyz" for child in plugin)


def is_underwater_object(plugin: Element) -> bool:
    """Return whether a plugin is the one of uuv_simulator, which holds links with a hydrodynamic model."""
    return any(link.find("hydrodynamic_model") is not None for link in plugin.findall("link"))


def unread(plugins: Sequence[Element]) -> list[str]:
    """Return a warning for each kind of plugin that exerts a force on the vehicle but is not read."""
    lines = []
    for kind, (parts, remedy) in UNREAD.items():
        count = sum(any(part in plugin_name(plugin) for part in parts) and not is_read(plugin) for plugin in plugins)
        if count:
            lines.append(f"plugins that are not read: {kind} ({count}); {remedy}")
    return lines


def is_read(plugin: Element) -> bool:
    """Return whether the coefficients of a plugin are read."""
    return is_hydrodynamics(plugin) or is_underwater_object(plugin)


# gz-sim -------------------------------------------------------------------------------------------------------------


def read_hydrodynamics(faults: Faults, warnings: list[str], plugin: Element, link: str) -> Hydrodynamics:
    """Read the coefficients of gz-sim's Hydrodynamics, in either sign convention."""
    hydrodynamics = Hydrodynamics(link, density=plugin_density(faults, plugin))
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
            remedy = "only |v| v of one velocity is a drag: leave it out here, and give a term quadratic_form"
            faults.add(f"<{child.tag}>", value, "is a product of velocities", remedy)
    if even:
        tags = ", ".join(f"<{tag}>" for tag in even)
        reading = "read as |v| v, as older versions of Gazebo do; newer ones take v v, which drives astern"
        warnings.append(f"{tags}: {reading}")
    if is_true(plugin.findtext("disable_added_mass")):
        matrices["added mass"] = np.zeros((6, 6))
    elif is_true(plugin.findtext("disable_coriolis")) and np.any(matrices["added mass"]):
        warnings.append("disable_coriolis is not followed: added mass always comes with its Coriolis forces here")
    frd = [
        HALF_TURN_6[:, None] * as_positive(faults, f"plugin's {key}", matrix) * HALF_TURN_6
        for key, matrix in matrices.items()
    ]
    hydrodynamics.added_mass = symmetric(faults, "plugin's added mass", frd[0])
    hydrodynamics.linear, hydrodynamics.quadratic = frd[1], frd[2]
    if text := text_of(plugin.find("default_current")):
        east, north, up = numbers_in(faults, "<default_current>", text, 3)
        hydrodynamics.current = np.array([north, east, -up])
    if any(child.tag.startswith("lookup_current") for child in plugin):
        warnings.append("lookup_current is not read: give the water's velocity as a term current_profile")
    return hydrodynamics


def plugin_density(faults: Faults, plugin: Element) -> float | None:
    """Return the water density [kg/m3] that a plugin gives, or None."""
    for tag in ("water_density", "waterDensity", "fluid_density"):
        if text_of(plugin.find(tag)):
            return faults.positive(f"<{tag}>", number(faults, "", plugin, tag, "1"), "kg/m3")
    return None


# uuv_simulator ------------------------------------------------------------------------------------------------------


def read_underwater_object(faults: Faults, warnings: list[str], plugin: Element) -> list[Hydrodynamics]:
    """Read the links of uuv_simulator's plugin, whose matrices are already in axes x ahead, y to starboard, z down."""
    density = plugin_density(faults, plugin)
    density = 1028.0 if density is None else density  # kg/m3: the plugin's default
    return [read_underwater_link(faults, warnings, link, density) for link in plugin.findall("link")]


def read_underwater_link(faults: Faults, warnings: list[str], link: Element, density: float) -> Hydrodynamics:
    """Read volume, centre and matrices of one link of uuv_simulator's plugin."""
    name = link.get("name", "")
    hydrodynamics = Hydrodynamics(name, density=density, neutral=is_true(link.findtext("neutrally_buoyant")))
    hydrodynamics.volume = number(faults, f"{name} ", link, "volume", "0")
    if text := text_of(link.find("center_of_buoyancy")):
        hydrodynamics.volume_center = numbers_in(faults, f"{name} <center_of_buoyancy>", text, 3)
    model = link.find("hydrodynamic_model")
    if model is None:
        return hydrodynamics
    kind = text_of(model.find("type")) or "fossen"
    if kind != "fossen":
        remedy = 'its numbers follow from shape and speed: give added mass and damping as type "fossen"'
        faults.add(f"{name} <type>", kind, "is not read", remedy)
        return hydrodynamics
    added_mass, *damping = (
        (f"{name} <{tag}>", block_matrix(faults, f"{name} <{tag}>", text_of(model.find(tag))))
        for tag in ("added_mass", "linear_damping", "linear_damping_forward_speed", "quadratic_damping")
    )
    hydrodynamics.added_mass = symmetric(faults, *added_mass)
    hydrodynamics.linear, hydrodynamics.forward, quadratic = (as_positive(faults, *matrix) for matrix in damping)
    hydrodynamics.quadratic = by_diagonal(warnings, quadratic)
    return hydrodynamics


def block_matrix(faults: Faults, key: str, text: str) -> np.ndarray:
    """Read a matrix (6, 6) from 36 numbers, or from the 6 numbers of its diagonal; an empty text gives zeros."""
    if not text:
        return np.zeros((6, 6))
    values = floats(text)
    if values is not None and len(values) == 6:
        return np.diag(numbers_in(faults, key, text, 6))
    return numbers_in(faults, key, text, 36).reshape(6, 6)


def by_diagonal(warnings: list[str], quadratic: np.ndarray) -> np.ndarray:
    """Return the diagonal part of a quadratic damping matrix (6, 6): uuv_simulator does not use the other entries."""
    diagonal = np.diag(np.diag(quadratic))
    if not np.array_equal(quadratic, diagonal):
        warnings.append("quadratic damping: read by its diagonal, as uuv_simulator does; what is beside it is left out")
    return diagonal


def shared(faults: Faults, tag: str, values: Sequence[Any], remedy: str) -> Any:
    """The value that the plugins of one body give for a property of the water; None if no plugin gives one."""
    said = [value for value in values if value is not None]
    if any(not np.array_equal(value, said[0]) for value in said):
        shown = "; ".join(" ".join(f"{x:g}" for x in np.atleast_1d(value)) for value in said)
        faults.add(f"<{tag}>", shown, "differs from plugin to plugin, where a body is in one water", remedy)
    return said[0] if said else None


# Into one body ------------------------------------------------------------------------------------------------------


def add_to(faults: Faults, body: Coefficients, hydrodynamics: Hydrodynamics, pose: Pose) -> None:
    """Add a link's coefficients to those of the body."""
    X = HALF_TURN_6[:, None] * carried(pose) * HALF_TURN_6
    for name in ("added_mass", "linear"):
        setattr(body, name, getattr(body, name) + X.T @ getattr(hydrodynamics, name) @ X)
    for name in ("quadratic", "forward"):
        matrix = getattr(hydrodynamics, name)
        if np.any(matrix) and not np.allclose(X, np.eye(6), atol=1e-12):
            remedy = (
                f"it has no such form about another point: pass link={hydrodynamics.link!r}, or leave that plugin out"
            )
            faults.add(
                f"{name} drag of the link", hydrodynamics.link, "is about another point than the vehicle's", remedy
            )
        else:
            setattr(body, name, getattr(body, name) + matrix)
