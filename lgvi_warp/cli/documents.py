# SPDX-License-Identifier: Apache-2.0
"""The results of verbs as tables for JSON; docs/reference/json.md describes their keys."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from lgvi_warp.cli.writing import Written


def of_settings(provenance: dict[str, Any]) -> dict[str, Any]:
    """Settings of a run: method, precision, step, number of steps and end of the run [s], seed, versions and machine."""
    names = ("dtype", "step", "steps", "versions", "machine")
    method, duration = provenance["method"], provenance["step"] * provenance["steps"]
    content = {"method": method["name"], "chosen": method.get("chosen"), "duration": duration}
    return content | {"seed": provenance["ensemble"].get("seed")} | {name: provenance[name] for name in names}


def of_result(result: Any) -> dict[str, Any]:
    """Outcomes of a run's members, statistics at its end, and its settings."""
    from lgvi_warp.uncertainty.footprint.footprint import run_answer

    divided = result.substeps > 0
    return {
        "answer": run_answer(result),
        "members": result.members,
        "settings": of_settings(result.provenance),
        "outcomes": result.status.counts(),
        "failed": int(result.status.failed.sum()),
        "stopped": int(result.status.stopped.sum()),
        "warnings": result.warnings.counts(),
        "divided": {"members": int(divided.sum()), "steps": int(result.substeps.sum())},
        "samples": {"times": len(result.time), "fields": list(result.samples), "kept": len(result.kept_members)},
        "messages": list(result.messages),
        "statistics": of_statistics(result.statistics),
    }


def of_statistics(estimates: Any) -> list[dict[str, Any]]:
    """The estimates of a run at its last sample time."""
    from lgvi_warp.statistics.estimates.table import entries

    return [dict(zip(("label", "unit", "value", "lower", "upper", "members"), entry, strict=True))
            for entry in entries(estimates)]  # fmt: skip


def of_energy(drawn: Any, members: int) -> dict[str, Any] | None:
    """Energy and momenta of some members: their largest changes, the conserved ones, and the terms that do work.

    drawn: These members, as a result; None for none.
    """
    from lgvi_warp.physics import energy as invariants

    if drawn is None:
        return None
    drift = invariants.drift(drawn)
    return {
        "change": drift,
        "conserved": sorted(invariants.conserved(drawn)),
        "at_work": list(invariants.at_work(drawn)),
        "members": drawn.members,
        "all": drawn.members == members,
    }


def of_run(result: Any, drawn: Any, written: Written, faults: Sequence[str], seconds: float) -> dict[str, Any]:
    """Describe a run for the verbs run and resume; seconds: time that it took; drawn: as in `of_energy`."""
    rate = result.members * result.provenance["steps"] / result.run_seconds if result.run_seconds else None
    return of_result(result) | {
        "energy": of_energy(drawn, result.members) if result.samples else None,
        "seconds": {"compile": result.compile_seconds, "run": result.run_seconds, "all": seconds},
        "vehicle_steps_per_second": rate,
        **of_files(written, faults),
    }


def of_files(written: Written, faults: Sequence[str] = ()) -> dict[str, Any]:
    """List the files of a verb."""
    return {
        "files": [Path(path) for path in written.files],
        "faults": [*written.faults, *faults],
        "notes": [*written.empty, *written.note_lines()],
    }


def of_prediction(prediction: Any) -> dict[str, Any]:
    """Describe a prediction of a run."""
    return {**vars(prediction), "seconds": prediction.seconds}


def of_store(contents: dict[str, Any]) -> dict[str, Any]:
    """Describe the content of a store and the settings of its run."""
    return {name: value for name, value in contents.items() if name != "provenance"} | {
        "settings": of_settings(contents["provenance"])
    }
