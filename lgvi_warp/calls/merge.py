# SPDX-License-Identifier: Apache-2.0
"""`merge`: one store from the parts of a run that were computed separately."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from pathlib import Path

from lgvi_warp.calls.resume import resume
from lgvi_warp.common import files as durable
from lgvi_warp.common import safe_files, scratch
from lgvi_warp.common.arguments import flag, listed, path_of
from lgvi_warp.common.errors import MembersFailed, SceneError, refusal
from lgvi_warp.engine.block import Block
from lgvi_warp.store.block_files import marker
from lgvi_warp.store.commits import Commits
from lgvi_warp.store.folder import CREATED, ROOT, Folder, held, refuse_foreign
from lgvi_warp.store.kept import keep_of, members_kept
from lgvi_warp.store.open import folder_of
from lgvi_warp.store.recipe import same_run
from lgvi_warp.store.run import disk_error_with_remedy


def merge(paths: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str], overwrite: bool = False) -> Folder:
    """Merge stores that hold blocks of one run (`run --blocks`) into a new store.

    Every file is compared with its checksum while it is copied. If no block is missing, the members that the run's
    `keep` selects ("failed" or indices) run again to obtain their samples. This step is skipped on a machine other than
    the run's, or if a scene file cannot describe the ensemble: then `lw.resume(path, fleet)` must complete the store.

    Args:
        paths: Paths of the stores, or of folders with one store each.
        out: Path of the new store, ending in .zarr, or of the folder in which to create it.
        overwrite: Whether to replace an existing run at `out`; default False.

    Returns:
        The new store, which may be incomplete.

    Raises:
        SceneError: If the stores belong to different runs, or a store is damaged.
        OSError: If the disk cannot be written.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=512, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> for name, blocks in {"first.zarr": range(0, 1), "second.zarr": range(1, 2)}.items():
        ...     part = lw.solve(fleet, h=0.1, t1=2.0, store=name, blocks=blocks)
        >>> whole = lw.merge(["first.zarr", "second.zarr"], "all.zarr")
        >>> lw.open_run("all.zarr").members
        512
    """
    target, overwrite = path_of("out", out), flag("overwrite", overwrite)
    parts = [Folder(folder_of(path)) for path in listed("paths", paths, "stores")]
    if not parts:
        raise refusal("paths", paths, "names no store", "give the stores to merge")
    first = parts[0]
    for further in parts[1:]:
        mismatches = same_run(further.provenance, first.provenance, str(further.path), str(first.path))
        if mismatches or further.recipe != first.recipe:
            remedy = "these are parts of different runs. Merge parts of one run"
            raise SceneError(f"{text}: {remedy}" for text in mismatches or ["another recipe"])
    if target.suffix != ".zarr":
        if os.path.lexists(target) and not target.is_dir():
            raise SceneError([f"{target} is a file. Give a folder"])
        safe_files.inside(target, first.path.name)
        target /= first.path.name
    with disk_error_with_remedy(target), held(target):
        if os.path.lexists(target) and not overwrite:
            raise SceneError([f"{target} holds a run already. Give --overwrite, or another folder"])
        refuse_foreign(target)
        again = _put_together(parts, Path(os.path.realpath(target)))
    if again:
        # On another machine, or with a user's own distributions, this is refused: the run then waits for lw.resume.
        with contextlib.suppress(SceneError, MembersFailed):
            resume(target)
    return Folder(target)


def _undamaged(parts: Sequence[Folder]) -> Folder:
    """Find the first store whose files outside the blocks are undamaged. Raises SceneError if there is none."""
    damage = []
    for part in parts:
        if not (faults := part.damage()):
            return part
        damage += [f"{part.path}: {text}. `lgvi-warp resume {part.path}` first" for text in faults]
    raise SceneError(damage)


def _copy_frame(part: Folder, target: Path) -> None:
    """Copy all files of a store that belong to no block. Raises SceneError, OSError."""
    files = durable.Files(target)
    for name in ("blocks", "parts"):
        (target / name).mkdir(parents=True)
    for key, size in (part.layout.frame() | {CREATED: None, ROOT: None}).items():
        (target / key).parent.mkdir(parents=True, exist_ok=True)
        files.write(key, safe_files.read(part.path, key, size or safe_files.MOST_JSON))
    files.finish()


def _copy_block(parts: Sequence[Folder], block: Block, target: Path, commits: Commits) -> None:
    """Copy a block from the first store with an undamaged copy. Raises SceneError if every copy is damaged."""
    damage = []
    for part in parts:
        block_files = part.block_files
        sums = block_files.sums(block)
        if sums is None:
            continue
        if unfit := block_files.unfit(block, sums, part.layout.times, part.recipe["keepers"]):
            damage += [f"{part.path}: {text}. `lgvi-warp resume {part.path}` first" for text in unfit]
            continue
        files = durable.Files(target)
        for key, wanted in sums.items():
            try:
                files.write(key, safe_files.read(part.path, key, wanted[0]))
            except FileNotFoundError:
                files.write(key, b"")
            if files.sums[key] != wanted:
                damage.append(f"{part.path / key} is torn, missing or changed. `lgvi-warp resume {part.path}` first")
                files.drop()
                break
        else:
            commits.add(files, target / "blocks" / block_files.marker(block).name, marker(sums))
            return
    if damage:
        raise SceneError(damage)


def _put_together(parts: Sequence[Folder], target: Path) -> bool:
    """Copy frame and blocks into a new store at the target. Return whether it still needs members to be run again."""
    beside = scratch.beside(target, scratch.NEW)
    try:
        _copy_frame(_undamaged(parts), beside)
        merged = Folder(beside)
        merged.reopen()
        with Commits() as commits:
            for block in parts[0].runs:
                _copy_block(parts, block, beside, commits)
        all_there = not merged.unfinished()
        again = all_there and len(members_kept(keep_of(merged.provenance), merged)) > 0
        if all_there and not again:
            merged.finish()
        durable.put_folder(beside, target)
    finally:
        scratch.remove_folder(beside)
    return again
