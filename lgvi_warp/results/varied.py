# SPDX-License-Identifier: Apache-2.0
"""Varied inputs of a result's members: numbers of the scene and of the start."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

# Fields of the start that the first sample shows.
STARTS = ("position", "velocity", "angular_velocity")


def varied(result: Any) -> dict[str, np.ndarray]:
    """Collect the numbers (n,) that differ between members, by name and component: first parameters, then the start."""
    inputs = {}
    starts: Mapping[str, np.ndarray] = result.starts
    if not starts and result.store is None:
        # A file of an earlier version shows the start by the first samples alone; a store would read all of them.
        starts = {f"start.{name}": result.samples[name][0] for name in result.samples if name in STARTS}
    for name, values in (*result.parameters.items(), *starts.items()):
        if len(values) != result.members:
            continue
        columns = values.reshape(len(values), -1)
        # What differs by round-off alone does not vary.
        for i in np.flatnonzero(np.ptp(columns, axis=0) > 1e-12 * np.abs(columns).max(initial=0.0)):
            place = "" if values.ndim == 1 else [int(k) for k in np.unravel_index(i, values.shape[1:])]
            inputs[f"{name}{place}"] = columns[:, i]
    return inputs
