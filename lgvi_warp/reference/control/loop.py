# SPDX-License-Identifier: Apache-2.0
"""The closed loop of one vehicle: ticks between steps, and the commands that are held until the next one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import NO_WISH, Measurement, Part
from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.submaps import Body, State, look, water


@dataclass(frozen=True)
class Fault:
    """From a time [s] on the command of a channel of an actuator is gain * command + offset."""

    of: str
    channel: int
    time: float
    gain: float = 0.0
    offset: float = 0.0


@dataclass
class Loop:
    """A controller of one vehicle.

    parts: in the order in which they act; actuators: the laws that take commands, by name, each with `command`, an array that
    the allocation sets, and `held`, by which the law acts; every: steps between ticks; delay: steps from a tick until its
    commands act. measured, demand, unmet: of the last tick.
    """

    parts: Sequence[Part]
    actuators: dict[str, Any]
    every: int
    delay: int = 0
    faults: Sequence[Fault] = ()
    sent: list[tuple[int, dict[str, Array]]] = field(default_factory=list)
    unmet: Any = field(default_factory=lambda: np.zeros(6))
    demand: Any = field(default_factory=lambda: np.zeros(6))
    measured: Measurement | None = None

    def begin(self) -> None:
        """Before the first tick: no part remembers anything, and no command has come."""
        for part in self.parts:
            part.begin()
        for law in self.actuators.values():
            law.command = np.zeros_like(law.limit)
            law.held = np.zeros_like(law.limit)
        self.sent, self.unmet = [], np.zeros(6)

    def tick(self, x: State, body: Body, h: float) -> None:
        """Measure, guide, control and allocate at the start of step x.step. docs/theory/control_loop.md, (C2)."""
        view = look(x, body, h)
        nu, Om = np.split(np.linalg.solve(body.I6, np.concatenate([x.p, x.pi])), 2)
        u = x.R.T @ water(view, body).velocity
        y = Measurement(
            x.b, x.R, nu + u, nu, Om, x.step * h, self.every * h, h, x.step, x.step // self.every, body.member
        )
        r = NO_WISH
        w: Any = np.zeros(6)
        for part in self.parts:
            y = part.measure(y)
        for part in self.parts:
            r = part.guide(r, y)
        for part in self.parts:
            w = part.control(w, r, y, self.unmet)
        self.measured, self.demand = y, w
        for part in self.parts:
            w = part.allocate(w, self.actuators)
        self.unmet = w
        self.sent.append((x.step + self.delay, {name: law.command.copy() for name, law in self.actuators.items()}))

    def act(self, step: int, h: float) -> None:
        """Let the actuators hold what acts in a step: the last commands that have come, with the faults that have begun.

        docs/theory/control_loop.md, (C4), (C5).
        """
        arrived = [commands for since, commands in self.sent if since <= step]
        tick_time = step // self.every * self.every * h
        for name, law in self.actuators.items():
            held = arrived[-1][name].copy() if arrived else np.zeros_like(law.limit)
            for fault in self.faults:
                if fault.of == name and tick_time + 1e-6 * h >= fault.time:
                    held[fault.channel] = fault.gain * held[fault.channel] + fault.offset
            law.held = held


def closed_loop(
    x: State, body: Body, loop: Loop, step: Callable[[State, Body, float], State], h: float, steps: int
) -> list[State]:
    """The states after 0, 1, ..., steps steps, with a tick before every `every`-th.

    docs/theory/control_loop.md, (C1).

    step, h, steps: (x, body, h) -> the state h later; step [s]; number of steps.
    """
    loop.begin()
    states = [x]
    for k in range(steps):
        x = replace(x, t=k * h, step=k)
        if k % loop.every == 0:
            loop.tick(x, body, h)
        loop.act(k, h)
        x = step(x, body, h)
        states.append(x)
    return states
