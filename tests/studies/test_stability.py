# SPDX-License-Identifier: Apache-2.0
"""Stability maps: cells whose class is known, beside the analytic limits; the command and the picture."""

import dataclasses

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.accuracy.stability import map as stability
from lgvi_warp.accuracy.stability.grid import StabilityGrid
from lgvi_warp.accuracy.stability.map import Cell, StabilityMap
from lgvi_warp.accuracy.stability.runs import column, make_references
from lgvi_warp.engine.step_warnings import COARSE
from lgvi_warp.physics import energy as invariants
from tests.conftest import ROOT
from tests.support.refusals import says

PAPER = str(ROOT / "examples" / "paper.toml")
METHODS = ["psi_s", "psi_x"]


@pytest.fixture(scope="module")
def answer(scene):
    """Step against angular velocity of the paper's vehicle, coarse."""
    axes = ("h", 0.01, 2.0), ("angular_velocity", 0.5, 20.0)
    return lw.stability_map(scene, *axes, METHODS, points=8, t1=10.0, error_time=2.0, directions=3)


def number(answer):
    """h |Omega| of every cell."""
    return answer.y.values[:, None] * answer.x.values


@pytest.mark.ci
def test_beyond_the_solvable_step_every_cell_is_flagged(answer):
    # h |J^-1 pi| = 2 for psi_s; a little less, since weight and Munk moment spin some starts up, or down by h |Om| / 2.
    beyond = number(answer) > 2.0 * 1.2
    assert beyond.sum() > 8
    assert np.all(answer.classes["psi_s"][beyond] == Cell.FLAGGED)
    assert np.all(answer.statuses["psi_s"][beyond] == lw.Status.STEP_TOO_LARGE)


def test_short_steps_are_accurate(answer):
    # Order 2: the error over error_time is of the size of (h |Om|)^2 |Om| error_time / 12, far below 1e-2 here.
    fine = (number(answer) ** 2 * answer.y.values[:, None] * answer.error_time < 1e-2) & (answer.x.values < 0.03)
    assert fine.sum() >= 4
    assert all(np.all(answer.classes[method][fine] == Cell.ACCURATE) for method in METHODS)


def test_between_they_are_bounded(answer):
    h_w = answer.x.values * 1.42  # w of the Munk oscillation at the start, the fastest besides the spin
    middle = (number(answer) > 0.5) & (number(answer) < 1.5) & (h_w < 0.5)
    assert middle.sum() >= 4
    assert np.all(answer.classes["psi_s"][middle] == Cell.BOUNDED)
    assert np.all(answer.energies["psi_s"][middle] <= 1.0)
    assert np.all(answer.errors["psi_s"][middle] > 1e-2)


def test_the_measured_limit_is_the_analytic_one(answer):
    limit = answer.limit("psi_s")
    ratios = answer.ratios["psi_s"]["rotation"]
    assert np.allclose(ratios, number(answer) / 2.0)
    assert np.allclose(answer.ratios["psi_x"]["rotation"], number(answer) / 4.0)
    fast = answer.y.values > 4.0
    factor = answer.x.values[1] / answer.x.values[0]
    # The last good step lies within a cell below, and never beyond h |Om| = 2.
    assert np.all(limit[fast] * answer.y.values[fast] <= 2.0 * 1.001)
    assert np.all(limit[fast] * answer.y.values[fast] * factor > 2.0 / 1.2)


def test_turns_that_are_too_long_are_flagged(answer):
    # psi_x has no equation without solution: the angle of its turns tells, and nothing breaks silently.
    assert np.any(answer.statuses["psi_x"] == lw.Status.STEP_TOO_LARGE)
    assert not np.any(answer.classes["psi_x"] == Cell.SILENT)


def test_classes_and_numbers_agree(answer):
    for method in METHODS:
        classes = answer.classes[method]
        assert np.all(answer.errors[method][classes == Cell.ACCURATE] <= answer.error_bound)
        assert np.all(answer.energies[method][classes < Cell.FAILED] <= 1.0)
        assert sum(answer.counts(method).values()) == 64
    assert (answer.unverified, answer.judged) == (0, "conservative")


@pytest.mark.ci
def test_errors_are_those_of_a_run_of_its_own(answer, scene):
    """One cell again by lw.solve: the error against a step 16 times shorter of a method of order 8."""
    i, j = 2, 2
    h, Om = float(answer.x.values[j]), float(answer.y.values[i])
    steps = int(np.ceil(answer.error_time / h))
    start = dataclasses.replace(
        scene.start, angular_velocity=Om * scene.start.angular_velocity / np.linalg.norm(scene.start.angular_velocity)
    )
    one = dataclasses.replace(scene, start=start, ensemble_settings=None)
    coarse = lw.solve(one, "psi_s", h=h, t1=steps * h, save=lw.SaveAt())
    fine = lw.solve(one, "kl8(psi_x)", h=h / 16, t1=steps * h, save=lw.SaveAt())
    R = np.swapaxes(coarse.attitude[-1, 0], 0, 1) @ fine.attitude[-1, 0]
    angle = np.arccos(np.clip(0.5 * (np.trace(R) - 1.0), -1.0, 1.0))
    # The largest of 3 starts and of all times is at least this one's at the end.
    assert 1e-5 < angle <= answer.errors["psi_s"][i, j] * 1.001


@pytest.mark.ci
def test_the_reference_is_verified_by_another(scene):
    grid = StabilityGrid(scene, ("h", 0.05, 0.2), ("angular_velocity", 1.0, 8.0), (2, 2), 1, 0, None)
    columns = [column(h, members, 1.0, 1.0) for h, members in grid.columns()]
    make_references(grid, columns, "attitude", 1e-4, 1, lambda part: None)
    assert all(one.verified.all() for one in columns)
    # Asked for what no run can have, no member is.
    make_references(grid, columns[:1], "attitude", 1e-18, 1, lambda part: None)
    assert not columns[0].verified.any()


def test_growth_of_energy_is_over_what_the_start_can_hold(scene):
    result = lw.solve(
        dataclasses.replace(scene, ensemble_settings=None), "psi_s", h=0.01, t1=2.0, save=lw.SaveAt(every=0.5)
    )
    assert 0.0 < invariants.energy_growth(result)[0] < 1e-4

    def altered(factor):
        velocity = result.velocity.copy()
        velocity[-1] *= factor
        return dataclasses.replace(result, samples=result.samples | {"velocity": velocity})

    faster, slower, lost = (altered(factor) for factor in (2.0, 0.5, np.nan))
    # Four times the kinetic energy of translation: three times what it was too much, of M from 189 to 199 kg.
    assert 2.5 < invariants.energy_growth(faster)[0] < 3.5
    assert invariants.energy_growth(lost)[0] == np.inf
    assert invariants.energy_growth(slower)[0] > 0.6 > invariants.energy_growth(slower, dissipative=True)[0]


def test_the_worst_status_is_of_a_failure_before_an_event(scene):
    grid = StabilityGrid(scene, "h", "angular_velocity", (2, 2), 3, 0, None)
    status = np.array([0, 16, 3, 0, 0, 16, 255, 16, 1, 0, 0, 0])
    assert stability.worst_status(grid, status).tolist() == [[3, 16], [255, 0]]


@pytest.mark.ci
def test_the_same_for_any_number_of_threads(scene):
    maps = [lw.stability_map(scene, ("h", 0.05, 1.0), ("angular_velocity", 1.0, 4.0), ["psi_s"], points=3, t1=4.0,
                             error_time=1.0, threads=n) for n in (1, 3)]  # fmt: skip
    assert np.array_equal(maps[0].errors["psi_s"], maps[1].errors["psi_s"])
    assert np.array_equal(maps[0].energies["psi_s"], maps[1].energies["psi_s"])


@pytest.mark.ci
def test_progress_rises_to_one(scene):
    seen = []
    lw.stability_map(scene, ("h", 0.05, 1.0), ("angular_velocity", 1.0, 4.0), ["psi_s"], points=2, t1=4.0,
                     error_time=1.0, progress=seen.append)  # fmt: skip
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert len(seen) > 2


@pytest.mark.ci
def test_a_step_on_no_axis(scene):
    one = lw.stability_map(scene, ("speed", 0.1, 2.0), ("angular_velocity", 1.0, 4.0), ["psi_s"], points=(3, 2), t1=4.0,
                           error_time=1.0, h=0.01)  # fmt: skip
    assert one.classes["psi_s"].shape == (2, 3)
    assert np.all(one.classes["psi_s"] == Cell.ACCURATE)
    assert np.all(one.limit("psi_s") == one.x.values[-1])


@pytest.mark.slow
def test_exact_drag_has_no_limit_and_explicit_drag_has(scene):
    """h (l + 2 q |v|) / I: none for psi_s, told beyond 5; 2.785 for rk4, whose drag grows beyond; backward is refused."""
    axes = ("h", 0.02, 0.5), ("drag_number", 0.5, 500.0)
    one = lw.stability_map(scene, *axes, ["psi_s", "rk4", "kl8(psi_x)"], points=8, t1=10.0, error_time=2.0)
    drag = one.x.values * one.y.values[:, None]
    # Half a second is coarse for the Munk oscillation, which is said of its cells whatever the drag; 2 is its limit.
    resolved = 2.0 * one.ratios["psi_s"]["munk"] <= COARSE
    assert np.all(resolved[:, :-1])
    assert not np.any(resolved[:, -1])
    assert one.judged == "dissipative"
    # A splitting keeps drag bounded at any step, and loses its order where drag is stiff.
    told = ~resolved | (drag > 5.0)
    assert np.all(one.classes["psi_s"][~told] <= Cell.BOUNDED)
    assert np.all(one.classes["psi_s"][told] == Cell.FLAGGED)
    assert np.all(one.statuses["psi_s"] == lw.Status.OK)
    # Beyond its limit every member of rk4 gets a status, and is frozen before or after its energy passed the bound. Short of
    # it none does, though near it the warning that its matrices leave the rotations flags some cells.
    beyond, short = one.statuses["rk4"][drag > 2.785 * 1.1], one.statuses["rk4"][drag < 2.0]
    assert np.all(beyond != lw.Status.OK)
    assert np.all(short == lw.Status.OK)
    assert np.all(one.energies["rk4"][drag < 2.0] <= 1.0)
    assert np.all(one.classes["rk4"][drag > 2.785 * 1.1] >= Cell.FLAGGED)
    assert np.allclose(one.ratios["rk4"]["drag"] * 2.785, drag, rtol=1e-3)
    refused = one.statuses["kl8(psi_x)"] == 255
    # The longest stage that goes backward is .6055 of a step, and is to have a drag number of .5 at most.
    assert np.all(refused[drag * 0.6055 > 0.55])
    assert not np.any(refused[drag * 0.6055 < 0.45])
    assert np.all(one.classes["kl8(psi_x)"][refused] == Cell.FLAGGED)
    assert any("goes backward" in text for text in one.messages)


@pytest.mark.slow
def test_what_drives_a_scene_is_compared_with_the_reference(scene):
    pushed = dataclasses.replace(scene, terms=[lw.terms.Wrench(force=[500.0, 0.0, 0.0])])
    one = lw.stability_map(pushed, ("h", 0.01, 0.3), "angular_velocity", ["psi_s"], points=4)
    assert (one.judged, one.t1) == ("driven", one.error_time)
    assert np.all(one.classes["psi_s"][:2, 0] == Cell.ACCURATE)


def test_a_method_that_the_scene_refuses_is_named(scene):
    """gauss4 takes no drag; the rest goes on."""
    damped = dataclasses.replace(scene, terms=[lw.terms.Drag(linear=[1.0] * 6)])
    with pytest.raises(lw.SceneError, match="gauss4"):
        lw.stability_map(damped, ("h", 0.05, 1.0), "angular_velocity", ["gauss4"], points=2, t1=1.0, error_time=0.5)


@pytest.mark.ci
def test_a_picture_of_linear_axes_and_of_one_row(scene, tmp_path):
    axes = "angular_velocity=1:4:linear", "h=0.05:1"
    for points in ((3, 2), (3, 1)):
        one = lw.stability_map(scene, *axes, ["psi_s"], points=points, t1=4.0, error_time=1.0)
        lw.plots.stability(one, path=tmp_path / "one.png")
        assert (tmp_path / "one.png").stat().st_size > 5000


@pytest.mark.ci
def test_the_command(tmp_path, capsys):
    arguments = ["--x", "h=0.02:2", "--y", "angular_velocity", "--methods", "psi_s", "--points", "5", "--duration", "8"]
    assert cli.main(["stability", PAPER, "--out", str(tmp_path), *arguments, "--seed", "3"]) == 0
    out = capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["stability.csv", "stability.json", "stability.png"]
    again = StabilityMap.load(tmp_path / "stability.json")
    assert (again.t1, again.classes["psi_s"].shape, again.provenance["seed"]) == (8.0, (5, 5), 3)
    says(out, "limit of h over angular_velocity", "stability.png")
    assert again.provenance["scene"]["vehicle"]["mass"] == 123.8
    assert "warp-lang" in again.provenance["versions"]


@pytest.mark.parametrize(("arguments", "words"), [
    (["--grid", "mass", "--x", "h"], ["--grid mass", "Leave out"]),
    (["--x", "h=3:1", "--error", "-1"], ["2 faults", "does not rise", "error = -1"]),
    (["--methods", "psi_z"], ["psi_z", "not known"]), (["--y", "vehicle.mas"], ["Did you mean 'vehicle.mass'"]),
    (["--seed", "x"], ["seed"]),
])  # fmt: skip
def test_a_bad_argument_is_refused_with_the_remedy(arguments, words, tmp_path, capsys):
    assert cli.main(["stability", PAPER, "--out", str(tmp_path / "out"), *arguments]) == 2
    text = capsys.readouterr().err
    assert all(word in text for word in words)
    assert "Traceback" not in text


@pytest.mark.ci
def test_a_map_of_whatever_statistics_know(scene):
    """A depth's error is that of the position at most: where the position is accurate, it is."""
    axes = ("h", 0.02, 0.5), ("angular_velocity", 0.5, 5.0)
    asked = {"points": 3, "t1": 4.0, "error_time": 2.0, "directions": 2, "error": 1e-4}
    depth, position = (lw.stability_map(scene, *axes, ["psi_x"], of=of, **asked) for of in ("depth", "position"))
    assert (depth.of, depth.unit) == ("depth", "m")
    assert "accurate    depth to 0.0001 m" in str(depth)
    assert (depth.errors["psi_x"] <= position.errors["psi_x"] * (1.0 + 1e-9)).all()
    assert (depth.errors["psi_x"] > 0.0).all()
    good = position.classes["psi_x"] == Cell.ACCURATE
    assert good.any()
    assert (depth.classes["psi_x"][good] == Cell.ACCURATE).all()
    back = StabilityMap.from_dict(depth.to_dict())
    assert back.unit == "m"
    assert "error_depth" in back.rows()[0]
    old = {name: value for name, value in position.to_dict().items() if name != "unit"}
    assert StabilityMap.from_dict(old).unit == "m"
