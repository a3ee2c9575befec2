# SPDX-License-Identifier: Apache-2.0
"""Grids of stability maps, limits by linear theory, maps as files."""

import dataclasses
import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.accuracy.stability import runs
from lgvi_warp.accuracy.stability.grid import ALIASES, Axis, Line, StabilityGrid, axis_of, rotation_vectors
from lgvi_warp.accuracy.stability.limits import oscillation_limit, rotation_limit
from lgvi_warp.accuracy.stability.map import Cell, StabilityMap, cells_of, map_of
from lgvi_warp.accuracy.stability.runs import REFUSED, CellRuns, column
from lgvi_warp.common.status import Status
from lgvi_warp.measuring.distance import compared_in
from lgvi_warp.methods.limits import drag_limit
from lgvi_warp.methods.method import Method
from lgvi_warp.physics import energy as invariants
from lgvi_warp.physics import notation, vehicle
from lgvi_warp.physics.rates import drag_rate, rates
from lgvi_warp.scene.settings import RunSettings
from tests.support.made import made


def grid_of(scene, x="h", y="angular_velocity", points=(3, 4), directions=2, h=None):
    return StabilityGrid(scene, x, y, points, directions, 0, h)


def by_cell(grid, values):
    """(ny, nx, directions, ...)."""
    return values.reshape(*grid.shape, *values.shape[1:])


def drag_scene(scene):
    return dataclasses.replace(scene, terms=[lw.terms.Drag(linear=[1.0] * 6, quadratic=[0, 0, 40.0, 0, 0, 0])])


@pytest.mark.parametrize(("text", "axis"), [
    ("h", Axis("h")), ("h=0.01:3", Axis("h", 0.01, 3.0)),
    ("vehicle.mass=50:500:linear", Axis("vehicle.mass", 50.0, 500.0, log=False)),
    ("vehicle.inertia=0.1:10:log:scale", Axis("vehicle.inertia", 0.1, 10.0, scaled=True)),
    ("vehicle.mass=1:2:set", Axis("vehicle.mass", 1.0, 2.0, scaled=False)),
])  # fmt: skip
def test_an_axis_is_read(text, axis):
    assert Axis.parse(text) == axis


def test_values_rise_by_equal_factors_or_equal_steps():
    assert np.allclose(Axis("h", 0.1, 10.0).values(3), [0.1, 1.0, 10.0])
    assert np.allclose(Axis("h", 1.0, 3.0, log=False).values(3), [1.0, 2.0, 3.0])


def test_axes_without_a_range_fit_the_scenes_own_rate(scene):
    grid = grid_of(scene)
    w = grid.rate
    assert w > 0.0
    assert abs(w - 1.0) > 0.1
    assert (grid.x.low, grid.x.high) == pytest.approx((0.01 / w, 4.0 / w))
    assert (grid.y.low, grid.y.high) == pytest.approx((0.1 * w, 10.0 * w))
    damped = grid_of(drag_scene(scene), "drag_number", "speed", h=0.01)
    speed = np.linalg.norm(damped.base.velocity)
    assert (damped.x.low, damped.x.high) == pytest.approx((0.01 * damped.rate, 100.0 * damped.rate))
    assert (damped.y.low, damped.y.high) == pytest.approx((0.1 * speed, 10.0 * speed))


def test_steps_and_rates_of_every_member(scene):
    grid = grid_of(scene, ("h", 0.1, 0.4), ("angular_velocity", 0.5, 4.0))
    h, Om = by_cell(grid, grid.h), by_cell(grid, grid.state["angular_velocity"])
    assert grid.shape == (4, 3, 2)
    assert np.allclose(h, np.array([0.1, 0.2, 0.4])[None, :, None])
    assert np.allclose(np.linalg.norm(Om, axis=-1), np.array([0.5, 1.0, 2.0, 4.0])[:, None, None])
    own = scene.start.angular_velocity
    assert np.allclose(Om[:, :, 0] / np.linalg.norm(Om[:, :, 0], axis=-1, keepdims=True), own / np.linalg.norm(own))
    assert not np.allclose(Om[:, :, 0], Om[:, :, 1], rtol=0.05)


def test_other_starts_keep_their_size(scene):
    grid = grid_of(scene, ("h", 0.1, 0.4), ("vehicle.mass", 100.0, 200.0), directions=5)
    for name in ("velocity", "angular_velocity"):
        sizes = np.linalg.norm(by_cell(grid, grid.state[name])[0, 0], axis=-1)
        assert np.allclose(sizes, sizes[0])
        assert sizes[0] > 0.0


def test_a_start_at_rest_is_given_a_direction():
    scene = lw.Scene(lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0)), run=RunSettings(step=0.1))
    grid = grid_of(scene, ("speed", 1.0, 4.0), ("angular_velocity", 0.5, 4.0), h=0.1)
    assert np.allclose(
        np.linalg.norm(by_cell(grid, grid.state["velocity"]), axis=-1), np.array([1, 2, 4])[None, :, None]
    )
    still = grid_of(scene, ("h", 1.0, 4.0), ("environment.gravity", 1.0, 2.0))
    assert not np.any(still.state["velocity"])
    assert not np.any(still.state["angular_velocity"])


def test_added_mass_by_its_ratio(scene):
    grid = grid_of(scene, ("h", 0.1, 0.4), ("added_mass_ratio", 0.5, 4.0))
    added = by_cell(grid, grid.parameters(np.arange(24))["vehicle.added_mass"])
    assert np.allclose(added.max(axis=(-1, -2))[:, 0, 0] / 123.8, [0.5, 1.0, 2.0, 4.0])
    assert np.allclose(added[0, 0, 0] / added[0, 0, 0, 2, 2], np.diag([65.0, 70.0, 75.0]) / 75.0)


def test_drag_by_its_rate(scene):
    for one in (drag_scene(scene), scene):  # a scene without drag gets one
        grid = grid_of(one, ("h", 0.1, 0.4), ("drag_number", 0.5, 4.0), directions=1)
        m = grid.base
        found = drag_rate(
            grid.parameters(np.arange(12)), vehicle.inertia6(m.parameters), m.velocity, m.angular_velocity
        )
        assert np.allclose(found.reshape(4, 3), np.array([0.5, 1.0, 2.0, 4.0])[:, None])
    assert "drag.linear" not in scene.parameters()


def test_numbers_are_set_and_matrices_multiplied(scene):
    grid = grid_of(scene, ("vehicle.mass", 100.0, 400.0), ("vehicle.inertia", 0.5, 4.0), h=0.1)
    p = grid.parameters(np.arange(24))
    assert np.allclose(by_cell(grid, p["vehicle.mass"])[0, :, 0], [100.0, 200.0, 400.0])
    assert np.allclose(by_cell(grid, p["vehicle.inertia"])[:, 0, 0, 0, 0], 5.46 * np.array([0.5, 1.0, 2.0, 4.0]))
    x, y = grid.lines
    assert (x.unit, y.unit) == ("kg", "1")
    assert "/ the scene's" in y.label
    scaled = grid_of(scene, Axis("vehicle.mass", 1.0, 4.0, scaled=True), "h")
    assert np.allclose(by_cell(scaled, scaled.varied["vehicle.mass"])[0, :, 0], 123.8 * np.array([1.0, 2.0, 4.0]))


@pytest.mark.parametrize("name", ["vehicle.mass", "vehicle.added_mass", "vehicle.center_of_buoyancy", "drag.linear",
                                  "drag.quadratic", "environment.gravity", "start.angular_velocity"])  # fmt: skip
def test_every_name_makes_a_fleet(scene, name):
    grid = grid_of(drag_scene(scene), "h", name)
    assert grid.fleet(np.arange(24)).members == 24


def test_columns_hold_every_member_once(scene):
    grid = grid_of(scene)
    columns = grid.columns()
    assert len(columns) == 3
    assert sorted(np.concatenate([members for _, members in columns])) == list(range(24))
    assert all(np.all(grid.h[members] == h) for h, members in columns)


def test_all_faults_at_once(scene):
    with pytest.raises(lw.SceneError) as caught:
        lw.stability_map(scene, "vehicle.mas", "angular_velocity=3:1", error=-1.0, of="heat", points=4)
    text = str(caught.value)
    assert all(
        word in text for word in ("vehicle.mas", "Did you mean 'vehicle.mass'", "does not rise", "error = -1", "heat")
    )
    with pytest.raises(lw.SceneError, match=r"2 faults(.|\n)*points(.|\n)*directions"):
        lw.stability_map(scene, points=0, directions=0)


@pytest.mark.parametrize("name", ["t1", "error_time"])
def test_a_time_of_too_many_steps_is_refused(name, scene):
    with pytest.raises(lw.SceneError, match=f"^{name} = 9.22.* is more than 2,147,483,646 steps of 0.01 s"):
        lw.stability_map(scene, ("h", 0.01, 1.0), ("angular_velocity", 0.1, 10.0), ["psi_s"], points=4, **{name: 2**63})


@pytest.mark.parametrize(("x", "y", "words"), [
    ("h", "h", "both axes"), ("speed", "angular_velocity", "missing, and is on no axis"),
    ("h=a:b", "speed", "NAME=LOW:HIGH"), ("h=1:2:cubic", "speed", "NAME=LOW:HIGH"), ("h=-1:2", "speed", "above 0"),
    ("h", "vehicle.inertia=1:2:log:set", "multiplied"),
])  # fmt: skip
def test_bad_axes_are_refused(scene, x, y, words):
    with pytest.raises(lw.SceneError, match=words):
        grid_of(dataclasses.replace(scene, run=RunSettings()), x, y)


def test_drag_that_is_zero_at_the_start_cannot_be_scaled():
    scene = lw.Scene(lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0)), terms=[lw.terms.Drag(quadratic=[1.0] * 6)])
    with pytest.raises(lw.SceneError, match="zero at the scene's start"):
        grid_of(scene, "h", "drag_number")


# Limits


def test_linear_theory():
    assert math.isclose(oscillation_limit("psi_s"), 2.0, abs_tol=2e-3)
    assert math.isclose(oscillation_limit("phi", "restoring"), 2.0, abs_tol=2e-3)
    # |R(iy)| = 1 at y^2 = 8 for the classical method, at 3 for any of order and stages 3.
    assert math.isclose(oscillation_limit("rk4"), math.sqrt(8.0), abs_tol=2e-3)
    assert math.isclose(oscillation_limit("cg3"), math.sqrt(3.0), abs_tol=2e-3)
    # R(-x) = 1 of the classical method: x^3 - 4 x^2 + 12 x - 24 = 0.
    roots = np.roots([1.0, -4.0, 12.0, -24.0])
    root = roots[np.abs(roots.imag) < 1e-12].real[0]
    assert math.isclose(drag_limit("rk4"), root, abs_tol=2e-3)
    assert drag_limit("rkw3") == math.inf


def test_composed_limits_are_of_their_longest_stage():
    g = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
    assert math.isclose(rotation_limit("tj4(psi_s)"), 2.0 / abs(1.0 - 2.0 * g))
    assert (rotation_limit("psi_s"), rotation_limit("psi_1"), rotation_limit("rkmk4")) == (2.0, 1.0, math.inf)
    assert rotation_limit("psi_x") == rotation_limit("psi_x8") == 4.0
    assert math.isclose(rotation_limit("tj4(psi_x)"), 4.0 / abs(1.0 - 2.0 * g))
    # One step of the triple jump as the product of three leapfrogs, at the limit: a trace of 2.
    y = oscillation_limit("tj4(psi_s)")
    step = np.eye(2)
    for c in (g, 1.0 - 2.0 * g, g):
        kick, drift = np.array([[1.0, 0.0], [-0.5 * c * y, 1.0]]), np.array([[1.0, c * y], [0.0, 1.0]])
        step = kick @ drift @ kick @ step
    assert math.isclose(abs(np.trace(step)), 2.0, abs_tol=0.03)


def test_drag_limits_of_the_rest():
    assert drag_limit("psi_s") == drag_limit("psi_x") == math.inf
    assert drag_limit("phi") == 2.0
    assert math.isclose(drag_limit("tj4(psi_s)"), 0.5 / 1.7024, rel_tol=1e-4)


def test_rates_of_the_example(scene):
    m = lw.Ensemble(scene, 1).select(0, 1)
    found = rates(m.parameters, m.velocity, m.angular_velocity)
    p = (123.8 + np.array([65.0, 70.0, 75.0])) * m.velocity[0]
    w = np.linalg.norm(p) * math.sqrt((1 / 188.8 - 1 / 198.8) / 5.29)
    assert math.isclose(found["munk"][0], w)
    assert math.isclose(found["rotation"][0], math.sqrt(0.14))
    assert math.isclose(found["restoring"][0], math.sqrt(1215.8 * 0.007 / 5.29))
    assert found["drag"][0] == 0.0


# Classes and files


def test_classes_are_a_table_of_bounded_and_flagged():
    status = np.array([0, 0, Status.STEP_TOO_LARGE, Status.NON_FINITE, 0, 0, Status.SURFACE, REFUSED, 0])
    growth = np.array([0.1, 0.1, 0.1, np.inf, 2.0, 0.1, 0.1, 0.0, 2.0])
    error = np.array([1e-3, 1.0, np.inf, np.inf, 1e-3, 1e-3, 1e-3, np.inf, 1e-3])
    warned = np.array([False, False, False, False, False, True, False, False, True])
    verified = np.ones(9, bool)
    found = CellRuns(error, growth, status, warned)
    wanted = [Cell.ACCURATE, Cell.BOUNDED, Cell.FLAGGED, Cell.FAILED, Cell.SILENT, Cell.FLAGGED, Cell.ACCURATE,
              Cell.FLAGGED, Cell.FAILED]  # fmt: skip
    assert list(cells_of(found, verified, 1e-2, 1.0)) == wanted
    # Without a reference nothing is accurate; a wider bound of energy makes less unbounded.
    assert cells_of(found, ~verified, 1e-2, 1.0)[0] == Cell.BOUNDED
    assert cells_of(found, verified, 1e-2, 3.0)[4] == Cell.ACCURATE


def made_map(classes):
    """A map of one method with these classes, steps 1, 2, 4 s and rates 1, 10 rad/s."""
    shape = np.shape(classes)
    return StabilityMap(
        x=Line("h", "step h", "s", True, np.array([1.0, 2.0, 4.0])),
        y=Line("angular_velocity", "|angular velocity|", "rad/s", True, np.array([1.0, 10.0])),
        classes={"psi_s": np.array(classes)}, errors={"psi_s": np.array([[0.1, np.inf, 0.2], [0.3] * 3])},
        energies={"psi_s": np.full(shape, 0.5)}, statuses={"psi_s": np.array([[0, 1, REFUSED], [0, 0, 3]])},
        ratios={"psi_s": {"rotation": np.full(shape, 0.7)}}, of="attitude", error_bound=1e-2, error_time=1.0, t1=2.0,
        directions=1, judged="conservative", reference="two runs", unverified=0, provenance={"seed": 0}, messages=("a",),
    )  # fmt: skip


def test_limits_are_the_last_good_step_of_a_row():
    found = made_map([[0, 1, 2], [2, 0, 0]])
    assert found.limit("psi_s")[0] == 2.0
    assert np.isnan(found.limit("psi_s")[1])
    assert found.limit("psi_s", Cell.ACCURATE)[0] == 1.0
    assert list(found.limit("psi_s", Cell.FLAGGED)) == [4.0, 4.0]
    assert found.counts("psi_s") == {"accurate": 3, "bounded": 1, "flagged": 2, "failed": 0, "silent": 0}
    with pytest.raises(lw.SceneError, match="Did you mean 'psi_s'"):
        found.limit("psi")


def test_silent_cells_are_listed():
    assert made_map([[0, 1, 4], [0, 4, 0]]).silent("psi_s") == [(4.0, 1.0), (2.0, 10.0)]


def test_json_round_trip(tmp_path):
    found = made_map([[0, 1, 2], [2, 0, 4]])
    files = found.save(tmp_path)
    again = StabilityMap.load(files[0])
    assert again.to_dict() == found.to_dict() == json.loads(files[0].read_text())
    assert np.array_equal(again.errors["psi_s"], found.errors["psi_s"])
    assert again.classes["psi_s"].dtype == np.int64
    rows = files[1].read_text().splitlines()
    assert len(rows) == 7
    assert rows[0].startswith("method,h,angular_velocity,class,error_attitude")
    assert rows[3].startswith("psi_s,4.0,1.0,flagged,0.2,0.5,refused")


def test_attitudes_of_a_map_are_the_first_and_any():
    """The first direction keeps the axes; the others are uniform on all rotations, of which the trace tells."""
    vectors = rotation_vectors(np.random.default_rng(1), 20_000)
    R = notation.matrix_from_rotation_vector(vectors)
    np.testing.assert_array_equal(R[0], np.eye(3))
    # Each entry of a random rotation has mean 0 and mean square 1/3; five standard errors.
    assert abs(R[1:].mean(axis=0)).max() < 5.0 * np.sqrt(1.0 / 3.0 / len(R))
    np.testing.assert_allclose((R[1:] ** 2).mean(axis=0), 1.0 / 3.0, atol=5.0 * np.sqrt(4.0 / 45.0 / len(R)))
    assert abs((np.trace(R[1:], axis1=1, axis2=2) ** 2).mean() - 1.0) < 0.1


def test_classes_are_counted_by_name():
    found = made_map([[0, 1, 4], [0, 4, 0]])
    counts = found.counts("psi_s")
    assert set(counts) == {cell.name.lower() for cell in Cell}
    assert sum(counts.values()) == 6
    assert [counts[Cell(code).name.lower()] for code in (0, 1, 4)] == [3, 1, 2]


@pytest.mark.parametrize("ask", ["counts", "silent", "limit"])
def test_a_method_that_the_map_has_not_is_refused(ask):
    with pytest.raises(lw.SceneError, match=r"method = 'psi'.*'psi_s'"):
        getattr(made_map([[0, 1, 2], [2, 0, 0]]), ask)("psi")


# Words, warnings and files of maps


def test_the_report_of_a_map_in_words():
    found = dataclasses.replace(made_map([[0, 1, 2], [2, 0, 4]]), unverified=2, refused={"gauss4": "no", "rk4": "why"},
                                seconds=12.4, messages=("one", "two"))  # fmt: skip
    assert str(found).splitlines()[:-1] == [
        "note        one",
        "note        two",
        "map         step h x |angular velocity|: 3 x 2 cells, 1 starts each, 12 s",
        "accurate    attitude to 0.01 rad up to 1 s; bounded: energy up to 2 s (conservative)",
        "reference   two runs; not in 2 cells",
        "refused     gauss4: no, rk4: why",
        "",
        "cells               accurate   bounded   flagged    failed    silent   limit of h over angular_velocity, "
        "least to most",
        "psi_s                      2         1         2         0         1   2 to 2 s",
    ]
    plain = str(dataclasses.replace(made_map([[2, 0, 0], [2, 0, 0]]), messages=()))
    assert "note" not in plain
    assert "refused" not in plain
    assert "reference   two runs\n" in plain
    assert plain.splitlines()[-2].endswith("   none s")
    assert str(made_map([[0, 1, 2], [0, 0, 0]])).splitlines()[-2].endswith("   2 to 4 s")


def test_a_map_as_content_and_records():
    found = dataclasses.replace(made_map([[0, 1, 2], [2, 0, 4]]), unit="deg", refused={"rk4": "why"})
    content = found.to_dict()
    assert content["limits"] == {"psi_s": [2.0, None]}
    assert content["legend"]["4"] == "silent: unbounded without any flag"
    assert content["legend"]["0"] == "accurate: error below the bound"
    assert len(content["legend"]) == 5
    assert content["errors"]["psi_s"] == [[0.1, None, 0.2], [0.3] * 3]
    assert content["x"]["values"] == [1.0, 2.0, 4.0]
    again = StabilityMap.from_dict(content)
    assert (again.refused, again.messages, again.unit) == ({"rk4": "why"}, ("a",), "deg")
    assert again.methods == ("psi_s",)
    assert again.ratios["psi_s"]["rotation"].dtype == np.float64
    assert (again.errors["psi_s"][0, 1], again.x.values.dtype) == (np.inf, np.float64)
    assert again.x.log
    assert again.y.unit == "rad/s"
    assert made_map([[0, 1, 2], [2, 0, 4]]).unit == "rad"
    unknown = dataclasses.replace(made_map([[0, 1, 2], [2, 0, 4]]), of="heat", unit="")
    assert unknown.unit == "1"
    row = found.rows()[5]
    assert row == {"method": "psi_s", "h": 4.0, "angular_velocity": 10.0, "class": "silent", "error_attitude": 0.3,
                   "energy_growth": 0.5, "status": "non_finite", "h_over_rotation_limit": 0.7}  # fmt: skip
    assert [row["status"] for row in found.rows()][:3] == ["ok", "step_too_large", "refused"]


# Grids


def test_axes_are_read_in_every_form():
    axis = Axis("h", 0.1, 1.0)
    assert axis_of(axis) is axis
    assert axis_of(("h", 0.1, 1.0)) == axis == axis_of(["h", 0.1, 1.0])
    assert axis_of(" h = 0.1:1") == axis
    assert {axis_of(f"{name}=1:2").key for name in ALIASES} == {"angular_velocity", "speed"}
    with pytest.raises(lw.SceneError, match=r"axis = 'h=1' is not understood. Write "):
        axis_of("h=1")


@pytest.mark.parametrize(("x", "words"), [
    (("h", 0.0, 1.0), "axis h = 0.0 is not a finite number above 0. Give a range: "),
    (("h", True, 1.0), "axis h = True is not a finite number above 0"),
    (("h", 0.1, math.inf), "axis h = inf is not a finite number above 0"),
    (("h", 1.0, 1.0), "axis h = [1.0, 1.0] does not rise. Give the lower end first"),
    (("vehicle.mass", "a", 1.0), "axis vehicle.mass = 'a' is not a finite number above 0"),
    ("vehicle.mass=-1:1:linear:set", None),
])  # fmt: skip
def test_ranges_that_are_none(scene, x, words):
    if words is None:
        with pytest.raises(lw.SceneError) as caught:
            grid_of(scene, x, ("angular_velocity", 1.0, 2.0), h=0.1).fleet(np.arange(2))
        assert "axis" not in str(caught.value)
        return
    with pytest.raises(lw.SceneError) as caught:
        grid_of(scene, x, ("angular_velocity", 1.0, 2.0), h=0.1)
    assert words in str(caught.value)


@pytest.mark.parametrize(("more", "words"), [
    ({"points": (2.0, 3)}, "points = (2.0, 3) is not a whole number above 0. Give how many"),
    ({"points": (True, 3)}, "points = (True, 3) is not a whole number above 0"),
    ({"directions": 0}, "directions = (0,) is not a whole number above 0"),
    ({"points": (100_000, 100_000)}, "make 20,000,000,000 members, more than "),
    ({"h": -1.0}, "h = -1.0"),
])  # fmt: skip
def test_grids_that_are_none(scene, more, words):
    with pytest.raises(lw.SceneError) as caught:
        grid_of(scene, **({"points": (2, 2)} | more))
    assert words in str(caught.value)


def test_members_are_numbered_by_y_x_and_direction(scene):
    grid = grid_of(scene, ("h", 0.1, 0.2), ("vehicle.mass", 100.0, 200.0), (2, 2), 3)
    assert np.array_equal(grid.h, np.tile(np.repeat([0.1, 0.2], 3), 2))
    assert np.array_equal(grid.varied["vehicle.mass"], np.repeat([100.0, 200.0], 6))
    fleet = grid.fleet(np.array([1, 7]))
    assert fleet.members == 2
    assert fleet.select(0, 2).parameters["vehicle.mass"].tolist() == [100.0, 200.0]
    for name in ("velocity", "angular_velocity"):
        assert np.array_equal(getattr(fleet.select(0, 2), name), grid.state[name][[1, 7]])
    assert np.array_equal(grid.parameters(np.array([7]))["vehicle.mass"], [200.0])
    other = StabilityGrid(scene, ("h", 0.1, 0.2), ("vehicle.mass", 100.0, 200.0), (2, 2), 3, 1, None)
    assert np.array_equal(other.state["velocity"][0], grid.state["velocity"][0])
    assert not np.allclose(other.state["velocity"][1], grid.state["velocity"][1])
    steps = grid_of(scene, ("angular_velocity", 1.0, 2.0), ("vehicle.mass", 100.0, 200.0), (2, 2), 1, h=0.3)
    assert steps.h.tolist() == [0.3] * 4
    assert len(steps.columns()) == 1


def test_axes_without_a_range_are_around_the_scenes_number(scene):
    grid = grid_of(scene, "vehicle.mass", "vehicle.inertia", h=0.1)
    assert (grid.x.low, grid.x.high) == pytest.approx((12.38, 1238.0))
    assert (grid.y.low, grid.y.high) == (0.1, 10.0)
    scaled = grid_of(scene, Axis("vehicle.mass", scaled=True), "added_mass_ratio", h=0.1)
    assert (scaled.x.low, scaled.x.high) == (0.1, 10.0)
    assert (scaled.y.low, scaled.y.high) == (0.01, 100.0)
    half = grid_of(scene, Axis("h", low=0.5), "vehicle.mass", h=0.1)
    assert half.x.low == 0.5
    assert half.x.high == pytest.approx(4.0 / half.rate)
    bare = lw.Scene(lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0)), run=RunSettings(step=0.1))
    assert grid_of(bare, "speed", "angular_velocity").x.low == 0.1
    assert grid_of(bare, "speed", "h").rate == 1.0
    with pytest.raises(lw.SceneError, match=r"axis vehicle\.buoyancy = None is not a finite number"):
        grid_of(bare, "vehicle.buoyancy", "h")


def test_a_vehicle_without_added_mass_gets_that_of_a_slender_body():
    scene = lw.Scene(lw.Vehicle(2.0, inertia=(1.0, 1.0, 1.0)), run=RunSettings(step=0.1))
    grid = grid_of(scene, ("added_mass_ratio", 0.5, 1.0), ("vehicle.mass", 2.0, 4.0), (2, 2), 1)
    added = grid.varied["vehicle.added_mass"].reshape(2, 2, 3, 3)
    assert np.allclose(added[0, 0], np.diag([0.0, 1.0, 1.0]))
    assert np.allclose(added[1, 1], np.diag([0.0, 4.0, 4.0]))
    label = grid.lines[0]
    assert (label.name, label.unit) == ("added_mass_ratio", "1")
    assert np.allclose(label.values, [0.5, 1.0])


def test_units_and_labels_of_lines(scene):
    grid = grid_of(scene, ("environment.gravity", 1.0, 2.0), ("speed", 1.0, 2.0), h=0.1)
    x, y = grid.lines
    assert (x.unit, x.label, x.log) == ("m/s2", "environment.gravity", True)
    assert y.unit == "m/s"
    linear = grid_of(scene, Axis("vehicle.mass", 1.0, 2.0, log=False), "h").lines[0]
    assert not linear.log
    assert (linear.values.tolist(), linear.to_dict()["values"]) == ([1.0, 1.5, 2.0], [1.0, 1.5, 2.0])
    assert Line.from_dict(linear.to_dict()).values.tolist() == [1.0, 1.5, 2.0]


# Runs, made by hand


def test_columns_hold_both_times_in_whole_steps():
    one = column(0.1, np.arange(3), 1.0, 10.0)
    assert one.error_steps.tolist() == [0, 1, 2, 4, 5, 6, 8, 9, 10]
    assert one.steps[-1] == 100
    assert len(one.steps) >= 65
    assert set(one.error_steps) <= set(one.steps)
    assert column(0.3, np.arange(1), 1.0, 0.5).steps.tolist() == [0, 1, 2, 3, 4]
    least = column(1.0, np.arange(1), 1.0, 1.0, 16)
    assert least.error_steps.tolist() == [0, 2, 4, 6, 8, 10, 12, 14, 16]
    assert least.steps.tolist() == list(range(17))
    finer, whole = one.grid(4, to_the_end=False), one.grid()
    assert (finer.h, finer.steps) == (0.025, 40)
    assert finer.times == pytest.approx(0.1 * one.error_steps)
    assert (whole.h, whole.steps) == (0.1, 100)
    assert whole.times == pytest.approx(0.1 * one.steps)


def ran(plan, error=0.0, **more):
    """A result of a plan: straight paths, aside by an error."""
    t, n = plan.grid.times, plan.ensemble.members
    path = np.zeros((len(t), n, 3))
    path[..., 0] = t[:, None] * (1.0 + error)
    return made(path, t, attitude=np.tile(np.eye(3), (len(t), n, 1, 1)), **more)


def test_references_are_refined_where_they_do_not_agree(scene):
    """The member of odd index agrees only from the third refinement on."""
    grid = grid_of(scene, ("h", 0.1, 0.2), ("angular_velocity", 0.5, 1.0), (1, 2), 2)
    ((h, members),) = grid.columns()
    one, asked = column(h, members, 1.0, 2.0), []

    def run_plan(plan, threads):
        asked.append((plan.method.name, plan.grid.h, len(plan.ensemble.indices), threads))
        return ran(plan, 1e-3 * (len(asked) <= 4) * (len(asked) % 2) * (np.arange(plan.ensemble.members) % 2 == 1))

    shares = []
    text = runs.make_references(grid, [one], "position", 1e-3, 1, shares.append, run=run_plan)
    rate = max(values.max() for values in grid.rates().values())
    finer = math.ceil(h * rate / 0.2)
    first, second = runs.precise_pair(grid)
    assert text == f"{second} against {first}, steps that turn by 0.2 rad or less, halved until they agree"
    assert shares == [1.0]
    counts = [4, 4, 2, 2, 1, 1]
    assert [(name, n, threads) for name, _, n, threads in asked] == [
        ((first, second)[i % 2], counts[i], 1) for i in range(6)
    ]
    steps = [k for i in range(3) for k in (finer * 2**i, math.ceil(1.5 * finer * 2**i))]
    assert [h / step for _, step, _, _ in asked] == pytest.approx(steps)
    assert one.verified.tolist() == [True] * 4
    assert one.reference.members == 4


def test_a_scene_without_a_precise_method_has_no_map(scene):
    grid = grid_of(scene)
    refusing = lambda grid, names, dtype: dict.fromkeys(names, "no")  # noqa: E731
    with pytest.raises(lw.SceneError, match=r"method: the scene takes none of kl8\(psi_x\), .* for a reference"):
        runs.precise_pair(grid, refused=refusing)
    assert runs.precise_pair(grid) == ("kl8(psi_x)", "rk8")


def test_parts_of_a_reference_are_put_in_their_places():
    path = np.zeros((2, 3, 3))
    whole, part = (made(path, attitude=np.tile(np.eye(3), (2, 3, 1, 1))),
                   made(path[:, :2] + 1.0, status=[0, Status.NON_FINITE], end=[np.nan, 0.5]))  # fmt: skip
    assert runs.joined(None, part, np.array([0, 1])) is part
    before = whole.energy
    joined = runs.joined(whole, part, np.array([2, 0]))
    assert joined is whole
    assert joined.position[0, :, 0].tolist() == [1.0, 0.0, 1.0]
    assert list(joined.status) == [Status.NON_FINITE, 0, 0]
    assert joined.failure_time[0] == 0.5
    assert joined.energy is not before


def test_errors_and_growth_of_a_run_are_written_down():
    t = np.arange(5.0)
    one = column(1.0, np.array([2, 0, 1]), 2.0, 4.0)
    path = np.zeros((5, 3, 3))
    reference = made(path[:3], t[:3])
    one = dataclasses.replace(one, reference=reference)
    moved = path.copy()
    moved[1, 0, 0], moved[4, 0, 0], moved[2, 2, 0] = 0.5, 9.0, 0.25
    turned = np.broadcast_to(np.eye(3), (5, 3, 3, 3)).copy()
    turned[3, 1] *= 1.1
    result = made(moved, t, attitude=turned, status=[0, 0, Status.NON_FINITE], end=[np.nan, np.nan, 3.0])
    result = dataclasses.replace(result, warnings=np.array([0, 4, 0], np.uint16))
    of = compared_in("position")

    def found():
        return CellRuns(np.full(3, -1.0), np.full(3, -1.0), np.full(3, REFUSED), np.zeros(3, bool))

    seen = found()
    runs.judge(result, one, np.arange(3), seen, of, "conservative")
    # Members 2, 0 and 1 of the map; the last failed, and the error counts up to its time alone.
    assert seen.error.tolist() == [0.0, np.inf, 0.5]
    assert seen.status.tolist() == [0, Status.NON_FINITE, 0]
    assert seen.warned.tolist() == [True, False, False]
    growth = invariants.energy_growth(result)
    assert seen.growth[0] == pytest.approx(max(growth[1], 0.21 / 0.1))
    assert seen.growth[2] == growth[0]
    assert seen.growth[1] == np.inf
    damped = found()
    runs.judge(result, one, np.arange(3), damped, of, "dissipative")
    assert damped.growth[2] == invariants.energy_growth(result, dissipative=True)[0]
    driven = found()
    runs.judge(result, one, np.arange(3), driven, of, "driven")
    size = np.maximum(invariants.kinetic_energy(reference).max(axis=0), 1e-300)
    change = np.abs(result.energy[:3] - reference.energy).max(axis=0) / size
    assert driven.growth[2] == change[0] > 0.0
    bare = found()
    runs.judge(result, dataclasses.replace(one, reference=None), np.arange(3), bare, of, "conservative")
    assert bare.error.tolist() == [-1.0] * 3
    assert bare.growth.tolist() == seen.growth.tolist()
    stopped = made(moved, t, status=[Status.FLOOR, 0, 0], end=[1.5, np.nan, np.nan])
    early = found()
    runs.judge(stopped, one, np.arange(3), early, of, "conservative")
    assert early.error.tolist() == [0.0, 0.25, 0.5]


def test_a_column_that_is_refused_is_tried_in_halves(scene):
    """Cells of mass above 150 kg are refused; the others run."""
    grid = grid_of(scene, ("h", 0.1, 0.2), ("vehicle.mass", 100.0, 200.0), (1, 5), 2)
    ((h, members),) = grid.columns()
    one, asked = column(h, members, 1.0, 1.0), []

    def plan_of(grid, members, method, times, dtype, checks="safe"):
        asked.append((len(members), method, dtype, checks))
        if times is not runs.SHORTEST and (grid.varied["vehicle.mass"][members] > 150.0).any():
            raise lw.SceneError(["too heavy"])
        return SimpleNamespace(compile=lambda: 0.0, n=len(members), grid=times)

    def run_plan(plan, threads):
        return made(np.zeros((len(plan.grid.times), plan.n, 3)), plan.grid.times)

    of, parts = compared_in("position"), {"plan_of": plan_of, "run": run_plan, "prepare": lambda plan: 0.0}
    found, why = runs.run_method(grid, [one], "psi_s", "float32", of, "conservative", 1, **parts)
    assert why == "too heavy."
    assert asked[0] == (10, "psi_s", "float32", "all")
    assert found.status.tolist() == [0] * 6 + [REFUSED] * 4
    assert (found.error[6:] == np.inf).all()
    # Halves are of whole cells.
    assert [n for n, *_ in asked[1:]] == [10, 4, 6, 2, 4, 2, 2]


def test_a_map_of_runs_made_by_hand(scene):
    """psi_s errs and gets warnings beyond a step; rk4 fails beyond another; gauss4 is refused by the drag."""
    damped = dataclasses.replace(scene, terms=[lw.terms.Drag(linear=[1.0] * 6)])
    asked, shares = [], []

    def run_plan(plan, threads):
        name, h, n = plan.method.name, plan.grid.h, plan.ensemble.members
        asked.append((name, h, plan.dtype, plan.ensemble.members, float(plan.grid.times[-1])))
        if name == "rk4" and h > 0.3:
            return ran(plan, status=np.full(n, Status.NON_FINITE), end=np.full(n, h))
        result = ran(plan, 0.5 * (name == "psi_s" and h > 0.15))
        if name == "psi_s" and h > 0.3:
            return dataclasses.replace(result, warnings=np.ones(n, np.uint16))
        return result

    grid = StabilityGrid(damped, ("h", 0.1, 0.4), ("angular_velocity", 0.5, 2.0), (3, 2), 2, 5, None)
    found = map_of(grid, ["psi_s", "gauss4", "rk4"], compared_in("position"), "float32", t1=3.0, error_time=1.0, error=0.1,
                   energy_bound=4.0, seed=5, threads=1, report=shares.append, run=run_plan,
                   prepare=lambda plan: 0.0)  # fmt: skip
    assert found.classes["psi_s"].tolist() == [[0, 1, 2]] * 2
    assert found.classes["rk4"].tolist() == [[0, 0, 3]] * 2
    assert found.statuses["rk4"].tolist() == [[0, 0, 3]] * 2
    assert list(found.refused) == ["gauss4"]
    assert found.errors["psi_s"][:, 1] == pytest.approx([0.5 * 1.0] * 2, rel=0.25)
    assert found.errors["rk4"][0, 2] == np.inf
    assert (found.of, found.unit, found.error_bound, found.error_time, found.t1) == ("position", "m", 0.1, 1.0, 3.0)
    assert (found.directions, found.judged, found.unverified, found.messages) == (2, "dissipative", 0, ())
    assert (found.provenance["methods"], found.provenance["seed"]) == (["psi_s", "rk4"], 5)
    assert (found.provenance["dtype"], found.provenance["energy_bound"]) == ("float32", 4.0)
    assert found.provenance["axes"]["x"]["low"] == 0.1
    assert set(found.provenance) >= {"scene", "versions", "machine", "checks"}
    assert {dtype for name, _, dtype, *_ in asked if name in ("psi_s", "rk4")} == {"float32"}
    assert {n for *_, n, _ in asked} == {4}
    assert shares[-1] == 1.0
    assert shares == sorted(shares)
    assert 0.4 in shares
    assert found.x.values == pytest.approx([0.1, 0.2, 0.4])
    assert found.limit("rk4") == pytest.approx([0.2, 0.2])
    drag = found.ratios["rk4"]["drag"]
    assert drag[0] == pytest.approx(drag[1])
    assert drag[0] / drag[0, 0] == pytest.approx([1.0, 2.0, 4.0])
    assert "drag" not in found.ratios["psi_s"]
    assert "rotation" in found.ratios["psi_s"]
    bound = dataclasses.replace(found)
    assert (bound.energies["psi_s"] <= 1.0).all()


def test_times_of_a_map_follow_the_fastest_motion(scene):
    def of(single=scene, t1=None, error_time=None):
        grid = StabilityGrid(single, ("h", 0.1, 0.4), "angular_velocity", (1, 1), 1, 0, None)
        return map_of(grid, ["psi_s"], compared_in("attitude"), "float64", t1=t1, error_time=error_time, error=0.01,
                      energy_bound=2.0, seed=0, threads=1, run=lambda plan, threads: ran(plan),
                      prepare=lambda plan: 0.0)  # fmt: skip

    period = 2.0 * math.pi / grid_of(scene).rate
    assert (of().error_time, of().t1) == pytest.approx((period, 10.0 * period))
    assert (of(t1=1.0).error_time, of(t1=1.0).t1) == (1.0, 1.0)
    assert of(t1=1.0, error_time=2.0).t1 == 2.0
    pushed = dataclasses.replace(scene, terms=[lw.terms.Wrench(force=[500.0, 0.0, 0.0])])
    driven = of(pushed, error_time=0.5, t1=9.0)
    assert (driven.judged, driven.t1, driven.error_time) == ("driven", 0.5, 0.5)
    assert of().reference.startswith("rk8 against kl8(psi_x), steps")
    assert of().directions == 1


def test_what_drives_a_scene_by_kind(scene):
    def kind(*terms):
        return runs.judged(grid_of(dataclasses.replace(scene, terms=list(terms))), ["psi_s"])

    drag, current = lw.terms.Drag(linear=[1.0] * 6), lw.terms.Current(velocity=[0.3, 0.0, 0.0])
    assert [kind(), kind(drag), kind(current), kind(drag, current)] == [
        "conservative", "dissipative", "conservative", "dissipative"]  # fmt: skip
    assert kind(lw.terms.Current(velocity=[0.0, 0.0, 0.1])) == kind(lw.terms.Wrench(force=[1.0, 0.0, 0.0])) == "driven"
    assert kind(current, lw.terms.Tether(anchor=[0.0, 0.0, 0.0], stiffness=5.0)) == "driven"
    with pytest.raises(lw.SceneError, match="terms: noise acts, whose path differs from step to step"):
        kind(lw.terms.WrenchNoise(force=[1.0, 0.0, 0.0]))


@pytest.mark.parametrize(("name", "first"), [("rkn6_11", "B"), ("rkn6_14", "A")])
def test_limits_of_methods_of_two_parts(name, first):
    """The step is a product of shears, turn and kick by turns; its trace leaves 2 at the limit."""
    stages = Method(name).stages
    turns = [(i % 2 == 0) == (first == "A") for i in range(len(stages))]

    def half_trace(y):
        step = np.eye(2)
        for turn, g in zip(turns, stages, strict=True):
            shear = np.array([[1.0, g * y], [0.0, 1.0]]) if turn else np.array([[1.0, 0.0], [-g * y, 1.0]])
            step = shear @ step
        return 0.5 * abs(np.trace(step))

    for kind in ("munk", "restoring"):
        limit = oscillation_limit(name, kind)
        assert max(half_trace(y) for y in np.linspace(0.01, limit - 0.01, 300)) <= 1.0 + 1e-5 < half_trace(limit + 0.01)
    longest = max(abs(g) for turn, g in zip(turns, stages, strict=True) if turn)
    assert rotation_limit(name) == pytest.approx(0.5 * math.pi / longest, rel=1e-12)


def test_methods_that_iterate_have_no_limit_by_theory():
    assert math.isnan(oscillation_limit("gauss4"))
    assert math.isnan(rotation_limit("gauss4"))
    assert rotation_limit("rk4") == oscillation_limit("rk4")
    assert rotation_limit("cg3") == math.inf
