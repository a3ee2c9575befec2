# SPDX-License-Identifier: Apache-2.0
"""The limit function of an event, of standard normals: first for the varied numbers, then for the draws of noise."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from lgvi_warp.calls.prepared import FailedMembers, Prepared, prepare
from lgvi_warp.common.errors import refusal
from lgvi_warp.criteria.memory import Remembered
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.runs.request import ensemble_of
from lgvi_warp.sampling.designs.table import Table
from lgvi_warp.scene.columns import as_given, columns_of
from lgvi_warp.scene.ensemble import Ensemble
from lgvi_warp.uncertainty.rare.event import FAILED, SURE, RareCondition

# Most numbers of the normals of one call: 160 MB.
MOST_NUMBERS = 20_000_000
# Spread of a limit that has none.
NO_SPREAD = 1e-290
# Levels of the cube are as far from its sides as this.
NEAREST_LEVEL = 2.0**-53


class Varying:
    """The varied numbers of a scene's members, as standard normals.

    Attributes:
        names: names of the numbers; each number has one normal.
    """

    names: tuple[str, ...] = ()

    def __init__(self, fleet: Any):
        self.fleet: Ensemble = ensemble_of(fleet)
        if brought := [*self.fleet.sampling.own_values(), *self.fleet.sampling.distributions()]:
            problem = f"is a {self.fleet.sampling.kind}, which gives members values and no distribution"
            remedy = f"give distributions of {', '.join(brought[:4])} in vary"
            raise refusal("ensemble.sampling", self.fleet.sampling.kind, problem, remedy)
        if self.fleet.explicit():
            raise refusal("fleet", "...", "has members that were given one by one", "give distributions in vary")

    def states(self, count: int) -> dict[str, Any]:
        """The start of a scene, `count` times, if no number varies."""
        member = self.fleet.select(0, 1)
        return {name: np.repeat(getattr(member, name), count, axis=0) for name in FIELDS}

    def levels(self, u: np.ndarray) -> np.ndarray:
        """Levels in (0, 1) of the varied numbers, in the order of the names."""
        from scipy.special import ndtr

        return np.asarray(np.clip(ndtr(u[:, : len(self.names)]), NEAREST_LEVEL, 1.0 - NEAREST_LEVEL))

    def values(self, u: np.ndarray) -> dict[str, np.ndarray]:
        """Values (n, ...) of the varied numbers, by name."""
        fleet = self.fleet
        described = as_given(fleet)
        columns = [column for variation in described for column in columns_of(fleet.space, variation.key)]
        cube = np.empty((len(u), len(columns)))
        cube[:, columns] = self.levels(u)
        levels = fleet.space.split(cube)
        drawn = [pair for variation in described for pair in variation.values(levels[variation.key])]
        return {target.label: values for target, values in drawn}

    def table(self, u: np.ndarray) -> Table | None:
        """Members with these normals as a table for `lw.Ensemble`; None if only noise varies."""
        return Table(values=self.values(u)) if self.names and len(u) else None


class VehicleLimit(Varying):
    """A scene as a limit function: standard normals (n, d) -> limits (n,), positive if the event happens.

    fleet: the scene and its distributions. condition: the event. settings: arguments of `prepare`. failed: "event"
    gives failed members the limit `FAILED`; or "refuse". remembered: store of calls, by a name; None for none.

    Attributes:
        names: names of the varied numbers, whose normals come first.
        draws: number of normals of noise, which come after these.
        members, seconds: number of members that were run, and their time [s].
    """

    def __init__(
        self, fleet: Any, condition: RareCondition, settings: Mapping[str, Any], failed: str = "event",
        remembered: Remembered | None = None, name: str = "",
    ):  # fmt: skip
        super().__init__(fleet)
        self._remembered, self._name = remembered or Remembered(), name
        self.condition, self._refuse = condition, failed == "refuse"
        varies = {"levels": True} if self.fleet.vary else {}
        self.run: Prepared = prepare(
            self.fleet,
            **condition.arguments(self.fleet.scene, settings.get("h")) | varies | {"draws": "given"} | dict(settings),
        )
        self.names = self.run.names if self.fleet.vary else ()
        self.sources = tuple(getattr(self.run, "draws", ()))
        self.draws = int(sum(each.numbers for each in self.sources))
        self.members, self.seconds = 0, 0.0
        self._spreads: np.ndarray | None = None
        if not self.d:
            remedy = "give distributions, vary={...}, or noise"
            raise refusal("fleet", "...", "has nothing that varies, and no noise", remedy)

    @property
    def d(self) -> int:
        """Number of the normals."""
        return len(self.names) + self.draws

    def __call__(self, u: np.ndarray) -> np.ndarray:
        """The limits (n,) of members whose normals are u (n, d). docs/theory/rare_events.md, (B1)."""
        rows = self.each(u)
        if self._spreads is None:
            self._spreads = spreads_of(rows)
        limits = limits_of(rows, self._spreads)
        limits[np.isinf(rows[0])] = FAILED
        return np.asarray(limits)

    def each(self, u: np.ndarray) -> np.ndarray:
        """The limits (k, n) of each condition, in its own unit; failed members have the limit `FAILED` for all."""
        rows, lost = self._parts(u)
        if self._refuse:
            refuse_lost(lost)
        return np.where(lost, FAILED, rows)

    def tolerant(self, u: np.ndarray) -> np.ndarray:
        """Limits like `each`, but if failed members are refused, they count as not meeting the event."""
        rows, lost = self._parts(u)
        return np.where(lost, -SURE if self._refuse else FAILED, rows)

    def _parts(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Limits (k, n) and a mask of failed members (n,), from a run or from the store."""
        rows, lost, seconds = self._remembered(self._name, self._ran, u)
        self.seconds += float(seconds)
        self.members += len(u)
        return rows, lost

    def _ran(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Limits (k, n), a mask of failed members (n,), and the time [s]; as many members at once as memory holds."""
        at_once, begin = max(1, MOST_NUMBERS // self.d), time.perf_counter()
        parts = [self.condition.distances(self._answers(u[i : i + at_once])) for i in range(0, len(u), at_once)]
        seconds = np.array(time.perf_counter() - begin)
        return np.concatenate([rows for rows, _ in parts], axis=1), np.concatenate([lost for _, lost in parts]), seconds

    def _answers(self, u: np.ndarray) -> Any:
        """Return values of the run for members with these normals."""
        count = len(self.names)
        xi: dict[str, Any] = {"xi": np.ascontiguousarray(u[:, count:])} if self.draws else {}
        if count:
            return self.run(self.levels(u), **xi)
        return self.run.states(**self.states(len(u)), **xi)


def refuse_lost(lost: np.ndarray) -> None:
    """Raise FailedMembers if members (n,) failed."""
    if lost.any():
        problem = f"limit: {int(lost.sum())} of {len(lost)} members failed, or have a number that is not finite"
        raise FailedMembers([f'{problem}. Fix the failing members, or count them as the event: failed="event"'])


def limits_of(distances: np.ndarray, spreads: np.ndarray) -> np.ndarray:
    """The limits (n,): the largest of the distances (c, n), each in its unit."""
    with np.errstate(over="ignore"):
        return np.asarray(np.clip(distances / spreads[:, None], -SURE, SURE).max(axis=0))


def spreads_of(distances: np.ndarray) -> np.ndarray:
    """Unit of each limit (k, n): its standard deviation; 1 for a single limit, which keeps its unit."""
    if len(distances) == 1:
        return np.ones(1)
    ordinary = np.where(np.abs(distances) < 1e300, distances, np.nan)
    with np.errstate(all="ignore"):
        spreads = np.where(np.nanmax(ordinary, axis=1) > np.nanmin(ordinary, axis=1), np.nanstd(ordinary, axis=1), 0.0)
    # What never differs leads nowhere: it is further away than all that does, until it happens.
    return np.where(spreads > 0.0, spreads, NO_SPREAD)
