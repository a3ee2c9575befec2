# SPDX-License-Identifier: Apache-2.0
"""Changes of a scene by arguments, and the folder and store given by arguments."""

from __future__ import annotations

import argparse
import errno
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common.errors import Faults, SceneError

if TYPE_CHECKING:
    from lgvi_warp.scene.scene import Scene

# Name of the store in a run's folder.
RUN = "run.zarr"
# Command-line option -> key of the scene file that it replaces.
OPTIONS = {
    name: f"run.{name}"
    for name in ("method", "step", "duration", "dtype", "solver", "iterations", "tolerance", "rtol", "atol", "checks",
                 "on_failure", "device", "keep")
} | {name: f"ensemble.{name}" for name in ("members", "seed")}  # fmt: skip


def overrides(chosen: argparse.Namespace) -> dict[str, Any]:
    """Collect the values of the scene that the command line replaces.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        Value as TOML text by name, such as "run.step" or "heading_pid.kp".

    Raises:
        SceneError: A --set has no name or no value, or sets a name that is already set.
    """
    changes: dict[str, Any] = {}
    faults = Faults()
    for name, key in OPTIONS.items():
        value = getattr(chosen, name, None)
        if value is not None:
            changes[key] = PLAIN.get(name, str)(value)
    for text in chosen.set:
        key, equals, value = (word.strip() for word in text.partition("="))
        if not (equals and key):
            faults.add("--set", text, "is not a NAME=VALUE", "write --set vehicle.buoyancy=300")
        elif key in changes:
            faults.add(f"--set {key}", value, f"is set to {changes[key]} as well", "keep one of them")
        else:
            changes[key] = value
    faults.raise_if_any()
    return changes


def load_scene(chosen: argparse.Namespace) -> Scene:
    """Load the scene file with the keys that the command line replaces."""
    from lgvi_warp.scene.scene import Scene

    return Scene.load(chosen.scene, overrides(chosen))


def whole_number_text(text: str) -> str:
    """Write a whole number as TOML does: 1e6 becomes 1000000."""
    if text.strip("+-").isdigit():
        return text
    try:
        number = float(text)
    except ValueError:
        return text
    return str(int(number)) if number.is_integer() else text


def listed(text: str) -> str:
    """Write indices as a TOML list: 3,17 becomes [3,17]."""
    return f"[{text}]" if text.replace(",", "").replace(" ", "").isdigit() else text


PLAIN = {"members": whole_number_text, "seed": whole_number_text, "keep": listed}


def out_of(chosen: argparse.Namespace, suffix: str = "") -> Path:
    """Choose the folder for the files: --out, or one named after the scene."""
    name = Path(chosen.scene).stem
    # A file called "...toml" would give "..", the parent folder.
    return chosen.out or Path("runs") / f"{name if name.strip('.') else 'scene'}{suffix}"


def folder(chosen: argparse.Namespace, suffix: str = "") -> Path:
    """Make the folder for the files before the run, since results would be lost if they could not be written."""
    return writable(out_of(chosen, suffix))


def writable(out: Path) -> Path:
    """Make a folder if it does not exist, and check that it is writable."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        raise SceneError([f"--out {out} is a file. Give a folder"]) from None
    if not os.access(out, os.W_OK | os.X_OK):
        fault = f"{os.strerror(errno.EACCES)}: choose a folder that can be written"
        raise PermissionError(errno.EACCES, fault, str(out))
    return out


def store_settings(chosen: argparse.Namespace) -> Any:
    """Read the `Store` from the arguments; None for a run in memory."""
    if chosen.store == "npz":
        names = ("store_dtype", "blocks", "overwrite", "resume")
        options = [f"--{name.replace('_', '-')}" for name in names if getattr(chosen, name, None)]
        if options:
            raise SceneError([f"{' and '.join(options)} is for runs in a store. Add --store zarr, or leave it out"])
        return None
    from lgvi_warp.store.settings import Store

    existing = next((name for name in ("overwrite", "resume") if getattr(chosen, name, False)), "refuse")
    return Store(out_of(chosen) / RUN, chosen.store_dtype, existing=existing)


def block_range(chosen: argparse.Namespace) -> range | None:
    """Read the blocks to run, from A to B - 1, from --blocks A:B; None for all."""
    if chosen.blocks is None:
        return None
    first, colon, stop = chosen.blocks.partition(":")
    if not (colon and first.isdigit() and stop.isdigit()):
        fault = "is not a range of blocks. Write --blocks 0:100 for the first hundred"
        raise SceneError([f"--blocks {chosen.blocks} {fault}"])
    return range(int(first), int(stop))
