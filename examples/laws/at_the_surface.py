# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 afloat in head seas, its propeller stopped: how far it heaves and pitches in waves of each period."""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

MEMBERS, AMPLITUDE = 200, 0.02  # m

# Half of the length ahead of the centre of buoyancy is the nose of 0.19 m, half a body that ends in a tail of 0.54 m.
hull = lw.terms.SurfaceBuoyancy(stations=[-0.72, -0.18, 0.42, 0.52, 0.61], heights=[0.01, 0.191, 0.191, 0.16, 0.0])
waves = lw.terms.Waves(amplitudes=[AMPLITUDE], periods=[3.0], headings_deg=[180.0])
stopped = lw.terms.Wrench(force=[0.0, 0.0, 0.0])


def run():
    """Time [s], positions [m] and attitudes of members that differ by the period of their waves [s]."""
    scene = lw.Scene.named(
        "remus_100", vehicle={"buoyancy": 308.0}, terms=[hull, waves, stopped], start={"position": [0.0, 0.0, 0.07]}
    )
    vary = {"waves.periods[0]": lw.distributions.Uniform(low=1.0, high=6.0)}
    fleet = lw.Ensemble(scene, members=MEMBERS, seed=2, vary=vary)
    result = lw.solve(fleet, h=0.01, t1=120.0, save=lw.SaveAt(every=0.05, fields=("position", "attitude")))
    return result.time, result.position, result.attitude, result.parameters["waves.periods"][:, 0]


def amplitude(angle, values):
    """Amplitude of the part of some values that swings with an angle."""
    parts = np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=1)
    return np.hypot(*np.linalg.lstsq(parts, values, rcond=None)[0][:2])


def responses(time, position, attitude, periods):
    """Heave and its part of twice the frequency over the waves' amplitude, and pitch over the surface's slope, by member."""
    late = time > 60.0
    omega = 2.0 * np.pi / periods
    k = omega**2 / 9.81
    # The phase of the waves where the vehicle is, which drifts.
    angles = omega * time[late, None] + k * position[late, :, 0]
    pitch = -np.arcsin(attitude[late, :, 2, 0])
    heave, twice, swing = (
        np.array([amplitude(times * angles[:, i], values[:, i]) for i in range(len(k))])
        for times, values in ((1, position[late, :, 2]), (2, position[late, :, 2]), (1, pitch))
    )
    return heave / AMPLITUDE, twice / AMPLITUDE, swing / (AMPLITUDE * k)


def plot(periods, heave, pitch, path):
    """Both by the waves' period."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    axes = figure.subplots()
    order = np.argsort(periods)
    axes.plot(periods[order], heave[order], color="#0072B2", label="heave over the waves' amplitude")
    axes.plot(periods[order], pitch[order], "--", color="#D55E00", label="pitch over the slope of the surface")
    axes.axhline(1.0, color="0.6", linewidth=1.0)
    axes.set(
        xlabel="period of the waves [s]", ylabel="response", xlim=(1.0, 6.0), ylim=(0.0, None),
        title="Afloat, a REMUS 100 heaves with the waves, and pitches most where these have 3 s",
    )  # fmt: skip
    axes.legend()
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/at_the_surface.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    *path, periods = run()
    heave, twice, pitch = responses(*path, periods)
    for period in (1.0, 2.0, 3.38, 3.5, 4.0, 6.0):
        i = np.abs(periods - period).argmin()
        print(
            f"waves of {periods[i]:.1f} s: heave {heave[i]:.2f}, at twice their frequency {twice[i]:.2f}, pitch {pitch[i]:.2f}"
        )
    print(plot(periods, heave, pitch, target))
