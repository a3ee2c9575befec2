# SPDX-License-Identifier: Apache-2.0
"""Rudder steps of a REMUS 100: Prestero (2001), his simulation as read from figures, and his sea trials."""

from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "REMUS 100: rudder steps"
AGAINST = "experiment at sea"
KNOWN = "readings of a thesis' figures by others, to half a step"
PICTURE = "Yaw rate and path of a REMUS 100 in two rudder steps, as computed and as published"
HEADLINE = "mean yaw rate, 25 to 38 s"
SCENES = ("examples/validation/remus_100_turn.toml",)


def measured() -> Content:
    """Run the scene and take the numbers for which a published number exists."""
    result = lw.solve(lw.Scene.load(ROOT / SCENES[0]))
    t, (north, east, _) = result.time, result.position[:, 0].T
    yaw = np.degrees(result.angular_velocity[:, 0, 2])
    surge, sway = result.velocity[:, 0, 0], result.velocity[:, 0, 1]
    pitch = np.degrees(np.arcsin(-result.attitude[:, 0, 2, 0]))
    port, starboard = (t >= 25.0) & (t <= 38.0), (t >= 50.0) & (t <= 68.0)
    turning = (t >= 14.0) & (t <= 40.0)
    rises = t[1:][(pitch[:-1] < 0.0) & (pitch[1:] >= 0.0)]
    rows = [
        Row("yaw rate at 14 s", "deg/s", -9.5, 0.25, yaw[np.isclose(t, 14.0)][0]),
        Row(HEADLINE, "deg/s", -9.0, 0.25, yaw[port].mean()),
        Row("mean yaw rate, 50 to 68 s", "deg/s", 9.3, 0.25, yaw[starboard].mean()),
        Row("surge in the first turn", "m/s", 1.39, 0.01, surge[port].mean()),
        Row("sway, rudder +4 degrees", "m/s", 0.07, 0.01, sway[port].mean()),
        Row("sway, rudder -4 degrees", "m/s", -0.04, 0.01, sway[starboard].mean()),
        Row("farthest north", "m", 31.0, 1.0, north.max()),
        Row("farthest south", "m", -3.0, 1.0, north.min()),
        Row("farthest west", "m", -18.0, 1.0, east.min()),
        Row("farthest east", "m", 3.0, 1.0, east.max()),
        Row("half the range of pitch", "deg", 10.0, 1.0, 0.5 * np.ptp(pitch[turning])),
        Row("period of pitch", "s", 12.0, 2.0, np.diff(rises).mean()),
        Row("at sea: yaw rate at about 4 degrees", "deg/s", 10.0, None, abs(yaw[port].mean())),
    ]
    return Content(rows, {"yaw rate": curve(t, yaw), "path": curve(east, north)})


def draw(content: Content, figure: Any) -> None:
    """Draw the yaw rate over time, and the path from above with the published extremes."""
    rows = {row.what: row for row in content.rows}
    rates, above = figure.subplots(1, 2, gridspec_kw={"width_ratios": (1.6, 1.0)})
    rates.plot(*content.curves["yaw rate"], color=COMPUTED, label="computed")
    for what, since, until in (
        ("yaw rate at 14 s", 14.0, 14.0),
        (HEADLINE, 25.0, 38.0),
        ("mean yaw rate, 50 to 68 s", 50.0, 68.0),
    ):
        row = rows[what]
        look: dict[str, Any] = {"color": PUBLISHED, "linewidth": 2.5}
        rates.errorbar(0.5 * (since + until), row.published, row.within, 0.5 * (until - since), **look, capsize=4)
    sea = rows["at sea: yaw rate at about 4 degrees"].published
    for side in (-1.0, 1.0):
        rates.axhline(side * sea, color="0.4", linestyle=":", label="at sea, about" if side < 0.0 else None)
    rates.plot([], [], color=PUBLISHED, linewidth=2.5, label="Prestero's simulation, figs. 8-1, 8-2")
    rates.set(xlabel="time [s]", ylabel="yaw rate [deg/s]", ylim=(-12.5, 17.0))
    rates.legend(loc="upper left")
    above.plot(*content.curves["path"], color=COMPUTED)
    south, north, west, east = (rows[f"farthest {side}"].published for side in ("south", "north", "west", "east"))
    above.plot([west, east, east, west, west], [south, south, north, north, south], "--", color=PUBLISHED)
    above.set(xlabel="east [m]", ylabel="north [m]", aspect="equal", title="path; dashed: extent, fig. 8-1")
