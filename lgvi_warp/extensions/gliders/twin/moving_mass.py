# SPDX-License-Identifier: Apache-2.0
"""A mass that moves in the vehicle."""

from dataclasses import replace

import numpy as np

from lgvi_warp.reference.rotation import Array, cross, hat
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.following import Following
from lgvi_warp.reference.terms.wrench import at_time


class MovingMass(Following):
    """Numbers of `lw.terms.MovingMass`, with gravity [m/s2], and those of `Following` if a controller drives it.

    inertia: Whether the inertia moves with the mass. The memory then ends with the mean velocity of the mass in the vehicle
    over the last step, 0 at the start.
    """

    slide_direction: Array | None = None
    turn_axis: Array | None = None
    turn_center: Array = np.zeros(3)
    inertia = False

    @property
    def moves(self) -> bool:
        """Whether commanded channels have a memory; all channels of a mass with inertia have one."""
        return self.driven and (self.inertia or super().moves)

    def start(self) -> Array:
        """Memory at the start: that of the channels, and a velocity of 0."""
        return np.concatenate([super().start() if self.driven else np.zeros(0), np.zeros(3 * self.inertia)])

    def _halves(self, view: View) -> tuple[View, Array]:
        """A view with only the memory of the channels, and the rest of the memory."""
        count = len(view.memory) - 3 * self.inertia
        return replace(view, memory=view.memory[:count]), view.memory[count:]

    def follow(self, view: View) -> Array:
        """Memory at this stage; channels change if a controller drives them."""
        own, rest = self._halves(view)
        return np.concatenate([super().follow(own) if self.driven else own.memory, rest])

    def where(self, view: View) -> Array:
        """Position r (3,) [m] of the mass: on its path, then slid, then turned."""
        r = at_time(view.t, self.times, self.places, False)
        if not self.driven:
            return r
        channels = iter(self.place(self._halves(view)[0]))
        if self.slide_direction is not None:
            r = r + next(channels) * self.slide_direction / np.linalg.norm(self.slide_direction)
        if self.turn_axis is not None:
            axis, angle = self.turn_axis / np.linalg.norm(self.turn_axis), next(channels)
            q = r - self.turn_center
            turned = np.cos(angle) * q + np.sin(angle) * cross(axis, q) + (1.0 - np.cos(angle)) * (axis @ q) * axis
            r = self.turn_center + turned
        return np.asarray(r)

    def wrench(self, view: View) -> tuple[Array, Array]:
        """Zero force, and the torque of the weight m g R^T e3 at r minus its torque at the reference position."""
        return np.zeros(3), cross(self.where(view) - self.reference, self.mass * self.gravity * view.down)

    def carried(self, view: View) -> tuple[Array, Array]:
        """Matrix and linear part of the kinetic energy m |nu + Om x r + v|^2 / 2 minus that at the reference position."""
        if not self.inertia:
            return super().carried(view)
        here, home = (np.hstack([np.eye(3), -hat(r)]) for r in (self.where(view), self.reference))
        return self.mass * (here.T @ here - home.T @ home), self.mass * here.T @ self._halves(view)[1]

    def depart(self, view: View) -> Array:
        """Memory with the mean velocity over the step."""
        if not self.inertia:
            return view.memory
        later = replace(view, t=view.t + view.h)
        later = replace(later, memory=self.follow(later))
        return np.concatenate([self._halves(view)[0].memory, (self.where(later) - self.where(view)) / view.h])
