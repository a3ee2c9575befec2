# SPDX-License-Identifier: Apache-2.0
"""Largest stable steps of each method by linear theory.

The limit of the step is h < c / rate, with a number c of the method and a rate of the member (lgvi_warp.physics.rates).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable

import numpy as np

from lgvi_warp.methods.limits import MOST, STEP, drag_limit, first_unstable, spin_limit
from lgvi_warp.methods.method import Method

# Letters of programs: sub-maps that turn the body, and those that change its momentum in each oscillation. Turns about
# the three axes follow one another; only that about the oscillation's own axis, R1 or R3 (twice a step), counts.
TURNS = ("D", "W", "R1", "A")
MOMENTS = {"munk": ("T", "Ap", "B"), "restoring": ("K", "B")}


def _oscillator(method: Method, moments: tuple[str, ...]) -> list[tuple[bool, float]]:
    """The sub-maps of one step in order: (True if the angle is advanced, False for the rate; its length in steps)."""
    if method.two_part:
        first = method.program[0][0]
        return [((first == "A") == (i % 2 == 0), g) for i, g in enumerate(method.stages)]
    program, n = method.program, len(method.program) // 2
    if method.halved:
        lengths = [2.0 * g for g in method.stages]
        pairs = list(zip(lengths[0::2], lengths[1::2], strict=True))
        maps = [(letter, c * (a if i < n else b if i >= len(program) - n else 0.5 * (a + b)))
                for a, b in pairs for i, (letter, c) in enumerate(program)]  # fmt: skip
    else:
        maps = [(letter, c * g) for g in method.stages for letter, c in program]
    return [(letter in TURNS, c) for letter, c in maps if letter in TURNS or letter in moments]


@functools.cache
def oscillation_limit(name: str, kind: str = "munk") -> float:
    """The largest h w [rad] at which a small oscillation of frequency w stays small; NaN for gauss*.

    A step of a method with sub-maps is a product of shears, whose trace gives the limit. For explicit methods the limit
    follows from the stability polynomial at i h w. Large amplitudes may tumble at shorter steps.
    """
    method, numbers = Method(name), np.arange(STEP, MOST, STEP)
    if method.gauss:
        return math.nan
    if method.tableau:
        return spin_limit(name)
    step = np.broadcast_to(np.eye(2), (len(numbers), 2, 2)).copy()
    for angle, c in _oscillator(method, MOMENTS[kind]):
        row, source, sign = (0, 1, 1.0) if angle else (1, 0, -1.0)
        step[:, row] += (sign * c * numbers)[:, None] * step[:, source]
    # Determinant 1: both eigenvalues lie on the unit circle up to a trace of 2.
    half = 0.5 * np.abs(step[:, 0, 0] + step[:, 1, 1])
    return first_unstable(numbers, half + np.sqrt(np.maximum(half**2 - 1.0, 0.0)))


@functools.cache
def rotation_limit(name: str) -> float:
    """The largest h |J^-1 pi| of a method [rad]; NaN for gauss*.

    The limit is |J^-1 a| = 1 for equation (24), a half angle of 1 for turns about axes; for rk* it is where R grows.
    """
    method = Method(name)
    if method.tableau:
        return math.inf if name in ("cg3", "rkmk4") else spin_limit(name)
    if method.gauss:
        return math.nan
    if method.two_part:
        # The modified rotation of a part ends at a quarter turn.
        first = method.program[0][0] == "A"
        return 0.5 * math.pi / max(abs(g) for g in method.stages[0 if first else 1 :: 2])
    share = max(abs(c) for letter, c in method.program if letter in ("D", "W", "R1"))
    longest = max(abs(g) for g in method.stages) * (2.0 if method.halved else 1.0)
    return (2.0 if method.turns else 1.0) / (share * longest)


LIMITS: dict[str, Callable[[str], float]] = {
    "rotation": rotation_limit,
    "munk": lambda name: oscillation_limit(name, "munk"),
    "restoring": lambda name: oscillation_limit(name, "restoring"),
    "drag": drag_limit,
}
TEXTS = {
    "rotation": "|J^-1 a| = 1, half a turn's angle = 1 (psi_x), or R grows (rk*)",
    "munk": "Munk oscillation, h w = limit",
    "restoring": "restoring oscillation, h w = limit",
    "drag": "drag number h (l + 2 q |v|) / I = limit",
}
