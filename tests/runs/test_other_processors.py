# SPDX-License-Identifier: Apache-2.0
"""Kernels compiled for processors that are not here: CUDA, which no run uses, and 64-bit ARM, on an emulated core."""

import json

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from benchmarks.arm import cross, step, tally
from benchmarks.arm.core import Core, in_place_of_this_machine
from benchmarks.cases.controllers import case as loops
from benchmarks.cases.operations import case as operations
from benchmarks.tables.roofline import ROWS
from lgvi_warp.engine.packets import Packets
from lgvi_warp.runs.settle import make_plan
from tests.support.tools import TURN, one, scene_of

pytestmark = pytest.mark.slow


def by_member(lanes, count):
    """Numbers of the state by member, (count, fields)."""
    return lanes.transpose(0, 2, 1).reshape(-1, lanes.shape[1])[:count]


def driven(name, **start):
    """A named vehicle under way."""
    return lw.Scene.named(name, start={"velocity": [1.0, 0.1, 0.05], "angular_velocity": [0.02, 0.01, 0.03]} | start)


FULL = scene_of(TURN @ np.diag((1.0, 2.0, 3.0)) @ TURN.T, net=1.0, moment=(0.0, 0.0, 1.0))
CUDA = {
    "psi_s": (FULL, "psi_s", "float64"),
    "psi_s float32": (FULL, "psi_s", "float32"),
    "rk4": (FULL, "rk4", "float64"),
    "remus_100": (driven("remus_100"), "rk4", "float64"),
    "bluerov2_heavy": (driven("bluerov2_heavy"), "rk4", "float64"),
    "controlled": (loops.remus(10), "rk4", "float64"),
}


@pytest.mark.parametrize("case", CUDA)
def test_a_kernel_compiles_for_cuda(case, tmp_path):
    # sm_90, without a GPU: the same code, one vehicle a packet.
    scene, method, dtype = CUDA[case]
    plan = make_plan(one(scene), method, h=0.01, t1=1.0, width=1, dtype=dtype)
    wp.compile_aot_module(plan.kernel.advance.kernel.module, arch=90, module_dir=str(tmp_path))
    (code,) = tmp_path.glob("*.cubin")
    assert code.stat().st_size > 10_000


needs_compiler = pytest.mark.skipif(bool(cross.missing()), reason=cross.REMEDY)
ARM = {
    "psi_s": (operations.speed.example(), "psi_s"),
    "rk4": (operations.speed.example(), "rk4"),
    "remus_100": (driven("remus_100"), "rk4"),
}


@needs_compiler
@pytest.mark.parametrize("processor", cross.PROCESSORS)
@pytest.mark.parametrize("case", ARM)
def test_code_for_arm_is_of_vectors(case, processor, tmp_path):
    """Hardly any arithmetic instruction of the kernel, in hot and cold parts, makes a single number."""
    scene, method = ARM[case]
    # Two registers a number, as by default there; REMUS 100 takes half as long to compile with one.
    plan = step.plan_of(scene, method, 0.01, registers=1 if case == "remus_100" else 2)
    found = tally.of_file(cross.image(plan, processor, tmp_path))
    # Enough for the share below to mean something: a step of REMUS 100 has 978 for Neoverse N1, the others more.
    assert found.vector > 500
    assert found.scalar < 0.02 * found.vector


@needs_compiler
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("case", ARM)
def test_an_emulated_arm_core_gives_the_same_vehicles(case, dtype, tmp_path):
    """The launch of the product, on an ARM core and here: equal but for the round-off of some hundred steps."""
    scene, method = ARM[case]
    there, steps = step.plan_of(scene, method, 0.01, dtype), 200
    here = make_plan(there.ensemble, method, h=0.01, t1=float(there.grid.times[-1]), dtype=dtype)
    core = Core(cross.image(there, step.PROCESSOR, tmp_path).read_bytes())
    mode = core.mode()
    with in_place_of_this_machine(core):
        packets = Packets(there, there.ensemble.select(0, there.ensemble.members))
        packets.launch(0, steps)
    assert core.mode() == mode  # which the kernel changes while it runs
    here.compile()
    native = Packets(here, here.ensemble.select(0, here.ensemble.members))
    start = native.state_lanes.view.copy()
    native.launch(0, steps)
    found, expected = (by_member(one.state_lanes.view, there.ensemble.members) for one in (packets, native))
    assert np.abs(expected - by_member(start, there.ensemble.members)).max() > 0.1
    # Each step adds a round-off of a few units of numbers up to 10, and errors of speeds grow with time in positions.
    eps = np.finfo(dtype).eps
    np.testing.assert_allclose(found, expected, rtol=0, atol=10 * eps * steps)
    assert not packets.outcome().status.any()


@needs_compiler
@pytest.mark.parametrize(("scene", "method"), [("paper", "psi_s"), ("remus_100", "rk4"), ("bluerov2_heavy", "rk4")])
def test_a_step_takes_no_more_operations_than_recorded(scene, method, tmp_path):
    """`python -m benchmarks table roofline` writes the record, and counts anew after a change."""
    recorded = {(one["scene"], one["method"]): one for one in json.loads(ROWS.read_text())}[scene, method]
    entry = operations.scenes()[scene]
    found = step.of_a_step(step.plan_of(entry[0], method, entry[2]), tmp_path)
    # Another version of the compiler may fuse a little more or less.
    assert found.operations <= 1.03 * recorded["operations"]
    assert found.instructions <= 1.05 * recorded["instructions"]
    assert found.slow <= recorded["slow"] + 1
