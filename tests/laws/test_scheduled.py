# SPDX-License-Identifier: Apache-2.0
"""Commands along a schedule: cut at their limits on the host, followed exactly, and the same bits whatever others have."""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels import built_in
from lgvi_warp.checks.bench import Bank, Bench
from lgvi_warp.physics import terms
from lgvi_warp.physics.terms.actuators import FOREVER, pieces, within_limits
from tests.laws.cases import COMMANDS, THRUSTERS
from tests.laws.test_device_code import FOLLOWED, PACKETS, SCENE, lanes_apart
from tests.laws.test_parity import GRAVITY, STATE, VEHICLE
from tests.support.tools import last

RISING = dict(times=(0.0, 2.0), command_schedule=((0.2, -0.4, 0.1), (0.8, 0.4, 0.1)))
SQUARE = dict(coefficient=(20.0, 20.0, 10.0))


def memories_of(term, time):
    """Memory of the device code (k, 3): after the halves of a kick, and after a time that ends at `time`."""
    bench = Bench(term, built_in("laws", term.device_in(True)), SCENE, PACKETS, 5)
    views = replace(bench.views, time=np.repeat(np.linspace(*time, PACKETS), bench.width))
    bank = Bank(bench, replace(bench.context(bench.parameters), aligned=True), views)
    kept = [lanes_apart(bank.memory)[:, :3].copy()]
    for second, h in ((1, 0.01), (2, FOLLOWED)):
        bank.run_device(views, second, h)
        kept.append(lanes_apart(bank.memory)[:, :3].copy())
    return views.time, kept


@pytest.mark.parametrize("taus", [(0.3, 0.3, 0.3), (0.3, 0.5, 0.0)], ids=["alike", "apart"])
def test_a_lag_behind_a_straight_command_is_exact(taus):
    term = terms.Thrusters(**THRUSTERS | {"time_constant": taus} | RISING, **SQUARE)
    times, (_, before, after) = memories_of(term, (1.0, 1.9))
    start, end = (np.stack([np.interp(t, RISING["times"], u) for u in np.transpose(RISING["command_schedule"])], axis=1)
                  for t in (times - FOLLOWED, times))  # fmt: skip
    tau = np.array(taus)
    slope = (end - start) / FOLLOWED
    with np.errstate(divide="ignore"):
        decayed = np.exp(-FOLLOWED / tau)
    # The command less its slope times tau is followed without a gap: the gap to it decays.
    exact = end - slope * tau + decayed * (before - (start - slope * tau))
    np.testing.assert_allclose(after, exact, rtol=0.0, atol=1e-15)


def test_one_exponential_for_all_has_the_bits_of_one_for_each():
    alike, apart = (
        memories_of(terms.Thrusters(**THRUSTERS | {"time_constant": taus} | COMMANDS, **SQUARE), (0.05, 1.6))[1]
        for taus in ((0.3, 0.3, 0.3), (0.3, 0.3, 0.1))
    )
    for one, other in zip(alike, apart, strict=True):
        np.testing.assert_array_equal(one[:, :2], other[:, :2])
        assert np.any(one[:, 2] != other[:, 2])


# What one member has and others have not: a dead band, other sides, powers that are even, commands beyond a limit.
OTHERS = {
    "dead_band": np.full(3, 0.05),
    "coefficient_astern": np.array((15.0, 15.0, 8.0)),
    "polynomial_astern": np.array((2.0, 0.0, 1.0)),
    "polynomial": np.array((2.0, 0.5, 1.0)),
    "limit": np.array((0.5, 0.6, 0.7)),
    "time_constant": np.array((0.2, 0.1, 0.3)),
}


@pytest.mark.ci
@pytest.mark.kernel
@pytest.mark.slow_but("rk4-*")
@pytest.mark.parametrize("tau", [0.2, 0.0])
@pytest.mark.parametrize("method", ["rk4", "psi_x"])
def test_a_member_has_the_same_bits_beside_others(method, tau):
    plain = {"dead_band": (0.0,) * 3, "limit": (1.0,) * 3, "time_constant": (tau,) * 3}
    law = terms.Thrusters(**THRUSTERS | plain, times=(0.0, 0.5, 1.5), **SQUARE, polynomial=(3.0, 0.0, 8.0),
                          command_schedule=((0.3, 0.8, -0.7), (0.7, -0.9, 0.9), (0.5, 0.5, -1.0)))  # fmt: skip
    scene = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), terms=[law])
    states = [np.broadcast_to(value, (2, *np.shape(value))) for value in STATE.values()]
    alone = last(lw.solve(lw.Ensemble.from_states(scene, *states).subset([0]), method, h=0.05, t1=1.2))
    for name, other in OTHERS.items():
        if name == "time_constant" and not tau:
            continue
        numbers = {f"thrusters.{name}": np.array([getattr(law, name), other])}
        result = lw.solve(lw.Ensemble.from_states(scene, *states, parameters=numbers), method, h=0.05, t1=1.2)
        assert all(np.array_equal(a, b) for a, b in zip(last(result, 0), alone, strict=True)), name
        assert not np.array_equal(last(result, 1)[0], alone[0]), name


def test_commands_are_cut_at_their_limits():
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(0.1, 1.0, (5, 6)), axis=1)
    schedule, limit = rng.normal(size=(5, 6, 3)), rng.uniform(0.3, 2.0, (5, 3))
    limit[4] = np.abs(schedule[4]).max()  # reaches none
    at, values = within_limits(times, schedule, limit)
    assert np.all(np.diff(at, axis=1) >= 0.0)
    assert np.all(np.abs(values) <= limit[:, None])
    for i in range(5):
        t = np.linspace(times[i, 0] - 1.0, times[i, -1] + 1.0, 1001)
        for j in range(3):
            cut = np.clip(np.interp(t, times[i], schedule[i, :, j]), -limit[i, j], limit[i, j])
            np.testing.assert_allclose(np.interp(t, at[i], values[i, :, j]), cut, rtol=0.0, atol=1e-14)
    # Times that others need change nothing for a member that reaches no limit.
    assert set(at[4]) == set(times[4])


def test_commands_within_their_limits_stay_as_they_are():
    times, schedule = np.array([[0.0, 1.0]]), np.array([[[0.5], [-1.0]]])
    at, values = within_limits(times, schedule, np.ones((3, 1)))
    assert at is times
    assert values is schedule


def test_the_rows_of_pieces():
    rows = pieces(np.array([[0.0, 2.0, 2.0]]), np.array([[[1.0, 5.0], [3.0, 4.0], [2.0, 4.0]]]))
    ever = [0.0, 0.0, 1.0, 0.0, 5.0, 0.0]
    rise = [2.0, 0.5, 1.0, 2.0, 5.0, -1.0]
    jump = [2.0, 1e20, 3.0, -1.0, 4.0, 0.0]
    on = [FOREVER, 0.0, 2.0, 0.0, 4.0, 0.0]
    np.testing.assert_array_equal(rows, [ever + rise + jump + on])
