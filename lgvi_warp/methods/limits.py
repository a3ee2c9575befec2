"""How large a step each method bears: limits of stability measured by method, or computed.

Limits are in h times the angular frequency of an oscillation (`python -m benchmarks table warning_limits` finds them): the
fastest one whose amplitude stays bounded, for the Munk moment with M = (1, 100, 100) and 0.3 rad, and for the restoring
moment of a sphere and 0.3 rad.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping

import numpy as np

from lgvi_warp.methods.method import Method

# Largest h |Omega| at which methods that turn about the axes are still accurate.
TURNS = 1.0

# Method or composition -> largest stable h w. Gauss collocation has no entry: a status reports where its iteration fails.
MUNK: dict[str, float] = {
    "phi": 1.41, "phi_adjoint": 1.41, "psi": 1.52, "psi_s": 2.14, "psi_1": 2.00, "psi_x": 2.19, "psi_x8": 2.19,
    "psi_w": 2.14, "rk4": 2.44, "rk5": 2.22, "rk8": 2.65, "cg3": 1.69, "rkmk4": 2.44, "rkn4_6": 4.76,
    "rkn6_11": 6.38, "rkn6_14": 9.41, "tj4(psi_s)": 1.60, "tj4(psi_x)": 1.58, "su4(psi_s)": 2.92, "su4(psi_x)": 2.94,
    "kl6(psi_s)": 2.71, "kl6(psi_x)": 3.03, "kl8(psi_s)": 3.35, "kl8(psi_x)": 3.98, "yo6(psi_s)": 2.48,
    "yo6(psi_x)": 2.56, "ss6_11(psi_s)": 3.08, "ss6_11(psi_x)": 3.16, "ss6_13(psi_s)": 4.47, "ss6_13(psi_x)": 4.60,
    "su8_15(psi_s)": 3.05, "su8_15(psi_x)": 3.03, "ss8_21(psi_s)": 6.08, "ss8_21(psi_x)": 6.06, "bm4(psi_s)": 5.42,
    "bm4(psi_x)": 5.87, "bm6(psi_s)": 3.13, "bm6(psi_x)": 5.61,
}  # fmt: skip
RESTORING: dict[str, float] = {
    "phi": 1.69, "phi_adjoint": 1.69, "psi": 1.95, "psi_s": 1.95, "psi_1": 1.95, "psi_x": 2.05, "psi_x8": 2.05,
    "psi_w": 1.95, "rk4": 2.55, "rk5": 2.17, "rk8": 4.51, "cg3": 1.99, "rkmk4": 3.23, "rkn4_6": 4.55,
    "rkn6_11": 8.18, "rkn6_14": 8.88, "tj4(psi_s)": 1.44, "tj4(psi_x)": 1.78, "su4(psi_s)": 2.80, "su4(psi_x)": 2.83,
    "kl6(psi_s)": 2.53, "kl6(psi_x)": 3.44, "kl8(psi_s)": 4.87, "kl8(psi_x)": 4.20, "yo6(psi_s)": 1.91,
    "yo6(psi_x)": 2.77, "ss6_11(psi_s)": 4.25, "ss6_11(psi_x)": 4.34, "ss6_13(psi_s)": 4.90, "ss6_13(psi_x)": 4.95,
    "su8_15(psi_s)": 2.76, "su8_15(psi_x)": 3.02, "ss8_21(psi_s)": 5.24, "ss8_21(psi_x)": 5.42, "bm4(psi_s)": 4.09,
    "bm4(psi_x)": 5.84, "bm6(psi_s)": 2.99, "bm6(psi_x)": 5.60,
}  # fmt: skip


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
