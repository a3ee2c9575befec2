# SPDX-License-Identifier: Apache-2.0
"""The law by the checks of lgvi_warp, and beside its twin."""

import numpy as np
from lgvi_magnet.term import Magnet
from lgvi_magnet.twin import torque

import lgvi_warp as lw

NUMBERS = {"moment": [30.0, -10.0, 20.0], "field": [2e-5, 1e-6, 4e-5]}
BODY = {"mass": 10.0, "inertia": [0.1, 0.2, 0.3], "added_mass": [0.0, 0.0, 0.0], "buoyancy": 0.0}


def scene(**start):
    """A vehicle without weight in the field."""
    return lw.Scene.from_dict(
        {"vehicle": BODY, "environment": {"gravity": 0.0}, "start": start, "terms": [{"type": "magnet", **NUMBERS}]}
    )


def test_the_device_code_is_right():
    report = lw.laws.check_law(Magnet(**NUMBERS))
    assert report.ok, report


def test_a_step_from_rest_is_the_twins_torque():
    h, here = 1e-3, scene(euler_deg=[20.0, -30.0, 70.0])
    result = lw.solve(here, "rk8", h=h, t1=h)
    turned = torque(np.array(NUMBERS["moment"]), np.array(NUMBERS["field"]), result.attitude[0, 0])
    # What is left is of the order of h^2: the torque changes as the hull turns.
    np.testing.assert_allclose(result.angular_velocity[-1, 0], h * turned / BODY["inertia"], rtol=1e-6)


def test_scene_files_know_the_type():
    assert type(scene().terms[0]) is Magnet
    assert lw.terms.Magnet is Magnet
    assert "Magnet" in dir(lw.terms)
