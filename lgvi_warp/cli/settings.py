"""What the arguments ask of a scene and of a store."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from lgvi_warp.errors import SceneError

# Command-line option -> key of the scene file that it replaces.
OPTIONS = {
    "method": "run.method",
    "step": "run.step",
    "duration": "run.duration",
    "dtype": "run.dtype",
    "solver": "run.solver",
    "iterations": "run.iterations",
    "tolerance": "run.tolerance",
    "rtol": "run.rtol",
    "atol": "run.atol",
    "checks": "run.checks",
    "on_failure": "run.on_failure",
    "keep": "run.keep",
    "members": "ensemble.members",
    "seed": "ensemble.seed",
}


def overrides(chosen: argparse.Namespace) -> dict[str, Any]:
    """What the command line replaces of the scene file. Raises SceneError for a --set without a value."""
    changes: dict[str, Any] = {}
    for name, key in OPTIONS.items():
        value = getattr(chosen, name, None)
        if value is not None:
            changes[key] = value
    for text in chosen.set:
        key, equals, value = text.partition("=")
        if not equals:
            raise SceneError([f"--set {text}: has no value; write --set vehicle.mass=120"])
        changes[key.strip()] = value.strip()
    return changes


def store_settings(chosen: argparse.Namespace, out: Path) -> Any:
    """The store that the arguments ask for, None without one. Raises SceneError."""
    if chosen.store == "npz":
        names = ("store_dtype", "blocks", "overwrite", "resume")
        given = [f"--{name.replace('_', '-')}" for name in names if getattr(chosen, name)]
        if given:
            raise SceneError([f"{' and '.join(given)}: is for runs in a store; add --store zarr, or leave it out"])
        return None
    from lgvi_warp.store import Store

    existing = "overwrite" if chosen.overwrite else "resume" if chosen.resume else "refuse"
    return Store(out / "run.zarr", chosen.store_dtype, existing=existing)


def block_range(chosen: argparse.Namespace) -> range | None:
    """The blocks of --blocks A:B. Raises SceneError."""
    if chosen.blocks is None:
        return None
    first, colon, stop = chosen.blocks.partition(":")
    if not (colon and first.isdigit() and stop.isdigit()):
        raise SceneError(
            [f"--blocks {chosen.blocks}: is no range of blocks; write --blocks 0:100 for the first hundred"]
        )
    return range(int(first), int(stop))
