# SPDX-License-Identifier: Apache-2.0
"""Actuators that a controller drives, each beside its twin: how they follow a command that is held, and how they push."""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels import built_in
from lgvi_warp.checks.bench import KICK, ORIGIN, TURN, Bank, Bench
from lgvi_warp.control.base import Bus
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.control_fins import ControlFins
from lgvi_warp.reference.terms.driven import ControlWrench
from lgvi_warp.reference.terms.thrusters import Thrusters
from tests.laws.cases import PROPELLERS, THRUSTERS
from tests.laws.cases_lift import DENSITY, FINS, RATES, STALL, arrays
from tests.laws.test_device_code import FOLLOWED, PACKETS, ROUND_OFF, SCENE, lanes_apart

WRENCH = dict(
    limit=(20.0, 20.0, 20.0, 2.0, 2.0, 2.0),
    rate_limit=(15.0, 1e6, 30.0, 1.0, 1e6, 2.0),
    time_constant=(0.2, 0.3, 0.0, 0.5, 0.0, 0.1),
)
POLYNOMIAL = dict(polynomial=(3.0, 0.5, 8.0, -2.0, 1.0), polynomial_astern=(2.0, 7.0, -1.5))
COEFFICIENTS = dict(coefficient=(2.0, 3.0, 1.0), coefficient_astern=(1.5, 2.5, 0.5))
# One lag, no dead band, and one odd curve ahead and astern.
PLAIN = {key: value for key, value in THRUSTERS.items() if key != "dead_band"} | {"time_constant": (0.2, 0.2, 0.2)}
ODD = dict(polynomial=(3.0, 0.0, 8.0, 0.0, -2.0))
LAGGED = dict(limit=(0.35, 0.2, 0.5), rate_limit=RATES, time_constant=(0.1, 0.3, 0.0))
ACTUATORS = {
    "control wrench": (lw.terms.ControlWrench(**WRENCH), ControlWrench(**arrays(WRENCH))),
    "thrusters": (
        lw.terms.Thrusters(**THRUSTERS, **PROPELLERS, **POLYNOMIAL, **COEFFICIENTS),
        Thrusters(
            **arrays(THRUSTERS | PROPELLERS),
            **POLYNOMIAL,
            forward=np.array(COEFFICIENTS["coefficient"]),
            backward=np.array(COEFFICIENTS["coefficient_astern"]),
        ),
    ),
    "plain thrusters": (
        lw.terms.Thrusters(**PLAIN, **ODD, coefficient=(2.0, 3.0, 1.0)),
        Thrusters(**arrays(PLAIN), **ODD, polynomial_astern=ODD["polynomial"], dead_band=np.zeros(3),
                  forward=np.array((2.0, 3.0, 1.0)), backward=np.array((2.0, 3.0, 1.0))),
    ),
    "control fins without flow angle": (
        lw.terms.ControlFins(**FINS, **LAGGED, **STALL, flow_angle=False),
        ControlFins(**arrays(FINS | LAGGED | STALL), density=DENSITY, flow_angle=False),
    ),
}  # fmt: skip


@pytest.mark.ci
@pytest.mark.parametrize("name", ACTUATORS)
def test_an_actuator_does_what_its_twin_does(name):
    term, law = ACTUATORS[name]
    law.driven = True
    law.rate_limit = np.where(law.rate_limit >= 1e6, np.inf, law.rate_limit)
    count = term.channels
    work = 2 * count if term.type == "control_fins" else 0
    # Commands stand behind the law's own rows, in the room for a backup.
    first = count + work
    term = term.driven_by(Bus({term.key: (first, count)}, 0, 0, 0, 0))
    bench = Bench(term, built_in("laws", term.device_in(True)), SCENE, PACKETS, 5)
    commands = 2.0 * term.limit * np.random.default_rng(1).uniform(-1.0, 1.0, (bench.count, count))
    places, pushes = device_of(bench, commands, first, False)
    for here, there in zip(pushes, device_of(bench, commands, first, True)[1], strict=True):
        # In other axes about another origin.
        force, torque = there[:, :3] @ TURN.T, there[:, 3:] @ TURN.T
        assert_close(np.hstack([force, torque + np.cross(ORIGIN, force)]), here, np.abs(here).max())
    for i, (R, b, nu, Om, t) in enumerate(zip(*vars(bench.views).values(), strict=True)):
        law.held = commands[i]
        view = View(R, b, nu, Om, t, KICK, 3, i, law.start())
        for j in range(3):
            memory = law.evolve(view, bool(j)) if j < 2 else law.follow(replace(view, h=FOLLOWED))
            view = replace(view, memory=memory)
            assert_close(places[j][i], memory, np.abs(term.limit).max())
            push = np.concatenate(law.wrench(view)) - law.damping(view) @ np.concatenate([nu, Om])
            assert_close(pushes[j][i], push, np.abs(pushes[j]).max())
    if name == "control wrench":
        # Held commands are followed exactly: by the exponential where the lag acts alone, at once where nothing does.
        after = KICK + FOLLOWED
        within = np.clip(commands, -term.limit, term.limit)
        np.testing.assert_allclose(places[2][:, 1], within[:, 1] * -np.expm1(-after / 0.3), rtol=1e-13)
        np.testing.assert_allclose(places[2][:, 4], within[:, 4], rtol=1e-13)
        ramp = np.sign(within[:, 2]) * np.minimum(np.abs(within[:, 2]), 30.0 * after)
        np.testing.assert_allclose(places[2][:, 2], ramp, rtol=1e-13)


def device_of(bench, commands, first, elsewhere):
    """Places and pushes after either half of a kick, and a time later; commands are written to rows of the memory."""
    views = bench.views.elsewhere() if elsewhere else bench.views
    bank = Bank(bench, replace(bench.context(bench.parameters, elsewhere), aligned=not elsewhere), views)
    rows, count = bank.memory.numpy(), commands.shape[1]
    rows[:, first : first + count] = commands.reshape(PACKETS, bench.width, count).transpose(0, 2, 1)
    places, pushes = [], []
    for second, time in ((0, KICK), (1, KICK), (2, FOLLOWED)):
        bank.run_device(views, second, time)
        places.append(lanes_apart(bank.memory)[:, :count])
        pushes.append(wrench_of(bank.evaluate(views), views))
    return places, pushes


def wrench_of(values, views):
    """(k, 6): what `law` and `damping` push together."""
    if "damping" not in values:
        return values["law"]
    twist = np.concatenate([views.velocity, views.rate], axis=1)
    braked = -np.einsum("kij,kj->ki", values["damping"].reshape(-1, 6, 6), twist)
    assert_close(values["push"], braked, np.abs(braked).max())
    return values.get("law", 0.0) + braked


def assert_close(actual, desired, size):
    np.testing.assert_allclose(actual, desired, rtol=0.0, atol=ROUND_OFF * size)
