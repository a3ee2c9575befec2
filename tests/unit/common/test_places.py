# SPDX-License-Identifier: Apache-2.0
"""Places on the Earth against geodesics of the ellipsoid."""

import contextlib

import numpy as np
import pytest

from lgvi_warp.common.errors import Faults, SceneError
from lgvi_warp.common.places import LocalPlane, check_places

pyproj = pytest.importorskip("pyproj")
WOODS_HOLE = LocalPlane(41.5, -70.6)


def test_distance_and_bearing_from_the_origin_are_those_of_the_geodesic():
    latitude, longitude = np.array([41.6, 40.9, 41.5]), np.array([-70.5, -71.4, -70.6])
    bearing, _, distance = pyproj.Geod(ellps="WGS84").inv([-70.6] * 3, [41.5] * 3, longitude, latitude)
    north, east = WOODS_HOLE.local(latitude, longitude)
    np.testing.assert_allclose(np.hypot(north, east), distance, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(np.arctan2(east, north)[:2], np.deg2rad(bearing)[:2], atol=1e-9)


def test_there_and_back():
    north, east = np.array([0.0, 4e4, -3e3]), np.array([0.0, -2e4, 5e4])
    back = WOODS_HOLE.local(*WOODS_HOLE.geodetic(north, east))
    np.testing.assert_allclose(back, (north, east), rtol=0.0, atol=1e-6)


def test_longitudes_from_0_to_360():
    np.testing.assert_allclose(WOODS_HOLE.local(41.6, 289.5), WOODS_HOLE.local(41.6, -70.5), atol=1e-9)


def test_lengths_across_are_too_long_by_what_is_said():
    latitude, longitude = WOODS_HOLE.geodetic(30e3 * np.cos([0.0, 1e-3]), 30e3 * np.sin([0.0, 1e-3]))
    across = pyproj.Geod(ellps="WGS84").inv(longitude[0], latitude[0], longitude[1], latitude[1])[2]
    stretched = 60e3 * np.sin(5e-4) / across - 1.0
    assert stretched == pytest.approx(30e3**2 / (6.0 * 6.37e6**2), rel=0.02)


def test_true_north_away_from_the_origin():
    first, second = WOODS_HOLE.local(41.6, -70.5), WOODS_HOLE.local(41.60001, -70.5)
    seen = np.arctan2(second[1] - first[1], second[0] - first[0])
    assert WOODS_HOLE.convergence(41.6, -70.5) == pytest.approx(seen, abs=1e-8)


@pytest.mark.parametrize(
    ("longitude", "good"), [(-180.0, True), (-180.5, False), (-360.0, False), (360.0, True), (360.5, False)]
)
def test_longitudes_that_are_on_a_map(longitude, good):
    faults = Faults()
    check_places(faults, "at", np.array([[10.0, longitude]]))
    with contextlib.nullcontext() if good else pytest.raises(SceneError, match=r"is not a longitude. Give -180 to 360"):
        faults.raise_if_any()
