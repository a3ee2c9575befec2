"""Programs of sub-maps, run step by step."""

from lgvi_warp.reference.rotation import newton
from lgvi_warp.reference.submaps import SUBMAPS


def step(x, body, program, h, stages=(1.0,), solve=newton):
    """One step: the program with g h for each stage coefficient g. program: (letter, coefficient), first applied first."""
    for g in stages:
        for letter, coefficient in program:
            x = SUBMAPS[letter](x, body, coefficient * g * h, solve)
    return x


def advance(x, body, program, h, steps, stages=(1.0,), solve=newton):
    """The state after so many steps."""
    for _ in range(steps):
        x = step(x, body, program, h, stages, solve)
    return x


def trajectory(x, body, program, h, steps, every=1, stages=(1.0,), solve=newton):
    """The states after 0, every, 2 every, ... steps."""
    states = [x]
    for _ in range(steps // every):
        x = advance(x, body, program, h, every, stages, solve)
        states.append(x)
    return states
