# SPDX-License-Identifier: Apache-2.0
"""A run on disk: a zarr v3 group, written block by block; a marker says that all files of a block are on disk.

    run.zarr/zarr.json            attributes: provenance, recipe, messages, complete
    run.zarr/position/c.0.3.0     chunk: times 0, block 3 (see layout)
    run.zarr/parts/000000768.npy  the block's parts of the keepers
    run.zarr/blocks/000000768.json   marker of the finished block that begins with member 768: files, sizes, checksums
    run.zarr/kept/                a group like the run's own, with members that were run again for their samples
                                  (see kept)

No file contains a date or time of day, so the same run always writes the same bytes.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Container, Iterator, Sequence
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common import machine, safe_files, scratch
from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.safe_files import parsed
from lgvi_warp.common.sentences import capital, sentences
from lgvi_warp.common.write_lock import write_lock
from lgvi_warp.engine.block import Block, blocks
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.store import layout_check as store_check
from lgvi_warp.store import texts as store_texts
from lgvi_warp.store.block_files import BlockFiles, damaged, name_of, read_marker
from lgvi_warp.store.layout import StoreArray
from lgvi_warp.store.layout_check import corrupt_store_as_scene_error
from lgvi_warp.store.settings import needed

FORMAT = 2
ROOT, CREATED, KEPT = "zarr.json", "created.json", "kept"


class Folder:
    """An existing store. It may come from an untrusted source, so its content is checked before it is used.

    Attributes:
        attributes: The attributes of its zarr group.
        provenance: Scene, ensemble, settings, versions and machine of the run.
        recipe: Settings of its plan.
        shared: Parameters that all members have in common.
        messages: Messages on the reliability of the result.
        layout: Arrays of the store.
        found: Number of blocks that were finished before this process.
        ran: Number of blocks that this process ran.
        ran_kept: Number of blocks of kept members that this process ran.
        noted: Warnings for a resumed run, such as changed functions of the user.
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
            raise SceneError([f"{path} holds no run. Give a folder that `lgvi-warp run --store zarr` made"]) from None
        except SceneError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError):
            good = False
        if not good:
            problem = "is damaged, or of another version of the format"
            raise SceneError([sentences(f"{path / ROOT}", problem, "run again (--overwrite)")])
        with corrupt_store_as_scene_error(path / ROOT):
            self.provenance, self.recipe, messages, self.shared = (parsed(text) for text in texts)
            store_texts.check_texts(self.attributes, self.provenance, self.recipe, messages, self.shared)
            self.messages: tuple[str, ...] = tuple(messages)
            self.layout = store_check.layout_of(content, int(self.recipe["members"]))
        # Blocks that this process found finished, those that it ran, and those of kept members that it ran.
        self.found, self.ran, self.ran_kept = 0, 0, 0
        self.noted: tuple[str, ...] = ()

    def _root(self) -> Any:
        """Read the root's metadata. Raises ValueError, SceneError, OSError."""
        if not self.path.is_dir():
            raise FileNotFoundError
        return safe_files.read_json(self.within, (self.path / ROOT).relative_to(self.within).as_posix())

    def kept(self) -> Folder | None:
        """The group of the kept members, opened; None if there is none."""
        return Folder(self.path / KEPT, self.path) if os.path.lexists(self.path / KEPT) else None

    @property
    def complete(self) -> bool:
        """Whether the run has ended with every block finished."""
        return bool(self.attributes["complete"])

    @property
    def members(self) -> int:
        """Number of members; smaller than the ensemble's if `until` ended the run."""
        return int(self.attributes.get("members", self.recipe["members"]))

    @property
    def runs(self) -> list[Block]:
        """The blocks of these members, in order."""
        return [block for block in blocks(int(self.recipe["members"])) if block.first < self.members]

    @property
    def block_files(self) -> BlockFiles:
        """The keeper that knows the files of the blocks."""
        return BlockFiles(self.path, self.layout.columns)

    def checked(self) -> Any:
        """The zarr store through which zarr and xarray read the folder, with all checks."""
        from lgvi_warp.store.zarr_access import checked_store

        present = {name: value for name, value in self.attributes.items() if value is not None}
        return checked_store(self.path, self.layout, self.layout.root(present))

    def group(self) -> Any:
        """The zarr group, opened for reading only."""
        import zarr

        return zarr.open_group(self.checked(), mode="r", zarr_format=3)

    def refuse_too_large(self) -> None:
        """Check that the arrays that are read at once (one number per member, without times) fit into memory."""
        each = sum(column.bytes for column in self.layout.columns if not column.times) * len(self.runs)
        memory = machine.memory_bytes() or 2**40
        if each > memory:
            size = f"has {self.members:,} members, of which {each / 1e9:.0f} GB are read at once"
            remedy = f"the memory is {memory / 1e9:.0f} GB. Read it on a larger machine, or run it again"
            raise SceneError([f"{self.path}: {size}, and {remedy}"])

    def unfinished(self) -> list[Block]:
        """List the blocks that have no valid marker."""
        files, marked = self.block_files, safe_files.names(self.path, "blocks")
        return [b for b in self.runs if f"{name_of(b)}.json" not in marked or files.sums(b) is None]

    def lost(self) -> list[str]:
        """List the missing files of blocks; no file is read.

        A missing chunk raises no error: it reads as NaN or 0.
        """
        files, samples = self.block_files, self.layout.times
        wanted = [f"blocks/{name_of(block)}.json" for block in self.runs]
        wanted += [key for block in self.runs for column in files.columns for key in column.keys(block, samples)]
        folders = {str(PurePosixPath(key).parent) for key in wanted}
        present = {f"{folder}/{name}" for folder in folders for name in safe_files.names(self.path, folder)}
        return [key for key in wanted if key not in present]

    def times(self) -> np.ndarray:
        """Read the times of the samples, (k,) [s]."""
        try:
            times = np.asarray(self.group()["time"][:])
            if np.isfinite(times).all():
                return times
        except (ValueError, KeyError):
            pass
        raise self._cannot_go_on("times are lost")

    def steps_and_arrays(self) -> tuple[TimeGrid, dict[str, np.ndarray]]:
        """Read the steps with the sample times, and the arrays from which the ensemble was made, by name."""
        try:
            # A missing chunk raises no error: it reads as NaN or 0.
            lost = [text for text in self.damage() if text.startswith(("time/", "step/", "explicit/"))]
            group = self.group()
            steps, times = group["step"][:].astype(np.int64), group["time"][:]
            arrays = {name: np.asarray(array[:]) for name, array in group["explicit"].arrays()}
            if lost or not np.isfinite(times).all():
                raise ValueError("times are missing")
        except (ValueError, OSError, KeyError) as error:
            raise self._cannot_go_on(error) from error
        return TimeGrid(self.recipe["step"], steps, times, tuple(self.recipe["messages"])), arrays

    def _cannot_go_on(self, reason: object) -> SceneError:
        remedy = "run the same scene again with --store zarr --resume, which mends it"
        return SceneError([f"{self.path}: {'; '.join(self.damage()) or reason}. {capital(remedy)}"])

    def damage(self) -> list[str]:
        """List the faults of the files that belong to no block."""
        sums, wanted = read_marker(self.path, CREATED), self.layout.frame()
        if sums is None:
            return [f"{CREATED} is damaged"]
        if sums.keys() != wanted.keys() or any(size not in (None, sums[key][0]) for key, size in wanted.items()):
            return [f"{CREATED} does not fit the arrays in {ROOT}"]
        faults = damaged(self.path, sums)
        return [f"{key} {text}" for key, text in faults.items()] + self._unlike(faults)

    def _unlike(self, damaged: Container[str]) -> list[str]:
        """Name the arrays whose own metadata is undamaged but differs from the root's metadata."""
        unlike = []
        for name, array in self.layout.arrays.items():
            key = f"{name}/{ROOT}"
            if key not in damaged and safe_files.read_json(self.path, key) != array.metadata():
                unlike.append(f"{key} says something else than {ROOT}")
        return unlike

    def finish(self, members: int | None = None) -> None:
        """Mark the run as complete."""
        if not self.complete:
            self._say(
                {"complete": True} | ({} if members is None else {"members": members}), metadata_under(self.path / KEPT)
            )

    def take_layout(self, source: Path) -> None:
        """Copy the layout in the root's metadata from another folder of the same run.

        If it differs from this folder's, the run is marked as incomplete.
        """
        content, right = self._root(), safe_files.read_json(source, ROOT)
        if Folder(source).layout != self.layout:
            right["attributes"] = content["attributes"] | {"complete": False}
            durable.write_whole(self.path / ROOT, json.dumps(right, indent=2).encode())

    def reopen(self) -> None:
        """Mark the run as incomplete."""
        if self.complete:
            self._say({"complete": False}, {})

    def _say(self, attributes: dict[str, Any], kept_group: dict[str, Any]) -> None:
        """Write attributes of the run, and the metadata of the group of its kept members."""
        content = self._root()
        content["attributes"] |= attributes
        arrays = content["consolidated_metadata"]["metadata"]
        of_run = {name: metadata for name, metadata in arrays.items() if name.partition("/")[0] != KEPT}
        content["consolidated_metadata"]["metadata"] = of_run | kept_group
        durable.write_whole(self.path / ROOT, json.dumps(content, indent=2).encode())
        self.attributes |= attributes


def metadata_under(path: Path) -> dict[str, Any]:
    """Read the metadata of a group and its arrays, in the form that the enclosing group needs."""
    if not path.exists():
        return {}
    root = safe_files.read_json(path.parent, f"{path.name}/{ROOT}")
    arrays = root["consolidated_metadata"]["metadata"]
    root["consolidated_metadata"] = {**root["consolidated_metadata"], "metadata": {}}
    return {path.name: root} | {f"{path.name}/{name}": metadata for name, metadata in arrays.items()}


def checksum_of(texts: Sequence[str]) -> int:
    """Compute one checksum of several texts."""
    return durable.checksum("\0".join(texts).encode())


def check_names(arrays: Sequence[StoreArray]) -> None:
    """Check that each array's name is valid as the name of a folder."""
    faults = Faults("store.")
    for name in (column.name for column in arrays if not store_check.is_name(column.name)):
        remedy = 'give the term or event another name, without / \\ : * ? " < > | and of 200 bytes at most'
        faults.add("fields", name, "cannot be the name of a folder", remedy)
    faults.raise_if_any()


@contextlib.contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the lock of a store, which need not exist yet, and remove the remains of a killed run."""
    with write_lock(path):
        place = Path(os.path.realpath(path))
        durable.restored(place)
        for beside in scratch.left_behind(place):
            if beside.suffix in (scratch.NEW, scratch.OLD) and not foreign(beside):
                scratch.remove_folder(beside)
        yield


def foreign(path: Path) -> str | None:
    """Find a file in a folder that no run wrote.

    Returns: A text on the first such file, or on why the folder holds no run; None if it holds only a run.
    """
    if path.is_symlink() or not path.is_dir():
        return "is not a folder of a run"
    names = []
    for name, entry in safe_files.entries(path):
        folder = entry.is_dir(follow_symlinks=False)
        if not folder and not (entry.is_file(follow_symlinks=False) and store_check.is_file_of_store(name)):
            return f"holds {name}, which no run wrote"
        names += [] if folder else [name]
    if names and not any(name in (ROOT, CREATED) or scratch.is_unfinished(name) for name in names):
        return f"holds {names[0]}, and nothing that says that it is a run"
    return None


def refuse_foreign(path: Path) -> None:
    """Check that a folder that is to be replaced contains only files of a run."""
    if os.path.lexists(path) and (fault := foreign(Path(os.path.realpath(path)))):
        raise SceneError([sentences(path, f"{fault}, and is not overwritten", "move it away, or give another folder")])
