# SPDX-License-Identifier: Apache-2.0
"""Vehicle: what is kept, what is refused, and that all faults come in one message."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import notation
from tests.support.refusals import says

GOOD = {"mass": 123.8, "added_mass": (65.0, 70.0, 75.0), "inertia": (5.46, 5.29, 5.72), "buoyancy": 1215.8}


def test_diagonals_become_matrices():
    v = lw.Vehicle(**GOOD)
    np.testing.assert_array_equal(v.inertia, np.diag([5.46, 5.29, 5.72]))
    # M = mass I + added mass
    np.testing.assert_array_equal(v.mass_matrix, np.diag([123.8 + 65.0, 123.8 + 70.0, 123.8 + 75.0]))
    np.testing.assert_array_equal(v.center_of_buoyancy, np.zeros(3))
    assert v.warnings == ()


def test_full_matrices_are_kept():
    J = np.array([[5.0, 0.3, 0.1], [0.3, 6.0, -0.2], [0.1, -0.2, 7.0]])
    v = lw.Vehicle(**GOOD | {"inertia": J, "added_mass": J})
    np.testing.assert_array_equal(v.inertia, J)
    np.testing.assert_array_equal(v.mass_matrix, 123.8 * np.eye(3) + J)
    assert v.to_dict()["inertia"] == J.tolist()


def test_it_is_frozen_and_apart_from_the_callers_arrays():
    given = np.array([5.46, 5.29, 5.72])
    v = lw.Vehicle(**GOOD | {"inertia": given})
    given[0] = -1.0
    assert v.inertia[0, 0] == 5.46
    for array in (v.inertia, v.added_mass, v.center_of_buoyancy):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        v.mass = 1.0
    assert dataclasses.replace(v, mass=100.0).mass_matrix[0, 0] == 165.0


def test_an_added_mass_may_be_negative_where_the_sum_is_positive():
    assert lw.Vehicle(**GOOD | {"added_mass": (-10.0, 0.0, 0.0)}).mass_matrix[0, 0] == 113.8


def test_triangle_inequality_warns():
    v = lw.Vehicle(**GOOD | {"inertia": (1.0, 1.0, 2.5)})
    assert len(v.warnings) == 1
    says(v.warnings[0], "vehicle.inertia", "2.5")
    # A flat plate fulfils J_1 + J_2 = J_3: no warning, whatever round-off the axes it is given in bring.
    for turn in notation.matrix_from_rotation_vector(np.random.default_rng(0).normal(size=(20, 3))):
        J = turn @ np.diag([1.0, 2.0, 3.0]) @ turn.T
        assert lw.Vehicle(**GOOD | {"inertia": 0.5 * (J + J.T)}).warnings == ()


def test_all_faults_come_in_one_message():
    with pytest.raises(lw.SceneError) as caught:
        lw.Vehicle(mass=-1.0, added_mass="no", inertia=(1.0, 1.0), buoyancy=np.nan, center_of_buoyancy=3.0)
    assert len(caught.value.faults) == 5
    for key in ("mass", "added_mass", "inertia", "buoyancy", "center_of_buoyancy"):
        assert f"vehicle.{key} = " in str(caught.value)
    assert isinstance(caught.value, ValueError)


def test_to_dict_makes_the_same_vehicle():
    v = lw.Vehicle(**GOOD | {"center_of_buoyancy": (0.0, 0.0, -0.007)})
    again = lw.Vehicle(**v.to_dict())
    assert again.to_dict() == v.to_dict()
    assert v.to_dict()["inertia"] == [5.46, 5.29, 5.72]
