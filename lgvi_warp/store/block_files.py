# SPDX-License-Identifier: Apache-2.0
"""`BlockFiles`: the keeper that writes blocks into a store and knows their files; the format of markers and of parts."""

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
from lgvi_warp.store.commits import Commits
from lgvi_warp.store.layout import StoreArray
from lgvi_warp.store.layout_check import corrupt_store_as_scene_error, is_sum
from lgvi_warp.store.writer import BlockWriter, Room

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


def name_of(block: Block) -> str:
    """Return the name of a block's files without their suffix."""
    return f"{block.first:09d}"


@dataclass(frozen=True)
class BlockFiles:
    """Keeper that writes blocks into a store. It may run in threads, processes or other machines that share the folder.

    columns: The arrays that are written block by block.
    room: Memory for chunks.
    commits: Queue of the blocks that are not durable yet.
    """

    root: Path
    columns: tuple[StoreArray, ...]
    room: Room = field(default_factory=Room, compare=False)
    commits: Commits = field(default_factory=Commits, compare=False)

    def open(self, plan: Plan, block: Block, members: Any) -> BlockWriter:
        """Open a writer of a block's chunks."""
        return BlockWriter(self.root, self.columns, self.room, plan, block, members)

    def understood(self, block: Block) -> AbstractContextManager[None]:
        """Turn errors that arise while a block's parts are used into faults of the parts' file."""
        return corrupt_store_as_scene_error(self.root / self.parts_key(block))

    def merge(self, block: Block, part: Any) -> None:
        """Do nothing: the block is already in its place."""

    def finish(self, block: Block, files: durable.Files, keepers: Sequence[Keeper], parts: Sequence[Any]) -> None:
        """Pass a block on to be made durable and marked."""
        if keepers:
            files.write(self.parts_key(block), packed(keepers, parts))
        self.commits.add(files, self.marker(block), marker(files.sums))

    @staticmethod
    def parts_key(block: Block) -> str:
        """Return the path of the file with a block's parts of the keepers."""
        return f"parts/{name_of(block)}.npy"

    def sums(self, block: Block) -> dict[str, list[int]] | None:
        """Read a block's marker: [size, checksum] by path of the file; None if the block is not finished."""
        return read_marker(self.root, f"blocks/{name_of(block)}.json")

    def marker(self, block: Block) -> Path:
        """Return the path of a block's marker, the file whose existence says that the block is finished."""
        return self.root / "blocks" / f"{name_of(block)}.json"

    def parts(self, block: Block, keepers: Sequence[Keeper]) -> tuple[Any, ...] | None:
        """Read the parts of a block, one for each keeper; None if the block is not finished."""
        if self.sums(block) is None:
            return None
        if not keepers:
            return ()
        with corrupt_store_as_scene_error(self.root / self.parts_key(block)):
            return unpacked(keepers, self.root, self.parts_key(block))

    def faults(self, block: Block, samples: int, keepers: Sequence[Any]) -> list[str]:
        """Compare a block's files with its marker."""
        sums = self.sums(block)
        if sums is None:
            return ["is not finished"]
        if unfit := self.unfit(block, sums, samples, keepers):
            return unfit
        return [f"{key} {text}" for key, text in damaged(self.root, sums).items()]

    def unfit(self, block: Block, sums: Mapping[str, Sequence[int]], samples: int, keepers: Sequence[Any]) -> list[str]:
        """Check the names and sizes in a block's marker: only the block's own chunks and parts may be there."""
        sizes = {key: column.bytes for column in self.columns for key in column.keys(block, samples)}
        parts = self.parts_key(block)
        faults = [f"{key} is not in the marker" for key in (*sizes, *([parts] if keepers else [])) if key not in sums]
        strange = [key for key in sums if key not in sizes and key != parts]
        faults += [
            f"{key!r:.100} is in the marker of block {name_of(block)}, and is not a file of it" for key in strange
        ]
        wrong = [key for key, size in sizes.items() if key in sums and sums[key][0] != size]
        return faults + [f"{key} has {sums[key][0]} bytes in the marker, not {sizes[key]}" for key in wrong]

    def remove(self, runs: Sequence[Block], samples: int) -> None:
        """Remove all files of blocks, their markers first."""
        for block in runs:
            self.marker(block).unlink(missing_ok=True)
        for block in runs:
            for column in self.columns:
                for key in column.keys(block, samples):
                    (self.root / key).unlink(missing_ok=True)
            (self.root / self.parts_key(block)).unlink(missing_ok=True)

    def remove_unfinished(self) -> None:
        """Remove the unfinished files that killed processes left behind."""
        names = ("blocks", "parts", *(column.name for column in self.columns))
        durable.remove_unfinished([self.root, *(self.root / name for name in names)])


def packed(keepers: Sequence[Keeper], parts: Sequence[Any]) -> bytes:
    """Pack a block's parts into a file: a JSON text, then the arrays, each as in an .npy file."""
    headers: list[tuple[str, list[str], Any]] = []
    arrays: list[np.ndarray] = []
    for keeper, part in zip(keepers, parts, strict=True):
        assert isinstance(keeper, PartKeeper)
        part_arrays, content = keeper.to_arrays(part)
        headers.append((keeper.name, list(part_arrays), content))
        arrays += part_arrays.values()
    buffer = io.BytesIO()
    for values in (np.array(json.dumps(headers, sort_keys=True)), *arrays):
        np.save(buffer, values, allow_pickle=False)
    return buffer.getvalue()


def unpacked(keepers: Sequence[Keeper], root: Path, key: str) -> tuple[Any, ...]:
    """Read a block's parts from a file."""
    with npy_files.opened(root, key) as arrays:
        headers = parsed(npy_files.text(arrays))
        contents = {name: (dict(zip(names, arrays, strict=False)), content) for name, names, content in headers}
    return tuple(keeper.from_arrays(*contents[keeper.name]) for keeper in keepers if isinstance(keeper, PartKeeper))


def marker(sums: Mapping[str, list[int]]) -> bytes:
    """Write a block's marker: files with their sizes and checksums, and the marker's own checksum in its last line.

    sums: [size, checksum] by path of the file.
    """
    text = json.dumps(dict(sorted(sums.items())), indent=0).encode()
    return text + b"\n%08x\n" % durable.checksum(text)


def damaged(root: Path, sums: Mapping[str, Sequence[int]]) -> dict[str, str]:
    """Find the files that differ from their marker.

    sums: [size, checksum] by path of the file.
    """
    faults = ((key, durable.fault(root, key, *size_and_sum)) for key, size_and_sum in sums.items())
    return {key: text for key, text in faults if text}


def read_marker(root: Path, key: str) -> dict[str, list[int]] | None:
    """Read a marker: [size, checksum] by path of the file; None if it is missing or damaged."""
    try:
        content = safe_files.read(root, key, safe_files.MOST_JSON)
        text, _, last = content.rstrip(b"\n").rpartition(b"\n")
        if int(last, 16) == durable.checksum(text):
            sums = dict(parsed(text))
            return sums if all(is_sum(size_and_sum) for size_and_sum in sums.values()) else None
    except SceneError:
        raise
    except (OSError, ValueError, TypeError):
        pass
    return None


def check_blocks(
    block_files: BlockFiles, runs: Sequence[Block], samples: int, keepers: Sequence[Any] = ()
) -> Iterator[tuple[Block, list[str]]]:
    """Yield each block with its faults (see BlockFiles.faults), in order; this reads every file."""
    with ThreadPoolExecutor(machine.thread_count()) as pool:
        faults = pool.map(lambda block: block_files.faults(block, samples, keepers), runs)
        yield from zip(runs, faults, strict=True)
