# SPDX-License-Identifier: Apache-2.0
"""Hydrodynamic coefficients in Fossen's names: signs, axes, and every fault at once."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.vehicles import fossen as co
from lgvi_warp.vehicles import from_fossen

DIAGONAL = {"X_udot": -0.93, "Y_vdot": -35.5, "Z_wdot": -35.5, "K_pdot": -0.0704, "M_qdot": -4.88, "N_rdot": -4.88}
PAIRS = {"Y_rdot": 1.93, "N_vdot": 1.93, "Z_qdot": -1.93, "M_wdot": -1.93}
BODY = {"mass": 30.48, "inertia": (0.177, 3.45, 3.45), "center_of_gravity": (0.0, 0.0, 0.0196)}


def refused(function, *args, count=None, **kwargs):
    """The message of the refusal; count: how many faults it holds."""
    with pytest.raises(lw.SceneError) as caught:
        function(*args, **kwargs)
    assert count is None or len(caught.value.faults) == count, str(caught.value)
    return str(caught.value)


def skew(r):
    return np.cross(r, np.eye(3)).T


def test_added_mass_is_minus_the_derivatives():
    vehicle = from_fossen(DIAGONAL | PAIRS, **BODY)["vehicle"]
    A = np.diag([0.93, 35.5, 35.5, 0.0704, 4.88, 4.88])
    A[1, 5] = A[5, 1] = -1.93
    A[2, 4] = A[4, 2] = 1.93
    np.testing.assert_array_equal(vehicle["added_mass_matrix"], A)


@pytest.mark.parametrize("left_out", [("Y_rdot", "Z_qdot"), ("N_vdot", "M_wdot")])
def test_one_of_a_pair_suffices(left_out):
    fewer = {key: value for key, value in PAIRS.items() if key not in left_out}
    assert from_fossen(DIAGONAL | fewer, **BODY) == from_fossen(DIAGONAL | PAIRS, **BODY)


def test_rigid_body_matrix_about_the_origin():
    """Kinetic energy of the two point masses that make the body, 1/2 m |v + w x r|^2, against 1/2 nu.M nu."""
    rng = np.random.default_rng(0)
    m, r, nu = np.array([2.0, 3.0, 1.5, 0.7]), rng.normal(size=(4, 3)), rng.normal(size=6)
    center = m @ r / m.sum()
    about_origin = sum(mi * skew(ri).T @ skew(ri) for mi, ri in zip(m, r, strict=True))
    about_center = sum(mi * skew(ri - center).T @ skew(ri - center) for mi, ri in zip(m, r, strict=True))
    energy = 0.5 * sum(mi * np.sum((nu[:3] + np.cross(nu[3:], ri)) ** 2) for mi, ri in zip(m, r, strict=True))
    for about, inertia in (("origin", about_origin), ("gravity", about_center)):
        made = from_fossen({}, mass=m.sum(), inertia=inertia, center_of_gravity=center, inertia_about=about)
        M = np.array(made["vehicle"]["rigid_body_mass_matrix"])
        np.testing.assert_allclose(0.5 * nu @ M @ nu, energy, rtol=1e-13)


@pytest.mark.parametrize(
    "name", ["X_udot", "Xudot", "X_du", "Xdu", "X_{\\dot u}", "X_{\\dot{u}}", "X_u_dot", "X_dot_u"]
)
def test_spellings_of_added_mass(name):
    assert np.array(from_fossen({name: -2.5}, **BODY)["vehicle"]["added_mass_matrix"])[0, 0] == 2.5


@pytest.mark.parametrize("name", ["X_uu", "X_u|u|", "Xuu", "X_{u|u|}", "X_{|u|u}", "X_|u|u", "Xuabsu", "X_{uu}"])
def test_spellings_of_quadratic_drag(name):
    (term,) = from_fossen({name: -1.62}, **BODY)["terms"]
    assert term == {"type": "drag", "linear": [0.0] * 6, "quadratic": [1.62, 0.0, 0.0, 0.0, 0.0, 0.0]}


@pytest.mark.parametrize("row,force", list(enumerate("XYZKMN")))
@pytest.mark.parametrize("column,velocity", list(enumerate("uvwpqr")))
def test_every_name_finds_its_place(row, force, column, velocity):
    assert co.read_name(f"{force}_{velocity}dot") == co.Name("dot", row, (column,))
    assert co.read_name(f"{force}_{velocity}") == co.Name("linear", row, (column,))
    assert co.read_name(f"{force}_|{velocity}|{velocity}") == co.Name("quadratic", row, (column, column))


NO_NAMES = ("", "X", "Q_u", "X_t", "X_uvw", "mass", "X_prop", "Y_uudr", "xudot")
# Derivatives that are refused: name -> value, words, and whether the name may be left out.
REFUSED = (
    {name: (-1.0, (f"{name} = -1.0",), False) for name in NO_NAMES}
    | {name: (3.0, (f"{name} = 3.0", "Fossen", "-3"), False) for name in (*DIAGONAL, "X_u", "N_r", "X_uu", "N_r|r|")}
    # Prestero's X_qq q^2 belongs to the added mass; read as |q| q it would push back for one sign of q only.
    | {name: (-1.93, ("|",), True) for name in ("X_qq", "X_vv", "M_rr")}
    | {name: (1.0, ("product",), True) for name in ("Y_uv", "X_wq", "Y_v|r|")}
)


@pytest.mark.parametrize("name", REFUSED)
def test_a_derivative_is_refused(name):
    value, words, spare = REFUSED[name]
    message = refused(from_fossen, {name: value}, count=1, **BODY)
    assert [word for word in words if word not in message] == []
    assert (co.read_name(name) is None) == (name in NO_NAMES)
    if spare:
        assert from_fossen({name: value}, ignore=[name], **BODY)["terms"] == []


def test_cross_terms_become_matrices():
    (term,) = from_fossen({"Y_v|v|": -1310.0, "Y_rr": 0.632, "N_r": -2.0, "M_ww": 3.18}, **BODY)["terms"]
    assert term["type"] == "drag_matrix"
    quadratic = np.array(term["quadratic"])
    assert (quadratic[1, 1], quadratic[1, 5], quadratic[4, 2]) == (1310.0, -0.632, -3.18)
    assert (np.array(term["linear"])[5, 5], np.count_nonzero(quadratic)) == (2.0, 3)


def test_without_drag_there_is_no_term():
    assert from_fossen(DIAGONAL, **BODY)["terms"] == []


def test_all_faults_of_a_map_come_at_once():
    given = {"X_udot": 0.93, "Y_uv": -28.6, "Q": 1.0, "X_uu": float("nan"), "N_r": "no"}
    message = refused(from_fossen, given, mass=-1.0, inertia=(1.0, 1.0), count=7)
    for key in (*given, "mass", "inertia"):
        assert f"{key} = " in message


def test_a_sum_that_is_not_positive_definite_is_refused():
    assert "positive definite" in refused(from_fossen, {"X_udot": -1.0, "X_vdot": -50.0}, **BODY)
    # About the origin 1 kg 2 m off the centre of gravity the inertia is at least 4 kg m2: 3 was meant about the other point.
    off = {"mass": 1.0, "inertia": (3.0, 3.0, 3.0), "center_of_gravity": (2.0, 0.0, 0.0)}
    assert "positive definite" in refused(from_fossen, {}, **off)
    from_fossen({}, inertia_about="gravity", **off)
    assert "inertia_about" in refused(from_fossen, {}, inertia_about="CG", count=1, **BODY)


def test_weight_and_buoyancy():
    vehicle = from_fossen({}, gravity=9.8, **BODY)["vehicle"]
    assert vehicle["weight"] == vehicle["buoyancy"] == 30.48 * 9.8
    vehicle = from_fossen({}, weight=299.0, buoyancy=308.0, **BODY)["vehicle"]
    assert (vehicle["weight"], vehicle["buoyancy"]) == (299.0, 308.0)


def test_the_dict_makes_a_vehicle():
    given = from_fossen(DIAGONAL | PAIRS, **BODY)["vehicle"]
    np.testing.assert_array_equal(lw.Vehicle(**given).added_mass_matrix, given["added_mass_matrix"])


def test_a_scene_from_what_an_importer_returns():
    given = {"X_udot": -1.0, "Y_vdot": -2.0, "Z_wdot": -2.0, "X_u": -3.0}
    tables = from_fossen(given, mass=10.0, inertia=[0.1, 0.5, 0.5])
    scene = lw.Scene.from_dict(tables)
    assert [term.type for term in scene.terms] == ["drag"]
    np.testing.assert_array_equal(scene.terms[0].linear, [3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
