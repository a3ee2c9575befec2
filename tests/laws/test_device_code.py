# SPDX-License-Identifier: Apache-2.0
"""Each law's device code alone, beside its twin: all that it adds to a step, at random views; and the distance of each event.

A stepping kernel with all laws at once, in test_parity.py, shows that steps use them as the twin does.
"""

from dataclasses import replace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_kernels import built_in
from lgvi_warp.checks.bench import KICK, ORIGIN, STEP, TURN, Bank, Bench
from lgvi_warp.reference.terms import View
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.thrusters import Thrusters
from lgvi_warp.reference.terms.weight import Weight
from tests.laws import cases
from tests.laws.case import Case
from tests.laws.cases import CASES, PROPELLERS, TABLE_OF_THRUST, THRUSTERS
from tests.laws.test_parity import GRAVITY, STATE, VEHICLE

pytestmark = pytest.mark.ci

# Long enough for several turns of a command.
FOLLOWED = 0.7
PACKETS, SEED = 16, 12 + (34 << 32)
# A hundred roundings of the largest number.
ROUND_OFF = 100.0 * np.finfo(float).eps
SCENE = lw.Scene(VEHICLE, lw.Environment(gravity=GRAVITY), start=lw.Start(position=STATE["b"]))
IMPLIED = {
    "weight": Case((lw.terms.Weight(),), (Weight(net=VEHICLE.mass * GRAVITY - VEHICLE.buoyancy),)),
    "restoring": Case(
        (lw.terms.Restoring(),), (Restoring(moment=VEHICLE.buoyancy * np.array(VEHICLE.center_of_buoyancy)),)
    ),
}
ALONE = IMPLIED | {name: case for name, case in CASES.items() if len(case.terms) == 1}
(LAGGING,), (LAGGING_TWIN,), _ = CASES["thrusters"]
ALONE |= cases.ALONE
ALONE["prompt thrusters"] = Case(
    (replace(LAGGING, time_constant=0.0),), (type(LAGGING_TWIN)(**vars(LAGGING_TWIN) | {"time_constant": np.zeros(3)}),)
)


def held(**numbers):
    """Thrusters whose commands are held, some beyond their limit or within the dead band, beside their twin."""
    given = THRUSTERS | PROPELLERS | {"advance_loss": None, "advance_loss_astern": None, "torque_loss": None} | numbers
    sides = dict(coefficient=(2.0, 3.0, 1.0), coefficient_astern=(1.5, 2.5, 0.5))
    known = {key: np.array(value) for key, value in given.items() if value is not None}
    twin = Thrusters(**known, forward=np.array(sides["coefficient"]), backward=np.array(sides["coefficient_astern"]))
    twin.times, twin.command = np.zeros(1), np.array([HELD])
    return Case((lw.terms.Thrusters(**given, **sides, command=HELD),), (twin,))


# The same ahead as astern, without a dead band: the twin sums its powers one by one.
ODD = dict(polynomial=(3.0, 0.0, 8.0, 0.0, -2.0), dead_band=(0.0, 0.0, 0.0))
ALONE["thrusters with an odd curve"] = Case(
    (replace(LAGGING, **ODD, polynomial_astern=ODD["polynomial"], coefficient_astern=LAGGING.coefficient),),
    (type(LAGGING_TWIN)(**vars(LAGGING_TWIN) | ODD | {"polynomial_astern": ODD["polynomial"], "backward": LAGGING_TWIN.forward,
                                                      "dead_band": np.zeros(3)}),),
)  # fmt: skip
HELD = (0.7, -0.95, 0.04)
TABLE = dict(zip(("table_commands", "table_thrusts"), TABLE_OF_THRUST, strict=True))
ALONE["held thrusters"] = held()
ALONE["held thrusters with polynomials"] = held(
    polynomial=(3.0, 0.5, 8.0, -2.0, 1.0), polynomial_astern=(2.0, 7.0, -1.5)
)
ALONE["held thrusters with a table"] = held(**TABLE, rate_limit=None)
# Thrust that falls with the speed follows from the velocities, whatever is held.
ALONE["held propellers"] = held(**PROPELLERS)


def bench_of(term, folder, aligned=False, device=None):
    """The law at views in the time of the cases' schedules; device: other device code than that of these axes."""
    bench = Bench(term, built_in(folder, device or term.device_in(aligned)), SCENE, PACKETS, SEED)
    bench.views = replace(bench.views, time=np.repeat(np.linspace(0.05, 1.6, PACKETS), bench.width))
    return bench


def measured(bench, elsewhere):
    """By role (k, numbers) between the halves of a kick, in the user's axes; the memory after each half, and what follows."""
    views = bench.views.elsewhere() if elsewhere else bench.views
    context = replace(bench.context(bench.parameters, elsewhere), aligned=not elsewhere)
    bank = Bank(bench, context, views)
    values = bank.evaluate(views)
    kept = [lanes_apart(bank.memory)]
    bank.run_device(views, 1)
    kept.append(lanes_apart(bank.memory))
    if hasattr(bench.module, "follow"):
        bank.run_device(views, 2, FOLLOWED)
        kept.append(lanes_apart(bank.memory))
    if "damping" in values:
        twist = np.concatenate([views.velocity, views.rate], axis=1)
        values["damping"] = -np.einsum("kij,kj->ki", values["damping"].reshape(-1, 6, 6), twist)
    if elsewhere:
        # Water and potentials are asked for at the user's origin only.
        values = {role: value for role, value in values.items() if role in ("law", "damping", "push", "power")}
        for role in values.keys() - {"power"}:
            value = values[role]
            force, torque = value[:, :3] @ TURN.T, value[:, 3:] @ TURN.T
            values[role] = np.concatenate([force, torque + np.cross(ORIGIN, force)], axis=1)
    return values, kept


def lanes_apart(memory):
    """(k, rows) of a memory (packets, rows) of lanes."""
    rows = memory.numpy()
    return rows.transpose(0, 2, 1).reshape(len(rows) * rows.shape[2], rows.shape[1])


def expected(law, views):
    """The same of the twin: by role (k, numbers), and the memory after either half of the kick, and what follows."""
    if hasattr(law, "seed0"):
        law = type(law)(**vars(law) | {"seed0": SEED & 0xFFFFFFFF, "seed1": SEED >> 32})
    values = {role: [] for role in ("law", "damping", "flow", "energy", "power")}
    kept = [], [], []
    for i, (R, b, nu, Om, t) in enumerate(zip(*vars(views).values(), strict=True)):
        view = View(R, b, nu, Om, t, KICK, STEP, i, law.start())
        view = replace(view, memory=law.evolve(view, False))
        flow = law.flow(view)
        values["law"].append(np.concatenate(law.wrench(view)))
        values["damping"].append(-law.damping(view) @ np.concatenate([nu, Om]))
        values["flow"].append(np.concatenate([flow.velocity, flow.rate, flow.gradient.T.reshape(9)]))
        values["energy"].append([law.potential(view)])
        values["power"].append([law.power(view)])
        kept[0].append(view.memory)
        view = replace(view, memory=law.evolve(view, True))
        kept[1].append(view.memory)
        kept[2].append(law.follow(replace(view, h=FOLLOWED)))
    return {role: np.array(value) for role, value in values.items()}, [np.array(memory) for memory in kept]


# In other axes weight and restoring moment are the same together, not each.
@pytest.mark.parametrize(
    ("name", "elsewhere"),
    [*((name, False) for name in ALONE), *((name, True) for name in ALONE if name not in IMPLIED)],
)
def test_a_law_gives_what_its_twin_gives(name, elsewhere):
    (term,), (law,) = ALONE[name].terms, ALONE[name].laws
    bench = bench_of(term, "laws", aligned=not elsewhere)
    assert hasattr(bench.module, "push") == hasattr(bench.module, "damping")
    compare(bench, law, elsewhere)


WATTS = dict(
    power_commands=(-0.9, -0.2, 0.0, 0.3, 0.8),
    power=((60.0, 80.0, 50.0), (20.0, 10.0, 9.0), (1.0, 2.0, 0.0), (15.0, 12.0, 30.0), (90.0, 70.0, 100.0)),
)
SHAFT = dict(shaft_speed=(40.0, 30.0, 50.0), efficiency=(0.5, 0.8, 1.0))


def powered(case, **numbers):
    """A case's thrusters in a scene that accounts their power, beside their twin."""
    (term,), (law,), _ = case
    twin = type(law)(**vars(law) | {name: np.array(value) for name, value in numbers.items()})
    if "power" in numbers:
        twin.power_table = twin.power
        del twin.power
    return Case((replace(term, **numbers).beside_account(True),), (twin,))


POWERED = {
    "lagging, watts": powered(CASES["thrusters"], **WATTS),
    "prompt, watts": powered(ALONE["prompt thrusters"], **WATTS),
    "held, watts": powered(ALONE["held thrusters"], **WATTS),
    "held, shaft": powered(ALONE["held thrusters"], **SHAFT),
    "held propellers, shaft": powered(ALONE["held propellers"], **SHAFT),
    "propellers, shaft": powered(CASES["thrusters with a table"], **SHAFT),
    "propellers, watts": powered(CASES["thrusters with a table"], **WATTS),
}


@pytest.mark.parametrize("elsewhere", [False, True])
@pytest.mark.parametrize("name", POWERED)
def test_thrusters_take_the_power_that_their_twin_takes(name, elsewhere):
    (term,), (law,) = POWERED[name].terms, POWERED[name].laws
    bench = bench_of(term, "laws", aligned=not elsewhere)
    assert "power" in bench.roles
    compare(bench, law, elsewhere)


PATTERNED = [name for name, case in ALONE.items() if case.terms[0].pattern_device]


@pytest.mark.parametrize("name", PATTERNED)
def test_a_law_in_the_users_axes_gives_what_its_twin_gives(name):
    (term,), (law,) = ALONE[name].terms, ALONE[name].laws
    numbers = {key: value[None] for key, value in term.parameters().items()}
    bench = bench_of(term, "laws", True, f"{term.pattern_device}:{','.join(term.entries(numbers))}")
    assert hasattr(bench.module, "push") or hasattr(bench.module, "law")
    compare(bench, law, False)


def compare(bench, law, elsewhere):
    """All that device code gives beside what its twin gives."""
    (values, kept), (twin_values, twin_kept) = measured(bench, elsewhere), expected(law, bench.views)
    twin_values["push"] = twin_values["damping"]
    if not elsewhere:
        assert {role for role, value in twin_values.items() if np.any(value)} - {"energy"} <= values.keys() | {"push"}
    if "energy" in values:
        # Constants of the potential are left out.
        values["energy"], twin_values["energy"] = (x["energy"] - x["energy"][0] for x in (values, twin_values))
    for role, value in values.items():
        assert_close(value, twin_values[role])
    for memory, twin_memory in zip(kept, twin_kept[: len(kept)], strict=True):
        assert_close(memory[:, : twin_memory.shape[1]], twin_memory)


def assert_close(actual, desired):
    np.testing.assert_allclose(actual, desired, rtol=0.0, atol=ROUND_OFF * np.abs(desired).max(initial=0.0))


LOWER, UPPER = np.array((-3.0, -4.0, 6.0)), np.array((4.0, 3.0, 11.0))
EVENTS = {
    lw.events.Surface(depth=1.5): lambda b, t: b[:, 2] - 1.5,
    lw.events.Floor(depth=9.0): lambda b, t: 9.0 - b[:, 2],
    lw.events.Box(lower=LOWER, upper=UPPER): lambda b, t: np.minimum(b - LOWER, UPPER - b).min(axis=1),
    lw.events.StopTime(at=0.7): lambda b, t: 0.7 - t,
}


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: event.type)
def test_the_distance_of_an_event(event):
    bench = bench_of(event, "stops")
    values, _ = measured(bench, False)
    distance = EVENTS[event](bench.views.position, bench.views.time)
    np.testing.assert_allclose(values["distance"][:, 0], distance, rtol=0.0, atol=1e-14)
    assert np.any(distance > 0.0)
    assert np.any(distance < 0.0)
