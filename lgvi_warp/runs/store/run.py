"""To be said in one sentence."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from lgvi_warp.common import safe_files, scratch
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.engine.executors.base import Executor
from lgvi_warp.engine.keepers.protocol import Keeper, PartKeeper
from lgvi_warp.engine.loop import Progress, run_blocks
from lgvi_warp.engine.plan import Plan
from lgvi_warp.engine.work import Work
from lgvi_warp.runs.store.create import create, names_of, skeleton
from lgvi_warp.runs.store.folder import ROOT, Folder, foreign, held, refuse_foreign
from lgvi_warp.runs.store.layout import columns
from lgvi_warp.runs.store.recipe import refuse_another
from lgvi_warp.runs.store.settings import Store
from lgvi_warp.runs.store.sink import Sink, check

# What the system says when a disk takes no more, or not from us.
FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


@dataclass(frozen=True)
class Stored:
    """A run into a store, begun or gone on with.

    keepers: what else is kept of it, beside the store: their parts lie in it. only: indices of the blocks to run, default
    all; the run is complete when every block is there, or as many as `enough` (see run_blocks) asks for, and `last` has
    done what there is to do then: called with this run, its members, the executor and the progress, it says how many
    blocks it ran.
    """

    plan: Plan
    store: Store
    provenance: dict[str, Any]
    messages: tuple[str, ...] = ()
    keepers: tuple[Keeper, ...] = ()
    only: range | None = None
    enough: Callable[[int], bool] = lambda members: False
    last: Callable[[Stored, int, Executor, Callable[[float], None] | None], int] = lambda *_: 0

    def run(self, executor: Executor, progress: Callable[[float], None] | None = None) -> Folder:
        """Run what is missing. Raises SceneError for what is refused, OSError where the disk takes no more."""
        check_keepers(self.keepers)
        path = self.store.folder
        with self._alone():
            self._begin()
            sink = Sink(path, columns(self.plan, self.store))
            sink.remove_unfinished()
            self._mend()
            left = self._left(sink)
            try:
                with sink.commits:
                    members = self._blocks(sink, left, executor, progress)
            except OSError as error:
                raise explained(error, self.store.whole) from error
            finally:
                sink.remove_unfinished()
            folder = Folder(path, self.store.whole)
            folder.ran = sum(block.first < members for block in left)
            folder.found = sum(block.first < members for block in self._runs()) - folder.ran
            beyond = [] if self.only else [block for block in self._runs() if block.first >= members]
            if beyond:
                # Blocks that were ahead of the last one depend on the number of threads: the store holds none of them.
                sink.remove(beyond, len(self.plan.grid.times))
            if beyond or not folder.unfinished():
                folder.ran_kept = self.last(self, members if beyond else self.plan.ensemble.members, executor, progress)
                folder.finish(members if beyond else None)
        return folder

    @contextlib.contextmanager
    def _alone(self) -> Iterator[None]:
        """No other run writes into the store, from the look at what is there to the end; of a group, its run sees to that."""
        if self.store.whole != self.store.folder:
            yield
            return
        with contextlib.ExitStack() as stack:
            try:
                stack.enter_context(held(self.store.folder))
            except OSError as error:
                raise explained(error, self.store.whole) from error
            yield

    def _runs(self) -> list[Block]:
        """The blocks of this run, in order."""
        runs = blocks(self.plan.ensemble.members)
        return runs if self.only is None else [runs[i] for i in self.only]

    def _begin(self) -> None:
        """Make the folder, or see that what lies there is this run."""
        path, store = self.store.folder, self.store
        there = os.path.lexists(path) and bool(os.listdir(path) if path.is_dir() else True)
        if there and store.existing == "refuse":
            if what := foreign(path):
                raise SceneError([f"{path}: {what}; give another folder"])
            remedy = 'go on with `lgvi-warp resume` (existing="resume"), or replace it with --overwrite (existing="overwrite")'
            raise SceneError([f"{path}: holds a run already; {remedy}"])
        if there and store.existing == "resume":
            safe_files.refuse_links(path)
            folder = Folder(path, store.whole)
            refuse_another(path, folder.provenance, self.provenance, store.force)
            there_is, asked = (
                (folder.recipe["store"], folder.recipe["keepers"]),
                (store.layout(), names_of(self.keepers)),
            )
            for one, other in zip(there_is, asked, strict=True):
                if one != other:
                    raise SceneError([f"{path}: stores {one}, not {other}; ask for the same, or overwrite"])
            return
        refuse_foreign(path)
        try:
            create(store, self.plan, self.provenance, self.messages, self.keepers)
        except OSError as error:
            raise explained(error, self.store.whole) from error

    def _mend(self) -> None:
        """Write anew what is damaged of the files that belong to no block."""
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
            for one in sorted(beside.rglob("*")):
                target = path / one.relative_to(beside)
                if one.is_file() and one != beside / ROOT:
                    target.parent.mkdir(parents=True, exist_ok=True)
                    one.replace(target)
        finally:
            scratch.remove_folder(beside)

    def _left(self, sink: Sink) -> list[Block]:
        """Blocks to be run, without those that are finished and whole; a damaged one loses its marker."""
        left = []
        for block, faults in check(sink, self._runs(), len(self.plan.grid.times), self.keepers):
            if faults:
                sink.marker(block).unlink(missing_ok=True)
                left.append(block)
        return left

    def _blocks(
        self, sink: Sink, left: Sequence[Block], executor: Executor, progress: Callable[[float], None] | None
    ) -> int:
        """Run blocks; parts of the finished ones come from the store, all in order. Returns where their members end."""
        runs, n, steps = self._runs(), self.plan.ensemble.members, self.plan.grid.steps
        made = Progress(n * steps, progress)
        for block in set(runs) - set(left):
            made.at(block, block.count * steps)
        members = run_blocks(Work(self.plan, self.keepers, sink), runs, executor, made.at, left, self.enough)
        if progress and members < runs[-1].stop:
            progress(1.0)
        return members


def check_keepers(keepers: Sequence[Keeper]) -> None:
    """Each must be able to leave its parts in a store, under a name of its own. Raises SceneError."""
    faults = Faults("keepers.")
    for keeper in keepers:
        if not isinstance(keeper, PartKeeper):
            faults.add(type(keeper).__name__, keeper, "cannot be stored", "give it name, to_arrays and from_arrays")
    names = names_of(keepers)
    for name in sorted({name for name in names if names.count(name) > 1 or "/" in name}):
        faults.add("name", name, "is no name of its own", "give each keeper another name, without /")
    faults.raise_if_any()


def explained(error: OSError, path: os.PathLike[str]) -> OSError:
    """The same error with what it means for the run."""
    if error.errno in FULL:
        text = f"{error.strerror}: the blocks that were finished are kept; make room, then `lgvi-warp resume {path}`"
    elif error.errno in (errno.EROFS, errno.EACCES, errno.EPERM):
        text = f"{error.strerror}: choose a folder that can be written"
    else:
        return error
    return OSError(error.errno, text, error.filename or str(path))
