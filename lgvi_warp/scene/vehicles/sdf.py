"""Vehicles from the robot descriptions that Gazebo reads: SDF, and URDF with the plugin of uuv_simulator or Gazebo."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.scene.vehicles.fossen import HALF_TURN, HALF_TURN_6, STANDARD_GRAVITY, Coefficients, rigid_body, turned
from lgvi_warp.scene.vehicles.links import Link, Lump, beside, joined, link_named, lumped, main_link
from lgvi_warp.scene.vehicles.plugins import Hydrodynamics, add_to
from lgvi_warp.scene.vehicles.robot_model import GAZEBO_DENSITY, Model, listed, read_model, read_water, world_of
from lgvi_warp.scene.vehicles.robot_xml import parse_xml


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
) -> dict[str, Any]:
    """A vehicle, its drag and its water from an SDF file (Gazebo) or a URDF, given as a path or as text.

    Read as Gazebo does: mass, pose, inertia and fluid_added_mass of every link; volume and centre of the collision shapes
    (box, sphere, cylinder, capsule, ellipsoid, cone); the coefficients xDotU ..., xU ..., xUabsU ... (older: xUU ...) of
    the Hydrodynamics plugin, in Fossen's signs or all positive; the plugin of uuv_simulator; of a <world> gravity and the
    Buoyancy plugin. Links that joints join are one body about the origin of the main link; those that can move are held
    where the file has them and named in the warnings. Gazebo's axes x ahead, y to port, z up become x ahead, y to
    starboard, z down.

    Args:
        source: path of the file, or its text.
        model: its name, where the file holds several.
        world: another SDF file (path or text), whose <world> the model of this one is put into: gravity, density.
        link: name of the main link; by default that of the plugin, else the first of the heaviest joined links.
        buoyancy: [N], in place of that of the shapes.
        volume: displaced volume [m3], in place of that of the shapes.
        water_density: [kg/m3]; by default that of the world or of a plugin, else 1000.
        center_of_buoyancy: (3,) [m] in the main link's axes (z up), in place of that of the shapes.
        gravity: [m/s2]; by default the world's, else 9.80665.

    Returns:
        The tables "vehicle", "environment" and "terms" of a scene file. Without a shape the vehicle is neutral.

    Raises:
        SceneError: naming every fault: a mass that is no number, a mesh without a volume given, a template.
    """
    faults = Faults()
    read = read_model(faults, parse_xml(source, "SDF"), model, link)
    if world is not None:
        read.water = read_water(faults, read.warnings, world_of(parse_xml(world, "world")))
    refuse_empty(faults, read)
    set_water(faults, read, water_density, gravity)
    main = read.links[chosen_link(read, link)]
    parts = [read.links[name] for name in together(read, main)]
    refuse_unweighed(read, main, parts)
    names = {part.name for part in parts}
    own = [each for each in read.hydrodynamics if each.link in names]
    displaced, center = displaced_by(read, parts, main, own)
    if volume is not None:
        displaced = faults.positive("volume", volume, "m3") or 0.0
    elif buoyancy is None:
        refuse_shapeless(faults, read, parts, own)
    buoyancy = weight_of(read, displaced) if buoyancy is None else buoyancy
    at = turned(center if center_of_buoyancy is None else center_of_buoyancy, HALF_TURN)
    body = body_of(faults, lumped(parts, main), buoyancy, at, read.water.gravity)
    add_hydrodynamics(faults, body, read, main, own)
    body.water_density, body.warnings = read.water.density, read.warnings
    return body.to_dict(faults)


def add_hydrodynamics(
    faults: Faults, body: Coefficients, read: Model, main: Link, own: Sequence[Hydrodynamics]
) -> None:
    """What plugins say of the links of the body."""
    for each in own:
        part = read.links[each.link]
        if np.any(each.added_mass) and np.any(part.added_mass):
            what, remedy = "and the plugin's xDotU ... both give added mass", "keep one, or set disable_added_mass"
            faults.add(f"{part.name} <fluid_added_mass>", "...", what, remedy)
        add_to(faults, body, each, main.pose.inverse().then(part.pose))


def refuse_empty(faults: Faults, read: Model) -> None:
    """Raises SceneError for a model without a link."""
    if not read.links:
        faults.raise_if_any()
        known = "; ".join(["the model has none", *read.warnings])
        raise SceneError([f"SDF link: {known}; give an SDF model with a <link>"])


def refuse_unweighed(read: Model, main: Link, parts: Sequence[Link]) -> None:
    """Raises SceneError for a main link without inertia. Others that have none weigh 1 kg in Gazebo, which is noted."""
    if not main.weighed:
        raise SceneError([f"SDF link {main.name!r}: has no <inertial>; add mass, pose and inertia"])
    unweighed = [part.name for part in parts if not part.weighed]
    if unweighed:
        read.warnings.append(f"links without <inertial>, to which Gazebo gives 1 kg and 1 kg m2: {listed(unweighed)}")


def weight_of(read: Model, volume: float | None) -> float | None:
    """The weight [N] of that volume [m3] of water; None where nothing is displaced though nothing forbids it."""
    water = read.water
    if not volume and not water.enabled:
        read.warnings.append("no collision shape displaces water: buoyancy is taken as the weight")
        return None
    return None if water.density is None or water.gravity is None else (volume or 0.0) * water.density * water.gravity


def body_of(faults: Faults, lump: Lump, buoyancy: float | None, at: Any, gravity: float | None) -> Coefficients:
    """The rigid body of the lump, with its added mass, in axes x ahead, y to starboard, z down."""
    inertia = HALF_TURN[:, None] * lump.inertia * HALF_TURN
    gravity = 0.0 if gravity is None else gravity  # a fault by then
    body = rigid_body(faults, lump.mass, inertia, HALF_TURN * lump.center, at, None, buoyancy, gravity)
    body.added_mass = HALF_TURN_6[:, None] * lump.added_mass * HALF_TURN_6
    return body


def chosen_link(read: Model, link: str | None) -> str:
    """The full name of the main link."""
    if link is not None:
        return link_named(read.links, link)
    if read.hydrodynamics:
        return read.hydrodynamics[0].link
    return main_link(read.links, read.joints)


def together(read: Model, main: Link) -> list[str]:
    """The links of the main one's body. What moves or is left out is noted."""
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


def set_water(faults: Faults, read: Model, density: float | None, gravity: float | None) -> None:
    """Settle density [kg/m3] and gravity [m/s2]: given, else the world's, else a plugin's, else the default."""
    named = [each.density for each in read.hydrodynamics if each.density is not None]
    density = next(x for x in (density, read.water.density, *named, GAZEBO_DENSITY) if x is not None)
    gravity = next(x for x in (gravity, read.water.gravity, STANDARD_GRAVITY) if x is not None)
    read.water.density = faults.positive("water_density", density, "kg/m3")
    read.water.gravity = faults.number("gravity", gravity, "m/s2", least=0.0)


def displaced_by(
    read: Model, parts: Sequence[Link], main: Link, own: Sequence[Hydrodynamics]
) -> tuple[float, np.ndarray]:
    """Volume [m3] and its centre (3,) [m] in the main link's axes: of the shapes, or as uuv_simulator's plugin gives it."""
    by_plugin = [each for each in own if each.volume is not None]
    for each in by_plugin:
        part = read.links[each.link]
        part.volume = part.mass / (each.density or 1.0) if each.neutral else float(each.volume or 0.0)
        part.volume_center = each.volume_center
    floating = [read.links[each.link] for each in by_plugin] or [
        part for part in parts if has_buoyancy(read, part.name)
    ]
    if not by_plugin and len(floating) < len(parts):
        read.warnings.append(f"the Buoyancy plugin is enabled for {listed(read.water.enabled)} alone")
    lump = lumped(floating, main)
    return lump.volume, lump.volume_center


def has_buoyancy(read: Model, name: str) -> bool:
    """Whether Gazebo's Buoyancy system acts on a link: on all, or on those named by <enable>, or on their model."""
    scoped = f"{read.name}::{name}"
    return not read.water.enabled or any(
        scoped == enabled or scoped.startswith(f"{enabled}::") for enabled in read.water.enabled
    )


def refuse_shapeless(faults: Faults, read: Model, parts: Sequence[Link], own: Sequence[Hydrodynamics]) -> None:
    """Shapes whose volume lies in another file cannot be left out: the vehicle would sink."""
    if any(each.volume is not None for each in own):
        return
    for part in parts:
        if part.shapeless and has_buoyancy(read, part.name):
            remedy = "give volume= [m3] or buoyancy= [N], and center_of_buoyancy=, of the whole vehicle"
            faults.add(f"{part.name} <collision>", listed(part.shapeless), "is no shape whose volume is known", remedy)
