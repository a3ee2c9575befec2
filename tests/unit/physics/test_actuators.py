# SPDX-License-Identifier: Apache-2.0
"""Actuators and their allocation on the host: what is refused, curves and their inverses, and what actuators can make."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels.laws.thrust_curves import START_SIZE
from lgvi_warp.common.errors import SceneError
from lgvi_warp.control import efforts
from lgvi_warp.control.efforts import inverse_rows
from lgvi_warp.physics.terms.thrust_curves import side_of_table
from lgvi_warp.scene import plausibility

PAIR = dict(position=((-0.5, 0.2, 0.0), (-0.5, -0.2, 0.0)), direction=((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
TABLE = dict(table_commands=(-1.0, -0.2, 0.1, 1.0), table_thrusts=(-8.0, 0.0, 0.0, 20.0))
FIN = dict(position=((-0.6, 0.0, 0.0),), chord=((1.0, 0.0, 0.0),), normal=((0.0, 1.0, 0.0),), area=0.01, drag=0.02)
LIFT = dict(lift_angles=(0.0, 0.3, 1.6), lift_coefficients=(0.0, 0.9, 0.0))
WANTED = dict(guidance=[lw.control.SetPoint(depth=5.0, heading=0.0)])
HEADING, DEPTH = lw.control.HeadingPID(kp=5.0), lw.control.DepthPID(kp=0.1, kp_pitch=5.0)


def scene(terms, **controller):
    vehicle = lw.Vehicle(20.0, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, 25.0), buoyancy=196.0)
    return lw.Scene(vehicle, terms=terms, controller=lw.Controller(period=0.1, **WANTED, **controller))


def thrusters(**more):
    return lw.terms.Thrusters(**PAIR, **({"coefficient": (20.0, 20.0)} | more))


def fins(**more):
    return lw.terms.ControlFins(**FIN, **({"lift_slope": 3.0} | more))


FAULTY_TERMS = {
    "thrusters.table_commands = [0.0, 1.0] is given alone": lambda: thrusters(table_commands=(0.0, 1.0)),
    "does not rise from below 0 through 0": lambda: thrusters(**TABLE | {"table_thrusts": (-8.0, 0.0, 5.0, 4.0)}),
    "count commands from the neutral one": lambda: thrusters(**TABLE | {"table_thrusts": (-8.0, 1.0, 5.0, 7.0)}),
    "is given beside a table": lambda: thrusters(**TABLE, polynomial=(1.0, 2.0)),
    "torque_loss = [0.1, 0.1] is given without torque_coefficient": lambda: thrusters(torque_loss=0.1),
    "thrusters.rate_limit": lambda: thrusters(rate_limit=-1.0),
    "Give (n,) [N per unit^2], a table [N], or a polynomial [N]": lambda: lw.terms.Thrusters(**PAIR),
    "Give it [1/rad], or a table of lift": lambda: lw.terms.ControlFins(**FIN),
    "does not begin with no lift at 0": lambda: fins(lift_angles=(0.1, 0.3), lift_coefficients=(0.0, 0.9)),
    "control_fins.lift_angles = [0.0, 0.3] is given alone": lambda: fins(lift_angles=(0.0, 0.3)),
    "control_fins.flow_angle = 'no' is neither true nor false": lambda: fins(flow_angle="no"),
    "control_fins.time_constant": lambda: fins(time_constant=-0.1),
}


@pytest.mark.parametrize("text", FAULTY_TERMS)
def test_faulty_numbers(text):
    with pytest.raises(SceneError) as error:
        FAULTY_TERMS[text]()
    assert text in str(error.value)


POLYNOMIAL = dict(polynomial=(3.0, 10.0), coefficient=None)
FAULTY_LOOPS = {
    "controller.laws = 'depth_pid': asks for M, of which thrusters can make nothing": lambda: scene(
        [thrusters()], laws=[DEPTH]
    ),
    "thrusters.limit": lambda: scene([thrusters(**POLYNOMIAL)], laws=[HEADING]),
    "Give 2, one for each channel of thrusters": lambda: scene(
        [thrusters()], laws=[HEADING], allocation=[lw.control.PseudoInverse(to="thrusters", weights=(1.0, 1.0, 1.0))]
    ),
    "fault.known = 1 is neither true nor false": lambda: lw.control.Fault(of="thrusters", known=1),
    "has 5 channels with known faults. Let at most 4 be known": lambda: scene(
        [lw.terms.ControlWrench()],
        laws=[HEADING],
        faults=[lw.control.Fault(name=f"f{i}", of="control_wrench", channel=i, known=True) for i in range(5)],
    ),
    "has commands of its own": lambda: scene([thrusters(command=0.5)], laws=[HEADING]),
}


@pytest.mark.parametrize("text", FAULTY_LOOPS)
def test_faulty_loops(text):
    with pytest.raises(SceneError) as error:
        FAULTY_LOOPS[text]()
    assert text in str(error.value)


def test_what_actuators_cannot_make_is_said():
    # Two thrusters ahead make X and N. A law that asks for all six gets these two.
    class Everything(lw.laws.ControlLaw):
        type = "everything"
        device = None

    assert scene([thrusters()], laws=[HEADING]).controller.unspanned == ()
    both = scene([thrusters()], laws=[HEADING, Everything()])
    assert both.controller.unspanned == ("Y", "Z", "K", "M")
    messages = [
        plausibility.of_ensemble(lw.Ensemble.from_scene(one)).messages(1)
        for one in (both, scene([thrusters()], laws=[HEADING]))
    ]
    assert messages[0][-1].startswith("controller.allocation: actuators cannot make Y, Z, K, M as the laws ask")
    assert not any(text.startswith("controller") for text in messages[1])


def test_a_fin_makes_a_moment_whatever_else_it_makes():
    # A rudder pushes sideways as well: the laws do not ask for that, so all of N counts as delivered.
    assert scene([fins()], laws=[HEADING]).controller.unspanned == ()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_sides_of_a_table(side):
    term = thrusters(**TABLE)
    at, values = side_of_table(term.table_commands[None], term.table_thrusts[None, :, 0], side)
    assert (at[0].min(), values[0].min()) == ((0.1, 0.0) if side > 0.0 else (0.2, 0.0))
    assert np.all(np.diff(values) >= 0.0)
    assert values.max() == (20.0 if side > 0.0 else 8.0)


def test_thrust_and_command_of_a_table():
    term = thrusters(**TABLE, coefficient_astern=(0.5, 1.0), dead_band=0.1, limit=1.5)
    commands = np.array([0.65, -0.7])
    thrust = term.thrust(commands)
    np.testing.assert_allclose(thrust, [20.0 * 20.0 * 0.45 / 0.9, -8.0 * 0.4 / 0.8], rtol=1e-14)
    np.testing.assert_allclose(term.command_for(thrust), commands, rtol=1e-14)
    np.testing.assert_array_equal(term.command_for(0.0), 0.0)


def test_the_inverse_of_a_polynomial():
    # The first rises to its reach, the second turns at 0.5, where it is 0.25, the third only falls.
    rows = inverse_rows(np.array([[1.0, 3.0], [1.0, -1.0], [-1.0, 0.0]]), np.array([2.0, 2.0, 2.0]))
    np.testing.assert_allclose(rows[:2, 1:3], [[14.0, 2.0], [0.25, 0.5]], rtol=1e-15)
    assert rows[2, 0] == rows[2, 1] == 0.0
    assert rows.shape == (3, 4 + START_SIZE)
    assert efforts.START_SIZE == START_SIZE
    s = np.linspace(0.0, 1.0, 101)
    start = np.polynomial.polynomial.polyval(2.0 * s - 1.0, rows[:2, 4:].T)
    exact = np.sqrt(1.0 + 12.0 * 14.0 * (1.0 - (1.0 - s**2) ** 2)) - 1.0, 3.0 * (1.0 - (1.0 - s**2))
    # What a polynomial of this degree leaves: A step of Halley's cubes it. The second inverse is a polynomial itself.
    np.testing.assert_allclose(start[0], exact[0] / 6.0, atol=3e-4)
    np.testing.assert_allclose(start[1], exact[1] / 6.0, atol=1e-9)


def test_the_inverse_of_bluerov2s_polynomial():
    """The kernel's way: the start, and a step of Halley's."""
    curve = np.array([8.9, 0.0, 176.0, 0.0, -404.1, 0.0, 389.9, 0.0, -140.3])
    value, slope = np.polynomial.Polynomial([0.0, *curve]), np.polynomial.Polynomial([0.0, *curve]).deriv()
    (inverse, most, top, floor, *start) = inverse_rows(curve[None], np.ones(1))[0]
    t = most * np.linspace(0.0, 1.0, 2001)
    w = np.clip(np.polynomial.Polynomial(start)(2.0 * np.sqrt(1.0 - np.sqrt(1.0 - t * inverse)) - 1.0), 0.0, top)
    short, steep = t - value(w), np.maximum(slope(w), floor)
    w = np.clip(w + short * steep / np.maximum(steep**2 + 0.5 * short * slope.deriv()(w), 0.5 * steep**2), 0.0, top)
    assert np.abs(value(w) - t).max() < 1e-8 * most
    # The polynomial turns before its limit: beyond the largest thrust the command is that of the turn.
    assert 0.97 < w[-1] < 0.972
    assert abs(slope(w[-1])) < 1e-6 * most


def test_effect_of_a_table_of_lift():
    # Its slope at 0, 3 per rad, times the factor.
    plain, table = fins(lift_slope=6.0), fins(lift_slope=2.0, **LIFT)
    numbers = [{key: value[None] for key, value in term.parameters().items()} for term in (plain, table)]
    water = {"environment.water_density": np.array([1025.0])}
    each = [term.effect(own, water, np.array([1.5])) for term, own in zip((plain, table), numbers, strict=True)]
    np.testing.assert_allclose(each[0], each[1], rtol=1e-15)


def test_absent_numbers_are_no_parameters():
    # A scene without the new numbers has the same parameters, file and device code as before there were any.
    schedule = dict(times=(0.0, 1.0), command_schedule=((0.0, 0.0), (1.0, 1.0)))
    for term, device in ((thrusters(**schedule), "thrusters_with:scheduled"), (fins(), "fins")):
        assert term.device_in(True) == device
        new = ("table", "advance", "torque", "lift_a", "lift_c", "flow", "rate_limit", "time_constant")
        given = {key for key in term.to_dict() if key.startswith(new)}
        assert given == ({"rate_limit"} if device == "fins" else {"time_constant"})


@pytest.mark.parametrize(
    ("has", "varied"), [({"time_constant": 0.2}, "rate_limit"), ({"rate_limit": 5.0}, "time_constant")]
)
def test_members_bring_in_no_lag_or_limit_that_the_scene_has_not(has, varied):
    looped = scene([lw.terms.ControlWrench(**has)], laws=[HEADING])
    with pytest.raises(SceneError, match=f"control_wrench.{varied} = .* does not act: the scene has none. Give"):
        lw.Ensemble(looped, 4, 1, {f"control_wrench.{varied}": lw.distributions.Uniform(low=1.0, high=2.0)})


def test_one_number_stands_for_thrusters_alike():
    place = {"position": ((0.0, 0.2, 0.0), (0.0, -0.2, 0.0)), "direction": ((1.0, 0.0, 0.0),) * 2, "command": 1.0}
    alike, each = lw.terms.Thrusters(**place, coefficient=9.0), lw.terms.Thrusters(**place, coefficient=(9.0, 9.0))
    assert alike.to_dict() == each.to_dict()
    with pytest.raises(lw.SceneError, match=r"^thrusters.coefficient = .* has shape \(3,\). Give 2 numbers"):
        lw.terms.Thrusters(**place, coefficient=(9.0, 9.0, 9.0), coefficient_astern=1.0)
