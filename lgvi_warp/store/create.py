# SPDX-License-Identifier: Apache-2.0
"""Creation of a store: its folder with all metadata and no blocks."""

from __future__ import annotations

import json
import os
import shutil
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common import files as durable
from lgvi_warp.common import scratch
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.sentences import capital
from lgvi_warp.engine.keepers.protocol import Keeper, PartKeeper
from lgvi_warp.results.result import TIME
from lgvi_warp.store.arrays import array, whole_array
from lgvi_warp.store.block_files import marker
from lgvi_warp.store.folder import CREATED, FORMAT, ROOT, check_names, checksum_of
from lgvi_warp.store.layout import columns, size
from lgvi_warp.store.recipe import recipe
from lgvi_warp.store.settings import Store

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


# Room on the disk for markers, metadata and folders [bytes].
SPARE_BYTES = 20_000_000


def create(
    store: Store, plan: Plan, provenance: Mapping[str, Any], messages: Sequence[str], keepers: Sequence[Keeper] = ()
) -> None:
    """Create the store's folder with all of its metadata, either whole or not at all."""
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


def names_of(keepers: Sequence[Keeper]) -> list[str]:
    """List the names of the keepers that leave parts in a store."""
    return [keeper.name for keeper in keepers if isinstance(keeper, PartKeeper)]


def nearest_folder(path: Path) -> Path:
    """Find the nearest existing folder above a path."""
    path = path.absolute()
    while not path.is_dir():
        path = path.parent
    return path


def free_enough(path: Path, wanted: int) -> None:
    """Raise SceneError if a disk has less free space than a run needs; wanted: size of the run [bytes]."""
    free = shutil.disk_usage(nearest_folder(path)).free
    if wanted + SPARE_BYTES > free:
        shortage = f"needs {wanted / 1e9:.2f} GB, and the disk has {free / 1e9:.2f} GB left"
        remedy = "save less often or fewer fields (SaveAt), store float32 (--store-dtype float32), or use another disk"
        raise SceneError([f"store = {path}: {shortage}. {capital(remedy)}"])


def skeleton(
    root: Path,
    store: Store,
    plan: Plan,
    provenance: Mapping[str, Any],
    messages: Sequence[str],
    keepers: Sequence[Keeper] = (),
) -> None:
    """Write groups and arrays to disk, without their blocks."""
    import zarr
    from zarr.storage import MemoryStore

    varied, first = plan.ensemble.varied(), plan.ensemble.parameters(0, 1)
    shared = {name: values.tolist() for name, values in first.items() if name not in varied}
    content = recipe(plan) | {"store": store.layout(), "keepers": names_of(keepers)}
    texts = [json.dumps(item) for item in (provenance, content, list(messages), shared)]
    # zarr writes into memory, and `files` writes to disk and syncs together: file by file it would take several times as long.
    inside: dict[str, Any] = {}
    memory = MemoryStore(inside)
    group = zarr.create_group(memory, zarr_format=3, attributes=_attributes(texts, provenance))
    k, n = len(plan.grid.times), plan.ensemble.members
    whole_array(group, "time", plan.grid.times, ("time",), TIME | {"axis": "T"})
    whole_array(group, "step", plan.grid.sample_steps, ("time",), {"units": "1", "long_name": "steps made until then"})
    for column in columns(plan, store):
        array(group, column.name, column.shape(k, n), column.chunk, column.dtype, column.fill, column.dims,
               column.attributes)  # fmt: skip
    store.write_given(group, plan)
    with warnings.catch_warnings():
        # Consolidated metadata let xarray open the store in one read; zarr warns that version 3 of the format has none.
        warnings.simplefilter("ignore")
        zarr.consolidate_metadata(memory, zarr_format=3)
    for folder in {os.path.dirname(key) for key in inside} | {"blocks", "parts"}:
        (root / folder).mkdir(parents=True, exist_ok=True)
    files = durable.Files(root)
    for key in sorted(inside):
        files.write(key, inside.pop(key).as_numpy_array())
    # The root's metadata changes when the run ends: its texts have a checksum of their own.
    files.write(CREATED, marker({key: item for key, item in files.sums.items() if key != ROOT}))
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
