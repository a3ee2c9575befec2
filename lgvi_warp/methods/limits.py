# SPDX-License-Identifier: Apache-2.0
"""Largest stable step of each method, measured or computed.

A limit is the largest h w for which an oscillation of angular frequency w keeps a bounded amplitude. It is measured at
an amplitude of 0.3 rad, for the Munk moment with M = (1, 100, 100) and for the restoring moment of a sphere. `python -m
benchmarks table warning_limits` writes the table.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lgvi_warp.common.reading import file_text
from lgvi_warp.methods.method import FORCED, Method
from lgvi_warp.methods.tableaux import Tableau

# Largest h |Omega| at which methods that turn about the axes are still accurate.
TURNS = 1.0

# A step counts as stable where a small motion grows by less than this: tenfold in 4000 steps.
GROWTH = math.log(10.0) / 4000.0
# Slowest contraction with which the iteration for the forces of Phi* reaches its tolerance in 60 rounds.
CONTRACTION = 1e-14 ** (1.0 / 60.0)
# Spacing and end of the numbers h w that are tried [rad].
STEP, MOST = 1e-3, 30.0

# The rows (method, largest stable h w of the Munk moment, and of the restoring moment) of methods and compositions. Gauss
# collocation has none: a status reports where its iteration fails.
STABLE_STEPS = Path(__file__).with_name("stable_steps.csv")
_ROWS = [line.split(",") for line in file_text(STABLE_STEPS, "CSV file").splitlines()[1:]]
MUNK = {method: float(munk) for method, munk, _ in _ROWS}
RESTORING = {method: float(restoring) for method, _, restoring in _ROWS}


def longest_stage(method: Method) -> float:
    """Length of a method's longest stage, forward or backward, in steps."""
    return max(abs(length) for length in method.lengths(None)[0])


def oscillation_limit(method: Method, table: Mapping[str, float]) -> float:
    """Largest stable h w [rad] of a method for an oscillation of angular frequency w; inf if a status reports the failure.

    It is measured. For a composition without a measurement it is the limit of the base method divided by the longest stage.
    """
    if method.gauss or method.adaptive:
        # A status reports where the iteration of the stages, or the step control, fails.
        return np.inf
    match = re.fullmatch(r"(\w+)\((\w+)\)", method.name)
    if match is None:
        return table[method.name]
    return table.get(method.name, table[match[2]] / longest_stage(method))


def rotation_limit(method: Method) -> float:
    """Largest h |Omega| [rad] of a method; inf if a status of the method reports a step that is too large."""
    if method.adaptive:
        return np.inf
    if method.turns:
        return TURNS / longest_stage(method)
    return spin_limit(method.name) if method.tableau else np.inf


def too_large(method: Method) -> str:
    """Say which quantity reached its limit when a method's step is too large, and the limit for the step."""
    reached = "half the angle of a turn" if method.turns else "|J^-1 a|"
    head = f"the step is too large: {reached} reached 1{'' if method.turns else ', where equation (24) may have no solution'}"
    if method.two_part:
        return f"{head}. Shorten the step, so that no part of it turns by a quarter turn"
    part = max(share for letter, share in method.program if letter[0] in "DRWP") * longest_stage(method)
    slender = ", and more for a slender body, whose turns about its length are split off: there psi_s is better"
    limit = f"{(2.0 if method.turns else 1.0) / part:.3g} / |angular velocity|"
    return f"{head}. Shorten the step below {limit}{slender if method.turns else ''}"


def stability_polynomial(tableau: Tableau, z: np.ndarray) -> np.ndarray:
    """R(z) (n,) of an explicit method at numbers z (n,): the result of one step of y' = (z/h) y from y = 1."""
    s = len(tableau.b)
    slopes: list[np.ndarray] = []
    for i in range(s):
        slopes.append(1.0 + z * sum((a * k for a, k in zip(tableau.a[i], slopes, strict=False)), np.zeros_like(z)))
    return np.asarray(1.0 + z * sum(b * k for b, k in zip(tableau.b, slopes, strict=True)))


def first_unstable(numbers: np.ndarray, growth: np.ndarray) -> float:
    """Largest h w [rad] up to which the growth factors (n,) of a step stay small; numbers: h w (n,), rising by STEP."""
    beyond = growth > 1.0 + GROWTH
    return float(numbers[np.argmax(beyond)] - STEP) if beyond.any() else math.inf


@functools.cache
def spin_limit(name: str) -> float:
    """Largest h |Omega| [rad] of a steady spin for an explicit method: beyond it the polynomial grows at i h |Omega|."""
    tableau = Method(name).tableau
    assert tableau is not None
    numbers = np.arange(STEP, MOST, STEP)
    return first_unstable(numbers, np.abs(stability_polynomial(tableau, 1j * numbers)))


@functools.cache
def drag_limit(name: str) -> float:
    """Largest stable h (l + 2 q |v|) / I of explicit drag.

    A composition is refused if a backward stage would have a drag number above 0.5.
    """
    method = Method(name)
    if method.linearly_implicit:
        return math.inf
    if method.tableau:
        numbers = np.arange(STEP, MOST, STEP)
        return first_unstable(numbers, np.abs(stability_polynomial(method.tableau, -numbers)))
    if method.base in FORCED:
        # Phi is explicit, (1 - x) v; Phi* implicit, v / (1 + x), but its iteration contracts by x, in Psi over h/2.
        return {"phi": 2.0, "phi_adjoint": CONTRACTION, "psi": 2.0 * CONTRACTION}[method.base]
    back = -min(0.0, *method.stages)
    return 0.5 / back if back else math.inf
