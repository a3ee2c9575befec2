# SPDX-License-Identifier: Apache-2.0
"""The event mission_done: members end at the tick at which the twin's guidance is done, whatever else is in the scene."""

import numpy as np
import pytest

import lgvi_warp as lw
from tests.control.test_circles_and_docks import CIRCLES, EVERY, WAY, H, T, scene, states
from tests.support.loops import twin_loop, twin_run

WAYS = {
    "stop": (WAY | dict(method="ilos"), 600),
    "in time": (WAY | dict(times=(1.0, 12.0, 20.0, 28.0)), 640),
    "circles": (CIRCLES, 1600),
    "loiter": (CIRCLES | dict(at_end="loiter", loiter_turns=(0.0, 0.0, 0.0, 0.0)), 1600),
}
DONE = lw.events.MissionDone()


def way(words=WAY, events=(DONE,), **more):
    """The scene whose guidance are these waypoints, with events."""
    return scene(lw.control.Waypoints(**words), events=list(events), **more)


def fleet(words=WAY, n=3, parameters=None, **more):
    """Members that start at other places, with look-aheads of their own."""
    parameters = {"waypoints.look_ahead": np.array([1.0, 1.1, 0.9])[:n] * words["look_ahead"]} | (parameters or {})
    return lw.Ensemble.from_states(way(words, **more), *states(n), parameters)


def solved(members, t1, **more):
    """A run with its samples at the ticks."""
    return lw.solve(members, "psi_s", h=H, t1=t1, **{"save": lw.SaveAt(every=T), **more})


@pytest.mark.ci
@pytest.mark.parametrize("name", WAYS)
@pytest.mark.slow_but("stop")
def test_a_member_ends_at_the_tick_of_the_twin(name):
    words, steps = WAYS[name]
    members = fleet(words, n=2)
    result = solved(members, steps * H)
    for i in range(2):
        numbers = {"waypoints.look_ahead": members.select(0, 2).parameters["waypoints.look_ahead"][i]}
        body, loop = twin_loop(members.scene, numbers, EVERY, H)
        b, R = twin_run(body, loop, "psi_s", H, steps, *(x[i] for x in states(2)))
        assert 0.0 < loop.parts[0].done < steps * H - T
        assert result.status[i] == lw.Status.MISSION_DONE
        # A tick is a whole number of steps: its time is one product.
        assert result.end_time[i] == loop.parts[0].done
        last = round(loop.parts[0].done / H)
        # As in test_circles_and_docks.py: some hundred ticks of a stable loop, of numbers of size 10.
        assert np.abs(result.position[-1, i] - b[last]).max() < 1e-9
        assert np.abs(result.attitude[-1, i] - R[last]).max() < 1e-9


@pytest.mark.ci
@pytest.mark.slow_for("float32")
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_until_then_it_is_the_run_without_the_event(dtype):
    with_event, without = (solved(fleet(events=e), 60.0, dtype=dtype) for e in ([DONE], []))
    assert with_event.status.counts() == {"mission_done": 3}
    for i, end in enumerate(with_event.end_time):
        rows = with_event.time <= end + 1e-9
        assert 20 < rows.sum() < len(rows)
        same = {"float64": 0.0, "float32": 1e-4}[dtype]
        np.testing.assert_allclose(with_event.position[rows, i], without.position[rows, i], rtol=0.0, atol=1e-9 + same)
        assert np.ptp(with_event.position[~rows, i], axis=0).max() == 0.0


@pytest.mark.ci
@pytest.mark.slow_for("after")
@pytest.mark.parametrize("place", [0, 1], ids=["before", "after"])
def test_the_first_of_two_events_counts_also_within_a_step_that_ends_at_the_last_tick(place):
    end, events = solved(fleet(), 60.0).end_time, [DONE]
    events.insert(place, lw.events.StopTime(at=0.0))
    # In the step before the tick at which the mission is done, and after it.
    for off, status in ((-0.4 * H, "time"), (-1e-3 * H, "time"), (0.4 * H, "mission_done"), (7.0, "mission_done")):
        result = solved(fleet(events=events, parameters={"time.at": end + off}), 60.0)
        assert result.status.counts() == {status: 3}
        np.testing.assert_allclose(result.end_time, end + min(off, 0.0), rtol=0.0, atol=1e-12)


@pytest.mark.ci
def test_it_is_an_outcome_with_its_time_and_energy():
    ends = lw.statistics.EndTime("mission_done", then=[lw.statistics.Mean()])
    asked = [lw.statistics.Outcome("mission_done"), ends]
    members = fleet()
    result = solved(members, 60.0, statistics=asked)
    assert result.statistics["outcome mission_done"].value[-1] == 1.0
    mean = result.statistics["mean end_time mission_done"].value.ravel()[-1]
    assert mean == pytest.approx(result.end_time.mean(), rel=1e-12)
    power = lw.Scene.from_dict(
        members.scene.to_dict() | {"terms": [*members.scene.to_dict()["terms"], {"type": "energy_use", "hotel": 12.0}]}
    )
    used = solved(lw.Ensemble.from_states(power, *states(3)), 60.0, save=lw.SaveAt(fields=("position", "energy_used")))
    np.testing.assert_allclose(used.energy_used[-1], 12.0 * used.end_time, rtol=1e-12)


@pytest.mark.ci
def test_a_run_in_two_parts_and_in_a_store_ends_at_the_same_tick(tmp_path):
    members, whole = fleet(), solved(fleet(), 60.0)
    # One part ends between two ticks, one at the very tick of the first member's end, which the next part notices.
    for middle in (5.03, float(whole.end_time.min())):
        begun = solved(members, round(middle / H) * H, save=lw.SaveAt(final=True))
        assert set(begun.status.counts()) == {"ok"}
        again = lw.solve(members, "psi_s", h=H, t1=60.0, start=begun.final)
        np.testing.assert_array_equal(again.status, whole.status)
        np.testing.assert_allclose(again.end_time, whole.end_time, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(again.position[-1], whole.position[-1], rtol=0.0, atol=1e-12)
    stored = solved(members, 60.0, store=tmp_path / "run.zarr")
    np.testing.assert_array_equal(lw.open_run(tmp_path / "run.zarr").status, whole.status)
    np.testing.assert_array_equal(stored.end_time, whole.end_time)


def test_a_scene_file_names_it():
    scene = way()
    again = lw.Scene.from_dict(scene.to_dict())
    assert again.to_dict()["events"] == [{"type": "mission_done", "guidance": "waypoints"}]
    assert lw.Status.MISSION_DONE.text == "stopped by an event: reached all waypoints of its mission"


@pytest.mark.parametrize(
    ("words", "event"),
    [(WAY | dict(at_end="go_on"), DONE), (WAY, lw.events.MissionDone(guidance="other"))],
    ids=["goes on", "another name"],
)
def test_guidance_that_never_ends_is_refused(words, event):
    with pytest.raises(lw.SceneError, match=r"mission_done\.guidance.*is the name of no guidance that ends. Give"):
        way(words, [event])


def test_a_scene_without_waypoints_is_refused():
    with pytest.raises(lw.SceneError, match=r"mission_done\.guidance.*at_end is \"stop\" or \"loiter\""):
        lw.Scene.named("sphere", events=[DONE])
    with pytest.raises(lw.SceneError, match=r"mission_done\.guidance"):
        scene(lw.control.Loiter(center=(3.0, 1.0, 4.0), radius=5.0, speed=1.0, look_ahead=2.0), events=[DONE])


def test_no_scene_without_it_has_a_row_of_memory_for_it():
    assert not way(events=[]).controller.bus.done
    assert way(events=[]).controller.bus.rows + 2 == way().controller.bus.rows
