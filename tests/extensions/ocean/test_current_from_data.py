# SPDX-License-Identifier: Apache-2.0
"""Vehicles in currents of data sets: tracks against an independent integrator, leaving the field, and everything at once."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

import lgvi_warp as lw
from tests.extensions.ocean import data
from tests.support.pages import snippets
from tests.support.tools import GRAVITY

pytestmark = pytest.mark.ci

pyproj = pytest.importorskip("pyproj")
netcdf = pytest.importorskip("netCDF4")
ORIGIN = (41.5, -70.5)
SPACING, DEPTHS, HOURS = 500.0, np.linspace(0.0, 50.0, 6), np.arange(3)
# Neutral, and as heavy as the water that it displaces: it goes with the water if it begins so.
DRIFTER = lw.Vehicle(10.0, inertia=(1.0, 1.2, 1.3), added_mass=(4.0, 5.0, 6.0), buoyancy=10.0 * GRAVITY,
                     center_of_buoyancy=(0.0, 0.0, 0.0))  # fmt: skip


def eddies(north, east, z, t):
    """Velocities along y, along x and upward: eddies that go by and fade with depth."""
    k, fade = 2.0 * np.pi / 6000.0, np.exp(-z / 40.0)
    return (
        0.5 * fade * np.sin(k * east + 2e-4 * t) + 0.1,
        0.5 * fade * np.cos(k * north - 1e-4 * t) * np.sin(0.5 * k * east),
        0.002 * np.sin(k * (north + east)) + 0.0 * (z + t),
    )


def roms_file(path):
    """A file as ROMS writes it, of which rows go to the north of the plane at the origin and columns to the east."""
    import xarray as xr

    lat, lon = data.turned(*ORIGIN, 0.0, shape=(31, 33), spacing=SPACING)
    rows, columns = (SPACING * (np.arange(n) - 0.5 * (n - 1)) for n in (31, 33))
    t, z, north, east = np.meshgrid(3600.0 * HOURS, DEPTHS, rows, columns, indexing="ij")
    dims = ("ocean_time", "depth", "eta_rho", "xi_rho")
    names = {"v": "sea_water_y_velocity", "u": "sea_water_x_velocity", "w": "upward_sea_water_velocity"}
    values = zip(names.items(), eddies(north, east, z, t), strict=True)
    xr.Dataset(
        {name: (dims, x, {"units": "meter second-1", "standard_name": word}) for (name, word), x in values},
        {"ocean_time": data.times(HOURS), "depth": ("depth", DEPTHS, {"units": "meter", "positive": "down"}),
         "lat_rho": (dims[2:], lat, {"units": "degree_north"}), "lon_rho": (dims[2:], lon, {"units": "degree_east"})},
    ).to_netcdf(path)  # fmt: skip


def water_of(path):
    """The current by another reader, with places by geodesics from the origin: velocities (3, n) at places (3, n)."""
    with netcdf.Dataset(path) as file:
        lat, lon, depth = (np.asarray(file[name][:]) for name in ("lat_rho", "lon_rho", "depth"))
        seconds = np.asarray(file["ocean_time"][:], dtype=float)
        seconds *= {"hours": 3600.0, "seconds": 1.0}[file["ocean_time"].units.split()[0]]
        u, v, w = (np.asarray(file[name][:]) for name in ("u", "v", "w"))
    origin = np.broadcast_to(ORIGIN[0], lat.shape), np.broadcast_to(ORIGIN[1], lat.shape)
    bearing, _, distance = pyproj.Geod(ellps="WGS84").inv(origin[1], origin[0], lon, lat)
    rows = (distance * np.cos(np.deg2rad(bearing)))[:, 0]
    columns = (distance * np.sin(np.deg2rad(bearing)))[0]
    known = RegularGridInterpolator((seconds, depth, rows, columns), np.stack([v, u, -w], axis=-1))
    return lambda t, b: known(np.stack([np.full(b.shape[1], t), b[2], b[0], b[1]], axis=-1)).T


@pytest.mark.parametrize("members", [8, pytest.param(1000, marks=pytest.mark.slow)])
def test_tracks_are_those_of_another_integrator_on_the_same_file(tmp_path, members):
    roms_file(tmp_path / "roms.nc")
    water, end = water_of(tmp_path / "roms.nc"), 7200.0
    rng = np.random.default_rng(3)
    start = np.stack(
        [rng.uniform(-2e3, 2e3, members), rng.uniform(-2e3, 2e3, members), rng.uniform(16.0, 34.0, members)]
    )
    # Where slopes jump, its steps of 4 s are off by a twenty-fifth of what ours of 20 s are.
    path = solve_ivp(lambda t, b: water(t, b.reshape(3, -1)).ravel(), (0.0, end), start.ravel(), method="DOP853",
                     rtol=1e-6, atol=1e-3, max_step=4.0)  # fmt: skip
    truth = path.y[:, -1].reshape(3, -1).T
    # Its nodes are those of the data: nothing is lost on the way.
    edge = 15 * SPACING
    region, spacing = [[-edge, edge], [-edge, edge], [0.0, 50.0]], [SPACING, SPACING, 10.0]
    field = lw.terms.CurrentField.from_dataset(tmp_path / "roms.nc", ORIGIN, region=region, spacing=spacing)
    assert field.data.error < 1e-9
    # Without drag, velocities that differ from the water's grow where the current draws lines out: by e^20 in this time.
    drag = lw.terms.Drag(linear=(0.3, 0.3, 0.3, 0.01, 0.01, 0.01))
    scene = lw.Scene(DRIFTER, lw.Environment(GRAVITY), terms=[field, drag])
    still, upright = np.zeros((members, 3)), np.tile(np.eye(3), (members, 1, 1))
    fleet = lw.Ensemble.from_states(scene, start.T, upright, water(0.0, start).T, still)
    first, second = (lw.solve(fleet, "rk4", h=h, t1=end, threads=1) for h in (20.0, 10.0))
    assert first.status.counts() == {"ok": members}
    own = np.linalg.norm(first.position[-1] - second.position[-1], axis=1)
    off = np.linalg.norm(first.position[-1] - truth, axis=1)
    assert np.linalg.norm(truth - start.T, axis=1).mean() > 5.0 * SPACING / 2.0
    # Slopes jump from cell to cell: order 2, so that half the step leaves a quarter of the error, and another one at most.
    assert off.max() < 2.0 * own.max()
    assert np.median(off) < 2.0 * np.median(own)


def small(outside, name="", times=None):
    velocities = np.broadcast_to(np.array([0.0, 0.5, 0.0]), (3, 3, 2, 3))
    if times is not None:
        velocities = np.broadcast_to(velocities, (3, 3, 3, 2, 3))
    return lw.terms.CurrentField(
        velocities=velocities, spacing=[50.0, 50.0, 20.0], outside=outside, name=name, times=times
    )


def drifting(*terms, start=(50.0, 90.0, 5.0)):
    start = {"position": start, "velocity": [0.0, 0.5, 0.0]}
    return lw.Scene(DRIFTER, lw.Environment(GRAVITY), terms=list(terms), start=lw.Start(**start))


def test_a_member_that_leaves_stops_where_it_does():
    result = lw.solve(drifting(small("stop")), "rk4", h=0.3, t1=60.0)
    assert result.status.counts() == {"outside": 1}
    np.testing.assert_allclose(result.end_time, 20.0, rtol=1e-9)
    np.testing.assert_allclose(result.position[-1, 0], [50.0, 100.0, 5.0], rtol=1e-9)
    assert lw.Status.OUTSIDE.text == "stopped by an event: left the data of a field"
    # Above the first level nothing stops; below the last one it does.
    assert lw.solve(drifting(small("stop"), start=(50.0, 50.0, -5.0)), "rk4", h=0.3, t1=6.0).status.counts() == {
        "ok": 1
    }
    assert lw.solve(drifting(small("stop"), start=(50.0, 50.0, 21.0)), "rk4", h=0.3, t1=6.0).status.counts() == {
        "outside": 1
    }
    held = lw.solve(drifting(small("hold")), "rk4", h=0.3, t1=60.0)
    np.testing.assert_allclose(held.position[-1, 0], [50.0, 120.0, 5.0], rtol=1e-9)


@pytest.mark.slow
def test_two_fields_have_two_events_which_go_with_them():
    scene = drifting(small("stop"), small("stop", "second"), small("hold", "third"))
    assert [event.key for event in scene.events] == ["outside", "second_outside"]
    again = lw.Scene.from_dict(scene.to_dict())
    assert [event.key for event in again.events] == ["outside", "second_outside"]
    content = scene.to_dict()
    content["terms"] = content["terms"][1:]
    assert [event.key for event in lw.Scene.from_dict(content).events] == ["second_outside"]
    moved = scene.with_numbers({"current_field.origin": [0.0, -10.0, 0.0]})
    result = lw.solve(moved, "rk4", h=0.3, t1=60.0)
    np.testing.assert_allclose(result.position[-1, 0, 1], 90.0, rtol=1e-9)


def test_a_run_that_lasts_longer_than_the_field_is_refused():
    with pytest.raises(lw.SceneError, match=r"current_field.times = .*ends the field at 20 s.* outside = 'hold'"):
        lw.solve(drifting(small("stop", times=[0.0, 10.0])), "rk4", h=0.5, t1=21.0)
    with pytest.raises(lw.SceneError, match="begins the field at 1 s"):
        lw.solve(drifting(small("stop", times=[1.0, 10.0])), "rk4", h=0.5, t1=21.0)
    assert lw.solve(drifting(small("hold", times=[0.0, 10.0])), "rk4", h=0.5, t1=21.0).status.counts() == {"ok": 1}
    ds = data.cmems(lambda lat, lon, z, t: 0.1 + 0.0 * t, data.still)
    for outside in ("hold", "stop"):
        read = lw.terms.CurrentField.from_dataset(ds, ORIGIN, duration=100.0, outside=outside)
        with pytest.raises(lw.SceneError, match=r"current_field.duration = 3600.*Give duration = 3601 to the field"):
            lw.solve(drifting(read), "rk4", h=1.0, t1=3601.0)


@pytest.mark.slow
def test_members_of_a_forecast_under_waves_a_profile_and_noise(tmp_path):
    """One at a time, members have the bits that they have together, and a run that goes on those of one that was not cut."""
    import xarray as xr

    each = [
        data.cmems(lambda *x, k=k: 0.1 + 0.1 * k + 0.0 * sum(x), lambda *x: 2e-3 * x[2] + 0.0 * sum(x))
        for k in range(3)
    ]
    ds = xr.concat(each, "realization")
    ds.uo[:, :, :, 0] = np.nan
    ds.to_netcdf(tmp_path / "a.nc")
    field = lw.terms.CurrentField.from_dataset(tmp_path / "a.nc", ORIGIN, duration=100.0)
    assert field.data.missing > 0
    others = [
        lw.terms.Waves(amplitudes=[0.3], periods=[6.0], headings_deg=[20.0], phases=[0.3]),
        lw.terms.CurrentProfile(depths=[0.0, 30.0], velocities=[[0.1, 0.0, 0.0], [0.0, 0.1, 0.0]]),
        lw.terms.GaussMarkovCurrent(standard_deviation=[0.1, 0.1, 0.0], time_constant=30.0),
    ]
    scene = lw.Scene.named(
        "remus_100", terms=[field, *others], start={"position": [0.0, 0.0, 12.0], "velocity": [1.5, 0.0, 0.0]}
    )
    vary = {"current_field.scenario": lw.distributions.Choice([0.0, 1.0, 2.0])}
    run = dict(method="psi_x", h=0.05, t1=4.0, threads=1)
    fleet = lw.Ensemble(scene, 5, 1, vary)
    result = lw.solve(fleet, **run)
    assert result.status.counts() == {"ok": 5}
    assert any("on land or below the sea floor, are missing" in text for text in result.messages)
    assert len(np.unique(result.parameters["current_field.scenario"])) > 1
    one = lw.solve(fleet.subset([3]), **run)
    np.testing.assert_array_equal(one.position[-1, 0], result.position[-1, 3])
    half = lw.solve(fleet, **{**run, "t1": 2.0})
    on = lw.solve(fleet, **run, start=half.final)
    np.testing.assert_array_equal(on.position[-1], result.position[-1])


@pytest.mark.parametrize("kept", ["file", "numbers"])
def test_a_stored_run_goes_on_with_the_file_or_the_numbers(tmp_path, kept):
    data.cmems(lambda lat, lon, z, t: 0.3 + 0.001 * z + 0.0 * t, data.still).to_netcdf(tmp_path / "a.nc")
    import xarray as xr

    with xr.open_dataset(tmp_path / "a.nc") as ds:
        source = tmp_path / "a.nc" if kept == "file" else ds.load()
    field = lw.terms.CurrentField.from_dataset(source, ORIGIN, duration=100.0)
    fleet = lw.Ensemble(drifting(field), 600, 1, {"start.position": lw.distributions.Normal(std=1.0)})
    run = dict(method="rk4", h=0.5, t1=2.0, threads=1)
    store = tmp_path / "run.zarr"
    lw.solve(fleet, **run, store=store, blocks=range(0, 1))
    again = lw.resume(store)
    np.testing.assert_array_equal(again.position[-1], lw.solve(fleet, **run).position[-1])
    table = again.provenance["scene"]["terms"][0]
    assert ("file" in table, "velocities" in table) == ((True, False) if kept == "file" else (False, True))
    if kept == "file":
        lw.solve(fleet, **run, store=tmp_path / "c.zarr", blocks=range(0, 1))
        data.cmems(data.still, data.still).to_netcdf(tmp_path / "a.nc")
        with pytest.raises(lw.SceneError, match=r"checksum = .*is not that of what is read"):
            lw.resume(tmp_path / "c.zarr")


@pytest.mark.slow
@pytest.mark.parametrize("page", ["docs/guide/terms/current_field.md", "docs/guide/ocean_data.md"])
def test_pages(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ((_, code, expected),) = snippets(page, "python")
    exec(code, {"__name__": "__main__"})
    assert capsys.readouterr().out == expected
    if "ocean_data" in page:
        ((_, scene, _),) = snippets(page, "toml")
        (tmp_path / "scene.toml").write_text(scene)
        read = lw.Scene.load(tmp_path / "scene.toml")
        field = next(term for term in read.terms if term.type == "current_field")
        assert field.velocities.shape == (1, 4, 9, 11, 21, 3)
        # What it will take, with the field and without.
        fleet = lw.Ensemble(read, 8)
        assert lw.predict(fleet, h=0.05, t1=1.0, threads=1).memory > field.velocities.nbytes
