# SPDX-License-Identifier: Apache-2.0
"""Regions of footprints on maps, opened by readers that are not ours: places, areas on the Earth, rings, refusals."""

import json
import math
from xml.etree import ElementTree

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.others.exporting.areas import divided
from tests.support.exported import DEGREES, by_geodesic
from tests.support.made import made
from tests.support.refusals import refused, says

pyproj, shapely = (pytest.importorskip(name) for name in ("pyproj", "shapely"))
ORIGIN = [63.44, 10.40]
SPACE = {"k": "http://www.opengis.net/kml/2.2"}
GEOD = pyproj.Geod(ellps="WGS84")


def footprint(places, origin=ORIGIN):
    end = np.concatenate([places, np.full((len(places), 1), 5.0)], axis=1)
    scene = lw.Scene.named("sphere", environment={"origin": origin} if origin else {})
    return lw.studies.footprint(made(np.stack([0.0 * end, end]), scene=scene))


def ring(n=1_000, radius=500.0, seed=1):
    """Members on a ring, which has a hole, and some of them in a second part in the north."""
    rng = np.random.default_rng(seed)
    angle, away = rng.uniform(0.0, 2.0 * np.pi, n), radius + 20.0 * rng.standard_normal(n)
    places = np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1)
    places[: n // 5] = [3_000.0, 100.0] + 50.0 * rng.standard_normal((n // 5, 2))
    return places


@pytest.fixture(scope="module")
def answer():
    return footprint(ring())


def geometries(answer, path, **options):
    """{share: geometry} as shapely reads GeoJSON."""
    features = json.loads(lw.export(answer, path, **options).read_text())["features"]
    return {
        each["properties"].get("share"): each["geometry"] and shapely.from_geojson(json.dumps(each["geometry"]))
        for each in features
    }


def test_a_map_has_the_regions_with_their_holes(answer, tmp_path):
    shapes = geometries(answer, tmp_path / "found.geojson")
    centre = shapes.pop(None)
    np.testing.assert_allclose((centre.y, centre.x), by_geodesic(answer.centre), rtol=0, atol=DEGREES)
    assert list(shapes) == [0.99, 0.95, 0.9, 0.5]
    for region in answer.regions:
        shape = shapes[region.share]
        assert shape.is_valid
        assert len(shape.geoms) == len(region.polygons)
        for polygon, rings in zip(shape.geoms, region.polygons, strict=True):
            assert shapely.is_ccw(polygon.exterior)
            assert not any(shapely.is_ccw(hole) for hole in polygon.interiors)
            for read, of_plane in zip([polygon.exterior, *polygon.interiors], rings, strict=True):
                longitude, latitude = np.array(read.coords).T
                np.testing.assert_allclose((latitude, longitude), by_geodesic(of_plane), rtol=0, atol=DEGREES)
        # On the Earth an area is that of the plane: 3 km away lengths across are too long by 4e-8. Edges are geodesics.
        on_earth = abs(GEOD.geometry_area_perimeter(shape)[0])
        assert on_earth == pytest.approx(region.area, rel=1e-5)
    assert max(len(rings) for rings in answer.main.polygons) == 2
    # Of new members the share is there: to four standard errors of the level, of 1,000 members.
    latitude, longitude = by_geodesic(ring(20_000, seed=2))
    assert shapely.contains_xy(shapes[0.9], longitude, latitude).mean() == pytest.approx(0.9, abs=0.04)


def test_a_file_for_globes_has_the_same(answer, tmp_path):
    shapes = geometries(answer, tmp_path / "found.geojson")
    root = ElementTree.parse(lw.export(answer, tmp_path / "found.kml")).getroot()
    *marks, centre = root.findall(".//k:Placemark", SPACE)
    assert [mark.find("k:name", SPACE).text for mark in marks] == ["99 %", "95 %", "90 %", "50 %"]
    assert centre.find("k:description", SPACE).text == answer.answer
    for mark, share in zip(marks, (0.99, 0.95, 0.9, 0.5), strict=True):
        polygons = mark.findall("k:MultiGeometry/k:Polygon", SPACE)
        rings = [[[tuple(map(float, place.split(","))) for place in node.text.split()]
                  for node in polygon.findall(f"k:{side}BoundaryIs/k:LinearRing/k:coordinates", SPACE)]
                 for polygon in polygons for side in ("outer", "inner")]  # fmt: skip
        read = shapely.MultiPolygon([(outer[0], holes) for outer, holes in zip(rings[::2], rings[1::2], strict=True)])
        assert read.equals_exact(shapes[share], 0.0)


def test_a_region_across_the_antimeridian_is_cut(tmp_path):
    origin = [-45.0, 179.999]
    answer = footprint(100.0 * np.random.default_rng(2).standard_normal((2_000, 2)), origin)
    for region in answer.regions:
        shape = geometries(answer, tmp_path / "cut.geojson", overwrite=True)[region.share]
        assert shape.is_valid
        west, _, east, _ = shape.bounds
        assert (west, east) == (-180.0, 180.0)
        assert len(shape.geoms) == 2
        assert all(part.bounds[2] - part.bounds[0] < 1.0 for part in shape.geoms)
        area = sum(abs(GEOD.geometry_area_perimeter(part)[0]) for part in shape.geoms)
        assert area == pytest.approx(region.area, rel=1e-5)


@pytest.mark.parametrize("longitude", [180.0, 179.9995, -179.9995, 179.9991])
def test_a_hole_across_the_antimeridian_is_no_part_of_the_region(longitude, tmp_path):
    """An annulus of 100 m, cut through or beside its hole."""
    rng = np.random.default_rng(3)
    angle, away = rng.uniform(0.0, 2.0 * np.pi, 3_000), 100.0 + 3.0 * rng.standard_normal(3_000)
    answer = footprint(np.stack([away * np.cos(angle), away * np.sin(angle)], axis=1), [10.0, longitude])
    shapes = geometries(answer, tmp_path / "cut.geojson")
    for region in answer.regions:
        shape = shapes[region.share]
        assert shape.is_valid, shapely.is_valid_reason(shape)
        assert {abs(shape.bounds[0]), abs(shape.bounds[2])} == {180.0}
        assert abs(GEOD.geometry_area_perimeter(shape)[0]) == pytest.approx(region.area, rel=1e-5)
        assert all(shapely.is_ccw(part.exterior) for part in shape.geoms)


@pytest.mark.parametrize("seed", range(20))
def test_half_of_any_polygon_is_that_of_shapely(seed):
    """Unions of boxes without other boxes: concave, with holes, some with points or edges on the meridian itself."""
    rng = np.random.default_rng(seed)
    corners = np.round(rng.uniform(0.0, [3.0, 3.0, 2.0, 2.0], (40, 4)), 1)
    boxes = shapely.box(*corners[:, :2].T, *(corners[:, :2] + corners[:, 2:]).T)
    shape = shapely.union_all(boxes[:25]).difference(shapely.union_all(boxes[25:])).buffer(-0.0125, join_style="mitre")
    shift = 180.0 - round(float(rng.uniform(1.0, 4.0)), 1) + rng.choice([0.0, 0.0125, -0.0125])
    for part in shapely.get_parts(shapely.transform(shape, lambda points: np.add(points, (shift, 0.0)).round(4))):
        polygon = shapely.orient_polygons(part)
        cut = shapely.MultiPolygon(
            [
                (rings[0], rings[1:])
                for rings in divided([np.array(ring.coords) for ring in (polygon.exterior, *polygon.interiors)])
            ]
        )
        assert cut.is_valid, shapely.is_valid_reason(cut)
        west = shapely.MultiPolygon([part for part in cut.geoms if part.bounds[0] > 0.0])
        assert west.symmetric_difference(part.intersection(shapely.box(170.0, -10.0, 180.0, 10.0))).area < 1e-9
        assert cut.area == pytest.approx(part.area, rel=1e-9)


def test_what_no_map_can_hold_is_refused(answer, tmp_path):
    nowhere = footprint(ring(), None)
    says(refused(lw.export, nowhere, tmp_path / "a.kml"), "origin", "is not known", "--origin=LAT,LON")
    path = lw.export(nowhere, tmp_path / "a.kml", origin=ORIGIN)
    assert path.read_text() == lw.export(answer, tmp_path / "b.kml").read_text()
    says(refused(lw.export, answer, tmp_path / "a.csv"), "holds no regions", ".geojson or .kml")
    says(refused(lw.export, answer, tmp_path / "c.kml", members=[0]), "members", "Leave it out")
    says(refused(lw.export, answer, tmp_path / "b.kml"), "is there already")
    at_the_pole = footprint(100.0 * np.random.default_rng(2).standard_normal((200, 2)), [90.0, 0.0])
    says(refused(lw.export, at_the_pole, tmp_path / "pole.kml"), "holds a pole")
    assert not (tmp_path / "pole.kml").exists()


def test_a_point_is_a_place_without_regions(tmp_path):
    answer = footprint(np.zeros((30, 2)))
    shapes = geometries(answer, tmp_path / "point.geojson")
    assert (shapes[None].y, shapes[None].x) == pytest.approx(ORIGIN)
    assert all(shapes[share] is None for share in shapes if share)
    marks = ElementTree.parse(lw.export(answer, tmp_path / "point.kml")).getroot().findall(".//k:Placemark", SPACE)
    assert len(marks) == 4
    assert not any(len(each) == 0 for mark in marks for each in mark.iterfind("k:MultiGeometry", SPACE))
    assert math.isnan(answer.main.area)
