# SPDX-License-Identifier: Apache-2.0
"""How probable is it that a glider's survey ends on the sea floor, if the eddy it crosses is known roughly?

    python examples/studies/glider_in_an_eddy.py            # or with a file for the picture, and a number of members

Ten thousand gliders dive to 90 m and climb again, on their way to the north along a shoal. An eddy carries them off their
course: where it is, how strong it is, and how the gliders are trimmed vary by member. Those that meet the floor stay there.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

import lgvi_warp as lw
from lgvi_warp.distributions import Choice, Normal, Uniform

HOURS = 3.0
# Nodes of chart and current along north and east [m].
NORTH, EAST = np.arange(-500.0, 6501.0, 100.0), np.arange(-2000.0, 4001.0, 100.0)
STRENGTHS = np.linspace(0.05, 0.30, 11)


def shoal():
    """A floor at 140 m with a ridge to the east, whose top is 45 m deep, and a hill on it."""
    north, east = np.meshgrid(NORTH, EAST, indexing="ij")
    ridge = 95.0 * np.exp(-(((east - 1500.0) / 700.0) ** 2)) * (0.75 + 0.25 * np.cos((north - 3800.0) / 600.0))
    return lw.events.Floor(depth=140.0 - ridge, origin=[NORTH[0], EAST[0]], spacing=[100.0, 100.0])


def eddy():
    """Swirls of eleven strengths, fastest 1.5 km from the middle, weaker with depth: scenarios of one field."""
    north, east, depth = np.meshgrid(NORTH, EAST, np.arange(0.0, 161.0, 40.0), indexing="ij")
    x, y = (north - 4600.0) / 1500.0, (east - 200.0) / 1500.0
    swirl = np.exp(0.5 * (1.0 - x**2 - y**2)) * np.exp(-depth / 150.0)
    velocities = np.stack([y * swirl, -x * swirl, 0.0 * swirl], axis=-1) * STRENGTHS[:, None, None, None, None]
    return lw.terms.CurrentField(velocities=velocities, origin=[NORTH[0], EAST[0], 0.0], spacing=[100.0, 100.0, 40.0])


def survey(members):
    """The scene, and what is not known of it."""
    engine = lw.terms.BuoyancyEngine(
        pump_rate=1e-5, volume_down=-3e-4, volume_up=3e-4, depth_top=10.0, depth_bottom=90.0, position=[0.73, 0.0, 0.0]
    )
    scene = lw.Scene.named("seawing", terms=[engine, eddy()], events=[shoal()], start={"position": [0.0, 0.0, 12.0]})
    return lw.Ensemble(scene, members, 1, {
        "current_field.scenario": Choice(list(range(len(STRENGTHS)))),
        "current_field.origin[1]": Normal(std=400.0),
        "buoyancy_engine.volume_down": Uniform(-3.3e-4, -2.7e-4),
        "start.rotation_vector": Normal(std=[0.0, 0.0, 0.1]),
    })  # fmt: skip


def draw(result, floor, field):
    """The survey from above, members from the side, and how probable the floor is by each time."""
    figure = plt.figure(figsize=(11.0, 5.4), layout="constrained")
    axes = figure.subplot_mosaic(
        [["plan", "side"], ["plan", "risk"]], width_ratios=(1.0, 1.15), height_ratios=(1.5, 1.0)
    )
    stranded, others = (
        np.flatnonzero(each) for each in (result.status == lw.Status.FLOOR, result.status == lw.Status.OK)
    )
    from_above(axes["plan"], result, floor, field, others[:150], stranded)
    for i, color, label in ((others[0], "0.2", "passes"), (stranded[0], "C1", "ends on the floor")):
        track = result.position[:, i]
        axes["side"].plot(track[:, 0] / 1e3, track[:, 2], color=color, linewidth=0.9, label=label)
        below = [floor.depth_at(*place) for place in track[:, :2]]
        axes["side"].plot(track[:, 0] / 1e3, below, color=color, linestyle="--")
    axes["side"].legend(loc="lower left", ncols=2)
    axes["side"].set(xlabel="north [km]", ylabel="depth; dashed: the floor [m]", ylim=(175.0, 0.0))
    risk, hours = result.statistics["outcome floor"], result.time / 3600.0
    low, high = risk.lower, risk.upper
    axes["risk"].fill_between(hours, 100.0 * low.ravel(), 100.0 * high.ravel(), color="C1", alpha=0.4)
    axes["risk"].plot(hours, 100.0 * risk.value.ravel(), color="C1")
    axes["risk"].set(xlabel="time [h]", ylabel="on the floor [%]", ylim=(0.0, None))
    return figure


def from_above(plan, result, floor, field, others, stranded):
    """Floor, current, tracks, and where members end on the floor."""
    filled = plan.contourf(EAST / 1e3, NORTH / 1e3, floor.depth, levels=np.arange(40.0, 151.0, 10.0), cmap="Blues")
    plan.figure.colorbar(filled, ax=plan, label="depth of the floor [m]")
    u = field.velocities[len(STRENGTHS) // 2, 0, ::4, ::4, 0]
    plan.quiver(EAST[::4] / 1e3, NORTH[::4] / 1e3, u[..., 1], u[..., 0], color="0.25", scale=2.5, width=0.004)
    kilometres = result.position / 1e3
    plan.plot(kilometres[:, others, 1], kilometres[:, others, 0], color="k", linewidth=0.4, alpha=0.35)
    plan.plot(kilometres[:, stranded[:25], 1], kilometres[:, stranded[:25], 0], color="C1", linewidth=0.6)
    plan.plot(kilometres[-1, stranded, 1], kilometres[-1, stranded, 0], "C3.", markersize=1.5)
    plan.set(xlabel="east [km]", ylabel="north [km]", xlim=(-1.6, 2.4), ylim=(-0.3, 5.6), aspect="equal")


def main(picture="glider_in_an_eddy.png", members="10000"):
    """Run the survey, print how probable the floor is, and draw it."""
    save, t1 = lw.SaveAt(every=30.0), 3600.0 * HOURS
    result = lw.solve(survey(int(members)), "rk4", h=0.5, t1=t1, save=save, statistics=[lw.statistics.Outcome("floor")])
    risk = result.statistics["outcome floor"]
    low, high = (100.0 * float(end[-1]) for end in (risk.lower, risk.upper))
    found = f"{100.0 * float(risk.value[-1]):.2f} % end on the floor ({low:.2f} to {high:.2f} %)"
    print(f"{int(members):,} gliders, {HOURS:g} hours: {found}")
    figure = draw(result, shoal(), eddy())
    figure.suptitle(f"{int(members):,} gliders through an eddy beside a shoal, {HOURS:g} hours: {found}")
    figure.savefig(picture, dpi=110)
    print(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
