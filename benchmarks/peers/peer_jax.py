# SPDX-License-Identifier: Apache-2.0
"""JAX without a library: fixed steps written out in a compiled loop, blocks of members as arrays.

RK4 is faster with the state as one array, DOP853 with the 13 numbers apart, where the compiler does not join so much.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from benchmarks.peers import jax_flags  # noqa: F401  first: JAX reads them when it starts

# isort: split
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.peers import tableaus
from benchmarks.peers.problem import SIZE, End, Problem, Run, Runs, end_of, make_rates

jax.config.update("jax_enable_x64", True)

BLOCK = 256
STEPS = {  # a second
    "rk4": (1, 1.5, 2, 3, 4, 6, 8, 12, 16, 32, 64, 128),
    "dop853": (0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 32),
}
# From a state (13, block), a step [s] or a tolerance, and a number of steps to the state at t1.
Advance = Callable[[Any, Any, Any], Any]


class Blocks:
    """An advance compiled once for all settings, block after block of members.

    XLA's threads work within one array operation, so on more threads all members are one block.
    """

    def __init__(self, advance: Advance, problem: Problem, threads: int):
        self.members = problem.members
        self.block = min(BLOCK if threads == 1 else self.members, self.members)
        self.start = jnp.asarray(np.resize(problem.state(), (-(-self.members // self.block) * self.block, SIZE)))
        self.compiled = jax.jit(partial(self._all, advance))

    def _all(self, advance: Advance, start: Any, h: Any, steps: Any) -> Any:
        parts = start.reshape(-1, self.block, SIZE)
        return jax.lax.map(lambda part: advance(part.T, h, steps), parts)

    def run(self, method: str, setting: str, h: float, steps: int = 0) -> Run:
        """One setting."""
        ends: list[Any] = [None]

        def call() -> None:
            ends[0] = jax.block_until_ready(self.compiled(self.start, h, steps))

        def end() -> End:
            return end_of(np.asarray(ends[0]).transpose(0, 2, 1).reshape(-1, SIZE)[: self.members])

        return Run(method, setting, self.members, call, end)


def rk4(problem: Problem, y: Any, h: Any, steps: Any) -> Any:
    """The classical method on one array."""
    rates = make_rates(problem)

    def rate(y: Any) -> Any:
        return jnp.stack(rates(y))

    def step(_: Any, y: Any) -> Any:
        k1 = rate(y)
        k2 = rate(y + 0.5 * h * k1)
        k3 = rate(y + 0.5 * h * k2)
        k4 = rate(y + h * k3)
        return y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    return jax.lax.fori_loop(0, steps, step, y)


def dop853(problem: Problem, y: Any, h: Any, steps: Any) -> Any:
    """Dormand & Prince's method of order 8 on 13 arrays."""
    rates = make_rates(problem)

    def step(_: Any, y: Any) -> Any:
        return tableaus.step(rates, y, h, tableaus.TABLEAUS["dop853"])

    return jnp.stack(jax.lax.fori_loop(0, steps, step, tuple(y)))


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second."""
    for name, advance in (("rk4", rk4), ("dop853", dop853)):
        blocks = Blocks(partial(advance, problem), problem, threads)
        for rate in STEPS[name]:
            h, steps = problem.steps(rate)
            yield blocks.run(name, f"h={h:g}", h, steps)
