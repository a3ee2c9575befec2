# SPDX-License-Identifier: Apache-2.0
"""Operations of one step of one vehicle: what more steps make more, on an emulated core."""

from benchmarks.arm.core import Core, in_place_of_this_machine
from benchmarks.arm.cross import image
from benchmarks.arm.tally import of_visits
from lgvi_kernels.advance.spec import CHUNK
from lgvi_warp.engine.packets import Packets
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.sampling.distributions.basic import Normal
from lgvi_warp.scene.ensemble import Ensemble

PROCESSOR = "neoverse_n1"
# What one 128-bit register holds.
WIDTHS = {"float64": 2, "float32": 4}
SPREAD = {"start.angular_velocity": Normal(relative=0.1)}


def plan_of(scene, method, h, dtype="float64", registers=1):
    """One packet of a scene's vehicles through the steps that `of_a_step` makes; registers: that each number fills."""
    width = registers * WIDTHS[dtype]
    fleet = Ensemble(scene, width, 1, SPREAD)
    return make_plan(fleet, method, h=h, t1=5 * CHUNK * h, dtype=dtype, width=width)


def of_a_step(plan, folder, processor=PROCESSOR):
    """The Tally of one step of one vehicle, with its part of the checks between steps.

    Args:
        plan: As of `plan_of`.
        folder: Where files may be left.
        processor: As of `image`.
    """
    core = Core(image(plan, processor, folder).read_bytes())
    totals = []
    with in_place_of_this_machine(core):
        packets = Packets(plan, plan.ensemble.select(0, plan.ensemble.members))
        # The launches differ by so many steps alone, whatever each does before and after them.
        for k0, k1 in ((0, CHUNK), (CHUNK, 2 * CHUNK), (2 * CHUNK, 4 * CHUNK)):
            core.visits.clear()
            packets.launch(k0, k1)
            totals.append(of_visits(core))
    status = packets.outcome().status
    assert not status.any(), f"a member failed: status {status}"
    return totals[2].plus(totals[1], -1).over(CHUNK * plan.spec.width)
