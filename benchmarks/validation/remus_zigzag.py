# SPDX-License-Identifier: Apache-2.0
"""A zigzag of the REMUS 100 of T. I. Fossen's Python Vehicle Simulator: its equations, and its own step."""

from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks import foreign_remus as remus
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "REMUS of Python Vehicle Simulator: a zigzag"
AGAINST = "published code"
KNOWN = "equations of a public program; no measurement"
PICTURE = "Path and heading of a REMUS in a zigzag, by this package and by the equations of another simulator"
HEADLINE = "its equations: largest distance of the paths"
# The largest distance is a part of this length.
OF, OF_WORDS = "its equations: length of the path", "the path"
SCENES = ("examples/validation/remus_zigzag.toml",)
ANGLE, FIRST, EVERY, SPEED = np.radians(10.0), 5.0, 6.0, 2.0  # rad, s, s, m/s


def rudder(t: float) -> float:
    """Commanded rudder angle [rad], which alternates from the first time on."""
    turns = int(np.floor((t - FIRST) / EVERY + 1e-9)) + 1
    return 0.0 if turns <= 0 else ANGLE * (1.0 if turns % 2 else -1.0)


def other(method: str, times: Any, parts: int) -> tuple[Any, Any, Any]:
    """Positions (k, 3) [m], angles (k, 3) [rad] and twists (k, 6) of the other simulator's equations at sampled times.

    method: "euler", its own method; or "rk4", with the exact lag of the rudder. parts: steps per 0.02 s.
    """
    step = {"euler": remus.euler_step, "rk4": remus.rk4_step}[method]
    state = [
        np.zeros(3),
        np.zeros(3),
        np.array([SPEED, 0.0, 0.0, 0.0, 0.0, 0.0]),
        np.array([0.0, 0.0, remus.REVOLUTIONS]),
    ]
    h, kept = remus.SAMPLE / parts, []
    per = round((times[1] - times[0]) / h)
    for i in range(per * (len(times) - 1) + 1):
        if i % per == 0:
            kept.append([np.array(part) for part in state[:3]])
        commands = np.array([rudder(i * h), 0.0, remus.REVOLUTIONS])
        state = step(state, commands, remus.Sea(), True, h)
    return tuple(np.array(part) for part in zip(*kept, strict=True))


def measured() -> Content:
    """Run the scene, and the other simulator's equations by rk4 and by its own step."""
    result = lw.solve(lw.Scene.load(ROOT / SCENES[0]))
    t, place, R = result.time, result.position[:, 0], result.attitude[:, 0]
    heading = np.degrees(np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0])))
    yaw, surge = np.degrees(result.angular_velocity[:, 0, 2]), result.velocity[:, 0, 0]
    late = t > 20.0
    rows, curves = [], {"path": curve(place[:, 1], place[:, 0]), "heading": curve(t, heading)}
    length = np.linalg.norm(np.diff(place, axis=0), axis=1).sum()
    for words, method in (("its equations", "rk4"), ("its own step", "euler")):
        positions, angles, twists = other(method, t, 1)
        there = np.degrees(angles[:, 2])
        apart = np.linalg.norm(place - positions, axis=1).max()
        whole = np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()
        rows += [
            Row(f"{words}: length of the path", "m", whole, None, length),
            Row(f"{words}: largest distance of the paths", "m", 0.0, None, apart),
            Row(
                f"{words}: half the range of heading",
                "deg",
                0.5 * np.ptp(there[late]),
                None,
                0.5 * np.ptp(heading[late]),
            ),
            Row(f"{words}: largest yaw rate", "deg/s", np.degrees(np.abs(twists[:, 5]).max()), None, np.abs(yaw).max()),
            Row(f"{words}: mean surge after 20 s", "m/s", twists[late, 0].mean(), None, surge[late].mean()),
        ]
        curves[f"path, {method}"] = curve(positions[:, 1], positions[:, 0], 100)
        curves[f"heading, {method}"] = curve(t, there, 100)
    return Content(rows, curves)


def draw(content: Content, figure: Any) -> None:
    """Path from above, and heading."""
    above, headings = figure.subplots(2, 1)
    for axes, name in ((above, "path"), (headings, "heading")):
        x, y = content.curves[name]
        axes.plot(*((y, x) if name == "path" else (x, y)), color=COMPUTED, label="this package")
        for method, mark, words in (("rk4", ".", "its equations, rk4"), ("euler", "x", "its own step")):
            x, y = content.curves[f"{name}, {method}"]
            color = PUBLISHED if method == "rk4" else "0.4"
            axes.plot(*((y, x) if name == "path" else (x, y)), mark, color=color, markersize=4, label=words)
    above.set(xlabel="north [m]", ylabel="east [m]")
    headings.set(xlabel="time [s]", ylabel="heading [deg]")
    above.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
