# SPDX-License-Identifier: Apache-2.0
"""Runs that go on from where another ended: pieces have the bits of one run, whatever acts, remembers or draws."""

import pickle
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.results import member_fields
from tests.laws.cases import CASES

EXAMPLES = Path(__file__).parents[2] / "examples" / "scenes"
PIECES = 10
STEPS = 0.02
VARY = {
    "start.angular_velocity": lw.distributions.Normal(std=0.05),
    "start.position": lw.distributions.Normal(std=0.2),
    "vehicle.buoyancy": lw.distributions.Normal(relative=0.001),
}


def fleet_of(name, members=20, vary=None, **parts):
    """Members of a named vehicle under way at a depth of 10 m."""
    scene = lw.Scene.named(name)
    start = lw.Start([0.0, 0.0, 10.0], euler_deg=[1.0, 2.0, 3.0], velocity=[1.0, 0.1, -0.1])
    terms = parts.pop("terms", scene.terms)
    return lw.Ensemble(lw.Scene(scene.vehicle, scene.environment, terms, start, **parts), members, 1, vary or VARY)


def one_run(fleet, method, pieces=PIECES, length=0.1, **settings):
    """All of it at once, with a sample where each piece will end."""
    save = lw.SaveAt(every=length, **settings.pop("saved", {}))
    return lw.solve(fleet, method, **{"h": STEPS, "t1": pieces * length, "save": save} | settings)


def in_pieces(fleet, method, pieces=PIECES, length=0.1, **settings):
    """One run after the other."""
    result, save = None, lw.SaveAt(**settings.pop("saved", {}))
    for i in range(1, pieces + 1):
        start = None if result is None else result.final
        how = {"h": STEPS, "t1": round(i * length, 9), "save": save} | settings
        result = lw.solve(fleet, method, **how, start=start)
    return result


def differences(whole, last):
    """Names of what differs at the end of two runs; nothing where all bits agree."""
    names = [name for name in whole.samples if not equal(whole.samples[name][-1], last.samples[name][-1])]
    of_members = [item.name for item in member_fields.EVERY]
    return names + [name for name in of_members if not equal(getattr(whole, name), getattr(last, name))]


def equal(a, b):
    """Whether two arrays have the same bits, NaN with NaN."""
    return np.asarray(a).tobytes() == np.asarray(b).tobytes()


def check(fleet, method, **settings):
    """Require the same bits of both; return the run at once."""
    whole, last = one_run(fleet, method, **settings), in_pieces(fleet, method, **settings)
    assert differences(whole, last) == []
    assert last.time.tolist() == pytest.approx([whole.time[-2], whole.time[-1]])
    return whole


@pytest.mark.slow_but("all together-psi_x", "thrusters-rk4", "Gauss-Markov current-psi_x")
@pytest.mark.parametrize("method", ["psi_x", "rk4"])
@pytest.mark.parametrize("name", [name for name in CASES if "slack" not in name])
def test_every_term(name, method):
    check(fleet_of("torpedo", terms=list(CASES[name].terms)), method, checks="all")


METHODS = ["psi", "phi", "phi_adjoint", "psi_1", "psi_s", "psi_x", "psi_w", "kl6(psi_s)", "su4(psi_x)", "rk4", "rk8", "cg3",
           "rkn6_11", "gauss4", "gauss6", "rkw3"]  # fmt: skip


@pytest.mark.slow_but("gauss4-float64", "psi_x-float32_compensated")
@pytest.mark.parametrize("dtype", ["float64", "float32", "float32_compensated"])
@pytest.mark.parametrize("method", METHODS)
def test_every_method(method, dtype):
    if dtype == "float32_compensated" and method.startswith(("gauss", "rk", "cg", "psi_w", "phi")):
        pytest.skip("the method has no compensated sums")
    check(fleet_of("nordkvist_sanyal"), method, dtype=dtype, checks="all")


@pytest.mark.slow
def test_steps_that_are_chosen():
    check(fleet_of("nordkvist_sanyal"), lw.Method("rk8", rtol=1e-9, atol=1e-12))


@pytest.mark.slow
def test_steps_that_are_divided():
    fleet = fleet_of("nordkvist_sanyal")
    whole = check(fleet, "psi_s", h=0.4, length=0.4, on_failure="substep")
    assert whole.substeps.any()


@pytest.mark.parametrize("at", [0.1, 0.31, 0.5])
def test_members_that_end(at):
    # In a piece's first step, in its middle, and where one ends; others fall through a floor, or start beyond it.
    events = [lw.events.Floor(depth=10.1), lw.events.StopTime(at=at)]
    fleet = fleet_of("torpedo", events=events, terms=list(CASES["waves"].terms))
    whole = check(fleet, "psi_x")
    assert len(whole.status.counts()) == 2


SENSORS = [
    {"type": "sensor", "name": "depth_cell", "of": "depth", "noise": 0.02, "quantum": 0.005, "latency": 1.0},
    {"type": "sensor", "name": "compass", "of": "heading", "noise": 0.01, "drift": 0.002, "dropout": 0.2},
    {"type": "sensor", "name": "gyro", "of": "angular_velocity", "noise": 1e-3, "every": 2.0, "latency": 2.0},
    {"type": "sensor", "name": "log", "of": "velocity", "noise": 0.01, "every": 3.0, "latency": 1.0, "dropout": 0.1},
    {"type": "complementary_filter", "time_constant": 2.0},
    {"type": "dead_reckoning", "depth": "measured"},
    {"type": "low_pass", "of": "heading", "time_constant": 0.3},
]
SIGNALS = ("measured_heading", "measured_velocity", "reference_depth", "command", "actuator", "demand")
MOTION = ("position", "attitude", "velocity", "angular_velocity")


def autopilot(members=20, vary=None, **changes):
    """The REMUS with its autopilot, sensors and filters, whose delay and sensors vary by member."""
    content = tomllib.loads((EXAMPLES / "remus_100_autopilot.toml").read_text())
    content["controller"] |= {"sensors": SENSORS} | changes
    content["controller"]["faults"][0]["time"] = 0.7
    del content["ensemble"], content["run"]
    varied = {
        "controller.delay": lw.distributions.Choice([0.0, 0.02, 0.16, 0.3]),
        "heading_pid.kp": lw.distributions.Uniform(0.7, 1.3),
    }
    if content["controller"]["sensors"]:
        varied["gyro.latency"] = lw.distributions.Choice([0.0, 1.0, 4.0])
    return lw.Ensemble(lw.Scene.from_dict(content), members, 1, varied | (vary or {}))


@pytest.mark.slow_but("2-0.1", "10-0.13")
@pytest.mark.parametrize("length", [0.1, 0.5, 0.13])
@pytest.mark.parametrize("pieces", [2, 10])
def test_a_controller(pieces, length):
    # Pieces end at ticks, and between them; a fault begins on the way.
    how = dict(h=0.01, pieces=pieces, length=length, saved={"fields": MOTION + SIGNALS})
    check(autopilot(), "psi_x", **how)


def test_way_points():
    guidance = [{"type": "waypoints", "points": [[0, 0, 5], [0.5, 0, 5], [0.5, 5, 6], [9, 9, 9]], "speed": 1.5, "look_ahead": 3.0,
                 "radius": 0.3, "method": "ilos"}]  # fmt: skip
    check(autopilot(guidance=guidance, sensors=[]), "psi_x", h=0.01, length=0.3)


def law(t, y, r, members):
    """A damper of the yaw rate, with the time and the members in it."""
    demand = np.zeros((len(members), 6))
    demand[:, 5] = -2.0 * y.angular_velocity[:, 2] + np.sin(3.0 * t) + 1e-3 * members
    return demand


@pytest.mark.parametrize("length", [0.2, 0.26])
def test_a_law_in_python(length):
    # A tick at the end of a piece is answered in the next one; a piece may end between two ticks.
    controller = lw.Controller(period=0.1, laws=[lw.control.Callback(law)])
    drag = lw.terms.Drag(linear=(1.0, 2.0, 2.0, 0.1, 0.1, 0.1), quadratic=(0.0,) * 6)
    scene = lw.Scene(lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0)), terms=[lw.terms.ControlWrench(limit=2.0), drag],
                     controller=controller)  # fmt: skip
    fleet = lw.Ensemble(scene, 20, 3, {"start.angular_velocity": lw.distributions.Normal(std=0.1)})
    check(fleet, "psi_s", length=length, saved={"fields": (*MOTION, "command", "demand", "measured_velocity")})


@pytest.mark.parametrize("where", ["file", "store", "pickle", "processes", "part", "prepared"])
def test_by_way_of(where, tmp_path):
    # From files and stores, other processes, some of the members, and by a prepared run.
    fleet = autopilot(300)
    how = dict(method="psi_x", h=0.01)
    whole = lw.solve(fleet, **how, t1=0.6)
    first = lw.solve(fleet, **how, t1=0.3, store=tmp_path / "first.zarr" if where == "store" else None)
    final = first.final
    if where == "file":
        final = lw.Result.load(first.save(tmp_path / "first.npz")).final
    elif where == "store":
        final = lw.open_run(tmp_path / "first.zarr").final
    elif where == "pickle":
        final = pickle.loads(pickle.dumps(final))
    elif where == "part":
        places = [7, 3, 299, 3]
        last = lw.solve(fleet.subset(places), **how, t1=0.6, start=final.part(places))
        assert differences(whole.part(np.array(places)), last) == []
        return
    if where == "prepared":
        run = lw.prepare(fleet.scene, **how, t1=0.3)
        last = run.states(final)
    elif where == "store":
        last = lw.solve(fleet, **how, t1=0.6, start=final, store=tmp_path / "second.zarr")
        assert last.provenance["start"]["goes_on"] == "exactly"
    else:
        last = lw.solve(fleet, **how, t1=0.6, start=final, executor="processes" if where == "processes" else "threads")
    assert differences(whole, last) == []
    assert last.provenance["start"]["time"] == 0.3


def test_a_stored_run_that_was_stopped(tmp_path):
    # Resumed, it goes on from the same end of the run before it, and blocks that were there keep theirs.
    fleet, how = autopilot(600), dict(method="psi_x", h=0.01)
    first = lw.solve(fleet, **how, t1=0.2)
    store = tmp_path / "second.zarr"
    lw.solve(fleet, **how, t1=0.4, start=first.final, store=store, only=range(0, 1))
    last = lw.resume(store)
    whole = lw.solve(fleet, **how, t1=0.4)
    assert differences(whole, last) == []
    third = lw.solve(fleet, **how, t1=0.5, start=lw.open_run(store).final)
    assert differences(lw.solve(fleet, **how, t1=0.5), third) == []
    few = lw.open_run(store, members=[300, 2, 599]).final
    assert equal(few.lanes["state"], last.final.lanes["state"][[300, 2, 599]])
