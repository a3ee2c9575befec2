# SPDX-License-Identifier: Apache-2.0
"""Contact with the sea floor at points of the hull."""

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View, WaterAt


class BottomContact(Law):
    """Contact: points (k, 3) [m]; stiffness [N/m] and damper [N s/m] at each point for the step; friction.

    depth and slope (2,): The floor is the plane depth + slope . (north, east). Memory: the anchor (3,) of each point, and 1
    once the point has an anchor.
    """

    def start(self) -> Array:
        """Memory at the start, without anchors."""
        return np.zeros(4 * len(self.points))

    @property
    def normal(self) -> Array:
        """Unit normal of the floor, upward."""
        n = np.array([*self.slope, -1.0])
        return np.asarray(n / np.linalg.norm(n))

    def sunk(self, place: Array) -> float:
        """Depth of a point below the floor [m]."""
        return float((self.depth + self.slope @ place[:2] - place[2]) * self.normal[2])

    def stretch(self, memory: Array, place: Array) -> Array:
        """Vector along the floor from the anchor to a point, limited to 1.25 times the friction cone of a point at rest."""
        s = memory[3] * (place - memory[:3])
        return within(s - (s @ self.normal) * self.normal, 1.25 * self.friction * max(self.sunk(place), 0.0))

    def anchored(self, view: View) -> Array:
        """Memory after sliding points have dragged their anchors along."""
        rows = []
        for arm, memory in zip(self.points, view.memory.reshape(-1, 4), strict=True):
            place = view.b + view.R @ arm
            rows += [*(place - self.stretch(memory, place)), 1.0]
        return np.array(rows)

    def evolve(self, view: View, second: bool) -> Array:
        """See `anchored`; at the end of the kick, for the position of its force."""
        return self.anchored(view) if second else view.memory

    def follow(self, view: View) -> Array:
        """See `anchored`."""
        return self.anchored(view)

    def load(self, view: View, water_at: WaterAt) -> tuple[Array, Array]:
        """Push and friction at all points, from their velocities over ground."""
        w, n = np.zeros(6), view.R.T @ self.normal
        for arm, memory in zip(self.points, view.memory.reshape(-1, 4), strict=True):
            place = view.b + view.R @ arm
            v = view.nu + cross(view.Om, arm) + view.R.T @ water_at(arm).velocity
            push = self.stiffness * self.sunk(place) - self.damper * n @ v
            if self.sunk(place) <= 0.0 or push <= 0.0:
                continue
            across = -self.stiffness * view.R.T @ self.stretch(memory, place) - self.damper * (v - (n @ v) * n)
            force = push * n + within(across, self.friction * push)
            w += np.concatenate([force, cross(arm, force)])
        return np.zeros((6, 6)), w


def within(v: Array, most: float) -> Array:
    """v, shortened to the length `most` if it is longer."""
    size = float(np.linalg.norm(v))
    return v * most / size if size > most else v
