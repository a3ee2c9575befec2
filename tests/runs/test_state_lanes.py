# SPDX-License-Identifier: Apache-2.0
"""States that the kernel packs have the bits of its twin in NumPy, whatever varies, in every frame, width and type."""

import inspect
import itertools

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels.packing.states import PLACES
from lgvi_warp.distributions import Normal, UniformRotation
from lgvi_warp.engine.packing import Packing
from lgvi_warp.engine.state_lanes import StateLanes, kernel_of
from lgvi_warp.engine.states import Starts
from lgvi_warp.engine.step_warnings import at_start, possible
from lgvi_warp.physics import notation
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.terms import Current, Drag

pytestmark = pytest.mark.kernel

COUPLED = lw.Vehicle(
    rigid_body_mass_matrix=np.diag([10.0, 10.0, 10.0, 1.0, 2.0, 2.5]),
    added_mass_matrix=np.array(
        [
            [3.0, 0.1, 0.2, 0.0, 0.3, 0.1],
            [0.1, 9.0, 0.3, 0.2, 0.0, 0.4],
            [0.2, 0.3, 8.0, 0.1, 0.2, 0.0],
            [0.0, 0.2, 0.1, 0.5, 0.05, 0.02],
            [0.3, 0.0, 0.2, 0.05, 0.6, 0.03],
            [0.1, 0.4, 0.0, 0.02, 0.03, 0.7],
        ]
    ),
    center_of_buoyancy=[0.0, 0.0, -0.02],
    buoyancy=99.0,
)
START = lw.Start(position=[1.0, -2.0, 3.0], velocity=[1.0, 0.2, -0.1], angular_velocity=[0.1, 0.2, -0.3])
SCENES = {
    "paper": lw.Scene.named("nordkvist_sanyal", start=START),
    "remus_100": lw.Scene.named("remus_100", start=START),
    "bluerov2_heavy": lw.Scene.named("bluerov2_heavy", start=START),
    "coupled": lw.Scene(COUPLED, start=START),
    "carried": lw.Scene(COUPLED, terms=[Current(velocity=[0.3, -0.2, 0.1])], start=START),
}
VARIED = {
    "nothing": {},
    "starts": {
        "start.position": Normal(std=1.0),
        "start.velocity": Normal(std=0.1),
        "start.angular_velocity": Normal(std=0.1),
        "start.attitude": UniformRotation(),
    },
    "a number": {"start.velocity[1]": Normal(std=0.1)},
    "inertia": {"inertia": Normal(relative=0.01), "start.angular_velocity": Normal(std=0.1)},
}


def drawn(name, varied, members):
    """An ensemble in which these vary."""
    scene = SCENES[name]
    full = "vehicle.rigid_body_mass_matrix" in scene.parameters()
    of_inertia = "vehicle.added_mass_matrix" if full else "vehicle.mass"
    vary = {(of_inertia if key == "inertia" else key): value for key, value in VARIED[varied].items()}
    return lw.Ensemble(scene, members, 3, vary)


@pytest.mark.ci
@pytest.mark.parametrize("dtype", ["float64", "float32", "float32_compensated"])
@pytest.mark.parametrize("method", ["psi", "psi_s", "psi_x", "rk4", lw.Method("rk5", rtol=1e-6, atol=1e-6)])
@pytest.mark.parametrize("name", SCENES)
def test_the_kernel_has_the_bits_of_its_twin(name, method, dtype):
    if method in ("psi", "psi_s") and name in ("remus_100", "coupled", "carried"):
        pytest.skip("the method takes no coupled vehicle")
    if method not in ("psi", "psi_s", "psi_x") and dtype == "float32_compensated":
        pytest.skip("the method has no compensated sums")
    # One packet, one that is padded, and several.
    for varied, members in itertools.product(VARIED, (1, 8, 21)):
        fleet = drawn(name, varied, members)
        plan = make_plan(fleet, method, h=0.01, t1=0.01, dtype=dtype, width=8)
        starts = Packing(plan, fleet.select(0, members)).starts()
        both = [
            StateLanes(plan.spec, -(-members // 8), kernel)
            for kernel in (kernel_of(plan.spec.width, plan.spec.real), None)
        ]
        for lanes in both * 2:  # few members are packed by the kernel from the second time on
            lanes.write(starts, members)
        assert both[0].peaks is not None
        assert both[1].peaks is None
        found, expected = (lanes.view.tobytes() for lanes in both)
        assert found == expected, (varied, members)
        assert np.isfinite(both[0].view).all()


@pytest.mark.ci
@pytest.mark.parametrize("width", [1, 2, 4, 16, 32])
def test_every_part_of_a_start_in_every_width(width):
    """Shared and individual parts of a start, in all of 2^5 forms; numbers that are none stay none."""
    rng, members = np.random.default_rng(width), 2 * width + 1
    plan = make_plan(lw.Ensemble(SCENES["paper"], members), "psi_s", h=0.01, t1=0.01, width=width, dtype="float32")
    both = [StateLanes(plan.spec, 3, kernel) for kernel in (kernel_of(plan.spec.width, plan.spec.real), None)]

    def numbers(local, *shape):
        return rng.normal(size=(members if local else 1, *shape))

    for turned, shifted, carried, full, inertial in itertools.product((False, True), repeat=5):
        own = rng.integers(2, size=8).astype(bool)
        R = numbers(own[0], 3, 3)
        R[0, 1, 1] = np.nan
        starts = Starts(
            R, numbers(own[1], 3), numbers(own[2], 3), numbers(own[3], 3),
            water=numbers(True, 3) if carried else None,
            axes=numbers(own[4], 3, 3) if turned else None,
            origin=numbers(own[5], 3) if shifted else None,
            mass=None if full else numbers(own[6], 3),
            moments=numbers(own[6], 3),
            inertia=numbers(own[6], 6, 6) if full else None,
            scale=np.abs(numbers(own[7])),
            inertial=inertial,
        )  # fmt: skip
        for lanes in both * 2:  # few members are packed by the kernel from the second time on
            lanes.write(starts, members)
        found, expected = (lanes.view for lanes in both)
        np.testing.assert_array_equal(found, expected)


def test_the_order_of_what_a_start_is_made_of():
    """The kernel finds each kind of numbers in the row of its name."""
    assert tuple(inspect.signature(Starts).parameters)[:-1] == PLACES[:-1]


def test_numbers_that_lie_apart_in_memory_are_found():
    """Columns of a larger table, and rows in steps."""
    rng, members = np.random.default_rng(0), 13
    plan = make_plan(lw.Ensemble(SCENES["paper"], members), "psi_s", h=0.01, t1=0.01, width=8)
    table = rng.normal(size=(2 * members, 20))[::2]
    attitudes = rng.normal(size=(members, 4, 4))[:, :3, :3]
    starts = Starts(attitudes, table[:, 3:6], table[:, 1:10:4], table[:, 19:16:-1], None, None, None, table[:, 7:10],
                    table[:, 8:11], None, table[:, 0], False)  # fmt: skip
    both = [StateLanes(plan.spec, 2, kernel) for kernel in (kernel_of(plan.spec.width, plan.spec.real), None)]
    for lanes in both * 2:
        lanes.write(starts, members)
    np.testing.assert_array_equal(both[0].view, both[1].view)


DAMPED = lw.Scene.named(
    "nordkvist_sanyal", terms=[Drag(linear=(5.0,) * 6, quadratic=(30.0, 60.0, 60.0, 3.0, 3.0, 3.0))], start=START
)
TORPEDO = lw.Scene.named("torpedo", start=START)


@pytest.mark.parametrize("method", ["psi", "psi_x", "rk4"])
@pytest.mark.parametrize(
    ("scene", "numbers"),
    [
        (SCENES["paper"], "vehicle.mass"),
        (SCENES["remus_100"], "drag_matrix.quadratic"),
        (SCENES["bluerov2_heavy"], "drag.quadratic"),
        (SCENES["carried"], "vehicle.buoyancy"),
        (DAMPED, "drag.linear"),
        (TORPEDO, "vehicle.buoyancy"),
    ],
)
def test_bounds_never_hide_a_warning(scene, numbers, method):
    """Members from slow to fast and with longer and longer steps: where no warning is told to be possible, none is given."""
    rng, members, seen = np.random.default_rng(5), 24, set()
    if method == "psi" and scene in (SCENES["remus_100"], SCENES["carried"], TORPEDO):
        method = "psi_w"
    value = scene.parameters().get(numbers)
    for h, size in itertools.product((1e-3, 0.05, 1.0), (1e-2, 1.0, 30.0)):
        velocity, rate = (size * rng.normal(size=(members, 3)) for _ in range(2))
        own = (
            {} if value is None else {numbers: value * np.exp(rng.normal(size=members)).reshape(-1, *[1] * value.ndim)}
        )
        attitude, place = np.repeat(np.eye(3)[None], members, axis=0), 10.0 * rng.normal(size=(members, 3))
        try:
            fleet = lw.Ensemble.from_states(scene, place, attitude, velocity, rate, own)
            plan = make_plan(fleet, method, h=h, t1=h, width=8)
        except lw.SceneError:  # the method does not take the scene, or not with such drag
            continue
        packing = Packing(plan, fleet.select(0, members))
        lanes = StateLanes(plan.spec, 3, kernel_of(8, plan.spec.real))
        for _ in range(2):
            lanes.write(packing.starts(), members)
        momentum = lanes.rows()[:, 12:15] * packing.scale[:, None]
        bits, _ = at_start(plan, packing.members, packing.frame, momentum, packing.water)
        told = not possible(plan, packing.members, packing.frame, lanes.peaks.max(axis=(0, 2)))
        assert not (told and bits.any())
        seen.add((told, bool(bits.any())))
    # Calm starts are told, and starts that warn are met.
    assert {(True, False), (False, True)} <= seen


def test_bounds_know_the_point_about_which_a_damped_vehicle_swings():
    """An explicit method keeps the user's origin, and a buoyant vehicle swings about its mass, half a metre off."""
    lever = notation.hat(np.array([[0.5, 0.0, 0.0]]))[0]
    rigid = np.block([[20.0 * np.eye(3), -20.0 * lever], [20.0 * lever, np.eye(3) - 20.0 * lever @ lever]])
    vehicle = lw.Vehicle(rigid_body_mass_matrix=rigid, weight=196.0, center_of_gravity=[0.5, 0.0, 0.0], buoyancy=784.0)
    scene = lw.Scene(vehicle, terms=[Drag(linear=(0.1,) * 6)])
    seen = set()
    for h in np.geomspace(0.005, 0.2, 24):
        plan = make_plan(lw.Ensemble(scene), "rk4", h=h, t1=h, width=8)
        packing = Packing(plan, plan.ensemble.select(0, 1))
        lanes = StateLanes(plan.spec, 1, kernel_of(8, plan.spec.real))
        for _ in range(2):  # few members take the kernel from the second time on
            lanes.write(packing.starts(), 1)
        momentum = lanes.rows()[:, 12:15] * packing.scale[:, None]
        bits, _ = at_start(plan, packing.members, packing.frame, momentum, packing.water)
        told = not possible(plan, packing.members, packing.frame, lanes.peaks.max(axis=(0, 2)))
        assert not (told and bits.any())
        seen.add((told, bool(bits.any())))
    assert seen >= {(True, False), (False, True)}
