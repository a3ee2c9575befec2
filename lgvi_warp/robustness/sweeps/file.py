# SPDX-License-Identifier: Apache-2.0
"""SWEEP.toml: the arguments of `sweep` as a file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lgvi_warp.common.errors import Faults, SceneError, refusal
from lgvi_warp.common.reading import file_text
from lgvi_warp.common.toml_text import parsed
from lgvi_warp.sampling.distributions.named import from_dict as distribution_of
from lgvi_warp.scene.examples import located
from lgvi_warp.scene.file import tables_of_file
from lgvi_warp.scene.scene import Scene

KEYS = ("scene", "members", "seed", "sampling", "confidence", "interval", "vary", "cases", "grid", "metrics", "success",
        "compare", "run", "rare")  # fmt: skip
# Keys of [compare]; keys of [run], and the arguments that they are.
COMPARE = ("baseline", "matters")
RUN = {"method": "method", "step": "h", "duration": "t1", "dtype": "dtype"}


def arguments_of_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the arguments of `sweep` from a sweep file (TOML); paths in it are relative to its folder."""
    path = located(path)
    content = parsed(file_text(path, "sweep file"), os.fspath(path))
    folder, faults = Path(path).parent, Faults()
    faults.keys("", content, KEYS)
    if not isinstance(content.get("scene"), str):
        remedy = 'write scene = "remus_autopilot.toml"'
        faults.add("scene", content.get("scene", ""), "is not a path of a scene file", remedy)
    for name, kind in (("vary", Mapping), ("grid", Mapping), ("compare", Mapping), ("run", Mapping), ("cases", list),
                       ("metrics", list)):  # fmt: skip
        if not isinstance(content.get(name, kind() if kind is list else {}), kind):
            faults.add(name, content[name], "is not a list" if kind is list else "is not a table", f"see {KEYS_PAGE}")
    faults.raise_if_any()
    faults.keys("compare", content.get("compare", {}), COMPARE)
    faults.keys("run", content.get("run", {}), RUN)
    arguments = {
        name: content[name] for name in KEYS[1:] if name in content and name not in ("compare", "run", "vary", "cases")
    }
    arguments |= {RUN[name]: value for name, value in content.get("run", {}).items() if name in RUN}
    arguments |= {name: value for name, value in content.get("compare", {}).items() if name in COMPARE}
    scene_path: Any = None
    with faults.including():
        scene_path = located(content["scene"], folder)
        arguments["scene"] = Scene.load(scene_path)
    vary = {}
    for key, value in content.get("vary", {}).items():
        with faults.including():
            vary[key] = distribution_of(f'vary."{key}"', value)
    cases = []
    for entry in content.get("cases", []):
        with faults.including():
            cases.append(_case(entry, folder, scene_path))
    faults.raise_if_any()
    return arguments | ({"vary": vary} if vary else {}) | ({"cases": cases} if cases else {})


KEYS_PAGE = "docs/guide/is_my_controller_robust.md"


def _case(entry: Any, folder: Path, scene_path: Path) -> Any:
    """The table of a case, with its scene and its vehicle as objects."""
    if not isinstance(entry, Mapping):
        raise refusal("cases", entry, "is not a table", 'write [[cases]] and name = "pid" below')
    case = dict(entry)
    scene = case.get("scene")
    if scene is not None and not isinstance(scene, str):
        raise refusal("cases.scene", scene, "is not a path of a scene file", 'write scene = "other.toml"')
    path = scene_path if scene is None else located(scene, folder)
    vehicle = case.get("vehicle")
    try:
        if isinstance(vehicle, Mapping) and "name" in vehicle:
            # A vehicle by its name brings terms of its own.
            case["scene"] = Scene.from_dict({**tables_of_file(path), "vehicle": vehicle})
            del case["vehicle"]
        elif scene is not None:
            case["scene"] = Scene.load(path)
    except SceneError as error:
        raise error.prefixed(f"case {case.get('name')!r}: ") from None
    return case
