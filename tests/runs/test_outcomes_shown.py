# SPDX-License-Identifier: Apache-2.0
"""An outcome is not a failure: pictures, recordings, summaries and exit codes of members that events stopped."""

import dataclasses
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from rerun.chunk import RrdReader

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.cli import report
from lgvi_warp.common import status
from lgvi_warp.common.errors import install
from lgvi_warp.common.status import Status, StatusArray, failed, stopped
from lgvi_warp.physics import energy as invariants
from lgvi_warp.results import outcomes
from lgvi_warp.views import fleet as looks
from tests.laws import cases
from tests.support.refusals import says
from tests.unit.views.test_recording import rows

GRAVITY = 10.0
# Neutrally buoyant with M = m I: each goes straight on at its speed, as in test_events, whose kernel this is.
VEHICLE = lw.Vehicle(20.0, inertia=(1.0, 1.2, 1.4), added_mass=(10.0, 10.0, 10.0), buoyancy=20.0 * GRAVITY)
FLOOR = 8.0
SPEEDS = np.array([1.0, 0.5, 0.25, 0.1, 0.0, -0.4, -1.0])
# From depth 5 in 20 s: three sink to the floor after 3, 6 and 12 s, two surface after 12.5 and 5 s, two go on.
OUTCOMES = [Status.FLOOR] * 3 + [Status.OK] * 2 + [Status.SURFACE] * 2


def divers(speeds):
    """Members that start at depth 5 and sink at these speeds [m/s]."""
    n = len(speeds)
    scene = lw.Scene(
        VEHICLE, lw.Environment(gravity=GRAVITY), events=[lw.events.Surface(), lw.events.Floor(depth=FLOOR)]
    )
    down = np.array([0.0, 0.0, 1.0])
    level = np.broadcast_to(np.eye(3), (n, 3, 3))
    return lw.Ensemble.from_states(scene, np.tile(5.0 * down, (n, 1)), level, np.outer(speeds, down), np.zeros((n, 3)))


@pytest.fixture(scope="module")
def mixed():
    """Seven members of three outcomes."""
    result = lw.solve(divers(SPEEDS), h=0.1, t1=20.0, save=lw.SaveAt(every=1.0))
    assert list(result.status) == OUTCOMES
    return result


@pytest.fixture(scope="module")
def sunk():
    """Five members that all sink to the floor."""
    result = lw.solve(divers(np.linspace(0.3, 1.0, 5)), h=0.1, t1=20.0, save=lw.SaveAt(every=1.0))
    assert result.status.counts() == {"floor": 5}
    return result


def ending(result, codes, times):
    """The same result, its members ended so at these times."""
    status, value = np.array(codes, np.uint8).view(StatusArray), np.ones(len(codes))
    return dataclasses.replace(result, status=status, failure_time=np.array(times), failure_value=value)


def acted_on(result, term):
    """The same samples, as if this term had acted as well."""
    numbers = {f"{term.key}.{name}": value[None] for name, value in term.parameters().items()}
    return dataclasses.replace(result, terms=(term,), parameters=dict(result.parameters) | numbers)


def drawn(result):
    """The panels of a run at a glance, by title, and the title of the whole."""
    axes = lw.plots.summary(result)
    return {one.get_title(): one for one in axes}, axes[0].figure.get_suptitle()


def texts(axes):
    """All texts of a panel's legend, its title in front."""
    legend = axes.get_legend()
    return [legend.get_title().get_text(), *(text.get_text() for text in legend.get_texts())]


def marks(axes, code):
    """Marks of members with an outcome (m, 2)."""
    color = tuple(part / 255.0 for part in looks.OUTCOME_STYLES[code].rgb)
    found = [
        one for one in axes.collections if one.get_offsets().size and np.allclose(one.get_facecolor()[0, :3], color)
    ]
    return np.concatenate([one.get_offsets() for one in found])


def test_failed_and_stopped_are_told_apart():
    codes = np.array([0, 1, 2, 16, 17, 20, 255], np.uint8)
    assert failed(codes).tolist() == [False, True, True, False, False, False, True]
    assert stopped(codes).tolist() == [False, False, False, True, True, True, False]
    assert all(bool(stopped(code)) == code.stopped for code in Status)
    of_result = codes.view(StatusArray)
    assert (of_result.failed == failed(codes)).all()
    assert (of_result.stopped == stopped(codes)).all()


@pytest.mark.slow
def test_members_are_under_way_until_they_end(mixed):
    end = status.stop_time(mixed)
    np.testing.assert_allclose(end, [3.0, 6.0, 12.0, np.inf, np.inf, 12.5, 5.0], rtol=1e-9)
    np.testing.assert_array_equal(status.under_way(mixed).sum(axis=0), [4, 7, 13, 21, 21, 13, 6])


def test_a_sample_at_the_last_good_step_counts():
    # 0.1 * 3 is not 0.3 in floating point: a member that failed at its third step is under way at the sample of that time.
    few = SimpleNamespace(
        time=np.array([0.0, 0.3, 0.6]), status=np.array([1, 1]), failure_time=np.array([0.3 - 1e-16, 0.1])
    )
    assert status.under_way(few).tolist() == [[True, True], [True, False], [False, False]]


@pytest.mark.ci
def test_the_first_in_time_is_named(mixed):
    assert outcomes.outcome_text(mixed, Status.FLOOR).startswith(
        "floor, 3 of 7 members (first: member 0 at 3 s): stopped"
    )
    assert outcomes.outcome_text(mixed, Status.SURFACE).startswith("surface, 2 of 7 members (first: member 6 at 5 s): ")
    assert outcomes.failure_text(mixed) == ""
    two = ending(mixed, [1, 0, 1, 0, 17, 0, 0], [8.0, np.nan, 2.0, np.nan, 1.0, np.nan, np.nan])
    said = outcomes.failure_text(two).splitlines()
    assert len(said) == 1
    assert said[0].startswith("step_too_large, 2 of 7 members (first: member 2 at 2 s, value 1): the step")


def test_the_fan_is_of_those_under_way(mixed):
    depth = drawn(mixed)[0]["Depth"]
    median = next(line for line in depth.lines if line.get_label() == "median").get_ydata()
    path = 5.0 + np.outer(np.arange(21.0), SPEEDS)
    end = [3.0, 6.0, 12.0, 99.0, 99.0, 12.5, 5.0]
    expected = [np.median(row[np.array(end) + 1e-9 >= time]) for time, row in enumerate(path)]
    np.testing.assert_allclose(median, expected, atol=1e-9)
    assert texts(depth)[0] == "under way: 7 at 0 s,\n2 at 20 s"


@pytest.mark.ci
def test_the_fan_ends_where_all_have(sunk):
    depth = drawn(sunk)[0]["Depth"]
    median = next(line for line in depth.lines if line.get_label() == "median").get_ydata()
    assert np.isfinite(median[:11]).all()
    assert np.isnan(median[11:]).all()


def test_ends_are_marked_and_counted_by_outcome(mixed):
    panels, head = drawn(mixed)
    depth, above = panels["Depth"], panels["7 members from above"]
    assert head == "7 members, psi_s, step 0.1 s: 2 ok, 2 surface, 3 floor"
    assert {"floor (3)", "surface (2)"} <= set(texts(depth))
    assert {"ok", "floor", "surface"} <= set(texts(above))
    at = marks(depth, Status.FLOOR)
    np.testing.assert_allclose(np.sort(at[:, 0]), [3.0, 6.0, 12.0], rtol=1e-9)
    np.testing.assert_allclose(at[:, 1], FLOOR, atol=1e-6)
    np.testing.assert_allclose(np.sort(marks(depth, Status.SURFACE)[:, 0]), [5.0, 12.5], rtol=1e-9)
    np.testing.assert_allclose(marks(above, Status.FLOOR), 0.0, atol=1e-6)


@pytest.mark.ci
def test_failures_are_drawn_until_they_fail(mixed):
    some = ending(mixed, [1, 1, 1, 0, 0, 2, 17], [2.0, 2.0, 4.0, np.nan, np.nan, 6.0, 5.0])
    panels, head = drawn(some)
    title = "7 members, psi_s, step 0.1 s: 2 ok, 3 step_too_large, 1 not_converged, 1 floor"
    assert head == title
    assert {"step_too_large (3)", "not_converged (1)", "floor (1)"} <= set(texts(panels["Depth"]))
    # A colour says failure, a marker says which.
    assert len(marks(panels["Depth"], Status.STEP_TOO_LARGE)) == 4
    # What an event stopped at once has its marks.
    assert len(marks(drawn(ending(mixed, [17] * 7, [0.0] * 7))[0]["Depth"], Status.FLOOR)) == 7
    every = ending(mixed, [1] * 7, [3.0] * 7)
    assert np.isfinite(drawn(every)[0]["Depth"].lines[0].get_ydata()).sum() == 4


def test_outcomes_look_different():
    seen = [(look.color, look.marker) for look in looks.OUTCOME_STYLES.values()]
    assert set(looks.OUTCOME_STYLES) == set(Status)
    assert len(set(seen)) == len(seen)
    assert len({look.color for code, look in looks.OUTCOME_STYLES.items() if code == Status.OK or code.stopped}) == 10


def test_nothing_to_draw_says_why(mixed, tmp_path):
    nowhere = {"position": np.full_like(mixed.position, np.nan)}
    lost = ending(dataclasses.replace(mixed, samples=dict(mixed.samples) | nowhere), [3] * 7, [0.0] * 7)
    for draw in (lw.plots.summary, lw.record):
        with pytest.raises(ValueError, match="nothing to draw"):
            draw(lost, path=tmp_path / "fleet.png")


def test_drift_is_of_the_times_under_way(mixed, sunk):
    assert all(0.0 <= value < 1e-9 for value in invariants.drift(sunk).values())
    # What a member is at after its end is no motion of its.
    after = {name: values.copy() for name, values in mixed.samples.items()}
    after["velocity"][4:, 0] *= 3.0
    moved = dataclasses.replace(mixed, samples=after)
    assert invariants.drift(moved)["energy"] == invariants.drift(mixed)["energy"] < 1e-9
    assert invariants.drift(ending(moved, [0] * 7, [np.nan] * 7))["energy"] > 1.0
    some = ending(mixed, [1, 17, 0, 0, 0, 0, 0], [1.0, 6.0] + [np.nan] * 5)
    assert np.isfinite(list(invariants.drift(some).values())).all()
    assert np.isnan(list(invariants.drift(ending(mixed, [1] * 7, [1.0] * 7)).values())).all()


# What acts beside weight and buoyancy, and what is conserved then.
ALL = {"energy", "horizontal_momentum", "vertical_angular_momentum"}
ACTING = {"still drag": (lw.terms.Drag(linear=np.zeros(6), quadratic=np.zeros(6)), ALL),
          "drag": (lw.terms.Drag(linear=np.ones(6), quadratic=np.zeros(6)), set()),
          "thrust": (lw.terms.Wrench(force=[1.0, 0.0, 0.0]), set()),
          "noise": (lw.terms.WrenchNoise(force=[0.1, 0.0, 0.0]), set()),
          "moving water": (lw.terms.Current(velocity=[0.2, 0.0, 0.0]), set()),
          "layers": (lw.terms.Stratification(gradient=0.01), ALL),
          "an anchor": (lw.terms.Tether(anchor=[0.0, 0.0, 8.0], stiffness=2.0), {"energy"})}  # fmt: skip


@pytest.mark.parametrize("name", ACTING)
def test_energy_error_only_where_energy_is_conserved(mixed, name):
    term, kept = ACTING[name]
    result = acted_on(mixed, term)
    assert invariants.conserved(result) == kept
    assert invariants.at_work(result) == (() if "energy" in kept else (term.key,))
    asked = ("Energy error", "E(t) - E(0) [J]") if "energy" in kept else ("Energy", "E(t) [J]")
    energy = drawn(dataclasses.replace(result, status=np.zeros(7, np.uint8).view(StatusArray)))[0][asked[0]]
    assert energy.get_ylabel() == asked[1]
    first = next(line for line in energy.lines if line.get_label() == "median").get_ydata()[0]
    assert first == pytest.approx(0.0 if "energy" in kept else np.median(result.energy[0]), abs=1e-12)


@pytest.mark.parametrize("name", cases.CASES)
def test_terms_say_of_energy_what_their_device_code_does(name):
    from lgvi_kernels import built_in

    for term in cases.CASES[name].terms:
        module = built_in("laws", term.device_in(True))
        follows = getattr(module, "POTENTIAL", False) and not hasattr(module, "damping") and not hasattr(module, "flow")
        # An account acts on nothing.
        assert ("energy" in term.conserves) == (follows or term.accounts)


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class Own(lw.laws.Term):
    """A law of a user's own."""

    type = "own"
    device = SimpleNamespace(POTENTIAL=True)


class Told(Own):
    """One whose potential is known to the host."""

    def potential(self, numbers, position, attitude, parameters):
        return position[..., 2]


class Timed(Told):
    """One whose potential varies in time."""

    timed = True


class Braking(Told):
    """One that damps as well."""

    device = SimpleNamespace(POTENTIAL=True, damping=None)


def test_a_law_of_the_users_own_conserves_energy_by_its_potential():
    assert [sorted(kind().conserves) for kind in (Own, Told, Timed, Braking)] == [[], ["energy"], [], []]


def entry_of(path):
    """The recording in a file."""
    return RrdReader(path).recordings()[0]


@pytest.mark.ci
def test_every_run_has_ids_of_its_own(mixed, sunk, tmp_path):
    again = lw.solve(divers(SPEEDS), h=0.1, t1=20.0, save=lw.SaveAt(every=1.0))
    part = mixed.part(np.array([0, 1]))
    other = mixed.part(np.array([2, 3]))
    ids = []
    for i, result in enumerate((mixed, again, sunk, part, other)):
        entry = entry_of(lw.record(result, tmp_path / f"{i}.rrd"))
        blueprint = RrdReader(tmp_path / f"{i}.rrd").blueprints()[0]
        assert entry.recording_id in entry.application_id
        assert blueprint.application_id == entry.application_id
        ids.append((entry.application_id, entry.recording_id))
    assert ids[0] == ids[1]
    assert len(set(ids)) == 4
    assert len({application for application, _ in ids}) == len({recording for _, recording in ids}) == 4


def test_the_ids_are_those_of_the_saved_result(mixed, tmp_path):
    saved = lw.Result.load(mixed.save(tmp_path / "result.npz"))
    assert looks.identity(saved) == looks.identity(mixed)


def test_a_recording_shows_each_member_by_its_outcome_from_then_on(mixed, tmp_path):
    path = lw.record(mixed, tmp_path / "fleet.rrd")
    names = ("ok", "floor", "surface")
    seen = {name: rows(path, f"/world/bodies/{name}", "translations") for name in names}
    scales = {name: rows(path, f"/world/bodies/{name}", "scales") for name in seen}
    visible = {
        name: [
            sum(scale[0] == 1.0 for scale in scales[name][t]) if scales[name] else len(seen[name][t])
            for t in seen[name]
        ]
        for name in seen
    }
    under_way = status.under_way(mixed)
    assert visible["ok"] == under_way.sum(axis=1).tolist()
    for name, code in (("floor", Status.FLOOR), ("surface", Status.SURFACE)):
        assert visible[name] == (~under_way & (mixed.status == code)).sum(axis=1).tolist()
    np.testing.assert_allclose(np.array(seen["floor"][20.0]), mixed.position[-1, :3], atol=1e-5)
    assert all(np.isfinite(pose).all() for frames in seen.values() for pose in frames.values())


@pytest.mark.ci
def test_a_stored_run_is_recorded_in_pieces_as_one_in_memory(mixed, tmp_path, monkeypatch):
    from lgvi_warp.views import choice

    stored = lw.solve(divers(SPEEDS), h=0.1, t1=20.0, save=lw.SaveAt(every=1.0), store=lw.Store(tmp_path / "run.zarr"))
    assert stored.store is not None
    monkeypatch.setattr(choice, "AT_ONCE", 21 * 3)  # three members at once
    paths = [lw.record(one, tmp_path / f"{i}.rrd") for i, one in enumerate((mixed, stored))]
    for entity, ending in (
        ("/world/bodies/ok", "translations"), ("/curves/height/median", "scalars"), ("/curves/speed/all", ":values"),
        ("/curves/energy/median", "scalars"), ("/members/floor", "scalars"),
    ):  # fmt: skip
        first, second = (rows(path, entity, ending) for path in paths)
        assert first.keys() == second.keys()
        assert len(first) == 21
        for t in first:
            np.testing.assert_array_equal(np.array(first[t]), np.array(second[t]))
    assert [entry_of(lw.record(stored, tmp_path / "2.rrd")).recording_id] == [entry_of(paths[1]).recording_id]


@pytest.mark.ci
def test_statistics_of_all_make_the_fan_where_few_members_were_kept(mixed):
    from lgvi_warp.views.drawn import LEVELS, drawn_of

    statistics = [lw.statistics.Quantiles("depth"), lw.statistics.Extremes("depth")]
    save = lw.SaveAt(every=1.0)
    lean = lw.solve(divers(SPEEDS), h=0.1, t1=20.0, save=save, keep=[0, 3], statistics=statistics)
    run = drawn_of(lean)
    expected = np.quantile(-mixed.position[..., 2], LEVELS, axis=1)
    np.testing.assert_allclose(run.fans[0].levels[[0, -1]], expected[[0, -1]], rtol=1e-6)
    between = (run.fans[0].levels[1:-1] >= expected[0] - 1e-6) & (run.fans[0].levels[1:-1] <= expected[-1] + 1e-6)
    assert between.all()
    assert (run.text, run.members.tolist()) == ("2 of 7 members", [0, 3])
    assert run.shares[Status.FLOOR][-1] == pytest.approx(3 / 7)


SCENE = """
[vehicle]
mass = 20.0
inertia = [1.0, 1.2, 1.4]
added_mass = [10.0, 10.0, 10.0]
buoyancy = 200.0
[environment]
gravity = 10.0
[start]
position = [0.0, 0.0, 5.0]
velocity = [0.0, 0.0, 1.0]
[[events]]
type = "surface"
[[events]]
type = "floor"
depth = 8.0
[ensemble]
members = 4
[ensemble.vary]
"start.velocity" = { normal = { std = 0.05 } }
[run]
step = 0.1
duration = 20.0
save_every = 1.0
"""


@pytest.fixture
def scene_file(tmp_path):
    path = tmp_path / "sink.toml"
    path.write_text(SCENE)
    return path


def run(scene_file, capsys, *options):
    """Exit code, stdout and stderr of a run into the folder beside."""
    code = cli.main(["run", str(scene_file), "--out", str(scene_file.parent / "out"), *options])
    said = capsys.readouterr()
    return code, said.out, said.err


@pytest.mark.ci
def test_a_run_that_all_sink_exits_with_0_and_has_its_pictures(scene_file, capsys):
    code, said, errors = run(scene_file, capsys)
    assert code == 0
    assert "nan" not in said
    assert "not written" not in errors
    files = sorted(path.name for path in (scene_file.parent / "out").iterdir())
    assert files == ["fleet.png", "fleet.rrd", "result.npz"]
    says(
        said,
        "All 4 members are stopped by an event (floor 4), the first at ",
        "drift       energy ",
        "floor, 4 of 4 members (first: member",
    )


def test_members_that_are_kept_since_they_failed_are_drawn(mixed, tmp_path):
    few = ending(mixed, [1] * 7, [2.0] * 7)
    written = report.write(few, few, tmp_path)
    assert (written.faults, written.empty) == ([], [])
    assert len(written.files) == 3
    # One that failed at once has no picture, which is no fault of the run.
    at_once = ending(mixed, [1] * 7, [0.0] * 7)
    written = report.write(mixed, at_once, tmp_path)
    assert written.faults == []
    assert "fleet.png was not written: every member failed before" in written.empty[0]


def test_the_summary_says_work_where_forces_do_some(mixed):
    driven = acted_on(mixed, ACTING["thrust"][0])
    (line,) = report.energy_lines(driven, driven)
    assert line.startswith("work        energy changed by up to ")
    assert "J, through wrench (largest of all members)" in line
    tethered = acted_on(mixed, ACTING["an anchor"][0])
    (line,) = report.energy_lines(tethered, tethered)
    assert line.startswith("drift       energy ")
    assert "momentum" not in line
    lost = ending(mixed, [1] * 7, [2.0] * 7)
    assert report.energy_lines(lost, lost) == []


@pytest.mark.ci
@pytest.mark.parametrize(("absent", "files", "words"), [
    (["matplotlib"], ["fleet.rrd", "result.npz"], "fleet.png: not made without matplotlib. "),
    (["rerun"], ["fleet.png", "result.npz"], "fleet.rrd: not made without rerun-sdk. "),
    (["matplotlib", "rerun"], ["result.npz"], "fleet.png, fleet.rrd: not made without matplotlib and rerun-sdk. "),
])  # fmt: skip
def test_a_plain_installation_runs(scene_file, capsys, monkeypatch, absent, files, words):
    for name in absent:
        for module in [name, *(one for one in sys.modules if one.startswith(f"{name}."))]:
            monkeypatch.setitem(sys.modules, module, None)
    code, said, errors = run(scene_file, capsys)
    assert code == 0
    assert "not written" not in errors
    assert f"note        {words}To have pictures: {install('viz')}\n" in said
    assert sorted(path.name for path in (scene_file.parent / "out").iterdir()) == files


def test_keep_failed_keeps_no_outcome(mixed):
    from lgvi_warp.engine.keepers.observation import Observation

    codes = np.array([0, 1, 16, 17, 18, 19, 20, 5])
    assert Observation(keep="failed").again(codes).tolist() == [1, 7]


REMUS = """
[vehicle]
name = "remus_100"
buoyancy = 280.0
[start]
position = [0.0, 0.0, 5.0]
[[events]]
type = "floor"
depth = 20.0
[ensemble]
members = 8
[ensemble.vary]
"start.angular_velocity" = { normal = { std = 0.1 } }
[run]
method = "psi_x"
step = 0.02
duration = 120.0
save_every = 1.0
"""


@pytest.mark.slow
def test_remus_100_that_all_sink(tmp_path, capsys):
    path = tmp_path / "sink.toml"
    path.write_text(REMUS)
    code, said, _ = run(path, capsys)
    assert code == 0
    assert "All 8 members are stopped by an event (floor 8), the first at " in said
    assert "nan" not in said
    assert "J, through drag_matrix, control_fins, wrench, body_lift (largest of all members)" in said
    assert len(list((tmp_path / "out").iterdir())) == 3
    result = lw.Result.load(tmp_path / "out" / "result.npz")
    assert np.isfinite(list(invariants.drift(result).values())).all()
