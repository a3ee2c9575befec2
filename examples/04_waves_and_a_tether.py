# SPDX-License-Identifier: Apache-2.0
"""Waves and a tether: buoys below the surface, moored to the sea floor.

Waves move the water and the buoys, and a mooring pulls its buoy while it is taut. The phases of the waves differ from
member to member: 300 realisations of one sea. The script defines the pull of a mooring as its own quantity.
"""

import numpy as np
from matplotlib.figure import Figure

import lgvi_warp as lw

ANCHOR, STIFFNESS, LENGTH = np.array([0.0, 0.0, 20.0]), 40.0, 9.5  # m, N/m, m
FOOT = np.array([0.0, 0.0, 0.5])  # m: where the mooring holds a buoy

waves = lw.terms.Waves(amplitudes=[0.9, 0.5, 0.3], periods=[9.0, 7.0, 5.5], headings_deg=[0.0, 25.0, -20.0])
tether = lw.terms.Tether(anchor=ANCHOR, stiffness=STIFFNESS, attachment=FOOT, rest_length=LENGTH)
drag = lw.terms.Drag(linear=[5.0, 5.0, 5.0, 2.0, 2.0, 2.0], quadratic=[60.0, 60.0, 60.0, 5.0, 5.0, 5.0])
buoy = lw.Vehicle(
    mass=60.0,  # kg
    added_mass=[30.0, 30.0, 30.0],  # kg
    inertia=[4.0, 4.0, 4.0],  # kg m2
    buoyancy=60.0 * 9.81 + 40.0,  # N: 40 N light
    center_of_buoyancy=[0.0, 0.0, -0.1],  # m
)
start = lw.Start(position=[0.0, 0.0, 9.0])
fleet = lw.Ensemble(
    lw.Scene(buoy, start=start, terms=[waves, tether, drag]),
    members=300,
    seed=1,
    vary={"waves.phases": lw.distributions.Uniform(low=0.0, high=2.0 * np.pi)},
)


def pull(samples, members=None):
    """Pull of the mooring (k, n) [N]."""
    foot = samples["position"] + samples["attitude"] @ FOOT
    return STIFFNESS * np.maximum(np.linalg.norm(foot - ANCHOR, axis=-1) - LENGTH, 0.0)


if __name__ == "__main__":
    result = lw.solve(fleet, h=0.02, t1=60.0, save=lw.SaveAt(every=0.25))
    newtons = pull(result.samples)
    print(result.status.counts())
    print(f"the mooring pulls {newtons.mean():.0f} N on average, {newtons.max():.0f} N at most,")
    print(f"and hangs slack {np.mean(newtons == 0.0):.1%} of the time")
    figure = Figure(figsize=(12.0, 5.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    lw.plots.phase(result, ("position[0]", "depth"), 2, ax=left).set_title("2 of 300 buoys, seen from the east")
    lw.plots.fan(result, lw.statistics.Quantity("pull of the mooring", pull, "N"), ax=right)
    figure.savefig("04_waves_and_a_tether.png", dpi=100)
    print("04_waves_and_a_tether.png")
