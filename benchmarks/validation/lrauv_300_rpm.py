# SPDX-License-Identifier: Apache-2.0
"""The long-range AUV Tethys at 300 revolutions a minute: tests of its simulation in Gazebo, and the exact solution."""

from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "LRAUV Tethys: from rest at 300 rpm"
AGAINST = "published code"
KNOWN = 'speeds in the tests of osrf/lrauv, to their tolerances; the vehicle\'s own speed as "around 1 m/s"'
PICTURE = "Speed of the LRAUV Tethys from rest at 300 revolutions a minute, as computed, in closed form and in tests of Gazebo"
HEADLINE = "speed after 40 s of thrust"
SCENES = ("examples/validation/lrauv_300_rpm.toml",)
# Time of thrust [s], speed [m/s] and tolerance: test_state.cc after 5 x 400 steps of 0.02 s; test_hydrodynamics.cc after 45 s.
AFTER = {40.0: (1.0, 0.02), 45.0: (1.01, 0.1)}
# test_propeller_action.cc: the speed from step 1800 to 100 m, of which 100 steps have no thrust.
FROM, TO, SPEED, SPEED_TO = 0.02 * (1800 - 100), 100.0, 1.0, 0.06


class Exact:
    """Closed form of M u' = T - k u^2 from rest: u = c tanh(t / tau), c = sqrt(T / k), tau = M / (k c)."""

    def __init__(self, scene: lw.Scene):
        drag, thrusters = scene.terms
        thrust = float(np.ravel(thrusters.coefficient)[0] * np.ravel(thrusters.command)[0] ** 2)
        resistance = float(drag.quadratic[0])
        self.last = np.sqrt(thrust / resistance)
        self.time = float(scene.vehicle.mass_matrix[0, 0]) / (resistance * self.last)

    def speed(self, t: Any) -> Any:
        """Speed [m/s]."""
        return self.last * np.tanh(np.asarray(t) / self.time)

    def way(self, t: float) -> float:
        """Way from the start [m]."""
        return float(self.last * self.time * np.log(np.cosh(t / self.time)))


def measured() -> Content:
    """Run the scene, and take its speeds at the times of the tests."""
    scene = lw.Scene.load(ROOT / SCENES[0])
    exact, result = Exact(scene), lw.solve(scene)
    t, way, speed = result.time, result.position[:, 0, 0], result.velocity[:, 0, 0]
    rows = [Row(f"speed after {s:g} s of thrust", "m/s", *AFTER[s], np.interp(s, t, speed)) for s in AFTER]
    tested = speed[(t >= FROM) & (way <= TO)]
    rows += [
        Row(f"least speed from {FROM:g} s to {TO:g} m", "m/s", SPEED, SPEED_TO, tested.min()),
        Row(f"greatest speed from {FROM:g} s to {TO:g} m", "m/s", SPEED, SPEED_TO, tested.max()),
        Row("speed after 120 s; the vehicle's own is around 1 m/s", "m/s", SPEED, None, speed[-1]),
        Row("closed form: speed after 40 s", "m/s", float(exact.speed(40.0)), None, np.interp(40.0, t, speed)),
        Row("closed form: way after 40 s", "m", exact.way(40.0), None, np.interp(40.0, t, way)),
        Row("closed form: speed after 120 s", "m/s", float(exact.speed(120.0)), None, speed[-1]),
    ]
    span = curve([FROM, t[way <= TO][-1]], [SPEED, SPEED])
    return Content(rows, {"speed": curve(t, speed), "exact": curve(t, exact.speed(t), 41), "span": span})


def draw(content: Content, figure: Any) -> None:
    """Draw the speed over time, with the closed form and the tolerances of the tests."""
    axes = figure.subplots()
    axes.plot(*content.curves["speed"], color=COMPUTED, label="this package")
    axes.plot(*content.curves["exact"], ".", color="0.4", label="closed form")
    points = np.array([(s, *AFTER[s]) for s in AFTER]).T
    axes.errorbar(*points, fmt="o", color=PUBLISHED, capsize=4, label="tests of osrf/lrauv")
    low, high = SPEED - SPEED_TO, SPEED + SPEED_TO
    axes.fill_between(
        content.curves["span"][0], low, high, color=PUBLISHED, alpha=0.15, label="their range up to 100 m"
    )
    axes.set(xlabel="time of thrust [s]", ylabel="speed [m/s]", xlim=(0.0, 120.0), ylim=(0.0, 1.2))
    axes.legend(loc="lower right")
