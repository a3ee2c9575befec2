"""The verbs merge and export, and info about a folder."""

from __future__ import annotations

import argparse
from pathlib import Path

from lgvi_warp.cli.report import controller_lines, file_line, members_line, print_faults


def merge(chosen: argparse.Namespace) -> int:
    """Run the verb merge: put runs of some blocks each together.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0 if the whole run is there, otherwise 1.

    Raises:
        SceneError: The folders do not belong together, or a store is there already.
    """
    from lgvi_warp.runs.store.merge import merge as put_together

    folder = put_together(chosen.dirs, chosen.out, chosen.overwrite)
    if not folder.complete:
        blocks = len(folder.unfinished())
        missing = f"{blocks} of {len(folder.runs)} blocks are in none of the folders; lgvi-warp resume {folder.path} runs them"
        kept = f"the members that it keeps are missing; lgvi-warp resume {folder.path} runs them, or says why not"
        print_faults([f"{folder.path}: {missing if blocks else kept}"])
    elif not chosen.quiet:
        print(f"{file_line(folder.path)}, complete")
    return 0 if folder.complete else 1


def export(chosen: argparse.Namespace) -> int:
    """Run the verb export: write a stored run as one NetCDF or Parquet file.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0.

    Raises:
        SceneError: The store cannot be read, or the format is unknown.
    """
    from lgvi_warp.runs.store.export import export as write_as

    path = write_as(chosen.dir, chosen.to, chosen.out)
    print(file_line(path))
    return 0


def report(chosen: argparse.Namespace) -> int:
    """Run the verb report: write one HTML file about a run or a study.

    Args:
        chosen: The command's parsed arguments.

    Returns:
        The exit code: 0.

    Raises:
        SceneError: The folder holds no run and no study.
    """
    import webbrowser

    from lgvi_warp.views.report import report as write_report

    path = write_report(chosen.dir, chosen.out or chosen.dir / "report.html")
    if not chosen.quiet:
        print(file_line(path))
    if chosen.open:
        webbrowser.open(path.resolve().as_uri())
    return 0


# Most lines on damage.
MOST_SAID = 20


def info_of_run(path: Path) -> int:
    """Print what a store holds, and what is damaged of it.

    Args:
        path: The store, or a folder with one.

    Returns:
        The exit code: 0 if it is complete and undamaged, otherwise 1.
    """
    from lgvi_warp.runs.store.state import state

    contents = state(path)
    provenance = contents["provenance"]
    version = provenance["versions"]["lgvi-warp"]
    print(f"run         {contents['path']} ({contents['bytes'] / 1e6:.1f} MB), lgvi-warp {version}")
    print("\n".join([members_line(contents["members"], provenance), *controller_lines(provenance["scene"])]))
    fields = ", ".join(contents["fields"])
    print(f"samples     {contents['samples']} times" + (f" of {fields}" if fields else ", not of all members"))
    if contents["keepers"]:
        print(f"parts       {', '.join(contents['keepers'])} of each block")
    if contents["kept"]:
        print(f"kept        {contents['kept']:,} members' samples, run again")
    print(f"blocks      {contents['finished']} of {contents['blocks']} finished; "
          + ("complete" if contents["complete"] else f"not complete: lgvi-warp resume {path}"))  # fmt: skip
    for text in contents["damage"][:MOST_SAID]:
        print(f"damage      {text}")
    if (more := len(contents["damage"]) - MOST_SAID) > 0:
        print(f"damage      and {more:,} more files")
    return 0 if contents["complete"] else 1
