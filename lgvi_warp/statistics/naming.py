"""Names of statistics: numbers in them are spelled in one way, and each makes a word that xarray and NetCDF take."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

# A number that stands by itself: no index in brackets.
_NUMBER = re.compile(r"(?<![\w.\[])-?\d+(?:\.\d*)?(?:e[+-]?\d+)?(?![\w.\]])")
# Of a number or of its exponent: a hyphen between words is none.
_MINUS = re.compile(r"(?<!\w)-(?=[\d.])|(?<=\de)-(?=\d)")


def spelled(value: Any) -> str:
    """A number, or several, as names have them: 10 for 10.0, (2, -0.5) for [2.0, -0.5]; as many digits as it takes."""
    numbers = np.asarray(value, dtype=np.float64)
    texts = [repr(one + 0.0).removesuffix(".0") for one in numbers.ravel().tolist()]
    return texts[0] if len(texts) == 1 else f"({', '.join(texts)})"


def canonical(name: str) -> str:
    """A name with its numbers as `spelled`: "exceedance depth above 10" for "... above 10.0"."""
    return _NUMBER.sub(lambda found: spelled(float(found[0])), name)


def word(name: str) -> str:
    """A name as a variable's: "exceedance velocity[0] above -0.5" is exceedance_velocity_0_above_minus_0_5."""
    return re.sub(r"\W+", "_", _MINUS.sub(" minus ", name)).strip("_")


def free(name: str, variables: Callable[[str], Iterable[str]], taken: set[str]) -> str:
    """The name's word, with a number after it where one of its variables is taken; takes them."""
    first, number = word(name), 1
    found = first
    while taken & set(variables(found)):
        number += 1
        found = f"{first}_{number}"
    taken |= set(variables(found))
    return found
