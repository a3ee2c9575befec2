# SPDX-License-Identifier: Apache-2.0
"""Scene files: conversion of a path or a text to tables, with overrides applied and a named vehicle inserted."""

from __future__ import annotations

import contextlib
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import mapping_of, path_of
from lgvi_warp.common.errors import Faults, SceneError, among, refusal
from lgvi_warp.common.reading import file_text
from lgvi_warp.common.safe_files import inside
from lgvi_warp.common.toml_text import parsed
from lgvi_warp.scene.variations import Target, clashes, targets

# Sections that are one table each.
TABLES = ("vehicle", "environment", "start", "ensemble", "run", "controller", "source")


def tables_of_file(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the tables of a scene file (TOML)."""
    return tables_of_text(file_text(path, "scene file"), None, os.fspath(path), path_of("path", path).parent)[0]


def tables_of_text(
    text: str, settings: Mapping[str, Any] | None = None, name: str = "scene", folder: Path | None = None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read the tables from the text of a scene file (TOML), with some values replaced; relative paths refer to a folder.

    Returns: The tables, and {name: value} of settings whose names are not keys of the tables.
    """
    content = parsed(text, name)
    given = {} if settings is None else mapping_of("overrides", settings, "names to values")
    others = _set_keys(content, given) if given else {}
    return _files_in(folder, content) if folder else content, others


def _set_keys(content: dict[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Replace values of keys in the tables of a scene file, in place; return the settings whose names are not keys."""
    faults, others, taken = Faults(), dict[str, Any](), []
    for name, value in settings.items():
        with faults.including():
            named = targets(name)
            read = _value_of(name, value) if isinstance(value, str) else value
            taken.append((name, (Target(name),) if is_key(name) else named))
            if is_key(name):
                override(content, name, read)
            else:
                others[name] = read
    clashes(faults, taken, "set")
    faults.raise_if_any()
    return others


def _files_in(folder: Path, content: dict[str, Any]) -> dict[str, Any]:
    """Prefix relative paths in the content with the folder: a table of members, policies, data, and a mesh."""
    try:
        ensemble = content["ensemble"]
        sampling = ensemble["sampling"]
        table = sampling["table"]
        if isinstance(table["file"], str):
            table = table | {"file": os.fspath(folder / table["file"])}
            content = content | {"ensemble": ensemble | {"sampling": sampling | {"table": table}}}
    except (KeyError, TypeError):
        pass
    try:
        vehicle = content["vehicle"]
        shape = vehicle["shape"]
        if isinstance(shape["mesh"], str):
            content = content | {"vehicle": vehicle | {"shape": shape | {"mesh": _mesh_in(folder, shape["mesh"])}}}
    except (KeyError, TypeError):
        pass
    with contextlib.suppress(KeyError, TypeError, AttributeError):
        content = content | {"terms": [_below(folder, term) for term in content["terms"]]}
    with contextlib.suppress(KeyError, TypeError, AttributeError):
        content = content | {"events": [_below(folder, event) for event in content["events"]]}
    try:
        controller = content["controller"]
        laws = [_below(folder, law) for law in controller["laws"]]
        content = content | {"controller": controller | {"laws": laws}}
    except (KeyError, TypeError, AttributeError):
        pass
    return content


def _below(folder: Path, part: Any) -> Any:
    """Return the table of a term, an event or a law, with the path of its file prefixed with the folder."""
    return part | {"file": os.fspath(folder / part["file"])} if isinstance(part.get("file"), str) else part


def _mesh_in(folder: Path, name: str) -> str:
    """Return the path of a mesh. Raises SceneError if it leaves the folder of the scene, also through a link."""
    key = "vehicle.shape.mesh"
    path = None
    with contextlib.suppress(OSError, ValueError):  # a link out of the folder, or a name with a null character
        path = inside(folder, name)
    if "\0" not in name and (path is None or Path(name).is_absolute()):
        raise refusal(key, name, "lies outside the scene file's folder", "put the mesh beside the scene file")
    if path is None or not path.is_file():
        raise refusal(key, name, "is not there", "put the mesh beside the scene file, or give length and diameter [m]")
    return os.fspath(path)


def is_key(name: str) -> bool:
    """Whether a name is a key of a table of the scene file."""
    section, _, rest = name.partition(".")
    return section in TABLES and bool(rest) and (section == "ensemble" or "[" not in rest)


def override(content: dict[str, Any], key: str, value: Any) -> None:
    """Set the value of a dotted key in the tables of a scene file, in place."""
    *path, last = key.split(".")
    if key.startswith("ensemble.vary."):
        path, last = path[:2], key.removeprefix("ensemble.vary.").strip("\"'")
    for i, word in enumerate(path):
        content = content.setdefault(word, {})
        if not isinstance(content, dict):
            raise refusal(key, value, f"{'.'.join(path[: i + 1])} is not a table", "write section.key=value")
    content[last] = value


def _value_of(key: str, text: str) -> Any:
    """Return a text parsed as a TOML value, or else the text itself. Raises SceneError if it holds several values."""
    try:
        content = parsed(f"value = {text}", key)
    except SceneError as error:
        if not isinstance(error.__cause__, tomllib.TOMLDecodeError):
            raise SceneError((key + fault.removeprefix("value") for fault in error.faults), error.more) from None
        with contextlib.suppress(ValueError):  # such as .5, which TOML does not take
            return float(text)
        if "\n" not in text.strip():
            return text
        content = {}
    if len(content) != 1:
        raise refusal(key, text, "is not one value", "write one value on one line, and --set once for each key")
    return content["value"]


def with_named_vehicle(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Insert the vehicle that [vehicle] name = "remus_100" refers to.

    Other keys of [vehicle] replace the vehicle's own values. A term of the same name or type replaces the vehicle's term.
    """
    if not isinstance(content, Mapping):
        raise refusal("scene", content, "is not a table", "give tables by section name, as of a scene file")
    table = content.get("vehicle")
    if not isinstance(table, Mapping) or "name" not in table:
        return content
    from lgvi_warp.vehicles.fossen import vehicle_tables

    known = vehicle_tables(str(table["name"]))
    merged = dict(content)
    for section in ("vehicle", "environment"):
        section_table = content.get(section, {})
        if isinstance(section_table, Mapping):
            merged[section] = known.get(section, {}) | section_table
            merged[section].pop("name", None)
    merged["vehicle"].setdefault("title", table["name"])
    terms = content.get("terms", [])
    if isinstance(terms, list | tuple):
        names = [_name_of(term) for term in terms]
        merged["terms"] = [term for term in known.get("terms", []) if not among(_name_of(term), names)] + list(terms)
    return merged


def with_origin_of_floors(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Add the origin of the axes from [environment] to the tables of floors that are read from a file."""
    events, origin = content.get("events"), _entry(content, "environment", "origin")
    if origin is None or not isinstance(events, list | tuple):
        return content

    def completed(event: Any) -> Any:
        reads = isinstance(event, Mapping) and event.get("type") == "floor" and "file" in event
        return {"origin": origin} | dict(event) if reads else event

    return {**content, "events": [completed(event) for event in events]}


def with_times_of_data(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Add values of other sections to the tables of currents that are read from a file.

    These are the origin of the axes and the date and time of t = 0 from [environment], the duration of the run, and the
    start position of members.
    """
    terms = content.get("terms")
    if not isinstance(terms, list | tuple) or not any(_reads_file(term) for term in terms):
        return content
    known = {key: _entry(content, "environment", key) for key in ("origin", "start")}
    known["duration"] = _entry(content, "run", "duration")
    known = {key: value for key, value in known.items() if value is not None}

    def completed(term: Any) -> Any:
        if not _reads_file(term):
            return term
        table = known | dict(term)
        if table.get("speed") is not None and "around" not in table:
            around = _start(content, table.get("origin"))
            table |= {} if around is None else {"around": around}
        return table

    return {**content, "terms": [completed(term) for term in terms]}


def _reads_file(term: Any) -> bool:
    return isinstance(term, Mapping) and among(term.get("type"), ("current_field",)) and "file" in term


def _entry(content: Mapping[str, Any], section: str, key: str) -> Any:
    """A value of a section, which is a table or an object; None if it is missing."""
    table = content.get(section, {})
    return table.get(key) if isinstance(table, Mapping) else getattr(table, key, None)


def _start(content: Mapping[str, Any], origin: Any) -> Any:
    """Start position of members, (3,) [m]; None if not given."""
    place = _entry(content, "start", "geodetic")
    if place is None or np.shape(place) != (3,) or np.shape(origin) != (2,):
        return _entry(content, "start", "position")
    from lgvi_warp.common.places import LocalPlane

    north, east = LocalPlane(*map(float, origin)).local(*place[:2])
    return [float(north), float(east), float(place[2])]


def _name_of(term: Any) -> Any:
    """Return the name of a term, or its type if it has no name."""
    if isinstance(term, Mapping):
        return term.get("name") or term.get("type")
    return getattr(term, "key", None)
