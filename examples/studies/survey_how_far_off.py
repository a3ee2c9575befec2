# SPDX-License-Identifier: Apache-2.0
"""Navigation error of a LAUV after a survey: three legs of 2 km at 3 m altitude over a sloping floor, in a tide.

    python examples/studies/survey_how_far_off.py

It prints the probability that the navigation error is above 50 m at the end, the input that matters most, where the vehicle
ends, and time and energy of the mission. A picture shows some paths and where the vehicles are when they believe to be done.
"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

SPEED, ALTITUDE, LIMIT = 1.5, 3.0, 50.0  # m/s, m, m
POWER, HOTEL = 35.0, 20.0  # W of the propeller at this speed, and of all that is always on
# Legs to the north and back, 100 m apart: north, east, depth [m].
LEGS = [[0, 0, 17], [2000, 0, 17], [2000, 100, 17], [0, 100, 17], [0, 200, 17], [2000, 200, 17]]
SLOPE = dict(depth=[[20.0, 20.0], [30.0, 30.0]], spacing=[3000.0, 1200.0], origin=[-500.0, -500.0])  # m
TIDE = 0.25  # m/s, to the east
UNSURE = {
    "compass.bias": lw.distributions.Normal(std=np.radians(1.0)),
    "log.bias": lw.distributions.Normal(std=[0.01, 0.01, 0.0]),  # m/s, body axes
    "current_harmonics.amplitudes[0,1]": lw.distributions.Uniform(-TIDE, TIDE),
    "vehicle.buoyancy": lw.distributions.Normal(std=0.3),  # N
}


def scene():
    """The vehicle over its first waypoint, with dead reckoning by compass and log, over a floor that slopes to the north."""
    shared = lw.Scene.named("lauv")
    (screw,) = (term for term in shared.terms if term.key == "thrusters")
    # The thrust that balances the drag of 2.4 v + 2.4 v^2 at the speed of the survey.
    pace = np.sqrt(2.4 * (SPEED + SPEED**2) / float(screw.coefficient[0]))
    controller = lw.Controller(
        period=0.2,  # s between ticks
        sensors=[
            lw.control.Sensor(name="compass", of="heading"),
            lw.control.Sensor(name="log", of="velocity"),
            lw.control.Altimeter(),
            lw.control.DeadReckoning(depth="measured"),
        ],
        guidance=[
            lw.control.Waypoints(points=LEGS, speed=SPEED, look_ahead=20.0, radius=8.0, method="ilos", kappa=0.5),
            lw.control.Altitude(altitude=ALTITUDE),
        ],
        laws=[
            lw.control.DepthPID(kp=0.15, ki=0.002, pitch_limit=0.35, kp_pitch=2.0, ki_pitch=0.2, kd_pitch=1.5),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        # The gains are radians of a fin for each radian of error: rows two rudders, two stern planes, columns X Y Z K M N.
        allocation=[
            lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1]] * 2 + [[0, 0, 0, 0, -1, 0]] * 2)
        ],
    )
    tide = lw.terms.CurrentHarmonics(amplitudes=[[0.0, TIDE, 0.0]], periods=[44_714.0])
    driven = lw.terms.Thrusters(
        position=screw.position,
        direction=screw.direction,
        coefficient=screw.coefficient,
        command=[pace],
        power_commands=[0.0, pace],
        power=[0.0, POWER],
    )
    return lw.Scene.named(
        "lauv",
        terms=[driven, tide, lw.terms.EnergyUse(hotel=HOTEL)],
        events=[lw.events.Floor(**SLOPE), lw.events.MissionDone()],
        start={"position": [0.0, 0.0, 18.0], "velocity": [SPEED, 0.0, 0.0]},
        controller=controller,
    )


def plot(result, region, path):
    """Paths from above, the errors at the end, and where the vehicles are."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 6.0), layout="constrained")
    above, errors, ends = figure.subplots(1, 3, width_ratios=[1.0, 1.0, 2.2])
    for member in range(20):
        above.plot(result.position[:, member, 1], result.position[:, member, 0], color="#0072B2", linewidth=0.5)
    above.plot([leg[1] for leg in LEGS], [leg[0] for leg in LEGS], "k:", label="waypoints")
    above.set(xlabel="east [m]", ylabel="north [m]", title="20 paths")
    above.legend()
    size = np.sort(np.linalg.norm(result.samples["navigation_error"][-1], axis=-1))
    errors.semilogy(size, 1.0 - np.arange(len(size)) / len(size), color="#0072B2")
    errors.axvline(LIMIT, color="0.5", linestyle=":")
    errors.set(xlabel="navigation error at the end [m]", ylabel="probability of more", title="How far off")
    lw.plots.footprint(region, ax=ends)
    ends.set(title="Where the vehicles are at the end")
    figure.savefig(path, dpi=100)
    return path


def main(path, members):
    """Run the surveys, print the answers, and draw the picture."""
    error = "norm(navigation_error)"
    asked = [
        lw.statistics.Exceedance(error, above=LIMIT, name="too far"),
        lw.statistics.EndTime("mission_done", then=lw.statistics.Quantiles(levels=(0.05, 0.5, 0.95))),
        lw.statistics.Mean("energy_used", name="energy"),
    ]
    save = lw.SaveAt(every=20.0, fields=("position", "navigation_error", "energy_used"))
    fleet = lw.Ensemble(scene(), members, seed=1, vary=UNSURE)
    result = lw.solve(fleet, h=0.1, t1=5000.0, save=save, statistics=asked)
    print(result.status.counts())
    far, ends, energy = result.statistics.values()
    print(f"error above {LIMIT:g} m: {far.value[-1, 0]:.1%} ({far.lower[-1, 0]:.1%} to {far.upper[-1, 0]:.1%})")
    low, middle, high = ends.value[-1, :, 0]
    print(f"time: {middle:.0f} s, 90 % from {low:.0f} s to {high:.0f} s; energy: {energy.value[-1, 0] / 1e3:.0f} kJ")
    print(lw.uq.given_data(result, error).answer)
    region = lw.studies.footprint(result, "mission_done")
    print(region.answer)
    print(plot(result, region, path))


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/survey_how_far_off.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    main(target, int(sys.argv[2]) if len(sys.argv) > 2 else 1000)
