"""To be said in one sentence."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.methods.saveat import FIELDS
from lgvi_warp.runs.store.arrays import whole_array
from lgvi_warp.runs.store.layout import MEMBER, parameter_units

if TYPE_CHECKING:
    from lgvi_warp.engine.plan import Plan


# Few enough bytes a chunk for its memory, enough that files and their syncs cost little.
CHUNK_BYTES = 10_000_000


EXISTING = ("refuse", "resume", "overwrite")


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
