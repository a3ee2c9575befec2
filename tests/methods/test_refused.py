# SPDX-License-Identifier: Apache-2.0
"""Methods that do not exist, and scenes that a method cannot advance: both are refused with what to do."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.physics import terms
from tests.laws.cases import CASES, together
from tests.laws.test_parity import VEHICLE
from tests.methods.test_coupled import scene_of as coupled_scene_of

TOLERANCES = {"rtol": 1e-8, "atol": 1e-8}
ESTIMATES_NONE = "estimates no error. Use one of rk5, rk5_ck, rk8, or leave them out"


@pytest.mark.parametrize(("words", "output"), [
    ({"name": "kl8(rk8)"}, "not symmetric"), ({"name": "su4(rkw3)"}, "not symmetric"),
    ({"name": "bm6(phi)"}, "not symmetric"), ({"name": "bm4(psi_1)"}, "divide D"),
    ({"name": "kl6(rkn4_6)"}, "not of order 2"), ({"name": "bm5(psi_x)"}, "Did you mean 'bm"),
    ({"name": "rk6"}, "rk"),
    *(({"name": name} | TOLERANCES, ESTIMATES_NONE) for name in ("rk4", "rkw3", "psi_s", "psi_x")),
    ({"name": "rk8", "rtol": 1e-8}, "is given alone"),
    ({"name": "rk8", "rtol": -1.0, "atol": 1e-8}, "is not between 0 and 1"),
])  # fmt: skip
def test_methods_that_do_not_exist(words, output):
    with pytest.raises(lw.SceneError, match=output):
        lw.Method(**words)


TETHER = terms.Tether(anchor=[0.0, 0.0, 0.0], stiffness=2.0, rest_length=8.0)
DRAG, MATRIX = terms.Drag(quadratic=np.ones(6)), terms.DragMatrix(linear=np.eye(6))
WRENCH = terms.Wrench(force=[1.0, 0.0, 0.0], torque=[0.0, 0.0, 0.0])
NOISE, WANDERING = CASES["wrench noise"].terms[0], CASES["Gauss-Markov current"].terms[0]
ROUGH = together("thrusters", "control fins with rates").terms
NO_POTENTIAL = "needs potentials of position plus those of attitude; {} has none such"


@pytest.mark.parametrize(("method", "inputs", "output"), [
    ("rkn6_14", [TETHER], NO_POTENTIAL.format("tether")),
    ("rkn6_11", [DRAG], NO_POTENTIAL.format("drag")),
    # Nor do compositions take what these laws remember.
    ("rkn4_6", ROUGH, "thrusters has none such. Use psi_s"),
    ("rkn4_6", [WRENCH], NO_POTENTIAL.format("wrench")),
    ("bm4(psi_x)", [MATRIX], "keeps its order only if a step of -h undoes one of h"),
    *(("gauss6", [term], "takes forces of position and time only")
      for term in (DRAG, MATRIX, terms.Current(velocity=[0.1, 0.0, 0.0]), NOISE)),
    *((method, [WANDERING], "gauss_markov_current, a term that remembers what is not known.*Use psi_s")
      for method in ("rk4", "rkmk4", "rkw3")),
    *((method, [term], "noise more than once|undoes one of h")
      for method in ("psi", "psi_1", "tj4(psi_s)") for term in (NOISE, WANDERING)),
    *((lw.Method(name, **TOLERANCES), [NOISE],
       "cannot choose its steps where noise is drawn once a step. Leave out rtol and atol")
      for name in ("rk5", "rk5_ck", "rk8")),
    ("cg3", ROUGH, "before the step's start, where it is not known what thrusters remembers. Use rkmk4"),
    ("kl6(psi_x)", ROUGH, "Use psi_x"),
])  # fmt: skip
def test_laws_that_do_not_fit(method, inputs, output):
    scene = lw.Scene(VEHICLE, lw.Environment(gravity=9.8, water_density=1025.0), terms=list(inputs))
    with pytest.raises(lw.SceneError, match=output):
        lw.solve(scene, method, h=0.1, t1=0.1)


def test_coupled_inertia_does_not_fit():
    with pytest.raises(lw.SceneError, match="cannot advance an inertia that couples velocities and rates"):
        lw.solve(coupled_scene_of(()), "rkn6_11", h=0.1, t1=0.1)


def test_compensated_sums_do_not_fit():
    with pytest.raises(lw.SceneError, match="which rkw3 is not"):
        lw.solve(lw.Scene(VEHICLE, terms=[DRAG]), "rkw3", h=0.1, t1=0.1, dtype="float32_compensated")
