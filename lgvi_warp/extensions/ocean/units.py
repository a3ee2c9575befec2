# SPDX-License-Identifier: Apache-2.0
"""Units of data sets: how much of the SI unit each of them is."""

from __future__ import annotations

import re
from typing import Any

from lgvi_warp.common.errors import refusal

# By what is measured: units in lower case, without spaces, as `_plain` writes them.
UNITS = {
    "m/s": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001, "dm/s": 0.1, "km/h": 1 / 3.6, "knot": 1852 / 3600, "kt": 1852 / 3600},
    "m": {"m": 1.0, "km": 1000.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "feet": 0.3048},
}  # fmt: skip
WORDS = ((r"\bmet(?:er|re)s?\b", "m"), (r"\bseconds?\b|\bsec\b", "s"), (r"\bhours?\b", "h"), (r"\bknots\b", "knot"))


def factor(where: str, text: Any, unit: str) -> float:
    """Size of a variable's unit in "m/s" or "m"."""
    known = UNITS[unit]
    if text is None or not str(text).strip():
        raise refusal(f"{where}.units", "", "is missing", f"write the attribute units, {unit!r} for instance")
    value = known.get(_plain(str(text)))
    if value is None:
        raise refusal(
            f"{where}.units", text, f"is not a unit of {unit}", f"convert it, and write one of {', '.join(known)}"
        )
    return value


def _plain(text: str) -> str:
    """A unit as the table has it: "meters second-1", "m s**-1" and "m.s^-1" are "m/s"."""
    plain = text.strip().lower().replace("**", "").replace("^", "").replace("_", " ").replace(" per ", "/")
    for word, letter in WORDS:
        plain = re.sub(word, letter, plain)
    plain = re.sub(r"[.*\s]+", " ", plain)
    return re.sub(r" ?([sh]) ?-1$", r"/\1", plain).replace(" ", "")
