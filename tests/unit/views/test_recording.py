# SPDX-License-Identifier: Apache-2.0
"""Recordings read back, beyond what is recorded: two together, odd runs, what is refused, viewers, sizes and times."""

import dataclasses
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import Status, failed, under_way
from lgvi_warp.views import drawn
from lgvi_warp.views.fleet import OUTCOME_STYLES
from lgvi_warp.views.recording import layout, viewer, world
from lgvi_warp.views.recording import words as ten_words
from tests.support.made import made
from tests.support.viewer import started_by
from tests.unit.views.test_hull import glb

rr.set_strict_mode(True)


def fleet(n=40, k=31, seed=1, **named):
    """Members that dive in a bow: some reach the floor, some the surface, some fail; others go on."""
    rng, time = np.random.default_rng(seed), np.linspace(0.0, 60.0, k)
    heading, slope = rng.normal(0.5, 0.2, n), rng.normal(0.0, 0.08, n)
    t = time[:, None]
    position = np.stack([t * np.cos(heading), t * np.sin(heading), 10.0 + 5.0 * np.sin(t / 9.0) + t * slope], axis=-1)
    angles = [
        np.broadcast_to(x, (k, n)) for x in (20.0 * np.sin(t / 3.0), -20.0 * np.cos(t / 9.0), np.degrees(heading))
    ]
    attitude = lw.notation.matrix_from_euler_deg(np.stack(angles, axis=-1).reshape(-1, 3)).reshape(k, n, 3, 3)
    status, end = np.zeros(n, int), np.full(n, np.nan)
    for code, beyond in ((Status.FLOOR, position[..., 2] > 16.0), (Status.SURFACE, position[..., 2] < 4.0)):
        reached = beyond.any(axis=0) & (status == 0)
        status[reached], end[reached] = code, time[beyond.argmax(axis=0)][reached]
    status[:2], end[:2] = Status.NON_FINITE, 11.0
    for i in np.flatnonzero(status):
        position[np.searchsorted(time, end[i]) :, i] = position[np.searchsorted(time, end[i]), i]
    named.setdefault("scene", SCENE)
    return made(position, time, status=status, end=end, attitude=attitude, seed=seed, **named)


SCENE = lw.Scene.named("remus_100", events=[{"type": "floor", "depth": 16.0}, {"type": "surface", "depth": 4.0}],
                       terms=[{"type": "current", "velocity": [0.1, -0.2, 0.0]}])  # fmt: skip


def rows(path, entity, ending, recording=None):
    """Time -> value of a component of an entity."""
    found = {}
    reader = RrdReader(path)
    stream = reader.stream() if recording is None else reader.stream(store=recording)
    for chunk in stream.filter(content=entity):
        batch = chunk.to_record_batch()
        column = next((name for name in batch.schema.names if name.endswith(ending)), None)
        if column and "sim_time" in batch.schema.names:
            times = batch.column("sim_time").cast("int64").to_numpy() / 1e9
            found |= dict(zip(times.tolist(), batch.column(column).to_pylist(), strict=True))
    return found


def text_of(path, entity, recording=None):
    """All text of an entity."""
    reader = RrdReader(path)
    stream = reader.stream() if recording is None else reader.stream(store=recording)
    return " ".join(
        str(text)
        for chunk in stream.filter(content=entity)
        for column in chunk.to_record_batch().columns
        for text in column.to_pylist()
    )


def entities(path):
    """Names of the entities in a file."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


@pytest.fixture(scope="module")
def mixed():
    result = fleet()
    assert set(result.status.counts()) == {"ok", "non_finite", "surface", "floor"}
    return result


@pytest.fixture(scope="module")
def path(mixed, tmp_path_factory):
    return lw.record(mixed, tmp_path_factory.mktemp("recording") / "fleet.rrd")


def test_what_filters_believe_is_drawn_beside_their_errors(tmp_path):
    run = fleet()
    rng, shape = np.random.default_rng(3), run.position.shape[:2]
    off = rng.normal(size=(*shape, 3)) * [0.3, 0.4, 0.1]
    samples = dict(run.samples) | {"measured_position": run.position + off, "nees": rng.chisquare(15, shape)}
    samples["estimate_sigma"] = rng.uniform(0.1, 0.5, (*shape, 15))
    path = tmp_path / "believed.rrd"
    lw.record(dataclasses.replace(run, samples=samples), path)
    alive = under_way(run)
    for frame in (0, 20):
        t, counted = float(run.time[frame]), alive[frame]
        wanted = {
            "/curves/position_error/median": np.linalg.norm(off, axis=-1),
            "/curves/position_error/believed": np.linalg.norm(samples["estimate_sigma"][..., :3], axis=-1),
            "/curves/nees/median": samples["nees"],
        }
        for entity, values in wanted.items():
            median = np.median(values[frame, counted])
            assert rows(path, entity, "scalars")[t] == pytest.approx([median], rel=1e-5)
    plain = tmp_path / "plain.rrd"
    lw.record(run, plain)
    assert not rows(plain, "/curves/position_error/median", "scalars")


def test_two_recordings_together_are_each_as_alone(mixed, path, tmp_path):
    import rerun_cli

    other = lw.record(fleet(20, seed=2), tmp_path / "other.rrd")
    both = tmp_path / "both.rrd"
    program = str(Path(rerun_cli.__file__).with_name("rerun"))
    subprocess.run([program, "rrd", "merge", str(path), str(other), "-o", str(both)], check=True, capture_output=True)
    entries = {entry.recording_id: entry for entry in RrdReader(both).recordings()}
    assert len(entries) == 2
    assert len({entry.application_id for entry in entries.values()}) == 2
    for alone in (path, other):
        (entry,) = RrdReader(alone).recordings()
        for entity, ending in (("/world/bodies/ok", "translations"), ("/curves/height/median", "scalars")):
            assert rows(both, entity, ending, entries[entry.recording_id]) == rows(alone, entity, ending)


def test_the_ellipsoid_holds_those_under_way_and_stays_in_the_water():
    # A fleet that gathers below the surface: its distribution is skew, and a covariance would reach above.
    rng = np.random.default_rng(3)
    cloud = rng.normal(size=(2, 4000, 3))
    cloud[..., 2] = rng.exponential(2.0, size=(2, 4000))
    spread = drawn.drawn_of(made(cloud)).spread
    top = spread.center[0, 2] - np.linalg.norm(spread.axes[0][2] * spread.half[0])
    assert top > -0.2
    assert cloud[0, :, 2].mean() - 2.8 * cloud[0, :, 2].std() < -3.0
    along = (cloud[0] - spread.center[0]) @ spread.axes[0] / spread.half[0]
    np.testing.assert_allclose((np.abs(along) <= 1.0).mean(axis=0), 0.95, atol=0.002)
    np.testing.assert_allclose(np.linalg.det(spread.axes), 1.0, rtol=1e-6)


def test_headings_are_circular():
    # Around south, which is 180 and -180 degrees: the fan is narrow, and its median goes on through it.
    angles = np.radians(180.0 + np.linspace(-20.0, 20.0, 41)[None] + np.arange(0.0, 400.0, 20.0)[:, None])
    attitude = lw.notation.matrix_from_euler_deg(
        np.stack([0 * angles, 0 * angles, np.degrees(angles)], axis=-1).reshape(-1, 3)
    ).reshape(20, 41, 3, 3)
    heading = drawn.drawn_of(made(np.zeros((20, 41, 3)), attitude=attitude)).fans[3]
    assert heading.name == "heading"
    np.testing.assert_allclose(heading.levels[-1] - heading.levels[0], 40.0, atol=1e-3)
    np.testing.assert_allclose(np.diff(heading.levels[3]), 20.0, atol=1e-3)


def test_extremes_are_of_all_members_and_quantiles_of_many():
    cloud = np.random.default_rng(5).normal(size=(2, 21_000, 3))
    run = drawn.drawn_of(made(cloud))
    assert len(run.choice.ranked) == 20_000
    height = run.fans[0].levels
    np.testing.assert_allclose(
        height[[0, -1]].T, np.stack([-cloud[..., 2].max(1), -cloud[..., 2].min(1)], axis=1), rtol=1e-6
    )
    np.testing.assert_allclose(height[3], -np.median(cloud[:, run.choice.ranked, 2], axis=1), rtol=1e-5)
    assert run.above == (cloud[..., 2] < 0.0).any(axis=0).sum()


def test_the_water_is_said_to_be_unbounded_where_members_leave_it(tmp_path):
    up = np.linspace(5.0, -0.5, 5)[:, None, None] * np.ones((1, 4, 3))
    up[:, 0, 2] = 5.0
    path = lw.record(made(up), tmp_path / "up.rrd")
    assert "| unbounded water: 3 of 4 members pass above depth 0 |" in text_of(path, "/run/summary")
    # Half a metre above the surface a vehicle floats; beyond, there is no surface, but a grid at depth 0.
    names = [entities(path), entities(lw.record(made(3.0 * up), tmp_path / "far.rrd"))]
    assert ["/world/water/surface" in one for one in names] == [True, False]
    assert all("/world/water/surface_grid" in one and "/world/water/floor" not in one for one in names)


def test_forces_balance_the_momentum():
    # A sphere that a known force accelerates: the third arrow is that force.
    t = np.linspace(0.0, 2.0, 21)
    scene = lw.Scene.named("sphere")
    force = 30.0
    mass = scene.vehicle.mass + scene.vehicle.added_mass[0, 0]
    position = np.zeros((21, 1, 3))
    position[:, 0, 0] = 0.5 * force / mass * t**2
    run = drawn.drawn_of(made(position, t))
    forces, points = world.forces_on(run)
    np.testing.assert_allclose(forces[2:-2, 2], [[force, 0.0, 0.0]] * 17, atol=1e-3)
    np.testing.assert_allclose(forces[:, 0] + forces[:, 1], 0.0, atol=1e-9)
    assert points.shape == (3, 3)
    # Speeds are of half a step after the start and before the end.
    kinetic = 0.5 * mass * (force / mass) ** 2 * (1.95**2 - 0.05**2)
    assert ten_words.energy_text(run) == f"drift {kinetic:.2g} J, the largest of the members drawn"


def test_the_current_is_drawn_as_it_flows(mixed, path):
    run = drawn.drawn_of(mixed)
    np.testing.assert_allclose(world.water_at(run, np.zeros((2, 3))), np.broadcast_to([0.1, -0.2, 0.0], (31, 2, 3)))
    assert "current, up to 0.22 m/s" in text_of(path, "/world/current")
    assert "/world/current" not in entities(lw.record(made(np.zeros((2, 1, 3))), path.parent / "still.rrd"))


@pytest.mark.parametrize("spans", [(1.0, 1.0, 1.0), (100.0, 3.0, 1.0), (1.0, 200.0, 5.0), (1.0, 1.0, 300.0)])
@pytest.mark.parametrize("aspect", [1.3, 0.65])
def test_the_eye_sees_the_whole_box(spans, aspect):
    far = layout.distance(np.zeros(3), np.array(spans), aspect)
    right = np.cross(layout.SIGHT, (0.0, 0.0, -1.0))
    right /= np.linalg.norm(right)
    corners = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * spans - 0.5 * np.array(spans)
    depth = corners @ layout.SIGHT + far
    across, above = corners @ right / depth, corners @ np.cross(right, layout.SIGHT) / depth
    inside = max(np.abs(across).max() / aspect, np.abs(above).max()) / np.tan(np.radians(27.5))
    assert (depth > 0.0).all()
    assert inside == pytest.approx(0.9)


@pytest.mark.parametrize("span", [(30.0, 30.0, 15.0), (600.0, 40.0, 60.0), (2.0, 3.0, 900.0), (0.1, 0.1, 0.1)])
@pytest.mark.parametrize("many", [1, 3])
def test_a_hull_across_the_sight_is_25_by_5_pixels_wherever_it_is(span, many):
    """By a pinhole camera of its own: 600 pixels are 55 degrees high, and the farthest corner is the worst."""
    corners = 20.0 + np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]) * np.array(span)
    result = made(np.stack([corners, corners]), scene=lw.Scene.named("remus_100"))
    run = drawn.drawn_of(result)
    box = world.box_of([run])
    scale = world.scale_of(run, box, layout.ASPECT / many)
    eye = 0.5 * (box.low + box.high) - layout.distance(box.low, box.high, layout.ASPECT / many) * layout.SIGHT
    pixels = 600.0 / (2.0 * np.tan(np.radians(27.5)) * ((corners - eye) @ layout.SIGHT))
    length, diameter = 1.33, 0.191
    assert (scale * length * pixels).min() >= 25.0
    assert (scale * diameter * pixels).min() >= 5.0
    least = (scale - 1) * min(length / 25.0, diameter / 5.0) * pixels.min()
    assert scale == 1 or least < 1.4, "no larger than is needed"


def test_each_run_has_its_own_floors(tmp_path):
    """One with a floor, one without, one with two: side by side, in one box."""
    two = [{"type": "floor", "depth": 18.0}, {"type": "floor", "depth": 25.0, "name": "deep"}]
    scenes = {"one": SCENE, "none": lw.Scene.named("remus_100"), "two": lw.Scene.named("remus_100", events=two)}
    path = lw.record({name: fleet(9, 7, scene=scene) for name, scene in scenes.items()}, tmp_path / "three.rrd")
    drawn_planes = {
        name: sorted(
            entity.rsplit("/", 1)[1] for entity in entities(path) if entity.startswith(f"/world/{name}/water/")
        )
        for name in scenes
    }
    surface = ["surface", "surface_grid"]
    assert drawn_planes["one"] == sorted(["floor", "floor_grid", *surface])
    assert drawn_planes["none"] == sorted(["depth_grid", *surface])
    assert drawn_planes["two"] == sorted(["floor", "floor_grid", "floor_1", "floor_1_grid", *surface])
    assert "floor at 16 m" in text_of(path, "/run/summary/one")
    assert "no floor" in text_of(path, "/run/summary/none")
    assert "floor at 18 and 25 m" in text_of(path, "/run/summary/two")


def test_members_that_ended_stand_out_from_the_floor():
    """By the ratio of luminances of WCAG 2, section 1.4.11: 3 for what has to be seen."""
    channel = np.array([[*OUTCOME_STYLES[Status.FLOOR].rgb], world.SAND[:3]]) / 255.0
    linear = np.where(channel <= 0.04045, channel / 12.92, ((channel + 0.055) / 1.055) ** 2.4)
    bright, dark = np.sort(linear @ [0.2126, 0.7152, 0.0722])[::-1]
    assert (bright + 0.05) / (dark + 0.05) > 3.0


def test_all_bodies_lie_in_the_box(mixed):
    for result in (mixed, made(np.zeros((2, 1, 3)) + 5.0), fleet(3, 5)):
        box = world.box_of([drawn.drawn_of(result)])
        assert (result.position >= box.low - 1e-5).all()
        assert (result.position <= box.high + 1e-5).all()
        assert box.size > 0.0
        assert (box.high > box.low).all()


ODD = {
    "one vehicle": lambda: fleet(1, 60),
    "two samples": lambda: fleet(30, 2),
    "one sample": lambda: made(np.zeros((1, 3, 3)) + 5.0),
    "all failed at once": lambda: made(np.ones((4, 9, 3)), status=np.full(9, 3), end=np.zeros(9)),
    "all stopped": lambda: made(np.ones((4, 9, 3)), status=np.full(9, 17), end=np.full(9, 1.5)),
    "lost": lambda: made(np.stack([np.ones((5, 3)), np.full((5, 3), np.nan)]), status=np.full(5, 3), end=np.zeros(5)),
    "in float32": lambda: fleet(5, 9, dtype=np.float32),
    "without rates": lambda: bare(fleet(5, 9), "angular_velocity"),
}


def bare(result, *fields):
    """The same result without some samples."""
    return dataclasses.replace(result, samples={k: v for k, v in result.samples.items() if k not in fields})


@pytest.mark.parametrize("name", ODD)
def test_odd_runs_have_a_recording_that_fits(name, tmp_path):
    result = ODD[name]()
    path = lw.record(result, tmp_path / "odd.rrd")
    names, summary = entities(path), text_of(path, "/run/summary")
    bands = {"/curves/height/all", "/curves/height/90_percent", "/curves/height/50_percent"}
    assert bool(bands & names) == (result.members > 1)
    assert ("SaveAt(every=...)" in summary) == (len(result.time) < 3)
    partly = name == "without rates"
    assert ("not known: not all of the motion was kept" in summary) == partly
    assert ("not known: every member drawn failed" in summary) == (failed(result.status).all() and not partly)
    assert "nan" not in summary
    assert "1 members" not in summary
    counts = ", ".join(f"{name} {number}" for name, number in result.status.counts().items())
    assert f"| outcome | {counts} |" in summary
    poses = [rows(path, one, "translations") for one in names if one.startswith("/world/bodies/")]
    assert all(np.isfinite(pose).all() for frames in poses for pose in frames.values())
    assert ("/world/spread" in names) == (result.members > 3)
    assert ("/curves/energy/median" in names) == (name not in ("without rates", "lost"))


def test_members_asked_for_are_drawn(mixed, tmp_path):
    path = lw.record(mixed, tmp_path / "few.rrd", members=[17, 3])
    assert len(rows(path, "/world/bodies/ok", "translations")[0.0]) == 2
    assert "2 of 40 drawn" in text_of(path, "/run/summary")
    # Curves stay those of all.
    assert rows(path, "/members/under_way", "scalars")[0.0] == [100.0]


def lean(mixed, **named):
    """The same run, of which samples of the members 3, 5 and 9 were kept alone."""
    kept = np.array([3, 5, 9])
    return dataclasses.replace(mixed, samples={}, kept=mixed.part(kept), kept_members=kept, **named)


def test_of_kept_members_alone_no_others_are_drawn(mixed, tmp_path):
    assert drawn.drawn_of(lean(mixed), [9, 3]).members.tolist() == [3, 9]
    with pytest.raises(lw.SceneError, match=r"members = 4 has no samples. Keep them: keep=\[4\]"):
        lw.record(lean(mixed), tmp_path / "kept.rrd", members=[4])


def test_a_mesh_is_drawn_times_a_whole_number(tmp_path):
    mesh = glb(tmp_path / "hull.glb", 0.5)
    vehicle = dataclasses.replace(lw.Scene.named("sphere").vehicle, shape={"mesh": str(mesh)})
    result = made(np.array([[[0.0, 0, 5]], [[100.0, 0, 5]], [[200.0, 0, 5]]]), scene=lw.Scene(vehicle))
    path = lw.record(result, tmp_path / "mesh.rrd")
    run = drawn.drawn_of(result)
    box = world.box_of([run])
    scale = world.scale_of(run, box)
    assert scale > 5
    assert rows(path, "/world/bodies/ok", "scales")[1.0][0] == [scale] * 3
    assert f"drawn {scale} times their size" in text_of(path, "/run/summary")
    mesh.unlink()
    with pytest.raises(lw.SceneError, match=r"vehicle\.shape\.mesh = 'hull\.glb' cannot be read"):
        lw.record(result, tmp_path / "mesh.rrd")


def test_a_recording_goes_to_a_stream(mixed, tmp_path):
    stream = rr.RecordingStream("mine", recording_id="mine")
    stream.save(tmp_path / "mine.rrd")
    flushed, flush = [], stream.flush
    stream.flush = lambda **named: flushed.append(flush(**named))
    assert lw.record(mixed, to=stream) is None
    # All is with the viewer when the call returns.
    assert len(flushed) == 1
    stream.disconnect()
    assert "| outcome |" in text_of(tmp_path / "mine.rrd", "/run/summary")


def test_a_viewer_that_takes_no_more_leaves_the_whole_file(tmp_path, mixed, monkeypatch):
    # rerun says so by a RuntimeError when its sender has stopped.
    whole = lw.record(mixed, tmp_path / "whole.rrd").read_bytes()

    def flush(self):
        raise RuntimeError("sender shut down prematurely")

    monkeypatch.setattr(rr.RecordingStream, "flush", flush)
    monkeypatch.setattr(rr.RecordingStream, "set_sinks", lambda *_, **__: None)
    monkeypatch.setattr(viewer, "reach", lambda address: None)
    monkeypatch.setattr(viewer, "answers", lambda *_: True)
    with pytest.raises(OSError, match=r"could not be sent .*. Start the viewer again"):
        lw.record(mixed, tmp_path / "fleet.rrd", to="rerun+http://127.0.0.1:9/proxy")
    assert abs(len((tmp_path / "fleet.rrd").read_bytes()) - len(whole)) < 0.01 * len(whole)


@pytest.mark.parametrize(("arguments", "kind", "words"), [
    ({"members": [40]}, lw.SceneError, "members = 40 is none of the 40 members. Give indices from 0 to 39"),
    ({"members": [-1]}, lw.SceneError, "members = -1 is negative. Count members from 0"),
    ({"members": []}, lw.SceneError, "names no member"),
    ({"members": "3"}, lw.SceneError, "is not a list of members"), ({"path": None}, ValueError, "Give path="),
    ({"to": "rerun+http://127.0.0.1:9/proxy"}, OSError, 'no viewer answers .*Start a viewer with "rerun"'),
    ({"to": "nowhere"}, OSError, "no viewer answers"),
])  # fmt: skip
def test_bad_input_is_one_line_with_the_remedy(mixed, tmp_path, arguments, kind, words):
    given = {"path": tmp_path / "a.rrd"} | arguments
    with pytest.raises(kind, match=words) as caught:
        lw.record(mixed, **given)
    assert "\n" not in str(caught.value)


def test_nothing_to_draw_is_said(mixed, tmp_path):
    for result, words in (
        (dataclasses.replace(mixed, samples={}), "no positions were kept"),
        (bare(mixed, "attitude"), r"attitude were not kept: .* SaveAt\(fields"),
        ({}, "there is no result"),
    ):
        with pytest.raises(NothingToDraw, match=words):
            lw.record(result, tmp_path / "a.rrd")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("text", "words"), [
    ("exec sleep 0.5", None),
    ("echo no display >&2; exit 1", r"did not start \(no display\). The recording is .*fleet.rrd: open it"),
    (None, "cannot be started .* The recording is"),
])  # fmt: skip
def test_show_starts_a_viewer(mixed, tmp_path, monkeypatch, text, words):
    started_by(monkeypatch, tmp_path, text and f'echo "$1" > "{tmp_path}/opened"\n{text}')
    if words is None:
        lw.show(mixed, members=[3])
        opened = Path((tmp_path / "opened").read_text().strip())
        assert "1 of 40 drawn" in text_of(opened, "/run/summary")
        shutil.rmtree(opened.parent)
    else:
        with pytest.raises(OSError, match=words) as caught:
            lw.show(mixed)
        shutil.rmtree(Path(re.search(r"The recording is (.*): open it", str(caught.value))[1]).parent)


def test_a_viewer_that_stays_is_started(tmp_path, monkeypatch):
    started_by(monkeypatch, tmp_path, "exec sleep 5")
    begun = time.monotonic()
    viewer.start([], "", started=0.3)
    assert time.monotonic() - begun < 4.0


def test_no_viewer_is_loaded_before_it_is_needed():
    text = "import sys, lgvi_warp as lw; lw.select_members, lw.record, lw.show; print('rerun' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert said.stdout == "False\n"


@pytest.mark.ci
def test_2000_members_take_a_second(tmp_path):
    large = fleet(2000, 200)
    lw.record(fleet(3, 5), tmp_path / "warm.rrd")
    costs, of_python = [], []
    for _ in range(2):
        begun = time.process_time()
        path = lw.record(large, tmp_path / "large.rrd")
        recorded = time.process_time()
        sum(i & 1 for i in range(10_000_000))
        costs.append(recorded - begun)
        of_python.append(time.process_time() - recorded)
    # 2.3 times as long as Python takes to count ten million numbers; a call for each of 400,000 samples would take far more.
    assert min(costs) < 4.0 * min(of_python), (costs, of_python)
    assert path.stat().st_size < 8e6


@pytest.mark.slow
def test_a_recording_of_100000_members_is_small(tmp_path):
    path = lw.record(fleet(100_000, 200), tmp_path / "large.rrd")
    assert path.stat().st_size < 15e6


def test_the_ten_lines_have_room(mixed):
    """A window of usual size has room for about 66 letters beside their headings."""
    run = drawn.drawn_of(mixed)
    box = world.box_of([run])
    told = ten_words.lines(run, box, world.scale_of(run, box))
    assert len(told) == 10, told
    assert max(map(len, told.values())) <= 66, told
