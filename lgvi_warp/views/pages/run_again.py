# SPDX-License-Identifier: Apache-2.0
"""Instructions to repeat a run: its scene in the original text, and the command."""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Mapping
from typing import Any

from lgvi_warp.common.errors import MissingExtra, SceneError

# What a run has where neither its scene nor a script says otherwise.
DEFAULTS = {"dtype": "float64", "checks": "safe", "on_failure": "freeze"}


def how_to_run_again(provenance: Mapping[str, Any]) -> tuple[str | None, str, str]:
    """Write instructions to repeat a run: (command, or None if no file holds the scene; a remark; text of the scene file).

    The text is the original one, or else is made from the scene's tables. An ensemble from Python replaces the file's own.
    """
    scene, source = provenance["scene"], provenance.get("source", {})
    written = isinstance(source.get("text"), str)
    name, changes = (str(source["file"]), dict(source["changes"])) if written else ("scene.toml", {})
    ensemble = _given_ensemble(provenance)
    if any(law.get("type") == "callback" for law in scene.get("controller", {}).get("laws", ())):
        reason = "A law is a Python function, which no file holds"
    elif ensemble is not None and not _is_scene(with_ensemble := {**scene, "ensemble": ensemble}):
        reason = "The ensemble was given in Python, with numbers that no file holds"
    else:
        reason, remark = "", f"Save this scene as {name}, then:"
    text = source["text"] if written else ""
    if not reason and ensemble is not None:
        remark = f"The ensemble was given in Python: it stands here in place of the file's own. {remark}"
        changes = {key: value for key, value in changes.items() if not key.startswith("ensemble.")}
        text = _with_ensemble(text, ensemble) if written else toml_of(shortened(with_ensemble))
    text = text or toml_of(shortened(scene))
    if reason:
        return None, f"{reason}: run the script again. The scene but for it:", text
    sets = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    return shlex.join(["lgvi-warp", "run", name, *sets, *_given(provenance)]), remark, text


def _given_ensemble(provenance: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The [ensemble] section of a run, if it differs from the scene's own; else None."""
    had, of_scene = provenance.get("ensemble"), provenance["scene"].get("ensemble", {"members": 1, "seed": 0})
    if had is None or json.dumps(had, sort_keys=True) == json.dumps(
        {"members": had["members"]} | of_scene, sort_keys=True
    ):
        return None
    return dict(had)


def _is_scene(content: Mapping[str, Any]) -> bool:
    """Whether tables describe a valid scene."""
    from lgvi_warp.scene.scene import Scene

    try:
        Scene.from_dict(content)
    except SceneError:
        return False
    return True


def _with_ensemble(text: str, ensemble: Mapping[str, Any]) -> str:
    """Replace the section [ensemble] in the text of a scene file; the rest is unchanged."""
    toml = _tomlkit()
    document = toml.parse(text)
    if "ensemble" in document:
        document.remove("ensemble")
    return f"{toml.dumps(document).rstrip()}\n\n{toml.dumps({'ensemble': ensemble})}"


def _given(provenance: Mapping[str, Any]) -> list[str]:
    """Options for the settings of a run that differ from its scene's own settings."""
    settings, method = provenance["scene"].get("run", {}), provenance["method"]
    options = {
        "method": method["name"],
        "step": provenance["step"],
        "duration": provenance["step"] * provenance["steps"],
        "dtype": provenance["dtype"],
        "rtol": method.get("rtol"),
        "atol": method.get("atol"),
        "checks": provenance.get("checks"),
        "on_failure": provenance.get("on_failure"),
    }
    unsaid = {"method"} if method.get("chosen") else set()
    return [word for name, value in options.items()
            if value is not None and name not in unsaid and not _same(settings.get(name, DEFAULTS.get(name)), value)
            for word in (f"--{name.replace('_', '-')}", value if isinstance(value, str) else f"{value:.12g}")]  # fmt: skip


def _same(setting: Any, value: Any) -> bool:
    """Whether a setting of a scene has the value of the run."""
    if isinstance(value, str):
        return bool(setting == value)
    return isinstance(setting, int | float) and math.isclose(setting, value, rel_tol=1e-9)


def shortened(scene: Mapping[str, Any]) -> Mapping[str, Any]:
    """Replace the numbers of a vehicle by its name in the package, if the scene stays the same."""
    from lgvi_warp.scene.scene import Scene
    from lgvi_warp.vehicles.fossen import vehicle_names

    name = scene.get("vehicle", {}).get("title")
    if name not in vehicle_names():
        return scene
    known = Scene.named(name).to_dict()
    short = dict(scene)
    for section in ("vehicle", "environment"):
        changed = {key: value for key, value in scene[section].items() if known[section].get(key) != value}
        short[section] = {"name": name} | changed if section == "vehicle" else changed
    short["terms"] = [term for term in scene.get("terms", ()) if term not in known.get("terms", ())]
    short = {section: content for section, content in short.items() if content}
    try:
        return short if Scene.from_dict(short).to_dict() == scene else scene
    except SceneError:
        return scene


def toml_of(content: Mapping[str, Any]) -> str:
    """Content as the text of a TOML file."""
    return str(_tomlkit().dumps(content))


def _tomlkit() -> Any:
    """Load tomlkit. Raises ImportError if it is not installed."""
    try:
        import tomlkit
    except ModuleNotFoundError as error:
        raise MissingExtra("reports", "tomlkit", "viz") from error
    return tomlkit
