"""Recordings are opened by the viewer without a window: every view shows something, things move, bodies are in sight."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.views import rerun as recordings
from lgvi_warp.views.fleet import LOOKS
from lgvi_warp.views.recording import layout, world
from tests.support.made import made
from tests.support.viewer import colored, moved, painted, viewer
from tests.unit.views.test_hull import glb
from tests.unit.views.test_recording import SCENE, fleet

# A view without content has a smooth background.
LEAST_PAINTED, LEAST_MOVED = 0.01, 0.001
# Pixels of bodies, which all lie in one place at the start of some runs.
LEAST_BODY = 8


def faults_of(paths, times, folder, rgbs=None):
    """What is wrong with how recordings look: the last one opened is in front."""
    with viewer(folder) as window:
        window.open(*paths)
        window.pictures(times[0])  # the camera settles
        seen = [window.pictures(t) for t in times]
        faults = window.complaints()
    assert seen[0], "no view was in sight"
    for key in seen[0]:
        pictures = [at[key] for at in seen if key in at]
        if painted(pictures[-1]) < LEAST_PAINTED:
            faults.append(f"{key}: looks empty ({painted(pictures[-1]):.4f})")
        if key[0] == "3D":
            faults += [f"{key}: nothing moves"] * (len(times) > 1 and moved(pictures[0], pictures[-1]) < LEAST_MOVED)
            bodies = [sum(colored(picture, rgb) for rgb in rgbs or COLORS) for picture in pictures]
            faults += [
                f"{key}: no body at {t:g} s" for t, count in zip(times, bodies, strict=True) if count < LEAST_BODY
            ]
    return faults


# Of bodies; those of the surface and of the floor's plane have other hues.
COLORS = [LOOKS[code].rgb for code in (Status.OK, Status.FLOOR, Status.SURFACE, Status.NON_FINITE)]


def many(n=1000):
    """A grid of members that rise and turn."""
    axes = np.meshgrid(*[np.linspace(0.0, 20.0, round(n ** (1 / 3)))] * 3, indexing="ij")
    start = np.stack(axes, axis=-1).reshape(-1, 3)
    return made(start + np.arange(5)[:, None, None] * np.array([3.0, 1.0, 2.0]))


RUNS = {
    "some of each outcome": lambda: fleet(200),
    "floor all": lambda: made(
        np.minimum(5.0 + np.arange(9.0)[:, None, None] * np.ones((9, 50, 3)), 11.0),
        status=np.full(50, Status.FLOOR),
        end=np.full(50, 6.0),
        scene=lw.Scene.named("torpedo"),
    ),
    "one vehicle, two samples": lambda: made(np.array([[[0.0, 0.0, 5.0]], [[6.0, 2.0, 8.0]]])),
    "one vehicle, 600 samples": lambda: fleet(1, 600),
    "a grid of 1,000": many,
    "100,000 members": lambda: fleet(100_000, 5),
}


def test_two_recordings_are_seen(tmp_path):
    paths = [lw.log_rerun(fleet(30, seed=seed), tmp_path / f"{seed}.rrd") for seed in (1, 2)]
    assert faults_of(paths, (0.0, 30.0, 60.0), tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_a_recording_is_seen(name, tmp_path):
    result = RUNS[name]()
    path = lw.log_rerun(result, tmp_path / "fleet.rrd")
    times = result.time[[0, len(result.time) // 2, -1]]
    assert faults_of([path], times, tmp_path) == []


@pytest.mark.slow
def test_compared_runs_are_seen(tmp_path):
    path = lw.log_rerun({"a": fleet(30), "b": fleet(30, seed=2)}, tmp_path / "both.rrd")
    assert faults_of([path], (0.0, 30.0, 60.0), tmp_path, recordings.COLORS[:2]) == []


@pytest.mark.slow
def test_a_mesh_is_seen(tmp_path):
    mesh = glb(tmp_path / "hull.glb", 2.0)
    scene = dataclasses.replace(SCENE, vehicle=dataclasses.replace(SCENE.vehicle, shape={"mesh": str(mesh)}))
    path = lw.log_rerun(fleet(30, scene=scene), tmp_path / "fleet.rrd")
    assert faults_of([path], (0.0, 30.0, 60.0), tmp_path) == []


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


@pytest.mark.slow
@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_seen(name, tmp_path, monkeypatch):
    module, attribute, replacement = BROKEN[name]
    monkeypatch.setattr(module, attribute, replacement)
    if name == "an eye that looks elsewhere":
        monkeypatch.setattr(layout, "distance", lambda box, aspect: -10.0 * box.size)
    path = lw.log_rerun(fleet(30), tmp_path / "fleet.rrd")
    assert faults_of([path], (0.0, 30.0, 60.0), tmp_path) != []
