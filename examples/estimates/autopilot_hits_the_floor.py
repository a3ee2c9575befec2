# SPDX-License-Identifier: Apache-2.0
"""How probable is it that an autopilot in gusts and sensor noise hits the floor, and how would it come about?

REMUS 100 dives to 10 m, one and a half metres above the floor, in a current that wanders in all directions, with a depth cell
that is noisy and somewhat wrong. Chains of members, over the numbers that vary and over all draws of the noise, come to the
hits level by level; the likeliest of those that they find is run again with its own noise, and recorded:

    python examples/estimates/autopilot_hits_the_floor.py [PICTURE]
    rerun autopilot_hits_the_floor.rrd
"""

import dataclasses
import sys
from pathlib import Path

import lgvi_warp as lw

SCENE = Path(__file__).parents[1] / "scenes" / "remus_100_autopilot.toml"
FLOOR = 11.5
RUN = {"method": "psi_x", "h": 0.1, "t1": 60.0, "threads": 1}


def fleet():
    """The scene without its fault, in gusts, above a floor."""
    scene = lw.Scene.load(SCENE, {"controller.delay": 0.1})
    gusts = lw.terms.GaussMarkovCurrent(standard_deviation=(0.05, 0.05, 0.05), time_constant=20.0)
    scene = dataclasses.replace(
        scene,
        terms=[*scene.terms, gusts],
        events=[lw.events.Floor(depth=FLOOR)],
        controller=dataclasses.replace(scene.controller, faults=()),
    )
    vary = {
        "vehicle.buoyancy": lw.distributions.Uniform(low=297.0, high=302.0),
        "depth_cell.bias": lw.distributions.Normal(std=0.1),
    }
    return lw.Ensemble(scene, vary=vary)


def likeliest(members, answer):
    """Run the likeliest member that hits the floor again, with its own noise."""
    run = lw.prepare(members, draws="given", save=lw.SaveAt(every=0.5), **RUN)
    numbers = {name: [value] for name, value in answer.likeliest.items()}
    return run(numbers, answer.likeliest_draws[None, :])


if __name__ == "__main__":
    picture = sys.argv[1] if len(sys.argv) > 1 else "autopilot_hits_the_floor.png"
    members = fleet()
    found = lw.rare_event(members, "floor", relative_error=0.3, seed=1, **RUN)
    print(found)
    result = likeliest(members, found)
    print(f"again: {result.status.counts()}, after {result.end_time[0]:.1f} s")
    print(lw.record(result, Path(picture).with_suffix(".rrd")))
    lw.plots.rare(found, path=picture)
    print(picture)
