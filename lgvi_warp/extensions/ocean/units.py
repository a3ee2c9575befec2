# SPDX-License-Identifier: Apache-2.0
"""Units of data sets, with their factors to SI units."""

from __future__ import annotations

import re
from typing import Any

from lgvi_warp.common.errors import refusal

# By what is measured: units in lower case, without spaces, as `_plain` writes them.
UNITS = {
    "m/s": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001, "dm/s": 0.1, "km/h": 1 / 3.6, "knot": 1852 / 3600, "kt": 1852 / 3600},
    "m": {"m": 1.0, "km": 1000.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "ft": 0.3048, "feet": 0.3048},
    "s": {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86400.0},
}  # fmt: skip
PREFIXES = {"centi": "c", "milli": "m", "deci": "d", "kilo": "k"}
WORDS = ((r"\b(centi|milli|deci|kilo|)met(?:er|re)s?\b", lambda match: PREFIXES.get(match[1], "") + "m"),
         (r"\bseconds?\b|\bsecs?\b", "s"), (r"\bminutes?\b|\bmins\b", "min"), (r"\bhours?\b|\bhrs?\b", "h"),
         (r"\bdays?\b", "d"), (r"\bknots\b", "knot"))  # fmt: skip
# A direction that some writers put behind the unit: "meters, positive up".
POSITIVE = re.compile(r"[,;(\s]*positive\s*[:=]?\s*(up|down)(?:ward)?s?\)?\s*$", re.IGNORECASE)


def factor(where: str, text: Any, unit: str) -> float:
    """Factor from a variable's unit to "m/s", "m" or "s"."""
    known = UNITS[unit]
    if text is None or not str(text).strip():
        remedy = f"write the attribute units, {unit!r} for instance, or give attributes = {{'{where}.units': {unit!r}}}"
        raise refusal(f"{where}.units", "", "is missing", remedy)
    value = known.get(_plain(str(text)))
    if value is None:
        raise refusal(
            f"{where}.units", text, f"is not a unit of {unit}", f"convert it, and write one of {', '.join(known)}"
        )
    return value


def positive(attributes: Any) -> str:
    """Direction in which numbers grow, "up" or "down", from the attribute `positive` or after the unit; "" if absent."""
    behind = POSITIVE.search(str(attributes.get("units", "")))
    return str(attributes.get("positive", behind[1] if behind else "")).strip().lower()


def _plain(text: str) -> str:
    """A unit as written in the table: "meters second-1", "m s**-1" and "m.s^-1" become "m/s"."""
    plain = POSITIVE.sub("", text).strip().lower().replace("**", "").replace("_", " ").replace(" per ", "/")
    plain = re.sub(r"[\^{}]", "", plain)
    for word, letter in WORDS:
        plain = re.sub(word, letter, plain)
    plain = re.sub(r"[.*\s]+", " ", plain)
    return re.sub(r" ?([sh]) ?-1$", r"/\1", plain).replace(" ", "")
