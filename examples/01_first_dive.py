# SPDX-License-Identifier: Apache-2.0
"""A first dive: 1,000 vehicles with slightly different numbers dive for 60 seconds.

Mass, heading and thrust are uncertain. The ellipse shows two standard deviations of the positions north and east after
60 s. `rerun 01_first_dive.rrd` plays a recording of the vehicles.
"""

import numpy as np
from matplotlib.figure import Figure

import lgvi_warp as lw

body = {"mass": 123.8, "inertia": [5.46, 5.29, 5.72], "added_mass": [65.0, 70.0, 75.0]}  # kg, kg m2, kg
# N: 4.4 N less than the weight; m: above the origin, so that it stays upright.
vehicle = lw.Vehicle(**body, buoyancy=1208.8, center_of_buoyancy=[0.0, 0.0, -0.02])
start = lw.Start(position=[0.0, 0.0, 5.0], velocity=[1.0, 0.0, 0.0])  # m: north, east, down; m/s: ahead
terms = [
    lw.terms.Drag(linear=[5.0, 30.0, 30.0, 2.0, 20.0, 20.0], quadratic=[10.0, 60.0, 60.0, 1.0, 5.0, 5.0]),
    lw.terms.Wrench(force=[15.0, 0.0, 0.0]),  # N: a propeller
]
scene = lw.Scene(vehicle=vehicle, environment=lw.Environment(gravity=9.8), start=start, terms=terms)
vary = {
    "vehicle.mass": lw.distributions.TruncatedNormal(relative=0.001),
    "start.rotation_vector": lw.distributions.Normal(std=[0.0, 0.0, 0.2]),  # rad: heading
    "wrench.force": lw.distributions.Normal(std=[2.0, 0.0, 0.0]),  # N
}
fleet = lw.Ensemble(scene, members=1000, seed=1, vary=vary)

if __name__ == "__main__":
    result = lw.solve(fleet, h=0.02, t1=60.0, save=lw.SaveAt(every=0.5))
    place = result.position[-1]
    middle, (north, east, down) = place.mean(axis=0), 2.0 * place.std(axis=0)
    print(result.status.counts())
    print(f"two standard deviations after 60 s: {north:.1f} m north, {east:.1f} m east, {down:.1f} m down")
    figure = Figure(figsize=(12.0, 6.0), layout="constrained")
    above, depth = figure.subplots(1, 2)
    lw.plots.plan_view(result, 100, ax=above)
    turn = np.linspace(0.0, 2.0 * np.pi, 100)
    ellipse = middle[1] + east * np.cos(turn), middle[0] + north * np.sin(turn)
    above.plot(*ellipse, "--", color="black", zorder=5, label="two standard deviations")
    above.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, frameon=False)
    lw.plots.fan(result, "depth", ax=depth).set_title("Depth of 1,000 members")
    figure.savefig("01_first_dive.png", dpi=100)
    print("01_first_dive.png", lw.record(result, "01_first_dive.rrd"))
