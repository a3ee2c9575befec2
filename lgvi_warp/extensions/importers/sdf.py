# SPDX-License-Identifier: Apache-2.0
"""Vehicles from the robot descriptions that Gazebo reads: SDF, and URDF with a plugin of uuv_simulator or Gazebo."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.extensions.importers.includes import put_in_place
from lgvi_warp.extensions.importers.links import Link, Lump, beside, joined, link_named, lumped, main_link
from lgvi_warp.extensions.importers.plugins import Hydrodynamics, add_to, shared
from lgvi_warp.extensions.importers.robot_model import (
    GAZEBO_DENSITY,
    RobotModel,
    listed,
    read_model,
    read_water,
    world_of,
)
from lgvi_warp.extensions.importers.robot_xml import parse_xml
from lgvi_warp.vehicles.fossen import HALF_TURN, HALF_TURN_6, STANDARD_GRAVITY, Coefficients, rigid_body, turned


def from_sdf(
    source: str | os.PathLike[str],
    *,
    model: str | None = None,
    link: str | None = None,
    world: str | os.PathLike[str] | None = None,
    buoyancy: float | None = None,
    volume: float | None = None,
    water_density: float | None = None,
    center_of_buoyancy: Sequence[float] | None = None,
    gravity: float | None = None,
    include: Mapping[str, str | os.PathLike[str]] | None = None,
) -> dict[str, Any]:
    """Build a vehicle, its drag and its water from an SDF file (Gazebo) or a URDF.

    The following parts of the file are read, with the meaning that Gazebo gives them:

    * mass, pose, inertia and fluid_added_mass of every link;
    * volume and centre of the collision shapes (box, sphere, cylinder, capsule, ellipsoid, cone);
    * the coefficients xDotU ..., xU ..., xUabsU ... (older: xUU ...) of the Hydrodynamics plugin, in Fossen's signs or
      all positive, and the plugin of uuv_simulator;
    * gravity and the Buoyancy plugin of a <world>.

    All links connected by joints become one rigid body about the origin of the main link. Links that can move are fixed at
    their position in the file, and warnings name them. Gazebo's axes (x ahead, y to port, z up) are converted to those of
    the scene file (x ahead, y to starboard, z down).

    Args:
        source: Path of the file, or its text.
        model: Name of the model, if the file holds several.
        link: Name of the main link; by default the plugin's link, else the heaviest root of the heaviest joined links.
        world: Another SDF file (path or text) with a <world> that gives gravity and density for the model.
        buoyancy: Buoyancy [N], instead of the buoyancy of the shapes.
        volume: Displaced volume [m3], instead of the volume of the shapes.
        water_density: Density of the water [kg/m3]; by default that of the world or of a plugin, or 1000 without these.
        center_of_buoyancy: Position (3,) [m] in the main link's axes (z up), instead of the centre of the shapes.
        gravity: Acceleration of free fall [m/s2]; by default that of the world, or 9.80665 if there is no world.
        include: {name: SDF file}, each file as path or text, to replace <include> elements. The name is the element's <name>,
            its <uri> or the last part of its <uri>. By default none; a file named inside `source` is never opened.

    Returns:
        The tables "vehicle", "environment" and "terms" of a scene file. Without any volume, the vehicle is neutral.

    Raises:
        SceneError: If the file is invalid: a mass is not a number, a mesh has no `volume`, the file is a template, etc. The
            message lists every fault.
    """
    faults = Faults()
    root = parse_xml(source, "SDF")
    if include is not None:
        put_in_place(root, include)
    read = read_model(faults, root, model, link)
    if world is not None:
        read.water = read_water(faults, read.warnings, world_of(parse_xml(world, "world")))
    refuse_empty(faults, read)
    set_water(faults, read, water_density, gravity)
    main = read.links[chosen_link(read, link)]
    parts = [read.links[name] for name in together(read, main)]
    refuse_unweighed(read, main, parts)
    names = {body_link.name for body_link in parts}
    hydrodynamics = [each for each in read.hydrodynamics if each.link in names]
    displaced, center = displaced_by(read, parts, main, hydrodynamics)
    if volume is not None:
        displaced = faults.positive("volume", volume, "m3") or 0.0
    elif buoyancy is None:
        refuse_shapeless(faults, read, parts, hydrodynamics)
    buoyancy = weight_of(read, displaced) if buoyancy is None else buoyancy
    at = turned(center if center_of_buoyancy is None else center_of_buoyancy, HALF_TURN)
    body = body_of(faults, lumped(parts, main), buoyancy, at, read.water.gravity)
    add_hydrodynamics(faults, body, read, main, hydrodynamics)
    body.water_density, body.warnings = read.water.density, read.warnings
    return body.to_dict(faults)


def add_hydrodynamics(
    faults: Faults, body: Coefficients, read: RobotModel, main: Link, plugins: Sequence[Hydrodynamics]
) -> None:
    """Add the coefficients that plugins give to the body."""
    for hydrodynamics in plugins:
        body_link = read.links[hydrodynamics.link]
        if np.any(hydrodynamics.added_mass) and np.any(body_link.added_mass):
            problem, remedy = "and the plugin's xDotU ... both give added mass", "keep one, or set disable_added_mass"
            faults.add(f"{body_link.name} <fluid_added_mass>", "...", problem, remedy)
        add_to(faults, body, hydrodynamics, main.pose.inverse().then(body_link.pose))
    current = shared(faults, "default_current", [each.current for each in plugins], "keep one of them in the file")
    if current is not None:
        body.current = current


def refuse_empty(faults: Faults, read: RobotModel) -> None:
    """Refuse a model that has no link."""
    if not read.links:
        faults.raise_if_any()
        known = "; ".join(["the model has none", *read.warnings])
        raise SceneError([f"SDF link: {known}. Give an SDF model with a <link>"])


def refuse_unweighed(read: RobotModel, main: Link, parts: Sequence[Link]) -> None:
    """Refuse a main link without inertia; add a warning for other links without inertia, to which Gazebo gives 1 kg."""
    if not main.weighed:
        raise SceneError([f"SDF link {main.name!r} has no <inertial>. Add mass, pose and inertia"])
    unweighed = [body_link.name for body_link in parts if not body_link.weighed]
    if unweighed:
        read.warnings.append(f"links without <inertial>, to which Gazebo gives 1 kg and 1 kg m2: {listed(unweighed)}")


def weight_of(read: RobotModel, volume: float | None) -> float | None:
    """Return the weight [N] of the displaced water; warn if no shape displaces any.

    The weight is None if it is unknown, or if no shape displaces water although buoyancy is not limited to some models.
    """
    water = read.water
    if not volume and not water.enabled:
        read.warnings.append("no collision shape displaces water: buoyancy is taken as the weight")
        return None
    return None if water.density is None or water.gravity is None else (volume or 0.0) * water.density * water.gravity


def body_of(faults: Faults, lump: Lump, buoyancy: float | None, at: Any, gravity: float | None) -> Coefficients:
    """Build the rigid body of lumped links, in axes x ahead, y to starboard, z down.

    buoyancy: [N]; None for a buoyancy equal to the weight. at: Centre of buoyancy (3,) [m], z down. gravity: [m/s2]; None if
    gravity is invalid.
    """
    inertia = HALF_TURN[:, None] * lump.inertia * HALF_TURN
    gravity = 0.0 if gravity is None else gravity  # a fault by then
    body = rigid_body(faults, lump.mass, inertia, HALF_TURN * lump.center, at, None, buoyancy, gravity)
    body.added_mass = HALF_TURN_6[:, None] * lump.added_mass * HALF_TURN_6
    return body


def chosen_link(read: RobotModel, link: str | None) -> str:
    """The full name of the main link: the given link, the plugin's link, or the first of the heaviest joined links."""
    if link is not None:
        return link_named(read.links, link)
    if read.hydrodynamics:
        return read.hydrodynamics[0].link
    return main_link(read.links, read.joints)


def together(read: RobotModel, main: Link) -> list[str]:
    """Return the links that form one body with the main link; warn of moving links and of links left out."""
    every = [name for name in joined(main.name, beside(read.joints)) if name in read.links]
    fixed = set(joined(main.name, beside(read.joints, ("fixed",))))
    moving = [name for name in every if name not in fixed]
    reached = set(every)
    apart = [name for name in read.links if name not in reached]
    if moving:
        read.warnings.append(f"links that can move are held where the file has them: {listed(moving)}")
    if apart:
        read.warnings.append(f"links that no joint joins to {main.name} are left out: {listed(apart)}")
    return every


def set_water(faults: Faults, read: RobotModel, density: float | None, gravity: float | None) -> None:
    """Set density [kg/m3] and gravity [m/s2] of the model: given, else the world's, else a plugin's, else the default."""
    density = read.water.density if density is None else density
    if density is None:
        density = shared(faults, "water_density", [each.density for each in read.hydrodynamics], "pass water_density=")
    density = GAZEBO_DENSITY if density is None else density
    gravity = next(x for x in (gravity, read.water.gravity, STANDARD_GRAVITY) if x is not None)
    read.water.density = faults.positive("water_density", density, "kg/m3")
    read.water.gravity = faults.number("gravity", gravity, "m/s2", least=0.0)


def displaced_by(
    read: RobotModel, parts: Sequence[Link], main: Link, plugins: Sequence[Hydrodynamics]
) -> tuple[float, np.ndarray]:
    """Displaced volume [m3] and its centre (3,) [m] in the main link's axes (z up), from shapes or from uuv_simulator."""
    by_plugin = [hydrodynamics for hydrodynamics in plugins if hydrodynamics.volume is not None]
    for hydrodynamics in by_plugin:
        body_link = read.links[hydrodynamics.link]
        neutral_volume = body_link.mass / (hydrodynamics.density or 1.0)
        body_link.volume = neutral_volume if hydrodynamics.neutral else float(hydrodynamics.volume or 0.0)
        body_link.volume_center = hydrodynamics.volume_center
    floating = [read.links[hydrodynamics.link] for hydrodynamics in by_plugin]
    floating = floating or [body_link for body_link in parts if has_buoyancy(read, body_link.name)]
    if not by_plugin and len(floating) < len(parts):
        read.warnings.append(f"the Buoyancy plugin is enabled for {listed(read.water.enabled)} alone")
    lump = lumped(floating, main)
    return lump.volume, lump.volume_center


def has_buoyancy(read: RobotModel, name: str) -> bool:
    """Return whether Gazebo's Buoyancy system acts on a link."""
    scoped = f"{read.name}::{name}::"
    return not read.water.enabled or any(scoped.startswith(f"{enabled}::") for enabled in read.water.enabled)


def refuse_shapeless(faults: Faults, read: RobotModel, parts: Sequence[Link], plugins: Sequence[Hydrodynamics]) -> None:
    """Add a fault for shapes whose volume neither this file nor a plugin gives: without them the vehicle would sink."""
    if any(hydrodynamics.volume is not None for hydrodynamics in plugins):
        return
    for body_link in parts:
        if body_link.shapeless and has_buoyancy(read, body_link.name):
            remedy = "give volume= [m3] or buoyancy= [N], and center_of_buoyancy=, of the whole vehicle"
            shapes, problem = listed(body_link.shapeless), "is not a shape whose volume is known"
            faults.add(f"{body_link.name} <collision>", shapes, problem, remedy)
