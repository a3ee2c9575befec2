# SPDX-License-Identifier: Apache-2.0
"""The final states of a run in a result, and in a result's file."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np

from lgvi_warp.common.safe_files import parsed
from lgvi_warp.engine.going_on import known_settings
from lgvi_warp.engine.plan import Plan
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.results.drawn import DrawnParameters
from lgvi_warp.sampling.final import NUMBERS, PREFIX, SUM, Final


def final_of(
    plan: Plan, members: int, states: Mapping[str, np.ndarray], status: np.ndarray, rows: Mapping[str, np.ndarray]
) -> Final:
    """Build the final states of the first members of a plan's run.

    states: (n, ...), by field. status: (n,). rows: final rows of their packets (see engine/going_on.py).
    """
    fleet = plan.ensemble
    return Final(
        time=float(plan.grid.times[-1]),
        step=plan.grid.h,
        steps=plan.grid.last,
        states={name: states[name] for name in FIELDS if name in states},
        status=np.asarray(status),
        indices=fleet.indices_of(0, members),
        seed=fleet.seed,
        parameters=DrawnParameters(fleet, members),
        lanes=rows,
        settings=known_settings(plan),
    )


def to_file(final: Final) -> tuple[dict[str, np.ndarray], str]:
    """Convert final states to arrays and a JSON text, without the states and parameters, which the result has."""
    left_out = f"{PREFIX}states.", f"{PREFIX}{SUM}"
    arrays = {name: rows for name, rows in final.to_arrays().items() if not name.startswith(left_out)}
    return arrays, json.dumps({name: getattr(final, name) for name in NUMBERS})


def from_file(
    content: Mapping[str, np.ndarray], samples: Mapping[str, np.ndarray], parameters: Mapping[str, np.ndarray]
) -> Final | None:
    """Read the final states from the content of a checked file; None if the file has no final states."""
    if "final" not in content:
        return None
    states = {f"{PREFIX}states.{name}": samples[name][-1] for name in FIELDS if name in samples}
    return Final.from_arrays({**content, **states}, parsed(str(content["final"])), parameters)
