# SPDX-License-Identifier: Apache-2.0
"""Rare events with known probabilities: error told and seen, members and seconds, and what other libraries take.

With --records the lines of `python -m benchmarks run rare` are read from a file in place of measuring again.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.cases.rare import case
from benchmarks.pages import markdown, read, stamp

TEXT = """`lw.rare_event` asked for 10 %, over runs with other seeds. Told and seen are standard deviations of the error in
parts of the probability; then how many runs were within three told ones, and the smallest answer over the truth.
Seconds are processor time of one thread of a shared machine, without compiling. The truth is a closed form, of the
autopilot a run to 2 %.

{events}

Subset simulation of other libraries over the same vehicles by `lw.uq.model`, with 20,000 members a level: OpenTURNS'
`SubsetSampling`, UQpy's `SubsetSimulation` by its `MetropolisHastings`. Error is the root mean square of {runs} runs.

{peers}

{stamp}"""


def percent(part: float) -> str:
    """A part in percent."""
    return f"{100.0 * part:.3g} %"


def events(records: Sequence[dict[str, Any]]) -> str:
    """The table of the study itself."""
    rows = []
    for record in (record for record in records if "estimators" in record):
        by = ", ".join(f"{name} {count}" for name, count in sorted(record["estimators"].items()))
        rows.append([record["event"], f"{record['truth']:.2g}", percent(record["told_spread"]),
                     percent(record["seen_spread"]), f"{record['within_three']} of {record['runs']}",
                     f"{record['lowest']:.2f}", f"{record['members']:,}", f"{record['seconds']:.2g}", by])  # fmt: skip
    head = ["event", "probability", "told", "seen", "within three", "lowest", "members", "seconds", "by"]
    return markdown(head, rows, "lrrrrrrrl")


def peers(records: Sequence[dict[str, Any]]) -> str:
    """The table of other libraries, beside the study."""
    own = {(record["event"], record["truth"]): record for record in records if "estimators" in record}
    rows = []
    for record in (record for record in records if "peer" in record):
        here = own[record["event"], record["truth"]]
        rows.append([record["event"], record["peer"], percent(record["told_spread"]), percent(record["error"]),
                     f"{record['members']:,}", f"{record['seconds']:.2g}",
                     f"{percent(here['seen_spread'])}, {here['members']:,}, {here['seconds']:.2g}"])  # fmt: skip
    head = ["event", "library", "told", "error", "members", "seconds", "lgvi_warp: seen, members, seconds"]
    return markdown(head, rows, "llrrrrr")


def section(records: Sequence[dict[str, Any]]) -> str:
    """The text of the page."""
    runs = max((record["runs"] for record in records if "peer" in record), default=0)
    others = peers(records) if runs else "None was installed."
    return TEXT.format(events=events(records), peers=others, runs=runs, stamp=stamp("rare"))


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--records", type=Path, help="a file of JSON lines that `run rare` printed")


def main(records: Path | None) -> str:
    measured = case.run(quick=False) if records is None else read(records)
    return section([record for record in measured if "event" in record])
