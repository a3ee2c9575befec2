# SPDX-License-Identifier: Apache-2.0
"""Readers of hydrodynamic coefficients: SDF and YAML; signs, axes, and every fault at once."""

import sys

import numpy as np
import pytest

from lgvi_warp.extensions.importers import poses as coefficients_poses
from lgvi_warp.vehicles import from_fossen, from_sdf, from_yaml
from tests.support.refusals import says
from tests.unit.vehicles.test_coefficients import DIAGONAL, PAIRS, refused, skew

HALF_TURN = np.diag([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
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
