# SPDX-License-Identifier: Apache-2.0
"""Words of pictures: names and units of quantities, the members drawn of all, floors, and what a reader has to know."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from lgvi_warp.common.errors import SceneError
from lgvi_warp.statistics.values.functional import quantity
from lgvi_warp.statistics.values.quantity import Quantity
from lgvi_warp.views.choice import of_members
from lgvi_warp.views.fleet import members_of_run
from lgvi_warp.views.sea_floor import flat_depths

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

DEPTHS = ("depth", "position[2]")
WORDS = {
    "position[0]": "north",
    "position[1]": "east",
    "position[2]": "depth",
    "velocity_inertial[0]": "velocity north",
    "velocity_inertial[1]": "velocity east",
    "velocity_inertial[2]": "velocity down",
    "energy": "E(t)",
    "energy error": "E(t) - E(0)",
    "euler[0]": "roll",
    "euler[1]": "pitch",
    "euler[2]": "yaw",
}
COMPONENT = re.compile(r"(?<![.\w])[a-z_]+\[\d\]")
HINT = "only start and end were kept: SaveAt(every=...) keeps the motion between them"


def label_of(of: Quantity) -> str:
    """Label of an axis, as "speed [m/s]"; depths say that they point down."""
    name = WORDS.get(of.name, of.name.replace("_", " "))
    unit = f" [{of.unit}]" if of.unit else ""
    return f"{name}{unit}, down" if is_depth(of) else f"{name}{unit}"


def in_words(text: str) -> str:
    """Say components by their names: "max(position[1])" is "max(east)"."""
    return COMPONENT.sub(lambda match: WORDS.get(match[0], match[0]), text)


def is_depth(of: Quantity) -> bool:
    """Tell whether a quantity is a depth, which is drawn downwards."""
    return of.name in DEPTHS


def floors(result: Result) -> dict[str, list[float]]:
    """Depths of the scene's flat floors [m], by the word for them."""
    return {"floor": flat_depths(result.provenance["scene"])}


def floors_of_each(results: Mapping[str, Result]) -> dict[str, list[float]]:
    """Depths of the floors of several scenes [m]; where these differ, by words that name the run."""
    each = {label: floors(result) for label, result in results.items()}
    first = next(iter(each.values()))
    if all(depths == first for depths in each.values()):
        return first
    return {f"floor\nof {label}": depths["floor"] for label, depths in each.items()}


def events(result: Result) -> list[dict[str, Any]]:
    """Tables of the scene's events."""
    return list(result.provenance["scene"].get("events", ()))


def some_of(result: Result, drawn: int) -> str:
    """Say how many members are drawn of how many of the run."""
    return of_members(drawn, members_of_run(result))


def unit_of(label: str) -> str:
    """Find the unit of a quantity by its name."""
    try:
        return quantity("of", label).unit
    except SceneError:
        return ""
