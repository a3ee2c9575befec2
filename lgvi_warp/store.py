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
from collections.abc import Container, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp import durable, machine, npy_files, safe_files, scratch, store_check, store_texts
from lgvi_warp.blocks import Block, Keeper, PartKeeper, blocks
from lgvi_warp.commits import Commits
from lgvi_warp.errors import Faults, SceneError
from lgvi_warp.recipe import ensemble_of, plan_of, recipe
from lgvi_warp.safe_files import parsed
from lgvi_warp.saveat import FIELDS
from lgvi_warp.store_blocks import BlockWriter, Room
from lgvi_warp.store_layout import MEMBER, Column, columns, parameter_units, size
from lgvi_warp.write_lock import write_lock

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

    def sums(self, block: Block) -> dict[str, list[int]] | None:
        """What the marker of a block lists; None if it is not finished. Raises SceneError where that is a link."""
        return read_marker(self.root, f"blocks/{name_of(block)}.json")

    def marker(self, block: Block) -> Path:
        """The file that says that a block is finished."""
        return self.root / "blocks" / f"{name_of(block)}.json"

    def parts(self, block: Block, keepers: Sequence[Keeper]) -> tuple[Any, ...] | None:
        """The parts of a finished block; None if it is not finished."""
        if self.sums(block) is None:
            return None
        if not keepers:
            return ()
        with understood(self.root / self.parts_key(block)):
            return unpacked(keepers, self.root, self.parts_key(block))

    def faults(self, block: Block, samples: int, keepers: Sequence[Any]) -> list[str]:
        """What is wrong with a finished block's files; "is not finished" alone for one that is not."""
        sums = self.sums(block)
        if sums is None:
            return ["is not finished"]
        if unfit := self.unfit(block, sums, samples, keepers):
            return unfit
        return [f"{key} {text}" for key, one in sums.items() if (text := durable.fault(self.root, key, *one))]

    def unfit(self, block: Block, sums: Mapping[str, Sequence[int]], samples: int, keepers: Sequence[Any]) -> list[str]:
        """What is wrong with the names and sizes in a block's marker: only its own chunks may be there, and its parts."""
        sizes = {key: column.bytes for column in self.columns for key in column.keys(block, samples)}
        parts = self.parts_key(block)
        found = [f"{key} is not in the marker" for key in (*sizes, *([parts] if keepers else [])) if key not in sums]
        strange = [key for key in sums if key not in sizes and key != parts]
        found += [f"{key!r:.100} is in the marker of block {name_of(block)}, and is no file of it" for key in strange]
        wrong = [key for key, size in sizes.items() if key in sums and sums[key][0] != size]
        return found + [f"{key} has {sums[key][0]} bytes in the marker, not {sizes[key]}" for key in wrong]

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


def unpacked(keepers: Sequence[Keeper], root: Path, key: str) -> tuple[Any, ...]:
    """The parts of these keepers, of all that were packed into a file below the root."""
    with npy_files.opened(root, key) as arrays:
        told = parsed(npy_files.text(arrays))
        found = {name: (dict(zip(names, arrays, strict=False)), content) for name, names, content in told}
    return tuple(keeper.from_arrays(*found[keeper.name]) for keeper in keepers if isinstance(keeper, PartKeeper))


def marker(sums: Mapping[str, list[int]]) -> bytes:
    """A list of files with sizes and checksums, and its own checksum in its last line."""
    text = json.dumps(dict(sorted(sums.items())), indent=0).encode()
    return text + b"\n%08x\n" % durable.checksum(text)


def read_marker(root: Path, key: str) -> dict[str, list[int]] | None:
    """What a marker below the root lists; None if there is none, or a damaged one. Raises SceneError where it is a link."""
    try:
        content = safe_files.read(root, key, safe_files.MOST_JSON)
        text, _, last = content.rstrip(b"\n").rpartition(b"\n")
        if int(last, 16) == durable.checksum(text):
            sums = dict(parsed(text))
            return sums if all(_is_sum(one) for one in sums.values()) else None
    except SceneError:
        raise
    except (OSError, ValueError, TypeError):
        pass
    return None


def _is_sum(value: Any) -> bool:
    """Whether it is a size and a checksum."""
    return isinstance(value, list) and len(value) == 2 and all(type(one) is int and one >= 0 for one in value)


@contextlib.contextmanager
def understood(path: Path) -> Iterator[None]:
    """What is no error of its own while a file is read is one of the file. Raises SceneError."""
    try:
        yield
    except SceneError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, IndexError, ArithmeticError, RecursionError) as error:
        text = " ".join(str(error).split())[:200] or type(error).__name__
        what = (
            text if isinstance(error, store_check.NotOursError) else f"cannot be used ({type(error).__name__}: {text})"
        )
        raise SceneError(
            [f"{path}: is not what lgvi-warp writes: {what}; ask for the run anew, or run it again"]
        ) from error


class Folder:
    """A store that exists, maybe somebody else's: what it says is checked before it is used. Its folder may be a link.

    within: the run that it is a group of. Raises SceneError where there is none, or its metadata is damaged.
    """

    def __init__(self, path: Path, within: Path | None = None):
        self.path, self.within = path, within or path
        needed()
        try:
            content = self._root()
            self.attributes: dict[str, Any] = content["attributes"]
            texts = [self.attributes[name] for name in ("provenance", "recipe", "messages", "shared")]
            good = self.attributes["format"] == FORMAT and self.attributes["crc32c"] == checksum_of(texts)
        except FileNotFoundError:
            raise SceneError([f"{path}: holds no run; give a folder that `lgvi-warp run --store zarr` made"]) from None
        except SceneError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError):
            good = False
        if not good:
            raise SceneError(
                [f"{path / ROOT}: is damaged, or of another version of the format; run again (--overwrite)"]
            )
        with understood(path / ROOT):
            self.provenance, self.recipe, messages, self.shared = (parsed(text) for text in texts)
            store_texts.check(self.attributes, self.provenance, self.recipe, messages, self.shared)
            self.messages: tuple[str, ...] = tuple(messages)
            self.layout = store_check.layout_of(content, int(self.recipe["members"]))
        # What this process did: blocks that it found whole, those that it ran, and those of kept members that it ran.
        self.found, self.ran, self.ran_kept = 0, 0, 0

    def _root(self) -> Any:
        """The root's metadata. Raises ValueError, SceneError, OSError."""
        if not self.path.is_dir():
            raise FileNotFoundError
        return safe_files.read_json(self.within, (self.path / ROOT).relative_to(self.within).as_posix())

    def kept(self) -> Folder | None:
        """The group of its kept members; None where there is none. Raises SceneError where it is damaged."""
        return Folder(self.path / KEPT, self.path) if os.path.lexists(self.path / KEPT) else None

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

    @property
    def sink(self) -> Sink:
        """What knows its blocks and their files."""
        return Sink(self.path, self.layout.columns)

    def checked(self) -> Any:
        """What zarr and xarray read it through."""
        from lgvi_warp.store_zarr import checked_store

        own = {name: value for name, value in self.attributes.items() if value is not None}
        return checked_store(self.path, self.layout, self.layout.root(own))

    def group(self) -> Any:
        """The zarr group, for reading."""
        import zarr

        return zarr.open_group(self.checked(), mode="r", zarr_format=3)

    def refuse_too_large(self) -> None:
        """Raise SceneError where what is read at once, numbers of members without times, is more than the memory."""
        each = sum(one.bytes for one in self.layout.columns if not one.times) * len(self.runs)
        memory = machine.memory_bytes() or 2**40
        if each > memory:
            what = f"has {self.members:,} members, of which {each / 1e9:.0f} GB are read at once, and the memory is"
            raise SceneError(
                [f"{self.path}: {what} {memory / 1e9:.0f} GB; read it on a larger machine, or run it again"]
            )

    def unfinished(self) -> list[Block]:
        """Blocks without a marker."""
        sink, marked = self.sink, safe_files.names(self.path, "blocks")
        return [block for block in self.runs if f"{name_of(block)}.json" not in marked or sink.sums(block) is None]

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
        with understood(self.path / ROOT):
            if ensemble is None:
                noise = given.pop("indices", None)
                ensemble = ensemble_of(self.provenance["scene"], self.provenance["ensemble"], given, noise, self.path)
            return plan_of(self.recipe, ensemble, steps, times)

    def damage(self) -> list[str]:
        """What is wrong with the files that do not belong to a block."""
        sums, wanted = read_marker(self.path, CREATED), self.layout.frame()
        if sums is None:
            return [f"{CREATED} is damaged"]
        if sums.keys() != wanted.keys() or any(size not in (None, sums[key][0]) for key, size in wanted.items()):
            return [f"{CREATED} does not fit the arrays in {ROOT}"]
        found = {key: text for key, one in sums.items() if (text := durable.fault(self.path, key, *one))}
        return [f"{key} {text}" for key, text in found.items()] + self._unlike(found)

    def _unlike(self, damaged: Container[str]) -> list[str]:
        """Arrays whose own metadata is whole and says something else than that of the root."""
        unlike = []
        for name, array in self.layout.arrays.items():
            key = f"{name}/{ROOT}"
            if key not in damaged and safe_files.read_json(self.path, key) != array.metadata():
                unlike.append(f"{key} says something else than {ROOT}")
        return unlike

    def finish(self, members: int | None = None) -> None:
        """Say that the run is complete; members: with so many, where it ended before the last of the ensemble."""
        if not self.complete:
            self._say({"complete": True} | ({} if members is None else {"members": members}), below(self.path / KEPT))

    def take_layout(self, other: Path) -> None:
        """Say of the arrays what the root's metadata of another folder of the same run says; then it is not complete."""
        content, right = self._root(), safe_files.read_json(other, ROOT)
        if Folder(other).layout != self.layout:
            right["attributes"] = content["attributes"] | {"complete": False}
            durable.write_whole(self.path / ROOT, json.dumps(right, indent=2).encode())

    def reopen(self) -> None:
        """Say that the run is not complete."""
        if self.complete:
            self._say({"complete": False}, {})

    def _say(self, said: dict[str, Any], kept: dict[str, Any]) -> None:
        """Write attributes of the run, and what lies in the group of its kept members."""
        content = self._root()
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
    own = safe_files.read_json(path.parent, f"{path.name}/{ROOT}")
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
    target = Path(os.path.realpath(store.folder))
    check_names(columns(plan, store))
    free_enough(target, size(plan, store))
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = scratch.beside(target, scratch.NEW)
    try:
        skeleton(beside, store, plan, provenance, messages, keepers)
        durable.put_folder(beside, target)
    finally:
        scratch.remove_folder(beside)


def check_names(found: Sequence[Column]) -> None:
    """Each array's name becomes that of a folder. Raises SceneError."""
    faults = Faults("store.")
    for name in (one.name for one in found if not store_check.is_name(one.name)):
        remedy = 'give the term or event another name, without / \\ : * ? " < > | and of 200 bytes at most'
        faults.add("fields", name, "cannot be the name of a folder", remedy)
    faults.raise_if_any()


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
    sink: Sink, runs: Sequence[Block], samples: int, keepers: Sequence[Any] = ()
) -> Iterator[tuple[Block, list[str]]]:
    """Each block and what is wrong with it (see Sink.faults), every file read, in order."""
    with ThreadPoolExecutor(machine.thread_count()) as pool:
        found = pool.map(lambda block: sink.faults(block, samples, keepers), runs)
        yield from zip(runs, found, strict=True)


@contextlib.contextmanager
def held(path: Path) -> Iterator[None]:
    """Keep other runs out of a store that is there or will be, from before the look at it; mend what a killed one left.

    Raises SceneError naming the run that is at work in it, OSError.
    """
    with write_lock(path):
        place = Path(os.path.realpath(path))
        durable.restored(place)
        for beside in scratch.left_behind(place):
            if beside.suffix in (scratch.NEW, scratch.OLD) and not foreign(beside):
                scratch.remove_folder(beside)
        yield


def foreign(path: Path) -> str | None:
    """What no run has written of a folder, or why it is none of a run; None where all of it is a run's."""
    if path.is_symlink() or not path.is_dir():
        return "is no folder of a run"
    names = []
    for name, entry in safe_files.entries(path):
        folder = entry.is_dir(follow_symlinks=False)
        if not folder and not (entry.is_file(follow_symlinks=False) and store_check.is_file_of_store(name)):
            return f"holds {name}, which no run wrote"
        names += [] if folder else [name]
    if names and not {ROOT, CREATED} & set(names) and not any(scratch.is_unfinished(one) for one in names):
        return f"holds {names[0]}, and nothing that says that it is a run"
    return None


def refuse_foreign(path: Path) -> None:
    """Raise SceneError where a folder that is to be replaced holds what no run wrote."""
    if os.path.lexists(path) and (what := foreign(Path(os.path.realpath(path)))):
        raise SceneError([f"{path}: {what}; it is not overwritten: move it away, or give another folder"])
