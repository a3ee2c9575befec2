# SPDX-License-Identifier: Apache-2.0
"""Guidance against its twins, and what it does: waypoints by three methods from one kernel."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from tests.support.loops import torpedo, twin_states

H, EVERY = 0.05, 2
POINTS = [(0.0, 0.0, 2.0), (4.0, 0.0, 3.0), (4.0, 3.0, 3.0), (1.0, 5.0, 2.5)]


def scene(current=(0.0, 0.0, 0.0), **words):
    """A body that is pushed along its waypoints, in a current."""
    words = dict(points=POINTS, speed=1.0, look_ahead=1.5, radius=0.8) | words
    laws = [
        lw.control.SpeedPID(kp=40.0, ki=4.0, drag=20.0),
        lw.control.HeavePID(kp=30.0, kd=40.0),
        lw.control.HeadingPID(kp=30.0, kd=40.0),
    ]
    controller = lw.Controller(period=EVERY * H, guidance=[lw.control.Waypoints(**words)], laws=laws)
    vehicle = torpedo(20.0 * 9.8, (0.0, 0.0, -0.1))
    terms = [lw.terms.Drag(linear=(3.0, 40.0, 40.0, 3.0, 4.0, 5.0), quadratic=(20.0, 90.0, 90.0, 1.0, 2.0, 3.0)),
             lw.terms.ControlWrench(limit=(60.0, 60.0, 60.0, 20.0, 20.0, 20.0))]  # fmt: skip
    terms += [lw.terms.Current(velocity=current)] if np.any(current) else []
    return lw.Scene(vehicle, lw.Environment(gravity=9.8), terms, controller=controller)


def states(n):
    """Position, attitude, velocity and angular velocity of n members: beside, behind and beyond the first leg."""
    position = np.array([(0.0, 0.6, 2.2), (-1.0, -0.5, 2.0), (3.7, 1.5, 2.0)])[:n]
    return position, np.tile(np.eye(3), (n, 1, 1)), np.tile((0.8, 0.1, 0.0), (n, 1)), np.zeros((n, 3))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("method", "words"),
    [("los", {}), ("ilos", {"kappa": 0.4}), ("alos", {"gamma": 0.05}), ("los", {"at_end": "go_on"})],
    ids=["los", "ilos", "alos", "go_on"],
)
@pytest.mark.slow_but("ilos", "alos")
def test_waypoints_are_their_twin(method, words):
    steps, way = 320, scene(method=method, **words)
    shift = np.array([(0.0, 0.0, 0.0), (0.2, -0.3, 0.1), (0.0, 0.4, 0.0)])
    parameters = {"waypoints.points": np.array(POINTS) + shift[:, None], "waypoints.speed": np.array([1.0, 1.2, 0.9])}
    given = states(3)
    ensemble = lw.Ensemble.from_states(way, *given, parameters)
    result = lw.solve(ensemble, "psi_s", h=H, t1=steps * H, save=lw.SaveAt(every=EVERY * H))
    for i in range(3):
        numbers = {name: values[i] for name, values in parameters.items()}
        b, R = twin_states(way, numbers, [x[i] for x in given], EVERY, H, steps)
        # 160 ticks of a stable loop: round-off of numbers of size 10, as in test_laws.py.
        assert np.abs(result.position[:, i] - b).max() < 1e-9
        assert np.abs(result.attitude[:, i] - R).max() < 1e-9


def across(result):
    """Distance of a member from the line of the x axis at its last sample."""
    return abs(result.position[-1, 0, 1])


@pytest.mark.slow
def test_a_current_drives_off_the_way_and_the_integral_comes_back():
    ends = {}
    for method in ("los", "ilos", "alos"):
        way = scene(
            (0.0, 0.3, 0.0), points=[(0, 0, 2), (500, 0, 2)], look_ahead=4.0, method=method, gamma=0.01, kappa=0.5
        )
        way = dataclasses.replace(way, start=lw.Start(position=(0.0, 0.0, 2.0), velocity=(1.0, 0.3, 0.0)))
        result = lw.solve(way, "psi_s", h=H, t1=200.0, save=lw.SaveAt(every=200.0))
        ends[method] = across(result)
    # Along the leg the vehicle heads into the current by the angle whose sine is 0.3 / 1: los holds it by its way off alone.
    assert abs(ends["los"] - 4.0 * np.tan(np.arcsin(0.3))) < 0.2
    assert ends["ilos"] < 0.02
    assert ends["alos"] < 0.02


@pytest.mark.slow
def test_it_stops_at_the_last_point_or_goes_on():
    end = []
    for at_end in ("stop", "go_on"):
        way = scene(points=[(0, 0, 2), (5, 0, 2)], at_end=at_end)
        way = dataclasses.replace(way, start=lw.Start(position=(0.0, 0.0, 2.0), velocity=(1.0, 0.0, 0.0)))
        result = lw.solve(way, "psi_s", h=H, t1=60.0, save=lw.SaveAt(every=30.0))
        end.append(result.position[1:, 0, 0])
    assert 4.2 - 1e-9 < end[0][1] < 8.0
    assert abs(end[0][1] - end[0][0]) < 0.2
    assert end[1][1] - end[1][0] > 25.0
