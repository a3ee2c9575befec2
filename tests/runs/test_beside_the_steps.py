# SPDX-License-Identifier: Apache-2.0
"""Nothing stands beside a kernel's steps that is not asked for: no copies for calls, no energy that nothing reads."""

import re

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.runs.settle import make_plan
from tests.support.tools import generated

# What all functions of a packet share: each is about 1 kB or more, and Warp hands a struct on as a copy.
LARGE = ("State", "CompensatedState", "Constants", "Monitor", "View", "Measurement", "Reference")
# Functions of the kernel that are not inlined, as the scenes below ask for them.
FAILING = {"failed", "keep", "show", "rest"}
ENDING = FAILING | {"retried", "in_parts", "arrival"}
TICKING = FAILING | {"feed", "held", "gather_signals", "keep_signals", "sample_signals", "note_actuators"}


def source(scene, folder, method, **settings):
    """The C++ that Warp generates for a scene."""
    plan = make_plan(lw.Ensemble(scene, 8), method, **{"h": 0.01, "t1": 0.1} | settings)
    return generated(plan, folder)


def ending(name):
    """A scene whose members stop at the sea floor."""
    scene = lw.Scene.named(name)
    return lw.Scene(scene.vehicle, scene.environment, scene.terms, scene.start, events=[lw.events.Floor(depth=10.0)])


def steered():
    """A scene with a controller."""
    controller = lw.Controller(
        period=0.02,
        guidance=[lw.control.SetPoint(heading=0.5)],
        laws=[lw.control.HeadingPID(kp=1.0)],
        allocation=[lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0] * 6])],
    )
    return lw.Scene.named("remus_100", controller=controller)


CASES = {
    "explicit": (
        lambda: lw.Scene.named("nordkvist_sanyal"),
        "rk4",
        {"checks": "all"},
        FAILING | {"energy_alarm", "note"},
    ),
    "splitting": (
        lambda: lw.Scene.named("nordkvist_sanyal"),
        "psi_s",
        {"checks": "all"},
        FAILING | {"stepped", "begin"},
    ),
    "compensated": (lambda: lw.Scene.named("sphere"), "psi_s", {"dtype": "float32_compensated"}, FAILING | {"stepped"}),
    "events": (lambda: ending("nordkvist_sanyal"), "psi_s", {"on_failure": "substep"}, ENDING),
    "controlled": (steered, "psi_x", {"save": lw.SaveAt(fields=("position", "actuator"))}, TICKING),
}


def functions(text):
    """Arguments of each function that is not inlined, by its name."""
    found = re.findall(r"^static WP_NOINLINE \S+ (?!adj_)(\w+?)_\d+\(\n(.*?)\)\n", text, re.MULTILINE | re.DOTALL)
    return {
        name.split("__")[-1]: [argument.split() for argument in arguments.split(",\n")] for name, arguments in found
    }


@pytest.mark.ci
@pytest.mark.parametrize("case", CASES)
def test_no_function_gets_a_copy_of_what_the_packet_holds(case, tmp_path):
    scene, method, settings, expected = CASES[case]
    found = functions(source(scene(), tmp_path, method, **settings))
    assert expected <= set(found)
    copied = {
        name
        for name, arguments in found.items()
        for kind, *_ in arguments
        if re.fullmatch(rf"({'|'.join(LARGE)})_\w+", kind)
    }
    assert not copied


# The attitude of a Runge-Kutta method is looked at in any case; the energy there is read by a warning of checks="all" alone.
@pytest.mark.parametrize(("checks", "views"), [("none", 0), ("safe", 1), ("all", 2)])
def test_energy_is_computed_where_something_reads_it(checks, views, tmp_path):
    text = source(lw.Scene.named("nordkvist_sanyal"), tmp_path, "rk4", checks=checks)
    assert len(re.findall(r"= make_watching__locals__created_\d+\(", text)) == views
    assert len(re.findall(r"^ +make_energy__locals__energies_\d+\(", text, re.MULTILINE)) == (views > 0) * 2
    assert bool(re.search(r"> energy;", text)) == (views > 0)


@pytest.mark.ci
@pytest.mark.parametrize("method", ["psi_s", "rk4"])
def test_what_is_looked_at_changes_no_bit(method):
    fleet = lw.Ensemble(
        lw.Scene.named("nordkvist_sanyal", start={"velocity": [0.3, 0.1, 0.2]}),
        50, 1, {"start.angular_velocity": lw.distributions.Normal(std=0.1)},
    )  # fmt: skip
    runs = [lw.solve(fleet, method, h=0.02, t1=4.0, checks=checks) for checks in ("none", "safe", "all")]
    for name in ("position", "attitude", "velocity", "angular_velocity"):
        assert len({np.ascontiguousarray(getattr(run, name)).tobytes() for run in runs}) == 1
