# SPDX-License-Identifier: Apache-2.0
"""A scene with other numbers, which are named as for variations."""

from __future__ import annotations

import keyword
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from lgvi_warp.common.arguments import mapping_of
from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.control.base import SECTIONS
from lgvi_warp.scene import variations
from lgvi_warp.scene.names import by_key
from lgvi_warp.scene.start import NAMES

SceneT = TypeVar("SceneT", bound=Any)
# Numbers of a scene that are no parameters of members, and that are set all the same.
SETTINGS = ("controller.period", "run.step", "run.duration")


def with_numbers(scene: SceneT, numbers: Mapping[str, Any], keys: Sequence[str] = ()) -> SceneT:
    """Return a scene with other numbers, by the names of `Scene.with_numbers`.

    keys: Names that messages suggest in addition to those of numbers.
    """
    base, faults, taken = scene.parameters(), Faults(), []
    changes: dict[str, dict[str, Any]] = {}
    known = (*base, *SETTINGS, *(f"start.{entry}" for entry in NAMES))
    for name, value in mapping_of("numbers", numbers, "names to numbers").items():
        target, *others = variations.targets(by_key(scene, name))
        key, _, attribute = target.name.rpartition(".")
        if others or target.name not in known:
            problem = "is not a number of this scene" + " and no key of its file" * bool(keys)
            faults.add(f'"{name}"', value, problem, closest(target.name, dict.fromkeys((*known, *keys))))
            continue
        taken.append((name, (target,)))
        attribute += "_" * keyword.iskeyword(attribute)
        place = changes.setdefault(key, {})
        if target.index is None:
            place[attribute] = value
            continue
        start = _of_start(scene, attribute) if key == "start" else base[target.name]
        array = np.array(place.get(attribute, start), dtype=np.float64)
        try:
            array[target.index] = value
            if target.name in variations.MATRICES:
                array[target.index[::-1]] = value
        except (IndexError, ValueError, TypeError):
            faults.add(
                f'"{name}"',
                value,
                f"is not a number of {target.name}, of shape {array.shape}",
                "give an existing one",
            )
            continue
        place[attribute] = array
    variations.clashes(faults, taken, "set")
    faults.raise_if_any()
    return _changed(scene, changes)


def _of_start(scene: Any, name: str) -> Any:
    """A number of the start; None if the start is given by other quantities."""
    return scene.start.geodetic if name == "geodetic" else scene.start.given().get(name)


def _changed(scene: SceneT, changes: Mapping[str, Mapping[str, Any]]) -> SceneT:
    """The scene with other values of fields, given as {key of a part: {field: value}}."""
    if not changes:
        return scene

    def part(entry: Any) -> Any:
        return entry.with_fields(changes[entry.key]) if entry.key in changes else entry

    sections: dict[str, Any] = {name: replace(getattr(scene, name), **changes[name])
                for name in ("vehicle", "environment", "run") if name in changes}  # fmt: skip
    if "start" in changes:
        sections["start"] = scene.start.with_fields(changes["start"])
    controller = scene.controller
    if controller is not None:
        lists = {section: tuple(map(part, getattr(controller, section))) for section in SECTIONS}
        controller = replace(controller, **lists, **changes.get("controller", {}))
    sections |= {name: tuple(map(part, getattr(scene, name))) for name in ("terms", "events")}
    return replace(scene, **sections, controller=controller)
