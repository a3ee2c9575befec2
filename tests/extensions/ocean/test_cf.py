# SPDX-License-Identifier: Apache-2.0
"""Variables and axes of data sets: found under the names of several models, in SI units, read part by part."""

import datetime

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.ocean import cf
from lgvi_warp.extensions.ocean.data_sets import opened
from lgvi_warp.extensions.ocean.units import factor
from tests.extensions.ocean import data

U = lambda lat, lon, z, t: lat + 10.0 * lon + 0.01 * z + t / 3600.0  # noqa: E731


def eastward(ds, about=None):
    return cf.gridded(ds, cf.EASTWARD, cf.variable_name(ds, cf.EASTWARD), about)


@pytest.mark.parametrize("standard", [True, False])
@pytest.mark.parametrize("model", [data.cmems, data.hycom])
def test_models(model, standard):
    grid = eastward(model(U, data.still, standard=standard), -70.5)
    assert grid.shape == (1, 4, 5, 11, 9)
    np.testing.assert_allclose(grid.longitude, data.LONGITUDE, atol=1e-12)
    np.testing.assert_array_equal(grid.depth, data.DEPTH)
    np.testing.assert_allclose(cf.seconds_since(grid.time, None), 3600.0 * data.HOURS)
    shift = 0.0 if model is data.cmems else 3600.0
    np.testing.assert_allclose(grid.values(time=2), data.on_grid(U)[2] + shift)


def test_a_file_in_another_order_upside_down_and_packed(tmp_path):
    ds = data.cmems(U, data.still).isel(latitude=slice(None, None, -1), longitude=slice(None, None, -1))
    ds = ds.isel(depth=slice(None, None, -1)).transpose("longitude", "depth", "time", "latitude")
    ds = ds.assign_coords(depth=("depth", -ds.depth.values / 1e3, {"units": "km", "positive": "up"}))
    ds.uo.data = 100.0 * ds.uo.data
    ds.uo.attrs["units"] = "cm/s"
    ds.uo.encoding = {"dtype": "int32", "scale_factor": 1e-4, "_FillValue": -(2**31)}
    ds.uo[0, 0, 0, 0] = np.nan
    ds.to_netcdf(tmp_path / "a.nc")
    with opened(tmp_path / "a.nc") as ds:
        grid = eastward(ds)
        assert np.all(np.diff(grid.depth) > 0.0)
        expected = data.on_grid(U)[0]
        # The first place of each axis, in the file's order, has no value.
        expected[-1, -1, -1] = np.nan
        np.testing.assert_allclose(grid.values(), expected, atol=1e-6)


def test_a_box_across_the_date_line():
    lon = np.arange(0.0, 360.0, 2.0)
    ds = data.cmems(lambda lat, lon, z, t: np.cos(np.deg2rad(lon)) + 0.0 * t, data.still, lon=lon)
    grid = eastward(ds, 179.0)
    assert np.all(np.diff(grid.longitude) == 2.0)
    box = grid.between(41.25, 41.35, 176.5, 183.1)
    np.testing.assert_allclose(box.latitude, [41.2, 41.3, 41.4])
    np.testing.assert_allclose(box.longitude, [176.0, 178.0, 180.0, 182.0, 184.0])
    np.testing.assert_allclose(box.values()[0, 0], np.cos(np.deg2rad(box.longitude)), atol=1e-12)
    # About Greenwich, the same file: from its last columns to its first.
    box = eastward(ds, 1.0).between(41.0, 41.1, -3.0, 3.0)
    assert len(box.pieces) == 2
    np.testing.assert_allclose(box.longitude, [-4.0, -2.0, 0.0, 2.0, 4.0])
    np.testing.assert_allclose(box.values()[0, 0], np.cos(np.deg2rad(box.longitude)), atol=1e-12)


def test_a_circle_closed_by_its_first_column():
    lon = np.linspace(0.0, 360.0, 19)
    assert eastward(data.cmems(U, data.still, lon=lon), 10.0).shape[-1] == 18


def test_levels_down_to_a_depth():
    grid = eastward(data.cmems(U, data.still))
    np.testing.assert_array_equal(grid.levels(10.0).depth, [0.0, 5.0, 10.0])
    np.testing.assert_array_equal(grid.levels(11.0).depth, [0.0, 5.0, 10.0, 20.0])
    assert grid.levels(11.0).values().shape[0] == 4


def test_elevation_is_a_depth_downward():
    ds = data.cmems(U, data.still).rename(uo="elevation").isel(time=0, depth=0, drop=True)
    ds.elevation.attrs = {"standard_name": "height_above_mean_sea_level", "units": "m"}
    assert cf.variable_name(ds, cf.FLOOR_DEPTH) is None
    grid = cf.gridded(ds, cf.ELEVATION, cf.variable_name(ds, cf.ELEVATION))
    np.testing.assert_allclose(grid.values()[0], -data.on_grid(U)[0, 0])


@pytest.mark.parametrize("text", ["m s-1", "m/s", "meter second-1", "meters/second", "m s**-1", "m.s-1", "m s^-1",
                                  "metres per second", "M S-1"])  # fmt: skip
def test_units_of_speed(text):
    assert factor("u", text, "m/s") == 1.0


def test_moments():
    time = data.times()
    zone = datetime.timezone(datetime.timedelta(hours=2))
    for start in ("2024-05-01T01:00:00", datetime.datetime(2024, 5, 1, 3, tzinfo=zone), time[1]):
        np.testing.assert_allclose(cf.seconds_since(time, start), [-3600.0, 0.0, 3600.0, 7200.0])


def changed(change):
    ds = data.cmems(U, data.still)
    return change(ds) or ds


def with_attribute(name, key, value):
    return lambda ds: ds[name].attrs.__setitem__(key, value)


def with_latitude(values):
    return lambda ds: ds.assign_coords(latitude=("latitude", values, ds.latitude.attrs))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (with_attribute("uo", "units", "furlong"), "is not a unit of m/s. Convert it"),
        (lambda ds: ds.uo.attrs.pop("units") and None, "uo.units = '' is missing"),
        (with_attribute("depth", "positive", "up"), "upside down: write the attribute positive = 'down'"),
        (lambda ds: ds.drop_vars("depth"), "uo.depth = 'depth' has no depths"),
        (lambda ds: ds.rename(latitude="row").drop_vars("row"), "have no latitude"),
        (lambda ds: ds.isel(time=[0, 2, 1]), "does not rise. Sort it by ds.sortby"),
        (lambda ds: ds.isel(latitude=[0, 2, 1]), "neither rises nor falls"),
        (lambda ds: ds.assign_coords(time=[0.0, 1.0, 2.0, 3.0]), "is not a time of the standard calendar"),
        (with_latitude(np.where(np.arange(11) == 3, np.nan, data.LATITUDE)), "has 1 holes. Give a place to every node"),
        (lambda ds: ds.expand_dims(track=2), "uo.dims = 'track' is not an axis that is known"),
        (with_latitude(data.LATITUDE * 10.0), "passes 90 degrees"),
    ],
)  # fmt: skip
def test_faults(change, words):
    with pytest.raises(lw.SceneError, match=words):
        eastward(changed(change))


def test_names_that_are_not_there():
    ds = data.cmems(U, data.still, standard=False).rename(uo="a", vo="b")
    assert cf.variable_name(ds, cf.EASTWARD) is None
    assert "have no CF names that are known" in str(cf.missing(ds, [cf.EASTWARD]))
    with pytest.raises(lw.SceneError, match="is not a variable of the data set"):
        cf.variable_name(ds, cf.EASTWARD, "uo")
    ds.a.attrs["standard_name"] = ds.b.attrs["standard_name"] = "eastward_sea_water_velocity"
    with pytest.raises(lw.SceneError, match=r"are all the eastward velocity. Name the one"):
        cf.variable_name(ds, cf.EASTWARD)


@pytest.mark.parametrize(
    ("file", "words"), [("none.nc", "No such file"), ("", "is not a regular file"), ("a.nc", "no NetCDF file")]
)
def test_files_that_are_none(tmp_path, file, words):
    (tmp_path / "a.nc").write_text("not data")
    with pytest.raises(lw.SceneError, match=words):
        opened(tmp_path / file)


def test_no_address_of_another_machine():
    with pytest.raises(lw.SceneError, match="No such file"):
        opened("https://example.org/roms.nc")
