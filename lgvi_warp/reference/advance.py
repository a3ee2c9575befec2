# SPDX-License-Identifier: Apache-2.0
"""Programs of sub-maps, run step by step."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from lgvi_warp.reference.paper import FORCED
from lgvi_warp.reference.rotation import Solver, newton
from lgvi_warp.reference.submaps import SUBMAPS, Body, K, State

# (letter, coefficient) of each sub-map, the first applied first.
Program = Sequence[tuple[str, float]]


def step(
    x: State, body: Body, program: Program, h: float, stages: Sequence[float] = (1.0,), solve: Solver = newton
) -> State:
    """One step of h [s]: the program with g h for each stage coefficient g.

    docs/theory/splitting.md, (S6), (S7), (S8), (S9).
    """
    last = len(program) - 1
    # Kicks at both ends of a step: what laws remember belongs to the time after the first, and before the last.
    late = {0: 0.5, last: -0.5} if last and program[0][0] == program[last][0] == "K" else {}
    for g in stages:
        for i, (letter, coefficient) in enumerate(program):
            if i in late:
                x = K(x, body, coefficient * g * h, solve, late[i])
            else:
                x = (SUBMAPS | FORCED)[letter](x, body, coefficient * g * h, solve)
    return x


def advance(
    x: State,
    body: Body,
    program: Program,
    h: float,
    steps: int,
    stages: Sequence[float] = (1.0,),
    solve: Solver = newton,
) -> State:
    """The state after this many steps."""
    for _ in range(steps):
        x = step(replace(x, t=x.step * h), body, program, h, stages, solve)
        x = replace(x, step=x.step + 1)
    return x


def trajectory(
    x: State,
    body: Body,
    program: Program,
    h: float,
    steps: int,
    every: int = 1,
    stages: Sequence[float] = (1.0,),
    solve: Solver = newton,
) -> list[State]:
    """The states after 0, every, 2 every, ..., steps steps. Raises ValueError if `every` does not divide `steps`."""
    if steps % every:
        raise ValueError(f"every = {every} does not divide steps = {steps}")
    states = [x]
    for _ in range(steps // every):
        states.append(advance(states[-1], body, program, h, every, stages, solve))
    return states


def arrival(
    x: State,
    body: Body,
    program: Program,
    h: float,
    distance: Callable[[State], float],
    stages: Sequence[float] = (1.0,),
    solve: Solver = newton,
) -> tuple[State, float]:
    """State where a step from x reaches distance 0, and the part of h until then; distance: positive at x alone."""
    start = replace(x, t=x.step * h)

    def after(part: float) -> State:
        return step(start, body, program, part * h, stages, solve)

    low, high = 0.0, 1.0
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if distance(after(middle)) > 0.0 else (low, middle)
    return after(high), high
