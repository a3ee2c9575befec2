# SPDX-License-Identifier: Apache-2.0
"""Files and summary of a finished run."""

from __future__ import annotations

import argparse
import contextlib
import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from lgvi_warp.cli import documents
from lgvi_warp.cli.output import Part, print_faults, tell
from lgvi_warp.cli.progress import progress_bar
from lgvi_warp.cli.writing import Written, side_by_side
from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.common.safe_files import size_below
from lgvi_warp.common.write_lock import write_lock


def report(result: Any, out: Path, chosen: argparse.Namespace, begun: float, failures: Sequence[str] = (),
           viewer: str | None = None, *, writer: Part = None, store: Part = None) -> list[str]:  # fmt: skip
    """Write the files of a finished run into a folder and print its summary.

    begun: Start time of the verb [s], by time.perf_counter.
    failures: Texts on earlier failures; default none.
    viewer: Address of a viewer that also receives the recording; default None.
    writer, store: Functions that write the files and open the folder of a store; default None: `write` and `Folder`.
    Returns: The failures, and one text for each file that could not be written.
    """
    from lgvi_warp.store.folder import Folder

    if result.store is not None and not (store or Folder)(result.store).complete:
        lines = [
            f"members     {result.members:,} of a run in parts, in {result.store}",
            f"next        lgvi-warp merge {out} ... --out DIR, with the folders of the other parts",
        ]
        drawn, written, text = None, Written([result.store]), lambda: "\n".join(lines)
    else:
        with progress_bar(chosen.quiet, "writing"):
            drawn = shown_members(result)
            written = (writer or write)(result, drawn, out, viewer)
        seconds = time.perf_counter() - begun
        text = lambda: "\n".join(  # noqa: E731
            [*written.note_lines(), summary(result, drawn, written.files, seconds, chosen.verbose)]
        )
    faults = [*written.faults, *failures]
    tell(chosen, lambda: documents.of_run(result, drawn, written, faults, time.perf_counter() - begun), text)
    print_faults(written.empty)
    return faults


# Most numbers that the picture, the drift and the summary look at; the picture and the drift then cover some members: a store
# may be larger than the memory.
MOST_DRAWN = 30_000_000


def shown_members(result: Any, *, limit: int = MOST_DRAWN, load: Part = None) -> Any:
    """Select the members for the picture and the drift: from a large store only some, as by `lw.select_members`.

    limit: Largest number of values in their samples; load: function that reads members of a stored result into memory.
    Returns: A result; without samples, the kept members; None without these, or if a field of the motion was not saved.
    """
    if not result.samples:
        return result.kept and shown_members(result.kept, limit=limit)
    if unsaved(result):
        return None
    if result.store is None:
        return result
    from lgvi_warp.store.open import chosen
    from lgvi_warp.views.choice import select_members

    most = max(1, limit // (18 * len(result.time)))
    members: Any = range(min(most, result.members))
    if result.members > most:
        with contextlib.suppress(NothingToDraw):  # each picture says so
            members = select_members(result, most).members
    return (load or chosen)(result, members)


def unsaved(result: Any) -> list[str]:
    """Name the fields of the motion that a run with samples did not save."""
    from lgvi_warp.physics.fields import FIELDS

    return [name for name in FIELDS if result.samples and name not in result.samples]


def write(result: Any, drawn: Any, out: Path, viewer: str | None = None) -> Written:
    """Write result.npz, fleet.png, fleet.rrd and statistics.png in parallel, if the run has their data: see `pictures`."""
    written = Written([result.store] if result.store else [])
    writers: dict[str, Callable[[Path], Path]] = {} if result.store else {"result.npz": result.save}
    writers |= pictures(result, drawn, viewer)
    with contextlib.ExitStack() as stack:
        # Runs that end together in one folder write one after another, so that all files are of one of them.
        with contextlib.suppress(OSError):  # a folder that cannot be written: each file reports it
            stack.enter_context(write_lock(out / "result", wait=True))
        jobs = side_by_side({out / name: writer for name, writer in writers.items()})
    for path, job in jobs.items():
        written.take(path, job.result)
    return written


def _draw(draw: Callable[..., Any], result: Any, path: Path) -> Path:
    """Draw a picture of a result, and return its path."""
    draw(result, path=path)
    return path


def _record(result: Any, viewer: str | None, path: Path) -> Path:
    """Write the recording of a result, and send it to the viewer, if one is given."""
    from lgvi_warp.views.recording.rerun import record
    from lgvi_warp.views.recording.viewer import answers

    record(result, path, to=viewer if viewer and answers(viewer) else None)
    return path


def pictures(result: Any, drawn: Any, viewer: str | None = None) -> dict[str, Callable[[Path], Path]]:
    """Functions that draw the pictures of a run, by file name.

    drawn: The members of the picture, from `shown_members`; None: no picture and no recording.
    viewer: Address of a viewer that also receives the recording; default None.
    """
    from lgvi_warp import plots
    from lgvi_warp.views.plots.estimates import drawable

    drawings: dict[str, Callable[[Path], Path]] = {}
    if drawn is not None:
        drawings |= {"fleet.png": partial(_draw, plots.summary, drawn), "fleet.rrd": partial(_record, result, viewer)}
    if drawable(result):
        drawings["statistics.png"] = partial(_draw, plots.statistics, result)
    return drawings


def summary(
    result: Any, drawn: Any, files: list[Path], seconds: float = 0.0, verbose: bool = False, *, limit: int = MOST_DRAWN
) -> str:
    """Summarise a run in a few lines.

    drawn: The members from which the drift is computed, from `shown_members`.
    seconds: Time that the verb took [s]; default 0, for a run that was not computed now.
    limit: Largest number of values in the samples that are searched.
    """
    from lgvi_warp.common.status import Status
    from lgvi_warp.results.outcomes import outcome_text, outcomes
    from lgvi_warp.statistics.estimates.table import table
    from lgvi_warp.uncertainty.footprint.footprint import run_answer

    settings = result.provenance
    lines = [
        *(f"note        {message}" for message in result.messages),
        members_line(result.members, settings),
        *(how_lines(settings) if verbose else ()),
        *controller_lines(settings["scene"]),
        *_speed(result, seconds),
    ]
    if missing := unsaved(result):
        lines.append(f"pictures    none, and no energy: {', '.join(missing)} not saved")
    elif result.samples:
        lines += energy_lines(result, drawn)
    elif result.kept is not None:
        lines.append(f"kept        {result.kept.members:,} members' samples, run again")
    elif settings.get("observed", {}).get("keep") == "failed":
        lines.append("kept        no samples: no member failed")
    lines += [f"  {outcome_text(result, code)}" for code in outcomes(result) if code != Status.OK]
    lines += _warning_lines(result)
    if "unmet" in result.samples and 6 * len(result.time) * result.members <= limit:
        short = int((result.samples["unmet"] != 0.0).any(axis=(0, 2)).sum())
        lines.append(f"unmet       {short:,} members asked at some sample for more than their actuators deliver")
    if result.substeps.any():
        divided = result.substeps > 0
        lines.append(f"substeps    {int(result.substeps.sum()):,} steps of {int(divided.sum()):,} members were divided: "
                     "those paths are not symplectic")  # fmt: skip
    if result.statistics:
        lines.append(f"statistics  at {result.time[-1]:g} s, with intervals")
        lines += [f"  {line}" for line in table(result.statistics)]
    return "\n".join([*lines, *map(file_line, files), *look_lines(files), run_answer(result)])


def look_lines(files: Sequence[Path]) -> list[str]:
    """Say how to view the files of a run."""
    known = {path.name: path for path in files}
    ways = [f"rerun {known['fleet.rrd']}"] if "fleet.rrd" in known else []
    ways += [f"open {path}" for name, path in known.items() if name.endswith(".png")][:1]
    ways = ways or [f"lgvi-warp info {path.parent}" for path in files[:1]]
    return [f"look        {', or '.join(ways)}"] if ways else []


def how_lines(provenance: dict[str, Any]) -> list[str]:
    """Say how a run was computed."""
    machine = provenance["machine"]
    versions = ", ".join(f"{name} {version}" for name, version in provenance["versions"].items())
    seed = provenance["ensemble"].get("seed")
    return [
        f"how         seed {seed}, checks {provenance['checks']}, packets of {provenance['width']}, "
        f"{machine['threads']} threads on {machine['cpu']} ({machine['simd']})",
        f"versions    {versions}",
    ]


# Quantities that may be conserved -> name in words, unit.
INVARIANTS = {
    "energy": ("energy", "J"),
    "horizontal_momentum": ("horizontal momentum", "N s"),
    "vertical_angular_momentum": ("vertical angular momentum", "N m s"),
}


def energy_lines(result: Any, drawn: Any) -> list[str]:
    """Write one line on the drift of conserved quantities, or on the change of energy if forces do work."""
    from lgvi_warp.physics import energy as invariants
    from lgvi_warp.views.choice import of_members

    whose = "all members" if drawn.members == result.members else of_members(drawn.members, result.members)
    return drift_lines(invariants.drift(drawn), invariants.conserved(drawn), invariants.at_work(drawn), whose)


def drift_lines(drift: Mapping[str, float], conserved: Iterable[str], at_work: Iterable[str], whose: str) -> list[str]:
    """Describe the drift of conserved quantities, or the terms that change the energy; whose: words for the members."""
    if math.isnan(drift["energy"]):
        return []
    if "energy" not in conserved:
        names = ", ".join(at_work)
        return [f"work        energy changed by up to {drift['energy']:.2g} J, through {names} (largest of {whose})"]
    texts = [f"{words} {drift[name]:.2g} {unit}" for name, (words, unit) in INVARIANTS.items() if name in conserved]
    return [f"drift       {', '.join(texts)} (largest of {whose})"]


def _warning_lines(result: Any) -> list[str]:
    """Lines on warnings: number of members by warning, then the text of each warning and its first member."""
    from lgvi_warp.common.status import Warnings

    counts = result.warnings.counts()
    if not counts:
        return []
    lines = ["warnings    " + ", ".join(f"{name} {number:,}" for name, number in counts.items())]
    worst = result.warnings.worst()
    for warning in Warnings:
        members = (worst == warning).nonzero()[0]
        if len(members):
            first = int(members[result.warning_time[members].argmin()])
            value = f"{warning.value_name} = {result.warning_value[first]:.4g}"
            when = f"first: member {first} at {result.warning_time[first]:g} s, {value}"
            lines.append(f"  {str(warning.name).lower()}: {warning.text} ({when})")
    return lines


def _speed(result: Any, seconds: float) -> list[str]:
    """Write one line on speed; none for a resumed run, only part of which was computed now."""
    if not result.run_seconds:
        return []
    rate = result.members * result.provenance["steps"] / result.run_seconds
    lines = [
        f"speed       {rate:.3g} vehicle-steps per second ({result.run_seconds:.2f} s; kernel loaded in "
        f"{result.compile_seconds:.2f} s; {seconds:.2f} s in all)"
    ]
    return [*lines, f"kernel      compiled: {result.compile_phases}"] if result.compile_phases.clang else lines


def members_line(members: int, provenance: dict[str, Any]) -> str:
    """Say how many members were run, and how they were drawn."""
    name, chosen = provenance["method"]["name"], provenance["method"].get("chosen")
    step = f"step {provenance['step']:g} s, {provenance['steps']:,} steps"
    line = f"members     {members:,}, {name}, {provenance['dtype']}, {step}"
    return f"{line}\nmethod      {name}, chosen {chosen}" if chosen else line


def controller_lines(scene: Mapping[str, Any]) -> list[str]:
    """List the parts of a controller."""
    section = scene.get("controller")
    if not section:
        return []
    delay = f", {section['delay']:g} s until they act" if section.get("delay") else ""
    words = ("sensors", "guidance", "laws", "allocation", "faults")
    lists = {word: section[word] for word in words if section.get(word)}
    texts = [f"{word} {', '.join(part.get('name') or part['type'] for part in parts)}" for word, parts in lists.items()]
    return [f"controller  acts every {section['period']:g} s{delay}; {'; '.join(texts)}"]


def file_line(path: Path) -> str:
    """Name a file or a folder with its size."""
    size = path.stat().st_size if path.is_file() else size_below(path)
    return f"file        {path} ({size / 1e6:.1f} MB)"
