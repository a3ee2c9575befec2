# SPDX-License-Identifier: Apache-2.0
"""Buoyancy that each part of a hull loses above the surface."""

import math
from collections.abc import Iterator

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View
from lgvi_warp.reference.terms.waves import Waves

AXIS = np.array([1.0, 0.0, 0.0])


class SurfaceBuoyancy(Law):
    """Numbers of `lw.terms.SurfaceBuoyancy`; buoyancy [N], center_of_buoyancy (3,) [m]; `waves`: twins of waves, if any."""

    section = "circle"
    waves: tuple[Waves, ...] = ()

    @property
    def potential_force(self) -> bool:  # type: ignore[override]
        """Whether the surface is still, so that the force has a potential."""
        return not self.waves

    def beside(self, laws: tuple[Law, ...]) -> Law:
        """The same law below those of the given laws that are waves."""
        return type(self)(**vars(self) | {"waves": tuple(law.beside(laws) for law in laws if isinstance(law, Waves))})

    def parts(self) -> Iterator[tuple[float, float, float, float]]:
        """Parts of the hull: position from the centre of buoyancy [m], buoyancy [N], height, length [m] (0 for one part)."""
        if len(self.stations) == 1:
            yield 0.0, float(self.buoyancy), float(self.heights[0]), 0.0
            return
        points = []
        for i in range(len(self.stations) - 1):
            length = self.stations[i + 1] - self.stations[i]
            for at in (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0)):
                x, height = ((1.0 - at) * table[i] + at * table[i + 1] for table in (self.stations, self.heights))
                points.append(
                    (x, 0.5 * length * height ** (2 if self.section == "circle" else 1), height, 0.5 * length)
                )
        volume = sum(point[1] for point in points)
        middle = sum(point[0] * point[1] for point in points) / volume
        for x, share, height, length in points:
            yield x - middle, self.buoyancy * share / volume, height, length

    def extent(self, along: float, height: float, length: float) -> tuple[float, float]:
        """Vertical extent of a part divided by its height, and the derivative by `along`, the sine of the axis's pitch."""
        if length == 0.0:
            return 1.0, 0.0
        stretch = (length / height) ** 2 * (4.0 / 3.0 if self.section == "circle" else 1.0)
        c = math.sqrt(1.0 - along**2 + stretch * along**4)
        return c, (2.0 * stretch * along**3 - along) / c

    def lost(self, place: float) -> tuple[float, float]:
        """Share of a section above the water, and moment of the submerged part; lengths are in units of the half-height."""
        u = min(max(place, -1.0), 1.0)
        if self.section == "box":
            return 0.5 * (1.0 - u), 0.25 * (1.0 - u**2)
        w = math.sqrt(1.0 - u**2)
        return (math.acos(u) - u * w) / math.pi, 2.0 * w**3 / (3.0 * math.pi)

    def swell(self, view: View, point: Array) -> tuple[float, Array]:
        """Elevation of the surface above a point [m], and acceleration of the water there (3,) divided by gravity."""
        elevation, acceleration = 0.0, np.zeros(3)
        for wave in self.waves:
            place = View(view.R, view.b + view.R @ point, view.nu, view.Om, view.t)
            acceleration = acceleration + wave.acceleration(place) / wave.gravity
            elevation += wave.elevation(place)
        return elevation, acceleration

    def wrench(self, view: View) -> tuple[Array, Array]:
        """The lost buoyancy along the pressure gradient, and the moment of partly submerged sections."""
        force, torque = np.zeros(3), np.zeros(3)
        for x, buoyancy, height, length in self.parts():
            point = self.center_of_buoyancy + x * AXIS
            elevation, acceleration = self.swell(view, point)
            depth = view.b[2] + view.down @ point + elevation
            c, slope = self.extent(view.down[0], height, length)
            lost, moment = self.lost(2.0 * depth / (c * height))
            f = buoyancy * lost * (view.down - view.R.T @ acceleration)
            force = force + f
            torque = torque + cross(point, f) - buoyancy * 0.5 * height * moment * slope * cross(AXIS, view.down)
        return force, torque

    def potential(self, view: View) -> float:
        """U [J], the energy to lift the part of the hull above still water out of it."""
        total = 0.0
        for x, buoyancy, height, length in self.parts():
            depth = view.b[2] + view.down @ (self.center_of_buoyancy + x * AXIS)
            c, _ = self.extent(view.down[0], height, length)
            lost, moment = self.lost(2.0 * depth / (c * height))
            total += buoyancy * (0.5 * c * height * moment - depth * lost)
        return float(total)
