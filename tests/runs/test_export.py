# SPDX-License-Identifier: Apache-2.0
"""Runs as files of other programs: what is read back is what the run holds, where and when on the Earth it was."""

import contextlib
import dataclasses
import json
import resource

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common import extensions
from lgvi_warp.scene.start import Environment
from lgvi_warp.store import export
from lgvi_warp.store.exporting.tracks import tracks_of
from tests.runs.test_hostile_folders import mutated
from tests.support.exported import DATE, DEGREES, ORIGIN, OUTCOMES, SETTINGS, by_geodesic, fleet, scene
from tests.support.verbs import main

pyproj, pandas, xarray = (pytest.importorskip(name) for name in ("pyproj", "pandas", "xarray"))
pytestmark = [
    pytest.mark.kernel,
    pytest.mark.filterwarnings("ignore:numpy.ndarray size changed"),
]
FILES = ("csv", "parquet", "nc", *(ending[1:] for ending in extensions.words("exporters")))


@pytest.fixture(scope="module")
def result():
    run = lw.solve(fleet(), **SETTINGS)
    assert [lw.Status(code).name.lower() for code in run.status] == OUTCOMES
    return run


@pytest.fixture(scope="module")
def single():
    return lw.solve(fleet(), dtype="float32", **SETTINGS)


def columns(frame, name, members, samples):
    """A field of a table as the run has it, (k, n, ...)."""
    shape = samples[name].shape
    names = [f"{name}_{''.join(map(str, at))}" for at in np.ndindex(*shape[2:])]
    values = frame[names].to_numpy().reshape(len(members), shape[0], *shape[2:])
    return np.swapaxes(values, 0, 1)


@pytest.mark.ci
@pytest.mark.parametrize("kind", ["csv", "parquet"])
@pytest.mark.parametrize("precision", ["result", "single"])
def test_a_table_holds_the_numbers_of_the_run(kind, precision, request, tmp_path):
    run = request.getfixturevalue(precision)
    path = lw.export(run, tmp_path / f"run.{kind}")
    frame = pandas.read_csv(path) if kind == "csv" else pandas.read_parquet(path)
    assert len(frame) == 5 * len(run.time)
    for name, values in run.samples.items():
        # A float32 number is told by digits that name it among float32 numbers.
        read = columns(frame, name, range(5), run.samples).astype(values.dtype)
        np.testing.assert_array_equal(read, values)
    first = frame[frame.time == 0.0]
    np.testing.assert_array_equal(first.realization, np.arange(5))
    np.testing.assert_array_equal(first.status, run.status)
    np.testing.assert_array_equal(first.end_time, run.end_time)
    np.testing.assert_array_equal(first.failure_time, run.failure_time)
    np.testing.assert_array_equal(first["vehicle.buoyancy"], run.parameters["vehicle.buoyancy"])
    np.testing.assert_allclose(
        first[["roll_deg", "pitch_deg", "yaw_deg"]], np.rad2deg(run.euler[0]), rtol=0, atol=1e-12
    )
    moments = pandas.to_datetime(frame[frame.realization == 1].utc, utc=True)
    np.testing.assert_array_equal(moments - pandas.Timestamp(DATE), pandas.to_timedelta(run.time, unit="s"))


def test_places_and_headings_are_those_of_the_geodesic(result, tmp_path):
    frame = pandas.read_parquet(lw.export(result, tmp_path / "run.parquet"))
    # One starts nowhere, and one goes, by its divergence, further than the Earth is large.
    away = np.hypot(frame.position_0, frame.position_1)
    lost = ~(away < 2e7)
    assert lost.sum() >= 7
    assert frame[lost][["latitude", "longitude", "heading_deg"]].isna().all(axis=None)
    frame = frame[~lost]
    position = frame[["position_0", "position_1", "position_2"]].to_numpy()
    latitude, longitude = by_geodesic(position)
    np.testing.assert_allclose(frame.latitude, latitude, rtol=0, atol=DEGREES)
    np.testing.assert_allclose(frame.longitude, longitude, rtol=0, atol=DEGREES)
    # The bow, a metre ahead on the plane, seen from the body: the geodesic from place to place.
    ahead = position + np.stack([frame.attitude_00, frame.attitude_10, 0.0 * frame.attitude_20], axis=1)
    there = by_geodesic(ahead)
    bearing, _, _ = pyproj.Geod(ellps="WGS84").inv(longitude, latitude, there[1], there[0])
    # Both ends are rounded to nanometres, over the horizontal part of a metre.
    level = np.hypot(frame.attitude_00, frame.attitude_10)
    error = (frame.heading_deg - bearing + 180.0) % 360.0 - 180.0
    assert np.all(np.abs(error)[level > 0.1] < np.rad2deg(1e-8 / 0.1))
    assert np.count_nonzero(level > 0.1) > 20


def test_trajectories_hold_the_numbers_of_the_run(result, tmp_path):
    path = lw.export(result, tmp_path / "run.nc")
    with xarray.open_dataset(path) as run:
        assert (run.attrs["featureType"], run.attrs["Conventions"]) == ("trajectory", "CF-1.8")
        np.testing.assert_array_equal(run.trajectory, np.arange(5))
        for axis, name in enumerate(("north", "east", "depth")):
            np.testing.assert_array_equal(run[name].T, result.position[..., axis])
        for axis, name in enumerate("xyz"):
            np.testing.assert_array_equal(run[f"velocity_{name}"].T, result.velocity[..., axis])
            np.testing.assert_array_equal(run[f"angular_velocity_{name}"].T, result.angular_velocity[..., axis])
        for i, letter in enumerate("wxyz"):
            np.testing.assert_array_equal(run[f"quaternion_{letter}"].T, result.quaternion_wxyz[..., i])
        for i, name in enumerate(("roll", "pitch", "yaw")):
            np.testing.assert_allclose(run[name].T, np.rad2deg(result.euler[..., i]), rtol=0, atol=1e-12)
        np.testing.assert_array_equal(run.speed.T, result.speed)
        np.testing.assert_array_equal(run.status, result.status)
        np.testing.assert_array_equal(run.end_time.dt if run.end_time.dtype.kind == "M" else seconds(run.end_time),
                                      result.end_time)  # fmt: skip
        np.testing.assert_array_equal(run.vehicle_buoyancy, result.parameters["vehicle.buoyancy"])
        moments = np.datetime64("2026-06-01T06:00:00", "ns") + (result.time * 1e9).astype("timedelta64[ns]")
        np.testing.assert_array_equal(run.time, np.tile(moments, (5, 1)))
        names = {name: run[name].attrs.get("standard_name") for name in ("lat", "depth", "pitch", "speed", "heading")}
        assert names == {"lat": "latitude", "depth": "depth", "pitch": "platform_pitch_fore_up",
                         "speed": "platform_speed_wrt_ground", "heading": "platform_orientation"}  # fmt: skip
        units = [run[name].attrs["units"] for name in ("velocity_x", "vehicle_buoyancy", "roll", "lon")]
        assert units == ["m s-1", "N", "degree", "degrees_east"]
        assert run.status.attrs["flag_meanings"].split()[1:2] == ["step_too_large"]


def seconds(values):
    """Durations that xarray made of seconds, as seconds."""
    return values / np.timedelta64(1, "s") if values.dtype.kind == "m" else values


def test_a_grid_mapping_leads_from_metres_to_the_same_places(result, tmp_path):
    with xarray.open_dataset(lw.export(result, tmp_path / "run.nc")) as run:
        crs = pyproj.CRS.from_cf(run.plane.attrs)
        back = pyproj.Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
        longitude, latitude = back.transform(run.east.values[0], run.north.values[0])
        np.testing.assert_allclose(run.lat[0], latitude, rtol=0, atol=DEGREES)
        np.testing.assert_allclose(run.lon[0], longitude, rtol=0, atol=DEGREES)


def test_single_precision_stays(single, tmp_path):
    with xarray.open_dataset(lw.export(single, tmp_path / "run.nc")) as run:
        assert run.velocity_x.dtype == np.float32
        np.testing.assert_array_equal(run.north.T, single.position[..., 0])
        assert (run.lat.dtype, run.lon.dtype) == (np.float64, np.float64)


def faults_of(path):
    """Findings of the CF checker on a file, of high and of medium weight."""
    from compliance_checker.runner import CheckSuite

    suite = CheckSuite()
    suite.load_all_available_checkers()
    data = suite.load_dataset(str(path))
    try:
        groups, errors = suite.run_all(data, ["cf:1.8"])["cf:1.8"]
    finally:
        getattr(data, "close", lambda: None)()
    assert not errors
    return [(group.name, text) for group in groups if group.weight >= 2 and not passed(group) for text in group.msgs]


def passed(group):
    """Whether all of a group of checks have passed."""
    value = group.value
    return value[0] == value[1] if isinstance(value, tuple) else bool(value)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::UserWarning", "ignore::FutureWarning")
def test_the_cf_checker_finds_no_fault(result, single, tmp_path):
    pytest.importorskip("compliance_checker")
    bare = lw.solve(fleet(scene()), **SETTINGS)
    loop = dataclasses.replace(result, samples={**result.samples, "demand": np.zeros((7, 5, 6)),
                                                "measured_depth": np.zeros((7, 5))})  # fmt: skip
    for i, run in enumerate((result, single, bare, loop)):
        assert faults_of(lw.export(run, tmp_path / f"{i}.nc")) == []
    assert faults_of(lw.export(result, tmp_path / "one.nc", members=[2])) == []
    # The checker sees what is wrong.
    import netCDF4

    with netCDF4.Dataset(tmp_path / "0.nc", "a") as file:
        file["pitch"].standard_name = "pitch_of_the_platform"
        file["lat"].units = "m"
    assert len(faults_of(tmp_path / "0.nc")) >= 2


@pytest.mark.parametrize("origin", [[89.9999, 20.0], [-89.99, 0.0], [0.0, 359.5]])
def test_places_at_high_latitudes_and_longitudes_beyond_180(origin, result, tmp_path):
    frame = pandas.read_parquet(lw.export(result, tmp_path / "run.parquet", members=[0, 1, 4], origin=origin))
    position = frame[["position_0", "position_1", "position_2"]].to_numpy()
    latitude, longitude = by_geodesic(position, origin)
    away = pyproj.Geod(ellps="WGS84").inv(longitude, latitude, frame.longitude, frame.latitude)[2]
    # Nanometres, whatever a degree of longitude is there.
    assert np.max(away) < 2e-8
    assert frame.longitude.between(-180.0, 180.0).all()


@pytest.fixture(scope="module")
def stored(result, tmp_path_factory):
    """The same run in a store, in a file and in memory."""
    folder = tmp_path_factory.mktemp("runs")
    lw.solve(fleet(), **SETTINGS, store=folder / "run.zarr")
    return {"store": folder / "run.zarr", "npz": result.save(folder / "result.npz"), "memory": result,
            "opened": lw.open_run(folder / "run.zarr")}  # fmt: skip


def content_of(path):
    """Content of a file, whatever wrote it: without the provenance, which tells where the run was kept."""
    if path.suffix == ".nc":
        with xarray.open_dataset(path) as run:
            return run.load().drop_attrs()
    return pandas.read_parquet(path).to_csv() if path.suffix == ".parquet" else path.read_bytes()


@pytest.mark.ci
@pytest.mark.parametrize("kind", FILES)
def test_every_kind_of_run_gives_the_same_file(kind, stored, tmp_path):
    if kind == "mcap":
        pytest.importorskip("mcap_ros2")
    files = {name: lw.export(run, tmp_path / f"{name}.{kind}", members=[1, 4]) for name, run in stored.items()}
    wanted = content_of(files.pop("memory"))
    for name, path in files.items():
        same = content_of(path).identical(wanted) if kind == "nc" else content_of(path) == wanted
        assert same, name


@pytest.mark.parametrize("kind", FILES)
def test_many_pieces_are_the_same_file(kind, result, tmp_path):
    """Data that do not fit into one piece are written member by member, or time by time."""
    if kind == "mcap":
        pytest.importorskip("mcap_ros2")
    whole = tracks_of(result, None, Environment(origin=ORIGIN, start=DATE))
    write = export.WRITERS.get(f".{kind}") or extensions.load("exporters", f".{kind}").write
    fractions = []
    write(whole, tmp_path / f"whole.{kind}", lambda fraction: None)
    write(dataclasses.replace(whole, piece_bytes=1), tmp_path / f"pieces.{kind}", fractions.append)
    one, other = (content_of(tmp_path / f"{name}.{kind}") for name in ("whole", "pieces"))
    assert one.identical(other) if kind == "nc" else one == other
    assert len(fractions) >= 5
    assert np.all(np.diff(fractions) >= 0)
    assert fractions[-1] == 1.0


def test_no_piece_is_larger_than_it_may_be(result):
    tracks = tracks_of(result, None, Environment())
    numbers, one = 30, 8 * 30 * len(result.time)
    for most in (1, one, 2 * one + 1, 10 * one):
        pieces = list(dataclasses.replace(tracks, piece_bytes=most).pieces(numbers))
        assert [i for piece in pieces for i in range(piece.start, piece.stop)] == list(range(5))
        assert all((piece.stop - piece.start) * one <= max(most, one) for piece in pieces)
        # What a file has in chunks of two members is written two by two, as far as two fit.
        twos = [piece.stop - piece.start for piece in dataclasses.replace(tracks, piece_bytes=most).pieces(numbers, 2)]
        assert twos == ([1] * 5 if most <= one else [2, 2, 1] if most < 5 * one else [5])


@pytest.mark.parametrize("kind", FILES)
def test_a_full_disk_is_told(kind, result, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(OSError, match=f"run.{kind}") as caught:
            lw.export(result, tmp_path / f"run.{kind}")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert caught.value.filename == str(tmp_path / f"run.{kind}")
    assert list(tmp_path.iterdir()) == []


def test_members_are_chosen_by_their_index(stored, tmp_path):
    for name, run in stored.items():
        for members, wanted in (([4, 0], [4, 0]), (slice(1, 3), [1, 2]), (np.array([3]), [3])):
            path = lw.export(run, tmp_path / "some.csv", members=members, overwrite=True)
            frame = pandas.read_csv(path)
            assert frame.realization.unique().tolist() == wanted, name


@pytest.mark.ci
def test_a_subset_keeps_its_indices(tmp_path):
    subset = lw.Ensemble(scene(origin=ORIGIN), members=9, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
    subset = subset.subset([7, 2])
    memory = lw.solve(subset, **SETTINGS)
    lw.solve(subset, **SETTINGS, store=tmp_path / "run.zarr")
    for i, run in enumerate((memory, tmp_path / "run.zarr", memory.save(tmp_path / "some.npz"))):
        frame = pandas.read_csv(lw.export(run, tmp_path / f"{i}.csv"))
        assert frame.realization.unique().tolist() == [7, 2]


@pytest.mark.ci
def test_members_that_were_kept_alone(tmp_path):
    save = lw.SaveAt(every=0.5)
    settings = SETTINGS | {"save": save, "keep": [4, 1]}
    run = lw.solve(fleet(), **settings)
    whole = lw.solve(fleet(), **SETTINGS)
    lw.solve(fleet(), **settings, store=tmp_path / "run.zarr")
    for i, kept in enumerate((run, tmp_path / "run.zarr", run.save(tmp_path / "kept.npz"))):
        frame = pandas.read_csv(lw.export(kept, tmp_path / f"{i}.csv"))
        assert sorted(frame.realization.unique()) == [1, 4]
        of = frame[frame.realization == 4]
        np.testing.assert_array_equal(of.position_1, whole.position[:, 4, 1])
        assert set(of.status) == {0}
        assert set(frame[frame.realization == 1].status) == {int(lw.Status.FLOOR)}
        assert pandas.read_csv(lw.export(kept, tmp_path / f"{i}4.csv", members=[4])).realization.unique() == [4]
        with pytest.raises(lw.SceneError, match="members = 0 is none of the 2 members that were kept"):
            lw.export(kept, tmp_path / "no.csv", members=[0])


@pytest.mark.ci
def test_a_run_without_samples_is_a_row_for_each_member(tmp_path):
    run = lw.solve(fleet(), **SETTINGS | {"keep": "none"}, statistics=[lw.statistics.Mean("depth")])
    frame = pandas.read_csv(lw.export(run, tmp_path / "run.csv"))
    np.testing.assert_array_equal(frame.status, run.status)
    assert "time" not in frame
    for kind in ("nc", "geojson", "kml", "mcap"):
        with pytest.raises(
            lw.SceneError, match=r"position.* were not kept: .* is made of them. Run it with keep='all'"
        ):
            lw.export(run, tmp_path / f"run.{kind}", origin=ORIGIN)
    assert [path.name for path in tmp_path.iterdir()] == ["run.csv"]


@pytest.mark.ci
def test_a_run_without_an_origin(tmp_path):
    run = lw.solve(fleet(scene()), **SETTINGS)
    frame = pandas.read_csv(lw.export(run, tmp_path / "run.csv"))
    assert not {"latitude", "longitude", "heading_deg", "utc"} & set(frame)
    with xarray.open_dataset(lw.export(run, tmp_path / "run.nc")) as content:
        assert not {"lat", "lon", "heading", "plane"} & set(content.variables)
        assert content.depth.attrs["positive"] == "down"
        assert content.time.values[0, 0] == np.datetime64("1970-01-01")
    for kind in ("geojson", "kml"):
        with pytest.raises(
            lw.SceneError, match=r"origin = None is not known: a map has places on the Earth. Give origin="
        ):
            lw.export(run, tmp_path / f"run.{kind}")
    there = json.loads(lw.export(run, tmp_path / "run.geojson", origin=ORIGIN).read_text())["features"][0]["geometry"]
    np.testing.assert_allclose(there["coordinates"][0][:2], ORIGIN[::-1], rtol=0, atol=DEGREES)


def test_faults(result, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def refused(words, *values, **settings):
        with pytest.raises(lw.SceneError, match=words):
            lw.export(result, *values, **settings)

    refused("to = 'run.xyz' is not a file of a known kind. Give a name that ends in .csv", "run.xyz")
    refused("to = 5 is not a file of a known kind", 5)
    refused("to = 'netcdf' is all that a store holds", "netcdf", tmp_path / "a.nc")
    refused(r"members = \[1\] is given for all that a store holds", "netcdf", tmp_path / "a.nc", members=[1])
    refused("to = 5 is not a file", 5, "b.csv")
    refused("overwrite = 'yes' is neither true nor false", "a.csv", overwrite="yes")
    refused("out = None is missing, and the run is in memory", "parquet")
    refused("out = .* is given beside the file 'a.csv'", "a.csv", "b.csv")
    for members in ("all", [0.5], [[1]], 3):
        refused("members = .* is not a list of members", "a.csv", members=members)
    refused("members = 5 is none of the 5 members. Give indices from 0 to 4", "a.csv", members=[5])
    refused("members = -1 is negative", "a.csv", members=[-1])
    refused("members = .* is a mask of 1 for 5 members", "a.csv", members=[True])
    for members in (slice(5, 9), []):
        refused("members = .* names no member", "a.csv", members=members)
    refused("^origin = 95.0 is not a latitude", "a.csv", origin=[95.0, 0.0])
    refused("^start = 'soon' is not a date and time", "a.csv", start="soon")
    refused("start = .* is before 1970", tmp_path / "a.mcap", start="1960-01-01")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(lw.SceneError, match="run = 5 is not a path"):
        lw.export(5, "a.csv")


@pytest.mark.ci
def test_any_value_of_where_a_result_comes_from_may_be_another(result, tmp_path):
    """A file from elsewhere is exported, or refused by a SceneError."""
    arrays = dict(np.load(result.save(tmp_path / "good.npz")))
    whole = json.loads(str(arrays["provenance"]))
    telling = {name: whole[name] for name in ("ensemble", "versions", "method")}
    telling["environment"] = whole["scene"]["environment"]
    exported = 0
    for content in mutated(telling, 1, 40):
        environment = content.pop("environment")
        content = whole | content | {"scene": whole["scene"] | {"environment": environment}}
        np.savez(tmp_path / "theirs.npz", **arrays | {"provenance": np.array(json.dumps(content))})
        for kind in ("csv", "nc", "geojson"):
            with contextlib.suppress(lw.SceneError):
                lw.export(tmp_path / "theirs.npz", tmp_path / f"run.{kind}", overwrite=True)
                exported += 1
    assert exported > 40


def test_a_file_that_is_there_is_kept(result, tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("mine")
    with pytest.raises(lw.SceneError, match=r"is there already. Give overwrite=True \(--overwrite\), or another name"):
        lw.export(result, path)
    assert path.read_text() == "mine"

    def ended(fraction):
        raise KeyboardInterrupt

    # An export that is ended leaves the file, and nothing beside it.
    for kind in FILES:
        with pytest.raises(KeyboardInterrupt):
            lw.export(result, tmp_path / f"new.{kind}", progress=ended)
    with pytest.raises(KeyboardInterrupt):
        lw.export(result, path, overwrite=True, progress=ended)
    assert [entry.name for entry in tmp_path.iterdir()] == ["run.csv"]
    assert path.read_text() == "mine"
    lw.export(result, path, overwrite=True)
    assert pandas.read_csv(path).shape[0] == 35


def test_the_command_exports_any_run(stored, tmp_path, capsys):
    folder = stored["store"].parent
    for name, path in (("a", stored["npz"]), ("b", stored["store"]), ("c", folder)):
        assert main(["export", str(path), "--to", str(tmp_path / f"{name}.csv"), "--members", "0:2", "-q"]) == 0
        assert pandas.read_csv(tmp_path / f"{name}.csv").realization.unique().tolist() == [0, 1]
    alone = tmp_path / "alone"
    alone.mkdir()
    (alone / "result.npz").write_bytes(stored["npz"].read_bytes())
    map_file = tmp_path / "a.kml"
    verb = [
        "export",
        str(alone),
        "--to",
        str(map_file),
        "--members",
        "4,1",
        "--origin=-33.9,151.3",
        "--start",
        "2027-01-01",
    ]
    assert main(verb) == 0
    assert main(verb) == 2
    assert "is there already. Give overwrite=True (--overwrite)" in capsys.readouterr().err
    assert main([*verb, "--overwrite"]) == 0
    assert "<when>2027-01-01T00:00:00.000000Z</when>" in map_file.read_text()
    (alone / "result2.npz").write_bytes(b"")
    for path, words in ((alone, "holds 2 results. Name one"), (tmp_path / "nowhere", "is not there"),
                        (tmp_path, "holds no store. Give the folder of a run")):  # fmt: skip
        assert main(["export", str(path), "--to", str(tmp_path / "x.csv")]) == 2
        assert words in capsys.readouterr().err
    for option, words in ((["--members", "a:b"], "--members a:b is not a list of members"),
                          (["--origin", "north"], "--origin north is not a place")):  # fmt: skip
        assert main(["export", str(folder), "--to", str(tmp_path / "x.csv"), *option]) == 2
        assert words in capsys.readouterr().err
