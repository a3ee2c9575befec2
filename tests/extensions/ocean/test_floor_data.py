# SPDX-License-Identifier: Apache-2.0
"""Floors from files: NetCDF as GEBCO and models write it, GeoTIFF in any projection, and what is wrong with them."""

import re
import tomllib

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

import lgvi_warp as lw
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.scene import plausibility
from tests.conftest import ROOT

xr = pytest.importorskip("xarray")
rasterio = pytest.importorskip("rasterio")

ORIGIN = (54.05, 7.9)
PLANE = LocalPlane(*ORIGIN)
LATITUDE = np.arange(54.0, 54.101, 1.0 / 240.0)
LONGITUDE = np.arange(7.8, 8.001, 1.0 / 240.0)
# Distances of the nodes [m], of 1 / 240 degree, a little above.
SIZES = np.array([464.0, 274.0])
REGION = [[-3000.0, 3500.0], [-4000.0, 4200.0]]


def sea_bed(latitude, longitude):
    """Depths [m] on latitudes and longitudes [deg]."""
    x, y = np.deg2rad(latitude - ORIGIN[0]) * 6.37e6, np.deg2rad(longitude - ORIGIN[1]) * 3.74e6
    return 25.0 + 3.0 * np.sin(x / 900.0) * np.cos(y / 1100.0) - 0.001 * x


DEPTH = sea_bed(*np.meshgrid(LATITUDE, LONGITUDE, indexing="ij"))


def gebco(depth=DEPTH, latitude=LATITUDE, longitude=LONGITUDE, **attributes):
    """Data set like GEBCO's: elevations, without fill values."""
    known = {
        "standard_name": "height_above_mean_sea_level",
        "units": "m",
        "long_name": "Elevation relative to sea level",
    }
    return xr.Dataset(
        {"elevation": (("lat", "lon"), -depth, known | attributes)},
        {"lat": ("lat", latitude, {"standard_name": "latitude", "units": "degrees_north"}),
         "lon": ("lon", longitude, {"standard_name": "longitude", "units": "degrees_east"})},
    )  # fmt: skip


def nodes(floor):
    """Latitudes and longitudes [deg] of a floor's nodes."""
    north, east = (floor.origin[i] + floor.spacing[i] * np.arange(floor.depth.shape[i]) for i in (0, 1))
    return PLANE.geodetic(*np.meshgrid(north, east, indexing="ij"))


@pytest.mark.parametrize("case", ["as it is", "from the north", "to 360", "a depth of a model", "its own variable"])
def test_netcdf_is_bilinear_in_its_own_cells(case, tmp_path):
    ds, more = gebco(), {}
    if case == "from the north":
        ds = ds.isel(lat=slice(None, None, -1))
    elif case == "to 360":
        ds = gebco(longitude=LONGITUDE + 360.0)
    elif case == "a depth of a model":
        known = {"standard_name": "sea_floor_depth_below_geoid", "units": "m"}
        ds = xr.Dataset({"deptho": (("lat", "lon"), DEPTH, known)}, gebco().coords)
    elif case == "its own variable":
        ds, more = gebco().rename(elevation="mine").assign(other=gebco().elevation + 1.0), {"variable": "mine"}
    path = tmp_path / "floor.nc"
    ds.to_netcdf(path)
    floor = lw.events.Floor.from_file(path, ORIGIN, region=REGION, **more)
    table = RegularGridInterpolator((LATITUDE, LONGITUDE), DEPTH)
    np.testing.assert_allclose(floor.depth, table(np.stack(nodes(floor), axis=-1)), atol=1e-9)
    # As fine as the file: 1 / 240 degree.
    assert np.all(floor.spacing < SIZES)
    assert np.all(floor.spacing > 0.9 * SIZES)
    np.testing.assert_allclose(floor.origin, [-3000.0, -4000.0])
    far = floor.origin + floor.spacing * (np.array(floor.depth.shape) - 1)
    np.testing.assert_allclose(far, [3500.0, 4200.0])
    # A dataset in memory is the same.
    in_memory = lw.events.Floor.from_file(ds, ORIGIN, region=REGION, **more)
    np.testing.assert_array_equal(in_memory.depth, floor.depth)


def geotiff(path, numbers, transform, crs="EPSG:4326", **more):
    """A GeoTIFF of numbers (rows, columns)."""
    with rasterio.open(path, "w", driver="GTiff", height=numbers.shape[0], width=numbers.shape[1], count=1,
                       dtype=numbers.dtype, crs=crs, transform=transform, **more) as file:  # fmt: skip
        file.write(numbers, 1)


STEP = 1.0 / 240.0
NORTH_UP = rasterio.transform.from_origin(LONGITUDE[0] - 0.5 * STEP, LATITUDE[-1] + 0.5 * STEP, STEP, STEP)
SOUTH_UP = rasterio.Affine(STEP, 0.0, LONGITUDE[0] - 0.5 * STEP, 0.0, STEP, LATITUDE[0] - 0.5 * STEP)


@pytest.mark.parametrize(("transform", "numbers", "positive"), [
    (NORTH_UP, -DEPTH[::-1], ""), (SOUTH_UP, -DEPTH, "up"), (NORTH_UP, DEPTH[::-1], "down"),
], ids=["north up", "south up", "depths"])  # fmt: skip
def test_geotiff_is_bilinear_between_the_middles_of_pixels(transform, numbers, positive, tmp_path):
    geotiff(tmp_path / "floor.tif", numbers, transform)
    floor = lw.events.Floor.from_file(tmp_path / "floor.tif", ORIGIN, region=REGION, positive=positive)
    table = RegularGridInterpolator((LATITUDE, LONGITUDE), DEPTH)
    np.testing.assert_allclose(floor.depth, table(np.stack(nodes(floor), axis=-1)), atol=1e-8)
    assert np.all(floor.spacing < SIZES)
    assert np.all(floor.spacing > 0.9 * SIZES)


def test_geotiff_in_another_projection(tmp_path):
    from pyproj import Transformer

    # UTM 32 N, pixels of 100 m: bilinear in its own plane, so it errs by curvature times 100^2 / 8.
    utm = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True)
    x0, y0 = utm.transform(ORIGIN[1], ORIGIN[0])
    x, y = x0 - 6000.0 + 100.0 * np.arange(121), y0 + 5000.0 - 100.0 * np.arange(101)
    longitude, latitude = utm.transform(*np.meshgrid(x, y), direction="INVERSE")
    transform = rasterio.transform.from_origin(x[0] - 50.0, y[0] + 50.0, 100.0, 100.0)
    geotiff(tmp_path / "floor.tif", -sea_bed(latitude, longitude), transform, "EPSG:32632")
    floor = lw.events.Floor.from_file(tmp_path / "floor.tif", ORIGIN, region=REGION, spacing=[250.0, 250.0])
    known = sea_bed(*nodes(floor))
    bound = 3.0 * (1.0 / 900.0**2 + 1.0 / 1100.0**2) * 100.0**2 / 8.0
    assert np.abs(floor.depth - known).max() < bound
    assert np.all(floor.spacing <= 250.0)


def test_integers_with_scale_and_without_a_value(tmp_path):
    numbers = np.round(-10.0 * DEPTH[::-1]).astype(np.int16)
    numbers[4, 7] = -32768
    geotiff(tmp_path / "floor.tif", numbers, NORTH_UP, nodata=-32768)
    with rasterio.open(tmp_path / "floor.tif", "r+") as file:
        file.scales = (0.1,)
    inside = dict(region=[[-3000.0, 0.0], [-4000.0, 4200.0]])
    floor = lw.events.Floor.from_file(tmp_path / "floor.tif", ORIGIN, **inside)
    table = RegularGridInterpolator((LATITUDE, LONGITUDE), DEPTH)
    np.testing.assert_allclose(floor.depth, table(np.stack(nodes(floor), axis=-1)), atol=0.051)
    whole = dict(region=[[-3000.0, 5000.0], [-6000.0, 4200.0]])
    with pytest.raises(lw.SceneError, match=r"fill = 'refuse': \d of [\d,]+ depths are missing. Give fill = 'nearest'"):
        lw.events.Floor.from_file(tmp_path / "floor.tif", ORIGIN, **whole)
    near = lw.events.Floor.from_file(tmp_path / "floor.tif", ORIGIN, **whole, fill="nearest")
    zero = lw.events.Floor.from_file(tmp_path / "floor.tif", ORIGIN, **whole, fill="zero")
    assert near.depth.min() > 15.0
    assert 0 < np.count_nonzero(zero.depth == 0.0) <= 6


def band(**attributes):
    """Elevations of a variable without a name or an attribute that says so, as GDAL writes it."""
    return gebco().rename(elevation="Band1").assign(Band1=(("lat", "lon"), -DEPTH, {"units": "m"} | attributes))


@pytest.mark.parametrize(("attributes", "requested", "sign"), [
    ({}, "up", 1), ({}, "down", -1), ({"positive": "up"}, "", 1), ({"positive": "down"}, "", -1),
    ({"positive": "down"}, "up", 1), ({"positive": "up"}, "up", 1), ({"standard_name": "altitude"}, "", 1),
    ({"standard_name": "altitude", "positive": "down"}, "", -1),
    ({"standard_name": "sea_floor_depth", "positive": "up"}, "", 1),
])  # fmt: skip
def test_a_variable_is_a_depth_or_an_elevation_by_what_says_so(attributes, requested, sign):
    known = {"variable": "Band1", "region": REGION}
    depth = lw.events.Floor.from_file(gebco(), ORIGIN, region=REGION).depth
    if sign > 0:
        np.testing.assert_array_equal(
            lw.events.Floor.from_file(band(**attributes), ORIGIN, positive=requested, **known).depth, depth
        )
    else:
        with pytest.raises(lw.SceneError, match=r"dry land, .*. Give positive = 'up' if the numbers are elevations"):
            lw.events.Floor.from_file(band(**attributes), ORIGIN, positive=requested, **known)


def test_a_variable_that_nothing_explains_needs_a_word():
    with pytest.raises(lw.SceneError, match=r"variable = 'Band1' says neither .*. Give positive = 'up' for elevations"):
        lw.events.Floor.from_file(band(), ORIGIN, variable="Band1")


def test_a_floor_that_is_mostly_dry_is_told():
    wet = lw.events.Floor(depth=[[5.0, -1.0], [5.0, -1.0]], spacing=[10.0, 10.0])
    dry = lw.events.Floor(depth=[[5.0, -1.0], [-5.0, -1.0]], spacing=[10.0, 10.0])
    assert wet.remarks == ()
    (text,) = dry.remarks
    assert text == "75 % of the floor lies above the sea: its sign may be wrong"
    scene = lw.Scene.named("sphere", start={"position": [0.0, 0.0, -9.0]}, events=[dry])
    assert text in str(plausibility.of_ensemble(lw.Ensemble(scene)))


def test_all_of_a_file_is_read_where_no_region_is_told():
    floor = lw.events.Floor.from_file(gebco(), ORIGIN)
    edge = floor.origin + floor.spacing * (np.array(floor.depth.shape) - 1)
    corners = PLANE.geodetic(*np.array([[floor.origin[0], edge[0]], [floor.origin[1], edge[1]]]))
    for values, axis in zip(corners, (LATITUDE, LONGITUDE), strict=True):
        assert axis[0] <= values[0] <= axis[0] + 0.02 * np.ptp(axis)
        assert axis[-1] - 0.02 * np.ptp(axis) <= values[1] <= axis[-1]


def holed():
    depth = DEPTH.copy()
    depth[8:12, 20:30] = np.nan
    return gebco(depth)


@pytest.mark.parametrize(("ds", "more", "words"), [
    (gebco(), {"region": [[0.0, 9e4], [0.0, 1e3]]}, r"region = .* is not within the data, .* of the origin. Give one within"),
    (gebco(), {"region": [[0.0, 1e3], [1e3, 0.0]]}, "ends before it begins"),
    (gebco(), {"spacing": [1.0, 0.01]}, "are too many nodes for a scene. Give a smaller region or a wider spacing"),
    (gebco(), {"spacing": [1.0, -1.0]}, "spacing = .* is not positive"),
    (gebco(), {"variable": "depht"}, "variables = 'depht' is not a variable of the data set"),
    (gebco(), {"fill": "guess"}, "fill = 'guess'"),
    (gebco(), {"positive": "down"}, "makes all of the floor dry land"),
    (gebco().rename(elevation="q").assign(q=gebco().elevation.drop_attrs().rename("q")), {}, "have no CF names"),
    (holed(), {}, r"fill = 'refuse': [\d,]+ of [\d,]+ depths are missing"),
    (gebco(DEPTH * np.nan), {}, "has no value there"),
    (gebco(units="parsec"), {}, "parsec"),
], ids=range(11))  # fmt: skip
def test_bad_data_is_one_line_with_the_remedy(ds, more, words):
    with pytest.raises(lw.SceneError, match=words) as error:
        lw.events.Floor.from_file(ds, ORIGIN, **more)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(("content", "words"), [
    (b"II*\0 but nothing more", "is damaged, or no GeoTIFF"), (b"text", "is damaged, or no NetCDF file"),
    (None, "No such file"),
])  # fmt: skip
def test_a_damaged_file(content, words, tmp_path):
    path = tmp_path / "floor"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(lw.SceneError, match=words):
        lw.events.Floor.from_file(path, ORIGIN)


def test_a_raster_without_a_reference_system(tmp_path):
    geotiff(tmp_path / "floor.tif", -DEPTH, NORTH_UP, None)
    with pytest.raises(lw.SceneError, match=r"says no coordinate reference system. Write it"):
        lw.events.Floor.from_file(tmp_path / "floor.tif", ORIGIN)


SCENE = """
[vehicle]
name = "remus_100"
[start]
position = [0.0, 0.0, 20.0]
[[events]]
type = "floor"
file = "gebco.nc"
origin = [54.05, 7.9]
region = [[-1000.0, 1000.0], [-500.0, 500.0]]
clearance = 1.5
"""


def test_a_scene_file_names_a_file_beside_it(tmp_path):
    gebco().to_netcdf(tmp_path / "gebco.nc")
    (tmp_path / "scene.toml").write_text(SCENE)
    (floor,) = lw.Scene.load(tmp_path / "scene.toml").events
    same = lw.events.Floor.from_file(tmp_path / "gebco.nc", ORIGIN, region=[[-1000.0, 1000.0], [-500.0, 500.0]])
    np.testing.assert_array_equal(floor.depth, same.depth)
    assert float(floor.clearance) == 1.5
    # The origin may be that of the whole scene.
    elsewhere = SCENE.replace("origin = [54.05, 7.9]\n", "") + "[environment]\norigin = [54.05, 7.9]\n"
    (tmp_path / "scene.toml").write_text(elsewhere)
    np.testing.assert_array_equal(lw.Scene.load(tmp_path / "scene.toml").events[0].depth, floor.depth)
    for wrong, words in (("gebco.nc", "bathy.nc"), ("origin = [54.05, 7.9]", ""), ("clearance", "clearence")):
        (tmp_path / "wrong.toml").write_text(SCENE.replace(wrong, words))
        with pytest.raises(lw.SceneError, match=r"events\[0\]"):
            lw.Scene.load(tmp_path / "wrong.toml")


def test_the_page_does_what_it_says(tmp_path, monkeypatch):
    text = (ROOT / "docs" / "guide" / "sea_floor.md").read_text()
    python, toml = (re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL) for kind in ("python", "toml"))
    assert (len(python), len(toml)) == (2, 2)
    gebco().to_netcdf(tmp_path / "gebco.nc")
    monkeypatch.chdir(tmp_path)
    names = {}
    for code in python:
        exec(code, names)
    assert names["floor"].depth.shape[0] > 10
    slope, chart = (
        lw.Scene.from_dict({"vehicle": {"name": "sphere"}, **tomllib.loads(code)}).events[0] for code in toml
    )
    assert slope.depth_at(40.0, 7.0) == pytest.approx(22.0)
    np.testing.assert_array_equal(chart.depth, names["floor"].depth)
