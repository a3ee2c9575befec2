# SPDX-License-Identifier: Apache-2.0
"""Store the results of a study's calls in a folder, so that an interrupted study can continue."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lgvi_warp.common import machine
from lgvi_warp.common.arguments import path_of
from lgvi_warp.common.errors import refusal
from lgvi_warp.common.identity import UNKNOWN, identity
from lgvi_warp.common.npy_files import of_npz, write_npz
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.functions import functions_of, identities

Arrays = tuple[np.ndarray, ...]
# Whatever these are, the numbers are the same.
NO_MATTER = ("threads", "executor", "scheduler")


class Remembered:
    """Call functions of arrays, and store each call as a numbered file of a folder: a stored call is not run again.

    store: the folder, created if needed; None stores nothing.
    fleets: ensembles that are run. asked: all other arguments on which the calls depend.
    """

    def __init__(
        self,
        store: str | os.PathLike[str] | None = None,
        fleets: Sequence[Ensemble] = (),
        asked: Mapping[str, Any] | None = None,
    ):
        self._folder: Path | None = None
        self._count = 0
        if store is not None:
            self._folder = path_of("store", store)
            self._asked = self._key(fleets, asked or {})
            self._folder.mkdir(parents=True, exist_ok=True)
            self._kept(0)  # one of other arguments is refused before anything runs

    @property
    def keeps(self) -> bool:
        """True if calls are stored."""
        return self._folder is not None

    def __call__(self, name: str, run: Callable[..., Arrays], *arrays: np.ndarray) -> Arrays:
        """Call a function of arrays, or read its stored return values; name: name of the function.

        Raises: SceneError, if the folder has another call under this number.
        """
        if self._folder is None:
            return run(*arrays)
        # A call that fails has a number, but no file, and fails again.
        number, self._count = self._count, self._count + 1
        digest = hashlib.sha256(name.encode())
        for array in arrays:
            digest.update(f"\n{array.dtype.str} {array.shape}\n".encode() + np.ascontiguousarray(array).tobytes())
        if (kept := self._kept(number)) is not None:
            if str(kept["call"]) != digest.hexdigest():
                raise self._other(f"has another call as {self._path(number).name}")
            return tuple(kept[f"result_{i}"] for i in range(len(kept) - 2))
        results = run(*arrays)
        words = {"asked": np.array(self._asked), "call": np.array(digest.hexdigest())}
        write_npz(self._path(number), words | {f"result_{i}": each for i, each in enumerate(results)}, self._folder)
        return results

    def _path(self, number: int) -> Path:
        assert self._folder is not None
        return self._folder / f"{number:06d}.npz"

    def _kept(self, number: int) -> dict[str, np.ndarray] | None:
        """Content of a file; None if it is missing or incomplete. Raises SceneError if it has other arguments."""
        try:
            arrays = of_npz(self._path(number))
        except (FileNotFoundError, ValueError):
            return None
        if not {"asked", "call"} <= arrays.keys() or str(arrays["asked"]) != self._asked:
            raise self._other("keeps the calls of other arguments, of another scene or of another version")
        return arrays

    def _other(self, problem: str) -> Exception:
        remedy = "give the arguments that it was begun with, or another folder"
        return refusal("store", str(self._folder), problem, remedy)

    def _key(self, fleets: Sequence[Ensemble], requested: Mapping[str, Any]) -> str:
        """Text that identifies the arguments. Raises SceneError if a user's function cannot be identified."""
        told = {f"[{i}] {place}": each for i, fleet in enumerate(fleets)
                for place, each in identities(functions_of(fleet)).items()}  # fmt: skip
        told |= {name: identity(value) for name, value in requested.items() if name not in NO_MATTER}
        if unknown := [place for place, text in told.items() if text == UNKNOWN]:
            problem = f"cannot tell {', '.join(unknown[:3])} from others in a later call"
            raise refusal("store", str(self._folder), problem, "leave store out, or give functions a version")
        scenes = [[fleet.scene.to_dict(), fleet.to_dict()] for fleet in fleets]
        return key_of({"scenes": scenes, "asked": told, "versions": machine.versions()})


def key_of(content: Mapping[str, Any]) -> str:
    """Key of all inputs that decide a cell's numbers: 32 hexadecimal digits."""
    text = json.dumps(content, sort_keys=True, default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return repr(value)
