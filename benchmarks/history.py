# SPDX-License-Identifier: Apache-2.0
"""Append the small set of measurements to a file of JSON lines, or draw their ratios to a peer or limit over commits."""

from __future__ import annotations

import datetime
import importlib
import json
import subprocess
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from benchmarks import pages

ROWS = pages.ROOT / "benchmarks" / "rows" / "history.jsonl"
PICTURE = pages.ROOT / "runs" / "history.png"
METHODS = ("psi_s", "psi_x", "rk4", "rk8")
Record = dict[str, Any]
Found = Iterator[tuple[str, float, str, float]]


def name(record: Record, *keys: str) -> str:
    """The values of these keys, as one text."""
    return " ".join(str(record[key]) for key in keys)


def kernel(records: list[Record]) -> Found:
    """Steps of the paper's vehicle, beside the time of their operations at the core's peak."""
    for record in records:
        if record["method"] in METHODS and record["part_of_peak"]:
            ns = record["ns_per_vehicle_step"]
            yield name(record, "method", "dtype", "width"), ns, "time at the peak", ns * record["part_of_peak"]


def driven(records: list[Record]) -> Found:
    """Steps of driven vehicles, beside the same vehicle without terms."""
    keys = ("vehicle", "method", "dtype")
    bare = {name(one, *keys): one["ns_per_vehicle_step"] for one in records if one["scene"] == "no terms"}
    for record in records:
        if record["scene"] != "no terms" and not record["scene"].startswith("without"):
            yield name(record, *keys, "scene"), record["ns_per_vehicle_step"], "no terms", bare[name(record, *keys)]


def controllers(records: list[Record]) -> Found:
    """Ticks, beside a step of the same vehicle without a controller."""
    keys = ("vehicle", "method", "dtype")
    steps = {name(one, *keys): one["ns"] for one in records if one.get("loop") == "none"}
    for record in records:
        if "ns_a_tick" in record and "method" in record:
            yield name(record, *keys), record["ns_a_tick"], "a step without loop", steps[name(record, *keys)]


def calls(records: list[Record]) -> Found:
    """Prepared calls and whole solves [ns], beside the kernel alone."""
    for record in records:
        for kind in ("call", "solve") if "kernel_ms" in record else ():
            label = f"{kind} {record['vehicle']} {record['members']} x {record['steps']}"
            yield label, 1e6 * record[f"{kind}_ms"], "the kernel alone", 1e6 * record["kernel_ms"]


def start(records: list[Record]) -> Found:
    """Imports and the first solve of a new Python [ns], beside an import of NumPy."""
    merged = {key: value for record in records for key, value in record.items()}
    numpy = 1e9 * merged["numpy_s"]
    for key in ("package", "scene", "solve"):
        yield f"import, {key}", merged[f"{key}_over_numpy"] * numpy, "import of NumPy", numpy
    yield "first solve", 1e9 * merged["first_solve_s"], "import of NumPy", numpy


CASES = {case.__name__: case for case in (kernel, driven, controllers, calls, start)}


def lines(about: Record, case: str, records: list[Record]) -> list[Record]:
    """A line for each measurement of a case, with its peer; about: commit, date, processor and versions."""
    return [
        about | {"case": case, "name": label, "ns": round(ns, 3), "peer": peer, "peer_ns": round(peer_ns, 3)}
        for label, ns, peer, peer_ns in CASES[case](records)
    ]


def here() -> Record:
    """Commit, date, processor and versions."""
    from lgvi_warp.common import machine

    describe = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    commit = subprocess.run(describe, cwd=pages.ROOT, check=True, capture_output=True, text=True).stdout.strip()
    info = Path("/proc/cpuinfo")
    pairs = [text.split(":", 1) for text in info.read_text().splitlines() if ":" in text] if info.exists() else []
    first = {key.strip(): value.strip() for key, value in reversed(pairs)}
    return {"commit": commit, "date": datetime.date.today().isoformat(), "cpu": machine.cpu_name(),
            "family": first.get("cpu family"), "model": first.get("model"), "simd": machine.simd(),
            "versions": machine.versions()}  # fmt: skip


def record(rows: Path, quick: bool) -> None:
    """Measure the cases and append their lines to a file, case by case."""
    about = here()
    rows.parent.mkdir(parents=True, exist_ok=True)
    for case in CASES:
        records = list(importlib.import_module(f"benchmarks.cases.{case}.case").run(quick))
        with rows.open("a") as file:
            file.writelines(f"{pages.show(line)}\n" for line in lines(about, case, records))


def ratios(rows: Iterable[Record]) -> dict[str, dict[str, dict[str, dict[str, float]]]]:
    """{processor: {case: {name: {commit: time over its peer's}}}}, in the order of the file."""
    found: dict[str, Any] = {}
    for row in rows:
        processor = f"{row['cpu']} (family {row['family']}, model {row['model']}, {row['simd']})"
        names = found.setdefault(processor, {}).setdefault(f"{row['case']}: over {row['peer']}", {})
        names.setdefault(row["name"], {})[row["commit"]] = row["ns"] / row["peer_ns"]
    return found


def draw(rows: Path, picture: Path) -> None:
    """Draw the ratios over commits: a column for each processor, a row for each case."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    if not rows.exists():
        raise SystemExit(f"{rows}: there is no history yet. Record one with `python -m benchmarks history`.")
    content = [json.loads(line) for line in rows.read_text().splitlines()]
    found, commits = ratios(content), list(dict.fromkeys(row["commit"] for row in content))
    cases = list(dict.fromkeys(case for of_processor in found.values() for case in of_processor))
    size = (8.0 * len(found), 4.0 * len(cases))
    figure, axes = plt.subplots(len(cases), len(found), figsize=size, squeeze=False, layout="constrained")
    for column, (processor, of_processor) in zip(axes.T, found.items(), strict=True):
        column[0].set_title(processor)
        for one, case in zip(column, cases, strict=True):
            for label, values in of_processor.get(case, {}).items():
                one.plot([commits.index(commit) for commit in values], list(values.values()), ".-", label=label)
            one.set(ylim=(0.0, None), ylabel=case, xticks=range(len(commits)), xticklabels=commits)
            one.tick_params(axis="x", rotation=30)
            one.grid(True, alpha=0.3)
            one.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5))
    picture.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(picture, dpi=100)
    plt.close(figure)
    print(picture)
