"""The scene file: a path or a text in, tables out, with what replaces them and the vehicle that they name."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from lgvi_warp.common.errors import SceneError, shown
from lgvi_warp.common.reading import file_text
from lgvi_warp.common.toml_text import parsed


def tables_of_file(path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """The tables of a scene file; overrides (dotted key -> value) replace what it says. Raises SceneError."""
    text = file_text(path, "scene file")
    return tables_of_text(text, overrides, os.fspath(path), Path(path).parent)


def tables_of_text(
    text: str, overrides: Mapping[str, Any] | None = None, name: str = "scene", folder: Path | None = None
) -> dict[str, Any]:
    """The same from a text. folder: where the files that it names are looked for, by default the current one."""
    content = parsed(text, name)
    for key, value in (overrides or {}).items():
        override(content, key, value)
    return _files_in(folder, content) if folder else content


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


def with_named_vehicle(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """The same with what [vehicle] name = "remus_100" stands for: that vehicle, its terms and the water it was given for.

    Keys beside the name replace the vehicle's own, a term of the same name or type replaces its term. Raises SceneError.
    """
    table = content.get("vehicle")
    if not isinstance(table, Mapping) or "name" not in table:
        return content
    from lgvi_warp.scene.vehicles.fossen import vehicle_file

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
