# SPDX-License-Identifier: Apache-2.0
"""Survey near the surface in the sea of a forecast and its tide: how often is a REMUS 100 off its depth by more than 0.5 m?

    python examples/studies/survey_in_a_seaway.py [picture.png] [members]

Height, period and direction of the sea, the tide's phase and the surge are as uncertain as a forecast; each vehicle has a sea
of its own. It holds its depth by a pressure cell. The last line tells P(depth error > 0.5 m) at each depth, with its interval.
"""

import sys
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

import lgvi_warp as lw

DEPTHS, ALLOWED = (2.0, 3.0, 5.0), 0.5  # m
STEP, SETTLED, END = 0.05, 30.0, 120.0  # s
SEA = {"significant_height": 1.0, "peak_period": 6.0, "heading_deg": 70.0, "spreading": 6.3}
TIDE = {"amplitudes": [1.2, 0.4], "speeds": [28.984, 30.0], "times": [0.0, 1e4], "heights": [0.0, 0.0], "mean": 2.0}
VARY = {
    "sea_state.significant_height": lw.distributions.Normal(relative=0.2),
    "sea_state.peak_period": lw.distributions.Normal(std=0.5),
    "sea_state.heading_deg": lw.distributions.Normal(std=15.0),
    "tide.phases": lw.distributions.Uniform(low=[-np.pi, -np.pi], high=[np.pi, np.pi]),
    "tide.mean": lw.distributions.Normal(std=0.2),
}


def scene(depth):
    """The vehicle ahead at 1.5 m/s, at a depth below the surface that its pressure cell reads."""
    controller = lw.Controller(
        period=0.1,  # s between ticks
        sensors=[lw.control.Sensor(name="depth_cell", of="depth", reads="pressure", noise=0.02)],
        guidance=[lw.control.SetPoint(depth=depth, heading=0.0)],
        laws=[
            lw.control.DepthPID(kp=0.1, ki=0.001, pitch_limit=0.5, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0),
            lw.control.HeadingPID(kp=1.0, ki=0.02, kd=2.0),
        ],
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
    )
    terms = [lw.terms.SeaState(**SEA), lw.terms.Tide(**TIDE)]
    # The depth 0 is that of the chart, 2 m below the mean surface.
    start = {"velocity": [1.54, 0.0, 0.0], "position": [0.0, 0.0, depth - TIDE["mean"]]}
    return lw.Scene.named("remus_100", vehicle={"buoyancy": 299.0}, terms=terms, start=start, controller=controller)


def errors(depth, members):
    """Times (k,) [s], and how far vehicles are below their depth under the tide (k, n) [m], once they have settled."""
    fleet = lw.Ensemble(scene(depth), members, seed=1, vary=VARY)
    result = lw.solve(fleet, h=STEP, t1=END, save=lw.SaveAt(every=0.5, fields=("position",)))
    tide = next(term for term in fleet.scene.terms if term.type == "tide")
    numbers = {name: result.parameters[f"tide.{name}"] for name in tide.parameters()}
    height = tide.height(numbers, result.time)
    settled = result.time >= SETTLED
    return result.time[settled], (result.position[..., 2] + height - depth)[settled]


def probability(error):
    """Part of the vehicles that are off by more than allowed at some time, and its 95 % interval."""
    off = np.abs(error).max(axis=0) > ALLOWED
    interval = binomtest(int(off.sum()), off.size).proportion_ci(0.95, "wilson")
    return off.mean(), interval.low, interval.high


def plot(path, surveys):
    """Errors over time of the shallowest survey, and the largest error of each vehicle by depth."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    time, error = surveys[DEPTHS[0]]
    for share, color in ((0.98, "#c6dbef"), (0.5, "#6baed6")):
        low, high = np.quantile(error, [0.5 - 0.5 * share, 0.5 + 0.5 * share], axis=1)
        left.fill_between(time, low, high, color=color, label=f"{100 * share:.0f} % of vehicles")
    left.plot(time, error[:, 0], color="#D55E00", linewidth=1.0, label="one of them")
    left.set(xlabel="time [s]", ylabel="below its depth [m]", title=f"survey at {DEPTHS[0]:g} m")
    left.legend(loc="upper right", fontsize=8)
    for (depth, (_, error)), color in zip(surveys.items(), ("#D55E00", "#0072B2", "#009E73"), strict=True):
        largest = np.sort(np.abs(error).max(axis=0))
        right.plot(largest, 1.0 - np.arange(largest.size) / largest.size, color=color, label=f"at {depth:g} m")
    right.axvline(ALLOWED, color="0.6", linestyle="--")
    right.set(xlabel="largest depth error e [m]", ylabel="P(error > e)", title="of 90 s of survey")
    right.legend()
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/survey_in_a_seaway.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    surveys = {depth: errors(depth, int(sys.argv[2]) if len(sys.argv) > 2 else 400) for depth in DEPTHS}
    for depth, (_, error) in surveys.items():
        print(f"at {depth:g} m: {error.std():.2f} m rms, largest {np.abs(error).max():.2f} m")
    print(plot(target, surveys))
    told = [
        f"{100 * p:.0f} % [{100 * a:.0f}, {100 * b:.0f}] at {d:g} m"
        for d, e in surveys.items()
        for p, a, b in [probability(e[1])]
    ]
    print(f"P(depth error > {ALLOWED:g} m) = {', '.join(told)}")
