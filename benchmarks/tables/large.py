# SPDX-License-Identifier: Apache-2.0
"""From 1,000 to 10 million members: time, memory and disk of runs in memory and in a store, beside what was predicted.

With --most 10000000 it takes 16 GB of disk in the folder --dir.
"""

import shutil
import time
from pathlib import Path

import lgvi_warp as lw
from benchmarks import own_process
from benchmarks.pages import markdown, show, stamp
from lgvi_warp.common import machine
from lgvi_warp.measuring import speed

SETTINGS = {"method": "psi_s", "h": 0.01, "t1": 10.0, "save": lw.SaveAt(every=1.0)}
SIZES = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)

TEXT = """What is measured: the paper's vehicle, `psi_s` in float64, 1,000 steps, 11 samples of position, attitude and both
velocities, {threads} threads; the whole of `lw.solve` in a process of its own, kernel in the cache. *Peak* is that
process's largest resident memory: {floor} MB of it are Python and Warp, {more} MB with zarr and xarray. *Predicted* is
what `lw.predict` said before the run, over what was measured.

{stamp}

{table}
"""


def measure(members, kind, folder):
    """One run, in this process: prediction, seconds, peak memory and bytes on the disk."""
    folder, chosen, observed = Path(folder), None, {}
    if kind == "statistics":
        kept = (
            lw.statistics.Mean("position"),
            lw.statistics.Covariance("position"),
            lw.statistics.Extremes("position"),
            lw.statistics.Quantiles("position"),
        )
        observed = {"statistics": kept, "keep": "none"}
    elif kind != "memory":
        fields = ("position",) if kind == "float32" else None
        chosen = lw.Store(folder / "run.zarr", dtype="float32" if fields else None, fields=fields, existing="overwrite")
    fleet = speed.fleet(members)
    predicted = lw.predict(fleet, **SETTINGS, store=chosen, **observed)
    start = time.perf_counter()
    lw.solve(fleet, **SETTINGS, store=chosen, **observed)
    seconds = time.perf_counter() - start
    disk = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    peak = own_process.peak_memory()
    return {"seconds": seconds, "predicted": predicted.seconds, "peak": peak, "predicted_peak": predicted.memory,
            "disk": disk, "predicted_disk": predicted.disk}  # fmt: skip


def in_process(members, kind, folder):
    """The same in a process of its own."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    try:
        return own_process.call(measure, members, kind, str(folder.resolve()))
    finally:
        shutil.rmtree(folder)


KINDS = {
    "memory": "in memory",
    "statistics": "mean, covariance, extremes, quantiles of position",
    "store": "store",
    "float32": "store, positions in float32",
}


def rows(most, folder):
    """A row of the table for each size and way."""
    for members in (size for size in SIZES if size <= most):
        for kind in KINDS:
            bytes_in_memory = members * 18 * 8 * 11
            if kind == "memory" and bytes_in_memory > 0.4 * (machine.memory_bytes() or bytes_in_memory):
                continue
            record = in_process(members, kind, folder)
            show({"members": members, "kind": kind} | record)
            yield members, kind, record


def cells(members, kind, record):
    """A row as text."""
    disk = f"{record['disk'] / 1e6:,.0f} MB" if record["disk"] else ""
    ratio = f"{record['predicted'] / record['seconds']:.2f}, {record['predicted_peak'] / record['peak']:.2f}"
    peak = f"{record['peak'] / 1e6:,.0f} MB"
    return [f"{members:,}", KINDS[kind], f"{record['seconds']:.2f} s", peak, disk, ratio]


def add_options(parser):
    parser.add_argument("--most", type=int, default=1_000_000, help="largest number of members (default 1,000,000)")
    parser.add_argument("--dir", type=Path, default=Path("runs"), help="folder for the stores (default: runs)")


def main(most, dir):
    lw.solve(speed.fleet(64), **SETTINGS)
    found = list(rows(most, dir / "large_table"))
    floor, more = (
        min(r["peak"] for _, kind, r in found if (kind in ("memory", "statistics")) == alone) / 1e6
        for alone in (True, False)
    )
    head = ["members", "kept", "time", "peak", "disk", "predicted: time, memory"]
    return TEXT.format(
        stamp=stamp("large", f"--most {most}"),
        table=markdown(head, (cells(*row) for row in found), "rlrrrl"),
        threads=machine.thread_count(),
        floor=f"{floor:.0f}",
        more=f"{more:.0f}",
    )
