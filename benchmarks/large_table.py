"""From 1,000 to 10 million members: time, memory and disk of runs in memory and in a store, beside what was predicted.

python benchmarks/large_table.py                1,000 to 1,000,000 members; writes docs/guide/large_ensembles.md
python benchmarks/large_table.py --most 10000000    10 million too: 16 GB of disk in the folder --dir (default: runs)
"""

import argparse
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import lgvi_warp as lw
from benchmarks.scenes import peak_memory
from lgvi_warp.common import machine
from lgvi_warp.studies import speed

TARGET = Path(__file__).resolve().parent.parent / "docs" / "guide" / "large_ensembles.md"
SETTINGS = {"method": "psi_s", "h": 0.01, "t1": 10.0, "save": lw.SaveAt(every=1.0)}
SIZES = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)

BEGIN, END = "<!-- large_table: begin -->", "<!-- large_table: end -->"

SECTION = """{begin}

What is measured: the paper's vehicle, `psi_s` in float64, 1,000 steps, 11 samples of position, attitude and both
velocities, {threads} threads; the whole of `lw.solve` in a process of its own, kernel in the cache. *Peak* is that
process's largest resident memory: {floor} MB of it are Python and Warp, {more} MB with zarr and xarray. *Predicted* is
what `lw.predict` said before the run, over what was measured.

Machine: {cpu}, {simd}, {threads} threads. Written by `python -m benchmarks table large --most {most}`; do not edit.

| members | kept | time | peak | disk | predicted: time, memory |
|---:|---|---:|---:|---:|---|
{table}

{end}"""


def measure(members, kind, folder):
    """One run, in this process: prediction, seconds, peak memory and bytes on the disk."""
    chosen, observed = None, {}
    if kind == "statistics":
        kept = (lw.Mean("position"), lw.Covariance("position"), lw.Extremes("position"), lw.Quantiles("position"))
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
    return {"seconds": seconds, "predicted": predicted.seconds, "peak": peak_memory(), "predicted_peak": predicted.memory,
            "disk": disk, "predicted_disk": predicted.disk}  # fmt: skip


def in_process(members, kind, folder):
    """The same in a process of its own."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    arguments = [sys.executable, __file__, "--one", str(members), kind, str(folder)]
    done = subprocess.run(arguments, capture_output=True, text=True)
    shutil.rmtree(folder)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


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
            print(json.dumps({"members": members, "kind": kind} | record), flush=True)
            yield members, kind, record


def line(members, kind, record):
    """A row as text."""
    disk = f"{record['disk'] / 1e6:,.0f} MB" if record["disk"] else ""
    ratio = f"{record['predicted'] / record['seconds']:.2f}, {record['predicted_peak'] / record['peak']:.2f}"
    peak = f"{record['peak'] / 1e6:,.0f} MB"
    return f"| {members:,} | {KINDS[kind]} | {record['seconds']:.2f} s | {peak} | {disk} | {ratio} |"


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--most", type=int, default=1_000_000, help="largest number of members (default 1,000,000)")
    arguments.add_argument("--dir", type=Path, default=Path("runs"), help="folder for the stores (default: runs)")
    arguments.add_argument("--out", type=Path, default=TARGET, help="the page whose table is written")
    arguments.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    chosen = arguments.parse_args()
    if chosen.one:
        members, kind, folder = chosen.one
        print(json.dumps(measure(int(members), kind, Path(folder))))
        return
    lw.solve(speed.fleet(64), **SETTINGS)
    found = list(rows(chosen.most, chosen.dir / "large_table"))
    floor, more = (
        min(r["peak"] for _, kind, r in found if (kind in ("memory", "statistics")) == alone) / 1e6
        for alone in (True, False)
    )
    about = machine.describe()
    section = SECTION.format(
        begin=BEGIN,
        end=END,
        table="\n".join(line(*row) for row in found),
        cpu=about["cpu"],
        simd=about["simd"],
        threads=about["threads"],
        floor=f"{floor:.0f}",
        more=f"{more:.0f}",
        most=chosen.most,
    )
    page = chosen.out.read_text()
    chosen.out.write_text(page.split(BEGIN)[0] + section + page.split(END)[1])


if __name__ == "__main__":
    main()
