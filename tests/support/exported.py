# SPDX-License-Identifier: Apache-2.0
"""Members that are exported: where they start, what becomes of them, and where on the Earth they are."""

import numpy as np

import lgvi_warp as lw

ORIGIN, DATE = [63.44, 10.40], "2026-06-01T06:00:00Z"
# Rounding of PROJ in degrees: parts in 1e15 of a turn, and of the inverse of Geod, nanometres on the Earth.
DEGREES = 1e-12
SETTINGS = dict(method="rk4", h=0.02, t1=3.0, save=lw.SaveAt(every=0.5), threads=1)
# What becomes of the members of `fleet`.
OUTCOMES = ["ok", "floor", "non_finite", "non_finite", "ok"]


def scene(**environment):
    start = {"velocity": [1.5, 0.0, 0.0]}
    return lw.Scene.named("remus_100", environment=environment, start=start, events=[lw.events.Floor(depth=5.3)])


def fleet(of=None):
    """Five members: two reach the end, one the floor, one starts nowhere, one turns too fast for its step."""
    position = np.array(
        [[0.0, 0.0, 3.0], [40.0, -30.0, 5.0], [np.nan, 0.0, 3.0], [5.0, 5.0, 3.0], [-900.0, 700.0, 4.0]]
    )
    turning = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.1], [0.0, 0.0, 0.0], [0.0, 900.0, 0.0], [0.1, 0.0, 0.05]])
    angles = np.deg2rad([10.0, 80.0, 0.0, 0.0, 250.0])
    zero, one = np.zeros(5), np.ones(5)
    rows = [[np.cos(angles), -np.sin(angles), zero], [np.sin(angles), np.cos(angles), zero], [zero, zero, one]]
    attitude = np.moveaxis(np.array(rows), -1, 0)
    velocity = np.tile([1.5, 0.0, 0.0], (5, 1))
    buoyancy = {"vehicle.buoyancy": [299.0, 250.0, 299.0, 299.0, 299.5]}
    return lw.Ensemble.from_states(
        of or scene(origin=ORIGIN, start=DATE), position, attitude, velocity, turning, buoyancy
    )


def by_geodesic(position, origin=ORIGIN):
    """Latitude and longitude of positions (..., 3): along the geodesic from the origin, by Karney's algorithm (2013)."""
    import pyproj

    north, east = position[..., 0], position[..., 1]
    latitude, longitude = (np.full(north.shape, value) for value in origin)
    bearing = np.rad2deg(np.arctan2(east, north))
    geod = pyproj.Geod(ellps="WGS84")
    longitude, latitude, _ = geod.fwd(longitude, latitude, bearing, np.hypot(north, east))
    return np.asarray(latitude), np.asarray(longitude)
