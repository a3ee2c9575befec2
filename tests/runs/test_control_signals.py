# SPDX-License-Identifier: Apache-2.0
"""Measured, wanted, demanded and commanded values, and actuators' places: saved with every sample, for every member."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
import warp as wp

import lgvi_warp as lw
from lgvi_kernels.law import div, mul, neg, ones, positive, sub, vec3  # noqa: F401
from lgvi_warp.common.status import Status, under_way
from lgvi_warp.control import Callback, HeadingPID, PseudoInverse, SetPoint, signals
from lgvi_warp.control.base import ControlLaw
from lgvi_warp.engine import launches
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics.fields import FIELDS
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.statistics import Mean, Quantiles
from lgvi_warp.store.folder import Folder
from tests.support.stores import differing
from tests.unit.views.test_recording import rows

# Those of a scene without a filter, without parts that iterate, and without an estimate of the position.
OTHERS = [name for name, signal in signals.SIGNALS.items() if signal.group == signals.ESTIMATE]
OTHERS += [signals.ENERGY_USED, signals.UNCONVERGED, signals.NAVIGATION_ERROR, signals.REJECTED]
SIGNALS, SAVED = (tuple(name for name in names if name not in OTHERS) for names in (signals.SIGNALS, signals.SAVED))
H, EVERY, STEPS, MEMBERS = 0.01, 5, 60, 600
LIMIT, LAG, DELAY = 0.4, 0.1, 2
KP, KD, LEVEL = 1.0, 2.0, 3.0
CURRENT = np.array([0.2, 0.1, 0.0])
FLOOR = 5.4
SETTINGS = {"h": H, "t1": STEPS * H, "save": lw.SaveAt(every=H, fields=SAVED)}


@wp.func
def control(w: Any, r: Any, y: Any, p: Any):
    """A force downward; no number from a time on."""
    unity = ones(p.time)
    # Half a step is added, since times are sums that round.
    well = positive(p.time - (y.t + y.h.dtype(0.5) * y.h) * unity, unity, unity - unity)
    w.force = vec3(w.force.x, w.force.y, w.force.z + p.level * (well / well))
    return w


class Device:
    """The device code of Spoiled."""

    control = control


@lw.laws.register
@dataclass(frozen=True, eq=False, kw_only=True)
class Spoiled(ControlLaw):
    """A law that gives no number from a time on."""

    type: ClassVar[str] = "spoiled"
    demands: ClassVar[tuple[str, ...]] = ("Z",)
    device: ClassVar[Any] = Device

    level: Any = lw.laws.number((), "N")
    time: Any = lw.laws.number((), "s", 1e6)


def scene(controller=True, lag=LAG, delay=DELAY * H, events=True):
    """A body in a current, which turns to a heading and sinks."""
    laws = [{"type": "heading_pid", "kp": KP, "kd": KD}, {"type": "spoiled", "level": LEVEL}]
    wrench = {"type": "control_wrench", "limit": [1e3] * 5 + [LIMIT], "time_constant": [lag] * 6}
    content = {
        "vehicle": {"mass": 20.0, "inertia": [1.0, 1.2, 1.4], "added_mass": [5.0, 10.0, 12.0], "buoyancy": 196.2},
        "start": {"position": [0.0, 0.0, 5.0]},
        "terms": [{"type": "current", "velocity": CURRENT.tolist()}, wrench],
        "events": [{"type": "floor", "depth": FLOOR}] if events else [],
    }
    guidance = [{"type": "set_point", "depth": 10.0, "heading": 0.5}]
    section = {"period": EVERY * H, "delay": delay, "guidance": guidance, "laws": laws}
    return lw.Scene.from_dict(content | ({"controller": section} if controller else {}))


def fleet(members=MEMBERS, spoiled=(), **settings):
    """Members that differ in their starts; some, {index: time}, whose law is spoiled from that time on."""
    random = np.random.default_rng(1)
    b = np.array([0.0, 0.0, 5.0]) + 0.1 * random.normal(size=(members, 3))
    yaw, nu = random.uniform(-2.0, 2.0, members), random.normal(size=(members, 3))
    c, s, zero, one = np.cos(yaw), np.sin(yaw), np.zeros(members), np.ones(members)
    R = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=1).reshape(-1, 3, 3)
    Om = 0.3 * random.normal(size=(members, 3)) * [0.0, 0.0, 1.0]
    nu[:, 2] = np.abs(nu[:, 2]) * (np.arange(members) % 3 == 0)
    time = np.full(members, 1e6)
    for index, at in dict(spoiled).items():
        time[index] = at
    return lw.Ensemble.from_states(scene(**settings), b, R, nu, Om, {"spoiled.time": time})


@pytest.fixture(scope="module")
def complete():
    return lw.solve(fleet(), "psi_s", **SETTINGS)


def same(x, y, members=slice(None), names=SAVED):
    """Whether two results have the same bits of these members."""
    return all(getattr(x, name)[:, members].tobytes() == getattr(y, name)[:, members].tobytes() for name in names)


def looked():
    """The steps at which samples were taken, by the tick that holds for each."""
    return np.arange(STEPS + 1) // EVERY * EVERY


@pytest.mark.slow
def test_a_scene_names_what_is_saved(complete):
    names = ("position", "command")
    run = lw.Scene.from_dict({**scene().to_dict(), "run": {"save_every": H, "save_fields": list(names)}})
    assert list(lw.Scene.from_dict(run.to_dict()).run.save_fields) == list(names)
    members = fleet()
    members.scene = run
    result = lw.solve(members, "psi_s", h=H, t1=STEPS * H)
    assert tuple(result.samples) == names
    assert same(result, complete, names=names)
    # The call decides, where it says something.
    assert lw.solve(members, "psi_s", h=H, t1=H, save=lw.SaveAt(fields=("velocity",))).samples.keys() == {"velocity"}
    bare = lw.Scene.from_dict({**scene(controller=False).to_dict(), "run": {"save_fields": ["command"]}})
    with pytest.raises(lw.SceneError, match=r"run.save_fields = 'command' is a signal of a controller"):
        lw.solve(bare, "psi_s", h=H, t1=H)


def free(result):
    """Members that no event stopped."""
    return np.flatnonzero(result.status == 0)


@pytest.mark.ci
def test_a_sample_on_a_tick_shows_what_that_tick_demands(complete):
    at, well = looked(), free(complete)
    assert 50 < len(well) < MEMBERS
    assert set(complete.status) == {0, Status.FLOOR}
    R, Om = complete.attitude[:, well], complete.angular_velocity[:, well]
    heading = np.arctan2(R[..., 1, 0], R[..., 0, 0])
    error = np.arctan2(np.sin(0.5 - heading), np.cos(0.5 - heading))
    # Of the state at the tick itself, t = 0 among them, and held until the next one.
    demand = np.zeros((STEPS + 1, len(well), 6))
    demand[..., 2], demand[..., 5] = LEVEL, (KP * error - KD * Om[..., 2])[at]
    np.testing.assert_allclose(complete.demand[:, well], demand, atol=1e-13)
    delivered = np.clip(complete.demand, [-1e3] * 5 + [-LIMIT], [1e3] * 5 + [LIMIT])
    assert (delivered != complete.demand).any()
    assert (delivered[..., 5] == complete.demand[..., 5]).any()
    np.testing.assert_allclose(complete.command, delivered, atol=1e-13)
    np.testing.assert_allclose(complete.unmet, complete.demand - delivered, atol=1e-13)


def test_actuators_follow_the_commands_late_and_slowly(complete):
    well = free(complete)
    command, where = complete.command[:, well], np.zeros((STEPS + 1, len(well), 6))
    for k in range(STEPS):
        u = command[k - DELAY] if k >= DELAY else np.zeros_like(command[0])
        where[k + 1] = u + (where[k] - u) * np.exp(-H / LAG)
    np.testing.assert_allclose(complete.actuator[:, well], where, atol=1e-13)


def test_measured_and_wanted(complete):
    at, well = looked(), free(complete)
    R = complete.attitude[at][:, well]
    truth = {name: getattr(complete, name)[at][:, well] for name in FIELDS}
    truth["water_velocity"] = truth["velocity"] - np.einsum("knji,j->kni", R, CURRENT)
    truth |= {"depth": truth["position"][..., 2], "heading": np.arctan2(R[..., 1, 0], R[..., 0, 0])}
    for name, value in truth.items():
        np.testing.assert_allclose(getattr(complete, f"measured_{name}")[:, well], value, atol=1e-14, err_msg=name)
    c, s = np.cos(0.5), np.sin(0.5)
    wanted = {"attitude": [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], "depth": 10.0, "heading": 0.5, "speed": 0.0}
    wanted |= {"position": [0.0, 0.0, 10.0], "velocity": [0.0] * 3, "angular_velocity": [0.0] * 3}
    wanted["angular_acceleration"] = [0.0] * 3
    assert {f"reference_{name}" for name in wanted} | {f"measured_{name}" for name in truth} == {
        name for name in SIGNALS if "_" in name
    }
    for name, value in wanted.items():
        values = getattr(complete, f"reference_{name}")
        np.testing.assert_allclose(values, np.broadcast_to(value, values.shape), atol=1e-15, err_msg=name)


def test_a_member_that_an_event_stops_keeps_the_signals_of_its_last_whole_step(complete):
    stopped = np.flatnonzero(complete.status == Status.FLOOR)
    last = np.floor(complete.failure_time[stopped] / H).astype(int)
    # In the first step after a tick, and in others.
    assert len(stopped) > 50
    assert set(last % EVERY) == set(range(EVERY))
    for name in SIGNALS:
        values = getattr(complete, name)
        for member, k in zip(stopped, last, strict=True):
            assert (values[k + 1 :, member] == values[k, member]).all(), name


@pytest.mark.ci
def test_threads_launches_and_blocks_give_the_same_bits(complete, monkeypatch):
    assert same(complete, lw.solve(fleet(), "psi_s", **SETTINGS, threads=1))
    few = lw.solve(fleet(), "psi_s", **SETTINGS | {"save": lw.SaveAt(at=[0.1, 0.23], fields=SAVED)}, threads=2)
    for name in SAVED:
        assert getattr(few, name).tobytes() == getattr(complete, name)[[0, 10, 23, STEPS]].tobytes()
    monkeypatch.setattr(launches, "SEGMENT_SAMPLE_BYTES", 7 * 256 * 100 * 8)
    plan = make_plan(fleet(), "psi_s", **SETTINGS)
    assert len(list(plan.launches.segments(256))) > 5
    assert same(complete, lw.solve(fleet(), "psi_s", **SETTINGS))


@pytest.mark.ci
def test_signals_change_nothing_of_the_motion_and_cost_nothing_where_nobody_asks(complete):
    settings = SETTINGS | {"save": lw.SaveAt(every=H)}
    plan = make_plan(fleet(), "psi_s", **settings)
    assert not plan.spec.control.reports
    assert not plan.spec.control.headings
    assert plan.layout.signal_rows == ()
    assert same(complete, lw.solve(fleet(), "psi_s", **settings), names=FIELDS)
    # What a tick writes anyway needs no other kernel.
    everything = SETTINGS | {"save": lw.SaveAt(every=H, fields=("demand", "measured_position", "reference_attitude"))}
    assert make_plan(fleet(), "psi_s", **everything).spec == plan.spec
    held = SETTINGS | {"save": lw.SaveAt(every=H, fields=("command", "unmet"))}
    assert make_plan(fleet(), "psi_s", **held).spec == plan.spec
    result = lw.solve(fleet(), "psi_s", **held)
    assert set(result.samples) == {"command", "unmet"}
    assert same(complete, result, names=("command", "unmet"))
    with pytest.raises(AttributeError, match=r"demand was not kept: add 'demand' to SaveAt\(fields="):
        _ = result.demand


# Two in one packet, and in other blocks one each.
SPOILED = {1: 0.0, 7: 0.3, 301: 0.0, 599: 0.3}


def check_spoiled(complete, spoiled):
    """Members whose law gives no number fail at that tick; no other bit changes."""
    members = np.array([*SPOILED])
    assert (complete.status[members] == 0).all()
    others = np.setdiff1d(np.arange(MEMBERS), members)
    assert same(complete, spoiled, others)
    assert (spoiled.status[others] == complete.status[others]).all()
    assert (spoiled.status[members] == Status.CONTROL_NON_FINITE).all()
    np.testing.assert_allclose(spoiled.failure_time[members], [max(0.0, at - H) for at in SPOILED.values()], atol=1e-12)
    for member, at in SPOILED.items():
        k = max(0, round(at / H) - 1)
        for name in FIELDS:
            # At the first tick a member rests at its start.
            np.testing.assert_array_equal(
                getattr(spoiled, name)[: k + 1, member], getattr(complete, name)[: k + 1, member]
            )
            held, stop = getattr(spoiled, name)[k + 1 :, member], getattr(complete, name)[k, member]
            # The lead of the next step is made and undone.
            round_off = 8 * np.finfo(held.dtype).eps * max(1.0, np.abs(stop).max())
            np.testing.assert_allclose(held, np.broadcast_to(stop, held.shape), rtol=0.0, atol=round_off)
        for name in SIGNALS:
            values = getattr(spoiled, name)[:, member]
            if k:
                assert values[: k + 1].tobytes() == getattr(complete, name)[: k + 1, member].tobytes(), name
            assert values[k:].tobytes() == np.repeat(values[k : k + 1], len(values) - k, axis=0).tobytes(), name
        if not k:
            assert np.isnan(spoiled.demand[0, member, 2])
            assert (spoiled.command[:, member] == 0.0).all()


@pytest.mark.ci
def test_a_law_that_gives_no_number_ends_its_member_alone(complete):
    spoiled = lw.solve(fleet(spoiled=SPOILED), "psi_s", **SETTINGS)
    check_spoiled(complete, spoiled)
    assert "a command of the controller is not finite" in Status.CONTROL_NON_FINITE.text


@pytest.mark.slow
@pytest.mark.parametrize(("method", "dtype"), [("rk4", "float64"), ("psi_s", "float32")])
def test_of_other_methods_and_numbers(complete, method, dtype):
    unlike = {} if method == "psi_s" else {"lag": 0.0}
    well = lw.solve(fleet(**unlike), method, dtype=dtype, **SETTINGS)
    check_spoiled(well, lw.solve(fleet(spoiled=SPOILED, **unlike), method, dtype=dtype, **SETTINGS))
    assert all(getattr(well, name).dtype == np.dtype(dtype) for name in SAVED)
    if dtype == "float32":
        both = (complete.status == 0) & (well.status == 0)
        for name in set(SAVED) - {"unmet"}:
            a, b = getattr(complete, name)[:, both], getattr(well, name)[:, both]
            np.testing.assert_allclose(b, a, atol=STEPS * 2.0**-23 * max(1.0, np.abs(a).max()), err_msg=name)
    else:
        # Without a lag an actuator is at once where the command is, once that arrives.
        np.testing.assert_array_equal(well.actuator[DELAY:, free(well)], well.command[:-DELAY, free(well)])


@pytest.mark.slow
def test_a_tick_sees_both_parts_of_compensated_sums():
    # Without events the lead of the next step is merged with the end of this one, and undone for a tick.
    result = lw.solve(fleet(events=False), "psi_s", dtype="float32_compensated", **SETTINGS)
    well = free(result)
    assert (result.position.dtype, result.measured_position.dtype) == (np.float64, np.float32)
    for name in ("position", "attitude", "velocity", "angular_velocity"):
        # Half a step at these speeds moves a body by 1e-2 m.
        here, there = getattr(result, name)[looked()][:, well], getattr(result, f"measured_{name}")[:, well]
        np.testing.assert_allclose(there, here, rtol=0.0, atol=2.0**-22 * np.abs(here).max(), err_msg=name)


@pytest.mark.ci
def test_a_store_holds_them_and_goes_on(complete, tmp_path):
    path, part = tmp_path / "whole.zarr", tmp_path / "part.zarr"
    stored = lw.solve(fleet(), "psi_s", **SETTINGS, store=path)
    assert same(complete, stored)
    lw.solve(fleet(), "psi_s", **SETTINGS, store=part, blocks=range(1))
    assert not Folder(part).complete
    lw.resume(part)
    assert differing(path, part) == []
    opened = lw.open_run(path)
    assert same(complete, opened)
    assert opened.dataset["command"].dims == ("time", "realization", "command_0")
    for name in SAVED:
        here, there = complete.dataset[name], opened.dataset[name]
        assert (here.dims, here.attrs) == (there.dims, there.attrs), name
    loaded = lw.Result.load(complete.save(tmp_path / "result.npz"))
    assert same(complete, loaded)
    assert set(loaded.samples) == set(SAVED)


@pytest.mark.ci
@pytest.mark.slow_for("laws1")
@pytest.mark.parametrize(
    "laws", [[HeadingPID(kp=KP)], [Callback(lambda t, y, r, members: np.zeros((len(members), 6)))]]
)
def test_a_file_knows_which_terms_the_controller_drives(laws, tmp_path):
    """Fins that are driven have no command of their own: energies and pictures of a file must not ask for it."""
    wanted = SetPoint(heading=0.5)
    loop = lw.Controller(period=0.1, guidance=[wanted], laws=laws, allocation=[PseudoInverse(to="control_fins")])
    (fins,) = (term for term in lw.Scene.named("remus_100", controller=loop).terms if term.type == "control_fins")
    start = lw.Start(velocity=[1.54, 0.0, 0.0])
    driven = lw.Scene(lw.Vehicle(30.0, inertia=(0.2, 3.0, 3.0)), terms=[fins], start=start, controller=loop)
    result = lw.solve(driven, "psi_s", h=0.1, t1=0.5)
    loaded = lw.Result.load(result.save(tmp_path / "result.npz"))
    lw.solve(driven, "psi_s", h=0.1, t1=0.5, store=tmp_path / "run.zarr")
    for other in (loaded, lw.open_run(tmp_path / "run.zarr")):
        assert other.energy.tobytes() == result.energy.tobytes()
        assert invariants.at_work(other) == invariants.at_work(result)
        lw.plots.summary(other, path=tmp_path / "fleet.png")
        assert (tmp_path / "fleet.png").stat().st_size > 0


@pytest.mark.ci
def test_members_that_are_kept_after_all_have_them(complete, tmp_path):
    kept = lw.solve(fleet(), "psi_s", **SETTINGS, keep=[5, 300]).kept
    stored = lw.solve(fleet(), "psi_s", **SETTINGS, keep=[5, 300], store=tmp_path / "run.zarr").kept
    for name in SAVED:
        assert getattr(kept, name).tobytes() == getattr(complete, name)[:, [5, 300]].tobytes(), name
        assert getattr(stored, name).tobytes() == getattr(complete, name)[:, [5, 300]].tobytes(), name


def test_a_recording_shows_commands_and_actuators(complete, tmp_path):
    path, early = lw.record(complete, tmp_path / "fleet.rrd"), under_way(complete)[3]
    for name in ("command", "actuator"):
        median = np.median(getattr(complete, name)[3, early, 5])
        assert rows(path, f"/{name}/5", "scalars")[3 * H] == pytest.approx([median])
    assert not rows(path, "/demand/5", "scalars")
    assert not rows(path, "/command/6", "scalars")


@pytest.mark.slow
def test_statistics_and_quantities_of_interest(complete):
    statistics = [Mean("command[5]"), Mean("measured_depth"), Mean("max(norm(demand))")]
    statistics += [Quantiles("actuator[2]"), Mean("reference_speed")]
    lean = lw.solve(fleet(), "psi_s", **SETTINGS, statistics=statistics, keep="none")
    found = lean.statistics
    np.testing.assert_allclose(found["mean command[5]"].value[:, 0], complete.command[..., 5].mean(axis=1), rtol=1e-12)
    np.testing.assert_allclose(
        found["mean measured_depth"].value[:, 0], complete.measured_depth.mean(axis=1), rtol=1e-12
    )
    size = np.linalg.norm(complete.demand, axis=-1).max(axis=0)
    np.testing.assert_allclose(found["mean max(norm(demand))"].value, size.mean(), rtol=1e-12)
    run = lw.prepare(
        fleet(), of=["max(norm(demand))", "command[5]"], method="psi_s", h=H, t1=STEPS * H, save=SETTINGS["save"]
    )
    np.testing.assert_allclose(run(), np.stack([size, complete.command[-1, :, 5]], axis=1), rtol=1e-12)


@pytest.mark.parametrize(("requested", "text"), [
    ({"save": lw.SaveAt(fields=("position", "demand"))}, "save.fields = 'demand'"),
    ({"statistics": [Mean("command[0]")]}, "statistics = 'command'"),
])  # fmt: skip
def test_a_scene_without_a_controller_has_none(requested, text):
    why = r" is a signal of a controller, which this scene has not. Give \[controller\]"
    with pytest.raises(lw.SceneError, match=text + why):
        lw.solve(scene(controller=False), "psi_s", h=H, t1=1.0, **requested)


@pytest.mark.ci
def test_names_that_are_not_known():
    with pytest.raises(lw.SceneError, match=r"save.fields = 'commands' is not known. Did you mean 'command'\?"):
        lw.SaveAt(fields=("commands",))
    with pytest.raises(lw.SceneError, match=r"is not one channel of command. Give one: 'command\[0\]'"):
        Mean("command")
    with pytest.raises(lw.SceneError, match=r"demand has the components demand\[0\]"):
        Mean("demand[6]")
    with pytest.raises(lw.SceneError, match=r"is beyond the 6 channels .*. Give 'command\[0\]' to 'command\[5\]'"):
        lw.solve(fleet(), "psi_s", **SETTINGS, statistics=[Mean("command[6]")])
