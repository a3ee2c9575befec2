# SPDX-License-Identifier: Apache-2.0
"""Series of the modified inertia for the preprocessed discrete Moser-Veselov rotation of order 8.

J~^-1 = (1 + s) J^-1 + d I, where s and d are polynomials in N = h^2 |pi|^2 / 2 and H = h^2 pi.J^-1 pi / 2. Their
coefficients are symmetric functions of the moments of inertia. Hairer & Vilmart (2006), J. Phys. A 39, 13225.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def fields(J: np.ndarray) -> dict[str, Any]:
    """Make the kernel's "inverse_J" (n, 3) and series "shrink" and "shift" {"c1": (n,), ...} from J (n, 3) [kg m^2]."""
    shrink, shift = series(J)
    return {
        "inverse_J": 1.0 / J,
        "shrink": {f"c{i}": value for i, value in enumerate(shrink, start=1)},
        "shift": {f"c{i}": value for i, value in enumerate(shift, start=1)},
    }


def series(J: np.ndarray) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Coefficients of the polynomials s and d for principal moments J (n, 3) [kg m^2], after Hairer & Vilmart (2006).

    Returns: (coefficients of s, of d), nine arrays (n,) each, in the order N, H; N^2, N H, H^2; N^3, N^2 H, N H^2, H^3.
    """
    e = J.prod(axis=1)

    def total(n: int, m: int = 0) -> np.ndarray:
        """Sum of I_i^n, or of (I_i^n + I_j^n) / I_k^m."""
        if m == 0:
            return np.asarray((J**n).sum(axis=1))
        return np.asarray(((np.roll(J, -1, axis=1) ** n + np.roll(J, 1, axis=1) ** n) / J**m).sum(axis=1))

    t1, t2, t3 = (total(n) for n in (1, 2, 3))
    i1, i2, i3 = (total(-n) for n in (1, 2, 3))
    r11, r12, r21 = (total(n, m) for n, m in ((1, 1), (1, 2), (2, 1)))
    shrink = [
        t1 / (6 * e),
        -i1 / 3,
        (t2 / e - i1) / (30 * e),
        (1 - r11) / (30 * e),
        (3 * t1 / e + 2 * i2) / 60,
        (4 * e + 17 * t3 - 15 * e * r11) / (2520 * e**3),
        (9 * t1 + 10 * e * i2 - 6 * r21) / (420 * e**2),
        ((6 * r12 - 100 * i1) * e + 53 * t2) / (2520 * e**2),
        (15 - e * i3 - 2 * r11) / (630 * e),
    ]
    shift = [
        -1 / (3 * e),
        t1 / (6 * e),
        -t1 / (60 * e**2),
        i1 / (10 * e) - t2 / (60 * e**2),
        -(9 + r11) / (60 * e),
        (34 * e * i1 - 19 * t2) / (2520 * e**3),
        (t3 + 2 * e * r11 - 85 * e) / (1260 * e**3),
        (47 * t1 + 13 * r21 - 38 * e * i2) / (2520 * e**2),
        (9 * e * i1 + e * r12 - 11 * t2) / (1260 * e**2),
    ]
    return shrink, shift
