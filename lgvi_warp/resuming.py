"""Go on with a run that was stopped; put the parts of one run together; say what a store holds."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lgvi_warp import durable
from lgvi_warp.blocks import Block, Keeper
from lgvi_warp.ensemble import Ensemble
from lgvi_warp.errors import SceneError
from lgvi_warp.executors import Executor, executor_of
from lgvi_warp.observation import Observing, observation_of
from lgvi_warp.recipe import of_store, refuse_another
from lgvi_warp.result import Result
from lgvi_warp.running import Stored
from lgvi_warp.scene import Scene
from lgvi_warp.store import CREATED, ROOT, Folder, Sink, Store, check, read_marker
from lgvi_warp.store_layout import columns
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
    from lgvi_warp.solving import finished, provenance

    folder = Folder(folder_of(path))
    given = Ensemble.from_scene(fleet) if isinstance(fleet, Scene) else fleet
    plan = folder.plan(given)
    told = folder.provenance.get("observed")
    observed = observation_of(told, statistics)
    observing = Observing(observed, plan.grid.times, plan.ensemble.members, plan.ensemble.replicates)
    now = of_store(provenance(plan), plan.ensemble) | ({} if told is None else {"observed": told})
    messages = refuse_another(folder.path, folder.provenance, now, force)
    runner = executor_of(executor, threads, scheduler)
    # What the store says stays as it was when it was made, on whatever machine the run goes on.
    run = Stored(
        plan, store_of(folder, force), folder.provenance, folder.messages, (*keepers, *observing.keepers), None,
        observing.enough,
    )  # fmt: skip
    result = result_of(
        run.run(runner, progress), None, folder.messages + messages, plan.ensemble.scene.terms, observing
    )
    return finished(result, plan, observed, (told or {}).get("fields", ()), threads)


def store_of(folder: Folder, force: bool = False) -> Store:
    """The settings that a folder was made with, to go on with."""
    own = folder.recipe["store"]
    fields = None if own["fields"] is None else tuple(own["fields"])
    return Store(folder.path, own["dtype"], fields, "resume", force, own["chunk_bytes"])


def merge(paths: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str], overwrite: bool = False) -> Folder:
    """Put the blocks of several stores of one run (`run --blocks`) into a new one. Returns it, complete or not.

    Every file is compared with its checksum on the way. Raises SceneError where they are not of one run, OSError.
    """
    parts = [Folder(folder_of(path)) for path in paths]
    first = parts[0]
    for other in parts[1:]:
        refuse_another(other.path, other.provenance, first.provenance, force=False)
        if other.recipe != first.recipe:
            raise SceneError([f"{other.path}: is of another run than {first.path}; merge parts of one run"])
    target = Path(out)
    target = target if target.suffix == ".zarr" else target / first.path.name
    if target.exists() and not overwrite:
        raise SceneError([f"{target}: holds a run already; give --overwrite, or another folder"])
    beside = target.with_name(target.name + ".new")
    shutil.rmtree(beside, ignore_errors=True)
    shutil.copytree(first.path, beside, ignore=lambda folder, names: _of_blocks(first.path, folder, names))
    made = Folder(beside)
    for block in first.runs:
        _copy_block(parts, block, beside)
    if not made.unfinished():
        made.finish()
    shutil.rmtree(target, ignore_errors=True)
    beside.replace(target)
    durable.sync_folder(target.parent)
    return Folder(target)


def _of_blocks(root: Path, folder: str, names: Sequence[str]) -> set[str]:
    """Names in a folder that are not in the list of what was made with the store."""
    made = {*(read_marker(root / CREATED) or {}), ROOT, CREATED}
    inside = Path(folder).relative_to(root)
    return {name for name in names if (Path(folder) / name).is_file() and (inside / name).as_posix() not in made}


def _copy_block(parts: Sequence[Folder], block: Block, target: Path) -> None:
    """A block from the first of the stores that has it whole. Raises SceneError where each has it damaged."""
    damage = []
    for part in parts:
        sink = Sink(part.path, ())
        sums = read_marker(sink.marker(block))
        if sums is None:
            continue
        files = durable.Files(target)
        for key, (_, crc) in sums.items():
            try:
                data = (part.path / key).read_bytes()
            except FileNotFoundError:
                data = b""
            (target / key).parent.mkdir(parents=True, exist_ok=True)
            files.write(key, data)
            if files.sums[key][1] != crc:
                damage.append(f"{part.path / key}: is torn, missing or changed; `lgvi-warp resume {part.path}` first")
                files.drop()
                break
        else:
            files.finish()
            durable.write_whole(target / "blocks" / sink.marker(block).name, sink.marker(block).read_bytes())
            return
    if damage:
        raise SceneError(damage)


def state(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a store holds: members, samples, blocks finished and in all, complete, bytes, and its damage as texts.

    Every file is read. Raises SceneError where there is no run.
    """
    folder = Folder(folder_of(path))
    runs = folder.runs
    damage = folder.damage()
    samples = int(folder.group()["time"].shape[0])
    try:
        found = columns(folder.plan(), store_of(folder))
    except SceneError:  # a law that this process does not know: the markers alone say what there should be
        found = ()
    finished = 0
    for _, faults in check(Sink(folder.path, found), runs, samples):
        if faults != ["is not finished"]:
            finished += not faults
            damage += faults
    return {
        "path": folder.path,
        "members": folder.members,
        "samples": samples,
        "fields": list(folder.recipe["fields"] if (own := folder.recipe["store"]["fields"]) is None else own),
        "keepers": list(folder.recipe["keepers"]),
        "blocks": len(runs),
        "finished": finished,
        "complete": folder.complete and finished == len(runs) and not damage,
        "bytes": sum(path.stat().st_size for path in folder.path.rglob("*") if path.is_file()),
        "damage": damage,
        "provenance": folder.provenance,
    }
