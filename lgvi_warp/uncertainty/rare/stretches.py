# SPDX-License-Identifier: Apache-2.0
"""Store of a walk's stretches from level to level in a folder: an interrupted call continues after the last stretch."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from lgvi_warp.common.safe_files import parsed
from lgvi_warp.criteria.memory import Remembered
from lgvi_warp.sampling.final import NUMBERS, Final
from lgvi_warp.uncertainty.rare.flock import AXES, Flock
from lgvi_warp.uncertainty.rare.stages import AtLook, Stage

# What the names of a member's parameters begin with among the arrays of its place.
PARAMETER = "parameter."


class Stretches:
    """Stretches of a walk, run and stored in a folder, or read from it."""

    def __init__(self, remembered: Remembered):
        self._remembered = remembered

    def __call__(self, walk: Any, stage: Stage, bound: float, go: Callable[[], AtLook]) -> AtLook:
        """Members that reach a bound, by checkpoint; a stored stretch updates walk and stage like a run."""
        steps, seconds = walk.steps_run, walk.seconds

        def arrays(*_: np.ndarray) -> tuple[np.ndarray, ...]:
            crossed = go()
            named: dict[str, Any] = {
                "reach": stage.reach,
                "steps": walk.steps_run - steps,
                "seconds": walk.seconds - seconds,
            }
            for look, (rows, flock) in crossed.items():
                named |= {f"{look} rows": rows} | {f"{look} {name}": each for name, each in arrays_of(flock).items()}
            return np.array(list(named)), *(np.asarray(each) for each in named.values())

        begins = [stage.run, stage.u, stage.look, stage.key, stage.before, np.array(bound)]
        names, *values = self._remembered("stretch", arrays, *begins)
        kept = dict(zip(names.tolist(), values, strict=True))
        stage.reach[:] = kept.pop("reach")
        walk.steps_run, walk.seconds = steps + int(kept.pop("steps")), seconds + float(kept.pop("seconds"))
        looks: dict[int, dict[str, np.ndarray]] = {}
        for name, each in kept.items():
            look, _, what = name.partition(" ")
            looks.setdefault(int(look), {})[what] = each
        return {look: (own.pop("rows"), flock_of(look, own)) for look, own in looks.items()}


def arrays_of(flock: Flock) -> dict[str, np.ndarray]:
    """Convert members at a checkpoint after the start to arrays by name."""
    place: Final = flock.place
    numbers = json.dumps({name: getattr(place, name) for name in NUMBERS})
    parameters = {f"{PARAMETER}{name}": np.asarray(each) for name, each in place.parameters.items()}
    return (
        {name: getattr(flock, name) for name in AXES} | place.to_arrays() | parameters | {"numbers": np.array(numbers)}
    )


def flock_of(look: int, arrays: dict[str, np.ndarray]) -> Flock:
    """Build members at a checkpoint from the arrays of `arrays_of`."""
    parameters = {name.removeprefix(PARAMETER): each for name, each in arrays.items() if name.startswith(PARAMETER)}
    place = Final.from_arrays(arrays, parsed(str(arrays["numbers"])), parameters)
    return Flock(look, place, **{name: arrays[name] for name in AXES})
