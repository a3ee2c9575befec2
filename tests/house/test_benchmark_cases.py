# SPDX-License-Identifier: Apache-2.0
"""Every benchmark case runs to its end with --quick, in a process of its own, and prints what it measured."""

import json
import os
import subprocess
import sys

import pytest

from benchmarks import history, pages
from benchmarks.tables import peers, term
from tests.house.test_benchmarks import CASES


def lines(tmp_path, *arguments):
    """The records of a command of the benchmarks."""
    run = [sys.executable, "-m", "benchmarks", *arguments]
    environment = os.environ | {"LGVI_WARP_BENCH_DIR": str(tmp_path)}
    done = subprocess.run(run, cwd=pages.ROOT, capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_a_case_runs_to_its_end(name, tmp_path):
    machine, *records = lines(tmp_path, "run", name, "--quick")
    assert machine["case"] == "machine"
    assert records
    assert {record["case"] for record in records} == {name}
    assert all(len(record) > 1 for record in records)
    if name in history.CASES:
        assert all(line["peer_ns"] > 0.0 for line in history.lines({}, name, records))
        assert history.lines({}, name, records)


@pytest.mark.slow
def test_peers_run_to_their_end_and_make_a_table(tmp_path):
    chosen = (
        "--peers",
        "lgvi_warp,hand_lanes",
        "--problems",
        "bluerov2_heavy",
        "--rounds",
        "1",
        "--out",
        str(tmp_path),
    )
    _, *records = lines(tmp_path, "peers", "--quick", *chosen)
    measured = [record for record in records if "us_per_vehicle_second" in record]
    assert {"float64", "float32"} == {record["dtype"] for record in measured}
    assert (tmp_path / "peers.png").stat().st_size > 1000
    assert "BlueROV2 heavy" in peers.section(pages.read(tmp_path / "peers.jsonl"))


@pytest.mark.slow
def test_the_bars_of_readme_are_measured(tmp_path):
    rows = tmp_path / "bars.json"
    run = [sys.executable, "-m", "benchmarks", "table", "bars", "--quick", "--rows", str(rows)]
    done = subprocess.run(run, cwd=pages.ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    content = json.loads(rows.read_text())
    tools = {row["tool"] for row in content["rows"]}
    assert {"lgvi_warp", "warp_ordinary"} <= tools
    assert all(row["error"] <= content["target"] and row["seconds"] > 0.0 for row in content["rows"])
    assert "| lgvi_warp | float64 |" in done.stdout


def record_of(peer, problem, method, error, time, dtype="float64"):
    return {"peer": peer, "problem": problem, "method": method, "setting": "", "dtype": dtype, "threads": 1, "members": 9,
            "us_per_vehicle_second": time, "error_max": error}  # fmt: skip


def test_a_table_of_peers_names_what_is_behind():
    about = {"problem": "remus_100", "members": 9, "judged": 4, "t1": 2.0, "reference_agrees_to": {"rk8": 3e-9}}
    machine = {"machine": {"cpu": "a processor", "simd": "lanes"}, "threads": 1}
    times = {("lgvi_warp", "rk4"): 2.0, ("hand_lanes", "rk4"): 1.0, ("numba_simd", "dop853"): 3.0}
    text = peers.section([machine, about] + [record_of(peer, "remus_100", method, error, factor * time)
                                             for (peer, method), time in times.items()
                                             for error, factor in ((1e-1, 1.0), (1e-3, 4.0))])  # fmt: skip
    assert "REMUS 100 as shipped: drag, lift, fins, thrust: 9 members" in text
    assert "Errors are those of the first 4 members; the reference is known to 3e-09." in text
    assert "| 1e-1 | 2 `rk4` |  | 1 (0.50) | 3 (1.50) |" in text
    assert "* lanes by hand, C++ is more than 1.3 times faster at 1e-1 (0.50), 1e-2 (0.50), 1e-3 (0.50).\n" in text
    assert "numba, written by hand over SIMD lanes is" not in text


def test_the_tables_of_terms_have_both_methods_and_driven_vehicles():
    def record(kind, name, method, dtype, ns):
        return {kind: name, "method": method, "dtype": dtype, "ns_per_vehicle_step": ns, "more_than_none": ns - 10.0,
                "over_none": ns / 10.0}  # fmt: skip

    made = [record(kind, name, method, dtype, ns + (dtype == "float32"))
            for kind, name, method, ns in (("term", "none", "psi_s", 10.0), ("term", "drag", "psi_s", 20.0),
                                           ("term", "none", "rk4", 30.0), ("vehicle", "remus_100", "rk4", 40.0),
                                           ("term", "none", "psi_x", 50.0))
            for dtype in ("float64", "float32")]  # fmt: skip
    terms, driven, methods = (text.splitlines() for text in term.tables(term.rows(made)))
    assert terms[2] == "| none | 10.0 | 0.0 | 11.0 | 1.0 | 30.0 | 20.0 | 31.0 | 21.0 |"
    assert terms[3] == "| drag | 20.0 | 10.0 | 21.0 | 11.0 |  |  |  |  |"
    assert driven[2:] == ["| remus_100 | rk4 | 40.0 | 41.0 |"]
    assert methods[2:] == ["| uncoupled | psi_x | 50.0 | 5.00 | 51.0 | 5.10 |"]
