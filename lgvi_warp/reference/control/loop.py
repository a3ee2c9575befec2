# SPDX-License-Identifier: Apache-2.0
"""The closed loop of one vehicle: ticks between steps, and commands that are held until the next tick."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lgvi_warp.reference.control import NO_WISH, Measurement, Part, Reference
from lgvi_warp.reference.control.fault import Fault
from lgvi_warp.reference.rotation import Array
from lgvi_warp.reference.submaps import Body, State, look, water


@dataclass
class Loop:
    """A controller of one vehicle.

    parts: in the order in which they act; actuators: the laws with commands, by name, each with `command`, an array
    that the allocation sets, and `held`, which the law uses; every: steps between ticks; delay: steps from a tick until
    its commands act. measured, demand, unmet: values of the last tick.
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
        """Reset the memory of all parts and the commands, before the first tick."""
        for part in self.parts:
            part.begin()
        for law in self.actuators.values():
            law.command = np.zeros_like(law.limit)
            law.held = np.zeros_like(law.limit)
        self.sent, self.unmet = [], np.zeros(6)
        for fault in self.faults:
            fault.begin()

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
            if part.ahead:
                part.foresee([self.wanted_later(y, j) for j in range(1, part.ahead + 1)], r, y)
        for part in self.parts:
            w = part.control(w, r, y, self.unmet)
        self.measured, self.demand = y, w
        for part in self.parts:
            w = part.allocate(w, self.actuators)
        self.unmet = w
        self.sent.append((x.step + self.delay, {name: law.command.copy() for name, law in self.actuators.items()}))
        self.change(x, body, self.every * h)

    def wanted_later(self, y: Measurement, ticks: int) -> Reference:
        """Reference of a time-dependent guidance some ticks later."""
        y, r = replace(y, t=y.t + ticks * y.period, step=y.step + ticks * self.every, tick=y.tick + ticks), NO_WISH
        for part in self.parts:
            r = part.guide(r, y)
        return r

    def arrived(self, step: int) -> dict[str, Array]:
        """The last commands that have arrived by a step."""
        arrived = [commands for since, commands in self.sent if since <= step]
        return arrived[-1] if arrived else {name: np.zeros_like(law.limit) for name, law in self.actuators.items()}

    def change(self, x: State, body: Body, T: float) -> None:
        """Let the faults change the commands of a period T [s], before its new commands arrive and afterwards.

        docs/theory/control_loop.md, (C5).
        """
        tick, end = x.step // self.every, x.step + self.every - 1
        self.turn = max((since for since, _ in self.sent if since <= end), default=0)
        self.before, self.after = (
            {name: value.copy() for name, value in self.arrived(step).items()} for step in (x.step - 1, end)
        )
        for fault in self.faults:
            before, after, i = self.before[fault.of], self.after[fault.of], fault.channel
            last, place = fault.last, self.place(fault.of, x, body)
            after[i] = fault.change(tick, T, float(after[i]), None if place is None else float(place[i]))
            if fault.acts(tick, T):
                stays = fault.kind == "stuck" and fault.value is None
                memory = fault.kind in ("freeze", "slow", "delay")
                old = after[i] if stays else fault.changed(float(before[i]), 0, T, None)
                before[i] = (after[i] if last is None else last) if memory else old

    def place(self, name: str, x: State, body: Body) -> Any:
        """Position of an actuator with a lag; None for one that is always at its command."""
        law = self.actuators[name]
        return next(rows for term, rows in zip(body.terms, x.memory, strict=True) if term is law) if law.moves else None

    def act(self, step: int, h: float) -> None:
        """Set the commands of actuators in a step: the last commands that have arrived, as changed by faults.

        docs/theory/control_loop.md, (C4).
        """
        for name, law in self.actuators.items():
            law.held = (self.after if step >= self.turn else self.before)[name]


def closed_loop(
    x: State, body: Body, loop: Loop, step: Callable[[State, Body, float], State], h: float, steps: int
) -> list[State]:
    """The states after 0, 1, ..., steps steps, with a tick before every `every`-th step.

    docs/theory/control_loop.md, (C1).

    step: function of (x, body, h) that returns the state h later; h: step [s]; steps: number of steps.
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
