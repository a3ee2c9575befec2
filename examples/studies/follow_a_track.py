# SPDX-License-Identifier: Apache-2.0
"""2,000 members follow a recorded REMUS 100 and learn the current from fixes, depths and a Doppler log.

    python examples/studies/follow_a_track.py

The recording is a run with a current of its own, by another method and step, and with errors of the instruments. A picture
shows the track, and what is known of the current from fix to fix.
"""

import matplotlib.pyplot as plt
import numpy as np

import lgvi_warp as lw

TRUTH = [0.18, -0.25, 0.0]  # m/s, north, east, down


def scene(current):
    """The vehicle with its propeller, rudder a little to one side, in a current."""
    named = lw.Scene.named("remus_100")
    start = lw.Start([0.0, 0.0, 5.0], velocity=[1.5, 0.0, 0.0])
    terms = [*named.terms, lw.terms.Current(velocity=current)]
    return lw.Scene(named.vehicle, named.environment, terms, start).with_numbers({"vehicle.buoyancy": 299.0})


def recording(t1=60.0):
    """Fixes every 10 s, depth every second, velocity over ground every 2 s, each with its error."""
    track = lw.solve(scene(TRUTH), "rk8", h=0.01, t1=t1, save=lw.SaveAt(every=1.0))
    rng = np.random.default_rng(1)

    def series(of, values, every, std):
        rows = slice(every, None, every)
        noisy = values[rows, 0] + std * rng.normal(size=values[rows, 0].shape)
        return lw.studies.Series(of, track.time[rows], noisy, std)

    depth = series("depth", track.depth, 1, 0.05)
    fixes = series("position", track.position, 10, 1.0)
    return track, [fixes, depth, series("velocity", track.velocity, 2, 0.02)]


def main():
    """Follow, print what was learned, and draw it."""
    track, instruments = recording()
    vary = {
        "start.position": lw.distributions.Normal(std=[2.0, 2.0, 0.2]),
        "start.velocity": lw.distributions.Normal(std=[0.2, 0.05, 0.05]),
        "current.velocity": lw.distributions.Normal(std=[0.3, 0.3, 0.0]),
    }
    fleet = lw.Ensemble(scene([0.0, 0.0, 0.0]), members=2000, seed=1, vary=vary)
    learn = ["current.velocity[0]", "current.velocity[1]"]
    followed = lw.assimilate(fleet, instruments, learn, method="rk4", h=0.05)
    print(followed)
    figure, (map_, right) = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained")
    map_.plot(track.position[:, 0, 1], track.position[:, 0, 0], "k", label="recorded vehicle")
    map_.plot(*followed.mean["position"][:, 1::-1].T, "C0.", label="mean of the members")
    map_.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
    map_.legend()
    for name, axis, truth, color in zip(learn, ("north", "east"), TRUTH, ("C1", "C2"), strict=False):
        mean, std = followed.mean[name], followed.std[name]
        right.fill_between(followed.time, mean - 2.0 * std, mean + 2.0 * std, color=color, alpha=0.3)
        right.plot(followed.time, mean, color, label=f"current {axis}, 2 sd")
        right.axhline(truth, color=color, linestyle=":")
    right.set(xlabel="time [s]", ylabel="current [m/s]")
    right.legend()
    figure.savefig("follow_a_track.png")


if __name__ == "__main__":
    main()
