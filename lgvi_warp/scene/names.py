# SPDX-License-Identifier: Apache-2.0
"""Names by which a user refers to the numbers of a scene.

A name is a key of the scene file ("run.step"), or a name in `scene.parameters()` ("heading_pid.kp"). Either may have an
index. A part may be named by its place in its list: "controller.sensors[0].noise".
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.scene import variations
from lgvi_warp.scene.settings import EnsembleSettings, RunSettings
from lgvi_warp.scene.start import Environment
from lgvi_warp.scene.variations import Target

Value = TypeVar("Value")
# Lists of parts; and a part by its place in one of them.
LISTS = ("terms", "events", "controller.sensors", "controller.guidance", "controller.laws", "controller.allocation",
         "controller.faults")  # fmt: skip
PLACE = re.compile(rf"({'|'.join(map(re.escape, LISTS))})\[(\d+)\](?=\.)")


def file_keys() -> list[str]:
    """Keys of a scene file that are not names of numbers in every scene, for messages."""
    kinds: dict[str, Any] = {"environment": Environment, "ensemble": EnsembleSettings, "run": RunSettings}
    return [f"{section}.{item.name}" for section, kind in kinds.items() for item in fields(kind)]


def by_key(scene: Any, name: str) -> str:
    """The name of a number, with the part's key in place of the part's index in its list."""

    def key(match: re.Match[str]) -> str:
        owner, _, section = match[1].rpartition(".")
        parts: Sequence[Any] = getattr(scene.controller if owner else scene, section, ())
        return parts[int(match[2])].key if int(match[2]) < len(parts) else match[0]

    return PLACE.sub(key, name) if isinstance(name, str) else name


def all_by_key(argument: str, scene: Any, values: Mapping[str, Value]) -> dict[str, Value]:
    """The values with names as in `by_key`. Raises SceneError if two names refer to the same number."""
    keyed: dict[str, Value] = {}
    for name, value in values.items():
        key = by_key(scene, name)
        if key in keyed:
            raise refusal(f'{argument}"{name}"', value, "is varied under another name as well", "keep one of them")
        keyed[key] = value
    return keyed


def numbers_of(scene: Any) -> dict[str, np.ndarray]:
    """Every number of a scene that may vary."""
    return scene.parameters() | {f"start.{key}": value for key, value in scene.start.given().items()}


def single_number(scene: Any, name: str, argument: str = "vary") -> tuple[Target, float]:
    """Resolve the name of a single number to its target and value; argument: name of the argument in error messages."""
    (target,) = variations.targets(by_key(scene, name))
    known, faults = numbers_of(scene), Faults(f"{argument}.")
    if variations.known_target(faults, name, "...", target, known) and (ndim := target.of(known[target.name]).ndim):
        entry = f"{name}[{','.join('0' * ndim)}]"
        faults.add(f'"{name}"', "...", "is not a single number", f'name its entries, such as "{entry}"')
    faults.raise_if_any()
    return target, float(target.of(known[target.name]))
