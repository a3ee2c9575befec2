# SPDX-License-Identifier: Apache-2.0
"""Damped bodies that come to rest: subnormal numbers are zero in the kernel, and kept everywhere else."""

import platform

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.engine.packets import Packets
from lgvi_warp.runs.settle import make_plan
from tests.support.tools import one, random_states, scene_of

pytestmark = pytest.mark.skipif(
    platform.machine().lower() not in ("x86_64", "amd64", "aarch64", "arm64"), reason="no such mode is known"
)

# Momenta fall by at least e^16 a second: in 60 s far below the least subnormal number of float64, e^-744.
FALL = lw.terms.Drag(linear=(300.0,) * 3 + (40.0,) * 3)
SCENE = scene_of((10.0, 12.0, 15.0), (1.0, 2.0, 2.5))
DAMPED = lw.Scene(SCENE.vehicle, SCENE.environment, terms=[FALL])


def lost_products():
    """Number of subnormal products of NumPy that are zero in this thread."""
    return sum(int((x * x == 0.0).sum()) for x in (np.full(64, 1e-20, np.float32), np.full(64, 1e-155)))


@pytest.mark.ci
@pytest.mark.parametrize(
    "dtype", ["float32", *(pytest.param(name, marks=pytest.mark.slow) for name in ("float64", "float32_compensated"))]
)
def test_a_body_comes_to_rest(dtype):
    fleet = one(DAMPED, *random_states(3, 16, 0.5, 0.5))
    plan = make_plan(fleet, "psi_s", h=0.02, t1=60.0, dtype=dtype)
    plan.compile()
    packets = Packets(plan, fleet.select(0, 16))
    assert lost_products() == 0
    packets.launch(0, plan.grid.steps)
    # This thread made the launch, and has its old mode again.
    assert lost_products() == 0
    momenta = np.abs(packets.state.numpy()[:, 12:18])
    tiny = np.finfo(momenta.dtype).smallest_normal
    # As small as they become, and none subnormal: a change that would be makes none.
    assert np.all(momenta < 1e3 * tiny)
    assert np.all((momenta == 0.0) | (momenta >= tiny))
