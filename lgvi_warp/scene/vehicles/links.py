"""Links of a robot description lumped into one rigid body: mass, inertia, added mass, displaced volume and its centre."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree.ElementTree import Element

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError, closest
from lgvi_warp.scene.vehicles.fossen import PAIRS, cross, inertia_from_names
from lgvi_warp.scene.vehicles.poses import HERE, Pose
from lgvi_warp.scene.vehicles.robot_xml import number, numbers, numbers_in, text_of


def _zeros() -> np.ndarray:
    return np.zeros((6, 6))


@dataclass
class Link:
    """One link: mass [kg], inertia (3, 3) [kg m2] about the centre of mass (3,) [m], volume [m3] and its centre (3,) [m],
    in the link's axes (x ahead, y to port, z up) from its origin; added_mass (6, 6) about that; pose in the model.

    weighed: whether the file gives its mass; shapeless: names of collision shapes whose volume the file does not hold.
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
    """What joins two links: its type, and the full names of the links."""

    type: str
    parent: str
    child: str


@dataclass
class Lump:
    """Links as one body, in the axes of its main link: as a Link has them; inertia about the centre of mass."""

    mass: float
    center: np.ndarray
    inertia: np.ndarray
    volume: float
    volume_center: np.ndarray
    added_mass: np.ndarray


# The largest robots of public repositories have some hundred.
MOST_LINKS = 2_000

# Shapes -------------------------------------------------------------------------------------------------------------

# Shape -> its sizes in SDF, with SDF's defaults, and its volume [m3] from them.
SHAPES: dict[str, tuple[dict[str, str], Callable[..., float]]] = {
    "box": ({"size": "1 1 1"}, lambda size: float(np.prod(size))),
    "sphere": ({"radius": "1"}, lambda r: 4.0 / 3.0 * np.pi * r[0] ** 3),
    "cylinder": ({"radius": "1", "length": "1"}, lambda r, length: np.pi * r[0] ** 2 * length[0]),
    "capsule": (
        {"radius": "0.5", "length": "1"},
        lambda r, length: np.pi * r[0] ** 2 * (length[0] + 4.0 / 3.0 * r[0]),
    ),
    "ellipsoid": ({"radii": "1 1 1"}, lambda radii: 4.0 / 3.0 * np.pi * float(np.prod(radii))),
    "cone": ({"radius": "0.5", "length": "1"}, lambda r, length: np.pi / 3.0 * r[0] ** 2 * length[0]),
}
FLAT = ("plane", "empty")


def volume_of(faults: Faults, where: str, collision: Element) -> float | None:
    """The volume [m3] of a collision's shape; 0 of a plane; None of a mesh and the like, which lie in another file."""
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
    """A size of a shape: an element in SDF, an attribute in URDF."""
    given = shape.get(key)
    if given is not None:
        return numbers_in(faults, f"{where}{key}", given, len(default.split()))
    return numbers(faults, where, shape, key, default)


def add_volumes(link: Link, shapes: Iterable[tuple[str, float | None, np.ndarray]]) -> None:
    """Set volume and centre from (name, volume, centre) of each collision shape, as Gazebo's Buoyancy system does."""
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
    """The inertia (3, 3) [kg m2] of six names, as elements (SDF) or attributes (URDF); SDF's defaults where one is missing."""
    named = {}
    for pair in PAIRS:
        key, fallback = f"i{pair}", default if pair[0] == pair[1] else "0"
        given = None if element is None else element.get(key)
        if given is not None:
            named[key] = float(numbers_in(faults, f"{where}<inertia {key}>", given, 1)[0])
        else:
            named[key] = number(faults, f"{where}<inertia> ", element, key, fallback)
    return inertia_from_names(named)


# Lumping ------------------------------------------------------------------------------------------------------------


def beside(joints: Iterable[Joint], types: tuple[str, ...] | None = None) -> dict[str, list[str]]:
    """Each link's neighbours across joints of these types, or of any."""
    neighbours: dict[str, list[str]] = {}
    for joint in joints:
        if types is None or joint.type in types:
            neighbours.setdefault(joint.parent, []).append(joint.child)
            neighbours.setdefault(joint.child, []).append(joint.parent)
    return neighbours


def joined(first: str, neighbours: Mapping[str, Sequence[str]]) -> list[str]:
    """All that a link is joined to, itself first."""
    reached, waiting = {first: None}, [first]
    while waiting:
        for name in neighbours.get(waiting.pop(), ()):
            if name not in reached:
                reached[name] = None
                waiting.append(name)
    return list(reached)


def main_link(links: Mapping[str, Link], joints: Sequence[Joint]) -> str:
    """Of the heaviest set of joined links, the one that is no other's child, else the heaviest."""
    sets, left, neighbours = [], dict.fromkeys(links), beside(joints)
    while left:
        sets.append([name for name in joined(next(iter(left)), neighbours) if name in links])
        for name in sets[-1]:
            left.pop(name, None)
    heaviest = max(sets, key=lambda names: sum(links[name].mass for name in names))
    children = {joint.child for joint in joints}
    roots = [name for name in heaviest if name not in children]
    return max(roots or heaviest, key=lambda name: links[name].mass)


def carried(pose: Pose) -> np.ndarray:
    """X (6, 6) with which a link of that pose has the velocity X v, in its own axes, where the body has v."""
    R, p = pose.rotation, pose.position
    return np.block([[R.T, -R.T @ cross(p)], [np.zeros((3, 3)), R.T]])


def lumped(links: Iterable[Link], main: Link) -> Lump:
    """Rigidly joined links as one body, in the main link's axes about its origin (parallel axes for inertia)."""
    placed = [(link, main.pose.inverse().then(link.pose)) for link in links]
    mass = sum(link.mass for link, _ in placed)
    volume = sum(link.volume for link, _ in placed)
    centers = [pose.position + pose.rotation @ link.center for link, pose in placed]
    volume_centers = [pose.position + pose.rotation @ link.volume_center for link, pose in placed]
    center = _mean([link.mass for link, _ in placed], centers)
    inertia, added = np.zeros((3, 3)), np.zeros((6, 6))
    for (link, pose), at in zip(placed, centers, strict=True):
        arm = cross(at - center)
        inertia = inertia + pose.rotation @ link.inertia @ pose.rotation.T - link.mass * arm @ arm
        added = added + carried(pose).T @ link.added_mass @ carried(pose)
    return Lump(mass, center, inertia, volume, _mean([link.volume for link, _ in placed], volume_centers), added)


def _mean(weights: Sequence[float], points: Sequence[np.ndarray]) -> np.ndarray:
    """The weighted mean of points; 0 where all weights are. Of one point alone, that point to the last digit."""
    total = sum(weights)
    for weight, point in zip(weights, points, strict=True):
        if weight == total:
            return point
    return sum((w * p for w, p in zip(weights, points, strict=True)), np.zeros(3)) / total if total else np.zeros(3)


def link_named(links: Mapping[str, Link], name: str) -> str:
    """The full name of a link: given in full, or by its last part alone. Raises SceneError if none or several fit."""
    if name in links:
        return name
    fitting = [key for key in links if key.endswith((f"::{name}", f"/{name}")) or name.endswith(f"/{key}")]
    if len(fitting) == 1:
        return fitting[0]
    what = "is not in the file" if not fitting else f"stands for several: {', '.join(fitting)}"
    raise SceneError([f"SDF link = {name!r}: {what}; {closest(name, links)}"])
