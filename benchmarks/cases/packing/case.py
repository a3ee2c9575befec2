# SPDX-License-Identifier: Apache-2.0
"""Cost of a member before its first step, beside its kernel and beside writing its numbers into memory; short runs."""

import itertools
import time

import numpy as np

import lgvi_warp as lw
from benchmarks.cases.calls.case import PAPER, REMUS, least, scenes
from lgvi_warp.engine.packets import Packets
from lgvi_warp.engine.state_lanes import MANY, kernel_for
from lgvi_warp.runs.settle import make_plan

# Members of a block of a short run, and steps of a short run.
BLOCK, STEPS = 16_384, 20
STARTS = {f"start.angular_velocity[{i}]": lw.distributions.Normal(std=0.01) for i in range(3)}
NUMBERS = {"paper": PAPER, "remus_100": dict(list(REMUS.items())[:3])}
# Size of what is copied to measure the memory [numbers].
COPIED = 8_000_000


def varied(name):
    """By name: the distributions of an ensemble of this vehicle."""
    cases = {"nothing": {}, "starts": STARTS, "3 numbers": NUMBERS[name]}
    return cases | ({"12 numbers": REMUS} if name == "remus_100" else {})


def seconds_of_a_byte():
    """Processor time in which the memory takes a byte that is copied from elsewhere in it [s]."""
    source, target = np.ones(COPIED), np.zeros(COPIED)
    return least(lambda: np.copyto(target, source), 5)[0] / source.nbytes


def bytes_written(packets):
    """Bytes of a member that the kernel reads and that are its own."""
    views = [packets.inertia.view, *(structs.view for structs in packets.laws.structs)]
    views += [packets.laws.table.view, packets.laws.memory.view, packets.state_lanes.view]
    return sum(view.nbytes for view in views if len(view) == packets.count) / (packets.count * packets.plan.spec.width)


def set_up(fleet, method, byte, rounds):
    """Time of a member of one block [us]: to draw its numbers, to check them, to pack them; and of its kernel."""
    plan = make_plan(fleet, method, h=0.01, t1=0.01 * STEPS, dtype="float32", survey_all=False)
    plan.compile()
    assert kernel_for(plan.spec, members=MANY)
    members = fleet.select(0, BLOCK)
    packets = Packets(plan, members)
    # In turn, since a plan remembers what follows from the last members.
    others = itertools.cycle([fleet.select(0, BLOCK), members])

    def packed():
        packets.refill(next(others))
        return packets.outcome()

    def checked():
        fleet.checked = 0
        fleet.check_block(0, BLOCK, members.parameters)

    draw, check, pack = (least(call, rounds)[0] for call in (lambda: fleet.select(0, BLOCK), checked, packed))
    kernel = np.inf
    for _ in range(rounds):
        packets.refill(members)
        kernel = min(kernel, least(lambda: packets.launch(0, STEPS), 1)[0])
    memory = byte * BLOCK * bytes_written(packets)
    us = {"draw": draw, "check": check, "pack": pack, "kernel": kernel, "memory": memory}
    return {"us_per_member": {name: round(1e6 * s / BLOCK, 4) for name, s in us.items()}} | {
        "pack_over_kernel": round(pack / kernel, 3),
        "pack_over_memory": round(pack / memory, 1),
        "all_over_kernel": round((draw + check + pack) / kernel, 3),
    }


def short_run(fleet, method, kernel_us, rounds):
    """A whole solve of few steps: processor time of a member [us], and over that of its kernel."""
    settings = dict(method=method, h=0.01, t1=0.01 * STEPS, dtype="float32", threads=1)
    best = np.inf
    for _ in range(rounds):
        begun = time.process_time()
        lw.solve(fleet, **settings)
        best = min(best, time.process_time() - begun)
    us = 1e6 * best / fleet.members
    return {"run_members": fleet.members, "run_us": round(us, 3), "run_over_kernel": round(us / kernel_us, 2)}


def run(quick):
    members, rounds = (100_000, 3) if quick else (1_000_000, 11)
    byte = seconds_of_a_byte()
    yield {"memory_GB_per_s": round(1e-9 / byte, 2)}
    for name, scene, _, method in scenes():
        for case, vary in varied(name).items():
            fleet = lw.Ensemble(scene, members, 1, vary)
            row = set_up(fleet, method, byte, rounds)
            row |= short_run(fleet, method, row["us_per_member"]["kernel"], 2 if quick else 3)
            yield {"vehicle": name, "varied": case, "steps": STEPS} | row
