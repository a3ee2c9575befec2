# SPDX-License-Identifier: Apache-2.0
"""Bounds of what a learner sees: those that events of the scene put on the place of a vehicle."""

import numpy as np

import lgvi_warp as lw
from lgvi_warp.extensions.learning.observations import bounds

SURFACE = lw.events.Surface(depth=0.5)
SLOPE = lw.events.Floor(depth=[[30.0, 40.0]] * 2, spacing=[9.0, 9.0], clearance=1.0)
BOX = lw.events.Box(lower=[-5.0, -6.0, -9.0], upper=[5.0, 6.0, 20.0])
INF = np.inf


def limits(events, *names, vary=None, **parts):
    """The least and the largest of named numbers; None where nothing bounds any."""
    controller = lw.Controller(
        period=0.1, guidance=[lw.control.SetPoint(depth=5.0)], laws=[lw.control.HeavePID(kp=1.0)], **parts
    )
    scene = lw.Scene.named("remus_100", controller=controller, events=events)
    found = bounds(names, lw.Ensemble(scene, 3, 1, vary or {}))
    return None if found is None else found.tolist()


def test_events_bound_the_place():
    assert limits([SURFACE], "depth", "measured_position[0]") == [[0.5, -INF], [INF, INF]]
    # The deepest place of the floor, less the clearance.
    assert limits([SURFACE, SLOPE], "measured_depth") == [[0.5], [39.0]]
    assert limits([SURFACE, SLOPE, BOX], "measured_position") == [[-5.0, -6.0, 0.5], [5.0, 6.0, 20.0]]
    assert limits([lw.events.Floor(depth=8.0), BOX], "measured_position[2]") == [[-9.0], [8.0]]
    assert limits([lw.events.StopTime(at=3.0)], "depth", "velocity") is None


def test_nothing_is_sure_of_what_varies_or_is_measured_with_errors():
    vary = {"floor.clearance": lw.distributions.Uniform(low=0.5, high=1.0)}
    assert limits([SURFACE, SLOPE], "depth", vary=vary) == [[0.5], [INF]]
    sensor = lw.control.Sensor(of="depth", noise=0.1)
    assert limits([SURFACE, SLOPE], "depth", sensors=[sensor]) is None
    assert limits([SURFACE], "depth", "down[2]", sensors=[sensor]) == [[-INF, -1.0], [INF, 1.0]]
