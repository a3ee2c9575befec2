# SPDX-License-Identifier: Apache-2.0
"""Pictures of sweeps by content: what is drawn, where, and how it is labelled. The sweep is that of test_sweep."""

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.status import failed
from lgvi_warp.robustness.sweeps.output import against_baseline
from lgvi_warp.views.plots import sweep_pictures as sweeps
from tests.studies.test_sweep import found, scene, swept  # noqa: F401  (fixtures)


@pytest.fixture(scope="module")
def plain(scene):  # noqa: F811
    """Without a grid: three cases, one of which is refused; distances are tracked as well."""
    return swept(scene, grid=None, members=20, metrics=["max_error position", "iae heading"], success=None)


def bars_of(axes):
    """Value, lower and upper end of each error bar [%], in the order drawn."""
    rows = []
    for container in axes.containers:
        line, _, (segments,) = container
        ends = np.array(segments.get_segments())
        rows += [(y, *sorted(end[:, 1])) for y, end in zip(line.get_ydata(), ends, strict=True)]
    return np.array(rows)


@pytest.mark.ci
def test_success_over_one_axis_has_a_line_for_each_case(found, tmp_path):  # noqa: F811
    (axes,) = sweeps.plot_success(found, tmp_path / "success.png")
    assert (tmp_path / "success.png").stat().st_size > 10_000
    cells = [cell for cell in found.cells if not found.record(cell).refused]
    expected = [100.0 * np.array(found.success(cell.case.name, cell.point)) for cell in cells]
    np.testing.assert_allclose(bars_of(axes), expected, atol=1e-9)
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["soft", "stiff"]
    assert axes.get_xlabel() == "controller.delay [s]"
    assert "95% interval" in axes.get_ylabel()


@pytest.mark.ci
def test_success_of_cases_alone(plain):
    (axes,) = sweeps.plot_success(plain)
    assert [label.get_text() for label in axes.get_xticklabels()] == ["soft", "stiff"]
    expected = [100.0 * np.array(plain.success(case)) for case in ("soft", "stiff")]
    np.testing.assert_allclose(bars_of(axes), expected, atol=1e-9)


@pytest.mark.ci
def test_success_over_two_axes_is_a_map_with_intervals(scene):  # noqa: F811
    grid = {"controller.delay": [0.02, 0.04], "heading_pid.kd": [3.0, 4.0], "heading_pid.ki": [0.0]}
    wide = swept(scene, grid=grid, members=20)
    panels = sweeps.plot_success(wide)
    assert [axes.get_title() for axes in panels] == [f"{case}: members that pass [%]" for case in wide.cases]
    for axes, case in zip(panels, wide.cases, strict=True):
        image = axes.get_images()[0].get_array()
        for text in axes.texts:
            (i, j) = (round(place) for place in text.get_position())
            point = {"controller.delay": grid["controller.delay"][i], "heading_pid.kd": grid["heading_pid.kd"][j]}
            (cell,) = wide.cells_of(case, point)
            if wide.record(cell).refused:
                assert text.get_text() == "refused"
                continue
            value, lower, upper = 100.0 * np.array(wide.success(case, cell.point))
            assert image[j, i] == value
            assert text.get_text() == f"{value:.1f}\n{lower:.1f} to {upper:.1f}"
        assert len(axes.texts) == 4


def test_boxes_are_quantiles_of_members_that_count(found):  # noqa: F811
    panels = sweeps.plot_metrics(found)
    names = [name for name in found.metrics if name != "time_to_failure"]
    assert [axes.get_ylabel().split("\n")[0] for axes in panels] == names
    assert [label.get_text() for label in panels[-1].get_xticklabels()][:2] == ["soft, 0.02", "soft, 0.04"]
    cell = found.cells[0]
    record = found.record(cell)
    for axes, name in zip(panels, names, strict=True):
        numbers = record.numbers[name][np.isfinite(record.numbers[name]) & ~failed(record.status)]
        box = axes.patches[0].get_path().vertices[:, 1]
        np.testing.assert_allclose((box.min(), box.max()), np.quantile(numbers, (0.25, 0.75)), rtol=1e-12)


def test_differences_are_paired_ones_from_the_top_down(found):  # noqa: F811
    (axes,) = sweeps.plot_differences(found)
    rows = [row for row in against_baseline(found) if row.of == "success"]
    drawn = {}
    for container in axes.containers:
        line, _, (segments,) = container
        for y, x, ends in zip(line.get_ydata(), line.get_xdata(), segments.get_segments(), strict=True):
            drawn[round(y)] = (x, ends[0, 0], ends[1, 0], line.get_color() == sweeps.COLORS[0])
    for i, row in enumerate(rows):
        d = row.difference
        np.testing.assert_allclose(drawn[i][:3], 100.0 * np.array([d.value, d.lower, d.upper]), atol=1e-9)
        assert drawn[i][3] == bool(row.real)
    assert len(drawn) == len(rows)
    assert axes.get_ylim()[0] > axes.get_ylim()[1]


def test_causes_are_those_of_the_worst_cell(found):  # noqa: F811
    (axes,) = sweeps.plot_causes(found)
    cells = [cell for cell in found.cells if not found.record(cell).refused]
    cell = min((cell for cell in cells if found.passed(cell).any()), key=lambda cell: found.passed(cell).mean())
    rows = found.causes(cell.case.name, cell.point)
    assert axes.get_title().endswith(f": {cell.name}")
    assert axes.get_xlabel().startswith(rows[0]["input"])
    passed, x = found.passed(cell), found.inputs(cell)[rows[0]["input"]]
    for line, chosen in zip(axes.get_lines(), (passed, ~passed), strict=True):
        assert line.get_xdata().tolist() == x[chosen].tolist()
        assert line.get_label().endswith(f": {chosen.sum():,}")


@pytest.mark.ci
def test_responses_are_fans_of_members_run_again(plain):
    panels = sweeps.plot_responses(plain, of="position", members=5)
    assert [axes.get_title() for axes in panels] == ["100 % pass: soft", "100 % pass: stiff"]
    figure = panels[0].figure
    assert figure.get_supylabel() == "error of position [m]: 5 members"
    result = plain.again("soft", range(5), None, lw.SaveAt(every=0.5, fields=("position", "reference_position")))
    away = np.linalg.norm(result.reference_position - result.position, axis=2)
    (median,) = (line for line in panels[0].get_lines() if line.get_label() == "median")
    drawn = np.interp(result.time, median.get_xdata(), median.get_ydata())
    np.testing.assert_allclose(drawn[[0, -1]], np.median(away, axis=1)[[0, -1]], rtol=1e-12)
    headings = sweeps.plot_responses(plain, of="heading", members=3)
    assert "reference" in [line.get_label() for line in headings[0].get_lines()]
    with pytest.raises(NothingToDraw, match="no metric is of a number that is tracked"):
        sweeps.plot_responses(plain, of="overshoot")


def test_what_cannot_be_drawn_says_so(scene):  # noqa: F811
    refused = swept(scene, cases={"unknown": {"heading_pid.kpp": 1.0}}, grid=None, members=2)
    for draw in sweeps.pictures(refused).values():
        with pytest.raises(NothingToDraw, match="all cells were refused"):
            draw(refused)
    assert "differences.png" not in sweeps.pictures(refused)
