# SPDX-License-Identifier: Apache-2.0
"""Sampling of the members' numbers: designs of the unit cube, tables and grids.

A sampling computes any members from their indices, so a member is the same in every run that contains it. Distributions
turn the cube's levels into values (sampling/distributions). The cube's columns are in alphabetical order of the varied
names ("environment.gravity" before "vehicle.mass"); the entries of a quantity follow each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.sampling.designs.base import Sampling

# Classes of samplings by their kind in a scene file.
KINDS = Sampling.kinds


def sampling_of(content: Any) -> Sampling:
    """Build a sampling from a `Sampling`, its name, or { name = { ... } } as in a scene file."""
    if isinstance(content, Sampling):
        return content
    if isinstance(content, str):
        content = {content: {}}
    if not isinstance(content, Mapping) or len(content) != 1:
        remedy = 'write "sobol", or { latin_hypercube = { group = 256 } }'
        raise refusal("ensemble.sampling", content, "is not a sampling", remedy)
    faults = Faults("ensemble.")
    kind, values = next(iter(content.items()))
    if kind not in KINDS:
        faults.choice("sampling", kind, KINDS)
    elif not isinstance(values, Mapping):
        faults.add(f"sampling.{kind}", values, "is not a table", f"write {{ {kind} = {{ ... }} }}")
    elif kind != "grid":
        faults.keys(f"sampling.{kind}", values, [item.name for item in fields(KINDS[kind])])
    faults.raise_if_any()
    sampling: Sampling = KINDS[kind](values) if kind == "grid" else KINDS[kind](**values)
    return sampling
