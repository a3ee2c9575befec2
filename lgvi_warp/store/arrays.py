# SPDX-License-Identifier: Apache-2.0
"""Creation of a store's arrays with zarr."""

from __future__ import annotations

from typing import Any

import numpy as np


def array(group: Any, name: str, shape: Any, chunks: Any, dtype: str, fill: Any, dims: Any, attributes: Any) -> Any:
    """Create an array of raw little-endian numbers with a checksum in each chunk."""
    from zarr.codecs import BytesCodec, Crc32cCodec

    return group.create_array(
        name, shape=shape, chunks=chunks, dtype=dtype, fill_value=fill, dimension_names=dims, attributes=attributes,
        serializer=BytesCodec(endian="little"), compressors=[Crc32cCodec()], filters=None,
        chunk_key_encoding={"name": "default", "separator": "."}, config={"write_empty_chunks": True},
    )  # fmt: skip


def whole_array(group: Any, name: str, values: np.ndarray, dims: tuple[str, ...], attributes: dict[str, Any]) -> None:
    """Create a small array of one chunk and write it."""
    values = np.ascontiguousarray(values)
    fill = np.nan if values.dtype.kind == "f" else 0
    dtype = values.dtype.newbyteorder("<").str
    array(group, name, values.shape, values.shape, dtype, fill, dims, attributes)[:] = values
