"""The verbs merge, export, and info of a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from lgvi_warp.cli.report import size_of, told


def merge(chosen: argparse.Namespace) -> int:
    """lgvi-warp merge."""
    from lgvi_warp.runs.store.merge import merge as put_together

    folder = put_together(chosen.dirs, chosen.out, chosen.overwrite)
    if not folder.complete:
        left = len(folder.unfinished())
        missing = (
            f"{left} of {len(folder.runs)} blocks are in none of the folders; lgvi-warp resume {folder.path} runs them"
        )
        kept = f"the members that it keeps are missing; lgvi-warp resume {folder.path} runs them, or says why not"
        told([f"{folder.path}: {missing if left else kept}"])
    elif not chosen.quiet:
        print(f"file        {folder.path} ({size_of(folder.path) / 1e6:.1f} MB), complete")
    return 0 if folder.complete else 1


def export(chosen: argparse.Namespace) -> int:
    """lgvi-warp export."""
    from lgvi_warp.runs.store.export import export as write_as

    path = write_as(chosen.dir, chosen.to, chosen.out)
    print(f"file        {path} ({size_of(path) / 1e6:.1f} MB)")
    return 0


# Lines on damage.
MOST_SAID = 20


def info_of_run(path: Path) -> int:
    """What a store holds. Returns 0 if it is complete and whole, else 1."""
    from lgvi_warp.runs.store.state import state

    found = state(path)
    own = found["provenance"]
    print(f"run         {found['path']} ({found['bytes'] / 1e6:.1f} MB), lgvi-warp {own['versions']['lgvi-warp']}")
    print(f"members     {found['members']:,}, {own['method']['name']}, {own['dtype']}, step {own['step']:g} s, "
          f"{own['steps']:,} steps")  # fmt: skip
    fields = ", ".join(found["fields"])
    print(f"samples     {found['samples']} times" + (f" of {fields}" if fields else ", not of all members"))
    if found["keepers"]:
        print(f"parts       {', '.join(found['keepers'])} of each block")
    if found["kept"]:
        print(f"kept        {found['kept']:,} members' samples, run again")
    print(f"blocks      {found['finished']} of {found['blocks']} finished; "
          + ("complete" if found["complete"] else f"not complete: lgvi-warp resume {path}"))  # fmt: skip
    for text in found["damage"][:MOST_SAID]:
        print(f"damage      {text}")
    if (more := len(found["damage"]) - MOST_SAID) > 0:
        print(f"damage      and {more:,} more files")
    return 0 if found["complete"] else 1
