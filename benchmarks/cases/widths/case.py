# SPDX-License-Identifier: Apache-2.0
"""The default width of a packet beside its neighbours, for kernels of users' vehicles: `off` is 1 where none is faster.

Every method on the paper's vehicle; on driven and damped ones, with all terms and with a controller, the methods that suit
them. Widths of half and twice the registers of the default are its neighbours. Members start anew before each reading.
"""

import dataclasses

import lgvi_warp as lw
from benchmarks import problems
from benchmarks.cases.methods.case import METHODS
from benchmarks.timing import least
from lgvi_warp.common.errors import SceneError
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.widths import WIDTHS
from lgvi_warp.runs.settle import make_plan

DRIVEN = ("rk4", "rk5", "rk8", "rkw3", "cg3", "rkmk4", "psi_x", "psi_x8", "psi_w", "psi", "psi_s", "psi_1")
FEW = ("rk4", "rk8", "psi_x", "psi_s")
MEMBERS, STEPS, H, ROUNDS = 1024, 100, 0.02, 9
SPIN = {"start.angular_velocity": lw.distributions.Normal(relative=0.1)}


def looped():
    """REMUS 100 that keeps a heading and a depth, with a tick every tenth step."""
    control = lw.control
    controller = lw.Controller(
        period=10 * H, guidance=[control.SetPoint(heading=0.5, depth=12.0)],
        laws=[control.HeadingPID(kp=0.2, kd=0.3), control.DepthPID(kp=0.1, kp_pitch=0.5, kd_pitch=0.3)],
        allocation=[control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1.0], [0, 0, 0, 0, -1.0, 0]])],
    )  # fmt: skip
    return dataclasses.replace(vehicle("remus_100", 1.54), controller=controller)


def vehicle(name, ahead):
    """A named vehicle on its way."""
    start = {"position": [0.0, 0.0, 10.0], "velocity": [ahead, 0.1, 0.05], "angular_velocity": [0.02, 0.01, 0.03]}
    return lw.Scene.named(name, start=start)


SCENES = {
    "paper": (lambda: vehicle("nordkvist_sanyal", 0.1), METHODS),
    "remus_100": (lambda: vehicle("remus_100", 1.54), DRIVEN),
    "bluerov2_heavy": (lambda: vehicle("bluerov2_heavy", 0.5), DRIVEN),
    "all terms": (lambda: problems.all_terms(noise=False), FEW),
    "remus_100, controlled": (looped, FEW),
}


def run(quick):
    scenes = {"remus_100": (SCENES["remus_100"][0], ("rk4",))} if quick else SCENES
    for name, (make, methods) in scenes.items():
        fleet = lw.Ensemble(make(), MEMBERS, 1, SPIN)
        for method in methods:
            for dtype in ("float64", "float32"):
                yield from one_kernel(name, fleet, method, dtype, 3 if quick else ROUNDS)


def one_kernel(name, fleet, method, dtype, rounds):
    """The kernel at its default width and its neighbours; nothing where the method does not take the scene."""

    def plan_of(width=None):
        return make_plan(fleet, lw.Method(method), h=H, t1=H * STEPS, dtype=dtype, width=width)

    if " " in method:  # steps that are chosen depend on the packet
        return
    try:
        default = plan_of()
    except SceneError:
        return
    lanes = default.spec.width
    plans = {lanes: default} | {w: plan_of(w) for w in (lanes // 2, 2 * lanes) if w in WIDTHS}
    members = fleet.select(0, MEMBERS)
    packets = {width: started(plan, members) for width, plan in plans.items()}
    seconds = least(
        [lambda p=p: p.launch(0, STEPS) for p in packets.values()],
        rounds,
        [lambda p=p: p.refill(members) for p in packets.values()],
    )
    ns = {width: 1e9 * spent / (MEMBERS * STEPS) for width, spent in zip(packets, seconds, strict=True)}
    yield {
        "scene": name, "method": method, "dtype": dtype, "width": lanes,
        "ns": {str(width): round(value, 2) for width, value in sorted(ns.items())},
        "off": round(ns[lanes] / min(ns.values()), 3),
    }  # fmt: skip


def started(plan, members):
    """Packets whose kernel is loaded."""
    plan.compile()
    return Packets(plan, members)
