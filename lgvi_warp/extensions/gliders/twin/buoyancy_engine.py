# SPDX-License-Identifier: Apache-2.0
"""A buoyancy engine: a pump between two volumes that turns at two depths."""

import numpy as np

from lgvi_warp.extensions.gliders.twin.density_profile import DensityProfile
from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View


class BuoyancyEngine(Law):
    """Numbers as those of `lw.terms.BuoyancyEngine`; density [kg/m3], gravity [m/s2]; profile as in `Ballast`.

    Memory: the volume now; 1 up, -1 down; volume and depth at the last look; the time since then, -1 before the first; with
    an efficiency the pressure at the last look [N/m2].
    """

    first = "down"
    gradient = 0.0
    reference_depth = 0.0
    efficiency: float | None = None
    profile: DensityProfile | None = None

    def wrench(self, view: View) -> tuple[Array, Array]:
        """-rho (1 + gradient (d - reference_depth)) g V R^T e3 at the position, d its depth."""
        depth = view.b[2] + view.down @ self.position
        density = self.density * (1.0 + self.gradient * (depth - self.reference_depth))
        if self.profile is not None:
            density = self.profile.density_at(float(depth))
        f = -density * self.gravity * view.memory[0] * view.down
        return f, cross(self.position, f)

    def start(self) -> Array:
        """At rest at its first volume."""
        rows = [self.volume_start, 1.0 if self.first == "up" else -1.0, self.volume_start, 0.0, -1.0]
        return np.array(rows if self.efficiency is None else [*rows, 0.0])

    def pumped(self, volume: float, side: float, time: float) -> float:
        """The volume after a time towards the one for this side."""
        goal, most = self.volume_up if side > 0.0 else self.volume_down, self.pump_rate * time
        return float(volume + np.clip(goal - volume, -most, most))

    def met(self, view: View, time: float) -> float | None:
        """Time after the last look at which a straight line met the depth where it turns, `time` being since then; or None."""
        _, side, _, before, since, *_ = view.memory
        depth, before = view.b[2], view.b[2] if since < 0.0 else before
        end = self.depth_top if side > 0.0 else self.depth_bottom
        if -side * (depth - end) <= 0.0:
            return None
        return float(time * (end - before) / (depth - before)) if -side * (before - end) <= 0.0 else 0.0

    def looked(self, view: View, time: float) -> tuple[float, float]:
        """(volume, side) after `time` more than at the last look."""
        _, side, volume, _, since, *_ = view.memory
        time += max(since, 0.0)
        until = self.met(view, time)
        if until is None:
            return self.pumped(volume, side, time), side
        return self.pumped(self.pumped(volume, side, until), -side, time - until), -side

    def evolve(self, view: View, second: bool) -> Array:
        """The volume in the middle of the kick, and then the look."""
        half = 0.5 * view.h
        volume, side = self.looked(view, half)
        if not second:
            return np.array([volume, *view.memory[1:]])
        return np.array([self.pumped(volume, side, half), side, volume, view.b[2], half, *view.memory[5:]])

    def follow(self, view: View) -> Array:
        """A look at this stage."""
        volume, side = self.looked(view, view.h)
        pressure = [] if self.efficiency is None else [self.pressure(view)]
        return np.array([volume, side, volume, view.b[2], 0.0, *pressure])

    def pressure(self, view: View) -> float:
        """The weight of the water above the position per area [N/m2], 0 above the surface."""
        d = view.b[2] + view.down @ self.position
        if self.profile is not None:
            return max(self.gravity * self.profile.column(float(d)), 0.0)
        return float(
            max(self.density * self.gravity * (d + self.gradient * (d**2 / 2.0 - self.reference_depth * d)), 0.0)
        )

    def spent(self, view: View, memory: Array) -> float:
        """p dV / efficiency of what the pump pushed out: see the device code."""
        if self.efficiency is None or memory[3:5].tolist() == view.memory[3:5].tolist():
            return 0.0
        _, side, volume, _, since, before = view.memory
        start = self.pumped(volume, side, max(since, 0.0))
        risen = max(memory[2] - start, 0.0)
        pressure = self.pressure(view)
        if memory[4] > 0.0:
            return pressure * (risen + max(memory[0] - memory[2], 0.0)) / self.efficiency
        middle = (self.met(view, view.h) or 0.0) + 0.5 * risen / self.pump_rate
        before = pressure if since < 0.0 else before
        return risen * (before + middle / view.h * (pressure - before)) / self.efficiency
