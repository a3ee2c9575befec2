"""A plan as plain numbers and texts, and back: what a store keeps so that a run can go on elsewhere and later."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.methods.method import Method
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.sampling.designs.table import Table, moved
from lgvi_warp.sampling.members import STATES
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.scene import Scene

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


def recipe(plan: Plan) -> dict[str, Any]:
    """Settings of a plan beyond its ensemble and its times: JSON has all of their digits."""
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


def plan_of(made: Mapping[str, Any], ensemble: Ensemble, sample_steps: np.ndarray, times: np.ndarray) -> Plan:
    """The plan of a recipe. Raises SceneError."""
    from lgvi_warp.engine.plan import Plan

    grid = TimeGrid(made["step"], sample_steps, times, tuple(made["messages"]))
    method, fields = Method(**made["method"]), tuple(made["fields"])
    settings = (made[name] for name in ("dtype", "width", "checks", "on_failure"))
    return Plan(ensemble, method, grid, fields, *settings)


# In a store's provenance of an ensemble: the SHA-256 of what was given as arrays, which lies in its group "explicit".
ARRAYS = "arrays_sha256"


def of_store(provenance: Mapping[str, Any], ensemble: Ensemble) -> dict[str, Any]:
    """Provenance as a store keeps it: of what was given as arrays the checksum alone, and of a table the names.

    A table of a file is told by its name and the checksum that it has already.
    """
    given, sampling = ensemble.explicit(), ensemble.sampling
    arrays, told = sampling.arrays(), dict(provenance["ensemble"])
    if getattr(sampling, "file", None) is not None:
        given = {name: values for name, values in given.items() if name not in arrays}
    elif arrays:
        left = {name: value for name, value in sampling.to_dict()[sampling.kind].items() if name not in arrays}
        told["sampling"] = {sampling.kind: {"columns": sorted(arrays)} if sampling.kind == "table" else left}
    return {**provenance, "ensemble": told | ({ARRAYS: _checksum(given)} if given else {})}


def _checksum(arrays: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of names, shapes and bytes."""
    found = hashlib.sha256()
    for name, values in sorted(arrays.items()):
        found.update(f"{name} {values.shape} {values.dtype.str}\n".encode())
        found.update(np.ascontiguousarray(values).data)
    return found.hexdigest()


def ensemble_of(
    scene: Mapping[str, Any],
    settings: Mapping[str, Any],
    explicit: Mapping[str, np.ndarray],
    noise: np.ndarray | None,
    store: Path,
) -> Ensemble:
    """The ensemble that provenance tells of; explicit: its arrays; noise: `indices` where they were set. Raises SceneError.

    store: the folder that the provenance is of, beside which a table's file is looked for.
    """
    _check_table(settings.get("sampling"))
    settings = {key: value for key, value in settings.items() if key != ARRAYS}
    table = _table(settings, explicit, store)
    if table is not None:
        settings["sampling"] = table
        if "ensemble" in scene:
            scene = {**scene, "ensemble": {**scene["ensemble"], "sampling": table}}
    own = Scene.from_dict(scene)
    if "explicit" in settings:
        states = {name: explicit[f"start.{name}"] for name in STATES}
        parameters = {name: value for name, value in explicit.items() if not name.startswith("start.")}
        ensemble = Ensemble.from_states(own, **states, parameters=parameters)
        ensemble.seed = int(settings["seed"])
        if "indices" in settings:
            ensemble = ensemble.subset(settings["indices"])
    else:
        if explicit and table is None:
            ((kind, left),) = settings["sampling"].items()
            settings["sampling"] = {kind: {"values": explicit} if kind == "table" else {**left, **explicit}}
        ensemble = Ensemble.from_scene(Scene.from_dict({**scene, "ensemble": settings}))
        ensemble.scene = own
    if noise is not None:
        ensemble.indices = noise
    return ensemble


def _check_table(sampling: Any) -> None:
    """A table's file that a store names is taken only with the checksum that it had. Raises SceneError."""
    table = sampling.get("table") if isinstance(sampling, Mapping) else None
    if isinstance(table, Mapping) and "file" in table and not isinstance(table.get("sha256"), str):
        faults = Faults("ensemble.sampling.table.")
        faults.add("sha256", table.get("sha256"), "is missing beside the file", "run the scene again")
        faults.raise_if_any()


def _table(settings: Mapping[str, Any], explicit: Mapping[str, np.ndarray], store: Path) -> Any:
    """The table of a file that an ensemble was drawn from, from its numbers in the store, or read again; None without."""
    sampling = settings.get("sampling")
    told = sampling.get("table") if isinstance(sampling, Mapping) else None
    if not isinstance(told, Mapping) or "file" not in told:
        return None
    if explicit:
        return Table.kept(told, explicit)
    return Table(**{**told, "file": moved(told["file"], told.get("sha256"), store)})


def same_run(
    stored: Mapping[str, Any], now: Mapping[str, Any], name: str = "the store", other: str | None = None
) -> list[str]:
    """What differs between two provenances that the bits depend on, one text each: key, value there, value here.

    name, other: what the two are called; no other is this run.
    """
    return [
        f"{key} is {there!r} in {name} and {here!r} {f'in {other}' if other else 'here'}"
        for key, there, here in differences(_comparable(stored), _comparable(now))
    ]


def _comparable(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Without what changes no bit: threads, the version of Python, the scene's own [ensemble] and [run], a file's place."""
    content = dict(provenance)
    content["scene"] = {key: value for key, value in content["scene"].items() if key not in ("ensemble", "run")}
    content["machine"] = {key: value for key, value in content["machine"].items() if key in ("cpu", "simd")}
    content["versions"] = {key: value for key, value in content["versions"].items() if key != "python"}
    content["ensemble"] = _without_place(content["ensemble"])
    return content


def _without_place(ensemble: Mapping[str, Any]) -> dict[str, Any]:
    """Of a table of a file what its numbers depend on: its checksum, and not where it lies."""
    sampling = ensemble.get("sampling")
    told = sampling.get("table") if isinstance(sampling, Mapping) else None
    if not isinstance(told, Mapping) or told.get("sha256") is None:
        return dict(ensemble)
    return {**ensemble, "sampling": {"table": {key: value for key, value in told.items() if key != "file"}}}


def differences(there: Any, here: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    """(dotted key, value, value) of each leaf that is not the same in two nested tables."""
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        for name in [*there, *(name for name in here if name not in there)]:
            yield from differences(there.get(name), here.get(name), f"{key}.{name}" if key else name)
    elif there != here:
        yield key, there, here


def refuse_another(path: Any, stored: Mapping[str, Any], now: Mapping[str, Any], force: bool) -> tuple[str, ...]:
    """Raise SceneError where two provenances are of different runs; with `force`, say so in messages instead.

    Only machine and versions can be forced: another scene or method makes another run.
    """
    found = same_run(stored, json.loads(json.dumps(now)))
    machine = [text for text in found if text.startswith(("machine.", "versions.", "kernel"))]
    if found and (not force or len(machine) < len(found)):
        what = "is another run; give --overwrite, or another folder"
        if len(machine) == len(found):
            what = (
                "the same bits cannot be promised; go on where it began, or give --force and take it that some differ"
            )
        raise SceneError(f"{path}: {text}: {what}" for text in found)
    return tuple(f"continued although {text}" for text in found)
