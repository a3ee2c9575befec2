# SPDX-License-Identifier: Apache-2.0
"""Currents of data sets on a regular grid: places and directions, levels, times, holes, regions, and what is refused."""

import datetime
import sys
import tracemalloc

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.places import LocalPlane
from lgvi_warp.extensions.ocean import cf, regrid
from lgvi_warp.extensions.ocean.s_levels import at_depths
from tests.extensions.ocean import data

pyproj = pytest.importorskip("pyproj")
xr = pytest.importorskip("xarray")
ORIGIN = (41.5, -70.5)
PLANE = LocalPlane(*ORIGIN)
# Within the data by a few kilometers.
DEPTHS = np.array([0.0, 4.0, 9.0, 20.0, 40.0])
REGION = [[-3e4, 3e4], [-3e4, 3e4], [0.0, 40.0]]
# True north turns by 1.5e-3 rad from one node to the next: half way, a speed is too small by an eighth of its square.
TURN = 3e-7


def read(ds, **more):
    return lw.terms.CurrentField.from_dataset(ds, ORIGIN, **{"region": REGION, **more})


def nodes(field):
    """North, east and depth of the nodes (x, y, z)."""
    counts = field.velocities.shape[2:5]
    axes = [o + d * np.arange(n) for o, d, n in zip(field.origin, field.spacing, counts, strict=True)]
    return np.meshgrid(*axes, indexing="ij")


# A flow of constant direction in true axes, whose parts grow with depth and time.
EAST = lambda lat, lon, z, t: 0.3 + 0.004 * z + 2e-5 * t + 0.0 * lat  # noqa: E731
NORTH = lambda lat, lon, z, t: -0.1 + 0.002 * z + 0.0 * (lat + t)  # noqa: E731


@pytest.mark.parametrize("model", [data.cmems, data.hycom])
def test_velocities_point_where_they_do_on_the_ellipsoid(model):
    field = read(model(EAST, NORTH))
    north, east, depth = nodes(field)
    # Along the flow for a meter, by a geodesic of the ellipsoid, and back to the plane.
    lat, lon = PLANE.geodetic(north, east)
    for number, t in enumerate(3600.0 * data.HOURS):
        u, v = EAST(lat, lon, depth, t), NORTH(lat, lon, depth, t)
        there = pyproj.Geod(ellps="WGS84").fwd(lon, lat, np.rad2deg(np.arctan2(u, v)), np.full(lat.shape, 10.0))
        goes = np.stack(PLANE.local(there[1], there[0]), axis=-1) - np.stack([north, east], axis=-1)
        expected = goes / 10.0 * np.hypot(u, v)[..., None]
        # Lengths across the bearing are too long by d^2 / (6 R^2), 7.4e-6 at 42 km, of at most 0.7 m/s.
        np.testing.assert_allclose(field.velocities[0, number, ..., :2], expected, rtol=0.0, atol=5.2e-6)
    np.testing.assert_array_equal(field.velocities[..., 2], 0.0)
    np.testing.assert_allclose(field.times, [0.0, 3600.0])


def test_upward_is_up():
    up = lambda lat, lon, z, t: 0.01 + 0.0 * (lat + lon + z + t)  # noqa: E731
    np.testing.assert_allclose(read(data.cmems(EAST, NORTH, up)).velocities[..., 2], -0.01)


def turned_data(function, along=False, angle=0.4):
    """A data set on a grid that is turned in the plane: eastward and northward velocities, or those along the grid."""
    lat, lon = data.turned(*ORIGIN, angle, shape=(12, 11), spacing=9000.0)
    z, t = data.DEPTH[:, None, None], 3600.0 * data.HOURS[:, None, None, None]
    north, east = function(*PLANE.local(lat, lon), z, t)
    if along:
        # Rows go along (cos, -sin), columns along (sin, cos), to the north and the east.
        u, v = np.sin(angle) * north + np.cos(angle) * east, np.cos(angle) * north - np.sin(angle) * east
        words = "sea_water_x_velocity", "sea_water_y_velocity"
    else:
        turn = PLANE.convergence(lat, lon)
        u, v = -np.sin(turn) * north + np.cos(turn) * east, np.cos(turn) * north + np.sin(turn) * east
        words = "eastward_sea_water_velocity", "northward_sea_water_velocity"
    dims = ("ocean_time", "depth", "eta_rho", "xi_rho")
    full = (len(data.HOURS), len(data.DEPTH), *lat.shape)
    variables = {
        name: (dims, np.broadcast_to(x, full), {"units": "meter second-1", "standard_name": word})
        for name, x, word in zip(("u", "v"), (u, v), words, strict=True)
    }
    return xr.Dataset(variables, {
        "ocean_time": data.times(),
        "depth": ("depth", -data.DEPTH, {"units": "meter", "positive": "up"}),
        "lat_rho": (dims[2:], lat, {"units": "degree_north", "standard_name": "latitude"}),
        "lon_rho": (dims[2:], lon, {"units": "degree_east", "standard_name": "longitude"}),
    })  # fmt: skip


def linear(north, east, z, t):
    """A current to the north and the east, linear in each of its numbers."""
    return (0.2 + 4e-6 * north - 2e-6 * east + 0.003 * z + 1e-5 * t, -0.1 + 3e-6 * east + 1e-10 * north * z + 0.0 * t)


@pytest.mark.parametrize("along", [True, False])
def test_a_turned_grid_is_exact_where_the_current_is_linear(along):
    field = read(turned_data(linear, along))
    north, east, depth = nodes(field)
    for number, t in enumerate(3600.0 * data.HOURS):
        expected = np.stack(np.broadcast_arrays(*linear(north, east, depth, t), 0.0), axis=-1)
        np.testing.assert_allclose(field.velocities[0, number], expected, rtol=0.0, atol=1e-11)


def roms(function, kind, surface):
    """Levels that follow the floor as ROMS has them, and their depths by the formulas of its manual."""
    ds = turned_data(lambda north, east, z, t: (0.0 * north + z + t, 0.0 * north + z + t), along=True)
    ds = ds.isel(depth=0, drop=True).drop_vars(["u", "v"])
    s = np.linspace(-1.0, 0.0, 9)
    C = (1.0 - np.cosh(3.0 * s)) / (np.cosh(3.0) - 1.0)
    north, east = PLANE.local(ds.lat_rho.values, ds.lon_rho.values)
    h = 100.0 + 5e-4 * north
    zeta, hc = surface * (1.0 + 1e-6 * east), 20.0
    if kind == 1:
        z0 = hc * (s - C)[:, None, None] + C[:, None, None] * h
        z = z0 + zeta * (1.0 + z0 / h)
    else:
        z0 = (hc * s[:, None, None] + h * C[:, None, None]) / (hc + h)
        z = zeta + (zeta + h) * z0
    u, v = function(north, east, -z, 0.0)
    dims = ("ocean_time", "s_rho", "eta_rho", "xi_rho")
    formula = "s: s_rho C: Cs_r eta: zeta depth: h depth_c: hc"
    known = {"standard_name": f"ocean_s_coordinate_g{kind}", "formula_terms": formula}
    # Rows go to the north and columns to the east: angle 0 below.
    full = (len(data.HOURS), *z.shape)
    return ds.assign(
        u_eastward=(dims, np.broadcast_to(v, full), {"units": "m/s"}),
        v_northward=(dims, np.broadcast_to(u, full), {"units": "m/s"}),
        h=(dims[2:], h), hc=hc, Cs_r=("s_rho", C), zeta=(("ocean_time", *dims[2:]), np.broadcast_to(zeta, (4, *h.shape))),
    ).assign_coords(s_rho=("s_rho", s, known))  # fmt: skip


@pytest.mark.parametrize("kind", [1, 2])
def test_levels_that_follow_the_floor(kind):
    # Linear in depth, and constant along: exact on any levels, from the surface of the water to the deepest.
    field = read(roms(lambda n, e, z, t: (0.0 * n + 0.5 - 0.004 * z, 0.0 * n + 0.0 * z), kind, 0.6),
                 region=[[-2e4, 2e4], [-2e4, 2e4], [0.0, 70.0]], spacing=[5e3, 5e3, 7.0])  # fmt: skip
    depth = nodes(field)[2]
    speed = np.hypot(field.velocities[..., 0], field.velocities[..., 1])
    np.testing.assert_allclose(speed[0, 0], 0.5 - 0.004 * depth, rtol=TURN)


@pytest.mark.parametrize("depths", [DEPTHS, DEPTHS[:1], np.array([3.0])])
@pytest.mark.parametrize("follows", [True, False])
def test_beyond_the_first_and_the_last_level_the_nearest_holds(depths, follows):
    """The last interval has a slope, which must not go on below the deepest level."""
    values = 0.5 + np.arange(float(len(depths))) ** 2
    target = regrid.Regular(np.array([0.0, 0.0, -5.0]), np.array([1.0, 1.0, 3.0]), (1, 1, 25))
    wanted = target.nodes(2)
    grid = cf.gridded(data.cmems(EAST, NORTH, depth=depths), cf.EASTWARD, "uo")
    field, levels = (np.broadcast_to(x[:, None, None], (len(depths), *grid.shape[3:])) for x in (values, depths))
    onto = regrid.Onto(regrid.Placed(grid, PLANE), target)
    found = at_depths(field, levels, wanted)[:, 1, 2] if follows else onto(field)[0, 0]
    np.testing.assert_allclose(found, np.interp(wanted, depths, values), rtol=1e-13)


def test_the_water_below_the_deepest_level_has_its_velocity():
    field = read(data.cmems(EAST, NORTH), region=[[-3e4, 3e4], [-3e4, 3e4], [0.0, 500.0]], outside="hold")
    last = field.origin[2] + field.spacing[2] * (field.velocities.shape[4] - 1)
    assert last == pytest.approx(data.DEPTH[-1])
    np.testing.assert_allclose(field.data.request.region[2], data.DEPTH[[0, -1]])
    # By the formula that states are checked with: 0.3 + 0.004 z at 40 m holds at any depth below.
    places = np.array([[[0.0, 0.0, depth]] for depth in (last, last + 1.0, last + 5.0, 1e4)])
    water = field.water({"velocities": field.velocities[None], "scenario": np.zeros(1), "times": field.times[None],
                         "origin": field.origin[None], "spacing": field.spacing[None]}, places, np.zeros(4), {})  # fmt: skip
    np.testing.assert_allclose(np.hypot(*water[:, 0, :2].T), np.hypot(0.3 + 0.16, -0.1 + 0.08), rtol=1e-4)
    np.testing.assert_array_equal(water, np.broadcast_to(water[:1], water.shape))


def test_depths_go_on_to_regular_levels_and_the_change_is_told():
    z = np.array([0.0, 4.0, 9.0, 20.0, 40.0])
    kinked = lambda lat, lon, depth, t: np.interp(depth, z, [0.0, 1.0, 0.0, 0.5, 0.2]) + 0.0 * (lat + t)  # noqa: E731
    field = read(data.cmems(kinked, data.still, depth=z))
    assert field.velocities.shape[4] == 11
    assert field.spacing[2] == 4.0
    # Node 9 m lies a quarter of the way from 8 to 12 m.
    at = np.interp([8.0, 12.0], z, [0.0, 1.0, 0.0, 0.5, 0.2])
    assert field.data.error == pytest.approx(abs(0.75 * at[0] + 0.25 * at[1] - 0.0), rel=1e-6)
    # At most a hundred levels, unless they are told.
    deep = data.cmems(EAST, NORTH, depth=np.array([0.0, 1.0, 5000.0]))
    assert read(deep, region=[[-3e4, 3e4], [-3e4, 3e4], [0.0, 5000.0]]).velocities.shape[4] == 100
    assert read(deep, spacing=[1e4, 1e4, 0.5]).velocities.shape[4] == 81


def test_times_at_unequal_intervals():
    hours = np.array([0.0, 1.0, 1.5, 4.0])
    field = read(data.cmems(lambda lat, lon, z, t: np.interp(t / 3600.0, hours, [0.0, 1.0, 0.0, 5.0]) + 0.0 * lat,
                            data.still, hours=hours))  # fmt: skip
    np.testing.assert_allclose(field.times, [0.0, 1800.0])
    east = np.hypot(*np.moveaxis(field.velocities[0, :, 0, 0, 0, :2], -1, 0))
    np.testing.assert_allclose(east, [0.0, 0.5, 1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0], atol=1e-6)
    assert field.data.error < 1e-5


@pytest.mark.parametrize(
    ("start", "first", "count"),
    [(None, 0.0, 4), ("2024-05-01T01:00", 0.0, 3), ("2024-05-01T01:30:00Z", -1800.0, 3),
     (datetime.datetime(2024, 5, 1, 2, tzinfo=datetime.UTC), 0.0, 2)],
)  # fmt: skip
def test_the_start_and_the_times_that_are_read(start, first, count):
    field = read(data.cmems(EAST, NORTH), start=start)
    np.testing.assert_allclose(field.times, [first, 3600.0])
    assert field.velocities.shape[1] == count
    assert not field.data.more
    field = read(data.cmems(EAST, NORTH), start=start, duration=1800.0)
    assert field.data.more == (count > 2)


def test_one_time_does_not_change():
    field = read(data.cmems(EAST, NORTH, hours=[0]))
    assert field.times is None
    assert not field.timed
    assert read(data.cmems(EAST, NORTH).isel(time=1, drop=True)).times is None


def test_members_of_a_forecast_are_scenarios():
    each = [data.cmems(lambda *x, k=k: 0.1 * k + 0.0 * sum(x), data.still) for k in range(3)]
    field = read(xr.concat(each, "number"))
    assert field.velocities.shape[0] == 3
    np.testing.assert_allclose(np.linalg.norm(field.velocities[:, 0, 0, 0, 0], axis=-1), [0.0, 0.1, 0.2], rtol=TURN)


def test_holes_are_counted_and_filled_with_the_nearest():
    ds = data.cmems(lambda lat, lon, z, t: lon + 0.0 * (lat + z + t), data.still).isel(time=[0])
    # Land in the west, and no water below 10 m in the first row but one.
    ds.uo[:, :, :, :4] = ds.vo[:, :, :, :4] = np.nan
    ds.uo[:, 3:, 1] = np.nan
    field = read(ds, region=None)
    holes = int(np.isnan(ds.uo).sum() + np.isnan(ds.vo).sum())
    assert (field.data.missing, field.data.values) == (holes, 2 * 5 * 11 * 9)
    text = f"{holes:,} of 990 values ({100 * holes / 990:.2g} %), on land or below the sea floor, are missing"
    assert field.remarks[0].startswith(text)
    _, lon = PLANE.geodetic(*(x[:, :, 0] for x in nodes(field)[:2]))
    expected = np.maximum(lon, data.LONGITUDE[4])
    np.testing.assert_allclose(-np.hypot(*np.moveaxis(field.velocities[0, 0, :, :, 0, :2], -1, 0)), expected, rtol=TURN)
    np.testing.assert_allclose(field.velocities[0, 0, :, :, -1], field.velocities[0, 0, :, :, 0], atol=1e-9)
    zero = read(ds, region=None, fill="zero")
    west = lon < data.LONGITUDE[3]
    np.testing.assert_array_equal(zero.velocities[0, 0][west], 0.0)
    with pytest.raises(lw.SceneError, match=r"values of uo at time 0 are missing. Give fill = 'nearest'"):
        read(ds, fill="refuse")
    ds.uo[:] = np.nan
    with pytest.raises(lw.SceneError, match="uo at time 0' has no value there: land"):
        read(ds)


def test_the_box_within_the_data_is_the_default():
    for ds in (data.cmems(EAST, NORTH), turned_data(linear)):
        field = lw.terms.CurrentField.from_dataset(ds, ORIGIN)
        north, east, _ = nodes(field)
        grid = LocalPlane(*ORIGIN).geodetic(north, east)
        assert field.velocities[0, 0, :, :, 0, 0].size > 20
        if "latitude" in ds:
            assert grid[0].min() >= 41.0 - 1e-9
            assert grid[0].max() <= 42.0 + 1e-9
            assert grid[1].min() >= -71.0 - 1e-9
        else:
            # The square in a turned rectangle.
            back = np.cos(0.4) * north - np.sin(0.4) * east, np.sin(0.4) * north + np.cos(0.4) * east
            assert np.abs(back[0]).max() <= 5.5 * 9000.0 + 1.0
            assert np.abs(back[1]).max() <= 5.0 * 9000.0 + 1.0


def test_what_a_vehicle_can_reach():
    field = read(data.cmems(EAST, NORTH), region=None, speed=2.0, duration=3600.0, around=[5e3, 0.0, 10.0])
    np.testing.assert_allclose(field.data.request.region, [[-2.2e3, 12.2e3], [-7.2e3, 7.2e3], [0.0, 40.0]])
    # Far beyond the data: cut, or refused where it would be held.
    far = {"region": None, "speed": 20.0, "duration": 7200.0}
    assert read(data.cmems(EAST, NORTH), **far).data.request.region[0, 1] < 6e4
    words = r"speed = '-144 to 144 km north and -144 to 144 km east' is not within the data, .* outside = 'stop'"
    with pytest.raises(lw.SceneError, match=words):
        read(data.cmems(EAST, NORTH), **far, outside="hold")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"region": [[-3e5, 3e5], [-3e4, 3e4], [0.0, 40.0]]}, "is not within the data.*a larger data set"),
        ({"region": [[3e4, -3e4], [-3e4, 3e4], [0.0, 40.0]]}, "ends before it begins"),
        ({"region": None, "speed": 2.0}, "says no region without a duration"),
        ({"speed": 2.0, "duration": 9.0}, "says the region, and so does region"),
        ({"start": "2023-01-01"}, "start = '2023-01-01' is outside the data, 2024-05-01T00:00:00 to"),
        ({"start": "yesterday"}, "is not a moment. Give a datetime"),
        ({"fill": "guess"}, "fill = 'guess' is not known"),
        ({"variables": ["uo"]}, "are no two or three names"),
        ({"variables": ["uo", "w"]}, "is not a variable of the data set. Known: uo, vo"),
        ({"spacing": [0.0, 1.0, 1.0]}, "is not positive"),
        ({"spacing": [1e-3, 1e-3, 1e-3]}, "more than half the memory. Give a smaller region"),
        ({"checksum": 7}, "checksum = 7 is not that of what is read"),
    ],
)
def test_refused(more, words):
    with pytest.raises(lw.SceneError, match=words):
        read(data.cmems(EAST, NORTH), **more)


def test_faults_of_the_data():
    with pytest.raises(lw.SceneError, match=r"have no CF names that are known. Write the attribute standard_name"):
        read(data.cmems(EAST, NORTH, standard=False).rename(uo="a"))
    with pytest.raises(lw.SceneError, match="upside down"):
        read(data.cmems(EAST, NORTH, depth=-data.DEPTH[::-1]))
    with pytest.raises(lw.SceneError, match="is not within the data"):
        lw.terms.CurrentField.from_dataset(data.cmems(EAST, NORTH), (20.0, 40.0), region=REGION)
    with pytest.raises(lw.SceneError, match="a latitude beyond 89"):
        lw.terms.CurrentField.from_dataset(data.cmems(EAST, NORTH), (141.5, 20.0), region=REGION)


def test_a_file_is_read_again_with_the_same_bits(tmp_path):
    path = tmp_path / "a.nc"
    data.cmems(EAST, NORTH).to_netcdf(path)
    field = read(path, region=None, speed=1.0, duration=5000.0, start="2024-05-01T00:30")
    table = field.to_dict()
    assert "velocities" not in table
    assert table["file"] == str(path)
    again = lw.Scene.named("sphere", terms=[table]).terms[0]
    np.testing.assert_array_equal(again.velocities, field.velocities)
    assert again.to_dict() == table
    # No list is made of numbers that the file has: one would take many times the memory of the field.
    fine = read(path, region=None, speed=1.0, duration=5000.0, spacing=[500.0, 500.0, 5.0])
    tracemalloc.start()
    fine.to_dict()
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < fine.velocities.nbytes / 4
    # Other numbers are those of no file.
    assert "velocities" in field.with_fields({"spacing": [9.0, 9.0, 9.0]}).to_dict()
    data.cmems(NORTH, EAST).to_netcdf(path)
    with pytest.raises(lw.SceneError, match=r"terms\[0\].checksum = .*is not that of what is read"):
        lw.Scene.named("sphere", terms=[table])


def test_scene_files(tmp_path):
    (tmp_path / "water").mkdir()
    data.cmems(EAST, NORTH).to_netcdf(tmp_path / "water" / "a.nc")
    text = """
[vehicle]
name = "sphere"
[start]
position = [1000.0, 0.0, 5.0]
[run]
duration = 3600.0
[[terms]]
type = "current_field"
file = "water/a.nc"
origin = [41.5, -70.5]
start = 2024-05-01T00:00:00Z
speed = 1.0
"""
    (tmp_path / "scene.toml").write_text(text)
    scene = lw.Scene.load(tmp_path / "scene.toml")
    field = scene.terms[0]
    np.testing.assert_allclose(field.data.request.region[0], [-2600.0, 4600.0])
    assert [event.key for event in scene.events] == ["outside"]
    assert field.velocities.shape[1] == 2
    again = lw.Scene.from_dict(scene.to_dict())
    np.testing.assert_array_equal(again.terms[0].velocities, field.velocities)
    for wrong, words in {
        'file = "water/b.nc"': "terms[0].file = .*b.nc': No such file or directory. Give the path of a NetCDF file",
        'file = "water/a.nc"\nvelocities = [0.0]': "terms[0].velocities = .* is an unknown key",
        'file = "scene.toml"': "terms[0].file = .* is damaged, or no NetCDF file",
    }.items():
        (tmp_path / "scene.toml").write_text(text.replace('file = "water/a.nc"', wrong))
        with pytest.raises(lw.SceneError, match=words.replace("[", r"\[")):
            lw.Scene.load(tmp_path / "scene.toml")


def test_of_a_gigabyte_only_what_a_run_can_reach_is_read(tmp_path):
    """Two variables of 1.1 GB each, of which few fields were ever written: the others take no disk space."""
    netcdf = pytest.importorskip("netCDF4")
    sizes = {"time": 60, "depth": 20, "latitude": 500, "longitude": 450}
    with netcdf.Dataset(tmp_path / "large.nc", "w") as file:
        for name, size in sizes.items():
            file.createDimension(name, size)
        axes = {"time": np.arange(60.0), "depth": 5.0 * np.arange(20.0), "latitude": 35.0 + 0.02 * np.arange(500.0),
                "longitude": -75.0 + 0.02 * np.arange(450.0)}  # fmt: skip
        units = {
            "time": "hours since 2024-05-01",
            "depth": "m",
            "latitude": "degrees_north",
            "longitude": "degrees_east",
        }
        for name, values in axes.items():
            file.createVariable(name, "f8", (name,))[:] = values
            file[name].units = units[name]
        file["depth"].positive = "down"
        for name, word in (("uo", "eastward_sea_water_velocity"), ("vo", "northward_sea_water_velocity")):
            variable = file.createVariable(
                name, "f4", tuple(sizes), zlib=True, fill_value=9e9, chunksizes=(1, 1, 100, 90)
            )
            variable.setncatts({"units": "m s-1", "standard_name": word})
            variable[20:23, :5, 300:400] = 0.25
    assert (tmp_path / "large.nc").stat().st_size < 5_000_000
    read(tmp_path / "large.nc", region=None, start="2024-05-01T20:00", speed=1.0, duration=3600.0)
    tracemalloc.start()
    field = read(tmp_path / "large.nc", region=[[-9e3, 9e3], [-9e3, 9e3], [0.0, 18.0]], start="2024-05-01T20:00",
                 duration=7000.0)  # fmt: skip
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert field.velocities.shape[1] == 3
    assert (field.data.missing, field.data.more) == (0, True)
    assert field.data.values < 2 * 3 * 5 * 12 * 16
    assert peak < 4_000_000


@pytest.mark.parametrize(("library", "extra"), [("xarray", "data sets of the ocean need xarray"), ("pyproj", "pyproj")])
def test_a_library_that_is_missing(monkeypatch, library, extra):
    ds = data.cmems(EAST, NORTH)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=extra):
        read(ds)


def at_nodes(field, north, east, depth, time):
    """Velocities (n, 3) of a field at places and times, by another interpolation."""
    from scipy.interpolate import RegularGridInterpolator

    axes = [
        o + d * np.arange(n) for o, d, n in zip(field.origin, field.spacing, field.velocities.shape[2:5], strict=True)
    ]
    axes.insert(0, field.times[0] + field.times[1] * np.arange(field.velocities.shape[1]))
    keep = [i for i, axis in enumerate(axes) if len(axis) > 1]
    table = field.velocities[0][tuple(slice(None) if i in keep else 0 for i in range(4))]
    places = np.stack(np.broadcast_arrays(time, north, east, depth), axis=-1).reshape(-1, 4)[:, keep]
    return RegularGridInterpolator([axes[i] for i in keep], table, bounds_error=False)(places)


def own_places(cell=0.05):
    """u and v on one pair of dimensions, each at its own places, by the attribute coordinates."""
    lat, lon = np.meshgrid(41.0 + 0.1 * np.arange(11), -71.0 + 0.1 * np.arange(11), indexing="ij")
    places = {"u": (lat, lon + cell), "v": (lat + cell, lon)}
    variables, coordinates = {}, {}
    for (letter, (a, o)), along in zip(places.items(), ("x", "y"), strict=True):
        known = {
            "units": "m/s",
            "standard_name": f"sea_water_{along}_velocity",
            "coordinates": f"lat_{letter} lon_{letter}",
        }
        speed = 0.2 + (o + 70.5) + 0.5 * (a - 41.5) if letter == "u" else -0.1 + (a - 41.5) + 0.7 * (o + 70.5)
        variables[f"vel_{letter}"] = (("y", "x"), speed, known)
        for word, values, unit in (("lat", a, "north"), ("lon", o, "east")):
            coordinates[f"{word}_{letter}"] = (("y", "x"), values, {"units": f"degrees_{unit}"})
    return xr.Dataset(variables, coordinates)


@pytest.mark.parametrize("stored", [False, True])
def test_each_variable_stands_at_the_places_that_it_names(stored, tmp_path):
    ds = own_places()
    if stored:
        for variable in ds.data_vars.values():
            variable.encoding["coordinates"] = variable.attrs.pop("coordinates")
        ds.to_netcdf(tmp_path / "a.nc")
    wanted = {"region": [[-2e4, 2e4]] * 2 + [[0, 0]], "spacing": [5e3, 5e3, 1.0]}
    field = lw.terms.CurrentField.from_dataset(tmp_path / "a.nc" if stored else ds, ORIGIN, **wanted)
    # The turn of the grid's axes from node to node is 1e-3.
    np.testing.assert_allclose(field.velocities[0, 0, 4, 4, 0], [-0.1, 0.2, 0.0], atol=1e-3)


def test_places_that_nobody_names_are_refused():
    ds = own_places()
    del ds.vel_v.attrs["coordinates"]
    with pytest.raises(lw.SceneError, match=r"vel_v.coordinates = .* are all its latitude. Name one"):
        lw.terms.CurrentField.from_dataset(ds, ORIGIN)


TIDE = lambda lat, lon, z, t: 0.5 * np.cos(2.0 * np.pi * t / 3600.0 / 12.42) + 0.0 * (lat + lon + z)  # noqa: E731


@pytest.mark.parametrize("hours", [np.r_[0:5, 245:250], np.r_[0:3, 4:6, 9:12], np.array([0.0, 0.5, 2.0, 4.0])])
def test_a_gap_in_time_changes_no_field_and_is_told(hours):
    field = read(data.cmems(data.still, TIDE, hours=hours.astype(float)))
    for hour in hours:
        np.testing.assert_allclose(
            at_nodes(field, 0.0, 0.0, 0.0, 3600.0 * hour)[0], [TIDE(0, 0, 0, 3600.0 * hour), 0, 0], atol=1e-6
        )
    assert any("the data have no field from" in text for text in field.remarks) == (np.ptp(hours) > 5)
    # A run that ends before it knows nothing of it.
    assert read(data.cmems(data.still, TIDE, hours=hours.astype(float)), duration=1800.0).remarks == ()


def test_a_gap_between_times_that_have_no_common_interval_is_refused():
    with pytest.raises(lw.SceneError, match=r"is a gap among times .* by ds.interp"):
        read(data.cmems(data.still, TIDE, hours=[0.0, 1.0, 2.1234567, 3.0, 100.7654321]))


@pytest.mark.parametrize("angle", [0.3, 0.7])
def test_a_turned_grid_loses_little_and_the_change_is_the_largest(angle):
    wave = lambda north, east, z, t: (  # noqa: E731
        0.2 * np.sin(north / 9e3) * np.cos(east / 8e3) + 0.0 * (z + t),
        0.2 * np.cos(north / 1e4 + 1.0) + 0.0 * (east + z + t),
    )
    ds = turned_data(wave, along=True, angle=angle).isel(ocean_time=slice(0, 2), depth=[0])
    for more, most in (({}, 0.02), ({"spacing": [9e3, 9e3, 1.0]}, 1.0)):
        field = read(ds, region=[[-3e4, 3e4]] * 2 + [[0.0, 0.0]], **more)
        lat, lon = ds.lat_rho.values, ds.lon_rho.values
        north, east = PLANE.local(lat, lon)
        own = np.stack([*wave(north, east, 0.0, 0.0), 0.0 * north], axis=-1).reshape(-1, 3)
        change = np.linalg.norm(at_nodes(field, north, east, 0.0, 0.0) - own, axis=-1)
        assert np.nanmax(change) <= field.data.error * (1.0 + 1e-9)
        assert np.nanmax(change) >= 0.99 * field.data.error
        assert field.data.error <= most * field.data.speed
        assert any("Give a finer spacing" in text for text in field.remarks) == (
            field.data.error > 0.05 * field.data.speed
        )
    assert field.remarks


def far_sides(order):
    """Data on both sides of the date line, in their own order or sorted."""
    lon = np.r_[170.0:180.0:0.25, -180.0:-170.0:0.25]
    return data.cmems(lambda lat, lon, z, t: 0.3 + 0.0 * (lat + z + t + lon), data.still, lon=np.sort(lon) if order else lon,
                      lat=np.linspace(-1.0, 1.0, 9), hours=[0])  # fmt: skip


@pytest.mark.parametrize("order", [True, False])
def test_data_about_the_date_line_end_where_they_end(order):
    region = [[-5e3, 5e3]] * 2 + [[0, 0]]
    with pytest.raises(lw.SceneError, match="is not within the data"):
        lw.terms.CurrentField.from_dataset(far_sides(order), (0.0, 0.0), region=region)
    for longitude in (179.9, 180.0, -180.0, -179.9, -175.0):
        field = lw.terms.CurrentField.from_dataset(far_sides(order), (0.0, longitude), region=region)
        np.testing.assert_allclose(np.linalg.norm(field.velocities, axis=-1), 0.3)


@pytest.mark.parametrize("turns", [-360.0, 0.0, 360.0])
def test_longitudes_of_any_turn(turns):
    same = read(data.cmems(EAST, NORTH))
    field = read(data.cmems(EAST, NORTH, lon=data.LONGITUDE + turns))
    np.testing.assert_allclose(field.velocities, same.velocities, atol=1e-9)
