# SPDX-License-Identifier: Apache-2.0
"""The final states of a run in a store, read from the parts of its blocks."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common.errors import SceneError
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.going_on import joined
from lgvi_warp.engine.keepers.final import FINAL, Finals
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.sampling.final import Final
from lgvi_warp.store.block_files import damaged, name_of
from lgvi_warp.store.folder import Folder
from lgvi_warp.store.layout import MEMBER
from lgvi_warp.store.layout_check import corrupt_store_as_scene_error


def has_end(folder: Folder) -> bool:
    """Whether the run in a folder stored its final states."""
    return FINAL in folder.recipe["keepers"]


def end_of(path: Path, places: slice | np.ndarray, parameters: Mapping[str, np.ndarray]) -> Final:
    """Read the final states of some members of the run in a folder; parameters: those of these members, by name."""
    folder = Folder(path)
    at = np.arange(folder.members)[places]
    parts, settings = dict[int, dict[str, np.ndarray]](), dict[str, Any]()
    firsts = np.array([block.first for block in folder.runs])
    of_block = np.searchsorted(firsts, at, side="right") - 1
    for i in np.unique(of_block):
        block = folder.runs[i]
        check_parts(folder, folder.block_files.sums(block), block)
        with corrupt_store_as_scene_error(folder.path / folder.block_files.parts_key(block)):
            ((rows, settings),) = folder.block_files.parts(block, (Finals(),)) or ()
            inside = at[of_block == i] - block.first
            parts[block.first] = {name: values[inside] for name, values in rows.items()}
    # Joined, members come block by block: back into the order of the places.
    by_block, order = joined(parts), np.argsort(np.argsort(of_block, kind="stable"))
    group = folder.group()
    end = Final(
        time=float(folder.times()[-1]),
        step=float(folder.recipe["step"]),
        steps=int(group["step"][-1]),
        states={name: np.asarray(group[name].oindex[-1, at]) for name in FIELDS if name in group},
        status=np.asarray(group["status"].oindex[at]),
        indices=np.asarray(group[MEMBER].oindex[at]),
        seed=int(folder.provenance["ensemble"]["seed"]),
        parameters={name: np.asarray(values) for name, values in parameters.items()},
        lanes={name: values[order] for name, values in by_block.items()},
        settings=settings,
    )
    with corrupt_store_as_scene_error(folder.path):
        return end.checked()


def check_parts(folder: Folder, sums: Any, block: Block) -> None:
    """Check that a block's parts are unchanged since they were written. Raises SceneError."""
    key = folder.block_files.parts_key(block)
    if sums is None:
        faults = [f"blocks/{name_of(block)}.json is missing or damaged"]
    elif key in sums:
        faults = [f"{key} {text}" for key, text in damaged(folder.path, {key: sums[key]}).items()]
    else:
        faults = [f"{key} is not in the marker of its block"] if folder.recipe["keepers"] else []
    if faults:
        raise SceneError(f"{folder.path}: {text}. `lgvi-warp resume {folder.path}` mends it" for text in faults)
