# SPDX-License-Identifier: Apache-2.0
"""Contact with the sea floor against the mechanics of a body on a slope, and against its twin."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.sea.twin.bottom_contact import BottomContact
from lgvi_warp.methods.method import PROGRAMS
from lgvi_warp.reference import advance
from lgvi_warp.reference.submaps import Body, start
from lgvi_warp.reference.terms.current import Current
from lgvi_warp.reference.terms.weight import Weight

GRAVITY, MASS, ADDED, NET, SLOPE = 10.0, 20.0, 10.0, 50.0, np.radians(20.0)
INERTIA = (2.0, 2.5, 3.0)
FEET = ((0.4, 0.4, 0.3), (0.4, -0.4, 0.3), (-0.4, 0.4, 0.3), (-0.4, -0.4, 0.3))
LANDER = lw.Vehicle(MASS, inertia=INERTIA, added_mass=(ADDED,) * 3, buoyancy=MASS * GRAVITY - NET)
# x along the fall of the slope, z into it.
DOWN = np.array([[np.cos(SLOPE), 0.0, -np.sin(SLOPE)], [0.0, 1.0, 0.0], [np.sin(SLOPE), 0.0, np.cos(SLOPE)]])


def lander(points=FEET, angle=SLOPE, **numbers):
    """A lander over a floor that falls to the north by an angle, 10 m deep at the origin."""
    edge = 10.0 + 1000.0 * np.tan(angle) * np.array([-1.0, 1.0])
    floor = lw.events.Floor(depth=np.stack([edge, edge], axis=1), origin=[-1000.0, -1000.0], spacing=[2000.0, 2000.0],
                            contact="rest")  # fmt: skip
    terms = [lw.terms.BottomContact(points=points, **numbers), lw.terms.Current(velocity=[0.1, 0.0, 0.0])]
    return lw.Scene(LANDER, lw.Environment(gravity=GRAVITY), terms=terms, events=[floor])


def on_slope(friction, current=0.0, height=0.3):
    """Members with these frictions and currents, whose feet are just above the slope."""
    count = len(friction)
    place = np.broadcast_to([0.0, 0.0, 10.0 - (height + 1e-3) / np.cos(SLOPE)], (count, 3))
    flow = np.zeros((count, 3))
    flow[:, 0] = current
    still = np.zeros((count, 3))
    numbers = {"bottom_contact.friction": np.array(friction), "current.velocity": flow}
    return lw.Ensemble.from_states(lander(), place, np.broadcast_to(DOWN, (count, 3, 3)), still, still, numbers)


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_rest_below_the_angle_of_friction_and_slide_above_it(method):
    # tan 20 deg = 0.364. Still water, and water that flows by without drag: friction is that of velocities over ground.
    fleet = on_slope([0.6, 0.2, 0.6, 0.2], [0.0, 0.0, 1.0, 1.0])
    result = lw.solve(fleet, method, h=0.02, t1=8.0, save=lw.SaveAt(every=1.0))
    assert result.status.counts() == {"ok": 4}
    ground = np.einsum("knij,knj->kni", result.attitude, result.velocity)
    # At rest after the fall of a millimetre: the oscillations of 8 s, 400 steps, are gone.
    # rk4 leaves the rotations a little, and the water's velocity is turned into the body and back.
    R = result.attitude[-1, ::2]
    assert np.abs(ground[-1, ::2]).max() < 1e-9 + np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max()
    assert np.abs(result.position[-1, ::2] - result.position[-2, ::2]).max() < 1e-9
    # g (sin a - mu cos a) apparent weight / (mass + added mass), to what is left of the oscillations.
    wanted = NET * (np.sin(SLOPE) - 0.2 * np.cos(SLOPE)) / (MASS + ADDED)
    along = ground @ DOWN[:, 0]
    np.testing.assert_allclose((along[-1] - along[5])[1::2] / 3.0, wanted, rtol=1e-6)
    # And in the plane of the floor.
    assert np.abs(ground[-1, 1::2] @ DOWN[:, 2]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.kernel
def test_kernel_and_twin():
    # A turning lander that comes down on one foot, and slides in a current.
    scene = lander(friction=0.3)
    h, steps = 0.02, 60
    R = DOWN @ lw.notation.matrix_from_rotation_vector(np.array([0.1, -0.15, 0.3]))
    b, nu, Om = np.array([0.5, -0.2, 9.75]), np.array([0.3, -0.1, 0.2]), np.array([0.1, -0.2, 0.15])
    u = np.array([0.1, 0.0, 0.0])
    fleet = lw.Ensemble.from_states(scene, b[None], R[None], nu[None], Om[None])
    result = lw.solve(fleet, "psi_s", h=h, t1=steps * h)
    term, p = scene.terms[0], fleet.parameters(0, 1)
    k, c = (float(x[0]) for x in term.stiffest(lw.Ensemble.own(term, p), p, h))
    law = BottomContact(points=np.array(FEET), stiffness=k, damper=c, friction=0.3, depth=10.0,
                        slope=np.array([np.tan(SLOPE), 0.0]))  # fmt: skip
    mass, net = (MASS + ADDED) * np.eye(3), Weight(net=NET)
    displaced = (MASS * GRAVITY - NET) / GRAVITY
    body = Body(mass, np.diag(INERTIA), (net, law, Current(velocity=u)), displaced - MASS, np.zeros(3), MASS)
    x = start(body, b, R, mass @ (nu - R.T @ u), np.diag(INERTIA) @ Om)
    x = advance.advance(x, body, PROGRAMS["psi_s"], h, steps)
    # 60 steps of round-off 1e-15, which contacts amplify: each step turns an oscillation by 1 rad.
    np.testing.assert_allclose(result.position[-1, 0], x.b, atol=1e-11)
    np.testing.assert_allclose(result.attitude[-1, 0], x.R, atol=1e-11)
    # It touched, and slid.
    assert np.any(result.position[-1, 0] - b - 1.2 * R @ nu > 0.01)


def test_the_twin_never_gains_energy():
    # A lander that falls from 0.3 m onto one foot, bounces and tumbles: kinetic energy, weight and springs together. Energy
    # of a step may grow by the error of one step of a spring that turns by 1 rad, and does not in sum.
    h, law = 0.01, None
    scene = lander(angle=0.0)
    p = {name: value[None] for name, value in scene.parameters().items()}
    k, c = (float(x[0]) for x in scene.terms[0].stiffest(lw.Ensemble.own(scene.terms[0], p), p, h))
    law = BottomContact(points=np.array(FEET), stiffness=k, damper=c, friction=0.5, depth=10.0, slope=np.zeros(2))
    body = Body((MASS + ADDED) * np.eye(3), np.diag(INERTIA), (Weight(net=NET), law))
    R = lw.notation.matrix_from_rotation_vector(np.array([0.3, -0.2, 0.1]))
    x = start(body, np.array([0.0, 0.0, 9.3]), R, np.zeros(3), np.zeros(3))
    energies = []
    for _ in range(60):
        x = advance.advance(x, body, PROGRAMS["psi_s"], h, 5)
        nu, Om = x.p / (MASS + ADDED), x.pi / np.array(INERTIA)
        sunk = [max(law.sunk(x.b + x.R @ arm), 0.0) for arm in law.points]
        energies.append(0.5 * (x.p @ nu + x.pi @ Om) - NET * x.b[2] + 0.5 * k * np.sum(np.square(sunk)))
    first, lost = energies[0], energies[0] - energies[-1]
    assert np.all(np.diff(energies) < 0.02 * lost)
    assert max(energies) == pytest.approx(first, abs=1e-2 * lost)
    assert lost > 10.0


def test_the_floor_is_as_hard_as_the_step_allows():
    scene = lander()
    p = {name: value[None] for name, value in scene.parameters().items()}
    own = lw.Ensemble.own(scene.terms[0], p)
    k, c = scene.terms[0].stiffest(own, p, 0.02)
    k2, c2 = scene.terms[0].stiffest(own, p, 0.01)
    np.testing.assert_allclose([k2 / k, c2 / c], [[4.0], [2.0]], rtol=1e-12)
    # On one point at the origin it is h^2 k = m.
    alone = lander(points=((0.0, 0.0, 0.0),))
    q = {name: value[None] for name, value in alone.parameters().items()}
    k, c = alone.terms[0].stiffest(lw.Ensemble.own(alone.terms[0], q), q, 0.1)
    np.testing.assert_allclose([k, c], [[(MASS + ADDED) / 0.01], [(MASS + ADDED) / 0.1]], rtol=1e-12)
    # As little damping as asked for, as long as a bounce gains nothing by the step: 0.08 (h w)^2 of what is critical.
    for stiffness, wanted in ((30.0, 0.08 * 0.01 * 60.0), (1e9, 0.08 * 600.0)):
        lively = lander(points=((0.0, 0.0, 0.0),), stiffness=stiffness, damping=0.0)
        q = {name: value[None] for name, value in lively.parameters().items()}
        assert lively.terms[0].stiffest(lw.Ensemble.own(lively.terms[0], q), q, 0.1)[1] == pytest.approx(wanted)
    # Softer where asked for, never harder.
    for stiffness, wanted in ((10.0, 10.0), (1e9, 3000.0)):
        softer = lander(points=((0.0, 0.0, 0.0),), stiffness=stiffness)
        q = {name: value[None] for name, value in softer.parameters().items()}
        assert softer.terms[0].stiffest(lw.Ensemble.own(softer.terms[0], q), q, 0.1)[0] == pytest.approx(wanted)


def test_refusals():
    floor = lw.events.Floor(depth=10.0)
    with pytest.raises(lw.SceneError, match=r"bottom_contact.floor.*needs a floor.*contact = \"rest\""):
        lw.Scene(LANDER, terms=[lw.terms.BottomContact(points=FEET)], events=[floor])
    rest = lw.events.Floor(depth=10.0, contact="rest")
    with pytest.raises(lw.SceneError, match=r"floor.contact.*has no term by which the vehicle rests"):
        lw.Scene(LANDER, events=[rest])
    other = lw.events.Floor(depth=12.0, contact="rest", name="mud")
    with pytest.raises(lw.SceneError, match=r"does not say which of 2 floors.*Name one: floor, mud"):
        lw.Scene(LANDER, terms=[lw.terms.BottomContact(points=FEET)], events=[rest, other])
    with pytest.raises(lw.SceneError, match=r"bottom_contact.floor = 'mid'"):
        lw.Scene(LANDER, terms=[lw.terms.BottomContact(points=FEET, floor="mid")], events=[rest])
