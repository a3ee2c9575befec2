# SPDX-License-Identifier: Apache-2.0
"""Orbits and drift of a neutral sphere under waves: linear theory, Stokes (1847), and the path of the water by SciPy."""

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from benchmarks.pages import ROOT
from benchmarks.validated import COMPUTED, PUBLISHED, Content, Row, curve

TITLE = "Orbits and drift in waves"
AGAINST = "theory"
KNOWN = "first term of a series: parts of (k a)^2 are left out"
PICTURE = "Orbits of a neutral sphere under waves at four depths, and their drift by depth"
HEADLINE = "drift at 5 m"
SCENES = ("examples/validation/wave_orbits.toml",)
DEPTHS = (2.0, 5.0, 10.0, 20.0)  # m, of the middle of the orbit


def measured() -> Content:
    """Run the sphere at four depths, from the top of its orbit under a crest."""
    scene = lw.Scene.load(ROOT / SCENES[0])
    (waves,) = scene.terms
    amplitude, omega = float(waves.amplitudes[0]), 2.0 * np.pi / float(waves.periods[0])
    k, n = omega**2 / scene.environment.gravity, len(DEPTHS)
    radii = amplitude * np.exp(-k * np.array(DEPTHS))
    tops = np.array(DEPTHS) - radii
    position, velocity = np.zeros((n, 3)), np.zeros((n, 3))
    position[:, 2], velocity[:, 0] = tops, amplitude * omega * np.exp(-k * tops)
    fleet = lw.Ensemble.from_states(scene, position, np.tile(np.eye(3), (n, 1, 1)), velocity, np.zeros((n, 3)))
    run = scene.run
    result = lw.solve(fleet, run.method, h=run.step, t1=run.duration, save=lw.SaveAt(every=run.save_every))
    t, north, depth = result.time, result.position[:, :, 0], result.position[:, :, 2]

    def flow(s: float, y: Any) -> Any:
        size, phase = amplitude * omega * np.exp(-k * y[1]), k * y[0] - omega * s
        return size * np.cos(phase), -size * np.sin(phase)

    rows, curves = [], {}
    for i, (mean, radius) in enumerate(zip(DEPTHS, radii, strict=True)):
        # What passes a particle that drifts is a wave of a slightly longer period: a whole number of its orbits is counted.
        level = depth[:, i] - 0.5 * (depth[:, i].min() + depth[:, i].max())
        first, last = np.flatnonzero((level[:-1] < 0.0) & (level[1:] >= 0.0))[[0, -1]]
        (t0, x0), (t1, x1) = (_crossed(level, t, north[:, i], at) for at in (first, last))
        drift = (x1 - x0) / (t1 - t0)
        rest = north[:, i] - drift * t
        water = solve_ivp(flow, (0.0, t[-1]), (0.0, tops[i]), "DOP853", t_eval=t, rtol=1e-12, atol=1e-12).y
        apart = np.hypot(north[:, i] - water[0], depth[:, i] - water[1]).max()
        half = slice(first, last)
        rows += [
            Row(f"radius at {mean:g} m, down", "m", radius, None, 0.5 * np.ptp(depth[half, i])),
            Row(f"radius at {mean:g} m, along", "m", radius, None, 0.5 * np.ptp(rest[half])),
            Row(f"drift at {mean:g} m", "m/s", amplitude**2 * omega * k * np.exp(-2.0 * k * mean), None, drift),
            Row(f"largest distance from the water's path at {mean:g} m", "m", 0.0, None, apart),
        ]
        curves[f"{mean:g}"] = curve(north[:, i], depth[:, i], 500)
    return Content(rows, curves)


def _crossed(level: Any, t: Any, x: Any, at: int) -> tuple[float, float]:
    """Time and place at which a level crosses 0 between two samples."""
    part = level[at] / (level[at] - level[at + 1])
    return t[at] + part * (t[at + 1] - t[at]), x[at] + part * (x[at + 1] - x[at])


def draw(content: Content, figure: Any) -> None:
    """The orbits, and the drift by depth."""
    rows = {row.what: row for row in content.rows}
    panels = figure.subplot_mosaic([["near", "drift"], ["far", "drift"]], width_ratios=(1.6, 1.0))
    near, far, drift = (panels[name] for name in ("near", "far", "drift"))
    angle = np.linspace(0.0, 2.0 * np.pi, 100)
    for axes, depth in ((near, 2.0), (far, 5.0)):
        axes.plot(*content.curves[f"{depth:g}"], color=COMPUTED, linewidth=0.9, label="computed, 20 periods")
        radius = rows[f"radius at {depth:g} m, down"].published
        axes.plot(
            radius * np.sin(angle),
            depth - radius * np.cos(angle),
            color=PUBLISHED,
            linewidth=2.0,
            label="linear theory",
        )
        axes.set(ylabel="depth [m]", aspect="equal", ylim=(depth + 0.45, depth - 0.45), xlim=(-0.5, 3.1))
    far.set(xlabel="along the waves [m]")
    far.legend(loc="lower right")
    fine = np.linspace(0.5, 22.0, 100)
    k, top = (2.0 * np.pi / 5.0) ** 2 / 9.81, rows["drift at 5 m"].published
    drift.semilogx(top * np.exp(-2.0 * k * (fine - 5.0)), fine, color=PUBLISHED, label="Stokes (1847)")
    drift.semilogx(
        [rows[f"drift at {depth:g} m"].computed for depth in DEPTHS], DEPTHS, "o", color=COMPUTED, label="computed"
    )
    drift.set(xlabel="drift [m/s]", ylabel="depth [m]", ylim=(22.5, 0.0))
    drift.legend(loc="lower right")
