# SPDX-License-Identifier: Apache-2.0
"""Small data sets as ocean models write them, filled from functions of latitude, longitude [deg], depth [m] and time [s]."""

import numpy as np
import pytest

xr = pytest.importorskip("xarray")

LATITUDE = np.linspace(41.0, 42.0, 11)
LONGITUDE = np.linspace(-71.0, -70.0, 9)
DEPTH = np.array([0.0, 5.0, 10.0, 20.0, 40.0])
START = np.datetime64("2024-05-01T00:00:00", "ns")
HOURS = np.arange(4)


def still(lat, lon, z, t):
    return 0.0 * (lat + lon + z + t)


def times(hours=HOURS):
    return START + (np.asarray(hours) * 3600e9).astype("timedelta64[ns]")


def on_grid(u, lat=LATITUDE, lon=LONGITUDE, depth=DEPTH, hours=HOURS):
    """Values (t, k, y, x) of a function."""
    t, z, y, x = np.meshgrid(np.asarray(hours) * 3600.0, depth, lat, lon, indexing="ij")
    return u(y, x, z, t)


def dataset(names, u, v, w=None, *, standard=True, lat=LATITUDE, lon=LONGITUDE, depth=DEPTH, hours=HOURS, unit="m s-1",
            axes=("time", "depth", "latitude", "longitude")):  # fmt: skip
    """A data set on latitudes, longitudes, depths and times; names of the variables and of the axes."""
    words = ("eastward_sea_water_velocity", "northward_sea_water_velocity", "upward_sea_water_velocity")
    data = {}
    for name, word, function in zip(names, words, (u, v, w), strict=False):
        if function is not None:
            attributes = {"units": unit} | ({"standard_name": word} if standard else {})
            data[name] = (axes, on_grid(function, lat, lon, depth, hours), attributes)
    t, k, y, x = axes
    coordinates = {
        t: (t, times(hours)),
        k: (k, depth, {"units": "m", "positive": "down", "standard_name": "depth"}),
        y: (y, lat, {"units": "degrees_north", "standard_name": "latitude"}),
        x: (x, lon, {"units": "degrees_east", "standard_name": "longitude"}),
    }
    return xr.Dataset(data, coordinates)


def cmems(u, v, w=None, **more):
    """Data set like one of the Copernicus Marine Service."""
    return dataset(("uo", "vo", "wo"), u, v, w, **more)


def hycom(u, v, w=None, **more):
    """Data set like HYCOM's: longitudes to 360, packed in 16 bits by `packed`."""
    return dataset(("water_u", "water_v", "water_w"), u, v, w,
                   **{"lon": LONGITUDE + 360.0, "axes": ("time", "depth", "lat", "lon"), **more})  # fmt: skip


def turned(latitude, longitude, angle, shape=(13, 12), spacing=9000.0):
    """Latitudes and longitudes (y, x) of a grid that is turned by an angle [rad] about a place."""
    from lgvi_warp.common.places import LocalPlane

    j, i = np.meshgrid(*(spacing * (np.arange(n) - 0.5 * (n - 1)) for n in shape), indexing="ij")
    north, east = np.cos(angle) * j + np.sin(angle) * i, np.cos(angle) * i - np.sin(angle) * j
    return LocalPlane(latitude, longitude).geodetic(north, east)
