# SPDX-License-Identifier: Apache-2.0
"""Grids of stability maps, limits by linear theory, maps as files."""

import dataclasses
import json
import math

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from lgvi_warp.methods.limits import drag_limit
from lgvi_warp.physics import notation, vehicle
from lgvi_warp.physics.rates import drag_rate, rates
from lgvi_warp.scene.settings import RunSettings
from lgvi_warp.studies.stability.grid import Axis, Line, StabilityGrid, rotation_vectors
from lgvi_warp.studies.stability.limits import oscillation_limit, rotation_limit
from lgvi_warp.studies.stability.map import Cell, StabilityMap, cells_of
from lgvi_warp.studies.stability.runs import REFUSED, Found


def grid_of(scene, x="h", y="angular_velocity", points=(3, 4), directions=2, h=None):
    return StabilityGrid(scene, x, y, points, directions, 0, h)


def by_cell(grid, values):
    """(ny, nx, directions, ...)."""
    return values.reshape(*grid.shape, *values.shape[1:])


def drag_scene(scene):
    return dataclasses.replace(scene, terms=[lw.Drag(linear=[1.0] * 6, quadratic=[0, 0, 40.0, 0, 0, 0])])


@pytest.mark.parametrize(
    ("text", "axis"),
    [
        ("h", Axis("h")),
        ("h=0.01:3", Axis("h", 0.01, 3.0)),
        ("vehicle.mass=50:500:linear", Axis("vehicle.mass", 50.0, 500.0, log=False)),
        ("vehicle.inertia=0.1:10:log:scale", Axis("vehicle.inertia", 0.1, 10.0, scaled=True)),
        ("vehicle.mass=1:2:set", Axis("vehicle.mass", 1.0, 2.0, scaled=False)),
    ],
)
def test_an_axis_is_read(text, axis):
    assert Axis.parse(text) == axis


def test_values_rise_by_equal_factors_or_equal_steps():
    assert np.allclose(Axis("h", 0.1, 10.0).values(3), [0.1, 1.0, 10.0])
    assert np.allclose(Axis("h", 1.0, 3.0, log=False).values(3), [1.0, 2.0, 3.0])


def test_axes_without_a_range_fit_the_scenes_own_rate(scene):
    grid = grid_of(scene)
    w = grid.rate
    assert w > 0.0 and abs(w - 1.0) > 0.1  # at 1 rad/s a product is a quotient
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
        assert np.allclose(sizes, sizes[0]) and sizes[0] > 0.0


def test_a_start_at_rest_is_given_a_direction():
    scene = lw.Scene(lw.Vehicle(1.0, (1.0, 1.0, 1.0)), run=RunSettings(step=0.1))
    grid = grid_of(scene, ("speed", 1.0, 4.0), ("angular_velocity", 0.5, 4.0), h=0.1)
    assert np.allclose(
        np.linalg.norm(by_cell(grid, grid.state["velocity"]), axis=-1), np.array([1, 2, 4])[None, :, None]
    )
    still = grid_of(scene, ("h", 1.0, 4.0), ("environment.gravity", 1.0, 2.0))
    assert not np.any(still.state["velocity"]) and not np.any(still.state["angular_velocity"])


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
    assert (x.unit, y.unit) == ("kg", "1") and "/ the scene's" in y.label
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
    assert len(columns) == 3 and sorted(np.concatenate([members for _, members in columns])) == list(range(24))
    assert all(np.all(grid.h[members] == h) for h, members in columns)


def test_all_faults_at_once(scene):
    with pytest.raises(lw.SceneError) as caught:
        lw.stability_map(scene, "vehicle.mas", "angular_velocity=3:1", error=-1.0, of="heat", points=4)
    text = str(caught.value)
    assert all(
        word in text for word in ("vehicle.mas", "did you mean 'vehicle.mass'", "does not rise", "error = -1", "heat")
    )
    with pytest.raises(lw.SceneError, match=r"2 faults(.|\n)*points(.|\n)*directions"):
        lw.stability_map(scene, points=0, directions=0)


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        ("h", "h", "both axes"),
        ("speed", "angular_velocity", "missing, and is on no axis"),
        ("h=a:b", "speed", "NAME=LOW:HIGH"),
        ("h=1:2:cubic", "speed", "NAME=LOW:HIGH"),
        ("h=-1:2", "speed", "above 0"),
        ("h", "vehicle.inertia=1:2:log:set", "multiplied"),
    ],
)
def test_bad_axes_are_refused(scene, x, y, words):
    with pytest.raises(lw.SceneError, match=words):
        grid_of(dataclasses.replace(scene, run=RunSettings()), x, y)


def test_drag_that_is_zero_at_the_start_cannot_be_scaled():
    scene = lw.Scene(lw.Vehicle(1.0, (1.0, 1.0, 1.0)), terms=[lw.Drag(quadratic=[1.0] * 6)])
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
    assert rotation_limit("psi_s") == 2.0 and rotation_limit("psi_1") == 1.0 and rotation_limit("rkmk4") == math.inf
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
    assert drag_limit("phi") == 2.0 and math.isclose(drag_limit("tj4(psi_s)"), 0.5 / 1.7024, rel_tol=1e-4)


def test_rates_of_the_example(scene):
    m = lw.Ensemble(scene, 1).select(0, 1)
    found = rates(m.parameters, m.velocity, m.angular_velocity)
    p = (123.8 + np.array([65.0, 70.0, 75.0])) * m.velocity[0]
    w = np.linalg.norm(p) * math.sqrt((1 / 188.8 - 1 / 198.8) / 5.29)
    assert math.isclose(found["munk"][0], w) and math.isclose(found["rotation"][0], math.sqrt(0.14))
    assert math.isclose(found["restoring"][0], math.sqrt(1215.8 * 0.007 / 5.29)) and found["drag"][0] == 0.0


# Classes and files


def test_classes_are_a_table_of_bounded_and_flagged():
    status = np.array([0, 0, Status.STEP_TOO_LARGE, Status.NON_FINITE, 0, 0, Status.SURFACE, REFUSED, 0])
    growth = np.array([0.1, 0.1, 0.1, np.inf, 2.0, 0.1, 0.1, 0.0, 2.0])
    error = np.array([1e-3, 1.0, np.inf, np.inf, 1e-3, 1e-3, 1e-3, np.inf, 1e-3])
    warned = np.array([False, False, False, False, False, True, False, False, True])
    verified = np.ones(9, bool)
    found = Found(error, growth, status, warned)
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
    assert found.limit("psi_s")[0] == 2.0 and np.isnan(found.limit("psi_s")[1])
    assert found.limit("psi_s", Cell.ACCURATE)[0] == 1.0
    assert list(found.limit("psi_s", Cell.FLAGGED)) == [4.0, 4.0]
    assert found.counts("psi_s") == {"accurate": 3, "bounded": 1, "flagged": 2, "failed": 0, "silent": 0}
    with pytest.raises(lw.SceneError, match="did you mean 'psi_s'"):
        found.limit("psi")


def test_silent_cells_are_listed():
    assert made_map([[0, 1, 4], [0, 4, 0]]).silent("psi_s") == [(4.0, 1.0), (2.0, 10.0)]


def test_json_round_trip(tmp_path):
    found = made_map([[0, 1, 2], [2, 0, 4]])
    files = found.save(tmp_path)
    again = StabilityMap.load(files[0])
    assert again.to_dict() == found.to_dict() == json.loads(files[0].read_text())
    assert np.array_equal(again.errors["psi_s"], found.errors["psi_s"]) and again.classes["psi_s"].dtype == np.int64
    rows = files[1].read_text().splitlines()
    assert len(rows) == 7 and rows[0].startswith("method,h,angular_velocity,class,error_attitude")
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
    assert set(counts) == {cell.name.lower() for cell in Cell} and sum(counts.values()) == 6
    assert [counts[Cell(code).name.lower()] for code in (0, 1, 4)] == [3, 1, 2]


@pytest.mark.parametrize("ask", ["counts", "silent", "limit"])
def test_a_method_that_the_map_has_not_is_refused(ask):
    with pytest.raises(lw.SceneError, match=r"method = 'psi'.*'psi_s'"):
        getattr(made_map([[0, 1, 2], [2, 0, 0]]), ask)("psi")
