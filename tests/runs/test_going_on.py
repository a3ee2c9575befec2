# SPDX-License-Identifier: Apache-2.0
"""Runs that go on from where another ended: pieces have the bits of one run, whatever acts, remembers or draws."""

import dataclasses
import pickle
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.results import member_fields
from tests.laws.cases import CASES

pytestmark = pytest.mark.ci

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


def differences(complete, last):
    """Names of what differs at the end of two runs; nothing where all bits agree."""
    names = [name for name in complete.samples if not equal(complete.samples[name][-1], last.samples[name][-1])]
    of_members = [item.name for item in member_fields.EVERY]
    return names + [name for name in of_members if not equal(getattr(complete, name), getattr(last, name))]


def equal(a, b):
    """Whether two arrays have the same bits, NaN with NaN."""
    return np.asarray(a).tobytes() == np.asarray(b).tobytes()


def check(fleet, method, **settings):
    """Require the same bits of both; return the run at once."""
    whole, last = one_run(fleet, method, **settings), in_pieces(fleet, method, **settings)
    assert differences(whole, last) == []
    assert last.time.tolist() == pytest.approx([whole.time[-2], whole.time[-1]])
    # The first sample of a piece is that at the end of the piece before.
    assert [name for name in whole.samples if not equal(whole.samples[name][-2], last.samples[name][0])] == []
    return whole


@pytest.mark.slow_but("thrusters-rk4", "Gauss-Markov current-psi_x")
@pytest.mark.parametrize(
    ("name", "method"),
    # A current that wanders is no flow of an explicit method.
    [(name, method) for name in CASES for method in ("psi_x", "rk4") if "slack" not in name
     and not (method == "rk4" and ("Gauss" in name or "all" in name))],
)  # fmt: skip
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
    # Some members turn by more than a step of 0.4 s can.
    fleet = fleet_of("nordkvist_sanyal", vary={"start.angular_velocity": lw.distributions.Normal(std=4.0)})
    whole = check(fleet, "psi_s", h=0.4, length=0.4, on_failure="substep")
    assert whole.substeps.any()


@pytest.mark.parametrize("at", [0.1, 0.31, 0.5])
def test_members_that_end(at):
    # In a piece's first step, in its middle, and where one ends; others fall through a floor, or start beyond it.
    events = [lw.events.Floor(depth=10.1), lw.events.StopTime(at=at)]
    fleet = fleet_of("torpedo", events=events, terms=list(CASES["waves"].terms))
    whole = check(fleet, "psi_x")
    assert len(whole.status.counts()) == 2


@pytest.mark.slow_but("False")
@pytest.mark.parametrize("signals", [False, True])
def test_members_that_ended_are_out_of_statistics_from_the_start_of_a_piece_on(signals):
    # Each piece's statistics are those of one run at its times, at its start too; members stop before it, or fail.
    events = [lw.events.Floor(depth=10.05), lw.events.StopTime(at=0.17)]
    fleet = autopilot() if signals else fleet_of("torpedo", members=40, events=events, terms=[])
    scene = fleet.scene if not signals else dataclasses.replace(fleet.scene, events=[lw.events.StopTime(at=0.17)])
    fleet = lw.Ensemble(scene, fleet.members, 1, fleet.vary)
    asked = [lw.statistics.Mean("speed", stopped=way, name=way) for way in ("held", "left_out")]
    how = dict(method="psi_x", h=0.01, save=lw.SaveAt(every=0.1), statistics=asked)
    whole, first = (lw.solve(fleet, **how, t1=t1) for t1 in (0.4, 0.2))
    second = lw.solve(fleet, **how, t1=0.4, start=first.final)
    assert whole.statistics["left_out"].count[2] < fleet.members
    for way in ("held", "left_out"):
        np.testing.assert_array_equal(second.statistics[way].count, whole.statistics[way].count[2:])
        np.testing.assert_array_equal(second.statistics[way].value, whole.statistics[way].value[2:])


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
@pytest.mark.parametrize("chunks", [2, 10])
def test_a_controller(chunks, length):
    # Pieces end at ticks, and between them; a fault begins on the way.
    how = dict(h=0.01, pieces=chunks, length=length, saved={"fields": MOTION + SIGNALS})
    check(autopilot(), "psi_x", **how)


@pytest.mark.slow
def test_way_points():
    points = [[0, 0, 5], [0.5, 0, 5], [0.5, 5, 6], [9, 9, 9]]
    guidance = [dict(type="waypoints", points=points, speed=1.5, look_ahead=3.0, radius=0.3, method="ilos")]
    check(autopilot(guidance=guidance, sensors=[]), "psi_x", h=0.01, length=0.3)


@pytest.mark.slow
def test_allocation_within_limits():
    # Far from its place: thrusters are at their limits, integrals wait, and one dies on the way.
    gains = dict(kp=(40.0,) * 3, ki=(4.0,) * 3, kd=(60.0,) * 3, kr=(10.0,) * 3, kw=(4.0,) * 3)
    dead = lw.control.Fault(name="dead", of="thrusters", channel=2, time=0.5, gain=0.0, known=True)
    controller = lw.Controller(
        period=0.1, guidance=[lw.control.SetPoint(position=(3.0, -2.0, 8.0), heading=1.0)], laws=[lw.control.PosePID(**gains)],
        allocation=[lw.control.BoundedLeastSquares(to="thrusters")], faults=[dead],
    )  # fmt: skip
    check(fleet_of("bluerov2_heavy", controller=controller), "psi_s", saved={"fields": (*MOTION, "command", "unmet")})


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
    lw.solve(fleet, **how, t1=0.4, start=first.final, store=store, blocks=range(0, 1))
    last = lw.resume(store)
    whole = lw.solve(fleet, **how, t1=0.4)
    assert differences(whole, last) == []
    third = lw.solve(fleet, **how, t1=0.5, start=lw.open_run(store).final)
    assert differences(lw.solve(fleet, **how, t1=0.5), third) == []
    few = lw.open_run(store, members=[300, 2, 599]).final
    assert equal(few.lanes["state"], last.final.lanes["state"][[300, 2, 599]])


@pytest.mark.parametrize("callback", [False, True])
def test_metrics_of_pieces_add_up(callback):
    # Integrals over the ticks: what a period adds belongs to the piece in which it lies.
    each = lw.statistics.MemberValues()
    if callback:
        controller = lw.Controller(
            period=0.1, guidance=[lw.control.SetPoint(heading=0.8)], laws=[lw.control.Callback(law)]
        )
        scene = lw.Scene(lw.Vehicle(10.0, inertia=(1.0, 2.0, 3.0)), terms=[lw.terms.ControlWrench(limit=2.0)],
                         controller=controller)  # fmt: skip
        fleet = lw.Ensemble(scene, 20, 3)
        statistics = [lw.metrics.IAE("heading", then=each), lw.metrics.ISE("heading", then=each)]
    else:
        fleet = autopilot()
        statistics = [kind("depth", then=each) for kind in (lw.metrics.IAE, lw.metrics.ISE)]
        statistics += [lw.metrics.Effort(then=each)]
    how = dict(h=0.02, statistics=statistics, method="psi_s" if callback else "psi_x")
    whole, result, total = lw.solve(fleet, t1=1.0, **how), None, 0.0
    for t1 in (0.1, 0.4, 1.0):
        result = lw.solve(fleet, t1=t1, **how, start=None if result is None else result.final)
        total = total + np.array([estimate.value[-1] for estimate in result.statistics.values()])
    expected = np.array([estimate.value[-1] for estimate in whole.statistics.values()])
    np.testing.assert_allclose(total, expected, rtol=1e-12)


@pytest.mark.slow
def test_other_numbers_and_states():
    # With other numbers, or after a change, a run goes on from the states: to round-off where these are the same.
    fleet = fleet_of("torpedo", terms=list(CASES["waves"].terms))
    whole, first = one_run(fleet, "psi_x", length=0.1, pieces=4), one_run(fleet, "psi_x", length=0.1, pieces=2)
    same = first.final.changed(position=first.final.position)
    again = lw.solve(fleet, "psi_x", h=STEPS, t1=0.4, start=same)
    assert again.provenance["start"]["goes_on"] == "from states"
    np.testing.assert_allclose(again.position[-1], whole.position[-1], rtol=1e-13)
    np.testing.assert_allclose(again.velocity[-1], whole.velocity[-1], rtol=1e-11)
    # Other methods, steps and number types, too.
    for method, h, dtype, close in (("rk8", 0.01, "float64", 2e-4), ("psi_x", 0.02, "float32", 1e-5)):
        other = lw.solve(fleet, method, h=h, t1=0.4, dtype=dtype, start=first.final)
        np.testing.assert_allclose(other.position[-1], whole.position[-1], atol=close)
    moved = first.final.changed(position=first.final.position + np.array([1.0, 0.0, 0.0]))
    calm = fleet_of("torpedo", terms=[])
    far = lw.solve(calm, "psi_x", h=STEPS, t1=0.4, start=moved).position[-1]
    near = lw.solve(calm, "psi_x", h=STEPS, t1=0.4, start=first.final).position[-1]
    np.testing.assert_allclose(far - near, np.broadcast_to([1.0, 0.0, 0.0], far.shape), atol=1e-13)


def test_a_fall_goes_on_in_closed_form():
    # v(t) = v_inf tanh(t / tau) against quadratic drag; then it goes on with more drag.
    mass, k, g = 10.0, 30.0, 9.81
    vehicle = lw.Vehicle(mass, inertia=(1.0, 1.0, 1.0), buoyancy=0.0)
    drag = lw.terms.Drag(linear=(0.0,) * 6, quadratic=(k, k, k, 0.0, 0.0, 0.0))
    fleet = lw.Ensemble(lw.Scene(vehicle, lw.Environment(gravity=g), terms=[drag]))
    first = lw.solve(fleet, "rk8", h=0.01, t1=0.5)
    terminal = np.sqrt(mass * g / k)
    v = terminal * np.tanh(0.5 * g / terminal)
    assert first.velocity[-1, 0, 2] == pytest.approx(v, rel=1e-10)
    # With four times the drag it slows down: v = v_inf coth(...), above its new terminal speed.
    heavy = fleet.scene.with_numbers({"drag.quadratic": [4.0 * k] * 3 + [0.0] * 3})
    second = lw.solve(heavy, "rk8", h=0.005, t1=0.7, start=first.final)
    terminal = np.sqrt(mass * g / (4.0 * k))
    v = terminal / np.tanh(np.arctanh(terminal / v) + 0.2 * g / terminal)
    assert second.velocity[-1, 0, 2] == pytest.approx(v, rel=1e-9)


@pytest.mark.slow
def test_states_at_a_time():
    # Waves, a schedule and noise are those of the time: from states alone to round-off, where nothing is remembered.
    fleet = fleet_of("torpedo", terms=list(CASES["waves"].terms + CASES["wrench schedule"].terms))
    whole = one_run(fleet, "psi_x", pieces=4)
    run = lw.prepare(fleet.scene, method="psi_x", h=STEPS, t1=0.2)
    states = [getattr(whole, name)[2] for name in MOTION]
    numbers = {"vehicle.buoyancy": fleet.parameters(0, 20)["vehicle.buoyancy"]}
    late = run.states(*states, numbers, t0=0.2)
    assert late.time.tolist() == [0.2, 0.4]
    np.testing.assert_allclose(late.position[-1], whole.position[-1], rtol=1e-13)
    early = run.states(*states, numbers)
    assert np.abs(early.position[-1] - whole.position[-1]).max() > 1e-6


def test_what_is_refused():
    fleet = fleet_of("torpedo", terms=[])
    final = lw.solve(fleet, "psi_x", h=STEPS, t1=0.2).final
    few = lw.solve(fleet, "psi_x", h=STEPS, t1=0.2, save=lw.SaveAt(fields=("position",))).final
    for message, call in {
        "t1 = 0.2 is not after the start, 0.2 s": lambda: lw.solve(fleet, "psi_x", h=STEPS, t1=0.2, start=final),
        "is the end of 20 members, and there are 3": lambda: lw.solve(
            fleet.subset([1, 2, 3]), t1=1.0, h=0.1, start=final
        ),
        "is no end of a run": lambda: lw.solve(fleet, t1=1.0, h=0.1, start="final"),
        "save.at = 0.1 lies before the start": lambda: lw.solve(
            fleet, t1=1.0, h=0.02, start=final, save=lw.SaveAt(at=[0.1])
        ),
        "start.attitude = '...' was not kept": lambda: lw.solve(fleet, "rk4", t1=1.0, h=STEPS, start=few),
        "t0 = 0.05 is not a whole number of steps": lambda: lw.prepare(
            fleet.scene, method="psi_x", h=STEPS, t1=0.2
        ).states(final, t0=0.05),
        "lies between two ticks": lambda: lw.prepare(autopilot().scene, method="psi_x", h=0.01, t1=0.2).states(
            *(getattr(final, name) for name in MOTION), t0=0.05
        ),
    }.items():
        with pytest.raises(lw.SceneError, match=re.escape(message)):
            call()
    kept = lw.solve(fleet, "psi_x", h=STEPS, t1=0.2, keep="none", statistics=[lw.statistics.Mean("depth")])
    with pytest.raises(AttributeError, match=re.escape("Give SaveAt(final=True)")):
        _ = kept.final
    asked = lw.SaveAt(final=True, fields=("position",))
    kept = lw.solve(fleet, "psi_x", h=STEPS, t1=0.2, keep="none", statistics=[lw.statistics.Mean("depth")], save=asked)
    assert kept.final.members == 20


@pytest.mark.slow
@pytest.mark.parametrize("method", ["psi_x", "psi_s"])
def test_what_is_remembered_stays(method):
    # From states that somebody set anew, to what they were: the current and the thrusters go on with what they remember.
    fleet = fleet_of("torpedo", terms=list(CASES["Gauss-Markov current"].terms + CASES["thrusters"].terms))
    whole, first = one_run(fleet, method, pieces=4), one_run(fleet, method, pieces=2)
    states = {name: np.asarray(rows) for name, rows in first.final.states.items() if name != "attitude"}
    again = lw.solve(fleet, method, h=STEPS, t1=0.4, start=first.final.changed(**states))
    np.testing.assert_allclose(again.velocity[-1], whole.velocity[-1], atol=1e-12)
    np.testing.assert_allclose(again.position[-1], whole.position[-1], atol=1e-12)


@pytest.mark.slow
def test_another_step_counts_the_same_time():
    # What is noted in steps, the end of a member and the time from which commands act, is told in the steps of the next run.
    events = [lw.events.StopTime(at=0.31)]
    fleet = fleet_of("torpedo", events=events, terms=[])
    first = lw.solve(fleet, "psi_x", h=STEPS, t1=0.4)
    second = lw.solve(fleet, "psi_x", h=0.025, t1=0.6, start=first.final)
    np.testing.assert_allclose(second.failure_time, 0.31, atol=1e-9)
    delayed = autopilot(vary={"controller.delay": lw.distributions.Choice([0.02])})
    whole = lw.solve(delayed, "psi_x", h=0.005, t1=1.0)
    finer = lw.solve(delayed, "psi_x", h=0.005, t1=0.5)
    coarse = lw.solve(delayed, "psi_x", h=0.01, t1=1.0, start=finer.final)
    # Commands that would act only after as many of the longer steps differ by a tenth of a radian; the step does by 1e-4.
    np.testing.assert_allclose(coarse.attitude[-1], whole.attitude[-1], atol=2e-3)


@pytest.mark.slow
def test_an_end_that_does_not_fit():
    fleet = fleet_of("torpedo", events=[lw.events.StopTime(at=0.1)], terms=[])
    final = lw.solve(fleet, "psi_x", h=STEPS, t1=0.2).final
    with pytest.raises(lw.SceneError, match="an event stopped which the scene does not have"):
        lw.solve(fleet_of("torpedo", terms=[]), "psi_x", h=STEPS, t1=0.4, start=final)
    torn = dataclasses.replace(final, lanes={**final.lanes, "state": final.lanes["state"][:, :7]})
    with pytest.raises(lw.SceneError, match=r"start\.state = .*is damaged"):
        lw.solve(fleet, "psi_x", h=STEPS, t1=0.4, start=torn)
    run = lw.prepare(fleet.scene, method="psi_x", h=STEPS, t1=0.2)
    for odd in (-1.0, float("nan"), "soon"):
        with pytest.raises(lw.SceneError, match="t0 = "):
            run.states(final, t0=odd)
