"""What zarr reads a store through: metadata that was checked, and chunks that are plain files of the size they must have."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import AsyncIterator, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common import safe_files
from lgvi_warp.common.errors import SceneError
from lgvi_warp.runs.store.layout_check import Layout

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

ROOT = "zarr.json"


def checked_store(root: Path, layout: Layout, metadata: bytes) -> Any:
    """A folder for zarr to read, and to do nothing else; metadata: of its root, as `Layout.root` gives it."""
    return _class()(root, layout, metadata)


@functools.cache
def _class() -> Any:
    """Zarr's kind of store; made when zarr is wanted."""
    from zarr.abc.store import RangeByteRequest, Store
    from zarr.core.buffer.core import default_buffer_prototype

    class CheckedStore(Store):
        """A store's folder, for reading alone; metadata: of its root, as `Layout.root` gives it."""

        supports_writes = supports_deletes = supports_partial_writes = False
        supports_listing = True

        def __init__(self, root: Path, layout: Layout, metadata: bytes):
            super().__init__(read_only=True)
            self.root, self.layout, self.metadata = root, layout, metadata

        def __eq__(self, other: object) -> bool:
            return isinstance(other, CheckedStore) and (self.root, self.metadata) == (other.root, other.metadata)

        def __hash__(self) -> int:
            return hash((self.root, self.metadata))

        def __reduce__(self) -> tuple[Any, ...]:
            """Made again in another process, as of Dask."""
            return checked_store, (self.root, self.layout, self.metadata)

        def __str__(self) -> str:
            return f"file://{self.root.absolute().as_posix()}"

        def with_read_only(self, read_only: bool = False) -> CheckedStore:
            """The same: it is read only."""
            if not read_only:
                raise ValueError("a run's store is only read by zarr")
            return self

        def content(self, key: str) -> bytes | None:
            """A file's bytes; None for one that is missing. Raises SceneError where it is not what it must be."""
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
                raise SceneError([f"{self.root / key}: is torn; `lgvi-warp resume {self.root}` mends it"])
            return data

        async def get(
            self, key: str, prototype: BufferPrototype | None = None, byte_range: ByteRequest | None = None
        ) -> Buffer | None:
            """A file's bytes, or a range of them."""
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
            """Several files, or ranges of them."""
            return [await self.get(key, prototype, part) for key, part in key_ranges]

        async def exists(self, key: str) -> bool:
            """Whether a file is there."""
            return await asyncio.to_thread(self.content, key) is not None

        async def set(self, key: str, value: Buffer) -> None:
            """Nothing is written by zarr."""
            self._check_writable()

        async def delete(self, key: str) -> None:
            """Nothing is removed by zarr."""
            self._check_writable()

        async def list(self) -> AsyncIterator[str]:
            """The root's metadata, which has that of all arrays."""
            yield ROOT

        async def list_prefix(self, prefix: str) -> AsyncIterator[str]:
            """As `list`."""
            if ROOT.startswith(prefix):
                yield ROOT

        async def list_dir(self, prefix: str) -> AsyncIterator[str]:
            """Names of arrays and groups."""
            names: set[Any] = set()
            head = f"{prefix.rstrip('/')}/" if prefix else ""
            for name in (*self.layout.arrays, *self.layout.groups):
                if name.startswith(head):
                    names.add(name.removeprefix(head).partition("/")[0])
            for name in sorted(names):
                yield name

    return CheckedStore
