# SPDX-License-Identifier: Apache-2.0
"""Cheaper settings for chains: choose one that agrees with the scene itself for members near failure."""

from __future__ import annotations

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import prepare
from lgvi_warp.common.arguments import items_of
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.common.random import generator
from lgvi_warp.scene import variations
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.scene.names import by_key
from lgvi_warp.scene.scene import Scene
from lgvi_warp.uncertainty.rare.limit import VehicleLimit

# Members of the pilot, the part of them nearest to failure, and the least squared correlation there.
PILOT, NEAREST, CORRELATED = 256, 0.25, 0.9
# How far from failure a member of the event may be at the cheaper setting, in standard deviations of what it misses.
MARGIN = 4.0
SETTINGS = frozenset(inspect.signature(prepare).parameters) - {
    "fleet",
    "vary",
    "of",
    "levels",
    "failed",
    "statistics",
    "draws",
}


@dataclass(frozen=True)
class Cheaper:
    """A cheaper setting; name: text of the differences."""

    name: str
    fleet: Ensemble
    settings: Mapping[str, Any]


@dataclass(frozen=True, eq=False)
class ChainLimit:
    """A cheaper limit, scaled to the scene's own limit; margin: see `MARGIN`."""

    limit: VehicleLimit
    name: str
    offset: float
    slope: float
    margin: float

    def __call__(self, u: np.ndarray) -> np.ndarray:
        return self.offset + self.slope * self.limit(u)


def cheaper_of(entries: Any, fleet: Ensemble, settings: Mapping[str, Any]) -> list[Cheaper]:
    """Read the cheaper settings: dicts of numbers of the scene and settings of the run."""
    listed = items_of(entries)
    if listed is None:
        raise refusal("cheaper", entries, "is not a list", 'give [{"h": 0.1, "dtype": "float32"}]')
    faults, settled = Faults(), []
    for i, entry in enumerate(listed):
        if not isinstance(entry, Mapping) or not entry:
            faults.add(f"cheaper[{i}]", entry, "names nothing that differs", 'give {"h": 0.1, "controller.delay": 0.0}')
            continue
        with faults.including():
            settled.append(_cheaper(f"cheaper[{i}]", entry, fleet, settings))
    faults.raise_if_any()
    return settled


def _cheaper(key: str, entry: Mapping[str, Any], fleet: Ensemble, settings: Mapping[str, Any]) -> Cheaper:
    numbers = {name: value for name, value in entry.items() if name not in SETTINGS}
    for name in numbers:
        if any(target.name in fleet.varied_names for target in variations.targets(by_key(fleet.scene, name))):
            raise refusal(f"{key}.{name}", entry[name], "is of a number that varies", "leave it out")
    scene = fleet.scene
    assert isinstance(scene, Scene)
    changed = Ensemble(scene.with_numbers(numbers), 1, fleet.seed, fleet.vary) if numbers else fleet
    own = {name: value for name, value in entry.items() if name in SETTINGS}
    words = ", ".join(f"{name} = {value}" for name, value in entry.items())
    return Cheaper(words, changed, {**settings, **own})


def chosen_chain(
    own: VehicleLimit, others: Mapping[str, VehicleLimit], seed: int
) -> tuple[ChainLimit | None, list[str]]:
    """The fastest limit that agrees with the scene's own near failure; None if there is none, and notes."""
    notes = []
    for name, other in others.items():
        if other.d != own.d or other.names != own.names:
            problem = f"has {other.d} normals where the scene has {own.d}"
            raise refusal("cheaper", name, problem, "keep what varies, and the times at which noise is drawn")
    u = generator(seed, "rare pilot").standard_normal((PILOT, own.d))
    limits = own(u)
    near = np.argsort(limits)[-round(NEAREST * PILOT) :]
    fitting = []
    for name, other in others.items():
        offset, slope, missed, shared = compared(limits[near], other(u)[near])
        pace = other.seconds / other.members
        if shared <= CORRELATED:
            problem = f"tells {shared:.0%} of the scene's own limit near failure, less than {CORRELATED:.0%}"
            notes.append(f"cheaper: {name}: {problem}. Name a setting nearer to the scene's own")
        else:
            fitting.append((pace, ChainLimit(other, name, offset, slope, MARGIN * missed)))
    return (min(fitting, key=lambda pair: pair[0])[1] if fitting else None), notes


def compared(own: np.ndarray, other: np.ndarray) -> tuple[float, float, float, float]:
    """Linear fit of limits by others (n,): (offset, slope, standard deviation of residuals, squared correlation)."""
    ordinary = (np.abs(own) < 1e300) & (np.abs(other) < 1e300)
    x, y = other[ordinary], own[ordinary]
    if len(x) < 16 or not (x.std() > 0.0 and y.std() > 0.0):
        return 0.0, 1.0, 0.0, 0.0
    correlation = float(np.corrcoef(x, y)[0, 1])
    slope = correlation * float(y.std() / x.std())
    offset = float(y.mean() - slope * x.mean())
    missed = float((y - offset - slope * x).std())
    return offset, slope, missed, correlation**2 if correlation > 0.0 else 0.0
