# SPDX-License-Identifier: Apache-2.0
"""State of a store: its content, its finished blocks, and its damage."""

from __future__ import annotations

import os
from typing import Any

from lgvi_warp.common import safe_files
from lgvi_warp.common.errors import SceneError
from lgvi_warp.store.block_files import check_blocks, name_of
from lgvi_warp.store.folder import KEPT, ROOT, Folder
from lgvi_warp.store.kept import keep_of, members_kept
from lgvi_warp.store.open import folder_of
from lgvi_warp.store.settings import Store


def store_of(folder: Folder, force: bool = False) -> Store:
    """Restore the settings with which a store was made, to resume its run."""
    layout = folder.recipe["store"]
    fields = None if layout["fields"] is None else tuple(layout["fields"])
    return Store(folder.path, layout["dtype"], fields, "resume", force, layout["chunk_bytes"])


def state(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Report the content of a store; this reads every file.

    Returns: A table: path, members, samples (times), fields, keepers, blocks (in all), finished (blocks), kept
        (members), complete, bytes, damage (texts) and provenance.
    """
    folder = Folder(folder_of(path))
    runs, recipe = folder.runs, folder.recipe
    fields, damage = recipe["store"]["fields"], folder.damage()
    samples, finished = folder.layout.times, 0
    for _, faults in check_blocks(folder.block_files, runs, samples, recipe["keepers"]):
        if faults != ["is not finished"]:
            finished += not faults
            damage += faults
    kept, faults = kept_state(folder, sound=not damage and finished == len(runs))
    damage += faults
    return {
        "path": folder.path,
        "members": folder.members,
        "samples": samples,
        "fields": list(recipe["fields"] if fields is None else fields),
        "keepers": list(recipe["keepers"]),
        "blocks": len(runs),
        "finished": finished,
        "kept": kept,
        "complete": folder.complete and finished == len(runs) and not damage,
        "bytes": safe_files.size_below(folder.path),
        "damage": damage,
        "provenance": folder.provenance,
    }


def kept_state(folder: Folder, sound: bool) -> tuple[int, list[str]]:
    """Report on the kept members of a run."""
    wanted = len(members_kept(keep_of(folder.provenance), folder)) if folder.complete and sound else 0
    try:
        group = folder.kept()
    except SceneError:
        return wanted, [f"{KEPT}/{ROOT} is damaged"] if folder.complete else []
    if group is None:
        return wanted, [f"{KEPT} is missing"] if wanted else []
    damage = group.damage()
    for block, faults in check_blocks(group.block_files, group.runs, group.layout.times):
        if faults == ["is not finished"]:
            faults = [f"blocks/{name_of(block)}.json is missing or damaged"] if folder.complete else []
        damage += faults
    return wanted, [f"{KEPT}/{text}" for text in damage]
