# SPDX-License-Identifier: Apache-2.0
"""Files as teams have them: YAML of a whole vehicle's software, SDF worlds that include their models, several plugins."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.vehicles import from_sdf, from_yaml

pytest.importorskip("yaml")
TEAM = """
thrusters: {count: 8, limits: [-50, 50], names: [a, b]}
controller: {gains: {kp: 1.0, ki: 0.2}, rate: 50, mode: auto}
vehicle:
  dynamics:
    mass_matrix: [[30.0, 0, 0, 0, 1.5, 0], [0, 30.0, 0, -1.5, 0, 3.0], [0, 0, 30.0, 0, -3.0, 0],
                  [0, -1.5, 0, 0.7, 0, 0], [1.5, 0, -3.0, 0, 3.5, 0], [0, 3.0, 0, 0, 0, 3.6]]
    linear_damping: [-4, -20, -20, -1, -10, -10]
"""


def test_known_keys_are_listed_once():
    with pytest.raises(lw.SceneError) as error:
        from_yaml(TEAM)
    faults = [line for line in error.value.faults if "unknown key" in line]
    assert len(faults) > 5
    assert sum("mass_inertia_matrix" in line for line in faults) == 1
    assert max(map(len, faults[1:])) < 150
    assert "table=" in faults[0]


@pytest.mark.parametrize("table", ["vehicle.dynamics", ["vehicle", "dynamics"]])
@pytest.mark.parametrize("axes", ["frd", "flu"])
def test_a_mass_matrix_is_taken_apart(table, axes):
    """Against M = [[m, -m S(r)], [m S(r), I - m S(r) S(r)]], taken together again."""
    read = from_yaml(TEAM, table=table, position_axes=axes, matrix_axes=axes)
    M = np.array([[30.0, 0, 0, 0, 1.5, 0], [0, 30.0, 0, -1.5, 0, 3.0], [0, 0, 30.0, 0, -3.0, 0],
                  [0, -1.5, 0, 0.7, 0, 0], [1.5, 0, -3.0, 0, 3.5, 0], [0, 3.0, 0, 0, 0, 3.6]])  # fmt: skip
    sign = np.array([1.0, -1.0, -1.0] * 2) if axes == "flu" else np.ones(6)
    np.testing.assert_allclose(read["vehicle"]["rigid_body_mass_matrix"], sign[:, None] * M * sign, atol=1e-12)
    np.testing.assert_allclose(read["vehicle"]["center_of_gravity"], sign[:3] * [0.1, 0.0, 0.05], atol=1e-12)


@pytest.mark.parametrize(("text", "more", "words"), [
    ("mass_matrix: [30, 35, 40, 1, 2, 3]\n", {}, "is not that of a rigid body"),
    ("mass_matrix: [30, 30, 30, 1, 2, 3]\nmass: 30\n", {}, "mass = 30 is given besides mass_matrix"),
    (TEAM, {"table": "vehicle.dynamic"}, "table = 'dynamic' is not a table of the file. Did you mean 'dynamics'"),
    (TEAM, {"table": "controller.rate"}, "is not a table of the file"),
    (TEAM, {"table": 3}, "table"),
])  # fmt: skip
def test_team_files_that_are_refused(text, more, words):
    with pytest.raises(lw.SceneError, match=words):
        from_yaml(text, **more)


LINK = (
    '<link name="{0}"><pose>0 {1} 0 0 0 0</pose><inertial><mass>{2}</mass><inertia><ixx>1</ixx><iyy>1</iyy><izz>1</izz>'
    "</inertia></inertial></link>"
)
PLUGIN = (
    '<plugin filename="gz-sim-hydrodynamics-system" name="gz::sim::systems::Hydrodynamics"><link_name>{0}</link_name>'
    "<xU>-4</xU><yV>-40</yV><zW>-40</zW><kP>-1</kP><mQ>-2</mQ><nR>-2</nR>{1}</plugin>"
)


def two(first, second):
    """Two joined links, each with a plugin that says more."""
    joint = '<joint name="j" type="fixed"><parent>a</parent><child>b</child></joint>'
    parts = (
        LINK.format("a", 0, 20),
        LINK.format("b", 0.4, 5),
        joint,
        PLUGIN.format("a", first),
        PLUGIN.format("b", second),
    )
    return '<sdf version="1.9"><model name="m">' + "".join(parts) + "</model></sdf>"


def current(north):
    return f"<default_current>0 {north} 0</default_current>"


@pytest.mark.parametrize("second", [current(0.5), ""])
def test_the_water_of_several_plugins_is_one(second):
    read = from_sdf(two(current(0.5), second))
    (water,) = [term for term in read["terms"] if "velocity" in term]
    np.testing.assert_allclose(water["velocity"], [0.5, 0.0, 0.0])
    density = "<water_density>1025</water_density>"
    assert from_sdf(two(density, density))["environment"]["water_density"] == 1025.0


def test_plugins_that_differ_on_the_water_are_refused():
    with pytest.raises(lw.SceneError, match=r"<default_current> = .* differs from plugin to plugin"):
        from_sdf(two(current(0.5), current(0.4)))
    densities = two("<water_density>1025</water_density>", "<water_density>1000</water_density>")
    with pytest.raises(lw.SceneError, match=r"<water_density> = '1025; 1000' differs .*. Pass water_density="):
        from_sdf(densities)
    assert from_sdf(densities, water_density=1020.0)["environment"]["water_density"] == 1020.0


WORLD = """<sdf version="1.9"><world name="w"><gravity>0 0 -9.8</gravity>
<model name="ground"><static>true</static><link name="l"/></model>
<include><uri>https://fuel.example.org/1.0/openrobotics/models/Coast</uri></include>
<include><name>swimmer</name><pose>0 0 -5 0 0 0</pose><uri>model://tethys_equipped</uri>{}</include></world></sdf>"""
HULL = '<sdf version="1.9"><model name="tethys">' + LINK.format("a", 0, 20) + "</model></sdf>"
EQUIPPED = """<sdf version="1.9"><model name="tethys_equipped"><include{}><name>hull</name><uri>tethys</uri>{}</include>
{}</model></sdf>"""


@pytest.mark.parametrize("key", ["swimmer", "model://tethys_equipped", "tethys_equipped"])
def test_a_world_includes_what_the_user_names(key, tmp_path):
    plain = from_sdf(f'<sdf version="1.9"><model name="m">{LINK.format("a", 0, 20)}{PLUGIN.format("a", "")}</model></sdf>',
                     gravity=9.8)  # fmt: skip
    (tmp_path / "model.sdf").write_text(HULL)
    for include in (
        {key: HULL.replace("</model>", PLUGIN.format("a", "") + "</model>")},
        {key: EQUIPPED.format("", PLUGIN.format("a", ""), ""), "tethys": tmp_path / "model.sdf"},
        {key: EQUIPPED.format(' merge="true"', "", PLUGIN.format("a", "")), "hull": HULL},
        {key: EQUIPPED.format("", "", PLUGIN.format("hull::a", "")), "hull": HULL},
    ):
        read = from_sdf(WORLD.format(""), include=include)
        assert read["terms"] == plain["terms"]
        assert read["vehicle"]["weight"] == plain["vehicle"]["weight"] == 20.0 * 9.8
        assert read["environment"]["gravity"] == 9.8
    named = from_sdf(WORLD.format("").replace("tethys_equipped", "MBARI%20Tethys"), include={"MBARI Tethys": HULL})
    assert named["vehicle"]["weight"] == plain["vehicle"]["weight"]
    outer = from_sdf(WORLD.format(PLUGIN.format("a", "")), include={key: HULL})
    assert outer["terms"] == plain["terms"]


def test_a_merged_model_lies_where_its_pose_says():
    """Beside the same links written into one model; c hangs below b and turns with the merged model by a quarter."""

    def link(name, pose):
        return LINK.format(name, 0, 5).replace("<pose>0 0 0 0 0 0</pose>", pose).replace("<ixx>1", "<ixx>2")

    joint = '<joint name="j{0}" type="fixed"><parent>a</parent><child>{0}</child></joint>'
    merged = (
        link("b", "<pose>1 0 0 0 0 0</pose>")
        + link("c", '<pose relative_to="b">0 0 -0.5 0 0 0</pose>')
        + link("e", '<pose relative_to="__model__">0 0 0.3 0 0 0</pose>')
        + link("g", "")
        + link("h", '<pose relative_to="f"/>')
        + '<frame name="f"><pose>0 0.2 0 0 0 0</pose></frame>'
    )
    include = '<include merge="true"><uri>tail</uri><pose degrees="true">-2 0.1 0 0 0 90</pose></include>'
    whole = '<sdf version="1.9"><model name="m">{}</model></sdf>'
    own = LINK.format("a", 0, 20) + "".join(joint.format(name) for name in "bcegh")
    read = from_sdf(whole.format(own + include), include={"tail": whole.format(merged)})
    turn = " 0 0 1.5707963267948966</pose>"
    flat = (
        link("b", "<pose>-2 1.1 0" + turn)
        + link("c", "<pose>-2 1.1 -0.5" + turn)
        + link("e", "<pose>-2 0.1 0.3" + turn)
        + link("g", "<pose>-2 0.1 0" + turn)
        + link("h", "<pose>-2.2 0.1 0" + turn)
    )
    beside = from_sdf(whole.format(own + flat))
    numbers = {key: value for key, value in beside["vehicle"].items() if np.asarray(value).dtype.kind == "f"}
    assert len(numbers) > 3
    for key, value in numbers.items():
        np.testing.assert_allclose(read["vehicle"][key], value, rtol=1e-12, atol=1e-12, err_msg=key)
    np.testing.assert_allclose(read["vehicle"]["weight"], 45.0 * 9.80665)
    placed = whole.replace('"m"', '"m" placement_frame="f"').format(merged)
    with pytest.raises(lw.SceneError, match="is merged by a placement_frame"):
        from_sdf(whole.format(own + include), include={"tail": placed})


@pytest.mark.parametrize(("include", "words"), [
    (None, "the file has none of its own that can move, it includes .*swimmer. Pass include="),
    ({"swimer": HULL}, "include = 'swimer' is none that the file includes. Did you mean 'swimmer'"),
    ({"swimmer": EQUIPPED.format("", "", ""), "tethys": EQUIPPED.format("", "", "")}, "nested more than 8 deep"),
    ({"swimmer": "<sdf/>"}, "the file has no <model>"),
    ({"swimmer": "nowhere.sdf"}, "include 'swimmer' file 'nowhere.sdf': No such file"),
    ({"swimmer": 3}, "is not a map of files"),
    ("model.sdf", "is not a map of files"),
])  # fmt: skip
def test_includes_that_are_refused(include, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(lw.SceneError, match=words):
        from_sdf(WORLD.format(""), include=include)


def test_includes_that_grow_without_end_are_refused():
    twice = '<sdf><model name="m"><include><uri>{0}</uri></include><include><uri>{0}</uri></include></model></sdf>'
    files = {name: twice.format(below) for name, below in zip("abcdefg", "bcdefgh", strict=True)}
    files["h"] = f'<sdf><model name="h">{"<link/>" * 5000}</model></sdf>'
    with pytest.raises(lw.SceneError, match="makes more than 100,000 elements"):
        from_sdf(WORLD.format("").replace("tethys_equipped", "a"), include=files)
