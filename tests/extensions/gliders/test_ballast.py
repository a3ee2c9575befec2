# SPDX-License-Identifier: Apache-2.0
"""Ballast and buoyancy engines that lift a body straight up and down, against closed forms and against SciPy's events."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lgvi_warp as lw
from tests.laws import test_parity
from tests.laws.cases import CASES
from tests.methods import test_explicit
from tests.support.refusals import refused, says
from tests.support.tools import difference, one, slope

GRAVITY, DENSITY = 9.8, 1000.0
WEIGHT = DENSITY * GRAVITY
MASS, ADDED = 20.0, 25.0
BODY = lw.Vehicle(MASS, inertia=(1.5, 4.0, 4.5), added_mass=(5.0, 22.0, ADDED), buoyancy=MASS * GRAVITY)
PUMP = dict(pump_rate=4e-5, volume_down=-1e-4, volume_up=2e-4)


def falling(*terms, speed=0.0, depth=10.0, vehicle=BODY, **sections):
    """A neutral body, upright, that goes down at a speed."""
    start = lw.Start(position=[0.0, 0.0, depth], velocity=[0.0, 0.0, speed])
    return lw.Scene(vehicle, lw.Environment(GRAVITY, DENSITY), terms=list(terms), start=start, **sections)


def depths(result):
    return result.position[:, :, 2]


# From 2e-4 m3 down to -1e-4 and back at 4e-5 m3/s: 7.5 s each.
STEPS = dict(times=(1.0, 1.5, 12.0, 12.5), command_schedule=((2e-4,), (-1e-4,), (-1e-4,), (2e-4,)))


def volume_of_steps(t):
    """Volume that a pump moves for them: within 0.5 s the command goes faster than it, from then on it follows at its rate."""
    down = np.clip(2e-4 - 4e-5 * (t - 1.0), -1e-4, 2e-4)
    return np.where(t < 12.0, down, np.clip(-1e-4 + 4e-5 * (t - 12.0), -1e-4, 2e-4))


def fallen(volume, t, speed):
    """Depth and speed of a body from 10 m, by quadrature of its weight in water at Gauss points of each second."""
    times = np.arange(0.0, t + 0.25, 0.5)
    nodes, weights = np.polynomial.legendre.leggauss(4)
    at = (times[:-1, None] + 0.25 * (nodes + 1.0)).ravel()
    pull = -WEIGHT * volume(at) / (MASS + ADDED) * np.tile(0.25 * weights, len(times) - 1)
    return 10.0 + speed * t + (t - at) @ pull, speed + pull.sum()


@pytest.mark.ci
@pytest.mark.kernel
def test_a_pump_follows_its_schedule():
    # Kinks at whole seconds: rk4 is exact for forces that are linear in time, and no step crosses one.
    result = lw.solve(falling(lw.terms.Ballast(rate_limit=4e-5, **STEPS), speed=0.3), "rk4", h=0.5, t1=24.0)
    depth, speed = fallen(volume_of_steps, 24.0, 0.3)
    np.testing.assert_allclose(depths(result)[-1, 0], depth, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(result.velocity[-1, 0, 2], speed, rtol=0.0, atol=1e-13)


@pytest.mark.ci
@pytest.mark.kernel
def test_two_ballasts_at_once_are_their_sum():
    half = {"times": STEPS["times"], "command_schedule": 0.5 * np.array(STEPS["command_schedule"])}
    pair = [
        lw.terms.Ballast(name=name, rate_limit=2e-5, position=[[x, 0, 0]], **half)
        for name, x in (("a", 0.4), ("b", -0.4))
    ]
    whole = lw.solve(falling(lw.terms.Ballast(rate_limit=4e-5, **STEPS)), "rk4", h=0.5, t1=24.0)
    parts = lw.solve(falling(*pair), "rk4", h=0.5, t1=24.0)
    np.testing.assert_allclose(depths(parts), depths(whole), rtol=0.0, atol=1e-13)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_volume_stays_within_its_limit():
    held = lw.solve(falling(lw.terms.Ballast(command=[5e-4], limit=[2e-4])), "psi_s", h=0.1, t1=4.0)
    np.testing.assert_allclose(
        depths(held)[-1, 0], 10.0 - 0.5 * WEIGHT * 2e-4 / (MASS + ADDED) * 16.0, rtol=0.0, atol=1e-12
    )


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
@pytest.mark.parametrize("lag", [0.0, 0.7])
def test_a_controller_drives_it_as_it_drives_a_force(method, lag):
    # The same force by an ideal actuator, with limits of force for limits of volume: the pump is at its limits for a while.
    law = lw.control.HeavePID(kp=3.0, ki=0.05, kd=20.0)
    limits, rates = np.full(6, 1e6), np.full(6, 1e6)
    limits[2], rates[2] = 3e-4 * WEIGHT, 4e-5 * WEIGHT
    actuators = {
        "ballast": lw.terms.Ballast(limit=[3e-4], rate_limit=[4e-5], time_constant=[lag]),
        "control_wrench": lw.terms.ControlWrench(limit=limits, rate_limit=rates, time_constant=[lag] * 6),
    }
    ends = []
    for name, actuator in actuators.items():
        controller = lw.Controller(
            period=0.5,
            guidance=[lw.control.SetPoint(depth=12.0)],
            laws=[law],
            allocation=[lw.control.PseudoInverse(to=name)],
        )
        ends.append(
            lw.solve(falling(actuator, controller=controller), method, h=0.1, t1=30.0, save=lw.SaveAt(every=1.0))
        )
    np.testing.assert_allclose(depths(ends[0]), depths(ends[1]), rtol=0.0, atol=1e-11)
    assert np.ptp(depths(ends[0])) > 1.0


SWAYING = lw.Start(
    position=[0.0, 0.0, 10.0],
    rotation_vector=[0.3, -0.4, 0.8],
    velocity=[1.2, 0.3, -0.2],
    angular_velocity=[0.3, -0.4, 0.5],
)
RAMP = lw.terms.Ballast(position=[[0.4, 0.05, 0.1]], times=[-1.0, 9.0], command_schedule=[[-3e-4], [6e-4]])


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize(("method", "order"), [("rk4", 4.0), ("psi_s", 2.0)])
def test_a_schedule_keeps_the_order(method, order):
    steps, scene = (0.1, 0.05, 0.025), replace(falling(RAMP), start=SWAYING)
    truth = lw.solve(scene, "rk8", h=0.0125, t1=2.0)
    ends = [lw.solve(scene, method, h=h, t1=2.0) for h in steps]
    errors = [np.abs(end.position[-1] - truth.position[-1]).max() for end in ends]
    assert abs(slope(steps, errors) - order) < 0.2


@pytest.mark.ci
@pytest.mark.kernel
def test_a_constant_volume_conserves_energy():
    # As much buoyancy as weight: so it does not gain speed for ever.
    pair = lw.terms.Ballast(position=[[0.4, 0.05, 0.1], [-0.3, 0.0, 0.3]], command=[3e-4, -3e-4])
    scene = replace(falling(pair), start=SWAYING)
    assert "energy" in scene.terms[0].conserves
    save = lw.SaveAt(every=0.2)
    result = lw.solve(scene, "psi_s", h=0.02, t1=20.0, save=save)
    error = result.energy - result.energy[0]
    # Of order 2 and bounded: half the step, a quarter of it; and no more in the second half of the run than in the first.
    finer = lw.solve(scene, "psi_s", h=0.01, t1=20.0, save=save)
    ratio = np.abs(error).max() / np.abs(finer.energy - finer.energy[0]).max()
    assert 3.5 < ratio < 4.5
    assert np.abs(error[len(error) // 2 :]).max() < 1.5 * np.abs(error[: len(error) // 2]).max()


def engine(**numbers):
    return lw.terms.BuoyancyEngine(**PUMP | {"depth_top": 5.0, "depth_bottom": 12.0} | numbers)


def turned_at_bottom(t, speed, bottom=12.0):
    """Depth and speed of a body without weight until it comes to the bottom; there the pump begins."""
    met = (bottom - 10.0) / speed
    s, full = t - met, PUMP["volume_up"] / PUMP["pump_rate"]
    pull = WEIGHT / (MASS + ADDED)
    ramp, rest = min(s, full), max(s - full, 0.0)
    lost = pull * PUMP["pump_rate"] * ramp**2 / 2.0
    depth = bottom + speed * s - pull * PUMP["pump_rate"] * ramp**3 / 6.0 - lost * rest
    return depth - 0.5 * pull * PUMP["volume_up"] * rest**2, speed - lost - pull * PUMP["volume_up"] * rest


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("carried", [0.0, 0.2], ids=["still", "carried"])
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_the_turn_is_within_the_step(method, carried):
    # At constant speed the time of the turn is exact, wherever in the step: what is left is the impulse of one ramp that
    # begins within a step, at most an eighth of q h^2, and of one that ends so.
    h, speed = 0.5, np.array([0.31, 0.37, 0.43, 0.49])
    # A current downward, in which the body goes down by itself as well.
    current = [lw.terms.Current(velocity=[0.0, 0.0, carried])] if carried else []
    scene = falling(engine(volume_down=0.0, volume_start=0.0), *current)
    fleet = one(scene, b=(0.0, 0.0, 10.0), nu=[(0.0, 0.0, w) for w in speed])
    result = lw.solve(fleet, method, h=h, t1=20.0)
    exact = np.array([turned_at_bottom(20.0, w) for w in speed])
    bound = WEIGHT / (MASS + ADDED) * PUMP["pump_rate"] * h**2 / 8.0
    assert np.abs(result.velocity[-1, :, 2] - exact[:, 1]).max() < 2.0 * bound
    assert np.abs(depths(result)[-1] - exact[:, 0]).max() < 2.0 * bound * 16.0
    # A turn at the step's end would be late by half a step in the mean: q h / 2 times the time after it.
    late = WEIGHT / (MASS + ADDED) * PUMP["pump_rate"] * 0.5 * h * 5.0
    assert late > 10.0 * bound


def cycles(begun, t1):
    """Depth of a body with an engine, by DOP853 from turn to turn and from full to full volume, each found as an event."""
    n = engine()
    t, side, y, turns = 0.0, -1.0, np.array([begun, 0.0, float(n.volume_start)]), 0
    while t < t1:
        goal = float(n.volume_up if side > 0.0 else n.volume_down)
        rate = float(n.pump_rate) * np.sign(goal - y[2]) if abs(goal - y[2]) > 1e-15 else 0.0

        def motion(_, y, rate=rate):
            return [y[1], -WEIGHT * y[2] / (MASS + ADDED), rate]

        def meets(_, y, side=side):
            return float(n.depth_bottom) - y[0] if side < 0.0 else y[0] - float(n.depth_top)

        def is_full(_, y, goal=goal, rate=rate):
            return (goal - y[2]) * np.sign(rate) if rate else 1.0

        meets.terminal = is_full.terminal = True
        meets.direction = is_full.direction = -1.0
        part = solve_ivp(motion, (t, t1), y, "DOP853", rtol=1e-12, atol=1e-14, events=[meets, is_full])
        t, y = part.t[-1], part.y[:, -1]
        if part.t_events[0].size:
            side = -side
        elif part.t_events[1].size:
            y[2] = goal
        turns += part.t_events[0].size
    assert turns == 2
    return y


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_dives_and_climbs_have_order_2(method):
    # A curved path turns at the bottom, and at the top. How far into a step it turns is another for each member and step: so
    # the worst of many members counts.
    steps, t1, begun = (0.4, 0.2, 0.1, 0.05), 70.0, 10.0 + 0.037 * np.arange(16)
    truth = np.array([cycles(depth, t1) for depth in begun])
    fleet = one(falling(engine()), b=[(0.0, 0.0, depth) for depth in begun])
    errors = [np.abs(depths(lw.solve(fleet, method, h=h, t1=t1))[-1] - truth[:, 0]).max() for h in steps]
    assert slope(steps, errors) > 1.9
    assert errors[-1] < 1e-4


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_step_over_both_depths_turns_at_the_one_ahead(method):
    # 0.2 m apart, and a step of 2 m: going down only the bottom counts, and the next turn is that of the top, going up.
    near = engine(volume_down=0.0, volume_start=0.0, depth_top=11.8)
    result = lw.solve(falling(near, speed=1.0), method, h=2.0, t1=6.0)
    alone = lw.solve(falling(engine(volume_down=0.0, volume_start=0.0), speed=1.0), method, h=2.0, t1=6.0)
    np.testing.assert_array_equal(depths(result), depths(alone))
    up = lw.solve(falling(engine(first="up", volume_up=0.0, volume_start=0.0, depth_top=8.0, depth_bottom=8.2), speed=-1.0),
                  method, h=2.0, t1=6.0)  # fmt: skip
    mirrored = lw.solve(falling(engine(volume_down=0.0, volume_up=1e-4, volume_start=0.0, depth_top=11.8), speed=1.0),
                        method, h=2.0, t1=6.0)  # fmt: skip
    np.testing.assert_allclose(depths(up) - 10.0, 10.0 - depths(mirrored), rtol=0.0, atol=1e-13)


@pytest.mark.ci
@pytest.mark.kernel
def test_a_start_beyond_the_bottom_turns_at_once():
    deep = lw.solve(falling(engine(volume_down=0.0, volume_start=0.0), depth=13.0), "rk4", h=0.5, t1=4.0)
    climbing = lw.solve(falling(engine(first="up", volume_start=0.0), depth=13.0), "rk4", h=0.5, t1=4.0)
    np.testing.assert_array_equal(depths(deep), depths(climbing))


OWN = {"depth_bottom": [11.0, 12.0, 13.0], "pump_rate": [4e-5, 2e-5, 8e-5], "volume_up": [2e-4, 1e-4, 3e-4]}


def fleet_of(numbers):
    """Members with numbers of their own."""
    parameters = {f"buoyancy_engine.{name}": np.array(values) for name, values in numbers.items()}
    return one(falling(engine()), b=(0.0, 0.0, 10.0), parameters=parameters)


@pytest.mark.ci
@pytest.mark.kernel
def test_members_have_engines_of_their_own():
    result = lw.solve(fleet_of(OWN), "psi_s", h=0.1, t1=40.0)
    for i in range(3):
        alone = lw.solve(falling(engine(**{name: values[i] for name, values in OWN.items()})), "psi_s", h=0.1, t1=40.0)
        np.testing.assert_allclose(depths(result)[:, i], depths(alone)[:, 0], rtol=0.0, atol=1e-13)


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_for("*float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_a_run_that_goes_on_in_the_midst_of_pumping_keeps_its_bits(method, dtype):
    fleet = fleet_of(OWN)
    # At 14 s the members turn at their bottoms, or have turned.
    first = lw.solve(fleet, method, h=0.1, t1=14.0, dtype=dtype)
    second = lw.solve(fleet, method, h=0.1, t1=40.0, start=first.final, dtype=dtype)
    np.testing.assert_array_equal(depths(second)[-1], depths(lw.solve(fleet, method, h=0.1, t1=40.0, dtype=dtype))[-1])


def test_a_schedule_that_is_no_number_is_told_once():
    for wrong in (np.nan, np.inf, "a"):
        text = refused(lw.terms.Ballast, times=[0.0, 1.0], command_schedule=[[wrong], [0.0]])
        assert text.startswith("ballast.command_schedule = ")
        assert "\n" not in text


def test_volumes_and_depths_in_the_wrong_order_are_refused():
    says(
        refused(engine, volume_up=-2e-4, depth_top=20.0),
        "volume_up",
        "above volume_down",
        "depth_bottom",
        "above depth_top",
    )
    says(refused(fleet_of, OWN | {"depth_bottom": [11.0, 4.0, 13.0]}), "buoyancy_engine.depth_bottom")


KAPPA, BELOW, NEUTRAL = 4e-3, 6e-3, 30.0
YIELDING = dict(gradient=BELOW, compressibility=KAPPA, reference_depth=NEUTRAL)


def neutral_depth(volume):
    """Archimedes: where W = rho g (V (1 + gradient x) (1 - kappa x) + volume), V the hull's at x = 0, depth NEUTRAL."""
    part = volume * WEIGHT / (MASS * GRAVITY)
    roots = np.roots([-BELOW * KAPPA, BELOW - KAPPA, part])
    return NEUTRAL + roots[np.argmin(np.abs(roots))]


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.parametrize("volume", [0.0, 3e-6, -3e-6])
def test_a_hull_that_yields_rests_at_archimedes_depth(volume):
    depth = neutral_depth(volume)
    water = lw.terms.Stratification(**YIELDING)
    scene = falling(water, lw.terms.Ballast(command=[volume]), depth=depth)
    rest = lw.solve(scene, "rk4", h=0.5, t1=50.0)
    assert np.abs(depths(rest) - depth).max() < 1e-11
    # Drawn down a little it swings about that depth, at the frequency of the slope there with the added mass.
    x, size = depth - NEUTRAL, 1e-4
    slope_there = MASS * GRAVITY * (BELOW - KAPPA - 2.0 * BELOW * KAPPA * x)
    period = 2.0 * np.pi / np.sqrt(slope_there / (MASS + ADDED))
    drawn, h = falling(water, lw.terms.Ballast(command=[volume]), depth=depth + size), period / 512.0
    swing = lw.solve(drawn, "rk4", h=h, t1=period)
    np.testing.assert_allclose(depths(swing)[-1, 0] - depth, size, rtol=1e-6)
    half = lw.solve(drawn, "rk4", h=h, t1=period / 2.0)
    # The slope's own change over the swing.
    np.testing.assert_allclose(depths(half)[-1, 0] - depth, -size, rtol=1e-3)


@pytest.mark.ci
@pytest.mark.kernel
def test_an_engine_lifts_more_in_denser_water():
    # x'' = -k (1 + gradient x), k = rho g V / M: a harmonic motion about where the water would weigh nothing.
    gradient, volume, t1, begun = 0.05, 2e-4, 20.0, -2.0
    still = engine(first="up", depth_top=-100.0, gradient=gradient, reference_depth=12.0)
    result = lw.solve(falling(still, depth=12.0 + begun), "rk4", h=0.1, t1=t1)
    omega = np.sqrt(WEIGHT * volume / (MASS + ADDED) * gradient)
    x = (begun + 1.0 / gradient) * np.cos(omega * t1) - 1.0 / gradient
    np.testing.assert_allclose(depths(result)[-1, 0] - 12.0, x, rtol=0.0, atol=1e-7)


@pytest.mark.ci
@pytest.mark.kernel
def test_the_density_counts_once():
    # A hull that yields as the water grows dense is neutral at all depths, but for the product of both.
    even = lw.terms.Stratification(gradient=5e-6, compressibility=5e-6, reference_depth=NEUTRAL)
    result = lw.solve(falling(even, depth=NEUTRAL + 100.0), "rk4", h=0.5, t1=10.0)
    force = MASS * GRAVITY * 25e-12 * 100.0**2
    np.testing.assert_allclose(depths(result)[-1, 0] - NEUTRAL - 100.0, 0.5 * force / (MASS + ADDED) * 100.0, rtol=1e-6)


@pytest.mark.ci
@pytest.mark.kernel
def test_stages_remember_what_those_of_the_twin_do():
    # 40 steps of round-off 1e-15 and little growth; the schedule turns.
    pumps = CASES["ballast with pumps"]
    scene, body = test_parity.scene_of(pumps), test_parity.body_of(pumps)
    assert difference(*test_explicit.both(scene, body, "rk4", 0.02, 40)) < 2e-12


@pytest.mark.ci
@pytest.mark.kernel
def test_stages_of_an_engine_are_near_those_of_the_twin():
    # The twin looks from the step's start to each stage, the kernel from stage to stage: they part at a turn, to order 2.
    case, steps = CASES["buoyancy engine"], (0.02, 0.01, 0.005)
    scene, body = test_parity.scene_of(case), test_parity.body_of(case)
    apart = [difference(*test_explicit.both(scene, body, "rk4", h, round(0.8 / h))) for h in steps]
    assert apart[0] < 1e-5
    assert apart[-1] < apart[0] / 8.0
