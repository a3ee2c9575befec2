# SPDX-License-Identifier: Apache-2.0
"""REMUS 100 with 6x6 inertia: its speed at a held thrust, turning circles, and the rudder steps of Prestero (2001).

    python examples/papers/prestero_2001/remus_100.py [picture]

Twice, since the hull is unstable in pitch and nothing steers its depth: held in the horizontal plane by an exact
symmetry (centre of gravity at the origin, no propeller torque), and as published. docs/guide/remus_100.md has the comparison.
"""

import dataclasses
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import root

import lgvi_warp as lw

# The default method of a damped scene that is not stiff at this step is rk4: a splitting would move the steady turns.
STEP = 0.02  # s
TURNED_IN = 0.01  # s
THRUST, SURGE_DRAG = 3.86, 1.62  # N, kg/m: X_prop and -X_uu, Prestero (2001), appendix B and table C.9
CRUISE = np.sqrt(THRUST / SURGE_DRAG)  # m/s
RUDDERS = (4.0, 10.0, 20.0)  # deg, positive turns to port
WEIGHT = 299.0  # N; the published buoyancy of 308 N would make it rise
# Without the lever of gravity and without torque neither pitch nor roll is ever pushed.
IN_THE_PLANE = {"center_of_gravity": [0.0] * 3, "rigid_body_mass_matrix": np.diag([30.48] * 3 + [0.177, 3.45, 3.45])}
NO_TORQUE = {"type": "wrench", "force": [THRUST, 0.0, 0.0]}


def plane_scene():
    """The vehicle that stays in the horizontal plane."""
    return lw.Scene.named("remus_100", vehicle={"buoyancy": WEIGHT} | IN_THE_PLANE, terms=[NO_TORQUE])


def full_scene():
    """The vehicle as published but for its buoyancy: it pitches, and rolls by the propeller's torque."""
    return lw.Scene.named("remus_100", vehicle={"buoyancy": WEIGHT})


def solve(scene, rudders, speeds, duration):
    """One member for each rudder [deg] and speed ahead [m/s] at the start, level; a sample each 0.1 s."""
    n = len(rudders)
    velocity = np.zeros((n, 3))
    velocity[:, 0] = speeds
    command = np.radians([[rudder, 0.0] for rudder in rudders])
    level = np.broadcast_to(np.eye(3), (n, 3, 3))
    states = (np.zeros((n, 3)), level, velocity, np.zeros((n, 3)))
    fleet = lw.Ensemble.from_states(scene, *states, {"control_fins.command": command})
    result = lw.solve(fleet, h=STEP, t1=duration, save=lw.SaveAt(every=0.1))
    assert result.status.counts() == {"ok": n}
    return result


def rudder_steps():
    """Prestero (2001), section 8.3: rudder 0, from 10 s +4, from 40 s to 70 s -4 degrees; the start of table 8.1."""
    scene = full_scene()
    (fins,) = (term for term in scene.terms if isinstance(term, lw.terms.ControlFins))
    degrees = [0.0, 0.0, 4.0, 4.0, -4.0, -4.0]
    table = {"times": [0.0, 10.0, 10.0 + TURNED_IN, 40.0, 40.0 + TURNED_IN, 70.0]}
    table["command_schedule"] = [[np.radians(angle), 0.0] for angle in degrees]
    terms = [dataclasses.replace(fins, **table) if term is fins else term for term in scene.terms]
    start = lw.Start(velocity=[1.54, 0.0, 0.0], euler_deg=[-5.0, 0.0, 0.0])
    scene = dataclasses.replace(scene, terms=terms, start=start)
    return lw.solve(scene, h=STEP, t1=70.0, save=lw.SaveAt(every=0.1))


def printed_turn(rudder):
    """Steady (u, v, r) [m/s, m/s, rad/s] of the printed sums in the plane; coefficients of Prestero (2001), appendix B.

    They are linear in the rudder and in the flow's angle at it: the difference to the fins of this package.
    """
    m = 30.48

    def sums(state):
        u, v, r = state
        X = -1.62 * abs(u) * u + 35.5 * v * r - 1.93 * r * r + THRUST + m * v * r
        Y = -1310.0 * abs(v) * v + 0.632 * abs(r) * r - 28.6 * u * v + (5.22 - m) * u * r + 9.64 * u * u * rudder
        N = -3.18 * abs(v) * v - 94.0 * abs(r) * r - 24.0 * u * v - 2.0 * u * r - 6.15 * u * u * rudder
        return X, Y, N

    return root(sums, (1.3, 0.05, -0.15), tol=1e-12).x


def sway_yaw_growth():
    """The faster root [1/s] of the printed sums for small sway and yaw rate, at CRUISE."""
    inertia = np.array([[30.48 + 35.5, -1.93], [-1.93, 3.45 + 4.88]])
    rates = CRUISE * np.array([[-28.6, 5.22 - 30.48], [-24.0, -2.0]])
    return np.linalg.eigvals(np.linalg.solve(inertia, rates)).real.max()


def steady(result, member, since):
    """Means from `since` [s] on: surge, sway [m/s], rate of heading [deg/s], radius [m]; half the range of pitch [deg]."""
    late = result.time >= since
    u, v, _ = result.velocity[late, member].mean(axis=0)
    heading = np.unwrap(np.arctan2(*result.attitude[late, member, 1::-1, 0].T))
    rate = (heading[-1] - heading[0]) / (result.time[-1] - since)
    path = np.diff(result.position[late, member, :2], axis=0)
    radius = np.linalg.norm(path, axis=1).sum() / abs(heading[-1] - heading[0])
    return u, v, np.degrees(rate), radius, 0.5 * np.ptp(pitch(result, member)[late])


def at_the_rudder(rudder, u, v, r):
    """Angle of the flow at the rudder, 0.638 m behind the origin [deg]: positive where it lifts to starboard."""
    return rudder - np.degrees(np.arctan2(v - 0.638 * np.radians(r), u))


def pitch(result, member):
    """Pitch (k,) [deg]."""
    return np.degrees(np.arcsin(-result.attitude[:, member, 2, 0]))


def plot(straight, circles, full, steps, path):
    """Paths from above, speed over time, and yaw rate and pitch in the rudder steps."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(15.0, 4.8), layout="constrained")
    above, speed, rates = figure.subplots(1, 3)
    above.set(title="Paths from above", xlabel="east [m]", ylabel="north [m]", aspect="equal")
    speed.set(title="Speed ahead", xlabel="time [s]", ylabel="u [m/s]")
    speed.plot(straight.time, straight.velocity[:, 0, 0], color="black", label="straight, from rest")
    speed.axhline(CRUISE, color="black", linewidth=0.5, linestyle=":")
    for i, rudder in enumerate(RUDDERS):
        for result, style in ((circles, "-"), (full, "--")):
            label = f"rudder {rudder:g}°" if result is circles else None
            early = result.time <= 60.0
            (line,) = above.plot(*result.position[early, i, 1::-1].T, style, color=f"C{i}", label=label, linewidth=0.9)
            speed.plot(result.time, result.velocity[:, i, 0], style, color=line.get_color(), label=label, linewidth=0.9)
    rates.set(title="Rudder 0°, 4°, -4°", xlabel="time [s]", ylabel="yaw rate [deg/s], pitch [deg]")
    rates.plot(steps.time, np.degrees(steps.angular_velocity[:, 0, 2]), label="yaw rate")
    rates.plot(steps.time, pitch(steps, 0), label="pitch")
    speed.legend(fontsize="small", loc="lower right")
    rates.legend(fontsize="small", loc="upper left")
    figure.suptitle("REMUS 100: in the plane (solid) and in all six degrees of freedom (dashed)")
    figure.savefig(path, dpi=100)
    return path


HEADINGS = ("rudder", "u", "v", "r", "radius", "pitch", "flow at rudder")
UNITS = ("[deg]", "[m/s]", "[m/s]", "[deg/s]", "[m]", "+- [deg]", "[deg]")
ROW = "{:22s} {:>7} {:>7} {:>7} {:>8} {:>7} {:>9} {:>15}"


def report_turns(circles, full):
    """Print the steady turns."""
    print(ROW.format("steady turns", *HEADINGS))
    print(ROW.format("", *UNITS))
    for i, rudder in enumerate(RUDDERS):
        u, v, r = printed_turn(np.radians(rudder))
        printed = (u, v, np.degrees(r), np.hypot(u, v) / abs(r), 0.0)
        rows = {
            "in the plane": steady(circles, i, 60.0),
            "printed sums": printed,
            "six degrees of freedom": steady(full, i, 60.0),
        }
        for name, values in rows.items():
            flow = at_the_rudder(rudder, *values[:3])
            numbers = [f"{x:.{k}f}" for x, k in zip((*values, flow), (4, 4, 3, 3, 1, 1), strict=True)]
            print(ROW.format(name, f"{rudder:g}", *numbers))


def report_steps(steps):
    """Print the rudder steps, over the times that are read off the figures of Prestero (2001)."""
    t, yaw = steps.time, np.degrees(steps.angular_velocity[:, 0, 2])
    print(f"rudder steps: yaw rate {yaw[t == 14.0][0]:.2f} deg/s at 14 s")
    for name, since, until in (("+4", 25.0, 38.0), ("-4", 50.0, 68.0)):
        when = (t >= since) & (t <= until)
        u, v, _ = steps.velocity[when, 0].T
        angle = pitch(steps, 0)[when]
        print(
            f"  {name} deg, {since:g} to {until:g} s: mean yaw rate {yaw[when].mean():.2f} deg/s, mean v {v.mean():.3f} m/s,",
            f"u {u.min():.3f} to {u.max():.3f} m/s, pitch {angle.min():.1f} to {angle.max():.1f} deg",
        )
    angle = pitch(steps, 0)
    rises = t[1:][(angle[:-1] < 0.0) & (angle[1:] >= 0.0)]
    print(f"  pitch: one oscillation takes {np.diff(rises).mean():.1f} s")
    north, east, _ = steps.position[:, 0].T
    print(f"  path: north {north.min():.1f} to {north.max():.1f} m, east {east.min():.1f} to {east.max():.1f} m")


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "runs/remus_100.png")
    target.parent.mkdir(parents=True, exist_ok=True)
    count = len(RUDDERS)
    straight = solve(plane_scene(), [0.0], [0.0], 120.0)
    circles = solve(plane_scene(), RUDDERS, [CRUISE] * count, 120.0)
    full = solve(full_scene(), RUDDERS, [CRUISE] * count, 120.0)
    steps = rudder_steps()
    print(f"straight run from rest: u = {straight.velocity[-1, 0, 0]:.4f} m/s after 120 s, balance {CRUISE:.4f} m/s")
    print(f"roll that balances the propeller's torque: {np.degrees(np.arcsin(-0.543 / (0.0196 * WEIGHT))):.2f} deg")
    print(f"straight course, growth of sway and yaw: {sway_yaw_growth():.2f} 1/s")
    report_turns(circles, full)
    report_steps(steps)
    print(plot(straight, circles, full, steps, target))
