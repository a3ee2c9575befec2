# SPDX-License-Identifier: Apache-2.0
"""The survey finds a kernel's features from all members, a few at a time."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common import machine
from lgvi_warp.engine.survey import COUPLINGS, SHAPES_OF_MASS, survey
from lgvi_warp.methods.method import Method
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.scene import slices
from tests.support.tools import scene_of

PLAIN = {"start.position": np.zeros((9, 3)), "start.attitude": np.broadcast_to(np.eye(3), (9, 3, 3))}


def fleet(scene, odd=4, **parameters):
    """Nine members that are the scene's, but for one: these of its parameters are its own."""
    base = scene.parameters()
    given = {name.replace("__", "."): value for name, value in parameters.items()}
    columns = {}
    for name, value in given.items():
        column = np.repeat(np.asarray(base[name], dtype=float)[None], 9, axis=0)
        column[odd] = value
        columns[name] = column
    still = np.zeros((9, 3))
    return lw.Ensemble.from_states(scene, still, PLAIN["start.attitude"], still, still, columns)


def seen(members, method="psi_s"):
    return survey(members, Method(method))


@pytest.fixture(params=(1, 4, 100))
def at_once(request, monkeypatch):
    """So many members are looked at together."""
    monkeypatch.setattr(slices, "AT_ONCE", request.param)


def test_one_odd_member_decides(at_once):
    ball = replace(scene_of((2.0, 2.0, 2.0)), terms=(lw.terms.Drag(),))
    none = seen(fleet(ball))
    assert SHAPES_OF_MASS[none.mass] == "isotropic"
    assert not (none.turned)
    assert not (none.bent)
    assert not (none.coupled)
    assert not (none.moved)
    assert not (none.felt)
    assert not (none.couplings)
    long = seen(fleet(ball, vehicle__added_mass=np.diag((0.0, 1.0, 1.0))))
    assert SHAPES_OF_MASS[long.mass] == "diagonal"
    assert not long.bent
    skew = seen(fleet(ball, vehicle__added_mass=[[1.0, 0.3, 0.0], [0.3, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    assert SHAPES_OF_MASS[skew.mass] == "full"
    assert skew.bent
    assert not skew.turned
    without_drag = fleet(scene_of((2.0, 2.0, 2.0)), vehicle__added_mass=np.ones((3, 3)) + np.eye(3))
    assert not seen(without_drag).bent
    turned = seen(fleet(ball, vehicle__inertia=[[2.0, 0.3, 0.0], [0.3, 3.0, 0.0], [0.0, 0.0, 4.0]]))
    assert turned.turned
    assert turned.bent
    assert seen(fleet(ball, vehicle__buoyancy=1.0)).buoyant
    heavy = fleet(ball, vehicle__buoyancy=1.0, vehicle__center_of_buoyancy=(0.0, 0.0, -0.1))
    assert seen(heavy).felt == {"weight", "restoring"}


def test_one_odd_member_is_coupled(at_once):
    vehicle = lw.Scene.named("remus_100").vehicle
    scene = lw.Scene(vehicle)
    added = np.array(vehicle.added_mass_matrix)
    added[0, 3] = added[3, 0] = 0.5
    others, odd = seen(fleet(scene), "psi_x"), seen(fleet(scene, vehicle__added_mass_matrix=added), "psi_x")
    assert others.couplings < odd.couplings <= set(range(len(COUPLINGS)))
    # What psi_s cannot have is told by its size.
    assert seen(fleet(scene, vehicle__added_mass_matrix=added)).residual_coupling > 1e-3


@pytest.mark.parametrize(("i", "j"), list(np.ndindex(3, 3)))
def test_each_coupling_alone_is_seen(i, j):
    """A velocity along axis i that is coupled with a rate about axis j is one entry of U, above its diagonal or on it."""
    rigid = np.diag([10.0, 10.0, 10.0, 0.5, 0.5, 0.5])
    added = np.diag([10.0, 20.0, 30.0, 0.5, 1.5, 2.0])
    added[i, 3 + j] = added[3 + j, i] = 0.7
    body = lw.Vehicle(rigid_body_mass_matrix=rigid, added_mass_matrix=added, weight=98.0, buoyancy=98.0)
    found = seen(lw.Ensemble.from_scene(lw.Scene(body)), "psi_x").couplings
    assert [COUPLINGS[number] for number in found] == [(min(i, j), max(i, j))]


def test_laws_that_one_member_feels(at_once):
    bare = scene_of()
    scene = lw.Scene(
        bare.vehicle, bare.environment, terms=[lw.terms.Drag(), lw.terms.Current(velocity=(0.0, 0.0, 0.0))]
    )
    assert not seen(fleet(scene)).felt
    one = seen(fleet(scene, drag__linear=(0.0, 0.0, 0.0, 0.0, 1.0, 0.0)))
    assert (one.felt, one.drag) == ({"drag"}, {"linear_torque"})
    level, rising = (seen(fleet(scene, current__velocity=v)) for v in ((0.1, 0.0, 0.0), (0.1, 0.0, 0.2)))
    assert level.felt == rising.felt == {"current"}
    assert not level.rising
    assert rising.rising == {"current"}


def test_parts_join_to_the_whole(monkeypatch):
    scene = lw.Scene(lw.Scene.named("remus_100").vehicle, terms=[lw.terms.Drag(quadratic=(1.0,) * 6)])
    vary = {
        "vehicle.added_mass_matrix": lw.distributions.Normal(relative=0.01),
        "drag.quadratic": lw.distributions.Uniform(relative=0.5),
    }
    members = lw.Ensemble(scene, 500, 3, vary)
    found = []
    for size in (7, 64, 1000):
        monkeypatch.setattr(slices, "AT_ONCE", size)
        found.append(seen(members, "psi_x"))
    assert found[0] == found[1] == found[2]


def test_the_first_unphysical_member_is_named_whatever_the_parts(at_once):
    masses = np.full(9, 50.0)
    masses[[5, 7]] = -1.0
    states = np.zeros((9, 3)), PLAIN["start.attitude"], np.zeros((9, 3)), np.zeros((9, 3))
    with pytest.raises(lw.SceneError, match=r"vehicle.mass of member 5 = .*-1.*\(2 of 9 members\)"):
        lw.Ensemble.from_states(scene_of(), *states, {"vehicle.mass": masses})


def test_memory_of_a_plan_does_not_grow_with_members(monkeypatch):
    monkeypatch.setattr(slices, "AT_ONCE", 512)
    members = lw.Ensemble(
        scene_of((1.0, 2.0, 3.0)), 60_000, 1, {"vehicle.inertia": lw.distributions.Normal(relative=0.01)}
    )
    make_plan(members.subset([0]), h=0.01, t1=0.1)  # the kernel's own
    tracemalloc.start()
    make_plan(members, h=0.01, t1=0.1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # A member's matrices, 36 numbers several times over; all of them together would be 17 MB for one copy of I6 alone.
    assert peak < machine.thread_count() * 512 * 36 * 8 * 16 + 1e6
