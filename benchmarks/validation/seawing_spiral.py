# SPDX-License-Identifier: Apache-2.0
"""The steady spiral of the glider Seawing: Zhang et al. (2013), as their recursion gives it."""

from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "Seawing: a steady spiral"
AGAINST = "published computation"
KNOWN = "numbers and coefficients in a transcript of the article, to the last digit"
PICTURE = "Angles and speed of the glider Seawing over time, and the published steady spiral"
HEADLINE = "speed"
SCENES = ("examples/validation/seawing_spiral.toml",)
# What, unit, published, half of its last digit.
SPIRAL = (
    ("roll", "deg", -13.703, 0.0005),
    ("pitch", "deg", -35.641, 0.0005),
    ("rate of turn", "rad/s", 0.0039, 0.00005),
    ("angle of attack", "deg", 1.267, 0.0005),
    ("sideslip", "deg", -1.283, 0.0005),
    ("speed", "m/s", 0.490, 0.0005),
)


def measured() -> Content:
    """Run the scene until it is steady."""
    result = lw.solve(lw.Scene.load(ROOT / SCENES[0]))
    (u, v, w), R, t = result.velocity[:, 0].T, result.attitude[:, 0], result.time
    speed = np.sqrt(u * u + v * v + w * w)
    found = {
        "roll": np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2])),
        "pitch": np.degrees(-np.arcsin(R[:, 2, 0])),
        "rate of turn": np.einsum("ki,ki->k", R[:, 2], result.angular_velocity[:, 0]),
        "angle of attack": np.degrees(np.arctan2(w, u)),
        "sideslip": np.degrees(np.arcsin(v / speed)),
        "speed": speed,
    }
    rows = [Row(what, unit, value, within, found[what][-1]) for what, unit, value, within in SPIRAL]
    north, east, _ = result.position[:, 0].T
    return Content(
        rows, {key: curve(t, found[key]) for key in ("roll", "pitch", "speed")} | {"path": curve(east, north)}
    )


def draw(content: Content, figure: Any) -> None:
    """Roll and pitch, speed, and the path from above with the published radius."""
    rows = {row.what: row for row in content.rows}
    angles, speed, above = figure.subplots(1, 3)
    for name, style in (("roll", "--"), ("pitch", "-")):
        angles.plot(*content.curves[name], style, color=COMPUTED, label=f"{name}, computed")
        angles.axhline(rows[name].published, color=PUBLISHED, linewidth=1.0)
    angles.plot([], [], color=PUBLISHED, linewidth=1.0, label="published")
    angles.set(xlabel="time [s]", ylabel="angle [deg]", xlim=(0.0, 600.0))
    angles.legend(loc="center right")
    speed.plot(*content.curves["speed"], color=COMPUTED, label="computed")
    speed.axhline(rows["speed"].published, color=PUBLISHED, linewidth=1.0, label="published")
    speed.set(xlabel="time [s]", ylabel="speed [m/s]", xlim=(0.0, 600.0))
    speed.legend(loc="lower right")
    east, north = (np.array(values) for values in content.curves["path"])
    above.plot(east, north, color=COMPUTED)
    steady = slice(len(east) // 4, None)
    radius = rows["speed"].published * np.cos(np.radians(rows["pitch"].published - rows["angle of attack"].published))
    radius /= rows["rate of turn"].published
    middle = [0.5 * (x[steady].min() + x[steady].max()) for x in (east, north)]
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    above.plot(middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle), color=PUBLISHED, linewidth=1.0)
    above.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
