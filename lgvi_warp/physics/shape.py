# SPDX-License-Identifier: Apache-2.0
"""The vehicle's drawn shape. No force depends on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lgvi_warp.common.declared import from_table, positive, read
from lgvi_warp.common.errors import Faults

REMEDY = 'give length and diameter [m], or mesh = "hull.glb"'


@dataclass(frozen=True)
class Shape:
    """Drawn shape of a vehicle: a hull of revolution along the body's x axis, or a mesh. It has no effect on the motion.

    Args:
        length: Length of the hull [m].
        diameter: Largest diameter of the hull [m].
        mesh: Instead of a hull, path of a binary glTF file (.glb) in body axes (x ahead, y to starboard, z down) [m]. In a
            scene file the path is relative to the file's folder, and must lie within it.

    Raises:
        SceneError: If neither or both of hull and mesh are given, or a number is not positive. The message lists every fault.
    """

    length: float | None = positive(None, unit="m")
    diameter: float | None = positive(None, unit="m")
    mesh: str | None = None

    def __post_init__(self) -> None:
        faults = Faults("vehicle.shape.")
        if self.mesh is None:
            for name, size in read(self, faults).items():
                if getattr(self, name) is None:
                    faults.add(name, size, "is missing", REMEDY)
                object.__setattr__(self, name, size)
        elif not isinstance(self.mesh, str) or not self.mesh.lower().endswith(".glb"):
            faults.add(
                "mesh", self.mesh, "is not a name of a .glb file", "give a binary glTF file, or length and diameter"
            )
        elif self.length is not None or self.diameter is not None:
            faults.add("mesh", self.mesh, "stands beside a length or a diameter", REMEDY)
        faults.raise_if_any()

    def to_dict(self) -> dict[str, Any]:
        """The given fields, as the table [vehicle.shape] of a scene file."""
        return {key: value for key, value in vars(self).items() if value is not None}


def shape_from(value: Any) -> Shape | None:
    """Read the shape of a vehicle: a table as in a scene file, a Shape, or None for none."""
    return None if value is None else from_table(Shape, "vehicle.shape", value, REMEDY)
