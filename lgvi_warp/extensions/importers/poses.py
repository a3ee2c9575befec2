# SPDX-License-Identifier: Apache-2.0
"""Poses of links, frames and shapes of a robot description in its model, by the rules of SDF and URDF."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.extensions.importers.robot_xml import child_of, is_true, numbers_in, text_of
from lgvi_warp.physics.notation import hat

# Most frames of which each is given relative to the next.
LONGEST_CHAIN = 200


class Pose(NamedTuple):
    """Pose of a frame in another one: position (3,) [m] of its origin, and rotation matrix (3, 3)."""

    position: np.ndarray
    rotation: np.ndarray

    def then(self, inner: Pose) -> Pose:
        """Convert a pose in this frame to a pose in the outer frame."""
        return Pose(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    def inverse(self) -> Pose:
        """Return the pose of the outer frame in this frame."""
        return Pose(-self.rotation.T @ self.position, self.rotation.T)


HERE = Pose(np.zeros(3), np.eye(3))


def rotation_from_rpy(angles: np.ndarray) -> np.ndarray:
    """Rotation matrix Rz(yaw) Ry(pitch) Rx(roll), (3, 3), from roll, pitch, yaw (3,) [rad]."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles), np.cos(angles)
    first = [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr]
    second = [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr]
    return np.array([first, second, [-sp, cp * sr, cp * cr]])


def rotation_from_xyzw(quaternion: np.ndarray) -> np.ndarray:
    """The rotation matrix of a quaternion (4,), scalar last, of any length but 0."""
    *v, w = quaternion / (np.linalg.norm(quaternion) or 1.0)
    S = hat(np.array(v))
    return np.asarray(np.eye(3) + 2.0 * w * S + 2.0 * S @ S)


def read_pose(faults: Faults, where: str, pose: Element | None) -> Pose:
    """Read an element <pose> of SDF: x y z roll pitch yaw, or x y z and a quaternion."""
    if pose is None or not text_of(pose):
        return HERE
    if pose.get("rotation_format") == "quat_xyzw":
        values = numbers_in(faults, f"{where}<pose>", text_of(pose), 7)
        return Pose(values[:3], rotation_from_xyzw(values[3:]))
    values = numbers_in(faults, f"{where}<pose>", text_of(pose), 6)
    angles = np.radians(values[3:]) if is_true(pose.get("degrees")) else values[3:]
    return Pose(values[:3], rotation_from_rpy(angles))


def read_origin(faults: Faults, where: str, parent: Element | None) -> Pose:
    """Read the pose in an element <origin> of URDF, from its xyz and rpy."""
    origin = child_of(parent, "origin")
    if origin is None:
        return HERE
    values = [numbers_in(faults, f"{where}<origin {key}>", origin.get(key, "0 0 0"), 3) for key in ("xyz", "rpy")]
    return Pose(values[0], rotation_from_rpy(values[1]))


@dataclass
class Scope:
    """The names of one <model> of an SDF file: its links, joints, frames and nested models."""

    model: Element
    prefix: str = ""
    parent: Scope | None = None
    named: dict[str, Element] = field(default_factory=dict)
    nested: dict[str, Scope] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for child in self.model:
            name = child.get("name", "")
            if child.tag in ("link", "joint", "frame", "model") and name not in self.named:
                self.named[name] = child
                if child.tag == "model":
                    self.nested[name] = Scope(child, f"{self.prefix}{name}::", self)

    def each(self) -> Iterator[Scope]:
        """Iterate over this scope and the scopes nested in it."""
        yield self
        for scope in self.nested.values():
            yield from scope.each()

    def find(self, name: str) -> tuple[Scope, str]:
        """Find the scope that a name belongs to."""
        scope, rest = self, name
        while "::" in rest:
            head, rest = rest.split("::", 1)
            scope = scope.nested[head]
        if rest not in scope.named and rest != "__model__":
            raise KeyError(name)
        return scope, rest

    def link_of(self, name: str) -> str | None:
        """Return the full name of the link that a name refers to; None if there is no such link."""
        scope, rest = self, name
        for _ in range(LONGEST_CHAIN):
            try:
                scope, rest = scope.find(rest)
            except KeyError:
                return None
            element = scope.named.get(rest)
            if element is None or element.tag == "model":
                scope = scope if element is None else scope.nested[rest]
                first = next((key for key, child in scope.named.items() if child.tag in ("link", "model")), "")
                rest = scope.model.get("canonical_link") or first
            elif element.tag == "link":
                return scope.prefix + rest
            else:
                rest = element.get("attached_to") or (text_of(element.find("child")) or "__model__")
        return None


class Poses:
    """Poses of all names of one model, each computed once."""

    def __init__(self, faults: Faults, root: Scope):
        self.faults, self.root = faults, root
        self.known: dict[tuple[int, str], Pose] = {(id(root), "__model__"): HERE}

    def of(self, scope: Scope, name: str, chain: tuple[tuple[int, str], ...] = ()) -> Pose:
        """Return the pose of a name in the root model."""
        key = (id(scope), name)
        if key in self.known:
            return self.known[key]
        if key in chain or len(chain) > LONGEST_CHAIN:
            self.faults.add(f"{scope.prefix}{name} <pose>", name, "is relative to itself", "correct relative_to")
            return HERE
        chain = (*chain, key)
        if name == "__model__":
            assert scope.parent is not None
            pose = self.placed(scope.parent, scope.model, "__model__", chain)
            placement = scope.model.get("placement_frame")
            if placement:
                # The file gives the pose of the placement frame; the pose wanted is that of the model's own frame.
                pose = pose.then(Poses(self.faults, scope).of(*self.lookup(scope, placement), chain).inverse())
        else:
            element = scope.named[name]
            default = {"joint": text_of(element.find("child")), "frame": element.get("attached_to") or ""}
            pose = self.placed(scope, element, default.get(element.tag, "") or "__model__", chain)
        self.known[key] = pose
        return pose

    def placed(self, scope: Scope, element: Element, frame: str, chain: tuple[tuple[int, str], ...] = ()) -> Pose:
        """Return the pose in the root model of an element that holds a <pose>."""
        where = f"{scope.prefix}{element.get('name', element.tag)} "
        pose = element.find("pose")
        relative_to = (pose.get("relative_to") if pose is not None else None) or frame
        return self.of(*self.lookup(scope, relative_to), chain).then(read_pose(self.faults, where, pose))

    def lookup(self, scope: Scope, name: str) -> tuple[Scope, str]:
        """Find the scope and the name that a name used in a scope refers to."""
        try:
            return scope.find(name)
        except KeyError:
            outside = name in ("world", "__root__")
            remedy = "name a frame of it" if outside else closest(name, [*scope.named, "__model__"])
            self.faults.add("relative_to", name, f"is not a frame of the model {scope.model.get('name')!r}", remedy)
            return scope, "__model__"
