"""Control fins: fins whose deflection follows a command, within a limit and no faster than a rate."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.fins import Fins
from lgvi_warp.reference.terms.wrench import at_time, pieces


class ControlFins(Fins):
    """Numbers as those of `lw.ControlFins`, but rate_limit inf for none; times (k,) [s] and command (k, n) [rad]."""

    @property
    def limited(self) -> bool:
        """Whether some fin's rate is limited: then all remember."""
        return bool(np.any(np.isfinite(self.rate_limit)))

    def commanded(self, t: float) -> Array:
        """Commands (n,) at t, within their limits."""
        return np.clip(at_time(t, self.times, self.command, False), -self.limit, self.limit)

    def start(self) -> Array:
        """The commands at t = 0, or none."""
        return self.commanded(0.0) if self.limited else np.zeros(0)

    def evolve(self, view: View, second: bool) -> Array:
        """Towards the command by at most rate h/2, the command that of the middle of the half."""
        if not self.limited:
            return view.memory
        change = self.commanded(view.t + (0.25 if second else -0.25) * view.h) - view.memory
        most = 0.5 * view.h * self.rate_limit
        return np.asarray(view.memory + np.clip(change, -most, most))

    def follow(self, view: View) -> Array:
        """Along each straight piece of the command: at the rate until the fin meets it, then with it, or after it."""
        angle = view.memory
        if not self.limited:
            return angle
        for s, first, last in pieces(view.t, view.h, self.times, self.command, self.limit):
            most = s * np.minimum(self.rate_limit, 1e6)
            ahead = np.where(first > angle, 1.0, -1.0)
            closing = most - ahead * (last - first)
            part = np.minimum(np.abs(first - angle) / np.maximum(closing, 1e-300), 1.0)
            angle = angle + ahead * part * most
            angle = angle + np.clip(last - angle, (part - 1.0) * most, (1.0 - part) * most)
        return np.asarray(angle)

    def deflection(self, view: View) -> Array:
        """What is remembered, or the command."""
        return view.memory if self.limited else self.commanded(view.t)
