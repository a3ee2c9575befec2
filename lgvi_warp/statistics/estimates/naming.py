# SPDX-License-Identifier: Apache-2.0
"""Names of statistics: a unique spelling of numbers, and names of variables for xarray and NetCDF."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

# A number that stands alone, not an index in brackets.
_NUMBER = re.compile(r"(?<![\w.\[])-?\d+(?:\.\d*)?(?:e[+-]?\d+)?(?![\w.\]])")
# Spaces beside commas and inside of brackets.
_SPACE = re.compile(r"(?<=[,(\[])\s+|\s+(?=[,)\]])")
# The minus sign of a number or of its exponent, not a hyphen between words.
_MINUS = re.compile(r"(?<!\w)-(?=[\d.])|(?<=\de)-(?=\d)")


def spelled(value: Any) -> str:
    """Return a number, or several, as spelled in names: 10 for 10.0, (2, -0.5) for [2.0, -0.5]; with all needed digits."""
    numbers = np.asarray(value, dtype=np.float64)
    texts = [repr(number + 0.0).removesuffix(".0") for number in numbers.ravel().tolist()]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def canonical(name: str) -> str:
    """Return the unique spelling of a name: "above 10" for "above 10.0", "attitude[0,1]" for "attitude[0, 1]"."""
    return _SPACE.sub("", _NUMBER.sub(lambda match: spelled(float(match[0])), name))


def word(name: str) -> str:
    """Return a variable's name: "exceedance velocity[0] above -0.5" becomes exceedance_velocity_0_above_minus_0_5."""
    return re.sub(r"\W+", "_", _MINUS.sub(" minus ", name)).strip("_")


def free(name: str, variables: Callable[[str], Iterable[str]], taken: set[str]) -> str:
    """Return the name's `word`, followed by a number if one of its variables already exists."""
    first, number = word(name), 1
    candidate = first
    while taken & set(variables(candidate)):
        number += 1
        candidate = f"{first}_{number}"
    taken |= set(variables(candidate))
    return candidate
