# SPDX-License-Identifier: Apache-2.0
"""New starts for members that reached a level: Metropolis steps with the members' own noise.

Copies of a member share its start. A Metropolis step from each start is accepted if the member still reaches the level
with its own noise. This keeps the distribution of members at the level, so any steps leave the answer unbiased.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from lgvi_warp.uncertainty.rare.flock import Score, Walk
from lgvi_warp.uncertainty.rare.stages import Log, Stage, by_look, note, walked


def moved(
    walk: Walk, score: Score, before: list[Stage], stage: Stage, bound: float, step: np.ndarray,
    generators: Sequence[np.random.Generator]) -> tuple[Stage, float]:  # fmt: skip
    """A stage after a step (d,) from each start, accepted if the member reaches the bound; and the accepted fraction.

    before: the stages that led to this one, which is appended to them. generators: one for each independent run.
    """
    counts = np.bincount(stage.run, minlength=len(generators))
    z = np.concatenate([rng.standard_normal((count, walk.d)) for rng, count in zip(generators, counts, strict=True)])
    u = np.sqrt(1.0 - step**2) * stage.u + step * z
    nothing, rows = np.full(len(u), -np.inf), np.arange(len(u))
    trial = replace(stage, u=u, before=nothing, reach=nothing.copy(), entrants={0: (rows, walk.begin(u))})
    crossed = walked(walk, score, trial, bound, keys=noise_of([*before, stage]))
    accepted, look = np.zeros(len(u), bool), np.zeros(len(u), int)
    entrants: dict[int, Log] = {}
    for reached, _ in crossed.values():
        accepted[reached] = True
    for own, at_looks in ((accepted, crossed), (~accepted, stage.entrants)):
        for at, (those, flock) in at_looks.items():
            note(entrants, at, those, flock, own[those])
            look[those[own[those]]] = at
    before.append(replace(stage, entrants={}))
    # All have new noise from where they are at the level: what a step that was refused says of it must not stay.
    reach = np.where(accepted, trial.reach, stage.before)
    there = Stage(stage.run, np.where(accepted[:, None], u, stage.u), rows, look, walk.keys(len(u)), reach, reach.copy(),
                  by_look(walk, entrants), accepted)  # fmt: skip
    return there, float(accepted.mean())


def noise_of(stages: Sequence[Stage]) -> Callable[[int], np.ndarray]:
    """Function of a checkpoint: keys (n,) of the last stage's noise up to the next checkpoint."""
    rows = np.arange(len(stages[-1].key))
    looks, keys = list[np.ndarray](), list[np.ndarray]()
    for stage in reversed(stages):
        looks.append(stage.look[rows])
        keys.append(stage.key[rows])
        rows = stage.parent[rows]
    since, by_stage = np.stack(looks), np.stack(keys)

    def at(look: int) -> np.ndarray:
        # The last of the stages that has begun.
        return np.asarray(by_stage[np.argmax(since <= look, axis=0), np.arange(by_stage.shape[1])])

    return at
