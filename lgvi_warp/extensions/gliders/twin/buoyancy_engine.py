# SPDX-License-Identifier: Apache-2.0
"""A buoyancy engine: a pump between two volumes that reverses at two depths."""

import numpy as np

from lgvi_warp.extensions.gliders.twin.density_profile import DensityProfile
from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View


class BuoyancyEngine(Law):
    """Numbers of `lw.terms.BuoyancyEngine`; density [kg/m3], gravity [m/s2]; `profile` as in `Ballast`.

    Memory: the present volume; the direction, 1 up or -1 down; volume and depth at the last evaluation; the time since then,
    -1 before the first; with an efficiency, the pressure at the last evaluation [N/m2].
    """

    first = "down"
    gradient = 0.0
    reference_depth = 0.0
    efficiency: float | None = None
    profile: DensityProfile | None = None

    def wrench(self, view: View) -> tuple[Array, Array]:
        """-rho (1 + gradient (d - reference_depth)) g V R^T e3 at the volume's position, whose depth is d."""
        depth = view.b[2] + view.down @ self.position
        density = self.density * (1.0 + self.gradient * (depth - self.reference_depth))
        if self.profile is not None:
            density = self.profile.density_at(float(depth))
        f = -density * self.gravity * view.memory[0] * view.down
        return f, cross(self.position, f)

    def start(self) -> Array:
        """Memory at the start: the first volume, with the pump at rest."""
        rows = [self.volume_start, 1.0 if self.first == "up" else -1.0, self.volume_start, 0.0, -1.0]
        return np.array(rows if self.efficiency is None else [*rows, 0.0])

    def pumped(self, volume: float, side: float, time: float) -> float:
        """The volume after pumping for a time towards the volume of a direction."""
        goal, most = self.volume_up if side > 0.0 else self.volume_down, self.pump_rate * time
        return float(volume + np.clip(goal - volume, -most, most))

    def met(self, view: View, time: float) -> float | None:
        """Time after the last evaluation, at most `time`, at which a linear path met the turning depth; or None."""
        _, side, _, before, since, *_ = view.memory
        depth, before = view.b[2], view.b[2] if since < 0.0 else before
        end = self.depth_top if side > 0.0 else self.depth_bottom
        if -side * (depth - end) <= 0.0:
            return None
        return float(time * (end - before) / (depth - before)) if -side * (before - end) <= 0.0 else 0.0

    def looked(self, view: View, time: float) -> tuple[float, float]:
        """(volume, direction) at `time` after the last evaluation."""
        _, side, volume, _, since, *_ = view.memory
        time += max(since, 0.0)
        until = self.met(view, time)
        if until is None:
            return self.pumped(volume, side, time), side
        return self.pumped(self.pumped(volume, side, until), -side, time - until), -side

    def evolve(self, view: View, second: bool) -> Array:
        """Memory with the volume in the middle of the kick; on the second call, an evaluation of the depth."""
        half = 0.5 * view.h
        volume, side = self.looked(view, half)
        if not second:
            return np.array([volume, *view.memory[1:]])
        return np.array([self.pumped(volume, side, half), side, volume, view.b[2], half, *view.memory[5:]])

    def follow(self, view: View) -> Array:
        """Memory after an evaluation of the depth at this stage."""
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
        """Energy p dV / efficiency of the volume that the pump pushed out: see the device code."""
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
