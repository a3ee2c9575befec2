# SPDX-License-Identifier: Apache-2.0
"""Checks of the arrays in a result.npz: a damaged or foreign file is refused with a clear message."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lgvi_warp.common.safe_files import parsed
from lgvi_warp.control.signals import IN_FILES, has_shape
from lgvi_warp.results import member_fields

TEXTS = ("messages", "provenance", "statistics", "final", "tangents")


def checked(content: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Check that the arrays of a result are consistent, and read its texts."""
    if missing := [name for name in ("time", "status", *TEXTS[:2]) if name not in content]:
        raise ValueError(f"it has no {', '.join(missing)}")
    of_members = {item.name: np.dtype(item.dtype) for item in member_fields.FIELDS}
    of_members["weights"] = np.dtype("<f8")
    k, n = content["time"].size, content["status"].size
    m = content["kept/members"].size if "kept/members" in content else 0
    for name, array in content.items():
        base = name.removeprefix("kept/")
        if base in IN_FILES:
            good = array.shape[:2] == (k, n if base == name else m) and array.dtype.kind == "f"
            good = good and has_shape(base, array.shape[2:])
        elif name.startswith("jacobian/"):
            base = name.removeprefix("jacobian/")
            good = base in IN_FILES and array.dtype.kind == "f" and array.shape[:2] == (k, n) and "tangents" in content
            good = good and has_shape(base, array.shape[2:-1])
        elif name in TEXTS:
            good = array.dtype.kind == "U" and array.shape == ()
        elif name == "time":
            good = array.shape == (k,) and array.dtype == np.float64
        elif name in of_members:
            good = array.shape == (n,) and array.dtype == of_members[name]
        elif name in ("final.indices", "final.status"):
            good = array.shape == (n,) and array.dtype == np.int64
        elif name.startswith("final.lanes."):
            good = array.ndim == 2 and len(array) == n and array.dtype.kind in "fi"
        elif name == "kept/members":
            good = array.shape == (m,) and array.dtype.kind == "i" and (not m or 0 <= array.min() <= array.max() < n)
        elif name.startswith("starts/"):
            good = array.dtype.kind == "f" and array.ndim > 0 and len(array) == n
        elif name.startswith(("parameters/", "kept/parameters/")):
            lengths = (1, m if name.startswith("kept/") else n)
            good = array.dtype.kind == "f" and array.ndim > 0 and len(array) in lengths
        else:
            good = name.startswith("statistics/") and array.dtype.kind in "biufU"
        if not good:
            raise ValueError(f"{name[:100]!r} has the type {array.dtype} and shape {array.shape}")
    texts = {name: parsed(str(content[name])) for name in TEXTS[:2]}
    if not isinstance(texts["messages"], list) or not all(isinstance(item, str) for item in texts["messages"]):
        raise ValueError("its messages are not texts")
    _provenance(texts["provenance"])
    _final(content)
    texts["tangents"] = _tangents(content)
    return texts


def _tangents(content: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    """Names of the numbers of the derivatives. Raises ValueError."""
    names = parsed(str(content["tangents"])) if "tangents" in content else []
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError("its tangents are not names")
    if any(content[name].shape[-1] != len(names) for name in content if name.startswith("jacobian/")):
        raise ValueError(f"it has derivatives by other numbers than {len(names)}")
    return tuple(names)


def _final(content: Mapping[str, np.ndarray]) -> None:
    """Check the arrays of the final states. Raises ValueError."""
    if "final" not in content:
        return
    table = parsed(str(content["final"]))
    whole = isinstance(table, dict) and all(isinstance(table.get(name), int) for name in ("steps", "seed"))
    real = whole and all(isinstance(table.get(name), int | float) for name in ("time", "step"))
    real = bool(real and np.isfinite([table["time"], table["step"]]).all() and table["step"] > 0.0 <= table["time"])
    arrays = {"final.indices", "final.status"} <= set(content)
    if not real or not arrays or not isinstance(table.get("settings"), dict):
        raise ValueError("its end tells no time, step or settings")


def _provenance(table: Any) -> None:
    """Check the entries of the provenance that the summary and the pictures read. Raises ValueError."""
    good = isinstance(table, dict) and isinstance(table.get("scene"), dict) and isinstance(table.get("method"), dict)
    if not good or not isinstance(table["method"].get("name"), str) or not isinstance(table.get("step"), int | float):
        raise ValueError("its provenance tells no scene, method or step")
