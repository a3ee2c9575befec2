# SPDX-License-Identifier: Apache-2.0
"""Failed members, looked at one by one: which members failed, why, and what would have helped.

A step of 0.5 s is too long for vehicles that turn fast. A failed member keeps its last good state; all others continue.
The failed members run again with a shorter step. Then the fleet runs with `on_failure="substep"`, which divides steps.
"""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import lgvi_warp as lw

scene = lw.Scene.load(Path(__file__).parent / "paper.toml")
fleet = lw.Ensemble(scene, members=400, seed=1, vary={"start.angular_velocity": lw.distributions.Normal(std=2.0)})


def plot(rates, failed, path):
    """Plot rates of turn at the start: bars of all members, and in front of them bars of the failed members."""
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.subplots()
    bins = np.linspace(0.0, rates.max(), 30)
    axes.hist(rates, bins, color="#0072B2", label=f"ok ({np.sum(~failed)})")
    axes.hist(rates[failed], bins, color="#D55E00", hatch="///", label=f"failed ({np.sum(failed)})")
    axes.set(
        xlabel="rate of turn at the start [rad/s]", ylabel="members", title="One number tells the failed members apart"
    )
    axes.legend()
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    result = lw.solve(fleet, h=0.5, t1=20.0)
    failed = np.asarray(result.status.failed)
    rates = np.linalg.norm(result.angular_velocity[0], axis=1)
    print(result.status.counts())
    for member in np.flatnonzero(failed)[:3]:
        status = lw.Status(result.status[member])
        when, value = result.failure_time[member], result.failure_value[member]
        print(
            f"member {member}: {status.name} at {when:g} s, value {value:.2f}; it turned at {rates[member]:.1f} rad/s"
        )
    shorter = lw.solve(fleet.subset(np.flatnonzero(failed)), h=0.05, t1=20.0)
    print("with 0.05 s:", shorter.status.counts())
    divided = lw.solve(fleet, h=0.5, t1=20.0, on_failure="substep")
    print("in parts:", divided.status.counts(), int((divided.substeps > 0).sum()), "members")
    print(plot(rates, failed, "09_failed_members.png"))
