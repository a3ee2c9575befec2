# SPDX-License-Identifier: Apache-2.0
"""Steps of a REMUS 100's stern planes: Prestero (2001), his simulation as read from figures, and his sea trials."""

from typing import Any

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "REMUS 100: steps of the stern planes"
AGAINST = "experiment at sea"
KNOWN = "readings of a thesis' figures by others, to half a step; one coefficient is doubtful"
PICTURE = "Pitch of a REMUS 100 after steps of its stern planes, as computed and as published"
HEADLINE = "up: pitch at 3.8 s"
WAYS = ("up", "down")
SCENES = tuple(f"examples/validation/remus_100_pitch_{way}.toml" for way in WAYS)
AT = (1.0, 2.0, 3.0, 3.8)
PITCH = {"up": (1.0, 6.0, 15.5, 24.5), "down": (-2.3, -12.0, -26.0, -36.5)}
RATE = {"up": (2.7, 6.8, 11.0, 11.0), "down": (-6.6, -11.8, -13.7, -11.5)}
# At 3.8 s: change of depth, surge, heave, yaw rate.
LAST = {"up": (-0.47, 1.43, 0.17, 4.5), "down": (0.55, 1.19, -0.20, -6.2)}
# M_qq of 10 times his strip theory, as his N_rr is, in place of 20 times [kg m2].
LESS = 94.0
# Changes of depth and pitch.
SEA = {"up": (-0.5, 20.0), "down": (0.4, -18.0)}


def measured() -> Content:
    """Run both scenes and take the numbers for which a published number exists."""
    rows, curves = [], {}
    for way, path in zip(WAYS, SCENES, strict=True):
        result = lw.solve(lw.Scene.load(ROOT / path))
        t, depth = result.time, result.position[:, 0, 2]
        pitch = np.degrees(np.arcsin(-result.attitude[:, 0, 2, 0]))
        rate, turn = np.degrees(result.angular_velocity[:, 0, 1]), np.degrees(result.angular_velocity[:, 0, 2])
        when = [int(np.argmin(np.abs(t - at))) for at in AT]
        last = when[-1]
        for at, i, read in zip(AT, when, PITCH[way], strict=True):
            rows.append(Row(f"{way}: pitch at {at:g} s", "deg", read, 0.25, pitch[i]))
        for at, i, read in zip(AT, when, RATE[way], strict=True):
            rows.append(Row(f"{way}: pitch rate at {at:g} s", "deg/s", read, 0.1, rate[i]))
        found = (depth[last] - depth[0], *result.velocity[last, 0, ::2], turn[last])
        names = (
            ("change of depth", "m", 0.01),
            ("surge", "m/s", 0.01),
            ("heave", "m/s", 0.01),
            ("yaw rate", "deg/s", 0.1),
        )
        for (name, unit, within), read, value in zip(names, LAST[way], found, strict=True):
            rows.append(Row(f"{way}: {name} at 3.8 s", unit, read, within, value))
        for name, unit, read, value in zip(
            ("depth", "pitch"), ("m", "deg"), SEA[way], (found[0], pitch[last] - pitch[0]), strict=True
        ):
            rows.append(Row(f"{way}, at sea: change of {name}", unit, read, None, value))
        curves[way] = curve(t, pitch)
        less = lw.solve(lw.Scene.load(ROOT / path).with_numbers({"drag_matrix.quadratic[4,4]": LESS}))
        pitch = np.degrees(np.arcsin(-less.attitude[:, 0, 2, 0]))
        rows.append(Row(f"{way}, M_qq = -{LESS:g}: pitch at 3.8 s", "deg", PITCH[way][-1], 0.25, pitch[last]))
        curves[f"{way}, less"] = curve(t, pitch)
    return Content(rows, curves)


def draw(content: Content, figure: Any) -> None:
    """Pitch over time, up and down."""
    rows = {row.what: row for row in content.rows}
    for axes, way, planes in zip(figure.subplots(1, 2), WAYS, ("-4", "+8"), strict=True):
        axes.plot(*content.curves[way], color=COMPUTED, label="computed")
        axes.plot(*content.curves[f"{way}, less"], "--", color=COMPUTED, label=f"computed, M_qq = -{LESS:g}")
        read = [rows[f"{way}: pitch at {at:g} s"].published for at in AT]
        axes.plot(AT, read, "o", color=PUBLISHED, label="Prestero's simulation, figs. 8-7, 8-12")
        axes.axhline(
            rows[f"{way}, at sea: change of pitch"].published, color="0.4", linestyle=":", label="at sea, about"
        )
        axes.axvline(2.0, color="0.8", zorder=0)
        axes.set(title=f"Stern planes {planes} degrees after 2 s", xlabel="time [s]", ylabel="pitch [deg]")
        axes.legend(loc="upper left" if way == "up" else "lower left")
