# SPDX-License-Identifier: Apache-2.0
"""diffrax on JAX: Tsit5, Dopri5, Dopri8, with fixed steps and adaptive, compiled, in blocks of members.

A block of members as one array (13, block) with steps in common is what is fastest here; "vmap" gives each member its
own steps, the usual way to write an ensemble, and every member then waits for the slowest.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from benchmarks.peers.peer_jax import Blocks  # first: it sets the flags of JAX
from benchmarks.peers.problem import DRIVEN, Problem, Runs, make_rates

# isort: split
import diffrax
import jax
import jax.numpy as jnp

PROBLEMS = ("vehicle", *DRIVEN)
SOLVERS = {"tsit5": diffrax.Tsit5, "dopri5": diffrax.Dopri5, "dopri8": diffrax.Dopri8}
ORDERS = {"tsit5": 5, "dopri5": 5, "dopri8": 8}
TOLERANCES = {"tsit5": (1e-3, 1e-5, 1e-7, 1e-9), "dopri8": (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)}
VMAP = (1e-5, 1e-9)
VMAP_MEMBERS = 512
FIRST_STEP = 0.01


def solve(problem: Problem, solver: Any, adaptive: bool, y: Any, setting: Any, _: Any = None) -> Any:
    """The state at t1, from a state (13,) or (13, block). setting: the step [s], or the tolerance."""
    rates = make_rates(problem, absolute=jnp.abs, root=jnp.sqrt)
    controller = diffrax.PIDController(rtol=setting, atol=setting) if adaptive else diffrax.ConstantStepSize()
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, y, args: jnp.stack(rates(y))),
        solver,
        0.0,
        problem.t1,
        FIRST_STEP if adaptive else setting,
        y,
        stepsize_controller=controller,
        saveat=diffrax.SaveAt(t1=True),
        adjoint=diffrax.ForwardMode(),
        max_steps=None,
    )
    return found.ys[-1]


def runs(problem: Problem, threads: int) -> Runs:
    """By steps a second, and by tolerance."""
    for name, solver in SOLVERS.items():
        fixed = Blocks(partial(solve, problem, solver(), False), problem, threads)
        for rate in problem.rates(ORDERS[name])[:: 3 if name == "dopri5" else 1]:
            h, _ = problem.steps(rate)
            yield fixed.run(name, f"h={h:g}", h)
        adaptive = Blocks(partial(solve, problem, solver(), True), problem, threads)
        for tolerance in TOLERANCES.get(name, ()):
            yield adaptive.run(f"{name} adaptive", f"tol={tolerance:g}", tolerance)
    part = problem.first(VMAP_MEMBERS)
    own = jax.vmap(partial(solve, part, diffrax.Dopri8(), True), in_axes=(1, None, None), out_axes=1)
    each = Blocks(own, part, threads)
    for tolerance in VMAP:
        yield each.run("dopri8 adaptive, vmap", f"tol={tolerance:g}", tolerance)
