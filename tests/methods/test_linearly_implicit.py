# SPDX-License-Identifier: Apache-2.0
"""The linearly implicit method: its coefficients, orders, steady motion, strong damping, and the kernel against the twin."""

import itertools

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.engine.survey import frame_of
from lgvi_warp.measuring.comparison import Sample
from lgvi_warp.methods.tableaux import DOP853, RK4, RKW3
from lgvi_warp.reference import explicit, linearly_implicit
from lgvi_warp.reference.terms.drag import Drag, DragMatrix
from lgvi_warp.runs.settle import make_plan
from tests.laws import test_parity, test_remus_100
from tests.laws.cases import CASES, together
from tests.methods import test_coupled
from tests.methods.test_explicit import begun, ended
from tests.support.tools import difference, last, one, slope

METHOD = "rkw3"


def matrices():
    """a, g (4, 4) and b (4,)."""
    a, g = np.zeros((4, 4)), np.zeros((4, 4))
    for i in range(4):
        a[i, :i], g[i, : i + 1] = RKW3.a[i], RKW3.implicit[i]
    return a, g, np.array(RKW3.b)


def amplification(z, w):
    """Amplification of y' = lambda y over a step: z = h lambda, and w the h times the matrix that stands for lambda."""
    a, g, b = matrices()
    stages = np.linalg.solve(np.eye(4) - np.multiply.outer(z, a) - np.multiply.outer(w, g), np.ones((len(z), 4, 1)))
    return 1.0 + z * (stages[..., 0] @ b)


def test_order_3_whatever_the_matrix():
    # Conditions of W-methods, Hairer & Wanner II, IV.7: those of the explicit method, and zero for each tree with an edge g.
    a, g, b = matrices()
    one, c = np.ones(4), a @ np.ones(4)
    assert (RKW3.a, RKW3.b, RKW3.c) == (RK4.a, RK4.b, RK4.c)
    assert abs(b @ g @ one) < 1e-15
    for pair in itertools.product((a, g), repeat=2):
        exact = 1.0 / 6.0 if pair[0] is a and pair[1] is a else 0.0
        assert abs(b @ pair[0] @ pair[1] @ one - exact) < 1e-15
    assert abs(b @ c**2 - 1.0 / 3.0) < 1e-15


def test_stability():
    # L-stable with the true matrix; decay too where the matrix is from half to twice the true one.
    frequencies, rates = np.logspace(-3, 6, 400), -np.logspace(-3, 6, 400)
    assert np.abs(amplification(1j * frequencies, 1j * frequencies)).max() < 1.0 + 1e-12
    assert abs(amplification(rates[-1:], rates[-1:])[0]) < 2e-5  # falls as 1 / z
    for ratio in (0.5, 1.0, 1.5, 2.0):
        assert np.abs(amplification(rates, ratio * rates)).max() < 1.0
        assert np.abs(amplification(rates, rates / ratio)).max() < 1.0


SPEEDS = np.array([1.0, 0.6, 0.5, 0.8, 0.9, 0.7])
LIGHT = Drag(linear=0.1 * SPEEDS, quadratic=np.zeros(6))
STRONG = DragMatrix(linear=np.diag(60.0 * SPEEDS * (1, 1, 1, 0.1, 0.1, 0.1)), quadratic=np.zeros((6, 6)))
FULL = DragMatrix(linear=CASES["drag matrix"].laws[0].linear, quadratic=np.zeros((6, 6)))
SCENES = {
    "light": ((LIGHT,), (0.1, 0.05, 0.025)),
    "lift": ((FULL, *CASES["body lift"].laws), (0.04, 0.02, 0.01)),
    "strong": ((STRONG,), (0.02, 0.01, 0.005)),
}


@pytest.mark.slow_for("light", "strong")
@pytest.mark.parametrize("name", SCENES)
def test_order_of_the_twin(name):
    # Against DOP853 at a step where its error is below 1e-10. Coupled 6x6 inertia, about another origin; no |v| has a kink.
    laws, steps = SCENES[name]
    body = test_coupled.body_of(laws)
    x = begun(body, test_coupled.STATE)
    t1 = 4.0 * steps[0]
    truth = ended(explicit.advance(explicit.stepper(DOP853), x, body, steps[-1], round(t1 / steps[-1])), body)
    step = linearly_implicit.stepper(RKW3, np.array([0.03, -0.02, 0.05]))
    errors = [difference(ended(explicit.advance(step, x, body, h, round(t1 / h)), body), truth) for h in steps]
    # Light damping leaves little but the error of order 4 of the classical method.
    assert slope(steps, errors) > 2.9


def test_without_damping_it_is_the_classical_method():
    body = test_coupled.body_of(())
    x = begun(body, test_coupled.STATE)
    pair = [module.stepper(tableau)(x, body, 0.1) for module, tableau in ((explicit, RK4), (linearly_implicit, RKW3))]
    assert difference(*(ended(y, body) for y in pair)) < 1e-14
    fleet = lw.Ensemble.from_scene(test_coupled.scene_of(()))
    assert make_plan(fleet, METHOD, h=0.1, t1=1.0).spec == make_plan(fleet, "rk4", h=0.1, t1=1.0).spec


def both(scene, body, at, h, steps, **named):
    """The state after so many steps by the kernel and by the twin."""
    fleet = one(scene, **at)
    result = lw.solve(fleet, METHOD, h=h, t1=steps * h, **named)
    assert result.status.counts() == {"ok": 1}
    origin = frame_of(lw.Method(METHOD), fleet.parameters(0, 1))[0].origin[0]
    step = linearly_implicit.stepper(RKW3, origin)
    return last(result), ended(explicit.advance(step, begun(body, at), body, h, steps), body)


COUPLED = together("drag matrix", "current profile", "body lift", "wrench")


@pytest.mark.ci
@pytest.mark.parametrize(
    "named",
    [{"width": 1}, pytest.param({}, marks=pytest.mark.slow), pytest.param({"width": 4}, marks=pytest.mark.slow)],
)
def test_kernel_with_coupled_inertia(named):
    scene, body = test_coupled.scene_of(COUPLED.terms), test_coupled.body_of(COUPLED.laws)
    # Round-off of 1e-15 in each of 5 steps; a long step, so that the matrix is not that of the start's velocity.
    for h in (0.02, 0.2):
        assert difference(*both(scene, body, test_coupled.STATE, h, 5, **named)) < 5e-13


@pytest.mark.slow
@pytest.mark.parametrize(("dtype", "bound"), [("float64", 1e-12), ("float32", 1e-5)])
@pytest.mark.parametrize("names", [("drag",), ("drag", "wrench schedule", "waves"), ("cross-flow", "wrench noise")])
def test_kernel_with_laws(names, dtype, bound):
    # 25 steps of round-off 1e-15, or 6e-8, and little growth.
    case = together(*names)
    scene, body = test_parity.scene_of(case), test_parity.body_of(case)
    assert difference(*both(scene, body, test_parity.STATE, 0.02, 25, dtype=dtype)) < bound


RUDDER = test_remus_100.RUDDERS[0]


def remus(h, t1, velocity, method=METHOD):
    """Velocity (6,) of REMUS 100 in the plane at the end."""
    result = lw.solve(one(test_remus_100.plane_scene(RUDDER), nu=velocity[:3], Om=velocity[3:]), method, h=h, t1=t1)
    assert result.status.counts() == {"ok": 1}
    return np.concatenate(last(result)[2:])


@pytest.mark.ci
@pytest.mark.parametrize("h", [0.02, 0.2, 0.5])
def test_a_steady_turn_is_a_fixed_point(h):
    # From the way ahead: after 150 s the transient is exp(-0.17 t) = 1e-11, and the root is exact to 1e-13.
    u, v, r = test_remus_100.steady_turn(RUDDER)
    end = remus(h, 150.0, test_remus_100.ahead(test_remus_100.CRUISE))
    np.testing.assert_allclose(end[[0, 1, 5]], (u, v, r), rtol=1e-9)


@pytest.mark.slow
def test_a_turn_with_roll_is_a_fixed_point():
    # Of all six degrees of freedom, R turning; unstable in pitch, by less than exp(0.3 t).
    velocity, R = test_remus_100.turn_with_roll(RUDDER)
    scene = test_remus_100.turned_rudder({"buoyancy": test_remus_100.WEIGHT}, RUDDER)
    result = lw.solve(one(scene, R=R, nu=velocity[:3], Om=velocity[3:]), METHOD, h=0.2, t1=20.0)
    _, turned, nu, Om = last(result)
    assert np.abs(np.concatenate([nu, Om]) - velocity).max() < 1e-10
    assert np.abs(turned[2] - R[2]).max() < 1e-10


def falling(linear, quadratic, h, steps, method=METHOD, speed=0.0):
    """Velocity of a heavy body that falls with linear or quadratic drag, at each step."""
    drag = {"type": "drag_matrix", "linear": linear * np.eye(6), "quadratic": quadratic * np.eye(6)}
    body = lw.Vehicle(20.0, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=150.0)
    fleet = one(lw.Scene(body, lw.Environment(gravity=9.8), [drag]), nu=(0.0, 0.0, speed))
    return lw.solve(fleet, method, h=h, t1=steps * h, save=lw.SaveAt(every=h)).velocity[:, 0]


NET = 20.0 * 9.8 - 150.0


@pytest.mark.ci
def test_terminal_fall():
    # v' = (net - q v^2) / 45 kg: rate 2 q v / 45 = 6.4 1/s, so nothing is left of the start after 30 s.
    end = falling(0.0, 450.0, 0.2, 150)[-1]
    assert end[2] == pytest.approx(np.sqrt(NET / 450.0), rel=1e-13)


@pytest.mark.parametrize("number", [1e2, 1e4, 1e6])
def test_linear_drag_of_any_strength(number):
    # h rate = `number`: the first step leaves R(z) of the start, which falls as 12 / |z| with the true matrix.
    h, mass = 0.1, 45.0
    linear = number * mass / h
    apart = falling(linear, 0.0, h, 3, speed=2.0)[:, 2] - NET / linear
    assert abs(apart[1]) < 12.0 / number * abs(apart[0])
    assert abs(apart[2]) < 12.0 / number * abs(apart[1]) + 1e-15


# h q |v| / m = 20 for h = 0.2 s and 2 m/s.
QUADRATIC = 20.0 * 45.0 / (0.2 * 2.0)


def test_quadratic_drag_where_rk4_diverges():
    h, speed = 0.2, 2.0
    v = falling(0.0, QUADRATIC, h, 60, speed=speed)[:, 2]
    assert np.abs(v).max() == speed
    assert v[-1] == pytest.approx(np.sqrt(NET / QUADRATIC), rel=1e-6)


@pytest.mark.slow
def test_rk4_diverges_there():
    with np.errstate(all="ignore"):
        assert not np.abs(falling(0.0, QUADRATIC, 0.2, 20, "rk4", 2.0)).max() < 1e3


def test_studies_try_it_where_something_is_damped():
    for name, tried in (("drag", ["rk4", METHOD]), ("wrench", ["rk4"])):
        sample = Sample(lw.Ensemble.from_scene(test_parity.scene_of(CASES[name])), 1.0, 1)
        taken, refused = sample.accepted(["rk4", METHOD])
        assert taken == tried
        assert list(refused.values()) == ["method rkw3: in this scene it is rk4"] * (2 - len(tried))


def test_drag_has_no_limit_of_the_step():
    fleet = lw.Ensemble.from_scene(test_parity.scene_of(CASES["drag"]))
    rows = {m: make_plan(fleet, m, h=0.1, t1=1.0, checks="all").spec.warning_rows for m in (METHOD, "rk4")}
    assert "drag" in rows["rk4"]
    assert set(rows["rk4"]) - {"drag"} == set(rows[METHOD])
