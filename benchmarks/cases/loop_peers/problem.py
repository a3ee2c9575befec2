# SPDX-License-Identifier: Apache-2.0
"""The closed loop that each way computes: a vehicle in water that goes to a place and stays there, by a geometric PID.

M nu' = M nu x Om + net z - D(nu) + f,  J Om' = J Om x Om + M nu x nu - d x z - D(Om) + tau,  b' = R nu,  R' = R hat(Om),
with z = R^T e3, D(v) = (l + q |v|) v along each axis, d = buoyancy x its lever; by rk4. Every so many steps a tick sets f and
tau, which are held until the next one:

f = R^T (kp e + ki I) - kd nu - net0 z,  tau = -kr e_R - ki_r I_R - kw Om + d0 x z,

e = b_d - b, e_R = sum over inertial axes i of (R_i x R_d,i) / 2; net0, d0 are those of the nominal vehicle. Then the
integrals are those of the errors of the ticks before, and each of their numbers stays within a limit. Members differ in
their start, their buoyancy and the gains kp and kr.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

import lgvi_warp as lw
from benchmarks import problems
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.work import unpacked
from lgvi_warp.reference.control import upright
from lgvi_warp.runs.settle import make_plan

STEP, EVERY = 0.01, 10
GAINS = dict(kp=(40.0, 40.0, 60.0), ki=(2.0, 2.0, 3.0), kd=(150.0, 150.0, 200.0), kr=(10.0, 10.0, 10.0),
             ki_r=(0.5, 0.5, 0.5), kw=(8.0, 8.0, 8.0))  # fmt: skip
LIMITS = (20.0, 5.0)
GOAL, HEADING = (1.0, -0.5, 11.0), 0.5
VARY = {
    "start.velocity_inertial": lw.distributions.Normal(std=0.05),
    "start.angular_velocity": lw.distributions.Normal(std=0.05),
    "vehicle.buoyancy": lw.distributions.Normal(std=1.0),
    "pose_pid.kp": lw.distributions.Normal(relative=0.1),
    "pose_pid.kr": lw.distributions.Normal(relative=0.1),
}
# Position (members, 3) and attitude (members, 3, 3) at the end.
End = tuple[np.ndarray, np.ndarray]


class Way(NamedTuple):
    """One way to compute the loop, compiled: `begin` puts all members at the start, `advance` takes them to the end."""

    begin: Callable[[], Any]
    advance: Callable[[], Any]
    end: Callable[[], End]


@dataclass(frozen=True)
class Problem:
    """Size of a problem: members, ticks, steps between ticks, and the step [s]."""

    members: int
    ticks: int
    every: int = EVERY
    h: float = STEP

    @cached_property
    def fleet(self) -> lw.Ensemble:
        """The members as lgvi_warp takes them: the paper's vehicle with drag and an ideal actuator."""
        controller = lw.Controller(
            period=self.every * self.h,
            guidance=[lw.control.SetPoint(position=GOAL, heading=HEADING)],
            laws=[lw.control.PosePID(**GAINS, integral_limit=LIMITS, feedforward="restoring")],
        )
        vehicle = lw.Vehicle(
            123.8,
            inertia=[5.46, 5.29, 5.72],
            added_mass=[65.0, 70.0, 75.0],
            buoyancy=1213.0,
            center_of_buoyancy=[0.002, -0.001, -0.007],
        )
        environment, terms = lw.Environment(gravity=problems.GRAVITY), [problems.drag(), lw.terms.ControlWrench()]
        scene = lw.Scene(vehicle, environment, terms, problems.START, controller)
        return lw.Ensemble(scene, self.members, 1, VARY)

    @cached_property
    def numbers(self) -> dict[str, Any]:
        """Numbers of the equations above by name: those that differ by member (members,) or (members, 3)."""
        scene, drawn = self.fleet.scene, self.fleet.select(0, self.members)
        vehicle, drag, varied = scene.vehicle, scene.terms[0], drawn.parameters
        lever, weight = np.array(vehicle.center_of_buoyancy), vehicle.mass * problems.GRAVITY
        buoyancy = varied["vehicle.buoyancy"]
        shared = {name: np.array(values) for name, values in GAINS.items() if name not in ("kp", "kr")}
        return shared | {
            "kp": varied["pose_pid.kp"],
            "kr": varied["pose_pid.kr"],
            "net": weight - buoyancy,
            "d": buoyancy[:, None] * lever,
            "net0": weight - float(vehicle.buoyancy),
            "d0": float(vehicle.buoyancy) * lever,
            "M": np.diag(vehicle.mass_matrix),
            "J": np.diag(vehicle.inertia),
            "linear": np.array(drag.linear),
            "quadratic": np.array(drag.quadratic),
            "goal": np.array(GOAL),
            "R_d": upright(HEADING),
            "b": drawn.position,
            "R": drawn.attitude,
            "nu": drawn.velocity,
            "Om": drawn.angular_velocity,
        }


def make_lanes(problem: Problem) -> Way:
    """Ours: law and steps in one kernel, a vehicle a lane."""
    steps = problem.ticks * problem.every
    save = lw.SaveAt(fields=("position", "attitude"))
    plan = make_plan(problem.fleet, "rk4", h=problem.h, t1=problem.h * steps, save=save)
    plan.compile()
    packets = Packets(plan, problem.fleet.select(0, problem.members))
    samples = []

    def advance() -> None:
        samples[:] = [packets.launch(0, steps)]

    def end() -> End:
        raw = samples[0][:, -1].transpose(0, 2, 1).reshape(1, -1, samples[0].shape[2])[:, : problem.members]
        fields = unpacked(plan.layout.sizes, raw.astype(np.float64), packets.frame)
        return fields["position"][-1], fields["attitude"][-1]

    return Way(lambda: packets.refill(packets.members), advance, end)
