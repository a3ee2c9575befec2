# SPDX-License-Identifier: Apache-2.0
"""The history of speed keeps each time beside that of its peer, and draws their ratios over commits."""

import json
from types import SimpleNamespace

import pytest

from benchmarks import history, pages
from benchmarks.__main__ import main

ABOUT = {"commit": "a1", "date": "2026-01-02", "cpu": "A", "family": "6", "model": "7", "simd": "avx2", "versions": {}}
STEP = {"method": "rk4", "dtype": "float64"}
REMUS = STEP | {"vehicle": "remus_100"}
# Case -> records as it yields them, and (name, ns, ns of the peer) of what is kept.
MADE = {
    "kernel": (
        [STEP | {"width": 8, "ns_per_vehicle_step": 10.0, "part_of_peak": part, "method": method}
         for method, part in (("psi_s", 0.5), ("rk4", None), ("euler", 0.5))],
        [("psi_s float64 8", 10.0, 5.0)],
    ),
    "driven": (
        [REMUS | {"scene": scene, "ns_per_vehicle_step": ns}
         for scene, ns in (("whole", 30.0), ("without drag", 20.0), ("no terms", 12.0))],
        [("remus_100 rk4 float64 whole", 30.0, 12.0)],
    ),
    "controllers": (
        [REMUS | {"loop": "none", "ns": 15.0}, REMUS | {"ns_a_tick": 45.0}, {"loop": "callback", "over_fused": 3.0},
         {"vehicle": "bluerov2_heavy", "allocation": "pseudo_inverse", "ns_a_tick": 9.0}],
        [("remus_100 rk4 float64", 45.0, 15.0)],
    ),
    "calls": (
        [{"vehicle": "paper", "members": 1, "steps": 2, "kernel_ms": 0.1, "call_ms": 0.3, "solve_ms": 0.5}, {"s": 1.0}],
        [("call paper 1 x 2", 3e5, 1e5), ("solve paper 1 x 2", 5e5, 1e5)],
    ),
    "start": (
        [{"numpy_s": 0.1, "package_over_numpy": 0.5, "scene_over_numpy": 2.0, "solve_over_numpy": 3.0},
         {"first_solve_s": 0.4}],
        [("import, package", 5e7, 1e8), ("import, scene", 2e8, 1e8), ("import, solve", 3e8, 1e8),
         ("first solve", 4e8, 1e8)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", history.CASES)
def test_each_time_has_that_of_its_peer(case):
    records, expected = MADE[case]
    found = history.lines(ABOUT, case, records)
    assert [(line["name"], line["ns"], line["peer_ns"]) for line in found] == expected
    assert all(ABOUT.items() <= line.items() and line["case"] == case and line["peer"] for line in found)


def test_the_ratios_are_drawn_by_processor_over_commits(tmp_path, capsys):
    rows, picture = tmp_path / "history.jsonl", tmp_path / "new" / "history.png"
    with pytest.raises(SystemExit, match="there is no history yet"):
        main(["history", "--draw", "--rows", str(rows)])
    places = [ABOUT, ABOUT | {"commit": "b2"}, ABOUT | {"cpu": "B", "commit": "b2"}]
    content = [line for about in places for line in history.lines(about, "driven", MADE["driven"][0])]
    content[1]["ns"] = 24.0
    rows.write_text("".join(f"{json.dumps(line)}\n" for line in content))
    ratios, label = history.ratios(content), "remus_100 rk4 float64 whole"
    assert ratios == {"A (family 6, model 7, avx2)": {"driven: over no terms": {label: {"a1": 2.5, "b2": 2.0}}},
                      "B (family 6, model 7, avx2)": {"driven: over no terms": {label: {"b2": 2.5}}}}  # fmt: skip
    main(["history", "--draw", "--rows", str(rows), "--picture", str(picture)])
    assert capsys.readouterr().out == f"{picture}\n"
    assert picture.stat().st_size > 1000


def test_a_line_says_where_it_was_measured():
    about = history.here()
    assert about.keys() == ABOUT.keys()
    assert about["commit"]
    assert "warp-lang" in about["versions"]


def test_a_history_is_appended(tmp_path, monkeypatch):
    cases = {f"benchmarks.cases.{case}.case": records for case, (records, _) in MADE.items()}
    monkeypatch.setattr(history.importlib, "import_module", lambda name: SimpleNamespace(run=lambda quick: cases[name]))
    rows = tmp_path / "rows" / "history.jsonl"
    for count in (1, 2):
        history.record(rows, quick=True)
        content = pages.read(rows)
        assert len(content) == count * sum(len(expected) for _, expected in MADE.values())
        assert {line["case"] for line in content} == set(history.CASES)
