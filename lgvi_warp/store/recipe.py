# SPDX-License-Identifier: Apache-2.0
"""Recipes: a plan written as plain numbers and texts and read back, so that a stored run can be resumed elsewhere."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.identity import UNKNOWN, comparable
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.common.sentences import sentences
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.drawn import DrawnParameters
from lgvi_warp.sampling.designs.table import Table, moved
from lgvi_warp.sampling.final import PREFIX, Final
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


def recipe(plan: Plan) -> dict[str, Any]:
    """Write a plan's settings without its ensemble and its times."""
    return {
        "members": plan.ensemble.members,
        "method": dataclasses.asdict(plan.method),
        "step": plan.grid.h,
        "messages": list(plan.grid.messages),
        "fields": list(plan.fields),
        "dtype": plan.dtype,
        "width": plan.spec.width,
        "checks": plan.checks,
        "on_failure": plan.on_failure,
    }


# Key in the stored provenance of an ensemble: SHA-256 of the arrays that it was given, which lie in the group "explicit".
ARRAYS = "arrays_sha256"


def of_store(provenance: Mapping[str, Any], ensemble: Ensemble) -> dict[str, Any]:
    """Shorten provenance for a store: arrays are replaced by their checksum, a table by its column names.

    A table that was read from a file keeps the file's name and checksum.
    """
    explicit, sampling = ensemble.explicit(), ensemble.sampling
    arrays, content = sampling.arrays(), dict(provenance["ensemble"])
    if getattr(sampling, "file", None) is not None:
        explicit = {name: values for name, values in explicit.items() if name not in arrays}
    elif arrays:
        settings = {name: value for name, value in sampling.to_dict()[sampling.kind].items() if name not in arrays}
        weights = {"weights": settings["weights"]} if "weights" in settings else {}
        of_table = {"columns": sorted(arrays)} | weights
        content["sampling"] = {sampling.kind: of_table if sampling.kind == "table" else settings}
    return {**provenance, "ensemble": content | ({ARRAYS: _checksum(explicit)} if explicit else {})}


def _checksum(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of the names, shapes and bytes of arrays."""
    digest = hashlib.sha256()
    for name, values in sorted(arrays.items()):
        digest.update(f"{name} {values.shape} {values.dtype.str}\n".encode())
        digest.update(np.ascontiguousarray(values).data)
    return digest.hexdigest()


def stored_ensemble(provenance: Mapping[str, Any], arrays: Mapping[str, np.ndarray], store: Path) -> Ensemble:
    """Build the ensemble that provenance describes, with the arrays from which it was made."""
    scene, settings = provenance["scene"], provenance["ensemble"]
    explicit = {name: rows for name, rows in arrays.items() if name != "indices" and not name.startswith(PREFIX)}
    _check_table(_table_in(settings))
    settings = {key: value for key, value in settings.items() if key != ARRAYS}
    table = _table(settings, explicit, store)
    if table is not None:
        settings["sampling"] = table
        if "ensemble" in scene:
            scene = {**scene, "ensemble": {**scene["ensemble"], "sampling": table}}
    bare_scene = Scene.from_dict(scene)
    if "explicit" in settings:
        states = {name: explicit[f"start.{name}"] for name in FIELDS}
        parameters = {name: value for name, value in explicit.items() if not name.startswith("start.")}
        ensemble = Ensemble.from_states(bare_scene, **states, parameters=parameters)
        ensemble.seed = int(settings["seed"])
        if "indices" in settings:
            ensemble = ensemble.subset(settings["indices"])
    else:
        if explicit and table is None:
            ((kind, arguments),) = settings["sampling"].items()
            weights = {"weights": arguments["weights"]} if "weights" in arguments else {}
            of_table = {"values": explicit} | weights
            settings["sampling"] = {kind: of_table if kind == "table" else {**arguments, **explicit}}
        ensemble = Ensemble.from_scene(Scene.from_dict({**scene, "ensemble": settings}))
        ensemble.scene = bare_scene
    if "indices" in arrays:
        ensemble.indices = arrays["indices"]
    return _gone_on(ensemble, provenance.get("start", {}), arrays)


def _gone_on(ensemble: Ensemble, start: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> Ensemble:
    """If the run in the store continued another run, return the ensemble that continues it."""
    if "end" not in start:
        return ensemble
    # With the numbers that the members had then, or with others, as the run itself found.
    exactly = start.get("goes_on") == "exactly"
    parameters: Mapping[str, np.ndarray] = DrawnParameters(ensemble, ensemble.members) if exactly else {}
    return ensemble.going_on(Final.from_arrays(arrays, start["end"], parameters))


def _table_in(ensemble: Mapping[str, Any]) -> Mapping[str, Any]:
    """Settings of an ensemble's table; empty if its members do not come from a table."""
    sampling = ensemble.get("sampling")
    table = sampling.get("table") if isinstance(sampling, Mapping) else None
    return table if isinstance(table, Mapping) else {}


def _check_table(table: Mapping[str, Any]) -> None:
    """Require a checksum if a store names the file of a table. Raises SceneError."""
    if "file" in table and not isinstance(table.get("sha256"), str):
        faults = Faults("ensemble.sampling.table.")
        faults.add("sha256", table.get("sha256"), "is missing beside the file", "run the scene again")
        faults.raise_if_any()


def _table(settings: Mapping[str, Any], explicit: Mapping[str, np.ndarray], store: Path) -> Any:
    """The table from which an ensemble was drawn: its numbers in the store, or else its file; None without a file."""
    table = _table_in(settings)
    if "file" not in table:
        return None
    if explicit:
        return Table.kept(table, explicit)
    return Table(**{**table, "file": moved(table["file"], table.get("sha256"), store)})


def same_run(
    stored: Mapping[str, Any], now: Mapping[str, Any], name: str = "the store", other_name: str | None = None
) -> list[str]:
    """List the differences between two provenances that can change the bits of a run."""
    leaves = [*differences(_comparable(stored), _comparable(now)), *_functions(stored, now)[0]]
    return [
        f"{key} is {first!r} in {name} and {second!r} {f'in {other_name}' if other_name else 'here'}"
        for key, first, second in leaves
    ]


# What is said of functions whose code does not tell which they are.
UNTOLD = (
    "cannot be compared with what the run began with. Give it a version, as lw.control.Callback(function, version=1)"
)


def _functions(stored: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[list[tuple[str, str, str]], list[str]]:
    """User's functions that differ between two provenances, as in `differences`; and names of functions not compared."""
    before, current = stored.get("functions", {}), now.get("functions", {})
    differ, untold = list[tuple[str, str, str]](), list[str]()
    for name in dict.fromkeys([*before, *current]):
        first, second = before.get(name, UNKNOWN), current.get(name, UNKNOWN)
        if not comparable(first, second):
            untold.append(name)
        elif first != second:
            differ.append((f"functions.{name}", first, second))
    return differ, untold


def _comparable(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Remove from provenance what changes no bit: threads, Python, paths, the scene's [ensemble], [run] and texts.

    The user's functions are removed too, since `_functions` compares them.
    """
    provenance = {key: value for key, value in provenance.items() if key != "source"}
    scene = {key: value for key, value in provenance["scene"].items() if key not in ("ensemble", "run")}
    scene["vehicle"] = {key: value for key, value in scene["vehicle"].items() if key not in ("shape", "title")}
    machine = {key: value for key, value in provenance["machine"].items() if key in ("cpu", "simd")}
    versions = {key: value for key, value in provenance["versions"].items() if key != "python"}
    ensemble = _without_place(provenance["ensemble"])
    compared = {**provenance, "scene": scene, "machine": machine, "versions": versions, "ensemble": ensemble}
    compared.pop("functions", None)
    return compared


def _without_place(ensemble: Mapping[str, Any]) -> dict[str, Any]:
    """Remove the file's path of an ensemble's table, and keep the file's checksum."""
    table = _table_in(ensemble)
    if table.get("sha256") is None:
        return dict(ensemble)
    return {**ensemble, "sampling": {"table": {key: value for key, value in table.items() if key != "file"}}}


def differences(before: Any, now: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield (dotted key, value before, value now) of each leaf that differs between two nested tables."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        for name in [*before, *(name for name in now if name not in before)]:
            yield from differences(before.get(name), now.get(name), f"{key}.{name}" if key else name)
    elif before != now:
        yield key, before, now


def refuse_another(path: Any, stored: Mapping[str, Any], now: Mapping[str, Any], force: bool) -> tuple[str, ...]:
    """Check that two provenances are of the same run.

    `force` allows differences in machine, versions and user's functions alone: another scene or method is another run.
    """
    mismatches = same_run(stored, parsed(json.dumps(now)))
    forcible = [text for text in mismatches if text.startswith(("machine.", "versions.", "kernel", "functions."))]
    if mismatches and (not force or len(forcible) < len(mismatches)):
        problem, remedy = "is another run", "give --overwrite, or another folder"
        if len(forcible) == len(mismatches):
            problem = "the same bits cannot be promised"
            where = "with the functions that it had" if "functions." in " ".join(mismatches) else "where it began"
            remedy = f"go on {where}, or give --force (force=True) and take it that some differ"
        raise SceneError(sentences(f"{path}: {text}", problem, remedy) for text in mismatches)
    return tuple(f"continued although {text}" for text in mismatches) + tuple(
        f"went on with {name}, which {UNTOLD}" for name in _functions(stored, now)[1]
    )


def noted_functions(stored: Mapping[str, Any], now: Mapping[str, Any]) -> tuple[str, ...]:
    """Name the functions in a finished run's statistics that differ from the run's, or cannot be compared with them."""
    current = now["functions"]
    before = {name: text for name, text in stored.get("functions", {}).items() if name in current}
    differ, untold = _functions({"functions": before}, now)
    return tuple(f"{name} is another function than the run had" for name, _, _ in differ) + tuple(
        f"{name} {UNTOLD}" for name in untold
    )
