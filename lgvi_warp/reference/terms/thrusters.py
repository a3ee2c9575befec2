"""Thrusters: a thrust curve with dead band and saturation, after a first-order lag."""

import math

import numpy as np

from lgvi_warp.reference.rotation import Array, cross
from lgvi_warp.reference.terms import Law, View
from lgvi_warp.reference.terms.wrench import at_time, pieces


class Thrusters(Law):
    """Numbers as those of `lw.Thrusters`, with coefficients forward, backward (n,); times (k,) [s], command (k, n)."""

    polynomial = (0.0, 1.0)
    polynomial_astern = (0.0, 1.0)

    @property
    def lagged(self) -> bool:
        """Whether some thruster has a lag: then all remember."""
        return bool(np.any(self.time_constant > 0.0))

    def commanded(self, t: float) -> Array:
        """Commands (n,) at t, within their limits."""
        return np.clip(at_time(t, self.times, self.command, False), -self.limit, self.limit)

    def start(self) -> Array:
        """The commands at t = 0, or none."""
        return self.commanded(0.0) if self.lagged else np.zeros(0)

    def evolve(self, view: View, second: bool) -> Array:
        """n' = (command - n) / time constant over half a kick, the command that of the middle of the half."""
        if not self.lagged:
            return view.memory
        u = self.commanded(view.t + (0.25 if second else -0.25) * view.h)
        kept = [math.exp(-0.5 * view.h / tau) if tau > 0.0 else 0.0 for tau in self.time_constant]
        return np.asarray(u + np.array(kept) * (view.memory - u))

    def follow(self, view: View) -> Array:
        """n' = (command - n) / tau: over s of a straight command n <- last + e^-x (n - first) - (1 - e^-x) / x (last - first).

        x = s / tau; tau is the time constant.
        """
        n = view.memory
        if not self.lagged:
            return n
        for s, first, last in pieces(view.t, view.h, self.times, self.command, self.limit):
            x = [s / tau if tau > 0.0 else math.inf for tau in self.time_constant]
            n = last + np.exp(np.negative(x)) * (n - first) + np.expm1(np.negative(x)) / x * (last - first)
        return np.asarray(n)

    def wrench(self, view: View) -> tuple[Array, Array]:
        """c+ f+(max(n - band, 0)) - c- f-(max(-n - band, 0)) along each."""
        n = view.memory if self.lagged else self.commanded(view.t)
        ahead, astern = np.maximum(n - self.dead_band, 0.0), np.maximum(-n - self.dead_band, 0.0)
        f_ahead = sum(p * ahead ** (i + 1) for i, p in enumerate(self.polynomial))
        f_astern = sum(p * astern ** (i + 1) for i, p in enumerate(self.polynomial_astern))
        forces = (self.forward * f_ahead - self.backward * f_astern)[:, None] * self.direction
        torque = sum((cross(r, f) for r, f in zip(self.position, forces, strict=True)), np.zeros(3))
        return forces.sum(axis=0), torque
