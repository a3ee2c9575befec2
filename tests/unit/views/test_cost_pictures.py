# SPDX-License-Identifier: Apache-2.0
"""Pictures of what a member's step costs: files and refusals; and that the measured rows fit them."""

import json

import pytest
from matplotlib.figure import Figure

import lgvi_warp as lw
from lgvi_warp.common.errors import NothingToDraw

RUNS = [
    {"members": n, "threads": k, "steps": 10, "ns_per_vehicle_step": 100.0 / k + 1000.0 / n}
    for n in (10, 1000, 100_000)
    for k in (1, 2, 4)
]
TERMS = [
    {
        "term": name,
        "method": method,
        "dtype": dtype,
        "ns_per_vehicle_step": price * (0.5 if dtype == "float32" else 1.0),
    }
    for name, price in {"none": 14.0, "drag": 16.0, "waves": 72.0}.items()
    for method in ("psi_s", "psi_x")
    for dtype in ("float64", "float32")
]


def test_files_of_the_benchmarks_are_read_and_pictures_written(tmp_path):
    lines = tmp_path / "rows.jsonl"
    lines.write_text("a line of text\n" + "".join(json.dumps({"case": "x"} | row) + "\n" for row in RUNS + TERMS))
    figure = Figure(figsize=(12.0, 5.0), layout="constrained")
    assert lw.plots.scaling(lines, figure=figure)[0].figure is figure
    axes = Figure().subplots()
    assert lw.plots.term_cost(str(lines), ax=axes, path=tmp_path / "terms.svg") is axes
    assert axes.get_title() == ""
    assert (tmp_path / "terms.svg").stat().st_size > 5000


def test_rows_of_another_kind_are_refused():
    with pytest.raises(NothingToDraw, match="Give rows of `python -m benchmarks run members threads`"):
        lw.plots.scaling(TERMS)
    with pytest.raises(NothingToDraw, match=r"Give rows of lw.bench.term_cost\(scene\)"):
        lw.plots.term_cost(RUNS)


def test_what_cannot_be_measured_is_refused(scene):
    with pytest.raises(lw.SceneError, match="terms is empty"):
        lw.bench.term_cost(scene, h=0.1)


@pytest.mark.kernel
@pytest.mark.slow
def test_measured_rows_fit_the_pictures(scene):
    waves = {"type": "waves", "amplitudes": [0.5], "periods": [8.0], "headings_deg": [0.0]}
    drag = {"type": "drag", "linear": [1.0] * 6}
    named = lw.Scene(scene.vehicle, scene.environment, [drag, waves], scene.start)
    costs = {row["term"]: row for row in lw.bench.term_cost(named, h=0.1)}
    assert list(costs) == ["none", "drag", "waves", "all terms"]
    assert costs["none"]["more_than_none"] == 0.0
    # A sum of sines costs more than nothing, and less than with drag beside it, on a machine however busy.
    assert costs["none"]["ns_per_vehicle_step"] < costs["waves"]["ns_per_vehicle_step"]
    lw.plots.term_cost(costs.values())
