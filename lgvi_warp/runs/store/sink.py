"""To be said in one sentence."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common import machine, npy_files, safe_files
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.engine.block import Block
from lgvi_warp.engine.keepers.protocol import Keeper, PartKeeper
from lgvi_warp.runs.store.commits import Commits
from lgvi_warp.runs.store.layout import Column
from lgvi_warp.runs.store.layout_check import is_sum, understood
from lgvi_warp.runs.store.writer import BlockWriter, Room

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


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

    def understood(self, block: Block) -> AbstractContextManager[None]:
        """While the parts of a block that was there are used: what is wrong with them is told as theirs."""
        return understood(self.root / self.parts_key(block))

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
            return sums if all(is_sum(one) for one in sums.values()) else None
    except SceneError:
        raise
    except (OSError, ValueError, TypeError):
        pass
    return None


def check(
    sink: Sink, runs: Sequence[Block], samples: int, keepers: Sequence[Any] = ()
) -> Iterator[tuple[Block, list[str]]]:
    """Each block and what is wrong with it (see Sink.faults), every file read, in order."""
    with ThreadPoolExecutor(machine.thread_count()) as pool:
        found = pool.map(lambda block: sink.faults(block, samples, keepers), runs)
        yield from zip(runs, found, strict=True)
