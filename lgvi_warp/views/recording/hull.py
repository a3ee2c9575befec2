# SPDX-License-Identifier: Apache-2.0
"""Shape of a vehicle: a hull of revolution, or the user's mesh."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from lgvi_warp.common.errors import refusal
from lgvi_warp.common.reading import UnreadableError, file_bytes
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.physics import vehicle
from lgvi_warp.physics.shape import Shape, shape_from

# Points around the hull, and from the end of its middle to its tip.
AROUND, ALONG = 12, 4
# Length of a hull over its diameter, where a vehicle has no shape.
SLENDER = 4.0
LIGHT, FIN = (245, 245, 245), (255, 200, 60)


class Hull(NamedTuple):
    """Surface of triangles in body axes.

    points: Corners, shape (p, 3) [m].
    triangles: Indices of corners, shape (t, 3).
    normals: Outward unit vectors at the corners, shape (p, 3).
    parts: Part of each corner, shape (p,): 0 the hull, 1 its nose, 2 its fin.
    """

    points: np.ndarray
    triangles: np.ndarray
    normals: np.ndarray
    parts: np.ndarray

    def colors(self, rgb: tuple[int, int, int]) -> np.ndarray:
        """Colour the corners (p, 3), with a light nose and a bright fin that show the attitude."""
        return np.array([rgb, LIGHT, FIN], np.uint8)[self.parts]


def hull_of(length: float, diameter: float) -> Hull:
    """Build a hull [m] along the body's x axis: a cylinder with round ends, a light nose, and a fin on its upper side."""
    radius, end = 0.5 * diameter, min(0.5 * diameter, 0.5 * length)
    bend = np.linspace(0.0, 0.5 * np.pi, ALONG + 1)
    middle = 0.5 * length - end
    # From the nose to the stern: distance along x, distance from the axis, and the normal's share along x.
    forward = np.concatenate([middle + end * np.sin(bend[::-1]), -middle - end * np.sin(bend)])
    across = radius * np.concatenate([np.cos(bend[::-1]), np.cos(bend)])
    ahead = np.concatenate([np.sin(bend[::-1]), -np.sin(bend)])
    angle = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    ring = np.stack([np.zeros(AROUND), np.cos(angle), np.sin(angle)], axis=-1)
    x = np.array([1.0, 0.0, 0.0])
    points = forward[:, None, None] * x + across[:, None, None] * ring
    normals = ahead[:, None, None] * x / end + np.sqrt(1.0 - ahead[:, None, None] ** 2) * ring / radius
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    rows, i = len(forward), np.arange(AROUND)
    first = (np.arange(rows - 1) * AROUND)[:, None]
    here, beside = first + i, first + (i + 1) % AROUND
    sides = np.stack([here, here + AROUND, beside, beside, here + AROUND, beside + AROUND], axis=-1).reshape(-1, 3)
    back = -0.5 * length
    fin = np.array([(back + end, 0.0, -0.8 * radius), (back, 0.0, -0.6 * radius), (back, 0.0, -1.6 * radius)])
    total = rows * AROUND
    faces = np.array([(0, 1, 2), (0, 2, 1)]) + total
    parts = np.repeat((np.arange(rows) < ALONG).astype(int), AROUND)
    return Hull(
        np.concatenate([points.reshape(-1, 3), fin]).astype(np.float32),
        np.concatenate([sides, faces]).astype(np.uint32),
        np.concatenate([normals.reshape(-1, 3), np.tile((0.0, 1.0, 0.0), (3, 1))]).astype(np.float32),
        np.concatenate([parts, np.full(3, 2)]),
    )


def shape_of(scene: Mapping[str, Any], parameters: Mapping[str, np.ndarray]) -> tuple[Shape, str]:
    """Find the shape of a run's vehicle and its source. Without a shape in the scene: a hull of the displaced volume."""
    shape = shape_from(scene["vehicle"].get("shape"))
    if shape is not None:
        return shape, "mesh of the scene" if shape.mesh else f"{shape.length:g} m by {shape.diameter:g} m"
    volume = float((vehicle.displaced_mass(parameters) / parameters["environment.water_density"])[0])
    # A spheroid's volume is pi / 6 times length times diameter squared.
    diameter = (6.0 * volume / (np.pi * SLENDER)) ** (1.0 / 3.0)
    return Shape(SLENDER * diameter, diameter), f"of the displaced {volume:.3g} m3, no [vehicle.shape] is given"


class Mesh(NamedTuple):
    """A user's mesh, and its largest extent [m]."""

    content: bytes
    length: float


JSON_CHUNK = 0x4E4F534A


def mesh_of(path: str) -> Mesh:
    """Read a binary glTF file that contains all its data."""
    key, remedy = "vehicle.shape.mesh", "give a binary glTF 2.0 file with all its parts, or length and diameter [m]"
    try:
        content = file_bytes(path, "mesh")
    except UnreadableError as error:
        raise refusal(key, Path(path).name, f"cannot be read: {error.what}", remedy) from None
    try:
        magic, version, _, size, kind = struct.unpack_from("<4sIIII", content)
        if (magic, version, kind) != (b"glTF", 2, JSON_CHUNK):
            raise ValueError
        tables = parsed(content[20 : 20 + size])
        parts = [*tables.get("buffers", ()), *tables.get("images", ())]
        outside = any("uri" in part and not str(part["uri"]).startswith("data:") for part in parts)
        used = {mesh_part["attributes"]["POSITION"] for mesh in tables["meshes"] for mesh_part in mesh["primitives"]}
        corners = [(tables["accessors"][i]["min"], tables["accessors"][i]["max"]) for i in used]
        low, high = (np.array(side, dtype=float) for side in zip(*corners, strict=True))
        length = float((high.max(axis=0) - low.min(axis=0)).max())
    except (struct.error, ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError):
        raise refusal(key, Path(path).name, "is not a binary glTF 2.0 file", remedy) from None
    if outside:
        raise refusal(key, Path(path).name, "names further files", remedy)
    if not (np.isfinite(length) and length > 0.0):
        raise refusal(key, Path(path).name, "has no size", remedy)
    return Mesh(content, length)
