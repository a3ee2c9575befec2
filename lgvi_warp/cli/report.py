"""What a finished run leaves: its files, and a summary."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lgvi_warp.cli.signals import Ended


def report(result: Any, out: Path, quiet: bool, begun: float) -> list[str]:
    """Write the files of a finished run, print its summary, and return what failed."""
    if result.store is not None and not complete(result):
        if not quiet:
            print(f"members     {result.members:,} of a run in parts, in {result.store}")
            print(f"next        lgvi-warp merge {out} ... --out DIR, with the folders of the other parts")
        return []
    drawn = shown_members(result)
    files, faults = write(result, drawn, out)
    if not quiet:
        print(summary(result, drawn, files, time.perf_counter() - begun))
    return faults


def told(faults: list[str]) -> list[str]:
    """The faults, said on stderr."""
    for fault in faults:
        print(f"lgvi-warp: {fault}", file=sys.stderr)
    return faults


def complete(result: Any) -> bool:
    """Whether a store holds the whole run."""
    from lgvi_warp.store import Folder

    return Folder(result.store).complete


# Plots and drift are of so many numbers at most, of the first members: a store may be larger than the memory.
MOST_DRAWN = 30_000_000


def shown_members(result: Any) -> Any:
    """The result, or of a large one in a store its first members, in memory; without samples, those kept, or None."""
    if not result.samples:
        return result.kept and shown_members(result.kept)
    if result.store is None:
        return result
    from lgvi_warp.stored import chosen

    most = max(1, MOST_DRAWN // (18 * len(result.time)))
    return chosen(result, range(min(most, result.members)))


def write(result: Any, drawn: Any, out: Path) -> tuple[list[Path], list[str]]:
    """Write result.npz, fleet.png, fleet.rrd and statistics.png side by side: what there is of them.

    drawn: the members of the pictures, None without. A result in a store is written already. Returns the files, and a text
    for each that failed.
    """
    from concurrent.futures import Future, ThreadPoolExecutor, wait

    from lgvi_warp.sinks.plots import drawable, plot, plot_statistics
    from lgvi_warp.sinks.rerun import log_rerun

    files: list[Path] = [result.store] if result.store else []
    faults: list[str] = []
    writers: dict[str, Callable[[Path], Path]] = {} if result.store else {"result.npz": result.save}
    if drawn is not None:
        writers |= {"fleet.png": lambda path: plot(drawn, path), "fleet.rrd": lambda path: log_rerun(drawn, path)}
    if drawable(result):
        writers["statistics.png"] = lambda path: plot_statistics(result, path)
    if not writers:
        return files, faults
    jobs: dict[Path, Future[Path]] = {}
    pool = ThreadPoolExecutor(len(writers))
    try:
        for name, writer in writers.items():
            jobs[out / name] = pool.submit(writer, out / name)
        while wait(jobs.values(), timeout=0.2).not_done:
            pass  # an interrupt that comes just before it waits is heard afterwards
    except KeyboardInterrupt as error:
        # A file that is half written is worth nothing.
        wait(jobs.values())
        written = [path for path, job in jobs.items() if job.exception() is None]
        if "result.npz" in writers and out / "result.npz" not in written:
            raise
        raise Ended(f"the run is finished; written: {', '.join(map(str, written)) or result.store}") from error
    finally:
        pool.shutdown()
    for path, job in jobs.items():
        try:
            files.append(job.result())
        except (OSError, ImportError, ValueError) as error:
            faults.append(f"{path} was not written: {error}")
    return files, faults


def summary(result: Any, drawn: Any, files: list[Path], seconds: float) -> str:
    """The run in a few lines."""
    from lgvi_warp import invariants
    from lgvi_warp.statistics.table import table
    from lgvi_warp.status import Status

    settings = result.provenance
    steps = settings["steps"]
    lines = [
        *(f"note        {message}" for message in result.messages),
        f"members     {result.members:,}, {settings['method']['name']}, {settings['dtype']}, "
        f"step {settings['step']:g} s, {steps:,} steps",
        *_speed(result, seconds),
        "status      " + ", ".join(f"{name} {number:,}" for name, number in result.status.counts().items()),
    ]
    if result.samples:
        drift = invariants.drift(drawn)
        whose = "all members" if drawn.members == result.members else f"the first {drawn.members:,} members"
        lines.append(
            f"drift       energy {drift['energy']:.2g} J, horizontal momentum {drift['horizontal_momentum']:.2g} N s, "
            f"vertical angular momentum {drift['vertical_angular_momentum']:.2g} N m s (largest of {whose})"
        )
    elif result.kept is not None:
        lines.append(f"kept        {result.kept.members:,} members' samples, run again")
    elif settings.get("observed", {}).get("keep") == "failed":
        lines.append("kept        no samples: no member failed")
    for code in Status:
        failed = (result.status == code).nonzero()[0]
        if code and len(failed):
            first = int(failed[0])
            lines.append(
                f"  {code.name.lower()}: {code.text} (first: member {first} at {result.failure_time[first]:g} s)"
            )
    lines += _warning_lines(result)
    if result.substeps.any():
        divided = result.substeps > 0
        lines.append(
            f"substeps    {int(result.substeps.sum()):,} steps of {int(divided.sum()):,} members were divided: those paths "
            "are not symplectic"
        )
    if result.statistics:
        lines.append(f"statistics  at {result.time[-1]:g} s, with intervals")
        lines += [f"  {line}" for line in table(result.statistics)]
    lines += [f"file        {path} ({size_of(path) / 1e6:.1f} MB)" for path in files]
    return "\n".join(lines)


def _warning_lines(result: Any) -> list[str]:
    """Members by warning, and of each warning what it says and who had it first as the most serious one."""
    from lgvi_warp.status import Warnings

    counts = result.warnings.counts()
    if not counts:
        return []
    lines = ["warnings    " + ", ".join(f"{name} {number:,}" for name, number in counts.items())]
    worst = result.warnings.worst()
    for one in Warnings:
        members = (worst == one).nonzero()[0]
        if len(members):
            first = int(members[result.warning_time[members].argmin()])
            value = f"{one.value_name} = {result.warning_value[first]:.4g}"
            when = f"first: member {first} at {result.warning_time[first]:g} s, {value}"
            lines.append(f"  {str(one.name).lower()}: {one.text} ({when})")
    return lines


def _speed(result: Any, seconds: float) -> list[str]:
    """The summary's line on speed; none for a run that went on, of which not all was made now."""
    if not result.run_seconds:
        return []
    rate = result.members * result.provenance["steps"] / result.run_seconds
    return [
        f"speed       {rate:.3g} vehicle-steps per second ({result.run_seconds:.2f} s; kernel loaded in "
        f"{result.compile_seconds:.2f} s; {seconds:.2f} s in all)"
    ]


def size_of(path: Path) -> int:
    """Bytes of a file, or of all in a folder."""
    return (
        path.stat().st_size if path.is_file() else sum(one.stat().st_size for one in path.rglob("*") if one.is_file())
    )
