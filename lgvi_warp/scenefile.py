"""The scene file: TOML in, Scene out, every fault of every section in one message."""

from __future__ import annotations

import inspect
import os
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.errors import Faults, SceneError, shown
from lgvi_warp.laws import from_dict as law_from_dict
from lgvi_warp.reading import file_text
from lgvi_warp.scene import EnsembleSettings, Environment, RunSettings, Scene, Start
from lgvi_warp.toml_text import parsed
from lgvi_warp.vehicle import Vehicle

SECTIONS = ("vehicle", "environment", "start", "ensemble", "run", "terms", "events", "controller", "source")


def load(path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Scene:
    """Read a scene file; overrides (dotted key -> value) replace what it says. Raises SceneError naming every fault."""
    text = file_text(path, "scene file")
    return loads(text, overrides, os.fspath(path), Path(path).parent)


def loads(
    text: str, overrides: Mapping[str, Any] | None = None, name: str = "scene", folder: Path | None = None
) -> Scene:
    """The same from a text. folder: where the files that it names are looked for, by default the current one."""
    content = parsed(text, name)
    for key, value in (overrides or {}).items():
        override(content, key, value)
    return from_dict(_files_in(folder, content) if folder else content)


def _files_in(folder: Path, content: dict[str, Any]) -> dict[str, Any]:
    """The same with the file of a table of members in that folder, where its path is relative."""
    try:
        ensemble = content["ensemble"]
        sampling = ensemble["sampling"]
        table = sampling["table"]
        known = isinstance(table["file"], str)
    except (KeyError, TypeError):
        return content
    if not known:
        return content
    table = table | {"file": os.fspath(folder / table["file"])}
    return content | {"ensemble": ensemble | {"sampling": sampling | {"table": table}}}


def override(content: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, such as vehicle.mass or ensemble.members; a text is read as TOML if it is TOML."""
    if isinstance(value, str):
        value = _value_of(key, value)
    section, _, rest = key.partition(".")
    if not rest:
        raise SceneError([f"{key}: is not a dotted key; write section.key=value, such as vehicle.mass=120"])
    table = content.setdefault(section, {})
    if section == "ensemble" and rest.startswith("vary.") and isinstance(table, dict):
        table, rest = table.setdefault("vary", {}), rest.removeprefix("vary.").strip("\"'")
    if not isinstance(table, dict):
        raise SceneError([f"{key}: {section} is not a table; write section.key=value"])
    table[rest] = value


def _value_of(key: str, text: str) -> Any:
    """What a text says as a TOML value; itself if it is none. Raises SceneError where it says more than one value."""
    try:
        content = parsed(f"value = {text}", key)
    except SceneError as error:
        if not isinstance(error.__cause__, tomllib.TOMLDecodeError):
            raise SceneError((key + one.removeprefix("value") for one in error.faults), error.more) from None
        if "\n" not in text.strip():
            return text
        content = {}
    if len(content) != 1:
        raise SceneError(
            [f"{key} = {shown(text)}: is not one value; write one value on one line, and --set once for each key"]
        )
    return content["value"]


def from_dict(content: Mapping[str, Any]) -> Scene:
    """A Scene from the tables of a scene file. Raises SceneError naming every fault."""
    content = with_named_vehicle(content)
    faults = Faults()
    faults.keys("", content, SECTIONS)
    tables: dict[str, Any] = {}
    for name in SECTIONS[:5]:
        tables[name] = content.get(name, {})
        if not isinstance(tables[name], Mapping):
            faults.add(name, tables[name], "is not a table", f"write [{name}] and its keys below")
            tables[name] = {}
    if not tables["vehicle"] and isinstance(content.get("vehicle", {}), Mapping):
        faults.add("vehicle", "", "is missing", "write [vehicle] with mass and inertia")
    vehicle = _build(faults, "vehicle", Vehicle, tables["vehicle"]) if tables["vehicle"] else None
    environment = _build(faults, "environment", Environment, tables["environment"])
    start = _build(faults, "start", Start, tables["start"])
    run = _build(faults, "run", RunSettings, tables["run"])
    laws = _laws(faults, tables["ensemble"].get("vary", {}))
    settings = _build(faults, "ensemble", EnsembleSettings, {**tables["ensemble"], "vary": laws})
    scene = None
    with faults.including():
        # Another stands in for a section that failed, so that the faults of the rest are found as well.
        scene = Scene(
            vehicle or Vehicle(**_STAND_INS), environment or Environment(), content.get("terms", ()), start or Start(),
            content.get("controller"), run or RunSettings(), settings if tables["ensemble"] else None,
            content.get("events", ()),
        )  # fmt: skip
    with faults.including():
        if scene is None:
            # What varies of a term that has a fault itself cannot be told: the names of the rest are looked at.
            sections = ("vehicle.", "environment.", "start.")
            laws = {name: law for name, law in laws.items() if str(name).startswith(sections)}
            settings = EnsembleSettings(vary=laws)
        whole = scene if vehicle and environment and start else None
        names = (scene or Scene(vehicle or Vehicle(**_STAND_INS))).parameters()
        _check_ensemble(settings or EnsembleSettings(vary=laws), whole, tuple(names))
    faults.raise_if_any()
    assert scene is not None
    return scene


def with_named_vehicle(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """The same with what [vehicle] name = "remus_100" stands for: that vehicle, its terms and the water it was given for.

    Keys beside the name replace the vehicle's own, a term of the same name or type replaces its term. Raises SceneError.
    """
    table = content.get("vehicle")
    if not isinstance(table, Mapping) or "name" not in table:
        return content
    from lgvi_warp.coefficients import vehicle_file

    known = tomllib.loads(vehicle_file(str(table["name"])).read_text(encoding="utf-8"))
    merged = dict(content)
    for section in ("vehicle", "environment"):
        own = content.get(section, {})
        if isinstance(own, Mapping):
            merged[section] = known.get(section, {}) | {key: value for key, value in own.items() if key != "name"}
    terms = content.get("terms", [])
    if isinstance(terms, list | tuple):
        names = {_name_of(term) for term in terms}
        merged["terms"] = [term for term in known.get("terms", []) if _name_of(term) not in names] + list(terms)
    return merged


def _name_of(term: Any) -> Any:
    """What a term is called by: its name, or its type."""
    if isinstance(term, Mapping):
        return term.get("name") or term.get("type")
    return getattr(term, "key", None)


def _check_ensemble(settings: EnsembleSettings, scene: Scene | None, parameters: Sequence[str]) -> None:
    """What varies must fit the scene: found here, before anything runs. Names alone if the scene has faults itself."""
    from lgvi_warp.ensemble import Ensemble, check_names

    if scene is None:
        check_names(settings.vary, parameters)
    else:
        try:
            Ensemble.of(scene, settings)
        except MemoryError:
            raise SceneError([f"ensemble.members = {settings.members}: do not fit into memory; give less"]) from None


def _build(faults: Faults, name: str, kind: Callable[..., Any], table: Mapping[str, Any]) -> Any:
    """Construct a section's object, or note what is wrong with it."""
    signature = [key for key in inspect.signature(kind).parameters]
    faults.keys(name, table, signature)
    known = {key: value for key, value in table.items() if key in signature}
    with faults.including():
        return kind(**known)
    return None


_STAND_INS: dict[str, Any] = {"mass": 1.0, "inertia": (1.0, 1.0, 1.0)}


def _laws(faults: Faults, vary: Any) -> dict[str, Any]:
    """The distributions of the [ensemble.vary] table."""
    laws = {}
    if not isinstance(vary, Mapping):
        faults.add("ensemble.vary", vary, "is not a table", 'write [ensemble.vary] and "vehicle.mass" = {...} below')
        vary = {}
    for key, value in vary.items():
        with faults.including():
            laws[key] = law_from_dict(f'ensemble.vary."{key}"', value)
    return laws
