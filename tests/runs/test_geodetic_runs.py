# SPDX-License-Identifier: Apache-2.0
"""Runs whose starts and waypoints are places on the Earth: the bits of those in metres, in memory, stores and resumed runs."""

import numpy as np
import pytest

import lgvi_warp as lw

pytest.importorskip("pyproj")
pytestmark = pytest.mark.kernel
WATER = {"origin": [63.44, 10.40], "start": "2026-06-01T06:00:00Z"}
PLACE, WAY = [63.4401, 10.4002, 5.0], [[63.4400, 10.4000, 5.0], [63.4402, 10.4000, 5.0], [63.4402, 10.4005, 5.0]]
SETTINGS = dict(method="rk4", h=0.05, t1=20.0, save=lw.SaveAt(every=1.0), threads=1)


def guided(way):
    laws = [{"type": "heading_pid", "kp": 1.0, "ki": 0.02, "kd": 2.0}]
    matrix = [{"type": "matrix", "to": "control_fins", "matrix": [[0, 0, 0, 0, 0, -1], [0] * 6]}]
    along = {"type": "waypoints", "speed": 1.5, "look_ahead": 5.0, "radius": 3.0} | way
    return {"period": 0.1, "guidance": [along], "laws": laws, "allocation": matrix}


def scene(start, way):
    start = {"velocity": [1.5, 0.0, 0.0]} | start
    return lw.Scene.named("remus_100", environment=WATER, start=start, controller=guided(way))


@pytest.mark.ci
def test_a_mission_by_places_is_that_by_metres():
    there = scene({"geodetic": PLACE}, {"geodetic": WAY})
    metres = there.environment.positions(WAY)
    here = scene({"position": there.environment.positions(PLACE)}, {"points": metres})
    spread = {"start.position": lw.distributions.Normal(std=[2.0, 2.0, 0.0])}
    by_place, by_metres = (lw.solve(lw.Ensemble(of, 6, seed=1, vary=spread), **SETTINGS) for of in (there, here))
    for name, values in by_metres.samples.items():
        np.testing.assert_array_equal(by_place.samples[name], values)
    assert by_place.provenance["scene"]["start"]["geodetic"] == PLACE
    assert by_place.provenance["scene"]["controller"]["guidance"][0]["geodetic"] == WAY
    # The way turns to the east after 22 m to the north: they are under way on it.
    assert np.ptp(by_place.position[-1, :, :2] - by_place.position[0, :, :2]) > 1.0


@pytest.mark.ci
def test_members_at_places_of_their_own_are_stored_and_resumed(tmp_path):
    places = np.array(PLACE) + np.linspace(0.0, 1e-3, 600)[:, None] * [1.0, -1.0, 1000.0]
    fleet = lw.Ensemble(scene({}, {"geodetic": WAY}), sampling=lw.designs.Table({"start.geodetic": places}))
    settings = SETTINGS | {"t1": 0.5, "save": lw.SaveAt(every=0.25)}
    whole = lw.solve(fleet, **settings)
    np.testing.assert_array_equal(whole.position[0], fleet.scene.environment.positions(places))
    part = lw.solve(fleet, **settings, store=tmp_path / "run.zarr", blocks=range(1))
    assert part.members < 600
    lw.resume(tmp_path / "run.zarr")
    stored = lw.open_run(tmp_path / "run.zarr")
    for name in whole.samples:
        np.testing.assert_array_equal(stored.samples[name], whole.samples[name])


@pytest.mark.ci
def test_a_run_far_from_its_origin_says_so():
    far = lw.Scene.named("remus_100", environment=WATER, start={"geodetic": [66.44, 10.40, 5.0]})
    messages = lw.solve(far, **SETTINGS | {"t1": 0.5, "save": None}).messages
    assert any("a place is 334 km from environment.origin: lengths across the way to it are 0.046 % too long" in text
               for text in messages)  # fmt: skip
