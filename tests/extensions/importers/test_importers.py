# SPDX-License-Identifier: Apache-2.0
"""Importers of robot descriptions against Gazebo's own equations: restoring forces, inertia, damping; and hostile files."""

import dataclasses
import itertools
import os
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lgvi_warp as lw
from lgvi_warp.extensions.importers import robot_xml as coefficients_xml
from lgvi_warp.results.provenance import messages
from lgvi_warp.runs.settle import make_plan
from lgvi_warp.vehicles import from_fossen, from_sdf, from_yaml
from tests.support import righting
from tests.support.refusals import refused, says
from tests.support.tools import one

FILES = Path(__file__).parents[2] / "data" / "vehicles"
MAIN = {"frame_rov": "base_link", "long_auv": "hull"}
SIX = np.kron(np.eye(2), righting.DOWN)  # velocities and forces: z up <-> z down
RNG = np.random.default_rng(5)


def warnings_of(tables):
    return " | ".join(tables["vehicle"].get("warnings", ()))


# Restoring forces


@pytest.mark.parametrize("name", MAIN)
def test_restoring_forces_are_gazebos(name):
    """Force and torque about the main link's origin, at attitudes of any kind, in a computation of the test's own."""
    tables = from_sdf(FILES / f"{name}.sdf")
    water = tables["environment"]
    theirs = righting.of_sdf(FILES / f"{name}.sdf", name, MAIN[name], water["water_density"], water["gravity"])
    attitudes = Rotation.random(20, random_state=1).as_matrix()
    np.testing.assert_allclose(
        righting.moments(righting.of_tables(tables), attitudes), righting.moments(theirs, attitudes), atol=1e-10
    )
    assert sum(up for _, up in righting.of_tables(tables)) == pytest.approx(sum(up for _, up in theirs), abs=1e-10)


@pytest.mark.parametrize("read,file", [(from_sdf, "frame_rov.sdf"), (from_sdf, "long_auv.sdf"),
                                       (from_sdf, "survey_auv.urdf"), (from_yaml, "survey_auv.yaml")])  # fmt: skip
def test_vehicles_float_upright(read, file):
    if read is from_yaml:
        pytest.importorskip("yaml")
    tables = read(FILES / file)
    forces, tilts = righting.of_tables(tables), righting.tilts()
    stiffness = righting.about_gravity(forces, tilts) - righting.about_gravity(forces, tilts.transpose(0, 2, 1))
    assert np.all(np.diag(stiffness) < 0.0)
    assert lw.Scene.from_dict(tables).environment.water_density == tables["environment"]["water_density"]


def test_the_world_gives_gravity_and_density():
    assert from_sdf(FILES / "frame_rov.sdf")["environment"] == {"gravity": 9.81, "water_density": 1021.0}
    world = "<sdf><world><gravity>0 0 -1.6</gravity><plugin name='gz::sim::systems::Buoyancy'/></world></sdf>"
    moon = from_sdf(FILES / "long_auv.sdf", world=world)
    assert moon["environment"] == {"gravity": 1.6, "water_density": 1000.0}
    earth = from_sdf(FILES / "long_auv.sdf")
    assert moon["vehicle"]["buoyancy"] / earth["vehicle"]["buoyancy"] == pytest.approx(1.6 / 9.80665)
    given = from_sdf(FILES / "frame_rov.sdf", water_density=1000.0, gravity=9.8)
    assert given["environment"] == {"gravity": 9.8, "water_density": 1000.0}


def test_a_model_that_buoyancy_is_not_enabled_for_sinks():
    text = (FILES / "frame_rov.sdf").read_text().replace("<enable>frame_rov", "<enable>other")
    tables = from_sdf(text)
    assert tables["vehicle"]["buoyancy"] == 0.0
    assert "other alone" in warnings_of(tables)


# Inertia


@pytest.mark.parametrize("name", MAIN)
def test_inertia_is_that_of_all_links(name):
    """The kinetic energy of the links one by one, each moving with the body, against 1/2 nu.M nu."""
    model = next(m for m in righting.tree(FILES / f"{name}.sdf").iter("model") if m.get("name") == name)
    place = righting.frames(model, np.eye(4))
    to_main = np.linalg.inv(place[MAIN[name]])
    tables = from_sdf(FILES / f"{name}.sdf")["vehicle"]
    M = np.array(tables["rigid_body_mass_matrix"])
    for nu in RNG.normal(size=(5, 6)):
        v, w = nu[:3], nu[3:]
        energy = 0.0
        for link, element in righting.links(model):
            T = to_main @ place[link] @ righting.matrix(element.find("inertial/pose"))
            named = {f"i{a}{b}": float(element.findtext(f"inertial/inertia/i{a}{b}") or 0.0)
                     for a, b in itertools.combinations_with_replacement("xyz", 2)}  # fmt: skip
            J = np.array([[named["".join(("i", *sorted((a, b))))] for b in "xyz"] for a in "xyz"])
            w_link, v_link = T[:3, :3].T @ w, v + np.cross(w, T[:3, 3])
            energy += 0.5 * float(element.findtext("inertial/mass")) * v_link @ v_link + 0.5 * w_link @ J @ w_link
        np.testing.assert_allclose(0.5 * (SIX @ nu) @ M @ (SIX @ nu), energy, rtol=1e-12)


def test_added_mass_of_a_fixed_link_moves_with_it():
    """Half v.A v of the camera's own water, at the velocity that the camera has when the body moves."""
    model = next(m for m in righting.tree(FILES / "frame_rov.sdf").iter("model") if m.get("name") == "frame_rov")
    T = np.linalg.inv(righting.frames(model, np.eye(4))["base_link"]) @ righting.frames(model, np.eye(4))["camera"]
    text = (FILES / "frame_rov.sdf").read_text()
    A = np.array(from_sdf(text.replace("DotU>-5<", "DotU>0<").replace("DotV>-7<", "DotV>0<").replace("DotW>-14<", "DotW>0<")
                             .replace(">-0.1</", ">0</"))["vehicle"]["added_mass_matrix"])  # fmt: skip
    for nu in RNG.normal(size=(3, 6)):
        v = T[:3, :3].T @ (nu[:3] + np.cross(nu[3:], T[:3, 3]))
        np.testing.assert_allclose((SIX @ nu) @ A @ (SIX @ nu), v @ np.diag([0.1, 0.2, 0.2]) @ v, atol=1e-13)


# Damping


def damping(tables, nu):
    """Force and torque (6,) of the drag and lift terms of a scene at the velocity nu (6,), z down."""
    total = np.zeros(6)
    for term in tables["terms"]:
        if term["type"] == "body_lift":
            total -= nu[0] * np.array(term["matrix"]) @ nu
        elif term["type"] in ("drag", "drag_matrix"):
            L, Q = (np.array(term[key]) for key in ("linear", "quadratic"))
            L, Q = (np.diag(x) if x.ndim == 1 else x for x in (L, Q))
            total -= (L + Q * np.abs(nu)) @ nu
    return total


def gazebo_damping(plugin, nu):
    """force_i = sum_j (X_j + X_j|j| |v_j|) v_j of gz-sim's Hydrodynamics, axes z up, Fossen's signs; xUU as |v| v."""
    total = np.zeros(6)
    for (i, force), (j, speed) in itertools.product(enumerate("xyzkmn"), enumerate("UVWPQR")):
        linear = float(plugin.findtext(f"{force}{speed}") or 0.0)
        quadratic = float(plugin.findtext(f"{force}{speed}abs{speed}") or 0.0)
        total[i] += (linear + quadratic * abs(nu[j])) * nu[j]
    return total


CROSS = ("<xU>-3</xU><yV>-30</yV><zW>-31</zW><kP>-1</kP><mQ>-10</mQ><nR>-11</nR><yR>2</yR><nV>1.5</nV>"
         "<zQ>-2.5</zQ><mW>0.7</mW><xW>0.3</xW><yP>0.2</yP><xUabsU>-7</xUabsU><yVabsV>-50</yVabsV><nRabsR>-4</nRabsR><yRabsR>0.25</yRabsR>"
         "<mWabsW>0.6</mWabsW><zWabsW>-60</zWabsW><mQabsQ>-5</mQabsQ><kPabsP>-1</kPabsP>")  # fmt: skip


def with_plugin(coefficients):
    text = (FILES / "frame_rov.sdf").read_text()
    start, end = text.index("<xDotU>"), text.index("</zWabsW>") + len("</zWabsW>")
    return text[:start] + coefficients + text[end:]


def test_damping_is_gazebos_with_every_sign():
    plugin = righting.ElementTree.fromstring(f"<plugin>{CROSS}</plugin>")
    tables = from_sdf(with_plugin(CROSS))
    for nu in RNG.normal(size=(6, 6)):
        np.testing.assert_allclose(SIX @ damping(tables, SIX @ nu), gazebo_damping(plugin, nu), atol=1e-12)


def test_added_mass_given_twice_is_refused():
    twice = link(outside="<plugin name='Hydrodynamics'><link_name>hull</link_name><xDotU>-1</xDotU>{}</plugin>")
    twice = twice.replace("</mass>", "</mass><fluid_added_mass><xx>1</xx></fluid_added_mass>")
    assert "both give added mass" in refused(from_sdf, twice.replace("{}", ""))
    off = from_sdf(twice.replace("{}", "<disable_added_mass>true</disable_added_mass>"))
    assert np.count_nonzero(off["vehicle"]["added_mass_matrix"]) == 1


def test_coefficients_of_another_link_are_moved_or_refused():
    """Linear damping and added mass of a fixed link in front act about the main link as well; quadratic has no such form."""
    front = "<link name='front'><pose>1 0 0 0 0 0</pose><inertial><mass>1</mass></inertial></link>"
    front += "<joint name='j' type='fixed'><parent>hull</parent><child>front</child></joint>"
    front += "<plugin name='Hydrodynamics'><link_name>front</link_name><yV>-3</yV><yDotV>-2</yDotV>{}</plugin>"
    tables = from_sdf(link(outside=front), link="hull")
    (term,) = tables["terms"]
    expected = np.zeros((6, 6))
    expected[np.ix_([1, 5], [1, 5])] = 1.0
    np.testing.assert_allclose(term["linear"], 3.0 * expected, atol=1e-15)
    np.testing.assert_allclose(tables["vehicle"]["added_mass_matrix"], 2.0 * expected, atol=1e-15)
    quadratic = front.replace("{}", "<yVabsV>-1</yVabsV>")
    assert "another point" in refused(from_sdf, link(outside=quadratic), link="hull")
    assert from_sdf(link(outside=quadratic))["terms"][0]["quadratic"][1] == 1.0


def test_added_mass_beside_the_diagonal_keeps_its_energy():
    text = "<xDotU>-5</xDotU><yDotV>-7</yDotV><zDotW>-8</zDotW><kDotP>-1</kDotP><mDotQ>-2</mDotQ><nDotR>-2</nDotR>"
    text += (
        "<yDotR>0.5</yDotR><nDotV>0.5</nDotV><xDotW>0.3</xDotW><zDotU>0.3</zDotU><xDotQ>-0.2</xDotQ><mDotU>-0.2</mDotU>"
    )
    flu = -np.diag([-5.0, -7, -8, -1, -2, -2])
    for i, j, value in ((1, 5, 0.5), (0, 2, 0.3), (0, 4, -0.2)):
        flu[i, j] = flu[j, i] = -value
    camera = "<fluid_added_mass><xx>0.1</xx><yy>0.2</yy><zz>0.2</zz></fluid_added_mass>"
    A = np.array(from_sdf(with_plugin(text).replace(camera, ""))["vehicle"]["added_mass_matrix"])
    for nu in RNG.normal(size=(4, 6)):
        np.testing.assert_allclose((SIX @ nu) @ A @ (SIX @ nu), nu @ flu @ nu, rtol=1e-12)


def uuv_damping(read, nu):
    """-D nu of uuv_simulator, axes z down: D = -D_linear - u D_forward - |nu| by the diagonal of the quadratic matrix."""
    forward, quadratic = np.array(read["linear_damping_forward_speed"], float), np.array(read["quad_damping"], float)
    return (nu[0] * forward + np.diag(np.diag(quadratic) * np.abs(nu))) @ nu


def test_damping_is_uuv_simulators():
    yaml = pytest.importorskip("yaml")
    read = yaml.safe_load((FILES / "survey_auv.yaml").read_text())
    tables, by_plugin = from_yaml(FILES / "survey_auv.yaml"), from_sdf(FILES / "survey_auv.urdf")
    for nu in RNG.normal(size=(6, 6)):
        np.testing.assert_allclose(damping(tables, nu), uuv_damping(read, nu), atol=1e-12)
        np.testing.assert_allclose(damping(by_plugin, nu), uuv_damping(read, nu), atol=1e-12)
    assert "by its diagonal" in warnings_of(tables)
    full = from_yaml(FILES / "survey_auv.yaml", quadratic="full")["terms"][0]
    np.testing.assert_array_equal(full["quadratic"], -np.array(read["quad_damping"]))


def test_the_plugin_of_a_urdf_gives_the_vehicle_of_the_yaml_file():
    pytest.importorskip("yaml")
    by_file, by_plugin = from_yaml(FILES / "survey_auv.yaml"), from_sdf(FILES / "survey_auv.urdf")
    for key in ("weight", "buoyancy", "center_of_buoyancy", "added_mass_matrix", "center_of_gravity"):
        np.testing.assert_allclose(by_plugin["vehicle"][key], by_file["vehicle"][key], rtol=1e-12, err_msg=key)
    np.testing.assert_allclose(by_plugin["vehicle"]["rigid_body_mass_matrix"], by_file["vehicle"]["rigid_body_mass_matrix"],
                               atol=1e-3)  # fmt: skip
    assert by_file["environment"] == by_plugin["environment"]


def test_a_current_is_turned_from_east_north_up():
    terms = from_sdf(FILES / "long_auv.sdf")["terms"]
    assert {"type": "current", "velocity": [0.1, 0.2, 0.0]} in terms


def test_a_controllers_gain_is_no_drag():
    controller = "<plugin name='controller'><kP>12</kP><kI>1</kI></plugin>"
    assert from_sdf(link(outside=controller))["terms"] == []


# Shapes

VOLUMES = {"<box><size>1 2 3</size></box>": 6.0, "<box/>": 1.0, "<sphere><radius>0.5</radius></sphere>": np.pi / 6.0,
           "<cylinder><radius>0.5</radius><length>2</length></cylinder>": np.pi / 2.0,
           "<capsule><radius>0.5</radius><length>2</length></capsule>": np.pi / 2.0 + np.pi / 6.0,
           "<ellipsoid><radii>1 2 3</radii></ellipsoid>": 8.0 * np.pi,
           "<cone><radius>0.5</radius><length>3</length></cone>": np.pi / 4.0}  # fmt: skip
LINK = """<sdf version="1.9"><model name="m"><link name="hull">
  <inertial><mass>{mass}</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz></inertia></inertial>
  <collision name="shape"><pose>0.1 0.2 0.3 0.4 0.5 0.6</pose><geometry>{shape}</geometry></collision>{more}
</link>{outside}</model></sdf>"""


def link(shape="<box/>", mass="20", more="", outside=""):
    return LINK.format(shape=shape, mass=mass, more=more, outside=outside)


@pytest.mark.parametrize("shape", VOLUMES)
def test_volumes_of_shapes(shape):
    tables = from_sdf(link(shape), gravity=10.0)
    assert tables["vehicle"]["buoyancy"] == pytest.approx(1e4 * VOLUMES[shape], rel=1e-14)
    np.testing.assert_allclose(tables["vehicle"]["center_of_buoyancy"], [0.1, -0.2, -0.3])


def test_shapes_in_other_files_need_a_volume():
    mesh = "<mesh><uri>model://hull.dae</uri></mesh>"
    message = refused(from_sdf, link(mesh))
    says(message, "hull <collision> = 'shape'", "Give volume=")
    tables = from_sdf(link(mesh), volume=0.02, center_of_buoyancy=(0.0, 0.0, 0.1))
    assert tables["vehicle"]["buoyancy"] == pytest.approx(0.02 * 1000.0 * 9.80665)
    assert from_sdf(link(mesh), buoyancy=200.0)["vehicle"]["buoyancy"] == 200.0
    plane = from_sdf(link("<plane/>"))["vehicle"]
    assert plane["buoyancy"] == plane["weight"]
    assert "no collision shape displaces water" in warnings_of({"vehicle": plane})


# What is refused


NAMED = '<link name="{}"><inertial><mass>{}</mass></inertial></link>'
BATTERY = NAMED.format("battery", 5)
XACRO = '<robot xmlns:xacro="x"><xacro:property name="mass" value="3"/><link name="a"/></robot>'
SPHERE = (
    "<plugin name='uuv'><link name='a'><hydrodynamic_model><type>sphere</type></hydrodynamic_model></link></plugin>"
)
URDF = f"<robot><link name='a'><inertial><mass value='3'/></inertial></link><gazebo>{SPHERE}</gazebo></robot>"
TWO = "".join(f'<model name="{name}">{NAMED.format("l", 1)}</model>' for name in "ab")
LOOP = '<frame name="f"><pose relative_to="g"/></frame><frame name="g"><pose relative_to="f"/></frame>'
PLACED = '<link name="x"><pose relative_to="f">0 0 0 0 0 0</pose></link>'
CHAIN = "".join(f'<frame name="f{i}"><pose relative_to="f{i + 1}"/></frame>' for i in range(1500))
ARMS = "".join(f"<model name='{name}'><link name='a'/></model>" for name in "xy")


def no_mass(text, remedy):
    """Even where another link has one: that is a battery, not the vehicle."""
    return link(mass=text, outside=BATTERY), ("hull <mass>", remedy)


def circle(names):
    """A chain of joints that leads back to a link, to itself at once too; nothing looks for its pose for ever."""
    joint = "<joint name='{0}{1}' type='fixed'><parent link='{0}'/><child link='{1}'/></joint>"
    links = "".join(f"<link name='{name}'/>" for name in names)
    joints = "".join(joint.format(*ends) for ends in zip(names, names[1:] + names[0], strict=True))
    return f"<robot name='r'>{links}{joints}</robot>", ("is above itself",)


# Text, words of its refusal, and settings.
REFUSED = {
    "a mass to calculate": no_mass("@calculated", "Generate the file"),
    "a mass of xacro's": no_mass("${mass}", "xacro"),
    "a mass of Jinja's": no_mass("{{ mass }}", "Jinja"),
    "a mass in words": no_mass("about 20", "Write a finite"),
    "a mass of nan": no_mass("nan", "a finite number"),
    "a mass of 1e999": no_mass("1e999", "a finite number"),
    "a mass of 2_0": no_mass("2_0", "a finite number"),
    "an empty mass": no_mass("", "Give the mass"),
    "a negative mass": (link(outside=NAMED.format("b", -1)), ("is negative",)),
    "a template": ("<sdf><%= mass %></sdf>", ("erb",)),
    "xacro": (XACRO, ('xacro:property name="mass"', "not executed", "Run xacro")),
    "a type that is not read": (URDF, ("a <type> = 'sphere'",)),
    "a property of xacro's": (URDF.replace("'3'", "'${m}'"), ("${m}",)),
    "several models": (f"<sdf><world>{TWO}</world></sdf>", ("several: a, b", "model=")),
    "no such model": (f"<sdf>{TWO}</sdf>", ("Known: a, b",), {"model": "rov"}),
    "what it includes": (
        "<sdf><world><include><uri>model://rov</uri></include></world></sdf>",
        ("includes model://rov",),
    ),
    "several links": (link(outside=ARMS), ("several: x::a, y::a",), {"link": "a"}),
    "frames in a circle": (link(outside=LOOP + PLACED), ("relative to itself",)),
    "a frame that there is not": (link(outside=PLACED.replace('"f"', '"nowhere"')), ("not a frame of the model",)),
    "frames without end": (link(outside=CHAIN + PLACED.replace('"f"', '"f0"')), ("relative",)),
    "a joint to itself": circle("a"),
    "two joints in a circle": circle("ab"),
    "three joints in a circle": circle("abc"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_model_is_refused(name):
    text, words, *settings = REFUSED[name]
    message = refused(from_sdf, text, **(settings[0] if settings else {}))
    assert [word for word in words if word not in message] == []
    if "hull <mass>" in words:
        assert "\n" not in message


def test_a_model_of_several_is_chosen_and_what_it_includes_is_left_out():
    assert from_sdf(f"<sdf><world>{TWO}</world></sdf>", model="b")["vehicle"]["weight"] == 9.8
    assert "model://arm" in warnings_of(from_sdf(link(outside="<include><uri>model://arm</uri></include>")))


def test_frames_attached_in_a_circle_are_read():
    attached = '<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>'
    joint = '<joint name="j" type="fixed"><parent>hull</parent><child>f</child></joint>'
    from_sdf(link(outside=attached + joint))


ENTITIES = "".join(f'<!ENTITY e{i + 1} "' + f"&e{i};" * 10 + '">' for i in range(10))
HOSTILE = {
    "entities that grow": f'<!DOCTYPE sdf [<!ENTITY e0 "ha">{ENTITIES}]><sdf>&e10;</sdf>',
    "an entity of another file": '<!DOCTYPE sdf [<!ENTITY x SYSTEM "file:///etc/hostname">]><sdf>&x;</sdf>',
    "a document type elsewhere": '<!DOCTYPE sdf SYSTEM "http://127.0.0.1:9/x.dtd"><sdf/>',
    "an entity that nobody declares": "<sdf>&x;</sdf>",
    "100,000 levels": "<a>" * 100_000 + "</a>" * 100_000,
    "a million elements": "<sdf>" + "<a/>" * 1_000_000 + "</sdf>",
    "20 MiB of text": "<sdf>" + " " * (20 * 2**20) + "</sdf>",
    "100,000 attributes": "<sdf " + " ".join(f'a{i}="1"' for i in range(100_000)) + "/>",
    "links in crowds": "<sdf><model>" + "".join(f"<link name='l{i}'/>" for i in range(50_000)) + "</model></sdf>",
    "shapes in crowds": link(
        outside="<link name='b'>" + "<collision name='c'><geometry/></collision>" * 40_000 + "</link>"
    ),
    "joints in crowds": link(outside="<joint name='j'/>" * 50_000),
    "a NUL": "<sdf>\0</sdf>",
    "an end that is missing": "<sdf><model>",
    "nested models": "<sdf>" + "<model name='m'>" * 190 + "</model>" * 190 + "</sdf>",
    "not SDF": "<svg/>",
}


def seconds_of(action):
    """Processor time of this thread [s], and the result; others of this process may be at work."""
    began = time.thread_time()
    value = action()
    return time.thread_time() - began, value


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_xml_is_refused_in_time(name):
    # Beside a plain parse of 100,000 elements: a busy machine slows both.
    plain, _ = seconds_of(lambda: ElementTree.fromstring("<a>" + "<b c='d'/>" * 100_000 + "</a>"))
    refusal, message = seconds_of(lambda: refused(from_sdf, HOSTILE[name]))
    assert refusal < 25.0 * plain
    assert len(message) < 2_000
    assert "\n" not in message


def test_hostile_files_are_refused(tmp_path):
    (tmp_path / "latin.sdf").write_bytes(b'<?xml version="1.0" encoding="klingon"?><sdf/>')
    (tmp_path / "bytes.sdf").write_bytes(bytes(range(256)))
    os.mkfifo(tmp_path / "pipe.sdf")
    for path in (tmp_path, tmp_path / "none.sdf", tmp_path / "latin.sdf", tmp_path / "bytes.sdf", tmp_path / "pipe.sdf",
                 "/dev/zero", "a\0b", None, 3):  # fmt: skip
        assert refused(from_sdf, path).startswith("SDF ")


def test_a_byte_order_mark_and_other_encodings_are_read(tmp_path):
    expected = from_sdf(link())
    assert from_sdf("\ufeff" + link()) == expected
    for encoding in ("utf-8-sig", "utf-16"):
        (tmp_path / "model.sdf").write_bytes(link().encode(encoding))
        assert from_sdf(tmp_path / "model.sdf") == expected


def test_the_limits_are_above_real_files():
    assert coefficients_xml.MOST_ELEMENTS >= 100_000
    assert coefficients_xml.MOST_BYTES >= 10 * 2**20


# Warnings


def test_a_heavy_top_is_a_warning():
    tables = from_sdf(link().replace("0.1 0.2 0.3 0.4", "0 0 -0.3 0.4"))
    says(warnings_of(tables), "turns upside down", "0.3 m above")
    fossen = from_fossen({}, mass=1.0, inertia=(1.0, 1.0, 1.0), center_of_gravity=(0.0, 0.0, -0.02))
    assert "0.02 m above" in warnings_of(fossen)
    assert "upside" not in warnings_of(from_sdf(link()))


def test_moving_links_and_plugins_not_read_are_named():
    told = warnings_of(from_sdf(FILES / "frame_rov.sdf"))
    says(told, "links that can move are held where the file has them: propeller", "thruster (1)")
    told = warnings_of(from_sdf(FILES / "long_auv.sdf"))
    assert "tray::battery" in told
    assert "weight" not in told
    assert "<xUU>, <yVV>" in told


def test_warnings_are_messages_of_the_run():
    scene = lw.Scene.from_dict(from_sdf(FILES / "frame_rov.sdf"))
    told = " ".join(messages(make_plan(one(scene), "psi_x", h=0.01, t1=0.1)))
    says(told, "propeller", "thruster")
    assert lw.Scene.from_dict(scene.to_dict()).vehicle.warnings == scene.vehicle.warnings


def test_a_vehicles_warnings():
    rigid = np.diag([2.0, 2.0, 2.0, 0.1, 1.0, 1.2])
    vehicle = lw.Vehicle(rigid_body_mass_matrix=rigid, inertia_tolerance=0.1, warnings=["from the file"])
    assert vehicle.warnings[0] == "from the file"
    assert "by 8.3 %" in vehicle.warnings[1]
    assert vehicle.to_dict()["warnings"] == ["from the file"]
    assert lw.Vehicle(**vehicle.to_dict()).warnings == vehicle.warnings
    mended = dataclasses.replace(vehicle, rigid_body_mass_matrix=np.eye(6))
    assert mended.warnings == ("from the file",)
    assert "warnings" not in dataclasses.replace(mended, warnings=()).to_dict()
    assert "is not a list of texts" in refused(lw.Vehicle, mass=1.0, inertia=(1.0, 1.0, 1.0), warnings="one")


def test_inertia_that_misses_the_triangle_is_taken_from_a_file():
    """The inertia of the ECA A9 in uuv_simulator misses it by (35 - 30.6)/35.

    By hand they are refused, with the tolerance named.
    """
    inertia = np.array([0.6, 30.0, 35.0])
    rigid = np.diag([*[69.7] * 3, *inertia])
    message = refused(lw.Vehicle, rigid_body_mass_matrix=rigid)
    says(message, "two of which sum to less than the third", "inertia_tolerance = 0.13")
    scene = lw.Scene.from_dict(from_fossen({}, mass=69.7, inertia=inertia))
    assert "by 13 % of it" in scene.vehicle.warnings[0]
    assert lw.Scene.from_dict(scene.to_dict()).vehicle.warnings == scene.vehicle.warnings
    varied = {"vehicle.rigid_body_mass_matrix": lw.distributions.Normal(relative=1e-3)}
    assert lw.Ensemble(scene, 20, 1, varied).members == 20
    far = from_fossen({}, mass=69.7, inertia=(0.6, 20.0, 35.0))
    assert "no rigid body has" in refused(lw.Scene.from_dict, far)
    assert "inertia_tolerance" in refused(lw.Vehicle, rigid_body_mass_matrix=rigid, inertia_tolerance=-1.0)


@pytest.mark.skipif("VEHICLE_FILES" not in os.environ, reason="VEHICLE_FILES names no folder of real files")
def test_real_files():
    """Every file of a folder of real robot descriptions (see tests/support/righting.py)."""
    read = list(righting.rows(os.environ["VEHICLE_FILES"]))
    assert len(read) >= 11
    for name, ours, theirs in read:
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9, err_msg=name)
