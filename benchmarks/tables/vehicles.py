# SPDX-License-Identifier: Apache-2.0
"""Measure how the vehicles that others have modelled run ahead, turn and right themselves, by one run of each.

Speeds and circles are those at the end of a run with held commands, by `rk4`; tests/laws/test_named_vehicles.py checks
them against the steady equations. They are properties of the models: no timing, the same on every machine.
"""

import numpy as np

from benchmarks import named_vehicles as named
from benchmarks.pages import markdown


def main() -> str:
    columns = {name: column(name) for name in named.TRIALS}
    rows = [[title, *(column[title] for column in columns.values())] for title in next(iter(columns.values()))]
    written = "Written by `python -m benchmarks table vehicles`; do not edit between the marks."
    return f"{markdown(['', *(f'`{name}`' for name in columns)], rows)}\n\n{written}"


def column(name: str) -> dict[str, str]:
    """Motion of a vehicle, in words by title."""
    run, trial = named.run(name), named.TRIALS[name]
    ahead, down = run.over_ground("ahead")
    level, _ = run.over_ground("turn")
    rate, wandering = run.end("turn")[5], abs(run.end("ahead")[5])
    _, alone = run.over_ground("free")
    return {
        "run ahead": trial.words[0],
        "speed over ground [m/s]": f"{ahead:.3g}"
        + (f", on a circle of {2.0 * ahead / wandering:.3g} m" if wandering > 1e-6 else ""),
        "rises meanwhile [m/s]": f"{-down:.2g}" if abs(down) > 1e-3 else "0",
        "turn": trial.words[1],
        "turning circle, diameter [m]": f"{2.0 * level / abs(rate):.3g}",
        "rate of turn [degrees/s]": f"{np.degrees(rate):.3g}",
        "speed in the turn [m/s]": f"{level:.3g}",
        "left alone it rises [m/s]": f"{-alone:.2g}" if abs(alone) > 1e-3 else "0",
        "roll from 20 degrees": named.righting(run.time, run.angle("rolled")),
        "pitch from 20 degrees": named.righting(run.time, run.angle("pitched")),
    }
