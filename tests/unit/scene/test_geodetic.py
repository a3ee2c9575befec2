# SPDX-License-Identifier: Apache-2.0
"""Places on the Earth in a scene: start, waypoints and tables of members as latitude, longitude and depth."""

import datetime
import tomllib

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.pages import blocks

pyproj = pytest.importorskip("pyproj")
ORIGIN = [63.44, 10.40]
# Steps of the position by rounding in PROJ's formulas, a few parts in 1e15 of the Earth's radius, and of the inverse of Geod.
ROUNDING = 2e-8


def by_geodesic(places, origin=None):
    """Metres to the north and east along the geodesic from the origin, by another algorithm (Karney 2013)."""
    latitude, longitude = origin or ORIGIN
    places = np.asarray(places)
    count = np.ones(len(places))
    bearing, _, distance = pyproj.Geod(ellps="WGS84").inv(
        longitude * count, latitude * count, places[:, 1], places[:, 0]
    )
    angle = np.deg2rad(bearing)
    return np.stack([distance * np.cos(angle), distance * np.sin(angle), places[:, 2]], axis=1)


def scene_of(start=None, origin=None, **sections):
    environment = {"origin": ORIGIN if origin is None else origin, "start": "2026-06-01T06:00:00+02:00"}
    return lw.Scene.named("remus_100", environment=environment, start=start or {}, **sections)


def guided(guidance):
    laws = [{"type": "heading_pid", "kp": 1.0, "ki": 0.0, "kd": 1.0}]
    matrix = [{"type": "matrix", "to": "control_fins", "matrix": [[0, 0, 0, 0, 0, -1], [0] * 6]}]
    way = {"type": "waypoints", "speed": 1.5, "look_ahead": 10.0, "radius": 5.0} | guidance
    return {"period": 0.1, "guidance": [way], "laws": laws, "allocation": matrix}


WAY = [[63.44, 10.40, 5.0], [63.45, 10.42, 5.0], [63.46, 10.40, 8.0]]


@pytest.mark.parametrize(
    "origin", [[63.44, 10.4], [-33.9, 151.3], [0.0, 0.0], [89.0, 40.0], [10.0, 179.99], [10.0, 359.9]]
)
def test_a_start_lies_where_the_geodesic_leads(origin):
    place = [origin[0] - 0.05, origin[1] + 0.05, 12.5]
    position = scene_of({"geodetic": place}, origin).start.given()["position"]
    np.testing.assert_allclose(position, by_geodesic([place], origin)[0], rtol=0, atol=ROUNDING)


def test_waypoints_lie_where_the_geodesics_lead():
    guidance = scene_of(controller=guided({"geodetic": WAY})).controller.guidance[0]
    np.testing.assert_allclose(guidance.points, by_geodesic(WAY), rtol=0, atol=ROUNDING)


def test_places_come_back():
    water = scene_of().environment
    np.testing.assert_allclose(water.geodetic(water.positions(WAY)), WAY, rtol=0, atol=1e-13 * 360)
    across = lw.Environment(origin=[10.0, 179.99])
    assert across.geodetic([0.0, 5000.0, 0.0])[1] < -179.9
    np.testing.assert_allclose(
        across.positions([[10.0, -179.9, 0.0]]), across.positions([[10.0, 180.1, 0.0]]), atol=1e-8
    )


def test_what_was_given_is_written_again():
    scene = scene_of({"geodetic": WAY[0], "velocity": [1.5, 0.0, 0.0]}, controller=guided({"geodetic": WAY}))
    content = scene.to_dict()
    assert content["start"] == {"geodetic": WAY[0], "velocity": [1.5, 0.0, 0.0]}
    assert content["environment"]["origin"] == ORIGIN
    assert content["environment"]["start"] == "2026-06-01T06:00:00+02:00"
    (way,) = content["controller"]["guidance"]
    assert way["geodetic"] == WAY
    assert "points" not in way
    again = lw.Scene.from_dict(content)
    assert again.to_dict() == content
    np.testing.assert_array_equal(again.start.given()["position"], scene.start.given()["position"])
    np.testing.assert_array_equal(again.controller.guidance[0].points, scene.controller.guidance[0].points)


def test_a_scene_without_places_is_written_as_before():
    content = lw.Scene.named("remus_100").to_dict()
    assert set(content["environment"]) == {"gravity", "water_density"}


def test_dates_are_in_utc():
    moments = [
        "2026-06-01T06:00:00+02:00",
        "2026-06-01T04:00:00Z",
        "2026-06-01T04:00:00",
        datetime.datetime(2026, 6, 1, 4),
    ]
    for moment in moments:
        assert lw.Environment(start=moment).start_time == np.datetime64("2026-06-01T04:00:00", "us")
    assert lw.Environment(start=datetime.date(2026, 6, 1)).start == "2026-06-01"
    assert lw.Environment().start_time is None


def test_positions_and_places_replace_each_other():
    scene = scene_of({"geodetic": WAY[1]}, controller=guided({"geodetic": WAY}))
    assert scene.with_numbers({"start.position": [1.0, 2.0, 3.0]}).to_dict()["start"] == {"position": [1.0, 2.0, 3.0]}
    there = scene.with_numbers({"start.geodetic[0]": WAY[2][0]})
    np.testing.assert_allclose(
        there.start.given()["position"], by_geodesic([[WAY[2][0], *WAY[1][1:]]])[0], rtol=0, atol=ROUNDING
    )
    points = [[0.0, 0.0, 5.0], [100.0, 0.0, 5.0]]
    assert scene.with_numbers({"waypoints.points": points}).to_dict()["controller"]["guidance"][0]["points"] == points
    faster = scene.with_numbers({"waypoints.speed": 2.0})
    np.testing.assert_array_equal(faster.controller.guidance[0].points, scene.controller.guidance[0].points)


def test_every_member_may_start_at_its_own_place():
    columns = {"start.geodetic": WAY, "vehicle.buoyancy": [306.0, 307.0, 308.0]}
    members = lw.Ensemble(scene_of(), sampling=lw.designs.Table(columns)).select(0, 3)
    np.testing.assert_allclose(members.position, by_geodesic(WAY), rtol=0, atol=ROUNDING)
    # By entries, of which the scene has one.
    columns = {"start.geodetic[0]": [way[0] for way in WAY], "start.geodetic[1]": [way[1] for way in WAY]}
    members = lw.Ensemble(scene_of({"geodetic": WAY[0]}), sampling=lw.designs.Table(columns)).select(0, 3)
    np.testing.assert_allclose(
        members.position, by_geodesic([[*way[:2], WAY[0][2]] for way in WAY]), rtol=0, atol=ROUNDING
    )


def test_a_start_varies_in_metres_around_its_place():
    vary = {"start.position": lw.distributions.Normal(std=[3.0, 3.0, 0.0])}
    scene = scene_of({"geodetic": WAY[1]})
    away = lw.Ensemble(scene, members=400, vary=vary).select(0, 400).position - scene.start.given()["position"]
    # Four standard errors of a mean and of a standard deviation of 400 members.
    assert np.all(np.abs(away.mean(axis=0)) < 4.0 * 3.0 / 20.0)
    np.testing.assert_allclose(away.std(axis=0), [3.0, 3.0, 0.0], atol=4.0 * 3.0 / np.sqrt(800.0))


@pytest.mark.parametrize(
    ("sections", "words"),
    [
        ({"environment": {}}, "start.geodetic = .*environment.origin is not known. Give the origin"),
        ({"environment": {"origin": [95.0, 0.0]}}, "environment.origin = 95.0 is not a latitude. Give -90 to 90"),
        ({"environment": {"origin": [5.0, 400.0]}}, "environment.origin = 400.0 is not a longitude. Give -180 to 360"),
        ({"environment": {"origin": [5.0]}}, r"environment.origin = \[5.0\] has shape \(1,\)"),
        ({"environment": {"origin": ORIGIN, "start": "soon"}}, "environment.start = 'soon' is not a date and time"),
        ({"environment": {"origin": ORIGIN, "start": 5}}, "environment.start = 5 is not a date and time"),
        ({"start": {"geodetic": [10.4, 163.0, 0.0], "position": [0.0, 0.0, 0.0]}}, "position and geodetic = .* say the same"),
        ({"start": {"geodetic": [-91.0, 10.0, 0.0]}}, "start.geodetic = -91.0 is not a latitude"),
        ({"start": {}, "environment": {}, "controller": guided({"geodetic": WAY})}, "waypoints.geodetic = .*is not known"),
        ({"controller": guided({"geodetic": WAY, "points": WAY})}, "points and geodetic = .* say the same thing twice"),
        ({"controller": guided({})}, "points = None are missing. Give points"),
        ({"controller": guided({"geodetic": WAY[:1]})}, "geodetic = .* are less than two"),
        ({"controller": guided({"geodetic": [*WAY, WAY[-1]]})}, r"geodetic\[3\] = .* is at the same place of the map"),
        ({"controller": guided({"geodetic": [[95.0, 0.0, 0.0], [5.0, 0.0, 0.0]]})}, "geodetic = 95.0 is not a latitude"),
        ({"controller": guided({"geodetic": [[5.0, 0.0], [6.0, 0.0]]})}, r"geodetic = .* has shape \(2, 2\)"),
    ],
)  # fmt: skip
def test_faults(sections, words):
    content = {"start": {"geodetic": WAY[0]}, "environment": {"origin": ORIGIN}} | sections
    with pytest.raises(lw.SceneError, match=words):
        lw.Scene.named("remus_100", **content)


def test_faults_of_members():
    scene, table = scene_of(), lw.designs.Table
    with pytest.raises(
        lw.SceneError, match=r'Vary "start.position" \[m\] around the place, or give every member its own'
    ):
        lw.Ensemble(
            scene_of({"geodetic": WAY[0]}), members=2, vary={"start.geodetic": lw.distributions.Normal(std=1.0)}
        )
    with pytest.raises(lw.SceneError, match=r"start.geodetic = 95.0 is not a latitude"):
        lw.Ensemble(scene, sampling=table({"start.geodetic": [[95.0, 0.0, 0.0]]}))
    with pytest.raises(lw.SceneError, match=r"has shape \(1, 2\)"):
        lw.Ensemble(scene, sampling=table({"start.geodetic": [[5.0, 0.0]]}))
    with pytest.raises(lw.SceneError, match=r'start.geodetic\[2\]" = .* is missing. Give it a column too'):
        lw.Ensemble(scene, sampling=table({"start.geodetic[0]": [5.0], "start.geodetic[1]": [5.0]}))
    with pytest.raises(lw.SceneError, match=r"environment.origin is not known"):
        lw.Ensemble(lw.Scene.named("remus_100"), sampling=table({"start.geodetic": [WAY[0]]}))
    with pytest.raises(lw.SceneError, match=r"environment.origin = None is not known"):
        lw.Environment().geodetic([0.0, 0.0, 0.0])
    with pytest.raises(lw.SceneError, match=r"geodetic = .* has shape \(2,\)"):
        scene.environment.positions([1.0, 2.0])


def test_a_place_far_from_the_origin_is_named_with_its_error():
    from lgvi_warp.scene import plausibility

    scene = scene_of({"geodetic": [66.44, 10.40, 5.0]}, controller=guided({"geodetic": [*WAY, [66.44, 10.4, 5.0]]}))
    odd = plausibility.of_ensemble(lw.Ensemble(scene)).by_name
    for key in ("environment.origin", "waypoints.points"):
        # 334 km: 334^2 / (6 6371^2) = 0.046 %.
        assert "a place is 334 km from environment.origin" in odd[key].text
        assert "0.046 % too long" in odd[key].text
    near = plausibility.of_ensemble(lw.Ensemble(scene_of({"geodetic": WAY[0]}))).by_name
    assert "environment.origin" not in near


def test_the_scene_of_the_page():
    (text,) = blocks("docs/guide/geodetic_places.md", "toml")
    found = lw.Scene.from_dict(tomllib.loads(text))
    places = found.controller.guidance[0].geodetic
    np.testing.assert_allclose(
        found.controller.guidance[0].points, by_geodesic(places, [63.44, 10.40]), rtol=0, atol=ROUNDING
    )


def test_a_date_of_toml_is_a_date():
    content = tomllib.loads("start = 2026-06-01T08:00:00+02:00")
    assert lw.Environment(**content).start_time == np.datetime64("2026-06-01T06:00:00", "us")
