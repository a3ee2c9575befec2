"""Go on with a run that was stopped; put the parts of one run together; say what a store holds."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lgvi_warp import durable, safe_files, scratch
from lgvi_warp.blocks import Block, Keeper
from lgvi_warp.commits import Commits
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import MembersFailed, SceneError
from lgvi_warp.executors import Executor, executor_of
from lgvi_warp.kept import KeptRun, keep_of, members_kept
from lgvi_warp.observation import Observing, observation_of
from lgvi_warp.recipe import of_store, refuse_another, same_run
from lgvi_warp.result import Result
from lgvi_warp.running import Stored, explained
from lgvi_warp.scene import Scene
from lgvi_warp.store import (
    CREATED,
    KEPT,
    ROOT,
    Folder,
    Store,
    check,
    held,
    marker,
    name_of,
    refuse_foreign,
    understood,
)
from lgvi_warp.stored import folder_of, result_of


def resume(
    path: str | os.PathLike[str],
    fleet: Ensemble | Scene | None = None,
    *,
    executor: str | Executor = "threads",
    threads: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[float], None] | None = None,
    force: bool = False,
    keepers: Sequence[Keeper] = (),
    statistics: Sequence[Any] | None = None,
) -> Result:
    """Go on with a run in a store, or in a folder with one store: it ends with the bytes of a run that was never stopped.

    Every finished block is read and compared with its checksums; what is torn, missing or changed runs again. fleet: the
    ensemble, needed where a scene file cannot tell it (laws of your own). force: on another machine or with other
    versions, where the bits may differ. keepers: those that the run had. statistics: those that it had, needed where they
    are of functions. Raises SceneError, OSError, or MembersFailed as the run was asked to.
    """
    from lgvi_warp.solving import finished, provenance, went_on

    folder = Folder(folder_of(path))
    given = Ensemble.from_scene(fleet) if isinstance(fleet, Scene) else fleet
    plan = folder.plan(given)
    told = folder.provenance.get("observed")
    with understood(folder.path / ROOT):
        observed = observation_of(told, statistics)
    observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
    now = of_store(provenance(plan), plan.ensemble) | ({} if told is None else {"observed": told})
    messages = refuse_another(folder.path, folder.provenance, now, force)
    runner = executor_of(executor, threads, scheduler)
    # What the store says stays as it was when it was made, on whatever machine the run goes on.
    run = Stored(
        plan, store_of(folder, force), folder.provenance, folder.messages, (*keepers, *observing.keepers), None,
        observing.enough, KeptRun(observed, tuple((told or {}).get("fields", ()))),
    )  # fmt: skip
    made = run.run(runner, progress)
    told_now = messages + went_on(made)
    result = result_of(made, None, folder.messages + told_now, plan.ensemble.scene.terms, observing)
    return finished(result, plan, observed, (told or {}).get("fields", ()), threads)


def store_of(folder: Folder, force: bool = False) -> Store:
    """The settings that a folder was made with, to go on with."""
    own = folder.recipe["store"]
    fields = None if own["fields"] is None else tuple(own["fields"])
    return Store(folder.path, own["dtype"], fields, "resume", force, own["chunk_bytes"])


def merge(paths: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str], overwrite: bool = False) -> Folder:
    """Put the blocks of several stores of one run (`run --blocks`) into a new one. Returns it, complete or not.

    Every file is compared with its checksum on the way. Members that the run keeps (keep="failed" or indices) are run
    again here when all blocks are there, as `resume` does; a run that only its own ensemble can resume is not complete
    before that. Raises SceneError where they are not of one run, OSError.
    """
    parts = [Folder(folder_of(path)) for path in paths]
    first = parts[0]
    for other in parts[1:]:
        found = same_run(other.provenance, first.provenance, str(other.path), str(first.path))
        if found or other.recipe != first.recipe:
            found = found or ["another recipe"]
            raise SceneError(f"{text}: these are parts of different runs; merge parts of one run" for text in found)
    target = Path(out)
    target = target if target.suffix == ".zarr" else target / first.path.name
    try:
        with held(target):
            if os.path.lexists(target) and not overwrite:
                raise SceneError([f"{target}: holds a run already; give --overwrite, or another folder"])
            refuse_foreign(target)
            again = _put_together(parts, Path(os.path.realpath(target)))
    except OSError as error:
        raise explained(error, target) from error
    if again:
        # Another machine, or laws of a user's own: then it waits for lw.resume.
        with contextlib.suppress(SceneError, MembersFailed):
            resume(target)
    return Folder(target)


def _put_together(parts: Sequence[Folder], target: Path) -> bool:
    """Copy frame and blocks into a new store in the place of the target. Whether members are to be run again for it."""
    beside = scratch.beside(target, scratch.NEW)
    try:
        _copy_frame(_undamaged(parts), beside)
        made = Folder(beside)
        made.reopen()
        with Commits() as commits:
            for block in parts[0].runs:
                _copy_block(parts, block, beside, commits)
        whole = not made.unfinished()
        again = whole and len(members_kept(keep_of(made.provenance), made)) > 0
        if whole and not again:
            made.finish()
        durable.put_folder(beside, target)
    finally:
        scratch.remove_folder(beside)
    return again


def _undamaged(parts: Sequence[Folder]) -> Folder:
    """The first of them that is whole but for its blocks. Raises SceneError where none is."""
    damage = []
    for part in parts:
        if not (found := part.damage()):
            return part
        damage += [f"{part.path}: {text}; `lgvi-warp resume {part.path}` first" for text in found]
    raise SceneError(damage)


def _copy_frame(part: Folder, target: Path) -> None:
    """All of a store that belongs to no block: what was made with it. Raises SceneError, OSError."""
    files = durable.Files(target)
    for name in ("blocks", "parts"):
        (target / name).mkdir(parents=True)
    for key, size in (part.layout.frame() | {CREATED: None, ROOT: None}).items():
        (target / key).parent.mkdir(parents=True, exist_ok=True)
        files.write(key, safe_files.read(part.path, key, size or safe_files.MOST_JSON))
    files.finish()


def _copy_block(parts: Sequence[Folder], block: Block, target: Path, commits: Commits) -> None:
    """A block from the first of the stores that has it whole. Raises SceneError where each has it damaged."""
    damage = []
    for part in parts:
        sink = part.sink
        sums = sink.sums(block)
        if sums is None:
            continue
        if unfit := sink.unfit(block, sums, part.layout.times, part.recipe["keepers"]):
            damage += [f"{part.path}: {text}; `lgvi-warp resume {part.path}` first" for text in unfit]
            continue
        files = durable.Files(target)
        for key, wanted in sums.items():
            try:
                files.write(key, safe_files.read(part.path, key, wanted[0]))
            except FileNotFoundError:
                files.write(key, b"")
            if files.sums[key] != wanted:
                damage.append(f"{part.path / key}: is torn, missing or changed; `lgvi-warp resume {part.path}` first")
                files.drop()
                break
        else:
            commits.add(files, target / "blocks" / sink.marker(block).name, marker(sums))
            return
    if damage:
        raise SceneError(damage)


def state(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a store holds: members, samples, blocks finished and in all, members kept, complete, bytes, damage as texts.

    Every file is read. Raises SceneError where there is no run.
    """
    folder = Folder(folder_of(path))
    runs = folder.runs
    damage = folder.damage()
    samples, finished = folder.layout.times, 0
    for _, faults in check(folder.sink, runs, samples, folder.recipe["keepers"]):
        if faults != ["is not finished"]:
            finished += not faults
            damage += faults
    kept, faults = kept_state(folder, sound=not damage and finished == len(runs))
    damage += faults
    return {
        "path": folder.path,
        "members": folder.members,
        "samples": samples,
        "fields": list(folder.recipe["fields"] if (own := folder.recipe["store"]["fields"]) is None else own),
        "keepers": list(folder.recipe["keepers"]),
        "blocks": len(runs),
        "finished": finished,
        "kept": kept,
        "complete": folder.complete and finished == len(runs) and not damage,
        "bytes": safe_files.size_below(folder.path),
        "damage": damage,
        "provenance": folder.provenance,
    }


def kept_state(folder: Folder, sound: bool) -> tuple[int, list[str]]:
    """(members kept, what is wrong with their files); sound: nothing is wrong with those of the run."""
    wanted = len(members_kept(keep_of(folder.provenance), folder)) if folder.complete and sound else 0
    try:
        group = folder.kept()
    except SceneError:
        return wanted, [f"{KEPT}/{ROOT} is damaged"] if folder.complete else []
    if group is None:
        return wanted, [f"{KEPT} is missing"] if wanted else []
    damage = group.damage()
    for block, faults in check(group.sink, group.runs, group.layout.times):
        if faults == ["is not finished"]:
            faults = [f"blocks/{name_of(block)}.json is missing or damaged"] if folder.complete else []
        damage += faults
    return wanted, [f"{KEPT}/{text}" for text in damage]
