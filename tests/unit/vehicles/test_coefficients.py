# SPDX-License-Identifier: Apache-2.0
"""Importers of hydrodynamic coefficients: Fossen's names, SDF, YAML; signs, axes, and every fault at once."""

import sys

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.extensions.importers import poses as coefficients_poses
from lgvi_warp.vehicles import fossen as co
from lgvi_warp.vehicles import from_fossen, from_sdf, from_yaml
from tests.support.refusals import says

DIAGONAL = {"X_udot": -0.93, "Y_vdot": -35.5, "Z_wdot": -35.5, "K_pdot": -0.0704, "M_qdot": -4.88, "N_rdot": -4.88}
PAIRS = {"Y_rdot": 1.93, "N_vdot": 1.93, "Z_qdot": -1.93, "M_wdot": -1.93}
BODY = {"mass": 30.48, "inertia": (0.177, 3.45, 3.45), "center_of_gravity": (0.0, 0.0, 0.0196)}
HALF_TURN = np.diag([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


def refused(function, *args, count=None, **kwargs):
    """The message of the refusal; count: how many faults it holds."""
    with pytest.raises(lw.SceneError) as caught:
        function(*args, **kwargs)
    assert count is None or len(caught.value.faults) == count, str(caught.value)
    return str(caught.value)


def skew(r):
    return np.cross(r, np.eye(3)).T


# Fossen


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


# SDF

SDF = """<?xml version="1.0"?>
<sdf version="1.10"><model name="auv">
  <link name="fin"><inertial><mass>0.1</mass></inertial></link>
  <link name="base"><inertial>
    <pose{attributes}>{pose}</pose>
    <mass>20.0</mass>
    <inertia><ixx>1</ixx><ixy>0.1</ixy><ixz>0.2</ixz><iyy>2</iyy><iyz>0.3</iyz><izz>3</izz></inertia>
    {added}
  </inertial></link>
  {plugin}
</model></sdf>"""
INERTIA = np.array([[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]])


def sdf(pose="0 0 0 0 0 0", added="", coefficients="", attributes=""):
    plugin = f'<plugin name="gz::sim::systems::Hydrodynamics"><link_name>base</link_name>{coefficients}</plugin>'
    return SDF.format(pose=pose, added=added, plugin=plugin if coefficients else "", attributes=attributes)


def test_sdf_axes_are_turned_by_half_a_turn_about_x():
    """Port becomes starboard and up becomes down: the energy of one motion is the same in both axes."""
    added = "<fluid_added_mass><xx>1</xx><yy>9</yy><zz>8</zz><xz>0.5</xz><yr>-1.5</yr><zq>2</zq><pp>1</pp><qq>3</qq><rr>4</rr>"
    vehicle = from_sdf(sdf("0.1 0.2 0.3 0 0 0", added + "</fluid_added_mass>"))["vehicle"]
    assert vehicle["center_of_gravity"] == [0.1, -0.2, -0.3]
    A = np.diag([1.0, 9.0, 8.0, 1.0, 3.0, 4.0])
    A[0, 2] = A[2, 0] = 0.5
    A[1, 5] = A[5, 1] = -1.5
    A[2, 4] = A[4, 2] = 2.0
    np.testing.assert_array_equal(vehicle["added_mass_matrix"], HALF_TURN @ A @ HALF_TURN)
    S = skew([0.1, 0.2, 0.3])
    M = np.block([[20.0 * np.eye(3), -20.0 * S], [20.0 * S, INERTIA - 20.0 * S @ S]])
    np.testing.assert_allclose(vehicle["rigid_body_mass_matrix"], HALF_TURN @ M @ HALF_TURN, atol=1e-14)
    assert vehicle["weight"] == vehicle["buoyancy"] == 20.0 * 9.80665


@pytest.mark.parametrize("pose,attributes", [
    ("0 0 0 0 0 1.5707963267948966", ""), ("0 0 0 0 0 90", ' degrees="true"'),
    ("0 0 0 0 0 0.7071067811865476 0.7071067811865476", ' rotation_format="quat_xyzw"'),
])  # fmt: skip
def test_sdf_pose_turns_the_inertia(pose, attributes):
    """A quarter of a turn about z: the axis x of the inertia's frame lies along y of the link."""
    M = np.array(from_sdf(sdf(pose, attributes=attributes))["vehicle"]["rigid_body_mass_matrix"])
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    flu = turn @ INERTIA @ turn.T
    np.testing.assert_allclose(M[3:, 3:], HALF_TURN[3:, 3:] @ flu @ HALF_TURN[3:, 3:], atol=1e-14)


def test_rpy_is_yaw_after_pitch_after_roll():
    R = coefficients_poses.rotation_from_rpy(np.array([0.3, -0.4, 0.5]))
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(R[2], [-np.sin(-0.4), np.cos(-0.4) * np.sin(0.3), np.cos(-0.4) * np.cos(0.3)])
    np.testing.assert_allclose(R[:, 0], [np.cos(0.5) * np.cos(-0.4), np.sin(0.5) * np.cos(-0.4), -np.sin(-0.4)])


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("quadratic", ["xUabsU", "xUU"])
def test_the_plugin_in_either_sign(sign, quadratic):
    text = f"<xDotU>{sign * 5}</xDotU><yDotV>{sign * 6}</yDotV><xU>{sign * 2}</xU><{quadratic}>{sign * 7}</{quadratic}>"
    made = from_sdf(sdf(coefficients=text))
    np.testing.assert_array_equal(np.diag(made["vehicle"]["added_mass_matrix"]), [5.0, 6.0, 0.0, 0.0, 0.0, 0.0])
    (term,) = made["terms"]
    assert (term["type"], term["linear"][0], term["quadratic"][0]) == ("drag", 2.0, 7.0)


def test_the_plugins_cross_terms_change_sign_with_the_axes():
    """Y_r r with y to port, r about up, is Y_r r with y to starboard, r about down; Z_q keeps its sign, X_w changes it."""
    text = "<yV>-3</yV><yR>1.5</yR><zQ>2.5</zQ><xW>0.5</xW><yRabsR>0.25</yRabsR>"
    (term,) = from_sdf(sdf(coefficients=text))["terms"]
    linear = np.array(term["linear"])
    assert (linear[1, 1], linear[1, 5], linear[2, 4], linear[0, 2]) == (3.0, -1.5, -2.5, 0.5)
    # With nothing on the diagonal to tell, the signs are Fossen's.
    assert np.array(term["quadratic"])[1, 5] == -0.25


def test_sdf_buoyancy():
    assert from_sdf(sdf(), volume=0.02, water_density=1000.0)["vehicle"]["buoyancy"] == pytest.approx(196.133)
    text = sdf(coefficients="<xU>-1</xU><water_density>1025</water_density>")
    assert from_sdf(text, volume=0.02)["vehicle"]["buoyancy"] == pytest.approx(0.02 * 1025.0 * 9.80665)
    made = from_sdf(sdf(), buoyancy=200.0, center_of_buoyancy=(0.0, 0.1, 0.2))["vehicle"]
    assert (made["buoyancy"], made["center_of_buoyancy"]) == (200.0, [0.0, -0.1, -0.2])


def test_sdf_faults():
    message = refused(from_sdf, sdf("0 0", "<fluid_added_mass><xx>-1</xx></fluid_added_mass>"), count=2)
    says(message, "<pose>", "<fluid_added_mass>")


def test_sdf_from_a_file_and_by_the_name_of_the_link(tmp_path):
    path = tmp_path / "model.sdf"
    path.write_text(sdf(), encoding="utf-8")
    assert from_sdf(path) == from_sdf(str(path)) == from_sdf(sdf(), link="base")


# YAML

UUV = """
mass: 20.0
volume: 0.02
density: 1000.0
cog: [0.1, 0.2, 0.3]
cob: [0.0, 0.0, 0.4]
inertial: {ixx: 1, ixy: 0.1, ixz: 0.2, iyy: 2, iyz: 0.3, izz: 3}
hydrodynamic_model:
  added_mass: [[1,0,0,0,0,0],[0,9,0,0,0,-1.5],[0,0,8,0,2,0],[0,0,0,1,0,0],[0,0,2,0,3,0],[0,-1.5,0,0,0,4]]
  linear_damping: [-1, -2, -3, -4, -5, -6]
  quadratic_damping: [7, 8, 9, 10, 11, 12]
"""


@pytest.fixture
def yaml():
    return pytest.importorskip("yaml")


def test_yaml_positions_are_flu_and_matrices_frd(yaml):
    made = from_yaml(UUV)
    vehicle, (term,) = made["vehicle"], made["terms"]
    assert (vehicle["center_of_gravity"], vehicle["center_of_buoyancy"]) == ([0.1, -0.2, -0.3], [0.0, 0.0, -0.4])
    assert np.array(vehicle["added_mass_matrix"])[1, 5] == -1.5
    assert np.array(vehicle["added_mass_matrix"])[2, 4] == 2.0
    assert vehicle["buoyancy"] == pytest.approx(0.02 * 1000.0 * 9.80665)
    assert term == {"type": "drag", "linear": [1.0, 2, 3, 4, 5, 6], "quadratic": [7.0, 8, 9, 10, 11, 12]}
    assert vehicle["rigid_body_mass_matrix"] == from_sdf(sdf("0.1 0.2 0.3 0 0 0"))["vehicle"]["rigid_body_mass_matrix"]


def test_yaml_axes_can_be_named(yaml):
    vehicle = from_yaml(UUV, position_axes="frd", matrix_axes="flu")["vehicle"]
    assert vehicle["center_of_gravity"] == [0.1, 0.2, 0.3]
    # Y_r, Z_q: both axes change sign, the product does not.
    assert np.array(vehicle["added_mass_matrix"])[1, 5] == -1.5
    assert "position_axes" in refused(from_yaml, UUV, position_axes="ned", count=1)


def test_yaml_with_fossens_names(yaml):
    head = "mass: 30.48\ninertia: [0.177, 3.45, 3.45]\n"
    flat = head + "".join(f"{key}: {value}\n" for key, value in (DIAGONAL | PAIRS).items())
    nested = head + "coefficients:\n" + "".join(f"  {key}: {value}\n" for key, value in (DIAGONAL | PAIRS).items())
    expected = from_fossen(DIAGONAL | PAIRS, mass=30.48, inertia=(0.177, 3.45, 3.45))
    assert from_yaml(flat) == from_yaml(nested) == expected


def test_yaml_faults(yaml):
    message = refused(from_yaml, "volume: 0.02\nmas: 3\nlinear_damping: [1, 2]\nMa: [1, -1, 1, 1, 1, 1]\n")
    for key in ("mass", "inertia", "mas = 3", "density", "linear", "both signs"):
        assert key in message
    assert from_yaml(UUV + "thrusters: 4\n", ignore=["thrusters"]) == from_yaml(UUV)
    assert from_yaml(UUV, mass=21.0)["vehicle"]["weight"] == 21.0 * 9.80665


def test_without_pyyaml_the_message_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(ImportError, match="pip install"):
        from_yaml(UUV)


# Round trip


def test_the_three_forms_agree(yaml):
    """One vehicle, written in each form."""
    added = "".join(f"<{n}>{v}</{n}>" for n, v in (("xx", 0.93), ("yy", 35.5), ("zz", 35.5), ("pp", 0.0704)))
    added += "<qq>4.88</qq><rr>4.88</rr><yr>-1.93</yr><zq>1.93</zq>"
    text = sdf("0 0 -0.0196 0 0 0", f"<fluid_added_mass>{added}</fluid_added_mass>", "<xUabsU>-1.62</xUabsU>")
    tables_sdf = from_sdf(text)
    given = {"mass": 20.0, "inertia": HALF_TURN[3:, 3:] @ INERTIA @ HALF_TURN[3:, 3:], "inertia_about": "gravity"}
    center = {"center_of_gravity": (0.0, 0.0, 0.0196)}
    tables_fossen = from_fossen(DIAGONAL | PAIRS | {"X_uu": -1.62}, **given, **center)
    assert tables_sdf["terms"] == tables_fossen["terms"]
    for key, value in tables_fossen["vehicle"].items():
        np.testing.assert_allclose(tables_sdf["vehicle"][key], value, atol=1e-15, err_msg=key)
    content = {key: np.asarray(value).tolist() for key, value in tables_fossen["vehicle"].items()}
    text = yaml.safe_dump({"mass": 20.0, "inertia": INERTIA.tolist(), "cog": [0.0, 0.0, -0.0196],
                           "added_mass": content["added_mass_matrix"],
                           "quadratic_damping": [-1.62, 0.0, 0.0, 0.0, 0.0, 0.0]})  # fmt: skip
    tables_yaml = from_yaml(text)
    assert tables_yaml["terms"] == tables_fossen["terms"]
    for key, value in tables_fossen["vehicle"].items():
        np.testing.assert_allclose(tables_yaml["vehicle"][key], value, atol=1e-15, err_msg=key)


def test_the_dict_makes_a_vehicle():
    given = from_fossen(DIAGONAL | PAIRS, **BODY)["vehicle"]
    np.testing.assert_array_equal(lw.Vehicle(**given).added_mass_matrix, given["added_mass_matrix"])


def test_a_scene_from_what_an_importer_returns():
    given = {"X_udot": -1.0, "Y_vdot": -2.0, "Z_wdot": -2.0, "X_u": -3.0}
    tables = from_fossen(given, mass=10.0, inertia=[0.1, 0.5, 0.5])
    scene = lw.Scene.from_dict(tables)
    assert [term.type for term in scene.terms] == ["drag"]
    np.testing.assert_array_equal(scene.terms[0].linear, [3.0, 0.0, 0.0, 0.0, 0.0, 0.0])
