"""To be said in one sentence."""

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
from lgvi_warp.engine.keepers.protocol import Keeper, PartKeeper
from lgvi_warp.runs.store.arrays import array, whole_array
from lgvi_warp.runs.store.folder import CREATED, FORMAT, ROOT, check_names, checksum_of
from lgvi_warp.runs.store.layout import columns, size
from lgvi_warp.runs.store.recipe import recipe
from lgvi_warp.runs.store.settings import Store
from lgvi_warp.runs.store.sink import marker

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


# Room that is left on a disk: markers, metadata, folders.
SPARE_BYTES = 20_000_000


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
        array(group, column.name, column.shape(k, n), column.chunk, column.dtype, column.fill, column.dims,
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
