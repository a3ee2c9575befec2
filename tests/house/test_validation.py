# SPDX-License-Identifier: Apache-2.0
"""Pages of comparisons with published numbers: they hold what their rows say, and the rows are what the scenes give now."""

import numpy as np
import pytest

from benchmarks import pages, validated
from benchmarks.tables import validation
from tests.conftest import ROOT

README = ROOT / pages.PAGES["validation"]


def test_there_are_at_least_eight():
    assert len(validated.CASES) >= 8
    written = {path.stem for path in README.parent.glob("*.md")} - {README.stem}
    assert written == set(validated.CASES)
    assert {validated.case(name).AGAINST for name in validated.CASES} == set(validated.KINDS)


@pytest.mark.parametrize("name", validated.CASES)
def test_a_page_holds_its_rows(name):
    page = validated.page_of(name)
    before, after = pages.parts("validation", page)
    text = validated.section(name, validated.kept(name))
    told = "run `python -m benchmarks table validation --kept`"
    assert page.read_text() == f"{before}\n\n{text.strip()}\n\n{after}", told
    for scene in validated.case(name).SCENES:
        assert (ROOT / scene).is_file()
        # The page names its scene file; what tests compare with stands beside it.
        assert scene.rsplit("/", 1)[1] in page.read_text()


def test_the_overview_holds_their_headlines():
    before, after = pages.parts("validation", README)
    assert README.read_text() == f"{before}\n\n{validation.text_of().strip()}\n\n{after}"


def test_the_best_agreement_comes_first():
    contents = {name: validated.kept(name) for name in validated.CASES}
    errors = {name: validated.agreement(name, content) for name, content in contents.items()}
    lines = validated.overview(contents).splitlines()[2:]
    names = [line.split("](", 1)[1].split(".md", 1)[0] for line in lines]
    assert names == sorted(errors, key=errors.__getitem__)
    for name, line in zip(names, lines, strict=True):
        assert f"| {errors[name]:.2g} %" in line
        # A stranger reads from where the numbers are, and how far the worst of the page is off.
        assert validated.case(name).KNOWN in line
        assert f"| {validated.largest(contents[name]):.2g} % |" in line


@pytest.mark.parametrize("name", validated.CASES)
def test_a_picture_has_a_title(name):
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    validated.plot(name, validated.kept(name), figure)
    assert figure.get_suptitle() == validated.case(name).TITLE
    assert any(axes.get_xlabel() and axes.get_ylabel() for axes in figure.axes)


# Comparison -> its rows outside of what is known: the page has the reason of each.
APART = {
    "gazebo_bodies": ["duck: height"],
    "lrauv_300_rpm": [],
    "bluerov2_gazebo": [
        "surge: mean of the last three readings",
        "heave: the only reading",
        "seconds of the simulation in one of the clock, by the reading of heave",
        "sway by that rate",
        "heave steady; theirs is the closed form of drag alone",
    ],
}


@pytest.mark.parametrize("name", APART)
def test_rows_of_other_programs_agree(name):
    rows = validated.kept(name).rows
    assert [row.what for row in rows if row.within is not None and abs(row.error) > row.within] == APART[name]
    # SciPy and closed forms: to the error of the step.
    exact = [row for row in rows if "SciPy" in row.what or row.what.startswith("closed form")]
    assert len(exact) == 3
    assert all(abs(row.error) < 2e-7 for row in exact)


def test_what_explains_the_differences_to_gazebo():
    rows = {row.what: row for row in validated.kept("gazebo_bodies").rows}
    for body in ("body 1", "body 2", "body 3"):
        # The printed rates have the error of a step of order 1: what is left is of order 2.
        plain, stepped = (
            rows[f"{body}: rate about z"],
            rows[f"{body}: rate about z, with the error of a step of 0.1 ms"],
        )
        assert abs(stepped.error) < 0.01 * abs(plain.error)
    for name in ("sinking submarine", "buoyant submarine", "duck"):
        row = rows[f"{name}: height, by Gazebo's step"]
        assert abs(row.error) <= row.within
    rows = {row.what: row for row in validated.kept("bluerov2_gazebo").rows}
    # One rate, that of the only reading of heave, gives the two other readings.
    assert abs(rows["surge by that rate"].error) < 0.0005
    assert abs(rows["sway by that rate"].error) < 0.002


def test_a_changed_row_changes_its_page():
    name = validated.CASES[0]
    content = validated.kept(name)
    first = content.rows[0]._replace(computed=1.1 * content.rows[0].computed + 1.0)
    changed = content._replace(rows=[first, *content.rows[1:]])
    assert validated.section(name, changed) != validated.section(name, content)


def test_what_is_counted_as_agreeing():
    row = validated.Row("x", "m", 2.0, 0.1, 2.09)
    rows = [row, row._replace(computed=1.89), row._replace(within=None, computed=9.0)]
    assert validated.within(rows) == "1 of 2"
    assert validated.within(rows[2:]) == ""
    assert (row.error, validated.percent(row)) == (pytest.approx(0.09), "4.5 %")
    assert validated.percent(row._replace(published=-2.0, computed=-2.1)) == "-5 %"


def test_a_curve_is_thinned_with_both_its_ends():
    x = np.arange(1001.0)
    places, values = validated.curve(x, 2.0 * x, 11)
    assert places == [100.0 * i for i in range(11)]
    assert values == [2.0 * place for place in places]
    assert validated.curve(x[:3], x[:3], 11)[0] == [0.0, 1.0, 2.0]


def test_what_is_kept_comes_back(tmp_path, monkeypatch):
    monkeypatch.setattr(validated, "rows_of", lambda name: tmp_path / name)
    content = validated.Content([validated.Row("x", "m", 1.0, None, 2.0)], {"line": ([0.0, 1.0], [2.0, 3.0])})
    validated.keep("one", content)
    assert validated.kept("one") == content


@pytest.mark.slow
@pytest.mark.parametrize("name", validated.CASES)
def test_the_rows_are_what_the_scenes_give_now(name):
    """To round-off, as it grows: other sums on other processors differ by 1e-16, which unstable vehicles raise to 1e-7."""
    before, now = validated.kept(name), validated.case(name).measured()
    assert [row[:2] for row in now.rows] == [row[:2] for row in before.rows]
    for row, old in zip(now.rows, before.rows, strict=True):
        size = max(abs(old.published), abs(old.computed))
        assert row.published == pytest.approx(old.published, rel=1e-6), row.what
        # Rows of 0 against 0, and distances of paths, are differences: 1e-9 of the 10 m or so from which they come.
        assert row.computed == pytest.approx(old.computed, rel=1e-6, abs=1e-6 * size + 1e-8), row.what
    assert now.curves.keys() == before.curves.keys()


@pytest.mark.slow
def test_the_slocum_scene_has_the_fitted_numbers():
    """The two numbers that depth rates alone determine, to the digits that the scene has."""
    import lgvi_warp as lw

    module = validated.case("slocum_comet")
    mass, drag = module.fit()
    scene = lw.Scene.load(ROOT / module.SCENES[0])
    (polar,) = (term for term in scene.terms if term.type == "polar")
    assert scene.vehicle.mass == pytest.approx(mass, abs=1e-4)
    assert float(polar.drag) == pytest.approx(drag, rel=1e-4)
    wings = 2.0 * np.pi * 7.0 / (2.0 + np.sqrt(49.0 * (1.0 + np.tan(np.radians(43.0)) ** 2) + 4.0))
    half = 0.5 * scene.environment.water_density * 0.1
    assert float(polar.lift_by_attack) == pytest.approx(half * (wings + 3.8), rel=1e-4)
    assert float(polar.drag_by_attack) == pytest.approx(half * (wings**2 / (np.pi * 0.8 * 7.0) + 9.7), rel=1e-4)


def test_the_scene_of_nps_auv_2_follows_from_the_printed_numbers():
    import lgvi_warp as lw

    module = validated.case("nps_auv_2")
    # The file has the numbers to the last digit.
    assert lw.Scene.load(ROOT / module.SCENES[0]).to_dict() == lw.Scene.from_dict(module.tables()).to_dict()


def test_the_scenes_beside_gazebo_follow_from_the_printed_numbers():
    import lgvi_warp as lw

    bodies, rov, lrauv = (validated.case(name) for name in ("gazebo_bodies", "bluerov2_gazebo", "lrauv_300_rpm"))
    shaken, rising = (lw.Scene.load(ROOT / path) for path in bodies.SCENES)
    (push,), table = shaken.terms, lw.Scene.from_dict(bodies.tables("body 1"))
    for key in ("times", "force", "torque"):
        assert np.asarray(getattr(push, key)) == pytest.approx(np.asarray(getattr(table.terms[0], key)), abs=2e-6)
    assert {**shaken.to_dict(), "terms": None} == {**table.to_dict(), "terms": None}
    mass, volume, _ = bodies.RISING["buoyant submarine"]
    assert rising.vehicle.mass == pytest.approx(mass, rel=1e-12)
    assert rising.vehicle.buoyancy == pytest.approx(bodies.GRAVITY * bodies.DENSITY * volume, rel=1e-12)
    scene = lw.Scene.load(ROOT / rov.SCENES[0])
    matrix, center = rov.rigid_body()
    assert np.asarray(scene.vehicle.rigid_body_mass_matrix) == pytest.approx(matrix, abs=1e-12)
    assert np.asarray(scene.vehicle.center_of_gravity) == pytest.approx(center, abs=1e-15)
    assert scene.vehicle.weight == pytest.approx(matrix[0, 0] * scene.environment.gravity, rel=1e-12)
    assert np.asarray(scene.terms[1].force) == pytest.approx(
        np.asarray(rov.pushed(scene, "surge").terms[1].force), abs=1e-12
    )
    drag, thrusters = lw.Scene.load(ROOT / lrauv.SCENES[0]).terms
    # model.sdf: thrust coefficient, density and diameter of the propeller.
    assert np.ravel(thrusters.coefficient)[0] == pytest.approx(0.004312328425753156 * 1025.0 * 0.2**4, rel=1e-12)
    assert np.ravel(thrusters.command)[0] == pytest.approx(10.0 * np.pi, rel=1e-15)
    assert np.asarray(drag.quadratic)[0] == 6.2282
