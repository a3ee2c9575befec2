"""From 1,000 to 10 million members: time, memory and disk of runs in memory and in a store, beside what was predicted.

python benchmarks/large_table.py                1,000 to 1,000,000 members; writes docs/large_ensembles.md
python benchmarks/large_table.py --most 10000000    10 million too: 16 GB of disk in the folder --dir (default: runs)
"""

import argparse
import json
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import lgvi_warp as lw
from lgvi_warp import machine, speed

TARGET = Path(__file__).resolve().parent.parent / "docs" / "large_ensembles.md"
SETTINGS = {"method": "psi_s", "h": 0.01, "t1": 10.0, "save": lw.SaveAt(every=1.0)}
SIZES = (1_000, 10_000, 100_000, 1_000_000, 10_000_000)

TEXT = """# From 1,000 to 10 million members

A run is cut into **blocks** of 256 to 4096 members. Each block goes through all of its steps by itself, so a run of
any size needs memory for the blocks at work and for what it keeps, and nothing more. What it keeps decides which of
four ways fits:

| members | keep | how |
|---|---|---|
| up to about 100,000 | all samples in memory | `lw.solve(fleet, ...)`, `lgvi-warp run SCENE` |
| more, or longer than you want to lose | all samples in a store on disk | `store="runs/x/run.zarr"`, `--store zarr` |
| more than the disk holds | fewer times or fields | `lw.SaveAt(every=..., fields=("position",))`, `--store-dtype float32` |
| any number | [statistics](statistics.md), outcomes | `statistics=[...], keep="none"`, with a store to resume |

## Before the run: `lgvi-warp plan`

    lgvi-warp plan examples/paper.toml --members 1000000 --store zarr --out runs/large

runs one block a thread for about a second and says what the whole run will take: time, memory, disk, blocks. It writes
nothing but a probe of the disk. In Python: `print(lw.predict(fleet, t1=10.0, store="runs/large/run.zarr"))`. Statistics
and members of `keep=[3, 17]` are counted; how many members fail is not known, so those of `keep="failed"` are not. A run
whose members stop early, or whose method chooses its steps, may cost less or more than its first steps tell.

## The run

    lgvi-warp run examples/paper.toml --members 1000000 --store zarr --out runs/large

    result = lw.solve(fleet, ..., store="runs/large/run.zarr")
    result = lw.solve(fleet, ..., store=lw.Store("runs/large/run.zarr", dtype="float32", fields=("position",)))

Samples go to `run.zarr` block by block and are not kept in memory. Every block is written, synced and then marked with
the sizes and checksums of its files. A folder that holds a run is refused unless you say `--overwrite` or `--resume`;
so is a run that the disk has no room for.

What is measured: the paper's vehicle, `psi_s` in float64, 1,000 steps, 11 samples of position, attitude and both
velocities, {threads} threads; the whole of `lw.solve` in a process of its own, kernel in the cache. *Peak* is that
process's largest resident memory: {floor} MB of it are Python and Warp, {more} MB with zarr and xarray. *Predicted* is
what `lw.predict` said before the run, over what was measured.

Machine: {cpu}, {simd}, {threads} threads. Written by `python benchmarks/large_table.py`; do not edit.

{table}

**Statistics in a store.** With `statistics=[...]`, or `[[run.statistics]]` in the scene file, the store holds what each
block gave to them; `keep="none"` leaves the samples out, so that status, warnings and varied parameters of each
member are all that is there beside. `lw.open_run` joins the blocks' parts again, and `resume` takes the statistics, `keep`
and `until` of the run from the store. A run that `until` ends early is complete with fewer members, and so it is after a
crash: at the same block, with the same bytes. Statistics of functions of your own are not in the file:
`lw.resume(path, statistics=[...])` and `lw.open_run(path, statistics=[...])` take them again. A run in parts (`--blocks`)
cannot have `until`.

**Members to look at.** Those that `keep="failed"` or `keep=[3, 17]` asks for are run again when all blocks are there, by the
same executor and to the same bits, into the group `kept` of the store; the run is complete after that. Its blocks have
checksums and markers of their own: `info` tells what is damaged, `resume` goes on with it. `lw.open_run(...).kept` reads it,
and so does `xarray.open_zarr("runs/large/run.zarr", group="kept")`, whose coordinate `member` is the index in the run. Of a
method that chooses its steps, members of the same packet lie there as well, told apart by `chosen`.

## After a crash: `lgvi-warp resume`

    lgvi-warp info runs/large          # what is there, and whether it is whole: every file is read
    lgvi-warp resume runs/large

`resume` checks every finished block against its checksums and runs what is missing, torn or changed. It ends with the
bytes of a run that was never stopped: the tests kill runs at random moments and compare all files. A run that was
killed before its folder was there has left nothing: start it again (`run --resume` begins or goes on, whichever it
is). On another type of machine or with other versions of lgvi_warp, Warp, NumPy or SciPy the last bits of some members
may differ, so `resume` refuses and says what differs; `--force` goes on nevertheless. Laws of your own are not in the
file: `lw.resume("runs/large", fleet)` takes the ensemble that has them.

The exit codes of all commands: 0 done; 1 members, files or the disk failed, or `info` or `merge` found a run that is not
whole; 2 refused, with the reason and the remedy; 130 interrupted from the keyboard (a store keeps its finished blocks).

## Reading it

    result = lw.open_run("runs/large")               # samples are read when you ask for them
    some = lw.open_run("runs/large", members=slice(0, 1000))
    result.dataset.position.isel(time=-1).mean("realization")     # by xarray, piece by piece
    xarray.open_zarr("runs/large/run.zarr")

The store is plain zarr v3: raw little-endian numbers with a CRC-32C a chunk, CF-1.11 attributes, scene, seed, versions
and machine in its attributes. There is no time of day in it: the same run leaves the same bytes. A *missing* chunk of a
zarr array silently reads as NaN: `open_run` refuses a run that is not complete, and `lgvi-warp info` finds chunks that
were lost later.

    lgvi-warp export runs/large --to netcdf          # xarray.open_dataset("runs/large/run.nc")
    lgvi-warp export runs/large --to parquet         # pandas.read_parquet("runs/large/run.parquet")

write one file for other programs (extra `export`), of a run that is complete and whole: every file is checked first.
NetCDF has all arrays with their CF attributes, kept members in the group `kept` and statistics in `statistics`. Parquet has
a row for each member and time of the samples of all members, else of those that were kept, else a row for each member; its
columns are each component of the samples and of what varies, status and failure time, and their units are in the table's
metadata (`attrs["units"]` in pandas).

## More machines

* `--executor processes` runs each block in one of several processes; `--executor dask --scheduler tcp://HOST:8786` on
  the workers of a Dask cluster (extra `cluster`), `--executor dask` alone on a cluster of this machine. A worker that
  dies costs the block it was at. With a store, workers write their blocks into it themselves (they must see its
  folder); without one, samples travel back. The bytes are the same for all of them; a worker of another type of
  machine is refused.
* A Slurm array needs no scheduler of ours. Each task runs a range of blocks into a folder of its own, `merge` puts
  them together, and `resume` runs what is in none:

      #SBATCH --array=0-9
      lgvi-warp run scene.toml --store zarr --out part_$SLURM_ARRAY_TASK_ID \\
          --blocks $((SLURM_ARRAY_TASK_ID * 25)):$((SLURM_ARRAY_TASK_ID * 25 + 25)) --resume

      lgvi-warp merge part_* --out whole

  `lgvi-warp plan` says how many blocks there are; the last task may ask for more of them. `merge` also runs the members
  that the run keeps, once all blocks are there.
* Each kernel is compiled once: processes that want the same one wait for the first to put it into Warp's cache.
  `WARP_CACHE_PATH` says where that is; give machines that share a home directory one each if their processors differ.
* Laws of your own must be importable where the workers are: what cannot be sent is refused with the reason.
"""


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
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return {"seconds": seconds, "predicted": predicted.seconds, "peak": peak, "predicted_peak": predicted.memory,
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
    arguments.add_argument("--out", type=Path, default=TARGET, help="the page to write")
    arguments.add_argument("--one", nargs=3, help=argparse.SUPPRESS)
    chosen = arguments.parse_args()
    if chosen.one:
        members, kind, folder = chosen.one
        print(json.dumps(measure(int(members), kind, Path(folder))))
        return
    lw.solve(speed.fleet(64), **SETTINGS)
    found = list(rows(chosen.most, chosen.dir / "large_table"))
    head = "| members | kept | time | peak | disk | predicted: time, memory |\n|---:|---|---:|---:|---:|---|\n"
    table = head + "\n".join(line(*row) for row in found)
    floor, more = (
        min(r["peak"] for _, kind, r in found if (kind in ("memory", "statistics")) == alone) / 1e6
        for alone in (True, False)
    )
    about = machine.describe()
    text = TEXT.format(
        table=table,
        cpu=about["cpu"],
        simd=about["simd"],
        threads=about["threads"],
        floor=f"{floor:.0f}",
        more=f"{more:.0f}",
    )
    chosen.out.write_text(text)


if __name__ == "__main__":
    main()
