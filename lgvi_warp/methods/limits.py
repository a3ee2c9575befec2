"""How large a step each method bears: limits of stability measured by method, or computed.

Limits are in h times the angular frequency of an oscillation (`python -m benchmarks table warning_limits` writes them): the
fastest one whose amplitude stays bounded, for the Munk moment with M = (1, 100, 100) and 0.3 rad, and for the restoring
moment of a sphere and 0.3 rad.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lgvi_warp.methods.method import Method

# Largest h |Omega| at which methods that turn about the axes are still accurate.
TURNS = 1.0

# The rows (method, largest stable h w of the Munk moment, and of the restoring moment) of methods and compositions. Gauss
# collocation has none: a status reports where its iteration fails.
STABLE_STEPS = Path(__file__).with_name("stable_steps.csv")
_ROWS = [line.split(",") for line in STABLE_STEPS.read_text().splitlines()[1:]]
MUNK = {method: float(munk) for method, munk, _ in _ROWS}
RESTORING = {method: float(restoring) for method, _, restoring in _ROWS}


def longest_stage(method: Method) -> float:
    """Length of a method's longest stage, forward or backward.

    Args:
        method: The method.

    Returns:
        The length in steps.
    """
    return max(abs(length) for length in method.lengths(None)[0])


def oscillation_limit(method: Method, table: Mapping[str, float]) -> float:
    """Largest stable h w of a method for an oscillation of angular frequency w.

    Args:
        method: The method.
        table: Measured limits by name, MUNK or RESTORING.

    Returns:
        The limit [rad]: measured, or for a composition that was not measured, that of its base divided by the longest
        stage. Infinite where a status reports the failure instead.
    """
    if method.gauss or method.adaptive:
        # A status reports where the iteration of the stages, or the step control, fails.
        return np.inf
    match = re.fullmatch(r"(\w+)\((\w+)\)", method.name)
    if match is None:
        return table[method.name]
    return table.get(method.name, table[match[2]] / longest_stage(method))


@functools.cache
def imaginary_limit(name: str) -> float:
    """Largest y with |R(iy)| <= 1, R the stability function of an explicit method: h |Omega| of a steady spin.

    Args:
        name: Name of an explicit method.

    Returns:
        The limit [rad].
    """
    tableau = Method(name).tableau
    assert tableau is not None
    n = len(tableau.b)
    A = np.array([(*row[:n], *(0.0,) * (n - len(row))) for row in tableau.a[:n]])
    y = 1j * np.linspace(0.001, 12.0, 12_000)
    stages = np.linalg.solve(np.eye(n) - y[:, None, None] * A, np.ones((len(y), n, 1)))[..., 0]
    return float(abs(y[np.argmax(np.abs(1.0 + y * (stages @ np.array(tableau.b))) > 1.0 + 1e-9)]))


def rotation_limit(method: Method) -> float:
    """Largest h |Omega| of a method that has no status for it.

    Args:
        method: The method.

    Returns:
        The limit [rad]; infinite for a method whose status reports a step that is too large.
    """
    if method.adaptive:
        return np.inf
    if method.turns:
        return TURNS / longest_stage(method)
    return imaginary_limit(method.name) if method.tableau else np.inf
