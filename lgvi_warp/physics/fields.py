# SPDX-License-Identifier: Apache-2.0
"""The fields of a vehicle's motion, with the shape, unit and meaning of each."""

from __future__ import annotations

from dataclasses import dataclass

from numpy import ndindex


@dataclass(frozen=True)
class Field:
    """A field: numbers of one vehicle at one time, with a shape; () for one number."""

    name: str
    shape: tuple[int, ...]
    unit: str
    meaning: str

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of a variable in xarray, Zarr and NetCDF; the unit is in UDUNITS form, such as "m s-1"."""
        return {"units": self.unit.replace("/s", " s-1"), "long_name": self.meaning}

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the entries: "position[2]", "attitude[0, 1]"; the field's name if it has only one entry."""
        if not self.shape:
            return (self.name,)
        return tuple(f"{self.name}[{', '.join(map(str, index))}]" for index in ndindex(*self.shape))


TABLE = {
    field.name: field
    for field in (
        Field("position", (3,), "m", "position in inertial axes, north east down"),
        Field("attitude", (3, 3), "1", "rotation from body to inertial axes"),
        Field("velocity", (3,), "m/s", "velocity in body axes"),
        Field("angular_velocity", (3,), "rad/s", "angular velocity in body axes"),
        # All others follow from these four.
        Field("depth", (), "m", "depth below the surface"),
        Field("altitude", (), "m", "height above the sea floor"),
        Field("velocity_inertial", (3,), "m/s", "velocity in inertial axes"),
        Field("speed", (), "m/s", "length of the velocity"),
        Field("quaternion_wxyz", (4,), "1", "unit quaternion of the attitude, scalar first"),
        Field("euler", (3,), "rad", "roll, pitch and yaw"),
        Field("euler_deg", (3,), "deg", "roll, pitch and yaw"),
        Field("rotation_vector", (3,), "rad", "axis of the attitude times its angle"),
        Field("energy", (), "J", "kinetic and potential energy"),
    )
}
# Unit of a place on the Earth: latitude, longitude, depth.
PLACE_UNIT = "deg, deg, m"
# Names of the samples of the motion that a run computes.
FIELDS = tuple(TABLE)[:4]
# Names of the last dimensions of an array, by their sizes; others are named after the array.
_TAILS = {(): (), (3,): ("component",), (3, 3): ("row", "column")}


def dims_of(name: str, tail: tuple[int, ...]) -> tuple[str, ...]:
    """Names of the dimensions of one vehicle's numbers at one time, in stores and datasets."""
    return _TAILS.get(tail, tuple(f"{name}_{i}" for i in range(len(tail))))
