# SPDX-License-Identifier: Apache-2.0
"""Gains of a depth law for the worst 5 % of the vehicles, beside gains for their mean, on vehicles that neither has met.

Ballast differs, and one computer in fourteen answers late: gains that are best on average swing there.
"""

import sys
from pathlib import Path

import numpy as np

import lgvi_warp as lw

WANTED, RUN = 10.0, dict(method="psi_x", h=0.05, t1=60.0)
OVER = {"depth_pid.kp": (0.05, 1.0, "log"), "depth_pid.kp_pitch": (0.5, 8.0, "log")}
RISKS = {"mean": "mean", "worst 5 %": lw.metrics.CVaR(0.05)}
STYLES = {"mean": ("#0072B2", "--"), "worst 5 %": ("#D55E00", "-")}

controller = lw.Controller(
    period=0.1,
    sensors=[lw.control.Sensor(name="depth_cell", of="depth", noise=0.02)],
    guidance=[lw.control.SetPoint(depth=WANTED, heading=0.0)],
    laws=[
        lw.control.DepthPID(kp=0.1, pitch_limit=0.35, kp_pitch=2.0, kd_pitch=1.5),
        lw.control.HeadingPID(kp=1.0, kd=2.0),
    ],
    allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])],
)
start = {"position": [0.0, 0.0, 5.0], "velocity": [1.54, 0.0, 0.0]}
scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 300.5}, start=start, controller=controller)
vary = {
    "vehicle.buoyancy": lw.distributions.Uniform(low=297.0, high=306.0),
    "controller.delay": lw.distributions.Choice([0.2, 0.8], weights=[13.0, 1.0]),  # s
}


def tuned(members, budget):
    """The best gains for each risk, by the integral of time times the depth's error."""
    fleet = lw.Ensemble(scene, members, seed=1, vary=vary)
    return {
        name: lw.tune_gains(fleet, OVER, "itae depth", risk=risk, budget=budget, **RUN) for name, risk in RISKS.items()
    }


def fresh_costs(gains, members):
    """The integral of the depth's error of members that no search has seen, the same for each risk [m s2]."""
    cases = {name: dict(best.parameters) for name, best in gains.items()}
    sweep = lw.sweep(scene, cases, vary=vary, members=members, seed=2, metrics=["itae depth"], **RUN)
    return {cell.case.name: sweep.record(cell).numbers["itae depth"] for cell in sweep.cells}


def plot(costs, path):
    """Exceedance curve of the vehicles' costs, and the means of the worst 5 %."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    panel = figure.add_subplot()
    for name, each in costs.items():
        color, style = STYLES[name]
        worse = 100.0 * np.arange(len(each), 0, -1) / len(each)
        panel.step(np.sort(each), worse, style, color=color, where="post", label=f"tuned for the {name}")
        worst = lw.metrics.CVaR(0.05)(each[None])[0]
        panel.axvline(worst, color=color, linestyle=":", label=f"mean of its worst 5 %: {worst:.0f} m s2")
    panel.set(yscale="log", xlabel="integral of time times error of depth [m s2]", ylabel="vehicles that cost more [%]")
    panel.set_yticks([0.1, 1.0, 10.0, 100.0], ["0.1", "1", "10", "100"])
    panel.grid(alpha=0.3)
    panel.legend()
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/tune_worst_5_percent.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    gains = tuned(members=200, budget=50_000)
    costs = fresh_costs(gains, members=2000)
    for name, each in costs.items():
        numbers = ", ".join(f"{key.split('.')[1]} {value:.3f}" for key, value in gains[name].parameters.items())
        print(
            f"{name}: {numbers}: {each.mean():.0f} m s2 on average, "
            f"{lw.metrics.CVaR(0.05)(each[None])[0]:.0f} m s2 in the worst 5 %"
        )
    print(plot(costs, target))
