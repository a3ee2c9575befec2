"""A run on disk: a zarr v3 group, written block by block, each block marked when all of it is safe.

    run.zarr/zarr.json            attributes: provenance, recipe, messages, complete
    run.zarr/position/c.0.3.0     chunk: times 0, block 3 (see store_layout)
    run.zarr/parts/000000768.npy  what keepers closed the block with
    run.zarr/blocks/000000768.json   the block that begins with member 768 is finished: its files, sizes, checksums
    run.zarr/kept/                a group like the run's own, of members that were run again for their samples (see kept)

Nothing in it tells the time of day: the same run leaves the same bytes.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import shutil
import warnings
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp import durable, machine
from lgvi_warp.blocks import Block, Keeper, PartKeeper, blocks
from lgvi_warp.commits import Commits
from lgvi_warp.errors import Faults, SceneError
from lgvi_warp.recipe import ensemble_of, plan_of, recipe
from lgvi_warp.saveat import FIELDS
from lgvi_warp.store_blocks import BlockWriter, Room
from lgvi_warp.store_layout import MEMBER, Column, columns, parameter_units, size

if TYPE_CHECKING:
    from lgvi_warp.ensemble import Ensemble
    from lgvi_warp.plan import Plan

FORMAT = 2
# Few enough bytes a chunk for its memory, enough that files and their syncs cost little.
CHUNK_BYTES = 10_000_000
EXISTING = ("refuse", "resume", "overwrite")
ROOT, CREATED, KEPT = "zarr.json", "created.json", "kept"
# Room that is left on a disk: markers, metadata, folders.
SPARE_BYTES = 20_000_000


@dataclass(frozen=True)
class Store:
    """Where a run is written, and how.

    path: a folder whose name ends in .zarr. dtype: "float32" stores the samples of a float64 run in single precision.
    fields: those of the samples to store, default all that are kept. chunk_bytes: about so large a chunk becomes at most;
    each block at work holds one of each field. existing: what to do where a run lies already:
    "refuse", "resume" (go on where it stopped, if it is the same run) or "overwrite". force: go on even on another
    machine or with other versions. Raises SceneError naming every fault.
    """

    path: str | os.PathLike[str]
    dtype: str | None = None
    fields: tuple[str, ...] | None = None
    existing: str = "refuse"
    force: bool = False
    chunk_bytes: int = CHUNK_BYTES

    def __post_init__(self) -> None:
        faults = Faults("store.")
        if not isinstance(self.path, str | os.PathLike) or self.whole.suffix != ".zarr":
            faults.add("path", self.path, "is no folder of a store", 'end its name in .zarr: "runs/x/run.zarr"')
        if self.dtype is not None:
            faults.choice("dtype", self.dtype, ("float32", "float64"))
        faults.choice("existing", self.existing, EXISTING)
        for name in self.fields or ():
            faults.choice("fields", name, FIELDS)
        faults.number("chunk_bytes", self.chunk_bytes, "bytes", least=1)
        faults.raise_if_any()
        needed()

    def layout(self) -> dict[str, Any]:
        """What the bytes in it depend on, as JSON has it."""
        fields = None if self.fields is None else list(self.fields)
        return {"dtype": self.dtype, "fields": fields, "chunk_bytes": int(self.chunk_bytes)}

    @property
    def folder(self) -> Path:
        """Its path."""
        return Path(self.path)

    @property
    def along(self) -> str:
        """What its arrays call the dimension of members."""
        return MEMBER

    @property
    def whole(self) -> Path:
        """The folder of the whole run."""
        return self.folder

    def write_given(self, group: Any, plan: Plan) -> None:
        """States and parameters that were given as arrays: nothing else tells them."""
        given, units = plan.ensemble.explicit(), parameter_units(plan.ensemble.scene)
        explicit = group.create_group("explicit")
        for name, values in given.items():
            dims = (
                f"{MEMBER}_given" if name != "indices" else MEMBER,
                *(f"{name}_{i}" for i in range(values.ndim - 1)),
            )
            whole_array(explicit, name, values, dims, {"units": units.get(name, "1")})


def needed() -> None:
    """Raise SceneError where the libraries of stores are not installed."""
    try:
        import google_crc32c  # noqa: F401
        import xarray  # noqa: F401
        import zarr  # noqa: F401
    except ImportError as error:
        raise SceneError([f"store: {error}; install it: pip install 'lgvi-warp[store]'"]) from error


def name_of(block: Block) -> str:
    """What a block's files are called by."""
    return f"{block.first:09d}"


@dataclass(frozen=True)
class Sink:
    """The keeper that writes blocks into a store, from threads, processes or other machines that see its folder."""

    root: Path
    columns: tuple[Column, ...]
    room: Room = field(default_factory=Room, compare=False)
    commits: Commits = field(default_factory=Commits, compare=False)

    def open(self, plan: Plan, block: Block, members: Any) -> BlockWriter:
        """A writer of the block's chunks."""
        return BlockWriter(self.root, self.columns, self.room, plan, block, members)

    def merge(self, block: Block, part: Any) -> None:
        """The block is in its place already."""

    def finish(self, block: Block, files: durable.Files, keepers: Sequence[Keeper], parts: Sequence[Any]) -> None:
        """Hand a block over to be made durable, with the parts of keepers, and marked. Raises OSError."""
        if keepers:
            files.write(self.parts_key(block), packed(keepers, parts))
        self.commits.add(files, self.marker(block), marker(files.sums))

    @staticmethod
    def parts_key(block: Block) -> str:
        """The file of what keepers closed a block with, below the root."""
        return f"parts/{name_of(block)}.npy"

    def marker(self, block: Block) -> Path:
        """The file that says that a block is finished."""
        return self.root / "blocks" / f"{name_of(block)}.json"

    def parts(self, block: Block, keepers: Sequence[Keeper]) -> tuple[Any, ...] | None:
        """The parts of a finished block; None if it is not finished."""
        if read_marker(self.marker(block)) is None:
            return None
        return unpacked(keepers, self.root / self.parts_key(block)) if keepers else ()

    def faults(self, block: Block, samples: int, keepers: Sequence[Keeper]) -> list[str]:
        """What is wrong with a finished block's files; "is not finished" alone for one that is not."""
        sums = read_marker(self.marker(block))
        if sums is None:
            return ["is not finished"]
        wanted = [key for column in self.columns for key in column.keys(block, samples)]
        wanted += [self.parts_key(block)] if keepers else []
        found = [(key, "is not in the marker") for key in wanted if key not in sums]
        found += [(key, text) for key, one in sums.items() if (text := durable.fault(self.root, key, *one))]
        return [f"{key} {text}" for key, text in found]

    def remove(self, runs: Sequence[Block], samples: int) -> None:
        """Remove all there is of these blocks, their markers first."""
        for block in runs:
            self.marker(block).unlink(missing_ok=True)
        for block in runs:
            for column in self.columns:
                for key in column.keys(block, samples):
                    (self.root / key).unlink(missing_ok=True)
            (self.root / self.parts_key(block)).unlink(missing_ok=True)

    def remove_unfinished(self) -> None:
        """Remove what killed writers left."""
        names = ("blocks", "parts", *(column.name for column in self.columns))
        durable.remove_unfinished([self.root, *(self.root / name for name in names)])


def packed(keepers: Sequence[Keeper], parts: Sequence[Any]) -> bytes:
    """What keepers closed a block with, always the same bytes: a JSON text, then the arrays, each as in an .npy file."""
    told: list[tuple[str, list[str], Any]] = []
    arrays: list[np.ndarray] = []
    for keeper, part in zip(keepers, parts, strict=True):
        assert isinstance(keeper, PartKeeper)
        own, content = keeper.to_arrays(part)
        told.append((keeper.name, list(own), content))
        arrays += own.values()
    buffer = io.BytesIO()
    for values in (np.array(json.dumps(told, sort_keys=True)), *arrays):
        np.save(buffer, values, allow_pickle=False)
    return buffer.getvalue()


def unpacked(keepers: Sequence[Keeper], path: Path) -> tuple[Any, ...]:
    """The parts of these keepers, of all that were packed."""
    with path.open("rb") as file:
        told = json.loads(str(np.load(file)))
        found = {name: ({one: np.load(file) for one in arrays}, content) for name, arrays, content in told}
    return tuple(keeper.from_arrays(*found[keeper.name]) for keeper in keepers if isinstance(keeper, PartKeeper))


def marker(sums: Mapping[str, list[int]]) -> bytes:
    """A list of files with sizes and checksums, and its own checksum in its last line."""
    text = json.dumps(dict(sorted(sums.items())), indent=0).encode()
    return text + b"\n%08x\n" % durable.checksum(text)


def read_marker(path: Path) -> dict[str, list[int]] | None:
    """What a marker lists; None if there is none, or a damaged one."""
    try:
        text, _, last = path.read_bytes().rstrip(b"\n").rpartition(b"\n")
        if int(last, 16) == durable.checksum(text):
            return dict(json.loads(text))
    except (OSError, ValueError):
        pass
    return None


class Folder:
    """A store that exists. Raises SceneError where there is none, or its metadata is damaged."""

    def __init__(self, path: Path):
        self.path = path
        needed()
        try:
            content = json.loads((path / ROOT).read_bytes())
            self.attributes: dict[str, Any] = content["attributes"]
            texts = [self.attributes[name] for name in ("provenance", "recipe", "messages", "shared")]
            good = self.attributes["format"] == FORMAT and self.attributes["crc32c"] == checksum_of(texts)
        except FileNotFoundError:
            raise SceneError([f"{path}: holds no run; give a folder that `lgvi-warp run --store zarr` made"]) from None
        except (ValueError, KeyError, TypeError):
            good = False
        if not good:
            raise SceneError(
                [f"{path / ROOT}: is damaged, or of another version of the format; run again (--overwrite)"]
            )
        self.provenance, self.recipe, messages, self.shared = (json.loads(text) for text in texts)
        self.messages: tuple[str, ...] = tuple(messages)
        # What this process did: blocks that it found whole, those that it ran, and those of kept members that it ran.
        self.found, self.ran, self.ran_kept = 0, 0, 0

    @property
    def complete(self) -> bool:
        """Whether every block was finished when the run ended."""
        return bool(self.attributes["complete"])

    @property
    def members(self) -> int:
        """n; fewer than the ensemble has where the run ended because there were enough."""
        return int(self.attributes.get("members", self.recipe["members"]))

    @property
    def runs(self) -> list[Block]:
        """The blocks of these members, in order."""
        return [block for block in blocks(int(self.recipe["members"])) if block.first < self.members]

    def group(self) -> Any:
        """The zarr group, for reading."""
        import zarr

        return zarr.open_group(self.path, mode="r", zarr_format=3)

    def unfinished(self) -> list[Block]:
        """Blocks without a marker."""
        sink = Sink(self.path, ())
        return [block for block in self.runs if read_marker(sink.marker(block)) is None]

    def plan(self, ensemble: Ensemble | None = None) -> Plan:
        """The run's plan, made again; ensemble: where a scene file cannot tell it (laws of your own). Raises SceneError."""
        try:
            # A chunk that is missing reads as NaN or 0.
            lost = [text for text in self.damage() if text.startswith(("time/", "step/", "explicit/"))]
            group = self.group()
            steps, times = group["step"][:].astype(np.int64), group["time"][:]
            given = {name: np.asarray(array[:]) for name, array in group["explicit"].arrays()}
            if lost or not np.isfinite(times).all():
                raise ValueError("times are missing")
        except (ValueError, OSError, KeyError) as error:
            remedy = "run the same scene again with --store zarr --resume, which mends it"
            raise SceneError([f"{self.path}: {'; '.join(self.damage()) or error}; {remedy}"]) from error
        if ensemble is None:
            noise = given.pop("indices", None)
            ensemble = ensemble_of(self.provenance["scene"], self.provenance["ensemble"], given, noise, self.path)
        return plan_of(self.recipe, ensemble, steps, times)

    def damage(self) -> list[str]:
        """What is wrong with the files that do not belong to a block."""
        sums = read_marker(self.path / CREATED)
        if sums is None:
            return [f"{CREATED} is damaged"]
        return [f"{key} {text}" for key, one in sums.items() if (text := durable.fault(self.path, key, *one))]

    def finish(self, members: int | None = None) -> None:
        """Say that the run is complete; members: with so many, where it ended before the last of the ensemble."""
        if not self.complete:
            self._say({"complete": True} | ({} if members is None else {"members": members}), below(self.path / KEPT))

    def reopen(self) -> None:
        """Say that the run is not complete."""
        if self.complete:
            self._say({"complete": False}, {})

    def _say(self, said: dict[str, Any], kept: dict[str, Any]) -> None:
        """Write attributes of the run, and what lies in the group of its kept members."""
        content = json.loads((self.path / ROOT).read_bytes())
        content["attributes"] |= said
        arrays = content["consolidated_metadata"]["metadata"]
        own = {name: one for name, one in arrays.items() if name.partition("/")[0] != KEPT}
        content["consolidated_metadata"]["metadata"] = own | kept
        durable.write_whole(self.path / ROOT, json.dumps(content, indent=2).encode())
        self.attributes |= said


def below(path: Path) -> dict[str, Any]:
    """Metadata of a group and its arrays, as that of the group it lies in has them; none of one that is not there."""
    if not path.exists():
        return {}
    own = json.loads((path / ROOT).read_bytes())
    arrays = own["consolidated_metadata"]["metadata"]
    own["consolidated_metadata"] = {**own["consolidated_metadata"], "metadata": {}}
    return {path.name: own} | {f"{path.name}/{name}": one for name, one in arrays.items()}


def checksum_of(texts: Sequence[str]) -> int:
    """Of several texts."""
    return durable.checksum("\0".join(texts).encode())


def create(
    store: Store, plan: Plan, provenance: Mapping[str, Any], messages: Sequence[str], keepers: Sequence[Keeper] = ()
) -> None:
    """Make the store's folder with all of its metadata, whole or not at all. Raises SceneError or OSError.

    keepers: whose parts it will hold; the recipe has their names.
    """
    target = store.folder
    free_enough(target, size(plan, store))
    target.parent.mkdir(parents=True, exist_ok=True)
    beside, old = (target.with_name(target.name + end) for end in (".new", ".old"))
    for one in (beside, old):
        shutil.rmtree(one, ignore_errors=True)
    try:
        skeleton(beside, store, plan, provenance, messages, keepers)
        if target.exists():
            target.replace(old)
            beside.replace(target)
            shutil.rmtree(old)
        else:
            beside.replace(target)
        durable.sync_folder(target.parent)
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise


def names_of(keepers: Sequence[Keeper]) -> list[str]:
    """What the parts of keepers are called by."""
    return [keeper.name for keeper in keepers if isinstance(keeper, PartKeeper)]


def free_enough(path: Path, wanted: int) -> None:
    """Raise SceneError where a disk has less room than a run needs."""
    there = path.absolute()
    while not there.exists():
        there = there.parent
    free = shutil.disk_usage(there).free
    if wanted + SPARE_BYTES > free:
        what = f"needs {wanted / 1e9:.2f} GB, and the disk has {free / 1e9:.2f} GB left"
        remedy = "save less often or fewer fields (SaveAt), store float32 (--store-dtype float32), or use another disk"
        raise SceneError([f"store = {path}: {what}; {remedy}"])


def skeleton(
    root: Path,
    store: Store,
    plan: Plan,
    provenance: Mapping[str, Any],
    messages: Sequence[str],
    keepers: Sequence[Keeper] = (),
) -> None:
    """Groups and arrays without their blocks, on the disk."""
    import zarr
    from zarr.storage import MemoryStore

    shared = {
        name: values.tolist()
        for name, values in plan.ensemble.parameters(0, 1).items()
        if name not in plan.ensemble.varied()
    }
    made = recipe(plan) | {"store": store.layout(), "keepers": names_of(keepers)}
    texts = [json.dumps(one) for one in (provenance, made, list(messages), shared)]
    # zarr writes into memory and `files` onto the disk, side by side: one by one the files would take several times as long.
    inside: dict[str, Any] = {}
    own = MemoryStore(inside)
    group = zarr.create_group(own, zarr_format=3, attributes=_attributes(texts, provenance))
    k, n = len(plan.grid.times), plan.ensemble.members
    whole_array(
        group, "time", plan.grid.times, ("time",), {"units": "s", "long_name": "time since the start", "axis": "T"}
    )
    whole_array(group, "step", plan.grid.sample_steps, ("time",), {"units": "1", "long_name": "steps made until then"})
    for column in columns(plan, store):
        _array(group, column.name, column.shape(k, n), column.chunk, column.dtype, column.fill, column.dims,
               column.attributes)  # fmt: skip
    store.write_given(group, plan)
    with warnings.catch_warnings():
        # Consolidated metadata is what lets xarray open the store in one read; zarr remarks that version 3 has no rule for it.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(own, zarr_format=3)
    for folder in {os.path.dirname(key) for key in inside} | {"blocks", "parts"}:
        (root / folder).mkdir(parents=True, exist_ok=True)
    files = durable.Files(root)
    for key in sorted(inside):
        files.write(key, inside.pop(key).as_numpy_array())
    # The root's metadata will change: it has a checksum of its own.
    files.write(CREATED, marker({key: one for key, one in files.sums.items() if key != ROOT}))
    files.finish()


def _attributes(texts: Sequence[str], provenance: Mapping[str, Any]) -> dict[str, Any]:
    versions = provenance["versions"]
    return {
        "Conventions": "CF-1.11",
        "title": "Ensemble of underwater vehicles",
        "source": f"lgvi-warp {versions['lgvi-warp']}, method {provenance['method']['name']}",
        "format": FORMAT,
        "complete": False,
        "provenance": texts[0],
        "recipe": texts[1],
        "messages": texts[2],
        "shared": texts[3],
        "crc32c": checksum_of(texts),
    }


def _array(group: Any, name: str, shape: Any, chunks: Any, dtype: str, fill: Any, dims: Any, attributes: Any) -> Any:
    """An array of raw little-endian numbers with a checksum a chunk."""
    from zarr.codecs import BytesCodec, Crc32cCodec

    return group.create_array(
        name, shape=shape, chunks=chunks, dtype=dtype, fill_value=fill, dimension_names=dims, attributes=attributes,
        serializer=BytesCodec(endian="little"), compressors=[Crc32cCodec()], filters=None,
        chunk_key_encoding={"name": "default", "separator": "."}, config={"write_empty_chunks": True},
    )  # fmt: skip


def whole_array(group: Any, name: str, values: np.ndarray, dims: tuple[str, ...], attributes: dict[str, Any]) -> None:
    """A small array, written at once."""
    values = np.ascontiguousarray(values)
    fill = np.nan if values.dtype.kind == "f" else 0
    dtype = values.dtype.newbyteorder("<").str
    _array(group, name, values.shape, values.shape, dtype, fill, dims, attributes)[:] = values


def check(
    sink: Sink, runs: Sequence[Block], samples: int, keepers: Sequence[Keeper] = ()
) -> Iterator[tuple[Block, list[str]]]:
    """Each block and what is wrong with it (see Sink.faults), every file read, in order."""
    with ThreadPoolExecutor(machine.thread_count()) as pool:
        found = pool.map(lambda block: sink.faults(block, samples, keepers), runs)
        yield from zip(runs, found, strict=True)


@contextlib.contextmanager
def held(path: Path) -> Iterator[None]:
    """Keep other runs out of a store. Raises SceneError where one is at work in it."""
    with durable.locked(path) as mine:
        if not mine:
            raise SceneError([f"{path}: another run is writing into it; wait for it, or end it"])
        yield
