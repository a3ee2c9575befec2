# SPDX-License-Identifier: Apache-2.0
"""Free decay in roll and pitch of a REMUS 100 at rest, beside another program and the period of small swings."""

from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "REMUS 100: free decay in roll and pitch"
AGAINST = "published code"
KNOWN = "numbers printed in a README, to the last digit; no measurement"
PICTURE = "Roll and pitch of a REMUS 100 that was let go at 10 degrees, as computed and as published"
HEADLINE = "period of roll"
AXES = ("roll", "pitch")
SCENES = tuple(f"examples/validation/remus_100_decay_{axis}.toml" for axis in AXES)
# Turning points on the other side, one a period.
ROLLS = (8.9, 7.3, 6.1, 5.3)
PITCH = 1.3
PERIODS = {"roll": (1.2778, 1.2768), "pitch": (7.469, 7.460)}


def measured() -> Content:
    """Run both scenes and take turning points and periods."""
    rows, curves = [], {}
    for axis, path in zip(AXES, SCENES, strict=True):
        result = lw.solve(lw.Scene.load(ROOT / path))
        R, t = result.attitude[:, 0], result.time
        angle = np.degrees(np.arctan2(R[:, 2, 1], R[:, 2, 2]) if axis == "roll" else np.arcsin(-R[:, 2, 0]))
        crossings = np.flatnonzero(angle[:-1] * angle[1:] < 0.0)
        zeros = t[crossings] - angle[crossings] * np.diff(t)[crossings] / np.diff(angle)[crossings]
        lows = [angle[a:b].min() for a, b in zip(crossings[::2], [*crossings[1::2], len(t)], strict=False)]
        # The last whole swings that both have: the largest swings take longest.
        period = np.diff(zeros[::2])[-1] if axis == "pitch" else np.diff(zeros[::2])[:4].mean()
        published, small = PERIODS[axis]
        rows.append(Row(f"period of {axis}", "s", published, None, period))
        rows.append(Row(f"period of small swings in {axis}", "s", small, 0.0005, _small(axis)))
        if axis == "roll":
            names = ("first", "second", "third", "fourth")
            rows += [
                Row(f"{name} swing of roll", "deg", read, 0.05, -low)
                for name, read, low in zip(names, ROLLS, lows, strict=False)
            ]
        else:
            rows.append(Row("first swing of pitch", "deg", PITCH, 0.05, -lows[0]))
        curves[axis] = curve(t, angle, 1000)
    return Content(rows, curves)


def _small(axis: str) -> float:
    """Period 2 pi / omega [s] of small swings about rest, from the scene's inertia with its coupling to free axes."""
    vehicle = lw.Scene.load(ROOT / SCENES[0]).vehicle
    M = np.asarray(vehicle.rigid_body_mass_matrix) + vehicle.added_mass_matrix
    own, rest = (3, [0, 1, 2, 4, 5]) if axis == "roll" else (4, [0, 1, 2, 3, 5])
    # Only the lever of the weight pulls back: the rest of the inertia matrix is taken out.
    inertia = M[own, own] - M[own, rest] @ np.linalg.solve(M[np.ix_(rest, rest)], M[rest, own])
    return float(2.0 * np.pi * np.sqrt(inertia / (0.0196 * 299.0)))


def draw(content: Content, figure: Any) -> None:
    """Both angles over time, and the published turning points at the computed times."""
    rows = {row.what: row for row in content.rows}
    for axes, axis in zip(figure.subplots(1, 2), AXES, strict=True):
        t, angle = (np.array(values) for values in content.curves[axis])
        axes.plot(t, angle, color=COMPUTED, label="computed")
        published = [row.published for what, row in rows.items() if what.endswith(f"swing of {axis}")]
        lows = np.flatnonzero((angle[1:-1] < angle[:-2]) & (angle[1:-1] <= angle[2:])) + 1
        axes.plot(t[lows][: len(published)], np.negative(published), "o", color=PUBLISHED, label="published swings")
        axes.set(xlabel="time [s]", ylabel=f"{axis} [deg]", xlim=(0.0, 6.5 if axis == "roll" else 20.0))
        axes.legend(loc="upper right")
