# SPDX-License-Identifier: Apache-2.0
"""ns per vehicle and step of driven vehicles, REMUS 100 and BlueROV2: whole, without each term, by schedules, by a loop.

The scenes of one vehicle, method and precision take turns, and each figure is the least processor time of all rounds.
`peak_fmas` is how many fused multiply-adds the core makes in that time at its peak, which is measured in the same run: a
figure to compare between machines, and a limit, since a step has as many operations at least.
"""

import dataclasses

import lgvi_warp as lw
from benchmarks.timing import least
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.peak import fma_peak
from lgvi_warp.runs.settle import make_plan

H = 0.02
METHODS = ("rk4", "rk8", "psi", "psi_x")
SPREAD = {"start.angular_velocity": lw.distributions.Normal(relative=0.1)}
TIMES = (0.0, 5.0, 15.0, 60.0)
# Of the thrusters the commands at these times: steady ones in the first row.
THRUSTS = (
    (0.3, -0.2, 0.1, 0.4, -0.1, 0.2, 0.3, -0.3),
    (0.4, -0.3, 0.2, 0.3, -0.2, 0.3, 0.2, -0.2),
    (0.2, 0.1, -0.1, 0.2, 0.1, -0.2, 0.1, 0.3),
    (0.3, -0.2, 0.1, 0.4, -0.1, 0.2, 0.3, -0.3),
)
# Of rudder and stern planes.
ANGLES = ((0.0, 0.0), (0.1, -0.05), (-0.1, 0.05), (0.0, 0.0))


def with_term(scene, kind, **fields):
    """The scene with other fields of its term of one kind."""
    return dataclasses.replace(
        scene, terms=[term.with_fields(fields) if isinstance(term, kind) else term for term in scene.terms]
    )


def lessened(scene):
    """Name -> the scene without each of its terms, and without any."""
    terms = list(scene.terms)
    each = {f"without {term.key}": [other for other in terms if other is not term] for term in terms}
    return {
        name: dataclasses.replace(scene, terms=rest, controller=None)
        for name, rest in (each | {"no terms": []}).items()
    }


def remus():
    """Name -> REMUS 100 at its speed, with fins at rest, or along a schedule."""
    scene = lw.Scene.named("remus_100", start={"velocity": [1.54, 0.1, 0.05], "angular_velocity": [0.02, 0.01, 0.03]})
    scheduled = with_term(scene, lw.terms.ControlFins, times=TIMES, command_schedule=ANGLES)
    return {"whole": scene, "schedule of 4": scheduled} | lessened(scene)


def bluerov2():
    """Name -> BlueROV2 with commands that are held, along a schedule, or of a controller every 10 steps."""
    start = {"velocity": [0.5, 0.1, 0.05], "angular_velocity": [0.02, 0.01, 0.03]}
    named = lw.Scene.named("bluerov2_heavy", start=start)
    scene = with_term(named, lw.terms.Thrusters, command=THRUSTS[0])
    scheduled = with_term(named, lw.terms.Thrusters, times=TIMES, command_schedule=THRUSTS)
    controller = lw.Controller(
        period=10 * H,
        guidance=[lw.control.SetPoint(position=(0.0, 0.0, 5.0), heading=0.0)],
        laws=[lw.control.PosePID(kp=(40.0, 40.0, 60.0), kd=(60.0, 60.0, 80.0), kr=(10.0,) * 3, kw=(4.0,) * 3)],
    )
    looped = dataclasses.replace(named, controller=controller)
    return {"whole": scene, "schedule of 4": scheduled, "controller every 10": looped} | lessened(scene)


VEHICLES = {"remus_100": remus, "bluerov2_heavy": bluerov2}


def packets_of(scene, method, dtype, members, steps):
    """Members that start a little apart, ready to be launched."""
    plan = make_plan(lw.Ensemble(scene, members, 1, SPREAD), method, h=H, t1=H * steps, dtype=dtype)
    plan.compile()
    return Packets(plan, plan.ensemble.select(0, members))


def measured(scenes, method, dtype, members, steps, rounds):
    """Name -> (ns per vehicle and step, lanes)."""
    each = [packets_of(scene, method, dtype, members, steps) for scene in scenes.values()]
    launches = [lambda packets=packets: packets.launch(0, steps) for packets in each]
    begins = [lambda packets=packets: packets.refill(packets.members) for packets in each]
    seconds = least(launches, rounds, begins)
    found = zip(scenes, seconds, each, strict=True)
    return {name: (1e9 * one / (members * steps), packets.plan.spec.width) for name, one, packets in found}


def run(quick):
    members, steps, rounds = (512, 20, 3) if quick else (1024, 100, 15)
    methods, dtypes = (("rk4",), ("float64",)) if quick else (METHODS, ("float64", "float32"))
    for dtype in dtypes:
        peak = fma_peak(dtype)
        for vehicle, make in VEHICLES.items():
            scenes = {name: scene for name, scene in make().items() if not quick or not name.startswith("without")}
            for method in methods:
                # The paper's method takes no coupled inertia.
                if vehicle == "remus_100" and method == "psi":
                    continue
                for name, (ns, width) in measured(scenes, method, dtype, members, steps, rounds).items():
                    yield {
                        "vehicle": vehicle,
                        "scene": name,
                        "method": method,
                        "dtype": dtype,
                        "width": width,
                        "ns_per_vehicle_step": round(ns, 1),
                        "peak_fmas": round(1e-9 * ns * peak),
                    }
