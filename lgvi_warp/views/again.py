# SPDX-License-Identifier: Apache-2.0
"""How to run a run again: its scene as it was written, and the command."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from typing import Any

from lgvi_warp.common.errors import MissingExtra, SceneError


def again(provenance: Mapping[str, Any]) -> tuple[str, str | None, str]:
    """Say how to run a run again.

    Args:
        provenance: That of the run.

    Returns:
        The name of the scene file, the command, and the text of the file: as it was written, else of the scene's tables. The
        command is None where a law is a Python function, which no file holds.

    Raises:
        ImportError: The scene is of no file, and tomlkit is not installed (extra: viz).
    """
    scene, source = provenance["scene"], provenance.get("source", {})
    written = isinstance(source.get("text"), str)
    name, changes = (str(source["file"]), dict(source["changes"])) if written else ("scene.toml", {})
    text = source["text"] if written else toml_of(shortened(scene))
    if any(law.get("type") == "callback" for law in scene.get("controller", {}).get("laws", ())):
        return name, None, text
    sets = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    return name, shlex.join(["lgvi-warp", "run", name, *sets, *_given(provenance)]), text


def _given(provenance: Mapping[str, Any]) -> list[str]:
    """Options for what a run was given in place of its scene's own settings."""
    settings, duration = provenance["scene"].get("run", {}), provenance["step"] * provenance["steps"]
    options = {
        "method": provenance["method"]["name"],
        "step": provenance["step"],
        "duration": duration,
        "dtype": provenance["dtype"],
    }
    chosen = {"method"} if provenance["method"].get("chosen") else set()
    return [word for name, value in options.items() if name not in chosen and not _same(settings.get(name), value)
            for word in (f"--{name}", value if isinstance(value, str) else f"{value:.12g}")]  # fmt: skip


def _same(setting: Any, value: Any) -> bool:
    """Whether a setting of a scene is what a run had; one that is not given is the default of a precision alone."""
    if isinstance(value, str):
        return setting == value or (setting is None and value == "float64")
    return isinstance(setting, int | float) and math.isclose(setting, value, rel_tol=1e-9)


def shortened(scene: Mapping[str, Any]) -> Mapping[str, Any]:
    """Name a vehicle of the package in place of its numbers, where that is the same scene.

    Args:
        scene: Tables of a scene.

    Returns:
        Tables of the same scene, with the numbers that differ from the vehicle's own alone.
    """
    from lgvi_warp.scene.scene import Scene
    from lgvi_warp.scene.vehicles.fossen import vehicles

    name = scene.get("vehicle", {}).get("title")
    if name not in vehicles():
        return scene
    known = Scene.named(name).to_dict()
    short = dict(scene)
    for section in ("vehicle", "environment"):
        own = {key: value for key, value in scene[section].items() if known[section].get(key) != value}
        short[section] = {"name": name} | own if section == "vehicle" else own
    short["terms"] = [term for term in scene.get("terms", ()) if term not in known.get("terms", ())]
    short = {section: content for section, content in short.items() if content}
    try:
        return short if Scene.from_dict(short).to_dict() == scene else scene
    except SceneError:
        return scene


def toml_of(content: Mapping[str, Any]) -> str:
    """Content as the text of a TOML file.

    Args:
        content: Tables of plain types, such as the scene of a provenance.

    Returns:
        The text.

    Raises:
        ImportError: tomlkit is not installed (extra: viz).
    """
    try:
        import tomlkit
    except ModuleNotFoundError as error:
        raise MissingExtra("reports", "tomlkit", "viz") from error
    return str(tomlkit.dumps(content))
