# SPDX-License-Identifier: Apache-2.0
"""Recordings are opened by the viewer without a window: every view shows something, things move, bodies are in sight."""

import dataclasses
import runpy
import time

import numpy as np
import pytest
import rerun as rr

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.views.fleet import OUTCOME_STYLES
from lgvi_warp.views.recording import layout, world
from lgvi_warp.views.recording import rerun as recordings
from lgvi_warp.views.recording.hull import FIN
from lgvi_warp.views.recording.live import Live
from tests.conftest import ROOT
from tests.support.made import made
from tests.support.viewer import GAMMA, colored, moved, painted, viewer
from tests.unit.views.test_hull import glb
from tests.unit.views.test_live import blocks
from tests.unit.views.test_recording import SCENE, fleet

# A view without content has a smooth background.
LEAST_PAINTED, LEAST_MOVED = 0.01, 0.001
# Pixels of bodies, which all lie in one place at the start of some runs.
LEAST_BODY = 8


def faults_of(paths, times, folder, rgbs=None):
    """Faults of recordings in a viewer of their own: the last one opened is in front."""
    with viewer() as window:
        return faults_in(window, paths, times, rgbs)


def faults_in(window, paths, times, rgbs=None):
    """Faults of recordings in a viewer: the last one opened is in front."""
    window.open(*paths)
    window.pictures(times[0])  # the camera settles
    frames = [window.pictures(t) for t in times]
    faults = window.complaints()
    if not frames[0]:
        return [*faults, "no view was in sight"]
    for key in frames[0]:
        pictures = [frame[key] for frame in frames if key in frame]
        if painted(pictures[-1]) < LEAST_PAINTED:
            faults.append(f"{key}: looks empty ({painted(pictures[-1]):.4f})")
        if key[0] == "3D":
            still = len(times) > 1 and max(moved(pictures[0], later) for later in pictures[1:]) < LEAST_MOVED
            bodies = [sum(colored(picture, rgb) for rgb in rgbs or COLORS) for picture in pictures]
            faults += [f"{key}: nothing moves"] * still
            faults += [
                f"{key}: no body at {t:g} s" for t, count in zip(times, bodies, strict=True) if count < LEAST_BODY
            ]
    return faults


# Of bodies, and of the fin, which is seen where light noses hide all else; the surface, the floor and arrows have other hues.
COLORS = [*(OUTCOME_STYLES[code].rgb for code in (Status.OK, Status.FLOOR, Status.SURFACE, Status.NON_FINITE)), FIN]


def test_a_hue_counts_in_the_open_and_through_the_surface():
    # Two sheets of the surface, one over the other, mix with what is behind them in light, not in numbers of pixels.
    sheet, alpha = np.array(world.WATER[:3]) / 255.0, world.WATER[3] / 255.0
    background, grid = np.array(layout.BACKGROUND), np.array(world.TRAIL[:3])

    def through(rgb):
        light = np.array(rgb) / 255.0
        for _ in range(2):
            light = ((1.0 - alpha) * light**GAMMA + alpha * sheet**GAMMA) ** (1.0 / GAMMA)
        return np.round(255.0 * light)

    for rgb in COLORS:
        shades = np.stack(
            [shaded for part in (1.0, 0.7) for shaded in (part * np.array(rgb), through(part * np.array(rgb)))]
        )
        assert [colored(shade[None, None], rgb) for shade in shades] == [1, 1, 1, 1]
        others = [background, through(background), grid, through(grid), 0.7 * grid, sheet * 255.0]
        assert colored(np.stack(others)[None], rgb) == 0


def many(n=1000):
    """A grid of members that rise and turn."""
    axes = np.meshgrid(*[np.linspace(0.0, 20.0, round(n ** (1 / 3)))] * 3, indexing="ij")
    start = np.stack(axes, axis=-1).reshape(-1, 3)
    return made(start + np.arange(5)[:, None, None] * np.array([3.0, 1.0, 2.0]))


def failing(n=400, failures=173):
    """Members that dive; some of them fail, one after another, and stay where they were."""
    result = fleet(n, seed=5, scene=lw.Scene.named("remus_100"))
    status, end = np.zeros(n, int), np.full(n, np.nan)
    status[:failures], end[:failures] = Status.NON_FINITE, np.linspace(2.0, 58.0, failures)
    position = result.position.copy()
    for i in range(failures):
        frame = np.searchsorted(result.time, end[i])
        position[frame:, i] = position[frame - 1, i]
    return made(
        position, result.time, status=status, end=end, attitude=result.attitude, scene=lw.Scene.named("remus_100")
    )


def rising():
    """REMUS 100 vehicles of which the lighter ones reach the surface."""
    start = lw.Start(position=[0.0, 0.0, 8.0], velocity=[1.5, 0.0, 0.0])
    scene = lw.Scene.named("remus_100", events=[{"type": "surface", "depth": 0.5}], start=start)
    fleet = lw.Ensemble(scene, 60, 1, {"vehicle.buoyancy": lw.distributions.Uniform(low=295.0, high=312.0)})
    return lw.solve(fleet, h=0.05, t1=60.0, save=lw.SaveAt(every=1.0))


def sinking():
    """REMUS 100 vehicles that all sink to the floor."""
    start = lw.Start(position=[0.0, 0.0, 5.0])
    scene = lw.Scene.named("remus_100", vehicle={"buoyancy": 280.0}, events=[lw.events.Floor(depth=20.0)], start=start)
    fleet = lw.Ensemble(scene, 60, 1, {"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    return lw.solve(fleet, h=0.05, t1=120.0, save=lw.SaveAt(every=1.0))


def tethered():
    """REMUS 100 vehicles at a tether in waves."""
    waves = lw.terms.Waves(amplitudes=[0.5, 0.3], periods=[9.0, 7.0], headings_deg=[180.0, 150.0])
    tether = lw.terms.Tether(anchor=[0.0, 0.0, 20.0], rest_length=12.0, stiffness=20.0)
    start = lw.Start(position=[0.0, 0.0, 9.0], velocity=[0.5, 0.0, 0.0])
    scene = lw.Scene.named("remus_100", terms=[waves, tether], start=start)
    fleet = lw.Ensemble(scene, 60, 1, {"waves.phases": lw.distributions.Uniform(low=0.0, high=2.0 * np.pi)})
    return lw.solve(fleet, h=0.05, t1=60.0, save=lw.SaveAt(every=1.0))


def first_dive():
    """The fleet of the first example."""
    fleet = runpy.run_path(str(ROOT / "examples" / "01_first_dive.py"))["fleet"]
    return lw.solve(fleet, h=0.02, t1=60.0, save=lw.SaveAt(every=0.5))


def of_paper(members, h, t1, every):
    """The paper's case, as its file and the README vary it."""
    scene = lw.Scene.load(ROOT / "examples" / "paper.toml")
    vary = {
        "start.angular_velocity": lw.distributions.Normal(std=0.03),
        "vehicle.mass": lw.distributions.Normal(relative=0.001),
    }
    return lw.solve(lw.Ensemble(scene, members, 1, vary), h=h, t1=t1, save=lw.SaveAt(every=every))


RUNS = {"paper": lambda: of_paper(100, 0.01, 60.0, 0.5), "README": lambda: of_paper(4096, 0.01, 10.0, 1.0),
        "first dive": first_dive, "some of each outcome": lambda: fleet(200),
        "REMUS 100 that sink to the floor": sinking, "some reach the surface": rising, "173 of 400 failed": failing,
        "one vehicle, two samples": lambda: made(np.array([[[0.0, 0.0, 5.0]], [[6.0, 2.0, 8.0]]])),
        "one vehicle, 600 samples": lambda: fleet(1, 600), "a grid of 1,000": many,
        "100,000 members": lambda: fleet(100_000, 5), "waves with a tether": tethered}  # fmt: skip


@pytest.mark.slow
def test_two_recordings_are_seen(tmp_path):
    paths = [lw.record(fleet(30, seed=seed), tmp_path / f"{seed}.rrd") for seed in (1, 2)]
    assert faults_of(paths, (0.0, 30.0, 60.0), tmp_path) == []


@pytest.mark.slow
@pytest.mark.kernel
@pytest.mark.parametrize("name", RUNS)
def test_a_recording_is_seen(name, tmp_path):
    result = RUNS[name]()
    path = lw.record(result, tmp_path / "fleet.rrd")
    times = result.time[[0, len(result.time) // 2, -1]]
    assert faults_of([path], times, tmp_path) == []


@pytest.mark.slow
def test_compared_runs_are_seen(tmp_path):
    path = lw.record({"a": fleet(30), "b": fleet(30, seed=2)}, tmp_path / "both.rrd")
    assert faults_of([path], (0.0, 30.0, 60.0), tmp_path, recordings.COLORS[:2]) == []


@pytest.mark.slow
def test_a_mesh_is_seen(tmp_path):
    mesh = glb(tmp_path / "hull.glb", 2.0)
    scene = dataclasses.replace(SCENE, vehicle=dataclasses.replace(SCENE.vehicle, shape={"mesh": str(mesh)}))
    path = lw.record(fleet(30, scene=scene), tmp_path / "fleet.rrd")
    assert faults_of([path], (0.0, 30.0, 60.0), tmp_path) == []


@pytest.mark.slow
def test_a_run_that_goes_on_is_seen_to_grow(tmp_path):
    result, pictures = fleet(60), []
    with viewer() as window:
        recording = rr.RecordingStream("live", recording_id="live")
        recording.connect_grpc(window.address)
        live = Live(recording)
        for block in blocks(result, 20, 20, 20):
            live.add(block)
            time.sleep(1.0)
            window.pictures(30.0)  # the camera settles
            pictures.append(window.pictures(30.0)["3D", "/world"])
        recording.disconnect()
        assert window.complaints() == []
    bodies = [sum(colored(picture, rgb) for rgb in COLORS) for picture in pictures]
    assert LEAST_BODY < bodies[0] < bodies[1] < bodies[2]


BROKEN = {
    "poses that are not finite": (
        world,
        "quaternion_xyzw",
        lambda attitude: np.full((*attitude.shape[:-2], 4), np.nan),
    ),
    "an eye that looks elsewhere": (layout, "SIGHT", -np.array([0.0, 0.6, -0.8])),
    "a wrong mesh": (world, "hull_of", lambda length, diameter: world_hull(1e-4, 1e-4)),
}
world_hull = world.hull_of


def broken_path(name, folder):
    """A recording of a fleet that something broken drew."""
    module, attribute, replacement = BROKEN[name]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(module, attribute, replacement)
        if name == "an eye that looks elsewhere":
            patched.setattr(layout, "distance", lambda low, high, aspect: -10.0 * np.linalg.norm(high - low))
        return lw.record(fleet(30), folder / "broken.rrd")


@pytest.mark.slow
@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_seen(name, tmp_path):
    assert faults_of([broken_path(name, tmp_path)], (0.0, 30.0, 60.0), tmp_path) != []


@pytest.mark.slow
def test_a_fleet_is_seen_and_poses_that_are_not_finite_are_not(tmp_path):
    # One viewer for both: what a viewer shows of one recording does not hide faults of the next.
    whole = lw.record(fleet(60), tmp_path / "fleet.rrd")
    broken = broken_path("poses that are not finite", tmp_path)
    with viewer(size=(800, 560)) as window:
        assert faults_in(window, [whole], (0.0, 60.0)) == []
        assert any("invalid rotation" in fault for fault in faults_in(window, [broken], (0.0, 60.0)))
