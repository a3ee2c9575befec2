# SPDX-License-Identifier: Apache-2.0
"""Lander that sinks through a current onto a slope: where does it come to rest, and how far does it slide?"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

SLOPE_DEG, DEPTH = 18.0, 30.0  # of the floor; m at the origin
STEP, END = 0.01, 60.0  # s
FEET = [[0.5, 0.5, 0.6], [0.5, -0.5, 0.6], [-0.5, 0.5, 0.6], [-0.5, -0.5, 0.6]]

frame = lw.Vehicle(
    mass=90.0, inertia=[14.0, 14.0, 12.0], added_mass=[50.0, 50.0, 70.0],
    buoyancy=820.0, center_of_buoyancy=[0.0, 0.0, -0.05],
)  # fmt: skip
edge = DEPTH + 500.0 * np.tan(np.radians(SLOPE_DEG)) * np.array([-1.0, 1.0])
floor = lw.events.Floor(
    depth=np.stack([edge, edge], axis=1), origin=[-500.0, -500.0], spacing=[1000.0, 1000.0], contact="rest"
)
scene = lw.Scene(
    frame,
    lw.Environment(gravity=9.81),
    terms=[
        lw.terms.Drag(quadratic=[300.0, 300.0, 500.0, 40.0, 40.0, 30.0], linear=[20.0, 20.0, 20.0, 10.0, 10.0, 10.0]),
        lw.terms.Current(velocity=[0.05, 0.1, 0.0]),
        lw.terms.BottomContact(points=FEET, friction=0.5),
    ],
    start=lw.Start(position=[0.0, 0.0, 22.0]),
    events=[floor],
)


def landed(members):
    """Vehicles on floors of uncertain friction, in uncertain currents."""
    vary = {
        "bottom_contact.friction": lw.distributions.Uniform(low=0.25, high=0.7),
        "current.velocity": lw.distributions.Normal(std=[0.02, 0.04, 0.0]),
    }
    return lw.solve(lw.Ensemble(scene, members, 1, vary), "psi_s", h=STEP, t1=END, save=lw.SaveAt(every=0.5))


def at_rest(result):
    """Whether each vehicle has not moved in the last two seconds."""
    return np.linalg.norm(result.position[-1] - result.position[-5], axis=-1) < 1e-6


def plot(path, result):
    """Paths from above, and speeds over ground."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    speed = np.linalg.norm(np.diff(result.position, axis=0), axis=-1) / np.diff(result.time)[:, None]
    rests = at_rest(result)
    for chosen, color, text in ((rests, "#0072B2", "at rest in the end"), (~rests, "#D55E00", "sliding")):
        left.plot(result.position[:, chosen, 1], result.position[:, chosen, 0], color=color, linewidth=0.6)
        right.plot(result.time[1:], speed[:, chosen], color=color, linewidth=0.6)
        right.plot([], [], color=color, label=text)
    left.set(xlabel="east [m]", ylabel="north, down the slope [m]", title="from above", aspect="equal")
    right.set(xlabel="time [s]", ylabel="speed over ground [m/s]", title=f"slope of {SLOPE_DEG:g}°")
    right.legend(fontsize=8)
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/land_on_a_slope.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    result = landed(60)
    rests, friction = at_rest(result), result.parameters["bottom_contact.friction"]
    print(f"{rests.sum()} of {rests.size} landers rest, with a friction from {friction[rests].min():.2f}")
    steep = np.tan(np.radians(SLOPE_DEG))
    print(f"the others slide, with up to {friction[~rests].max():.2f}; the slope's tangent is {steep:.2f}")
    print(plot(target, result))
