# SPDX-License-Identifier: Apache-2.0
"""Links of a robot description, and their lumping into one rigid body."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, closest
from lgvi_warp.common.sentences import sentences
from lgvi_warp.extensions.importers.poses import HERE, Pose
from lgvi_warp.extensions.importers.robot_xml import number, numbers_in, read_floats, text_of
from lgvi_warp.physics.notation import hat
from lgvi_warp.vehicles.fossen import PAIRS, inertia_from_names


def _zeros() -> np.ndarray:
    return np.zeros((6, 6))


@dataclass
class Link:
    """One link of a robot description, in its own axes (x ahead, y to port, z up) from its own origin.

    mass: [kg]. center: Centre of mass (3,) [m]. inertia: (3, 3) [kg m2] about `center`. added_mass: (6, 6) about the origin.
    volume: Displaced volume [m3], with its centre `volume_center` (3,) [m]. All numbers are 0 by default.
    shapeless: Names of collision shapes whose volume the file does not give.
    """

    name: str
    pose: Pose = HERE
    mass: float = 0.0
    center: np.ndarray = field(default_factory=lambda: np.zeros(3))
    inertia: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    volume: float = 0.0
    volume_center: np.ndarray = field(default_factory=lambda: np.zeros(3))
    added_mass: np.ndarray = field(default_factory=_zeros)
    weighed: bool = True
    shapeless: tuple[str, ...] = ()


@dataclass(frozen=True)
class Joint:
    """A joint between two links."""

    type: str
    parent: str
    child: str


@dataclass
class Lump:
    """Several links as one rigid body, in the axes of its main link and about its origin; units as in `Link`."""

    mass: float
    center: np.ndarray
    inertia: np.ndarray
    volume: float
    volume_center: np.ndarray
    added_mass: np.ndarray


# The largest robots in public repositories have some hundred links.
MOST_LINKS = 2_000

# Shapes -------------------------------------------------------------------------------------------------------------

# For each shape its sizes in SDF, with SDF's defaults, and its volume [m3] as a function of them.
SHAPES: dict[str, tuple[dict[str, str], Callable[..., float]]] = {
    "box": ({"size": "1 1 1"}, lambda size: float(np.prod(size))),
    "sphere": ({"radius": "1"}, lambda r: 4.0 / 3.0 * np.pi * r[0] ** 3),
    "cylinder": ({"radius": "1", "length": "1"}, lambda r, length: np.pi * r[0] ** 2 * length[0]),
    "capsule": ({"radius": "0.5", "length": "1"}, lambda r, length: np.pi * r[0] ** 2 * (length[0] + 4.0 / 3.0 * r[0])),
    "ellipsoid": ({"radii": "1 1 1"}, lambda radii: 4.0 / 3.0 * np.pi * float(np.prod(radii))),
    "cone": ({"radius": "0.5", "length": "1"}, lambda r, length: np.pi / 3.0 * r[0] ** 2 * length[0]),
}
FLAT = ("plane", "empty")


def volume_of(faults: Faults, where: str, collision: Element) -> float | None:
    """Volume [m3] of a collision shape: 0 for a plane; None if the file does not give the volume, as for a mesh."""
    geometry = collision.find("geometry")
    if geometry is None:
        if text_of(collision):
            numbers_in(faults, f"{where}<collision>", text_of(collision), 1)
        else:
            faults.add(f"{where}<collision>", "", "has no <geometry>", f"give one of {', '.join(SHAPES)}")
        return 0.0
    for shape in geometry:
        if shape.tag in FLAT:
            return 0.0
        if shape.tag in SHAPES:
            sizes, volume = SHAPES[shape.tag]
            values = [size_of(faults, f"{where}<{shape.tag}> ", shape, key, sizes[key]) for key in sizes]
            if any(np.any(value < 0.0) for value in values):
                faults.add(f"{where}<{shape.tag}>", values, "has a negative size", "give sizes above 0 [m]")
            return float(volume(*values))
    return None


def size_of(faults: Faults, where: str, shape: Element, key: str, default: str) -> np.ndarray:
    """Sizes [m] of a shape, as many as the default has; they are an element in SDF and an attribute in URDF."""
    attribute = shape.get(key)
    if attribute is not None:
        return numbers_in(faults, f"{where}{key}", attribute, len(default.split()))
    return read_floats(faults, where, shape, key, default)


def add_volumes(link: Link, shapes: Iterable[tuple[str, float | None, np.ndarray]]) -> None:
    """Set volume and centre of a link from its collision shapes, as Gazebo's Buoyancy system does.

    shapes: Name, volume [m3] and centre (3,) [m] of each shape; the volume is None if the file does not give it.
    """
    known = []
    for name, volume, center in shapes:
        if volume is None:
            link.shapeless += (name,)
        else:
            known.append((volume, center))
    link.volume = sum(volume for volume, _ in known)
    if link.volume > 0.0:
        link.volume_center = np.asarray(sum(volume * center for volume, center in known) / link.volume)


def read_inertia(faults: Faults, where: str, element: Element | None, default: str = "1") -> np.ndarray:
    """Inertia matrix (3, 3) [kg m2] from the six entries of <inertia>, which are elements in SDF and attributes in URDF."""
    named = {}
    for pair in PAIRS:
        key, fallback = f"i{pair}", default if pair[0] == pair[1] else "0"
        attribute = None if element is None else element.get(key)
        if attribute is not None:
            named[key] = float(numbers_in(faults, f"{where}<inertia {key}>", attribute, 1)[0])
        else:
            named[key] = number(faults, f"{where}<inertia> ", element, key, fallback)
    return inertia_from_names(named)


# Lumping ------------------------------------------------------------------------------------------------------------


def beside(joints: Iterable[Joint], types: tuple[str, ...] | None = None) -> dict[str, list[str]]:
    """Return the neighbours of each link across joints of the given types, or of any type for None."""
    neighbours: dict[str, list[str]] = {}
    for joint in joints:
        if types is None or joint.type in types:
            neighbours.setdefault(joint.parent, []).append(joint.child)
            neighbours.setdefault(joint.child, []).append(joint.parent)
    return neighbours


def joined(first: str, neighbours: Mapping[str, Sequence[str]]) -> list[str]:
    """Return all links that a link is joined to, directly or through others."""
    reached, waiting = {first: None}, [first]
    while waiting:
        for name in neighbours.get(waiting.pop(), ()):
            if name not in reached:
                reached[name] = None
                waiting.append(name)
    return list(reached)


def main_link(links: Mapping[str, Link], joints: Sequence[Joint]) -> str:
    """Return the main link: the heaviest link that is no joint's child, within the heaviest set of joined links."""
    sets, remaining, neighbours = [], dict.fromkeys(links), beside(joints)
    while remaining:
        sets.append([name for name in joined(next(iter(remaining)), neighbours) if name in links])
        for name in sets[-1]:
            remaining.pop(name, None)
    heaviest = max(sets, key=lambda names: sum(links[name].mass for name in names))
    children = {joint.child for joint in joints}
    roots = [name for name in heaviest if name not in children]
    return max(roots or heaviest, key=lambda name: links[name].mass)


def carried(pose: Pose) -> np.ndarray:
    """X (6, 6): if the body has the velocity v, the link has the velocity X v in its own axes."""
    R, p = pose.rotation, pose.position
    return np.block([[R.T, -R.T @ hat(p)], [np.zeros((3, 3)), R.T]])


def lumped(links: Iterable[Link], main: Link) -> Lump:
    """Lump rigidly joined links into one body; inertia by the parallel axis theorem."""
    placed = [(link, main.pose.inverse().then(link.pose)) for link in links]
    mass = sum(link.mass for link, _ in placed)
    volume = sum(link.volume for link, _ in placed)
    centers = [pose.position + pose.rotation @ link.center for link, pose in placed]
    volume_centers = [pose.position + pose.rotation @ link.volume_center for link, pose in placed]
    center = _mean([link.mass for link, _ in placed], centers)
    inertia, added = np.zeros((3, 3)), np.zeros((6, 6))
    for (link, pose), at in zip(placed, centers, strict=True):
        arm = hat(at - center)
        inertia = inertia + pose.rotation @ link.inertia @ pose.rotation.T - link.mass * arm @ arm
        added = added + carried(pose).T @ link.added_mass @ carried(pose)
    return Lump(mass, center, inertia, volume, _mean([link.volume for link, _ in placed], volume_centers), added)


def _mean(weights: Sequence[float], points: Sequence[np.ndarray]) -> np.ndarray:
    """Return the weighted mean of points; 0 if all weights are 0. A single point is returned exactly."""
    total = sum(weights)
    for weight, point in zip(weights, points, strict=True):
        if weight == total:
            return point
    return sum((w * p for w, p in zip(weights, points, strict=True)), np.zeros(3)) / total if total else np.zeros(3)


def link_named(links: Mapping[str, Link], name: str) -> str:
    """Return the full name of a link."""
    if name in links:
        return name
    fitting = [key for key in links if key.endswith((f"::{name}", f"/{name}")) or name.endswith(f"/{key}")]
    if len(fitting) == 1:
        return fitting[0]
    problem = "is not in the file" if not fitting else f"stands for several: {', '.join(fitting)}"
    raise SceneError([sentences(f"SDF link = {name!r}", problem, closest(name, links))])
