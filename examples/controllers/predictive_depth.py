# SPDX-License-Identifier: Apache-2.0
"""A heavy vehicle with weak thrusters goes to a depth: predictive control beside a PID of the same weights."""

import sys
from pathlib import Path

import lgvi_warp as lw

WANTED, LIMIT, RATE, PERIOD = 12.0, 20.0, 10.0, 1.0  # m, N, N/s, s
LAWS = {
    "linear_mpc": ("predictive control", "#0072B2", "-"),
    "heave_pid": ("PID with the gains of the same weights", "#D55E00", "--"),
}
VEHICLE = lw.Vehicle(300.0, inertia=[30.0, 60.0, 60.0], added_mass=[60.0, 250.0, 300.0], buoyancy=300.0 * 9.81,
                     center_of_buoyancy=[0.0, 0.0, -0.05])  # fmt: skip


def scene(laws, net=0.0):
    """The vehicle, lighter than the water by `net` [N], with laws of its depth, or without a controller."""
    controller = None
    if laws:
        controller = lw.Controller(period=PERIOD, guidance=[lw.control.SetPoint(depth=WANTED, heading=0.0)], laws=laws)
    weak = lw.terms.ControlWrench(limit=[1.0, 1.0, LIMIT, 1.0, 1.0, 1.0])
    drag = lw.terms.Drag(linear=[5.0, 10.0, 10.0, 5.0, 10.0, 10.0], quadratic=[50.0, 50.0, 50.0, 10.0, 50.0, 50.0])
    terms = [drag, weak, lw.terms.Wrench(force=[0.0, 0.0, -net])]
    start = lw.Start(position=[0.0, 0.0, 2.0])
    return lw.Scene(VEHICLE, lw.Environment(gravity=9.81), terms, start, controller)


model = lw.linear.linearize(scene([]), period=PERIOD, inputs="wrench", method="psi_s", h=0.05)
heave = model.part(("position[2]", "velocity[2]"), ("Z",))
weights = dict(Q=[40.0, 0.0], R=[0.02])
predictive = lw.linear.mpc(heave, **weights, limit=[LIMIT], rate_limit=[RATE], horizon=20, disturbance_time=5.0)
gains = lw.linear.lqr(heave, **weights).K[0]
regulator = lw.control.HeavePID(kp=gains[0], kd=gains[1], ki=0.1 * gains[0], integral_limit=5.0)


def plot(runs, path):
    """Depth and force over time."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    depth, force = figure.subplots(2, 1, sharex=True)
    for law, result in runs.items():
        name, color, style = LAWS[law]
        depth.plot(result.time, result.position[:, 0, 2], style, color=color, label=name)
        force.plot(result.time, result.samples["actuator"][:, 0, 2], style, color=color, label=name)
    depth.axhline(WANTED, color="black", linestyle=":", label="wanted")
    depth.set(ylabel="depth [m]", title="600 kg with the added mass, and 20 N of thrust")
    depth.invert_yaxis()
    for side in (-LIMIT, LIMIT):
        force.axhline(side, color="black", linestyle=":", label="limit" if side > 0.0 else None)
    force.set(xlabel="time [s]", ylabel="force downward [N]")
    depth.legend(loc="center right")
    force.legend(loc="lower right", bbox_to_anchor=(1.0, 0.08))
    figure.savefig(path, dpi=100)
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/predictive_depth.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    save = lw.SaveAt(every=0.5, fields=("position", "actuator"))
    laws = {"linear_mpc": predictive, "heave_pid": regulator}
    # It is 3 N light, which no law was told.
    runs = {name: lw.solve(scene([law], 3.0), "psi_s", h=0.05, t1=150.0, save=save) for name, law in laws.items()}
    for name, result in runs.items():
        z = result.position[:, 0, 2]
        print(
            f"{LAWS[name][0]}: {max(0.0, z.max() - WANTED):.2f} m too deep at most, {z[-1] - WANTED:+.3f} m at the end"
        )
    print(plot(runs, target))
