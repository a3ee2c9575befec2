# SPDX-License-Identifier: Apache-2.0
"""Data sets of a stranger: they lead to no other file, program or address, and are read or refused soon.

docs/guide/what_files_can_do.md says what holds. A canary tells whether something opened it: a pipe, or a local server.
"""

import os
import socket
import sys
import threading
import time
import warnings

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.ocean import closed_files
from tests.extensions.ocean import data
from tests.extensions.ocean.test_floor_data import DEPTH, NORTH_UP, gebco, geotiff

h5py = pytest.importorskip("h5py")
rasterio = pytest.importorskip("rasterio")
ORIGIN, PLACE = (41.5, -70.5), (54.05, 7.9)
EAST = lambda lat, lon, z, t: 0.3 + 0.0 * (lat + lon + z + t)  # noqa: E731
# Of the clock, on a busy machine [s].
MOST_SECONDS = 5.0


class Pipes:
    """Pipes, as canaries: `opened` are those that something opened to read. None of them waits."""

    def __init__(self):
        self.paths, self.opened, self.stop = [], set(), threading.Event()
        self.thread = threading.Thread(target=self._watch, daemon=True)
        self.thread.start()

    def at(self, path):
        os.mkfifo(path)
        self.paths.append(path)
        return str(path)

    def _watch(self):
        while not self.stop.wait(0.005):
            for path in list(self.paths):
                try:
                    os.close(os.open(path, os.O_WRONLY | os.O_NONBLOCK))
                except OSError:
                    continue
                self.opened.add(str(path))


@pytest.fixture
def pipes():
    made = Pipes()
    yield made
    made.stop.set()
    made.thread.join()


@pytest.fixture
def server():
    """A server on this machine, and whether somebody has called it."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.setblocking(False)
        address = f"http://127.0.0.1:{listening.getsockname()[1]}/floor"

        def called():
            try:
                listening.accept()[0].close()
            except BlockingIOError:
                return False
            return True

        yield address, called


def good(path):
    data.cmems(EAST, EAST).to_netcdf(path, engine="h5netcdf")


def instead(make):
    """A file whose `uo` is another: `make(file, shape, name of another file)`."""

    def harm(path, second):
        good(path)
        with h5py.File(path, "r+") as file:
            old = file["uo"]
            shape = old.shape
            attributes = {name: old.attrs[name] for name in ("units", "standard_name")}
            del file["uo"]
            made = make(file, shape, second)
            if made is not None:
                made.attrs.update(attributes)
                for number, name in enumerate(("time", "depth", "latitude", "longitude")):
                    made.dims[number].attach_scale(file[name])

    return harm


def external(file, shape, second):
    return file.create_dataset("uo", shape, "f8", external=[(second, 0, h5py.h5f.UNLIMITED)])


def virtual(file, shape, second):
    layout = h5py.VirtualLayout(shape, "f8")
    layout[...] = h5py.VirtualSource(second, "vo", shape)
    return file.create_virtual_dataset("uo", layout)


def in_a_group(file, shape, second):
    file["uo"] = file["vo"]
    inner = file.create_group("a/b")
    inner["c"] = h5py.ExternalLink(second, "vo")
    inner["back"] = file["a"]


def by_reference(file, shape, second):
    """A variable that no group has, behind an axis of one that is."""
    hidden = file.create_dataset("hidden", (4,), "f8", external=[(second, 0, 32)])
    file["uo"] = file["vo"]
    made = file.create_dataset("other", (4,), "f8")
    made.attrs.create("DIMENSION_LIST", np.array([np.array([hidden.ref], h5py.ref_dtype), None], object)[:1],
                      dtype=h5py.vlen_dtype(h5py.ref_dtype))  # fmt: skip
    del file["hidden"]


def other_references(file, shape, second):
    file["uo"] = file["vo"]
    file["uo"].attrs["region"] = file["vo"].regionref[...]


def filtered(file, shape, second):
    file.create_dataset("packed", (4,), chunks=(4,), compression="lzf")
    file["uo"] = file["vo"]


def chunk(file, shape, second):
    file.create_dataset("large", (3000, 3000), "u1", chunks=(2000, 2000))
    file["uo"] = file["vo"]


def axis(file, shape, second):
    file.create_dataset("long", (10**12,), "f8", chunks=(1000,))
    file["uo"] = file["vo"]


def crowd(file, shape, second):
    file["uo"] = file["vo"]
    for number in range(11):
        file.create_group(f"g{number}")


def external_link(file, shape, second):
    file["uo"] = h5py.ExternalLink(second, "vo")


def soft_link_through_it(file, shape, second):
    file["out"] = h5py.ExternalLink(second, "/")
    file["uo"] = h5py.SoftLink("/out/vo")


# A harm, and words of the refusal.
HDF5 = {
    "external storage": (instead(external), "has the numbers of '/uo' in another file"),
    "a virtual variable": (instead(virtual), "takes the numbers of '/uo' from other files"),
    "an external link": (instead(external_link), "has a link to another file, 'uo'"),
    "a link through it": (instead(soft_link_through_it), "has a link to another file, 'out'"),
    "in a group": (instead(in_a_group), "has a link to another file, 'c'"),
    "behind an axis": (instead(by_reference), "(has the numbers of|is damaged)"),
    "other references": (instead(other_references), "has references in 'region'"),
    "a filter to be loaded": (instead(filtered), "has '/packed' packed by filter 32000"),
    "a large chunk": (instead(chunk), "has '/large' in chunks of more than"),
    "a long axis": (instead(axis), "has more than 268,435,456 bytes in '/long'"),
    "many objects": (instead(crowd), "has more than 8 groups and variables"),
}


@pytest.mark.parametrize("reader", ["current", "floor"])
@pytest.mark.parametrize("name", HDF5)
def test_a_netcdf_file_that_is_not_all_there_is(name, reader, tmp_path, pipes, monkeypatch):
    harm, words = HDF5[name]
    if name == "many objects":
        monkeypatch.setattr(closed_files, "MOST_OBJECTS", 8)
    monkeypatch.setattr(closed_files, "MOST_CHUNK", 2_000_000)
    harm(tmp_path / "a.nc", pipes.at(tmp_path / "canary"))
    read = lw.terms.CurrentField.from_dataset if reader == "current" else lw.events.Floor.from_file
    begun = time.monotonic()
    with pytest.raises(lw.SceneError, match="^file = .* " + words) as error:
        read(tmp_path / "a.nc", ORIGIN)
    assert time.monotonic() - begun < MOST_SECONDS
    assert len(str(error.value).splitlines()) == 1
    time.sleep(0.02)
    assert not pipes.opened


def test_a_canary_sings(tmp_path, pipes):
    """The watch of these tests finds what opens a pipe."""
    path = pipes.at(tmp_path / "canary")
    os.close(os.open(path, os.O_RDONLY))
    time.sleep(0.05)
    assert pipes.opened == {path}


@pytest.mark.skipif(not os.path.exists("/proc/self/mem"), reason="the system shows no memory as a file")
def test_a_file_that_cannot_be_read_is_refused():
    with pytest.raises(lw.SceneError, match="is damaged, or no NetCDF file"):
        lw.terms.CurrentField.from_dataset("/proc/self/mem", ORIGIN)


def test_soft_links_and_circles_within_a_file_are_read(tmp_path):
    good(tmp_path / "a.nc")
    known = lw.terms.CurrentField.from_dataset(tmp_path / "a.nc", ORIGIN)
    with h5py.File(tmp_path / "a.nc", "r+") as file:
        file["group/top"] = file["/"]
        file["group/again"] = h5py.SoftLink("/vo")
    again = lw.terms.CurrentField.from_dataset(tmp_path / "a.nc", ORIGIN)
    np.testing.assert_array_equal(again.velocities, known.velocities)


@pytest.mark.parametrize("form", ["NETCDF3_CLASSIC", "NETCDF3_64BIT", "NETCDF3_64BIT_DATA", "NETCDF4"])
def test_each_form_of_netcdf_has_its_reader(form, tmp_path, monkeypatch):
    netcdf = pytest.importorskip("netCDF4")
    import xarray as xr

    ds = data.cmems(EAST, EAST, hours=np.arange(2.0))
    ds.to_netcdf(tmp_path / "a.nc", engine="netcdf4", format="NETCDF3_64BIT" if form.endswith("DATA") else form)
    if form.endswith("DATA"):
        with netcdf.Dataset(tmp_path / "a.nc") as old, netcdf.Dataset(tmp_path / "b.nc", "w", format=form) as new:
            for name, dimension in old.dimensions.items():
                new.createDimension(name, len(dimension))
            for name, variable in old.variables.items():
                made = new.createVariable(name, variable.dtype, variable.dimensions)
                made.setncatts({k: variable.getncattr(k) for k in variable.ncattrs() if k != "_FillValue"})
                made[:] = variable[:]
        os.replace(tmp_path / "b.nc", tmp_path / "a.nc")
    asked = []
    opening = xr.open_dataset
    monkeypatch.setattr(
        xr, "open_dataset", lambda *a, engine, **more: asked.append(engine) or opening(*a, engine=engine, **more)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        field = lw.terms.CurrentField.from_dataset(tmp_path / "a.nc", ORIGIN)
    np.testing.assert_allclose(field.velocities[0, 0, 2, 2, 0, :2].sum(), 0.6, atol=0.01)
    assert asked == ["h5netcdf" if form == "NETCDF4" else "netcdf4"]
    content = (tmp_path / "a.nc").read_bytes()
    (tmp_path / "a.nc").write_bytes(content[: 2 * len(content) // 5])
    with pytest.raises(lw.SceneError, match=r"no NetCDF file: (it is shorter than it says|.*truncated)"):
        lw.terms.CurrentField.from_dataset(tmp_path / "a.nc", ORIGIN)


@pytest.mark.parametrize("reader", ["current", "floor", "floor as a raster"])
@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "zarr", "address", "the library's address"])
def test_only_regular_files_of_this_machine(kind, reader, tmp_path, pipes, server):
    address, called = server
    path = {"pipe": tmp_path / "pipe", "folder": tmp_path, "device": "/dev/zero", "zarr": tmp_path / "a.zarr",
            "address": address + ".nc#mode=bytes", "the library's address": f"/vsicurl/{address}.tif"}[kind]  # fmt: skip
    if kind == "pipe":
        pipes.at(path)
    if kind == "zarr":
        (path / "uo").mkdir(parents=True)
        (path / ".zgroup").write_text('{"zarr_format": 2}')
    read = lw.terms.CurrentField.from_dataset if reader == "current" else lw.events.Floor.from_file
    known = "No such file" if "address" in kind else "it is not a regular file"
    with pytest.raises(lw.SceneError, match=f"^file = .*{known}.*Give the path of a NetCDF file"):
        read(path, ORIGIN)
    time.sleep(0.02)
    assert not pipes.opened
    assert not called()


def vrt(source):
    return ('<VRTDataset rasterXSize="49" rasterYSize="25"><VRTRasterBand dataType="Byte" band="1"><SimpleSource>'
            f"<SourceFilename>{source}</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>")  # fmt: skip


SIDECARS = (".msk", ".ovr", ".aux.xml", ".tfw", ".prj", ".tif.msk.ovr", ".IMD", "_metadata.txt")


@pytest.mark.parametrize("kind", ["pipes", "addresses", "inside the file"])
def test_nothing_beside_a_raster_is_looked_at(kind, tmp_path, pipes, server):
    address, called = server
    geotiff(tmp_path / "floor.tif", -DEPTH[::-1], NORTH_UP)
    plain = lw.events.Floor.from_file(tmp_path / "floor.tif", PLACE, fill="nearest")
    if kind == "inside the file":
        with rasterio.open(tmp_path / "floor.tif", "r+") as file:
            other = pipes.at(tmp_path / "canary")
            file.update_tags(ns="OVERVIEWS", OVERVIEW_FILE=other, MASK_FILE=other)
            file.update_tags(ns="ProxyOverviewRequest", FILENAME=f"/vsicurl/{address}")
    else:
        for name in SIDECARS:
            for path in (tmp_path / f"floor{name}", tmp_path / f"floor.tif{name}"):
                if kind == "pipes":
                    pipes.at(path)
                else:
                    path.write_text(vrt(f"/vsicurl/{address}"))
    begun = time.monotonic()
    floor = lw.events.Floor.from_file(tmp_path / "floor.tif", PLACE, fill="nearest")
    assert time.monotonic() - begun < MOST_SECONDS
    np.testing.assert_array_equal(floor.depth, plain.depth)
    time.sleep(0.02)
    assert not pipes.opened
    assert not called()


SYSTEMS = {
    "by a grid": ("+proj=longlat +ellps=bessel +nadgrids={} +no_defs", "names a file of its own"),
    "vertical": ("EPSG:5703", "is a engineering crs|is not understood"),
    "engineering": ('LOCAL_CS["x",UNIT["metre",1]]', "is a engineering crs|is not understood"),
    "geocentric": ("EPSG:4978", "is a geocentric crs|is not understood"),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_reference_system_without_places(name, tmp_path, pipes):
    system, words = SYSTEMS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        geotiff(tmp_path / "floor.tif", -DEPTH[::-1], NORTH_UP, system.format(tmp_path / "grid.gsb"))
    # The library that writes the file would wait for this one.
    pipes.at(tmp_path / "grid.gsb")
    with pytest.raises(lw.SceneError, match=f"has a coordinate reference system that ({words}).*. Write one"):
        lw.events.Floor.from_file(tmp_path / "floor.tif", PLACE)
    time.sleep(0.02)
    assert not pipes.opened


def test_a_height_beside_the_places_changes_nothing(tmp_path):
    geotiff(tmp_path / "plain.tif", -DEPTH[::-1], NORTH_UP)
    geotiff(tmp_path / "high.tif", -DEPTH[::-1], NORTH_UP, "EPSG:9518")
    plain, high = (lw.events.Floor.from_file(tmp_path / f"{name}.tif", PLACE).depth for name in ("plain", "high"))
    np.testing.assert_array_equal(plain, high)


@pytest.mark.parametrize("region", [None, [[-3000.0, 3500.0], [-4000.0, 4200.0]]])
@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300, 1e160, 1e30, 1e-300])
@pytest.mark.parametrize("place", range(6))
def test_a_raster_that_is_nowhere(place, number, region, tmp_path):
    numbers = list(NORTH_UP)[:6]
    numbers[place] = number
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        geotiff(tmp_path / "floor.tif", -DEPTH[::-1], rasterio.Affine(*numbers))
    try:
        lw.events.Floor.from_file(tmp_path / "floor.tif", PLACE, region=region)
    except lw.SceneError as error:
        assert len(str(error).splitlines()) == 1
    else:
        # What is next to nothing is nothing: no turn, or a corner at 0 degrees.
        assert number == 1e-300
        assert place in (1, 3) or region is None


def test_the_last_pixels_are_read(tmp_path):
    """To the middle of the last pixel and not one further, on each side."""
    geotiff(tmp_path / "floor.tif", -DEPTH[::-1], NORTH_UP)
    from lgvi_warp.common.places import LocalPlane
    from lgvi_warp.extensions.ocean.rasters import open_raster

    asked = []
    with (
        open(tmp_path / "floor.tif", "rb", buffering=0) as file,
        open_raster("", file, LocalPlane(*PLACE), "up") as raster,
    ):
        reading = raster.file.read

        class Watched:
            scales, offsets = raster.file.scales, raster.file.offsets

            def read(self, band, window, masked):
                asked.append(window)
                return reading(band, window=window, masked=masked)

        raster.file = Watched()
        (south, _), (west, _) = raster.bounds()
        from lgvi_warp.extensions.ocean.regrid import Regular

        pixel = raster.spacing()
        # One place between the second and the third pixel from the south-west corner: four pixels and no more.
        place = np.array([south + 1.5 * pixel[0], west + 1.5 * pixel[1], 0.0])
        raster.depths(Regular(place, np.array([1.0, 1.0, 1.0]), (1, 1, 1)))
    rows = len(DEPTH)
    assert asked == [((rows - 3, rows - 1), (1, 3))]


def test_a_scene_is_read_without_a_file_left_open(tmp_path):
    (tmp_path / "scene.toml").write_text('[vehicle]\nname = "sphere"\n')
    gebco().to_netcdf(tmp_path / "gebco.nc")
    geotiff(tmp_path / "floor.tif", -DEPTH[::-1], NORTH_UP)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        lw.Scene.load(tmp_path / "scene.toml")
        for name in ("gebco.nc", "floor.tif"):
            lw.events.Floor.from_file(tmp_path / name, PLACE)
            good = len(os.listdir("/dev/fd"))
            lw.events.Floor.from_file(tmp_path / name, PLACE)
            assert len(os.listdir("/dev/fd")) == good


@pytest.mark.parametrize("library", ["h5py", "rasterio"])
def test_a_reader_that_is_missing(library, tmp_path, monkeypatch):
    gebco().to_netcdf(tmp_path / "h5py")
    geotiff(tmp_path / "rasterio", -DEPTH[::-1], NORTH_UP)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(ImportError, match=rf"need {library}: .*pip install"):
        lw.events.Floor.from_file(tmp_path / library, PLACE)


@pytest.mark.parametrize("call", [
    lambda path: lw.events.Floor.from_file(path, PLACE), lambda path: lw.terms.CurrentField.from_dataset(path, ORIGIN),
    lw.Scene.load, lw.Result.load, lw.open_run, lw.designs.Table, lw.vehicles.from_sdf, lw.vehicles.from_yaml,
    lambda path: lw.report(path, "report.html"),
], ids=["floor", "current", "scene", "result", "run", "table", "sdf", "yaml", "report"])  # fmt: skip
def test_a_path_with_half_a_character(call):
    with pytest.raises(lw.SceneError):
        call("a\ud800b.nc")


def test_a_damaged_chunk_is_a_line(tmp_path):
    ds = gebco()
    ds.to_netcdf(tmp_path / "a.nc", encoding={"elevation": {"zlib": True, "chunksizes": (25, 49)}}, engine="h5netcdf")
    with h5py.File(tmp_path / "a.nc") as file:
        place = file["elevation"].id.get_chunk_info(0).byte_offset
    with open(tmp_path / "a.nc", "r+b") as file:
        file.seek(place)
        file.write(b"\xff" * 64)
    with pytest.raises(lw.SceneError, match=r"^file = .*a.nc' is damaged"):
        lw.events.Floor.from_file(tmp_path / "a.nc", PLACE)
