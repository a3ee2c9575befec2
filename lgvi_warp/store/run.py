# SPDX-License-Identifier: Apache-2.0
"""The loop of a stored run: missing and damaged blocks are run, finished blocks are kept."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lgvi_warp.common import safe_files, scratch
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.sentences import capital, sentences
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.protocol import Keeper, PartKeeper
from lgvi_warp.engine.loop import RunProgress, run_blocks
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.work import Work
from lgvi_warp.store.block_files import BlockFiles, check_blocks
from lgvi_warp.store.create import create, names_of, skeleton
from lgvi_warp.store.folder import ROOT, Folder, foreign, held, refuse_foreign
from lgvi_warp.store.layout import columns
from lgvi_warp.store.recipe import refuse_another
from lgvi_warp.store.settings import Store

# Errors of the system for a full disk, a quota and a file that is too large.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@dataclass(frozen=True)
class StoredRun:
    """A run into a store, new or resumed.

    It is complete when every block is stored, or as many blocks as `enough` requires, and `last` is done.

    provenance: Provenance in the form of a store.
    keepers: Additional keepers, whose parts are in the store.
    only: Indices of the blocks to run; None: all.
    enough: Function that tells whether this many members are enough (see run_blocks).
    last: Last stage of the run: a function of this run, its members, the executor and the progress. It returns how many
        blocks it ran.
    after: Function that is called with each block, in order, as soon as the block is in the store; default nothing.
    """

    plan: Plan
    store: Store
    provenance: dict[str, Any]
    messages: tuple[str, ...] = ()
    keepers: tuple[Keeper, ...] = ()
    only: range | None = None
    enough: Callable[[int], bool] = lambda members: False
    last: Callable[[StoredRun, int, Executor, Callable[[float], None] | None], int] = lambda *_: 0
    after: Callable[[Block], None] | None = None

    def run(self, executor: Executor, progress: Callable[[float], None] | None = None) -> Folder:
        """Run the missing or damaged blocks."""
        check_keepers(self.keepers)
        path = self.store.folder
        with self._alone():
            noted = self._begin()
            block_files = BlockFiles(path, columns(self.plan, self.store))
            block_files.remove_unfinished()
            self._mend()
            missing = self._left(block_files)
            try:
                with disk_error_with_remedy(self.store.whole), block_files.commits:
                    members = self._blocks(block_files, missing, executor, progress)
            finally:
                block_files.remove_unfinished()
            folder = Folder(path, self.store.whole)
            folder.noted = noted
            folder.ran = sum(block.first < members for block in missing)
            folder.found = sum(block.first < members for block in self.blocks) - folder.ran
            beyond = [] if self.only else [block for block in self.blocks if block.first >= members]
            if beyond:
                # How many blocks ran beyond the last one depends on the number of threads: the store keeps none of them.
                block_files.remove(beyond, len(self.plan.grid.times))
            if beyond or not folder.unfinished():
                folder.ran_kept = self.last(self, members if beyond else self.plan.ensemble.members, executor, progress)
                folder.finish(members if beyond else None)
        return folder

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """Hold the lock of the store for the whole run. A group is locked by the run to which it belongs."""
        if self.store.whole != self.store.folder:
            yield
            return
        with contextlib.ExitStack() as stack:
            with disk_error_with_remedy(self.store.whole):
                stack.enter_context(held(self.store.folder))
            yield

    @property
    def blocks(self) -> list[Block]:
        """The blocks of this run, in order."""
        runs = blocks(self.plan.ensemble.members)
        return runs if self.only is None else [runs[i] for i in self.only]

    def _begin(self) -> tuple[str, ...]:
        """Create the folder, or check that it holds this run. Returns warnings about differences that change the bits."""
        path, store = self.store.folder, self.store
        exists = os.path.lexists(path) and bool(os.listdir(path) if path.is_dir() else True)
        if exists and store.existing == "refuse":
            if fault := foreign(path):
                raise SceneError([sentences(path, fault, "give another folder")])
            remedy = 'go on with `lgvi-warp resume` (existing="resume"), or replace it with --overwrite (existing="overwrite")'
            raise SceneError([f"{path} holds a run already. {capital(remedy)}"])
        if exists and store.existing == "resume":
            safe_files.refuse_links(path)
            folder = Folder(path, store.whole)
            noted = refuse_another(path, folder.provenance, self.provenance, store.force)
            recipe = folder.recipe
            for present, wanted in ((recipe["store"], store.layout()), (recipe["keepers"], names_of(self.keepers))):
                if present != wanted:
                    raise SceneError([f"{path} stores {present}, not {wanted}. Ask for the same, or overwrite"])
            return noted
        refuse_foreign(path)
        with disk_error_with_remedy(store.whole):
            create(store, self.plan, self.provenance, self.messages, self.keepers)
        return ()

    def _mend(self) -> None:
        """Rewrite the damaged files that belong to no block."""
        path = self.store.folder
        for name in ("blocks", "parts"):
            (path / name).mkdir(exist_ok=True)
        folder = Folder(path, self.store.whole)
        if not folder.damage():
            return
        beside = scratch.beside(path, scratch.NEW)
        try:
            skeleton(beside, self.store, self.plan, self.provenance, self.messages, self.keepers)
            folder.take_layout(beside)
            for file in sorted(beside.rglob("*")):
                target = path / file.relative_to(beside)
                if file.is_file() and file != beside / ROOT:
                    target.parent.mkdir(parents=True, exist_ok=True)
                    file.replace(target)
        finally:
            scratch.remove_folder(beside)

    def _left(self, block_files: BlockFiles) -> list[Block]:
        """List the unfinished or damaged blocks; a damaged block loses its marker."""
        missing = []
        for block, faults in check_blocks(block_files, self.blocks, len(self.plan.grid.times), self.keepers):
            if faults:
                block_files.marker(block).unlink(missing_ok=True)
                missing.append(block)
        return missing

    def _blocks(
        self,
        block_files: BlockFiles,
        remaining: Sequence[Block],
        executor: Executor,
        progress: Callable[[float], None] | None,
    ) -> int:
        """Run the remaining blocks, and merge the parts of all blocks in order. Returns the end of their members."""
        runs, n, steps = self.blocks, self.plan.ensemble.members, self.plan.grid.steps
        overall = RunProgress(n * steps, progress)
        for block in set(runs) - set(remaining):
            overall.at(block, block.count * steps)
        members = run_blocks(
            Work(self.plan, self.keepers, block_files),
            runs,
            executor,
            overall.at,
            remaining,
            self.enough,
            after=self.after,
        )
        if progress and members < runs[-1].stop:
            progress(1.0)
        return members


def check_keepers(keepers: Sequence[Keeper]) -> None:
    """Check that each keeper can write its parts into a store, under its own name."""
    faults = Faults("keepers.")
    for keeper in keepers:
        if not isinstance(keeper, PartKeeper):
            faults.add(type(keeper).__name__, keeper, "cannot be stored", "give it name, to_arrays and from_arrays")
    names = names_of(keepers)
    for name in sorted({name for name in names if names.count(name) > 1 or "/" in name}):
        faults.add("name", name, "is not a name of its own", "give each keeper another name, without /")
    faults.raise_if_any()


@contextlib.contextmanager
def disk_error_with_remedy(path: os.PathLike[str]) -> Iterator[None]:
    """Extend errors of the disk by their consequence for the run."""
    try:
        yield
    except OSError as error:
        if error.errno in FULL:
            remedy = f"the blocks that were finished are kept. Make room, then `lgvi-warp resume {path}`"
        elif error.errno in (errno.EROFS, errno.EACCES, errno.EPERM):
            remedy = "choose a folder that can be written"
        else:
            raise
        raise OSError(error.errno, f"{error.strerror}: {remedy}", error.filename or str(path)) from error
