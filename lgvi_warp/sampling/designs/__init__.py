"""How the members' numbers are chosen: designs of the unit cube, tables and grids.

A sampling gives any members by their indices, so that a member is the same in every run that contains it. Distributions turn
the cube's levels into values (sampling/distributions). The cube's columns are in the order of the names that vary
("environment.gravity" before "vehicle.mass"), with the entries of a quantity one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from lgvi_warp.common.errors import Faults
from lgvi_warp.sampling.designs.base import Drawn, Replicated, Sampling
from lgvi_warp.sampling.designs.designs import Morris, Saltelli, salib_problem
from lgvi_warp.sampling.designs.grid import Grid
from lgvi_warp.sampling.designs.hypercube import LatinHypercube
from lgvi_warp.sampling.designs.levels import UnitCubePoints
from lgvi_warp.sampling.designs.random import Random
from lgvi_warp.sampling.designs.sequences import Halton, Sobol, sobol_points
from lgvi_warp.sampling.designs.table import Table

KINDS: dict[str, type[Sampling]] = {
    design.kind: design
    for design in (Random, LatinHypercube, Sobol, Halton, Saltelli, Morris, Grid, Table, UnitCubePoints)
}


def sampling_of(content: Any) -> Sampling:
    """Build a sampling from what a scene file or a user gives.

    Args:
        content: A `Sampling`, its name, or { name = { ... } } as in a scene file.

    Returns:
        The sampling.

    Raises:
        SceneError: Where the name or a setting is unknown or wrong. The message lists every fault.
    """
    if isinstance(content, Sampling):
        return content
    faults = Faults("ensemble.")
    if isinstance(content, str):
        content = {content: {}}
    if not isinstance(content, Mapping) or len(content) != 1:
        remedy = 'write "sobol", or { latin_hypercube = { group = 256 } }'
        faults.add("sampling", content, "is not a sampling", remedy)
        faults.raise_if_any()
    kind, values = next(iter(content.items()))
    if kind not in KINDS:
        faults.choice("sampling", kind, KINDS)
    elif not isinstance(values, Mapping):
        faults.add(f"sampling.{kind}", values, "is not a table", f"write {{ {kind} = {{ ... }} }}")
    elif kind != "grid":
        faults.keys(f"sampling.{kind}", values, [item.name for item in fields(KINDS[kind])])
    faults.raise_if_any()
    return KINDS[kind](values) if kind == "grid" else KINDS[kind](**values)  # type: ignore[call-arg]


__all__ = [
    "KINDS",
    "Drawn",
    "Grid",
    "Halton",
    "LatinHypercube",
    "Morris",
    "Random",
    "Replicated",
    "Saltelli",
    "Sampling",
    "Sobol",
    "Table",
    "UnitCubePoints",
    "salib_problem",
    "sampling_of",
    "sobol_points",
]
