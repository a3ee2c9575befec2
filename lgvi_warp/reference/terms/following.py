# SPDX-License-Identifier: Apache-2.0
"""Actuators that follow commands of a schedule or of a controller, with a limit, a lag and a largest rate."""

import math
from dataclasses import replace

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View
from lgvi_warp.reference.terms.wrench import at_time, pieces


class Following(Law):
    """Channels with limit (n,), time_constant (n,) [s] or 0, rate_limit (n,) or inf; times (k,) [s] and command (k, n).

    Instead of a schedule, a driven law has `held` (n,), the commands of a controller, set by its loop.
    """

    driven = False
    time_constant: Array | float = 0.0
    rate_limit: Array | float = math.inf

    @property
    def moves(self) -> bool:
        """Whether a channel has a lag or a limited rate, and commands change; then all channels have memory."""
        slow = np.any(np.greater(self.time_constant, 0.0)) or np.any(np.isfinite(self.rate_limit))
        return bool(slow and (self.driven or len(self.times) > 1))

    def commanded(self, t: float) -> Array:
        """Commands (n,) at t, within their limits."""
        wanted = self.held if self.driven else at_time(t, self.times, self.command, False)
        return np.clip(wanted, -self.limit, self.limit)

    def start(self) -> Array:
        """The commands at t = 0, 0 for a driven law; empty if no channel has memory."""
        if not self.moves:
            return np.zeros(0)
        return np.zeros(len(self.limit)) if self.driven else self.commanded(0.0)

    def place(self, view: View) -> Array:
        """Position in the memory, or the command itself."""
        return view.memory if self.moves else self.commanded(view.t)

    def evolve(self, view: View, second: bool) -> Array:
        """Follow the command over the half of a kick that ends or begins at its middle."""
        half = 0.5 * view.h
        return self.follow(replace(view, t=view.t + second * half, h=half))

    def follow(self, view: View) -> Array:
        """Follow each straight part of the command within the view.h before view.t.

        docs/theory/control_loop.md, (C6).
        """
        n = view.memory
        if self.driven:
            return self._moved(n, view.h, self.commanded(view.t), self.commanded(view.t))
        for s, first, last in pieces(view.t, view.h, self.times, self.command, self.limit):
            n = self._moved(n, s, first, last)
        return n

    def _moved(self, n: Array, s: float, first: Array, last: Array) -> Array:
        if not self.moves:
            return n
        lags, rates = (np.broadcast_to(x, n.shape) for x in (self.time_constant, self.rate_limit))
        return np.array([chased(*channel, s) for channel in zip(n, first, last, lags, rates, strict=True)])


def chased(n: float, first: float, last: float, lag: float, rate: float, s: float) -> float:
    """n after s [s], while the command u moves linearly from first to last: n' = (u - n) / lag, with a limited rate.

    docs/theory/control_loop.md, (C6).
    """
    if s <= 0.0:
        return n
    slope, gap, remaining = (last - first) / s, first - n, s
    band = rate * lag if lag > 0.0 else 0.0
    if rate == 0.0:
        return n
    if abs(gap) > band:
        speed = slope - math.copysign(rate, gap) if math.isfinite(rate) else -math.copysign(math.inf, gap)
        closing = -speed * math.copysign(1.0, gap)
        needed = (abs(gap) - band) / closing if closing > 0.0 else math.inf
        if needed >= remaining:
            return last - (gap + speed * remaining)
        remaining, gap = remaining - needed, math.copysign(band, gap)
    if lag > 0.0:
        # gap' = slope - gap / lag, for as long as the gap is within the band.
        final = slope * lag
        within = remaining
        if abs(slope) > rate:
            edge = math.copysign(band, slope)
            within = min(remaining, lag * math.log((gap - final) / (edge - final)))
        gap = final + math.exp(-within / lag) * (gap - final)
        remaining = remaining - within
    if abs(slope) > rate:
        gap += (slope - math.copysign(rate, slope)) * remaining
    return last - gap
