# SPDX-License-Identifier: Apache-2.0
"""Models of SDF and URDF files as read: links, joints, coefficients from plugins, and the water of the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement
from xml.etree.ElementTree import Element

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, closest
from lgvi_warp.common.sentences import capital, sentences
from lgvi_warp.extensions.importers.includes import names_of
from lgvi_warp.extensions.importers.links import (
    MOST_LINKS,
    Joint,
    Link,
    add_volumes,
    link_named,
    read_inertia,
    volume_of,
)
from lgvi_warp.extensions.importers.plugins import (
    Hydrodynamics,
    is_hydrodynamics,
    is_read,
    is_underwater_object,
    read_hydrodynamics,
    read_underwater_object,
    unread,
)
from lgvi_warp.extensions.importers.poses import Poses, Scope, read_pose
from lgvi_warp.extensions.importers.robot_xml import (
    child_of,
    is_true,
    number,
    plugin_name,
    plugins_of,
    read_floats,
    text_of,
)
from lgvi_warp.extensions.importers.urdf import read_urdf

GAZEBO_GRAVITY = 9.8  # m/s2: of a <world> that gives none
GAZEBO_DENSITY = 1000.0  # kg/m3: of Gazebo's Buoyancy system, if none is given


@dataclass
class Water:
    """Water of a file's <world>: gravity [m/s2] and density [kg/m3]."""

    gravity: float | None = None
    density: float | None = None
    enabled: tuple[str, ...] = ()


@dataclass
class RobotModel:
    """A model as read from a file."""

    name: str
    links: dict[str, Link]
    joints: list[Joint]
    hydrodynamics: list[Hydrodynamics]
    water: Water
    warnings: list[str] = field(default_factory=list)


def listed(names: Sequence[str], most: int = 20) -> str:
    """Return at most `most` names as one text, with the number of the names left out."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def refuse_crowd(elements: Sequence[Element]) -> None:
    """Refuse more elements than any vehicle has, so that the reading time is bounded."""
    if len(elements) > MOST_LINKS:
        problem = f"the model has {len(elements):,} of <{elements[0].tag}>, more than {MOST_LINKS:,}"
        raise SceneError([sentences("SDF model", problem, "give the vehicle alone")])


# URDF and SDF -------------------------------------------------------------------------------------------------------


def read_model(faults: Faults, root: Element, name: str | None, link: str | None) -> RobotModel:
    """Read the model of a URDF file, or the named or only model of an SDF file."""
    return model_of_urdf(faults, root) if root.tag == "robot" else model_of_sdf(faults, root, name, link)


def model_of_urdf(faults: Faults, root: Element) -> RobotModel:
    """Read the model of a URDF file."""
    for tag in ("link", "joint", "plugin", "collision"):
        refuse_crowd(list(root.iter(tag)))
    links, joints = read_urdf(faults, root)
    read = RobotModel(root.get("name", "robot"), links, joints, [], Water())
    add_plugins(faults, read, list(plugins_of(root)), "")
    return read


# SDF ----------------------------------------------------------------------------------------------------------------


def model_of_sdf(faults: Faults, root: Element, name: str | None, link: str | None) -> RobotModel:
    """Read one model of an SDF file: the model with the name, the only model, or the only one with hydrodynamics."""
    element, world = chosen_model(root, name, link)
    for tag in ("link", "joint", "plugin", "collision", "frame", "model"):
        refuse_crowd(list(element.iter(tag)))
    scope = Scope(element)
    read = RobotModel(element.get("name", ""), {}, [], [], Water())
    if world is not None:
        read.water = read_water(faults, read.warnings, world)
    poses = Poses(faults, scope)
    for inner in scope.each():
        for key, child in inner.named.items():
            if child.tag == "link":
                read.links[inner.prefix + key] = read_link(faults, read.warnings, poses, inner, key)
        read.joints += joints_of(scope, inner)
        included = [text_of(child.find("uri")) for child in inner.model.findall("include")]
        if included:
            read.warnings.append(f"what the model includes lies in other files and is left out: {listed(included)}")
    for inner in scope.each():
        add_plugins(faults, read, inner.model.findall("plugin"), inner.prefix)
    return read


def world_of(root: Element) -> Element:
    """Return the first <world> of a file."""
    world = next(root.iter("world"), None)
    if world is None:
        raise SceneError(["world: the file has no <world>. Give an SDF file with one"])
    return world


def chosen_model(root: Element, name: str | None, link: str | None) -> tuple[Element, Element | None]:
    """Choose a top-level <model> of an SDF file by the rule of `model_of_sdf`; also return the <world> around it or None."""
    known: list[tuple[Element, Element | None]] = []
    known += [(child, world) for world in root.iter("world") for child in world.findall("model")]
    known += [(child, None) for child in ([root] if root.tag == "model" else root.findall("model"))]
    if not known and root.find("link") is not None:
        return root, None
    fitting = [pair for pair in known if not is_true(pair[0].findtext("static"))]
    if not known or (not fitting and name is None):
        included = [names_of(child)[0] for child in root.iter("include") if names_of(child)]
        problem = "the file has none of its own" + (" that can move" if known else "")
        problem += f", it includes {listed(included)}" if included else ""
        remedy = f"pass include={{{included[0]!r}: 'model.sdf'}}" if included else "give an SDF model with a <link>"
        raise SceneError([sentences("SDF link", problem, remedy)])
    if name is not None:
        fitting = [pair for pair in known if pair[0].get("name") == name]
        if not fitting:
            raise SceneError([f"SDF model = {name!r} is not in the file. {capital(closest(name, _names(known)))}"])
    for narrowed in (
        [pair for pair in fitting if link is not None and any(x.get("name") == link for x in pair[0].iter("link"))],
        [pair for pair in fitting if any(is_read(plugin) for plugin in plugins_of(pair[0]))],
    ):
        fitting = narrowed if len(fitting) > 1 and narrowed else fitting
    if len(fitting) > 1:
        raise SceneError([f"SDF model: the file holds several: {listed(_names(fitting))}. Name one, model=..."])
    return fitting[0]


def _names(pairs: Sequence[tuple[Element, Element | None]]) -> list[str]:
    return [pair[0].get("name", "") for pair in pairs]


def read_water(faults: Faults, warnings: list[str], world: Element) -> Water:
    """Read gravity and density of a world."""
    vector = read_floats(faults, "<world> ", world, "gravity", f"0 0 {-GAZEBO_GRAVITY}")
    if np.any(vector[:2]) or vector[2] > 0.0:
        faults.add("<gravity>", vector, "does not point down", "turn the world so that it is along -z")
    plugin = next((p for p in world.findall("plugin") if is_buoyancy(p)), None)
    if plugin is None:
        missing = "the world has no Buoyancy plugin, without which all sinks in Gazebo"
        warnings.append(f"{missing}: water of {GAZEBO_DENSITY:g} kg/m3")
        return Water(abs(vector[2]))
    graded = plugin.find("graded_buoyancy")
    if text_of(plugin.find("uniform_fluid_density")) or graded is None:
        density = number(faults, "", plugin, "uniform_fluid_density", f"{GAZEBO_DENSITY}")
    else:
        density = number(faults, "", graded, "default_density", f"{GAZEBO_DENSITY}")
        for layer in graded.findall("density_change"):
            above = number(faults, "", layer, "above_depth", "0")
            if above < 0.0:
                change = f"the water's density changes at {-above:g} m of depth"
                warnings.append(f"{change}: taken as {density:g} kg/m3 everywhere")
    return Water(abs(vector[2]), density, tuple(text_of(child) for child in plugin.findall("enable")))


def is_buoyancy(plugin: Element) -> bool:
    """Return whether a plugin is Gazebo's Buoyancy (BuoyancyEngine is another plugin)."""
    return "buoyancy" in plugin_name(plugin) and "engine" not in plugin_name(plugin)


def read_link(faults: Faults, warnings: list[str], poses: Poses, scope: Scope, name: str) -> Link:
    """Read one link of an SDF file: mass, inertia, added mass, displaced volume and pose."""
    element = scope.named[name]
    link, where = Link(scope.prefix + name, poses.of(scope, name)), f"{scope.prefix}{name} "
    inertial = element.find("inertial")
    if inertial is None:
        link.weighed = False
    elif is_true(inertial.get("auto")):
        faults.add(f"{where}<inertial auto>", "true", "is left to Gazebo to compute", "write mass and inertia")
    elif inertial.find("mass") is None or not text_of(inertial.find("mass")):
        faults.add(f"{where}<mass>", "", "is missing", "give the mass of the link [kg]")
    link.mass = number(faults, where, inertial, "mass", "1")
    if link.mass < 0.0:
        faults.add(f"{where}<mass>", link.mass, "is negative", "give the mass of the link [kg]")
    pose = child_of(inertial, "pose")
    if pose is not None and pose.get("relative_to"):
        faults.add(f"{where}<pose>", pose.get("relative_to"), "is relative to another frame", "give it in the link's")
    center = read_pose(faults, where, pose)
    link.center = center.position
    inertia = read_inertia(faults, where, child_of(inertial, "inertia"))
    link.inertia = center.rotation @ inertia @ center.rotation.T
    link.added_mass = read_fluid_added_mass(faults, where, child_of(inertial, "fluid_added_mass"))
    if text_of(element.find("gravity")) and not is_true(element.findtext("gravity")):
        warnings.append(f"link {link.name}: <gravity> false is not followed; its weight acts")
    shapes = []
    for collision in element.findall("collision"):
        place = poses.placed(scope, collision, name)
        key = collision.get("name", "")
        at = poses.of(scope, name).inverse().then(place).position
        shapes.append((key, volume_of(faults, f"{where}{key} ", collision), at))
    add_volumes(link, shapes)
    return link


def joints_of(root: Scope, scope: Scope) -> list[Joint]:
    """Read the joints of a scope; a detachable joint counts as fixed, its state at the start."""
    joints = []
    for element in scope.named.values():
        if element.tag == "joint":
            ends = (text_of(element.find(tag)) for tag in ("parent", "child"))
            joints.append(Joint(element.get("type", ""), *(scope.link_of(end) or end for end in ends)))
    for plugin in scope.model.findall("plugin"):
        if "detachable" in plugin_name(plugin):
            parent, child = (scope.link_of(text_of(plugin.find(tag))) for tag in ("parent_link", "child_link"))
            if parent and child and text_of(plugin.find("child_model")) in ("__self__", root.model.get("name")):
                joints.append(Joint("fixed", parent, child))
    return joints


def read_fluid_added_mass(faults: Faults, where: str, element: Element | None) -> np.ndarray:
    """Read <fluid_added_mass>, xx, xy ... rr, as (6, 6) in the link's axes about its origin; missing entries are 0."""
    matrix = np.zeros((6, 6))
    for row, column in combinations_with_replacement(range(6), 2):
        value = number(faults, f"{where}<fluid_added_mass> ", element, "xyzpqr"[row] + "xyzpqr"[column], "0")
        matrix[row, column] = matrix[column, row] = value
    if np.any(np.diag(matrix) < 0.0):
        problem = "is negative on its diagonal"
        faults.add(f"{where}<fluid_added_mass>", np.diag(matrix), problem, "SDF's added mass is positive")
    return matrix


def add_plugins(faults: Faults, read: RobotModel, plugins: Sequence[Element], prefix: str) -> None:
    """Add the coefficients that plugins give to the model."""
    for plugin in plugins:
        if is_underwater_object(plugin):
            read.hydrodynamics += read_underwater_object(faults, read.warnings, plugin)
        elif is_hydrodynamics(plugin):
            name = text_of(plugin.find("link_name"))
            if not name and len(read.links) == 1:
                name = next(iter(read.links))
            if not name:
                faults.add("<link_name>", "", "is missing in the Hydrodynamics plugin", "name the link it acts on")
                continue
            read.hydrodynamics.append(read_hydrodynamics(faults, read.warnings, plugin, prefix + name))
    known = []
    for each in read.hydrodynamics:
        with faults.including():
            each.link = link_named(read.links, each.link)
            known.append(each)
    read.hydrodynamics = known
    read.warnings += unread(plugins)
