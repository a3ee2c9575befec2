# SPDX-License-Identifier: Apache-2.0
"""The zarr store through which zarr and xarray read: checked metadata, and chunks that must have their exact size."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import AsyncIterator, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common import safe_files
from lgvi_warp.common.errors import SceneError
from lgvi_warp.store.layout_check import Layout

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

ROOT = "zarr.json"


def checked_store(root: Path, layout: Layout, metadata: bytes) -> Any:
    """Open a folder for zarr, for reading only."""
    return _class()(root, layout, metadata)


class CheckedFolder:
    """Folder of a store for reading by zarr, independent of the zarr library.

    layout: the arrays and chunks that it may hold.
    metadata: content of its zarr.json.
    """

    supports_writes = supports_deletes = supports_partial_writes = False
    supports_listing = True
    root: Path
    layout: Layout
    metadata: bytes

    def __eq__(self, other: object) -> bool:
        return isinstance(other, CheckedFolder) and (self.root, self.metadata) == (other.root, other.metadata)

    def __hash__(self) -> int:
        return hash((self.root, self.metadata))

    def __reduce__(self) -> tuple[Any, ...]:
        """Rebuild it in another process, such as one of Dask."""
        return checked_store, (self.root, self.layout, self.metadata)

    def __str__(self) -> str:
        return f"file://{self.root.absolute().as_posix()}"

    def with_read_only(self, read_only: bool = False) -> CheckedFolder:
        """Return the store itself, which is read-only."""
        if not read_only:
            raise ValueError("a run's store is only read by zarr")
        return self

    def content(self, key: str) -> bytes | None:
        """Read the bytes of a file; None if it is missing, or is not in the layout."""
        if key == ROOT:
            return self.metadata
        size = self.layout.chunk_bytes(key)
        if size is None:
            return None
        try:
            data = safe_files.read(self.root, key, size)
        except (FileNotFoundError, NotADirectoryError):
            return None
        if len(data) != size:
            raise SceneError([f"{self.root / key} is torn. `lgvi-warp resume {self.root}` mends it"])
        return data

    async def get(
        self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
    ) -> Buffer | None:
        """Read a file, or the range from a first to a last byte of it; None if the file is missing."""
        from zarr.abc.store import RangeByteRequest
        from zarr.core.buffer.core import default_buffer_prototype

        data = await asyncio.to_thread(self.content, key)
        if data is None:
            return None
        if isinstance(byte_range, RangeByteRequest):
            data = data[byte_range.start : byte_range.end]
        elif byte_range is not None:
            raise NotImplementedError("chunks of a run are read as wholes")
        return (prototype or default_buffer_prototype()).buffer.from_bytes(data)

    async def get_partial_values(
        self, prototype: BufferPrototype, key_ranges: Iterable[tuple[str, ByteRequest | None]]
    ) -> list[Buffer | None]:
        """Read several files, or ranges of their bytes; None for a missing file."""
        return [await self.get(key, prototype, part) for key, part in key_ranges]

    async def exists(self, key: str) -> bool:
        """Tell whether a file is there."""
        return await asyncio.to_thread(self.content, key) is not None

    async def list(self) -> AsyncIterator[str]:
        """List the root's metadata, which hold those of all arrays."""
        yield ROOT

    async def list_prefix(self, prefix: str) -> AsyncIterator[str]:
        """List the root's metadata, if its name begins with a prefix."""
        if ROOT.startswith(prefix):
            yield ROOT

    async def list_dir(self, prefix: str) -> AsyncIterator[str]:
        """List the arrays and groups in a folder."""
        head = f"{prefix.rstrip('/')}/" if prefix else ""
        inside = (name for name in (*self.layout.arrays, *self.layout.groups) if name.startswith(head))
        for name in sorted({name.removeprefix(head).partition("/")[0] for name in inside}):
            yield name


@functools.cache
def _class() -> Any:
    """Define the class of zarr store, at the first use of zarr."""
    from zarr.abc.store import Store

    class CheckedStore(CheckedFolder, Store):
        """A store's folder, for reading only."""

        def __init__(self, root: Path, layout: Layout, metadata: bytes):
            super().__init__(read_only=True)
            self.root, self.layout, self.metadata = root, layout, metadata

        async def set(self, key: str, value: Buffer) -> None:
            """Refuse to write: the store is read-only."""
            self._check_writable()

        async def delete(self, key: str) -> None:
            """Refuse to remove: the store is read-only."""
            self._check_writable()

    return CheckedStore
