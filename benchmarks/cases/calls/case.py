# SPDX-License-Identifier: Apache-2.0
"""Overhead around the kernel: a call of a prepared run, a whole solve and the set-up of a member, beside the kernel alone.

And what noise that a call gives costs, beside noise that it draws.
"""

import dataclasses
import itertools
import time

import numpy as np

import lgvi_warp as lw
from lgvi_warp.engine.packets import Packets
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.terms import GaussMarkovCurrent, WrenchNoise

# Varied numbers of each vehicle; of REMUS 100 twelve, six of its drag matrix among them.
PAPER = {
    name: lw.distributions.Normal(std=1e-3)
    for name in ("vehicle.mass", "start.angular_velocity[0]", "vehicle.buoyancy")
}
REMUS = {
    **{f"drag_matrix.quadratic[{i},{i}]": lw.distributions.Normal(relative=0.01) for i in range(6)},
    **{f"start.velocity[{i}]": lw.distributions.Normal(std=0.01) for i in range(3)},
    **{f"start.angular_velocity[{i}]": lw.distributions.Normal(std=0.01) for i in range(3)},
}


def scenes():
    """By name: scene, distributions and method."""
    yield "paper", lw.Scene.load("examples/paper.toml"), PAPER, "psi_s"
    yield "remus_100", lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]}), REMUS, "psi_x"


def least(call, rounds):
    """The least processor time of a call [s], and what it returned."""
    best, value = np.inf, None
    for _ in range(rounds):
        begun = time.thread_time()
        value = call()
        best = min(best, time.thread_time() - begun)
    return best, value


def run(quick):
    rounds = 5 if quick else 200
    for name, scene, vary, method in scenes():
        for members, steps in ((1, 1), (16, 1000)):
            settings = dict(method=method, h=0.01, t1=0.01 * steps, threads=1)
            call = lw.prepare(scene, vary, of="position", **settings)
            fleet = lw.Ensemble(scene, members, 1, vary)
            values = fleet.select(0, members)
            X = np.column_stack([_column(values, label) for label in call.names])
            plan = make_plan(fleet, method, h=0.01, t1=0.01 * steps)
            plan.compile()
            packets = Packets(plan, values)
            kernel, _ = least(lambda: packets.launch(0, steps), rounds)  # noqa: B023
            prepared, Y = least(lambda: call(X), rounds)  # noqa: B023
            # A call keeps what follows from numbers that are those of the last one: here none is.
            others = itertools.cycle([X * (1.0 + 1e-6), X])
            changed, _ = least(lambda: call(next(others)), rounds)  # noqa: B023
            solve, result = least(lambda: lw.solve(fleet, **settings), rounds)  # noqa: B023
            yield {
                "vehicle": name,
                "members": members,
                "steps": steps,
                "kernel_ms": round(1e3 * kernel, 3),
                "call_ms": round(1e3 * prepared, 3),
                "changed_call_ms": round(1e3 * changed, 3),
                "solve_ms": round(1e3 * solve, 3),
                "same_bits": bool(np.array_equal(Y, result.position[-1])),
            }
        yield from set_up(name, scene, vary, method, 4096, 3 if quick else 20)
    yield from given_draws(2 if quick else 20)
    begun = time.perf_counter()
    fleet = lw.Ensemble(lw.Scene.load("examples/paper.toml"), 10**8, 1, PAPER)
    make_plan(fleet, "psi_s", h=0.01, t1=0.2, survey_all=False)
    yield {"planned_members": 10**8, "s": round(time.perf_counter() - begun, 3)}


def given_draws(rounds):
    """A call that is given its draws beside one that draws: REMUS 100 in a random current, under white force and torque."""
    quiet = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
    current = GaussMarkovCurrent(standard_deviation=(0.1,) * 3, time_constant=20.0)
    noise = [current, WrenchNoise(force=(1.0,) * 3, torque=(0.1,) * 3)]
    noisy = dataclasses.replace(quiet, terms=[*quiet.terms, *noise])
    members = 1024
    X, indices = np.linspace(305.0, 307.0, members)[:, None], np.arange(members)
    for dtype, h in (("float64", 0.05), ("float64", 0.2), ("float32", 0.2)):
        settings = dict(of="position[0]", method="psi_x", h=h, t1=60.0, dtype=dtype, threads=1)
        drawing = lw.prepare(noisy, ["vehicle.buoyancy"], **settings)
        given = lw.prepare(noisy, ["vehicle.buoyancy"], draws="given", **settings)
        xi = lw.uq.draws_of(given, indices)
        drawn, Y = least(lambda: drawing(X, indices=indices), rounds)  # noqa: B023
        seconds = {"drawn": drawn}
        for kind in ("float64", "float32"):
            normals = xi.astype(kind)
            seconds[kind], found = least(lambda: given(X, normals), rounds)  # noqa: B023
            if normals.dtype == xi.dtype:
                same = bool(np.array_equal(found, Y))
        yield {
            "vehicle": "remus_100 in noise",
            "dtype": dtype,
            "step": h,
            "normals": xi.shape[1],
            "us_per_member": {name: round(1e6 * value / members, 2) for name, value in seconds.items()},
            "given_over_drawn": {name: round(seconds[name] / drawn, 3) for name in ("float64", "float32")},
            "same_bits": same,
        }


def set_up(name, scene, vary, method, members, rounds):
    """Cost of a member before its first step."""
    fleet = lw.Ensemble(scene, members, 1, vary)
    plan = make_plan(fleet, method, h=0.01, t1=0.01)
    plan.compile()
    values = fleet.select(0, members)
    packets = Packets(plan, values)
    draw, _ = least(lambda: fleet.select(0, members), rounds)
    # In turn, since a plan remembers what follows from the last members.
    others = itertools.cycle([fleet.select(0, members), values])
    pack, _ = least(lambda: packets.refill(next(others)), rounds)
    fresh = fleet.subset(np.arange(members))
    fresh.checked = 0
    check, _ = least(lambda: fresh.check_block(0, members, values.parameters), rounds)
    each = {"draw": draw, "pack": pack, "check": check, "all": draw + pack + check}
    yield {
        "vehicle": name,
        "numbers": len(vary),
        "us_per_member": {k: round(1e6 * s / members, 3) for k, s in each.items()},
    }


def _column(members, label):
    """One number of each member (n,), by its label."""
    name, _, rest = label.partition("[")
    field = name.removeprefix("start.")
    values = getattr(members, field) if name.startswith("start.") else members.parameters[name]
    index = tuple(int(i) for i in rest.rstrip("]").split(",")) if rest else ()
    return np.broadcast_to(values[(slice(None), *index)], members.count)
