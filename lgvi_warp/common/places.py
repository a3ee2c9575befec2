# SPDX-License-Identifier: Apache-2.0
"""Latitude and longitude, and the local axes of a scene: metres to the north and east of an origin."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from lgvi_warp.common.errors import Faults, MissingExtra

# Mean radius of the Earth [m].
RADIUS = 6_371_000.0
# Distance [m] from the origin from which on a run says how far the plane is from the Earth's lengths.
FAR_FROM_ORIGIN = 200_000.0
# Distance [m] to the other side of the Earth, along a meridian.
OTHER_SIDE = 20_003_931.0


@dataclass(frozen=True)
class LocalPlane:
    """Plane that touches the Earth (WGS 84) at an origin, azimuthal equidistant: distance and bearing from it are exact.

    At a distance d from the origin, lengths across the bearing are too long by d^2 / (6 R^2): 4 parts in a million at
    30 km.
    """

    latitude: float
    longitude: float

    def local(self, latitude: Any, longitude: Any) -> tuple[np.ndarray, np.ndarray]:
        """Convert latitudes and longitudes [deg], -180 to 360, to metres to the north and to the east of the origin."""
        east, north = self._projection(np.asarray(longitude, float), np.asarray(latitude, float))
        return np.asarray(north), np.asarray(east)

    def geodetic(self, north: Any, east: Any) -> tuple[np.ndarray, np.ndarray]:
        """Convert metres to the north and to the east of the origin to latitudes and longitudes [deg], -180 to 180.

        The result is NaN for numbers that are not finite, or beyond the opposite point of the Earth.
        """
        north, east = np.asarray(north, float), np.asarray(east, float)
        with np.errstate(over="ignore", invalid="ignore"):
            on_earth = np.hypot(north, east) < OTHER_SIDE
        longitude, latitude = self._projection(east, north, inverse=True)
        return np.where(on_earth, latitude, np.nan), np.where(on_earth, longitude, np.nan)

    def positions(self, places: Any) -> np.ndarray:
        """Convert places (..., 3), latitude, longitude [deg], depth [m], to positions (..., 3) north, east, down [m]."""
        places = np.asarray(places, float)
        return np.stack([*self.local(places[..., 0], places[..., 1]), places[..., 2]], axis=-1)

    def places(self, positions: Any) -> np.ndarray:
        """Convert positions (..., 3) north, east, down [m] to places (..., 3), latitude, longitude [deg], depth [m]."""
        positions = np.asarray(positions, float)
        return np.stack([*self.geodetic(positions[..., 0], positions[..., 1]), positions[..., 2]], axis=-1)

    def convergence(self, latitude: Any, longitude: Any) -> np.ndarray:
        """Angle [rad] from the plane's north to true north at places, positive towards the east."""
        factors = self._projection.get_factors(np.asarray(longitude, float), np.asarray(latitude, float))
        return np.deg2rad(-np.asarray(factors.meridian_convergence))

    @functools.cached_property
    def _projection(self) -> Any:
        try:
            from pyproj import Proj
        except ImportError as error:
            raise MissingExtra("places on the Earth", "pyproj", "ocean") from error
        return Proj(proj="aeqd", lat_0=self.latitude, lon_0=self.longitude, ellps="WGS84", units="m")


def check_places(faults: Faults, key: str, places: np.ndarray) -> None:
    """Add a fault for latitudes and longitudes (..., 2 or more) [deg] outside their range."""
    bounds = (("latitude", 90.0, 90.0), ("longitude", 180.0, 360.0))
    for (word, low, high), values in zip(bounds, np.moveaxis(places, -1, 0), strict=False):
        wrong = (values < -low) | (values > high)
        if np.any(wrong):
            value = float(np.atleast_1d(values)[np.atleast_1d(wrong)][0])
            faults.add(
                key, value, f"is not a {word}", f"give {-low:g} to {high:g} [deg]: latitude first, then longitude"
            )


def too_long(distance: Any) -> Any:
    """Relative error d^2 / (6 R^2) by which lengths across the bearing are too long at a distance [m] from the origin."""
    return np.square(distance) / (6.0 * RADIUS**2)
