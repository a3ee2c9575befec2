# SPDX-License-Identifier: Apache-2.0
"""Faults of a vehicle's file are reported with place and remedy."""

import pytest

import lgvi_warp as lw
from tests.support.refusals import faults, says

LINK = ("<sdf><model name='m'><link name='b'><inertial><mass>10</mass><inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz>"
        "</inertia></inertial></link><plugin name='hydrodynamics'><xU>-1</xU></plugin></model></sdf>")  # fmt: skip
SDF = [
    ("<sdf/>", {}, "SDF link", "has none", "with a <link>"),
    ("<sdf><link name='b'/></sdf>", {}, "'b'", "no <inertial>", "Add mass, pose and inertia"),
    ("<sdf><", {}, "not XML", "Correct that line"),
    ("missing.sdf", {}, "missing.sdf", "No such file", "Give the path of a file, or its text"),
    (None, {}, "SDF file None", "Give the path of a file, or its text"),
    (LINK.replace("<mass>10</mass>", ""), {}, "<mass>", "is missing", "[kg]"),
    (LINK.replace(">10<", ">ten<"), {}, "<mass> = 'ten'", "does not hold 1 finite numbers"),
    (LINK.replace("<xU>-1</xU>", "<xU>-1</xU><yV>1</yV>"), {}, "plugin's linear drag", "both signs", "Fossen's signs"),
    (LINK.replace("xU", "xUabsV"), {}, "<xUabsV> = -1.0", "product of velocities", "leave it out"),
    ("<sdf><link></sdf>", {}, "not XML", "Correct that line"),
    (LINK, {"link": "c"}, "SDF link = 'c'", "not in the file", "Known: b"),
    (LINK, {"volume": -1.0}, "volume = -1.0", "not positive", "[m3]"),
    (LINK, {"volume": 0.01, "gravity": "g"}, "gravity = 'g'", "not numeric", "[m/s2]"),
]


@pytest.mark.parametrize(("text", "more", "words"), [(row[0], row[1], row[2:]) for row in SDF])
def test_sdf(text, more, words):
    fault = next(one for one in faults(lw.vehicles.from_sdf, text, **more) if words[0] in one)
    assert all(word in fault for word in words), fault


YAML = [
    ("inertia: [1, 2, 2.5]\n", "mass = ''", "is missing", "Add mass to the file, or pass mass="),
    ("mass: 10\ninertia:\n", "inertia = ''", "is missing", "pass inertia="),
    ("mass: ten\ninertia: [1, 2, 2.5]\n", "mass = 'ten'", "not numeric", "[kg]"),
    ("mass: 10\ninertia: [1, 2, 2.5]\nvolume: 0.1\n", "density = 'not given'", "[kg/m3 (with volume)]"),
    ("mass: 10\ninertia: [1, 2, 2.5]\ncolour: red\n", "colour = 'red'", "unknown key", "ignore="),
    ("mass: 10\ninertia: [1, 2, 2.5]\nadded_mass: [1, 2]\n", "added_mass = [1, 2]", "shape (2,)", "6x6 matrix"),
    ("mass: 10\ninertia: [1, 2, 2.5]\ncoefficients: [1]\n", "coefficients = [1]", "not a map", "X_udot"),
    ("- 1\n- 2\n", "is not a map", "Write mass: ..."),
    ("nowhere.yaml", "nowhere.yaml", "Give the path"),
    ("mass: [1\n", "YAML", "Correct that line"),
]


@pytest.mark.parametrize(("text", "words"), [(row[0], row[1:]) for row in YAML])
def test_yaml(text, words):
    pytest.importorskip("yaml")
    says(*faults(lw.vehicles.from_yaml, text), *words)
