"""Actuators that a controller drives: how each follows the command that it holds."""

import numpy as np

from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.terms import Law, View


def approached(n: Array, u: Array, length: float, time_constant: Array, rate: Array) -> Array:
    """n' = (u - n) / time constant, no faster than the rate, after a time: at the rate first, then by the exponential.

    Args:
        n, u: Places at the start (k,); commands (k,), held.
        length, time_constant, rate: Time [s]; time constants (k,) [s], 0 for none; limits of the rate (k,), inf for none.
    """
    after = np.zeros_like(n)
    for i in range(len(n)):
        gap, T, most = u[i] - n[i], time_constant[i], rate[i]
        fast = (
            max((abs(gap) - most * T) / most, 0.0)
            if most > 0.0 and np.isfinite(most)
            else (0.0 if most > 0.0 else length)
        )
        fast = min(fast, length)
        left = abs(gap) - (fast * most if fast > 0.0 else 0.0)
        slow = length - fast
        left *= np.exp(-slow / T) if T > 0.0 else float(slow <= 0.0)
        after[i] = u[i] - np.sign(gap) * left
    return after


class Driven(Law):
    """limit (k,); `held` (k,), the commands of the controller, which its loop sets; time_constant and rate_limit (k,)."""

    time_constant: Array = np.zeros(1)
    rate_limit: Array = np.full(1, np.inf)

    @property
    def moving(self) -> bool:
        """Whether some channel has a lag or a limit of its rate: then all remember."""
        return bool(np.any(np.asarray(self.time_constant) > 0.0) or np.any(np.isfinite(self.rate_limit)))

    def start(self) -> Array:
        """At rest, or nothing."""
        return np.zeros_like(self.limit) if self.moving else np.zeros(0)

    def moved(self, view: View, length: float) -> Array:
        """Where the channels are after a time [s]."""
        if not self.moving:
            return view.memory
        u = np.clip(self.held, -self.limit, self.limit)
        T, rate = (np.broadcast_to(value, u.shape) for value in (self.time_constant, self.rate_limit))
        return approached(view.memory, u, length, T, rate)

    def evolve(self, view: View, second: bool) -> Array:
        """Half a kick later."""
        return self.moved(view, 0.5 * view.h)

    def follow(self, view: View) -> Array:
        """A time view.h later."""
        return self.moved(view, view.h)

    def place(self, view: View) -> Array:
        """Where the channels are."""
        return view.memory if self.moving else np.clip(self.held, -self.limit, self.limit)


class ControlWrench(Driven):
    """An ideal actuator: channels X, Y, Z, K, M, N."""

    def wrench(self, view: View) -> tuple[Array, Array]:
        """What the channels are."""
        n = self.place(view)
        return n[:3], n[3:]

    def effort(self, command: Array) -> Array:
        """The wrench of a command."""
        return command

    def command_for(self, effort: Array) -> Array:
        """The command of a wrench."""
        return effort


class DrivenThrusters(Driven):
    """Numbers as those of the twin's `Thrusters`, with square curves."""

    def effort(self, command: Array) -> Array:
        """Thrusts (k,) [N] of commands."""
        ahead, astern = (np.maximum(sign * command - self.dead_band, 0.0) for sign in (1.0, -1.0))
        return np.asarray(self.forward * ahead**2 - self.backward * astern**2)

    def command_for(self, effort: Array) -> Array:
        """The least commands of thrusts (k,) [N]."""
        c = np.where(effort > 0.0, self.forward, self.backward)
        size = np.sqrt(np.abs(effort) / c) + self.dead_band
        return np.asarray(np.where(effort != 0.0, np.sign(effort) * size, 0.0))

    def wrench(self, view: View) -> tuple[Array, Array]:
        """The thrusts at their places."""
        forces = self.effort(self.place(view))[:, None] * self.direction
        return forces.sum(axis=0), np.cross(self.position, forces).sum(axis=0)
