# SPDX-License-Identifier: Apache-2.0
"""Read columns by name from a mapping, a data frame, a structured array or an xarray Dataset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, closest
from lgvi_warp.common.real_numbers import column_names

# Dimensions of the draws of a posterior, as ArviZ calls them.
DRAWS = ("chain", "draw")


def is_labelled(value: Any) -> bool:
    """Tell whether a value has named columns, so that their order does not matter."""
    return _labels(value) is not None


def columns_by_name(faults: Faults, key: str, value: Any) -> dict[str, Any]:
    """Read the columns of a labelled value.

    value: A mapping, a data frame (pandas, polars, pyarrow, or another with `columns` and table[name]), a structured
        array, an xarray Dataset (a posterior with chains and draws is flattened, one chain after the other), or a
        DataArray with labels along its second dimension.
    """
    labels = _labels(value)
    if labels is None or not labels:
        faults.add(key, value, "has no names of columns", 'name them: {"vehicle.mass": ...}')
        return {}
    odd = [label for label in labels if not isinstance(label, str)]
    if odd:
        problem = f"has no names of columns: they are called {', '.join(map(repr, odd[:6]))}{', ...' * (len(odd) > 6)}"
        remedy = "name the columns: table.columns = [...], or give .to_numpy() in the right order"
        faults.add(key, "...", problem, remedy)
        return {}
    doubled = sorted({label for label in labels if labels.count(label) > 1})
    if doubled:
        faults.add(key, "...", f"has columns of one name ({', '.join(doubled)})", "give each a name of its own")
        return {}
    return _read(value, labels)


def match(faults: Faults, key: str, labels: Sequence[str], wanted: Sequence[str]) -> bool:
    """Compare labels with the expected labels, in any order; add a fault for each missing or unknown label."""
    missing = [name for name in wanted if name not in labels]
    for label in labels:
        if label not in wanted:
            faults.add(f'{key}["{label}"]', "...", "is not one of its columns", closest(label, missing or wanted))
    for name in missing:
        faults.add(f'{key}["{name}"]', None, "is missing", f"give a column for each of {', '.join(wanted)}")
    return not missing and len(labels) == len(wanted)


def _labels(value: Any) -> list[Any] | None:
    if isinstance(value, Mapping):
        return list(value)
    if isinstance(value, np.ndarray):
        return None if value.dtype.names is None else list(value.dtype.names)
    along = _labelled_dimension(value)
    return column_names(value) if along is None else np.asarray(value.coords[along]).tolist()


def _labelled_dimension(value: Any) -> str | None:
    """Name of an xarray DataArray's second dimension, if its coordinate consists of texts."""
    dims = getattr(value, "dims", ())
    if not hasattr(value, "coords") or not isinstance(dims, tuple) or len(dims) != 2 or dims[1] not in value.coords:
        return None
    return str(dims[1]) if np.asarray(value.coords[dims[1]]).dtype.kind in "UOT" else None


def _read(value: Any, labels: Sequence[str]) -> dict[str, Any]:
    along = _labelled_dimension(value)
    if along is not None:
        return {label: np.asarray(value)[:, i] for i, label in enumerate(labels)}
    columns = {label: value[label] for label in labels}
    if all(hasattr(column, "dims") and hasattr(column, "transpose") for column in columns.values()):
        if all({*DRAWS} <= {*column.dims} for column in columns.values()):
            # Of a posterior all draws of all chains are members.
            drawn = {label: np.asarray(column.transpose(*DRAWS, ...)) for label, column in columns.items()}
            return {label: column.reshape(-1, *column.shape[2:]) for label, column in drawn.items()}
        return {label: np.asarray(column) for label, column in _members_first(columns).items()}
    return {label: column if isinstance(column, np.ndarray | list | tuple) else _plain(column)
            for label, column in columns.items()}  # fmt: skip


def _members_first(columns: Mapping[str, Any]) -> Mapping[str, Any]:
    """Variables of a Dataset, with their common dimension first."""
    dims = [column.dims for column in columns.values()]
    shared = [dim for dim in dims[0] if all(dim in dims_of_column for dims_of_column in dims)]
    if len(shared) != 1:
        return columns
    return {label: column.transpose(shared[0], ...) for label, column in columns.items()}


def _plain(column: Any) -> Any:
    """Convert a frame's column to an array; return anything else unchanged."""
    return np.asarray(column) if hasattr(column, "__array__") or hasattr(column, "__array_interface__") else column
