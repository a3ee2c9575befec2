# SPDX-License-Identifier: Apache-2.0
"""Files as models, radars and charts write them: at any place, depth and time the current that their closed form has."""

import os
import time

import netCDF4
import numpy as np
import pytest

import lgvi_warp as lw
from tests.extensions.ocean.test_field_reader import nodes
from tests.extensions.ocean.test_hostile_data import Pipes
from tests.support import ocean_files

pyproj = pytest.importorskip("pyproj")
xr = pytest.importorskip("xarray")
GEOD = pyproj.Geod(ellps="WGS84")


def place_of(grid, row, column, projection=ocean_files.STEREO):
    lat, lon = ocean_files.turned_places(projection, [row], [column], **grid)
    return float(lat[0, 0]), float(lon[0, 0])


NEMO = {"spacing": 9000.0, "origin": (-60000.0, -2560000.0), "angle": -0.5}
ROMS, UTM, ARCTIC = place_of(ocean_files.NORDIC, 6.5, 8.0), (53.26, 3.93), (73.0, 27.0)


def box(half, low, high):
    return {"region": [[-half, half], [-half, half], [low, high]]}


ROMS_BOX = box(8e3, 2.0, 60.0) | {"spacing": [1e3, 1e3, 4.0]}
DELFT_BOX = box(800.0, 2.5, 15.0) | {"spacing": [100.0, 100.0, 1.0]}
PLAIN = box(5e4, 0.0, 0.0)
# A kind of file: how it is written, a place in it, what is read, and the error [m/s]. Bilinear cells of size h lose at most
# 2 h^2 / (8 R^2) of the rotation and of the directions in each axis, 2 m/s in a radius; packed numbers their rounding.
KINDS = {
    "roms 1": (lambda p: ocean_files.roms(p, 1), ROMS, ROMS_BOX, 2e-6),
    "roms 2": (lambda p: ocean_files.roms(p, 2), ROMS, ROMS_BOX, 2e-6),
    "nordic 1": (lambda p: ocean_files.roms(p, 1, "nordic"), ROMS, ROMS_BOX, 2e-6),
    "nordic 2": (lambda p: ocean_files.roms(p, 2, "nordic"), ROMS, ROMS_BOX, 2e-6),
    "croco": (lambda p: ocean_files.roms(p, 2, "croco"), ROMS, ROMS_BOX, 2e-6),
    "nemo": (ocean_files.nemo, place_of(NEMO, 16.0, 6.0), box(2e4, 0.5, 60.0) | {"spacing": [5e3, 5e3, 1.0]}, 4e-6),
    "nemo by a hole": (
        ocean_files.nemo,
        place_of(NEMO, 6.6, 9.0),
        box(1e4, 0.5, 9.0) | {"spacing": [5e3, 5e3, 1.0]},
        2e-5,
    ),
    **{
        f"delft3d {system}": (lambda p, s=system: ocean_files.delft3d(p, s), UTM, DELFT_BOX, 1e-6)
        for system in ocean_files.SYSTEMS
    },
    "delft3d in rows": (lambda p: ocean_files.delft3d(p, "cf", False, "crs"), UTM, DELFT_BOX, 1e-6),
    "oscar": (ocean_files.oscar, ARCTIC, PLAIN, 3e-5),
    "access": (ocean_files.access, ARCTIC, box(5e4, 2.0, 20.0), 3e-5),
    "radar": (ocean_files.radar, (73.0, 31.5), box(2e4, 0.0, 0.0), 3e-5),
}


def closed_form(origin, north, east, depth, seconds):
    """Velocities to the north and the east of the plane, by a geodesic from the origin to each place."""
    bearing, distance = np.rad2deg(np.arctan2(east, north)), np.hypot(north, east)
    lon, lat, back = GEOD.fwd(np.full(north.shape, origin[1]), np.full(north.shape, origin[0]), bearing, distance)
    turn = np.deg2rad(bearing - (back + 180.0))
    along = ocean_files.current(lat, lon, depth, seconds)
    return np.cos(turn) * along[1] - np.sin(turn) * along[0], np.cos(turn) * along[0] + np.sin(turn) * along[1]


def read(path, origin, **more):
    return lw.terms.CurrentField.from_dataset(path, origin, **more)


@pytest.mark.ci
@pytest.mark.parametrize("kind", KINDS)
def test_values_are_those_of_the_closed_form(kind, tmp_path):
    make, origin, more, most = KINDS[kind]
    make(tmp_path / "a.nc")
    field = read(tmp_path / "a.nc", origin, **more)
    assert field.velocities.shape[1] > 1
    assert np.prod(field.velocities.shape[2:4]) >= 12
    for number in range(field.velocities.shape[1]):
        expected = closed_form(origin, *nodes(field), field.times[0] + number * field.times[1])
        np.testing.assert_allclose(
            field.velocities[0, number, ..., :2], np.stack(expected, axis=-1), rtol=0.0, atol=most
        )
    np.testing.assert_array_equal(field.velocities[..., 2], 0.0)
    again = lw.Scene.named("sphere", terms=[field.to_dict()]).terms[0]
    np.testing.assert_array_equal(again.velocities, field.velocities)


def at(field, north, east, number=0):
    from scipy.interpolate import RegularGridInterpolator

    axes = [
        o + d * np.arange(n) for o, d, n in zip(field.origin, field.spacing, field.velocities.shape[2:5], strict=True)
    ]
    return RegularGridInterpolator(axes[:2], field.velocities[0, number, :, :, 0, :2])([[north, east]])[0]


def test_a_hole_has_the_value_of_the_nearest_node(tmp_path):
    """Rows are 27.9 km apart, columns 16 km: beside node (6, 10) the nearest are in the same row."""
    ocean_files.radar(tmp_path / "a.nc")
    lat, lon = ocean_files.LAT[::-1][6], ocean_files.LON[10]
    origin = (float(lat), float(lon))
    field = read(tmp_path / "a.nc", origin, **box(3e3, 0.0, 0.0), spacing=[500.0, 500.0, 1.0])
    near = [ocean_files.current(lat, side)[::-1] for side in (lon - 0.5, lon + 0.5)]
    far = ocean_files.current(ocean_files.LAT[::-1][7], lon)[::-1]
    offs = [np.abs(at(field, 0.0, 0.0) - value).max() for value in (*near, far)]
    # Directions of the two nodes differ from those at the origin by their distance in longitude times the sine.
    assert min(offs[:2]) < 0.02 * np.linalg.norm(near[0])
    assert min(offs[:2]) < 0.5 * offs[2]
    zero = read(tmp_path / "a.nc", origin, **box(3e3, 0.0, 0.0), spacing=[500.0, 500.0, 1.0], fill="zero")
    np.testing.assert_allclose(at(zero, 0.0, 0.0), 0.0, atol=1e-9)
    with pytest.raises(lw.SceneError, match=r"values of u at time 0 are missing. Give fill = 'nearest'"):
        read(tmp_path / "a.nc", origin, **box(3e3, 0.0, 0.0), fill="refuse")


@pytest.mark.parametrize("kind", ["roms", "croco"])
def test_the_coast_of_a_model_has_the_column_of_the_nearest_water(kind, tmp_path):
    """Land is at columns 14 and more: u is missing from 13 on, v from 14 on, whatever the file has there."""
    ocean_files.roms(tmp_path / "a.nc", 2, kind)
    grid = ocean_files.NORDIC
    origin = place_of(grid, 7.0, 15.0)
    field = read(tmp_path / "a.nc", origin, **box(2e3, 5.0, 60.0), spacing=[100.0, 100.0, 5.0])
    # At a rho point the mean of two v, and of two u, filled along their rows: columns 12.5 and 13.
    stereo = ocean_files.STEREO
    for depth in (0, 5, 11):
        total = np.zeros(2)
        for letter, column, rows in (("u", 12.5, (7.0,)), ("v", 13.0, (6.5, 7.5))):
            for row in rows:
                lat, lon = place_of(grid, row, column)
                # Its part along the grid there, and the direction of the grid at the land node.
                bend = ocean_files.angle_of(stereo, [row], [column], **grid)[0, 0]
                east, north = ocean_files.current(lat, lon, nodes(field)[2][0, 0, depth])
                along = (
                    east * np.cos(bend) + north * np.sin(bend)
                    if letter == "u"
                    else north * np.cos(bend) - east * np.sin(bend)
                )
                turn = ocean_files.angle_of(stereo, [7.0], [15.0], **grid)[0, 0]
                unit = (np.sin(turn), np.cos(turn)) if letter == "u" else (np.cos(turn), -np.sin(turn))
                total += along * np.array(unit) / len(rows)
        np.testing.assert_allclose(field.velocities[0, 0, 20, 20, depth, :2], total, atol=5e-4 * np.linalg.norm(total))
    assert field.data.missing > 0


def test_a_field_that_is_missing_is_gone_over_in_a_straight_line(tmp_path):
    more = box(2e4, 0.0, 0.0)
    ocean_files.radar(tmp_path / "a.nc", outage=(3, 4))
    field = read(tmp_path / "a.nc", (73.0, 31.5), **more)
    np.testing.assert_allclose(field.times, [0.0, 3600.0])
    assert field.velocities.shape[1] == 7
    np.testing.assert_allclose(
        field.velocities[:, 3], (2.0 * field.velocities[:, 2] + field.velocities[:, 5]) / 3.0, atol=1e-12
    )
    assert "2 of the fields have no value there: the current goes straight over them" in field.remarks
    assert any("no field from 2 to 5 h" in text for text in field.remarks)
    ocean_files.radar(tmp_path / "a.nc", outage=(0,))
    with pytest.raises(
        lw.SceneError, match=r"start = 'u' has no value there .* an outage. Give a moment 3600 to 21600 s from it"
    ):
        read(tmp_path / "a.nc", (73.0, 31.5), **more)
    assert read(tmp_path / "a.nc", (73.0, 31.5), start="2020-09-13T13:26:40", **more).velocities.shape[1] == 6
    ocean_files.radar(tmp_path / "a.nc", outage=range(7))
    with pytest.raises(lw.SceneError, match="u at time 0' has no value there: land"):
        read(tmp_path / "a.nc", (73.0, 31.5), **more)


@pytest.mark.parametrize(
    ("calendar", "day", "first"),
    [
        ("NOLEAP", "1999-02-28", -86400.0),
        ("365_day", "1999-03-01T12:00", -216000.0),
        ("all_leap", "1994-09-08", None),
        ("360_day", "2020-01-01", None),
        ("julian", "1999-02-14", None),
        ("proleptic_gregorian", "1998-09-10", None),
    ],
)
def test_times_count_in_the_calendar_of_the_file(calendar, day, first, tmp_path):
    """Days after the year 1: 1999 years of 365 days and 57 more."""
    ocean_files.access(tmp_path / "a.nc", calendar)
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        moments = netCDF4.num2date(file["time"][:], file["time"].units, calendar.lower())
    field = read(tmp_path / "a.nc", ARCTIC, **box(5e4, 2.0, 20.0))
    np.testing.assert_allclose(field.times, [0.0, 86400.0], rtol=1e-12)
    assert field.velocities.shape[1] == 3
    second = f"{moments[1].year:04d}-{moments[1].month:02d}-{moments[1].day:02d}T06:00"
    later = read(tmp_path / "a.nc", ARCTIC, start=second, **box(5e4, 2.0, 20.0))
    np.testing.assert_allclose(later.times, [-21600.0, 86400.0], rtol=1e-12)
    with pytest.raises(lw.SceneError, match=r"start = .* is outside the data, \d{4}-\d\d-\d\d"):
        read(tmp_path / "a.nc", ARCTIC, start="1950-01-01", **box(5e4, 2.0, 20.0))


def test_a_day_that_a_calendar_does_not_have(tmp_path):
    ocean_files.access(tmp_path / "a.nc")
    with pytest.raises(
        lw.SceneError, match=r"start = '2000-02-29' is no day of the file's calendar, noleap. Give another day"
    ):
        read(tmp_path / "a.nc", ARCTIC, start="2000-02-29", **box(5e4, 2.0, 20.0))


def test_times_that_count_from_no_moment(tmp_path):
    ocean_files.roms(tmp_path / "a.nc", 2, "croco")
    plain = read(tmp_path / "a.nc", ROMS, **ROMS_BOX)
    assert plain.data.request.start is None
    with pytest.raises(lw.SceneError, match=r"start = .* count from none. Leave it out, or give attributes = "):
        read(tmp_path / "a.nc", ROMS, start="2000-01-02", **ROMS_BOX)
    told = read(
        tmp_path / "a.nc", ROMS, start="2000-01-02", attributes={"time.units": "seconds since 2000-01-01"}, **ROMS_BOX
    )
    np.testing.assert_allclose(told.times, [0.0, 86400.0])
    np.testing.assert_array_equal(told.velocities, plain.velocities[:, 1:])


def changed(path, *changes, **attributes):
    """The file with attributes by variable, and what else a function does to it."""
    with netCDF4.Dataset(path, "r+") as file:
        for change in changes:
            change(file)
        for name, values in attributes.items():
            for key, value in values.items():
                if value is None:
                    file[name].delncattr(key)
                else:
                    file[name].setncattr(key, value)


def without(name):
    return lambda file: file.renameVariable(name, f"other_{name}")


def mask_beside(file):
    file["mask_u"][:] = np.roll(file["mask_u"][:], 1, axis=1)


REFUSALS = {
    "no units": ("roms", {"u": {"units": None}}, r"u.units = '' is missing.* give attributes = {'u.units': 'm/s'}"),
    "no formula": (
        "roms",
        [without("Vtransform"), {"s_rho": {"standard_name": "s"}}],
        r"u.s_rho = .*does not tell one formula of its depths. Give attributes = {'Vtransform': 1}, or 2",
    ),
    "two formulas": (
        "roms",
        {"s_rho": {"standard_name": "ocean_s_coordinate_g1"}},
        "does not tell one formula of its depths",
    ),
    "no stretching": ("roms", [without("Cs_r")], r"does not tell the depths of its levels: C. Name s, C, depth"),
    "a floor elsewhere": (
        "roms",
        [without("h"), lambda f: f.createVariable("h", "f8", ("s_rho",))],
        r"u.s_rho = 'h' stands at other nodes than u. Interpolate h to them",
    ),
    "degrees for radians": (
        "roms",
        [lambda f: f["angle"].__setitem__(slice(None), np.rad2deg(f["angle"][:]))],
        r"angle = .* degrees' is between it and the x of the grid. Give attributes = {'angle.units': 'degrees'}",
    ),
    "cut beside": (
        "nordic",
        [mask_beside],
        r"mask_u = .* is not between the points of mask_rho with the same indices. Cut",
    ),
    "a bad calendar": (
        "roms",
        {"ocean_time": {"calendar": "none"}},
        r"u.ocean_time = .*is not a time of the standard calendar.*. Give attributes = {'ocean_time.units': ",
    ),
    "no system": (
        "delft3d",
        {"projected_coordinate_system": {"epsg": None, "EPSG_code": None}},
        r"projected_coordinate_system = 'Unknown projected' has a coordinate reference system that is not understood",
    ),
    "no ellipsoid": (
        "ibcao",
        {"polar_stereographic": {"semi_major_axis": None}},
        "that says no ellipsoid, such as semi_major_axis",
    ),
    "no mapping": (
        "ibcao",
        {"z": {"grid_mapping": None}},
        r"z.grid_mapping = '' names no projection of its x and y. Give attributes = {'z.grid_mapping': 'EPSG:32631'}",
    ),
    "no direction": (
        "nemo",
        [{"vozocrtx": {"standard_name": None}}, lambda f: f.renameVariable("vozocrtx", "u")],
        r"u.standard_name = '' does not say whether it is along the axes .* 'sea_water_x_velocity'}, or 'eastward_",
    ),
    "a damaged variable": (
        "radar",
        {"u": {"scale_factor": "a tenth"}},
        "variables = 'u' cannot be decoded, its scale_factor is no number",
    ),
}
WRITERS = {
    "roms": (ocean_files.roms, ROMS, ROMS_BOX),
    "nemo": KINDS["nemo"][:3],
    "radar": KINDS["radar"][:3],
    "nordic": KINDS["nordic 2"][:3],
    "delft3d": KINDS["delft3d epsg"][:3],
}


@pytest.mark.parametrize("case", REFUSALS)
def test_what_a_file_does_not_tell_is_refused_in_a_line(case, tmp_path):
    kind, changes, words = REFUSALS[case]
    changes = changes if isinstance(changes, list) else [changes]
    path = tmp_path / "a.nc"
    make, origin, more = WRITERS.get(kind, (ocean_files.ibcao, None, None))
    make(path)
    for change in changes:
        changed(path, *([] if isinstance(change, dict) else [change]), **(change if isinstance(change, dict) else {}))
    if case == "a damaged variable":
        more = more | {"variables": ["u", "v"]}
    with pytest.raises(lw.SceneError, match=words) as error:
        if origin is None:
            lw.events.Floor.from_file(path, (79.0, 0.5), region=[[-5e3, 5e3], [-5e3, 5e3]])
        else:
            read(path, origin, **more)
    assert len(str(error.value).splitlines()) == 1


@pytest.mark.parametrize(
    ("more", "attributes"),
    [
        ({}, None),
        ({"descending": True}, None),
        ({"mapping": ""}, {"z.grid_mapping": "EPSG:3996"}),
        ({"mapping": "projection_stereographic", "spatial_ref": pyproj.CRS.from_epsg(3996).to_wkt("WKT1_GDAL")}, None),
        ({"mapping": "crs", "proj4": "+proj=stere +lat_0=90 +lat_ts=75 +lon_0=0 +datum=WGS84 +units=m +no_defs"}, None),
        ({"mapping": "crs", "grid_mapping_name": "polar_stereographic"}, {"crs.epsg": 3996}),
    ],
)
def test_a_chart_in_a_polar_projection(more, attributes, tmp_path):
    ocean_files.ibcao(tmp_path / "a.nc", **more)
    origin = (79.0, 0.5)
    floor = lw.events.Floor.from_file(
        tmp_path / "a.nc", origin, region=[[-5e3, 5e3], [-4e3, 4e3]], spacing=[250.0, 250.0], attributes=attributes
    )
    north, east = np.meshgrid(
        *(o + d * np.arange(n) for o, d, n in zip(floor.origin, floor.spacing, floor.depth.shape, strict=True)),
        indexing="ij",
    )
    lon, lat, _ = GEOD.fwd(
        np.full(north.shape, origin[1]),
        np.full(north.shape, origin[0]),
        np.rad2deg(np.arctan2(east, north)),
        np.hypot(north, east),
    )
    # Numbers of 32 bits, about 500 m.
    np.testing.assert_allclose(floor.depth, -ocean_files.elevation(*ocean_files.IBCAO(lon, lat)), rtol=1.2e-7)


def test_degrees_of_gmt_along_x_and_y(tmp_path):
    ocean_files.gmt(tmp_path / "a.nc")
    floor = lw.events.Floor.from_file(tmp_path / "a.nc", ARCTIC, region=[[-5e3, 5e3], [-5e3, 5e3]])
    lon, lat, _ = GEOD.fwd(*ARCTIC[::-1], 0.0, floor.origin[0])
    lon, lat, _ = GEOD.fwd(*ARCTIC[::-1], np.rad2deg(np.arctan2(*floor.origin[::-1])), np.hypot(*floor.origin))
    assert floor.depth[0, 0] == pytest.approx(100.0 + 3.0 * (lat - 70.0) - 2.0 * (lon - 20.0), rel=1e-6)


@pytest.mark.parametrize("falls", [False, True])
def test_rows_from_the_north_of_a_projection_turn_no_velocity(falls):
    """Files of MET Norway: x and y of a projection along the rows, and latitudes and longitudes of each node."""
    y, x = -2520000.0 + 4000.0 * np.arange(12), -20000.0 + 4000.0 * np.arange(14)
    places = ocean_files.turned_places(ocean_files.STEREO, np.arange(12.0), np.arange(14.0), 4000.0, (x[0], y[0]), 0.0)
    bend = ocean_files.angle_of(ocean_files.STEREO, np.arange(12.0), np.arange(14.0), 4000.0, (x[0], y[0]), 0.0)
    east, north = ocean_files.current(*places)
    values = {"u": east * np.cos(bend) + north * np.sin(bend), "v": north * np.cos(bend) - east * np.sin(bend)}
    words = {"coordinates": "longitude latitude", "grid_mapping": "projection_stere", "units": "meter second-1"}
    ds = xr.Dataset(
        {
            n: (("Y", "X"), a, words | {"standard_name": f"{d}_sea_water_velocity"})
            for (n, a), d in zip(values.items(), "xy", strict=True)
        },
        {
            "X": ("X", x, {"standard_name": "projection_x_coordinate", "units": "m"}),
            "Y": ("Y", y, {"standard_name": "projection_y_coordinate", "units": "m"}),
            "latitude": (("Y", "X"), places[0], {"units": "degrees_north"}),
            "longitude": (("Y", "X"), places[1], {"units": "degrees_east"}),
        },
    )
    origin = float(places[0][6, 7]), float(places[1][6, 7])
    field = read(
        ds.isel(Y=slice(None, None, -1)) if falls else ds, origin, **box(8e3, 0.0, 0.0), spacing=[1e3, 1e3, 1.0]
    )
    np.testing.assert_allclose(
        field.velocities[0, 0, ..., :2], np.stack(closed_form(origin, *nodes(field), 0.0), axis=-1), atol=1e-6
    )


def test_levels_in_attributes_and_the_plain_formula(tmp_path):
    """CROCO of old has its levels as attributes of the file; Song and Haidvogel's formula makes its own stretching."""
    from lgvi_warp.extensions.ocean import cf
    from lgvi_warp.extensions.ocean.data_sets import opened

    ocean_files.roms(tmp_path / "a.nc", 2, "croco")
    ocean_files.roms(tmp_path / "b.nc", 1)
    with opened(tmp_path / "a.nc") as ds:
        grid = cf.gridded(ds, cf.ALONG_X, "u")
    s, C = ocean_files.stretching(ocean_files.LEVELS)
    np.testing.assert_allclose((grid.s_levels.s, grid.s_levels.C), (s, C), rtol=1e-12)
    with opened(tmp_path / "b.nc") as ds:
        ds.s_rho.attrs |= {
            "standard_name": "ocean_s_coordinate",
            "formula_terms": "s: s_rho eta: zeta depth: h a: a b: b depth_c: hc",
        }
        plain = cf.gridded(ds.drop_vars(["Vtransform", "Cs_r"]).assign(a=6.0, b=0.4), cf.ALONG_X, "u").s_levels
        depths = plain.depths(1)
        floor, surface = (
            0.5 * (v[..., :-1] + v[..., 1:]) for v in (ds.h.values, np.nan_to_num(ds.zeta.values[1].astype(float)))
        )
    C = 0.6 * np.sinh(6.0 * s) / np.sinh(6.0) + 0.4 * (np.tanh(6.0 * (s + 0.5)) / (2.0 * np.tanh(3.0)) - 0.5)
    s, C = s[:, None, None], C[:, None, None]
    np.testing.assert_allclose(-depths, surface * (1.0 + s) + 30.0 * s + (floor - 30.0) * C, rtol=1e-12)


def test_a_file_that_becomes_another_while_it_is_looked_at(tmp_path, monkeypatch):
    from lgvi_warp.extensions.ocean import data_sets

    ocean_files.roms(tmp_path / "a.nc")
    expected = read(tmp_path / "a.nc", ROMS, **ROMS_BOX).velocities
    check = data_sets._check_whole

    def swapped(path, size):
        check(path, size)
        (tmp_path / "b").write_bytes(b"CDF\1 and nothing more")
        os.replace(tmp_path / "b", tmp_path / "a.nc")

    monkeypatch.setattr(data_sets, "_check_whole", swapped)
    np.testing.assert_array_equal(read(tmp_path / "a.nc", ROMS, **ROMS_BOX).velocities, expected)


@pytest.mark.ci
@pytest.mark.parametrize(
    "text",
    [
        "+proj=utm +zone=31 +nadgrids={}",
        "+proj=utm +zone=31 +geoidgrids={}",
        "+init={}:32631",
        "+proj=pipeline +step +proj=utm +zone=31 +step +proj=gridshift +grids={}",
        'PROJCS["a",GEOGCS["b",DATUM["c",SPHEROID["d",6378137,298.25],EXTENSION["PROJ4_GRIDS","{}"]],PRIMEM["e",0],'
        'UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],UNIT["metre",1]]',
    ],
)
@pytest.mark.parametrize("name", ["proj4", "spatial_ref", "crs_wkt", "geographic_crs_name"])
def test_a_projection_opens_no_other_file(text, name, tmp_path):
    pipes = Pipes()
    try:
        path = pipes.at(tmp_path / "grid.gsb")
        ocean_files.delft3d(tmp_path / "a.nc")
        with netCDF4.Dataset(tmp_path / "a.nc", "r+") as file:
            mapping = file["projected_coordinate_system"]
            mapping.delncattr("epsg")
            mapping.delncattr("EPSG_code")
            mapping.setncattr(name, text.format(path))
        with pytest.raises(lw.SceneError, match=r"^projected_coordinate_system = .*. Give attributes = ") as error:
            read(tmp_path / "a.nc", UTM, **DELFT_BOX)
        assert len(str(error.value).splitlines()) == 1
        time.sleep(0.02)
        assert not pipes.opened
    finally:
        pipes.stop.set()
        pipes.thread.join()


@pytest.mark.parametrize(
    ("text", "unit", "size"),
    [
        ("centimeter/s", "m/s", 0.01),
        ("centimeters per second", "m/s", 0.01),
        ("cm/sec", "m/s", 0.01),
        ("m/sec", "m/s", 1.0),
        ("meters, positive up", "m", 1.0),
        ("m (positive down)", "m", 1.0),
        ("kilometers", "m", 1000.0),
        ("m s^{-1}", "m/s", 1.0),
        ("second", "s", 1.0),
        ("days", "s", 86400.0),
        ("hours", "s", 3600.0),
    ],
)
def test_units(text, unit, size):
    from lgvi_warp.extensions.ocean.units import factor, positive

    assert factor("a", text, unit) == size
    assert positive({"units": text}) == ("up" if "up" in text else "down" if "down" in text else "")
    assert positive({"units": text, "positive": "Down"}) == "down"
