# SPDX-License-Identifier: Apache-2.0
"""Noise of a prepared run's calls: drawn by the counters of given members, or standard normals passed to the call."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import members_of
from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.engine.counted_draws import counted_draws, dtype_of
from lgvi_warp.engine.plan import Plan
from lgvi_warp.methods.saveat import TimeGrid
from lgvi_warp.physics.given_draws import DrawLayout, GivenDraws
from lgvi_warp.scene.settings import MOST_MEMBERS, EnsembleSettings

# Most bytes of the normals of one call.
MOST_BYTES = 1_000_000_000
DRAWN, GIVEN = "drawn", "given"


@dataclass(frozen=True, eq=False)
class NoiseOfCalls:
    """Draws of a run and their source.

    layout: columns of the draws. given: whether calls pass the draws. seed, members: of the ensemble. plan: plan of the
    members that the run was prepared for; its kernel decides how normals are rounded. varied: names of the varied numbers.
    grid: steps.
    """

    layout: DrawLayout
    given: bool
    seed: int
    members: int
    plan: Plan
    varied: frozenset[str]
    grid: TimeGrid

    def of_call(self, xi: Any, members: int, keys: dict[str, Any]) -> GivenDraws | None:
        """Check and return the normals that a call passes for this many members; None if they are drawn.

        keys: other arguments of the call that select noise (seed, indices), by name.
        """
        faults = Faults()
        if xi is not None and not self.given:
            remedy = 'prepare the run with draws="given", or leave it out'
            faults.add("xi", "...", "is given to a run that draws its noise", remedy)
        for name, value in keys.items():
            if self.given and value is not None:
                problem = 'says whose noise each row has, where draws="given" takes it from xi'
                faults.add(name, value, problem, "give xi=lw.uq.draws_of(run, indices, seed=...)")
        faults.raise_if_any()
        if not self.given:
            return None
        if xi is None and self.layout.count == 0:
            xi = np.empty((members, 0))
        shape = f"give standard normals of shape ({members}, {self.layout.count}), such as lw.uq.draws_of(run, indices)"
        if xi is None:
            raise refusal("xi", None, 'is missing, since the run was prepared with draws="given"', shape)
        return GivenDraws(self.layout, self._checked(xi, members, shape))

    def _checked(self, xi: Any, members: int, shape: str) -> np.ndarray:
        """Check the normals of a call and return them as an array (members, m), float32 or float64."""
        faults = Faults()
        values = xi if type(xi) is np.ndarray and xi.dtype in (np.float32, np.float64) else faults.real("xi", xi, shape)
        faults.raise_if_any()
        assert values is not None
        if values.shape != (members, self.layout.count):
            raise refusal("xi", "...", f"has shape {values.shape}", shape)
        check_size(members, self.layout.count, values.dtype.itemsize)
        # NaN is the least of what it is among; two passes without an array of answers.
        if values.size and not (np.isfinite(values.min()) and np.isfinite(values.max())):
            row, column = (int(i) for i in np.argwhere(~np.isfinite(values))[0])
            problem = f"is not finite in row {row}, column {column} ({self.layout.owner(column)})"
            raise refusal("xi", float(values[row, column]), problem, "give standard normals")
        return values


def check_size(members: int, numbers: int, size: int) -> None:
    """Refuse a call with normals of more than MOST_BYTES; the message says how many bytes they would take."""
    if (total := members * numbers * size) > MOST_BYTES:
        problem = f"would be {members:,} members times {numbers:,} normals of {size} bytes, {total / 1e9:,.1f} GB"
        raise refusal(
            "xi", "...", problem, f"call with fewer members at once, at most {MOST_BYTES // (numbers * size):,}"
        )


def checked_indices(indices: Any, members: int | None = None) -> np.ndarray:
    """Check indices of members and return them as int64 (n,); members: the required length n, None for any."""
    keys = members_of("indices", indices)
    if members not in (None, len(keys)) or keys.max() >= MOST_MEMBERS:
        problem = "are not one whole number from 0 for each member"
        shape = "(n,)" if members is None else f"({members},)"
        raise refusal("indices", indices, problem, f"give an array of shape {shape}, of numbers below {MOST_MEMBERS}")
    return keys


def draws_of(run: Any, indices: Any = None, *, seed: int | None = None, members: int | None = None) -> np.ndarray:
    """Return the standard normals that the random number generator draws in a call without given draws.

    Let `plain` be the same run prepared without draws="given". Then run(X, lw.uq.draws_of(run, indices)) gives the bits
    of plain(X, indices=indices); the last digit may differ only with `rkmk4` in float32 and with width=1. Change these
    normals to study one gust, to set the first columns to Sobol points, or to move a Markov chain over the noise.

    Args:
        run: A run made by `lw.prepare`.
        indices: (n,), whole numbers from 0: indices of the members whose draws are returned. Default None: the members
            0 to members - 1.
        seed: Seed of the noise, a whole number from 0; default None: the seed of the ensemble.
        members: Number of members if `indices` is None; default None: all members of the ensemble.

    Returns:
        Standard normals (n, m); `run.draws` lists the columns. Their type is the type in which the kernel draws:
        float32 for a run in "float32" or "float32_compensated", otherwise float64. If a term draws its initial value,
        as a stationary current does, the type is always float64.

    Raises:
        SceneError: If arguments are at fault, or the normals would take more than 1 GB.

    Examples:
        >>> import lgvi_warp as lw
        >>> gusts = lw.terms.WrenchNoise(force=(0.0, 0.0, 1.0))
        >>> scene = lw.Scene.named("sphere", terms=[gusts])
        >>> run = lw.prepare(scene, ["start.position[2]"], of="depth", draws="given", method="psi_x", h=0.1, t1=1.0)
        >>> xi = lw.uq.draws_of(run, [3, 4])
        >>> xi.shape
        (2, 30)
        >>> bool((run([[0.0], [0.0]], xi) == run([[0.0], [0.0]], 0.0 * xi)).any())
        False
    """
    noise = getattr(run, "noise", None)
    if not isinstance(noise, NoiseOfCalls):
        raise refusal("run", run, "is not a prepared run", "give what lw.prepare returns")
    if indices is not None and members is not None:
        raise refusal("members", members, "is given beside indices, which say how many", "leave out one of them")
    settings = EnsembleSettings(members, noise.seed if seed is None else seed)
    keys = np.arange(settings.members or noise.members) if indices is None else checked_indices(indices)
    spec = noise.plan.spec
    check_size(len(keys), noise.layout.count, np.dtype(dtype_of(noise.layout, spec.real)).itemsize)
    return counted_draws(noise.layout, int(settings.seed), keys, spec.width, spec.real)
