# SPDX-License-Identifier: Apache-2.0
"""`Store`: the folder and the settings of a run that is written to disk."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common.arguments import explained, listed
from lgvi_warp.common.declared import read, real, word
from lgvi_warp.common.errors import Faults, SceneError, install
from lgvi_warp.control.signals import SAVED
from lgvi_warp.store.arrays import whole_array
from lgvi_warp.store.layout import MEMBER, parameter_units

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


# Small enough for the memory of the blocks at work, large enough that files and their syncs cost little [bytes].
CHUNK_BYTES = 10_000_000


EXISTING = ("refuse", "resume", "overwrite")


@explained
@dataclass(frozen=True)
class Store:
    """Folder and settings of a run that is written to disk as a zarr store.

    Args:
        path: A folder whose name ends in .zarr.
        dtype: "float32" stores the samples of a float64 run in single precision; by default the dtype of the run is used.
        fields: Names of the fields whose samples are stored; by default all sampled fields.
        existing: Action if the folder already holds a run: "refuse" (default), "resume" (complete it, if it is the same
            run) or "overwrite".
        force: Whether to resume on another machine or with other software versions, which may change the bits; default False.
        chunk_bytes: Approximate largest size of a chunk [bytes]; default 10 MB. Each running block holds one chunk per
            field in memory.

    Raises:
        SceneError: If settings are at fault or a library is missing; the message names every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, store=lw.Store("run.zarr", dtype="float32"))
        >>> result.position.dtype
        dtype('<f4')
    """

    path: str | os.PathLike[str]
    dtype: str | None = word(None, known=("float32", "float64"))
    fields: tuple[str, ...] | None = None
    existing: str = word("refuse", known=EXISTING)
    force: bool = False
    chunk_bytes: int = real(CHUNK_BYTES, unit="bytes", least=1)

    def __post_init__(self) -> None:
        faults = Faults("store.")
        if not isinstance(self.path, str | os.PathLike) or self.whole.suffix != ".zarr":
            faults.add("path", self.path, "is not a folder of a store", 'end its name in .zarr: "runs/x/run.zarr"')
        read(self, faults)
        with faults.including():
            for name in () if self.fields is None else listed("fields", self.fields, "names of fields"):
                faults.choice("fields", name, SAVED)
        faults.raise_if_any()
        needed()

    def layout(self) -> dict[str, Any]:
        """Settings that determine the bytes in the store, in JSON types."""
        fields = None if self.fields is None else list(self.fields)
        return {"dtype": self.dtype, "fields": fields, "chunk_bytes": int(self.chunk_bytes)}

    @property
    def folder(self) -> Path:
        """The store's folder as a Path."""
        return Path(self.path)

    @property
    def along(self) -> str:
        """Name of the dimension of members in the store's arrays."""
        return MEMBER

    @property
    def whole(self) -> Path:
        """Folder of the whole run to which the store belongs; for this class, the store's own folder."""
        return self.folder

    def write_given(self, group: Any, plan: Plan) -> None:
        """Write the states and parameters that the ensemble received as arrays, which nothing else in the store holds.

        Args:
            group: zarr group of the store.
            plan: Plan of the run.
        """
        arrays, units = plan.ensemble.explicit(), parameter_units(plan.ensemble.scene)
        explicit = group.create_group("explicit")
        for name, values in arrays.items():
            along = MEMBER if name == "indices" else f"{MEMBER}_given"
            dims = (along, *(f"{name}_{i}" for i in range(values.ndim - 1)))
            whole_array(explicit, name, values, dims, {"units": units.get(name, "1")})


def needed() -> None:
    """Raise SceneError if a library that stores need is not installed."""
    try:
        import google_crc32c  # noqa: F401
        import xarray  # noqa: F401
        import zarr  # noqa: F401
    except ImportError as error:
        raise SceneError([f"store: {error}. Install it: {install('store')}"]) from error
