# SPDX-License-Identifier: Apache-2.0
"""Closed loops beside the same scene without a controller, by processor time, in turn; callbacks and metrics beside none."""

import dataclasses
import time

import numpy as np

import lgvi_warp as lw
from lgvi_warp.engine.packets import Packets
from lgvi_warp.runs.settle import make_plan

H = 0.01
HEADING = dict(kp=1.0, ki=0.02, kd=2.0, integral_limit=20.0)
DEPTH = dict(kp=0.1, ki=0.001, kp_pitch=5.0, ki_pitch=0.3, kd_pitch=2.0, integral_limit=(20.0, 20.0))
POSE = dict(kp=(40.0, 40.0, 60.0), ki=(4.0, 4.0, 6.0), kd=(60.0, 60.0, 80.0), kr=(10.0,) * 3, kw=(4.0,) * 3)


def remus(every, **more):
    """REMUS 100 with the autopilot of depth and heading; every: steps between ticks, 0 for none."""
    controller = None
    if every:
        controller = lw.Controller(
            period=every * H,
            guidance=[lw.control.SetPoint(depth=10.0, heading=0.5)],
            laws=[lw.control.DepthPID(**DEPTH), lw.control.HeadingPID(**HEADING)],
            allocation=[
                lw.control.AllocationMatrix(to="control_fins", matrix=((0, 0, 0, 0, 0, -1), (0, 0, 0, 0, -1, 0)))
            ],
            **more,
        )
    return lw.Scene.named("remus_100", start={"velocity": [1.54, 0.0, 0.0]}, controller=controller)


# Places to hold: below the start, at the start, and so far away that thrusters are always at their limits.
BELOW, HERE, FAR = (0.0, 0.0, 5.0), (0.0, 0.0, 0.0), (300.0, 200.0, 50.0)
ALLOCATIONS = {
    "pseudo_inverse": lw.control.PseudoInverse(to="thrusters"),
    "bounded_least_squares": lw.control.BoundedLeastSquares(to="thrusters"),
}


def bluerov2(every, allocation=ALLOCATIONS["pseudo_inverse"], place=BELOW):
    """BlueROV2 heavy that keeps its station with eight thrusters."""
    controller = None
    if every:
        controller = lw.Controller(
            period=every * H,
            guidance=[lw.control.SetPoint(position=place, heading=0.0)],
            laws=[lw.control.PosePID(**POSE, feedforward="restoring")],
            allocation=[allocation],
        )
    return lw.Scene.named("bluerov2_heavy", controller=controller)


def at_work():
    """BlueROV2 heavy without a controller, whose thrusters work all the time: commands along a schedule, with their lag."""
    scene = bluerov2(0)
    (thrusters,) = (term for term in scene.terms if term.type == "thrusters")
    commands = [[0.1 * (-1) ** i for i in range(8)], [0.0] * 8]
    moving = thrusters.with_fields({"times": [0.0, 20.0], "command_schedule": commands, "command": commands[0]})
    return dataclasses.replace(scene, terms=[moving if term is thrusters else term for term in scene.terms])


def packets_of(scene, method, dtype, members, steps):
    """Packets of members that start a little apart."""
    vary = {
        "start.velocity": lw.distributions.Normal(std=0.02),
        "start.angular_velocity": lw.distributions.Normal(std=0.02),
    }
    plan = make_plan(lw.Ensemble(scene, members, 1, vary), method, h=H, t1=H * steps, dtype=dtype)
    plan.compile()
    return Packets(plan, plan.ensemble.select(0, members))


def seconds(packets, k0, k1):
    """Processor time of steps [s]."""
    begun = time.thread_time()
    packets.launch(k0, k1)
    return time.thread_time() - begun


def least_times(scenes, method, dtype, quick):
    """ns of a member's step of each scene, the least of several rounds; and of a tick, of "every 10" and "every 1"."""
    members, steps, rounds = (64, 300, 2) if quick else (512, 1000, 7)
    all_packets = [packets_of(scene, method, dtype, members, steps) for scene in scenes.values()]
    times = np.empty((rounds, len(scenes)))
    for i in range(rounds):
        for j, packets in enumerate(all_packets):
            packets.refill(packets.members)
            times[i, j] = seconds(packets, 0, steps)
    least = dict(zip(scenes, (times.min(axis=0) * 1e9 / (members * steps)).tolist(), strict=True))
    return *least.values(), (least["every 1"] - least["every 10"]) / 0.9


def ratios(name, scenes, method, dtype, quick):
    """Loops beside the scene without one, and what one tick takes."""
    *least, tick = least_times(scenes, method, dtype, quick)
    for label, ns in zip(scenes, least, strict=True):
        yield {"vehicle": name, "method": method, "dtype": dtype, "loop": label, "ns": round(ns, 1),
               "over_none": round(ns / least[0], 3)}  # fmt: skip
    yield {"vehicle": name, "method": method, "dtype": dtype, "ns_a_tick": round(tick, 1)}


def allocations(dtype, quick):
    """Cost of a tick by allocation, with no thruster at its limit and with some there."""
    for where, place in (("within the limits", HERE), ("at the limits", FAR)):
        for label, allocation in ALLOCATIONS.items():
            scenes = {f"every {every}": bluerov2(every, allocation, place) for every in (10, 1)}
            *_, tick = least_times(scenes, "psi_s", dtype, quick)
            yield {"vehicle": "bluerov2_heavy", "dtype": dtype, "allocation": label, "thrusters": where,
                   "ns_a_tick": round(tick, 1)}  # fmt: skip


def settled(quick):
    """A loop at the start and once it has settled: products of its rates are subnormal numbers then."""
    members, part = (64, 500) if quick else (256, 1000)
    for dtype in ("float64", "float32"):
        packets = packets_of(bluerov2(10), "psi_s", dtype, members, 8 * part)
        each = [seconds(packets, k, k + part) for k in range(0, 8 * part, part)]
        yield {"vehicle": "bluerov2_heavy", "dtype": dtype, "late_over_early": round(min(each[-3:]) / min(each[:3]), 3)}


def callback(quick):
    """The heading law as a Python function beside the one in the kernel, ten steps a period."""
    members, t1 = (256, 2.0) if quick else (4096, 10.0)

    def heading(t, y, r, members):
        s, c = r.attitude[:, :2, 0], y.attitude[:, :2, 0]
        demand = np.zeros((len(members), 6))
        demand[:, 5] = HEADING["kp"] * np.arctan2(s[:, 1] * c[:, 0] - s[:, 0] * c[:, 1], np.sum(s * c, axis=1))
        demand[:, 5] -= HEADING["kd"] * y.angular_velocity[:, 2]
        return demand

    laws = {
        "fused": lw.control.HeadingPID(kp=HEADING["kp"], kd=HEADING["kd"]),
        "callback": lw.control.Callback(heading),
    }
    times = {}
    for label, law in laws.items():
        controller = lw.Controller(
            period=10 * H,
            guidance=[lw.control.SetPoint(heading=0.5)],
            laws=[law],
            allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=((0, 0, 0, 0, 0, -1), (0,) * 6))],
        )
        scene = lw.Scene.named("remus_100", start={"velocity": [1.54, 0.0, 0.0]}, controller=controller)
        fleet = lw.Ensemble(scene, members, 1, {"start.angular_velocity": lw.distributions.Normal(std=0.02)})
        best = np.inf
        for _ in range(2 if quick else 4):
            begun = time.process_time()
            lw.solve(fleet, "psi_x", h=H, t1=t1, threads=1)
            best = min(best, time.process_time() - begun)
        times[label] = best
    yield {"vehicle": "remus_100", "loop": "callback", "members": members, "steps_a_period": 10,
           "over_fused": round(times["callback"] / times["fused"], 3)}  # fmt: skip


def metrics(quick):
    """Whole runs that gather metrics at every tick, ten steps a tick, beside the same runs that gather nothing."""
    members, t1 = (256, 5.0) if quick else (4096, 30.0)
    fleet = lw.Ensemble(remus(10), members, 1, {"start.angular_velocity": lw.distributions.Normal(std=0.02)})
    depth = [lw.metrics.Overshoot("depth"), lw.metrics.SettlingTime("depth", within=0.5)]
    others = [lw.metrics.IAE("heading"), lw.metrics.Travel(), lw.metrics.SaturationShare()]
    asked = {"none": [], "two of depth": depth, "five": depth + others}
    times = dict.fromkeys(asked, np.inf)
    for _ in range(2 if quick else 5):
        for label, statistics in asked.items():
            begun = time.process_time()
            lw.solve(fleet, "psi_x", h=H, t1=t1, statistics=statistics, keep="none", threads=1)
            times[label] = min(times[label], time.process_time() - begun)
    for label in list(asked)[1:]:
        yield {
            "vehicle": "remus_100",
            "metrics": label,
            "members": members,
            "over_none": round(times[label] / times["none"], 3),
        }


def predictive(quick):
    """A tick of predictive control of heave beside one of heave_pid: within its limits, and where every tick iterates."""
    members, steps, rounds = (64, 200, 2) if quick else (512, 500, 7)
    model = lw.linear.linearize(lw.Scene.named("bluerov2_heavy"), period=10 * H, inputs="wrench", method="psi_s", h=H)
    heave = model.part(("position[2]", "velocity[2]"), ("Z",))
    weights = dict(Q=[10.0, 0.1], R=[1e-3], limit=[40.0], rate_limit=[100.0])
    laws = {("heave_pid", 0): lw.control.HeavePID(kp=60.0, kd=80.0)}
    laws |= {("linear_mpc", count): lw.linear.mpc(heave, **weights, horizon=count) for count in (5, 10, 20)}
    # 20 m away all members are at the limit for the whole run.
    for depth, where in ((0.0, "within limits"), (20.0, "at its limits")):
        each = {}
        for (name, horizon), law in laws.items():
            wanted = lw.control.SetPoint(depth=5.0 + depth, heading=0.0)
            controller = lw.Controller(
                period=10 * H, guidance=[wanted], laws=[law, lw.control.HeadingPID(kp=10.0, kd=10.0)]
            )
            scene = lw.Scene.named("bluerov2_heavy", controller=controller, start={"position": [0.0, 0.0, 5.0]})
            each[name, horizon] = packets_of(scene, "psi_s", "float64", members, steps)
        times = np.empty((rounds, len(each)))
        for i in range(rounds):
            for j, packets in enumerate(each.values()):
                packets.refill(packets.members)
                times[i, j] = seconds(packets, 0, steps)
        least = times.min(axis=0) * 1e9 / (members * steps / 10)
        for (name, horizon), ns in list(zip(each, least, strict=True))[1:]:
            yield {"vehicle": "bluerov2_heavy", "loop": name, "horizon": horizon, "where": where,
                   "ns_a_tick_over_heave_pid": round(ns - least[0], 1)}  # fmt: skip


def run(quick):
    delay_and_faults = dict(
        delay=0.05,
        sensors=[
            lw.control.Sensor(name="cell", of="depth", noise=0.02, quantum=0.005),
            lw.control.Sensor(name="compass", of="heading", noise=0.01),
        ],
        faults=[lw.control.Fault(of="control_fins", channel=0, time=5.0, gain=0.5)],
    )
    for dtype in ("float64", "float32"):
        scenes = {"none": remus(0), "every 10": remus(10), "every 1": remus(1)}
        if dtype == "float64":
            scenes["every 10, sensors, delay, fault"] = remus(10, **delay_and_faults)
        yield from ratios("remus_100", scenes, "psi_x", dtype, quick)
        scenes = {
            "none": bluerov2(0),
            "every 10": bluerov2(10),
            "every 1": bluerov2(1),
            "none, by a schedule": at_work(),
        }
        yield from ratios("bluerov2_heavy", scenes, "psi_s", dtype, quick)
        yield from allocations(dtype, quick)
    yield from settled(quick)
    yield from callback(quick)
    yield from predictive(quick)
    yield from metrics(quick)
