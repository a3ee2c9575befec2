# SPDX-License-Identifier: Apache-2.0
"""Content of a folder that a verb wrote, for the verb info and for pictures that are drawn again."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lgvi_warp.cli import documents
from lgvi_warp.cli.output import Part, tell
from lgvi_warp.cli.report import controller_lines, file_line, how_lines, members_line, shown_members, summary
from lgvi_warp.common.errors import SceneError
from lgvi_warp.common.reading import corrupt_file_as_scene_error, file_json, file_text
from lgvi_warp.common.safe_files import inside

# Endings of what verbs write beside the numbers.
OTHERS = (".png", ".rrd", ".html", ".csv", ".txt", ".nc", ".parquet")
# Most lines on damage.
MOST_SAID = 20


@dataclass(frozen=True)
class Content:
    """A run or study in a folder."""

    kind: str
    path: Path

    def load(self) -> Any:
        """Read the numbers of a run or of a study."""
        if self.kind == "store":
            from lgvi_warp.store.open import open_run

            return open_run(self.path)
        if self.kind == "result":
            from lgvi_warp.results.result import Result

            return Result.load(self.path)
        if self.kind == "sweep":
            with self.understood():
                return file_json(self.path)
        return _study(self.kind).load(self.path)

    def understood(self) -> AbstractContextManager[None]:
        """Turn errors that arise while the numbers are printed or drawn into faults of their file."""
        return corrupt_file_as_scene_error(self.path, "not what a verb wrote", "write it again, or see where by -v")


# Study -> name of the public class of what it found.
CLASSES = {"tradeoff": "Tradeoff", "stability": "StabilityMap", "rare": "RareEvent", "derivatives": "Derivatives",
           "worst_case": "WorstCase", "estimate": "Estimated", "tune_gains": "Tuned",
           "footprint": "Footprint"}  # fmt: skip


def _study(kind: str) -> Any:
    """Find the class of a study's answer."""
    if kind == "sensitivity":
        from lgvi_warp.uncertainty.sensitivity.indices import Indices

        return Indices
    if kind == "margins":
        from lgvi_warp.robustness.linear.margins import Margins

        return Margins
    if kind == "trim":
        from lgvi_warp.robustness.linear.trim import Trim

        return Trim
    from lgvi_warp import studies
    from lgvi_warp.common import extensions

    return getattr(studies, CLASSES[kind]) if kind in CLASSES else extensions.load("studies", kind)


def contents(folder: Path) -> list[Content]:
    """Find the runs and studies in a folder."""
    from lgvi_warp.criteria.files import study_files

    patterns = {"result": "result*.npz", **study_files()}
    studies: list[Content] = []
    if folder.suffix != ".zarr" and not folder.exists():
        raise SceneError([f"{folder} is not there. Give the folder of a run or of a study"])
    if folder.suffix != ".zarr" and folder.is_dir():
        studies = [Content(kind, path) for kind, pattern in patterns.items() for path in sorted(folder.glob(pattern))]
        for content in studies:
            inside(folder, content.path.name)
        stores = list(folder.glob("*.zarr"))
        if not studies and not stores:
            raise SceneError([f"{folder} contains no results of a command. Give the folder of a run or of a study"])
        if not stores:
            return studies
    from lgvi_warp.store.open import folder_of

    return [*studies, Content("store", folder_of(folder))]


def info_of_folder(chosen: argparse.Namespace, describe: Part = None) -> int:
    """Print the content and the damage of a folder; describe: function that describes a store."""
    parts = [_part(content, chosen, describe) for content in contents(chosen.dir)]
    others = [path for path in sorted(chosen.dir.glob("*")) if path.suffix in OTHERS and chosen.dir.suffix != ".zarr"]
    undamaged = all(document.get("complete", True) for document, _ in parts)
    document = {"path": chosen.dir, "complete": undamaged, "holds": [part for part, _ in parts], "files": others}
    tell(chosen, lambda: document, lambda: "\n".join([*(text() for _, text in parts), *map(file_line, others)]))
    return 0 if undamaged else 1


def _part(content: Content, chosen: argparse.Namespace, describe: Part) -> tuple[dict[str, Any], Callable[[], str]]:
    """Make the document and the text about one run or study in a folder."""
    head = {"kind": content.kind, "path": content.path}
    if content.kind == "store":
        from lgvi_warp.store.state import state

        numbers = (describe or state)(content.path)
        return head | documents.of_store(numbers), lambda: "\n".join(store_lines(numbers, chosen))
    numbers = content.load()
    with content.understood():
        if content.kind == "sweep":
            text = file_text(inside(content.path.parent, "summary.md"), "summary").rstrip()
            return head | {"content": numbers}, lambda: text
        if content.kind == "result":
            document = documents.of_result(numbers)
            text = summary(numbers, shown_members(numbers), [], verbose=chosen.verbose)
        else:
            document, text = {"content": numbers.to_dict()}, str(numbers)
    report = f"{file_line(content.path)}\n{text}"
    return head | document, lambda: report


def store_lines(contents: dict[str, Any], chosen: argparse.Namespace) -> Iterator[str]:
    """Describe the content of a store in lines."""
    provenance = contents["provenance"]
    yield f"run         {contents['path']} ({contents['bytes'] / 1e6:.1f} MB), lgvi-warp {provenance['versions']['lgvi-warp']}"
    yield members_line(contents["members"], provenance)
    yield from controller_lines(provenance["scene"])
    if chosen.verbose:
        yield from how_lines(provenance)
    fields = ", ".join(contents["fields"])
    yield f"samples     {contents['samples']} times" + (f" of {fields}" if fields else ", not of all members")
    if contents["keepers"]:
        yield f"parts       {', '.join(contents['keepers'])} of each block"
    if contents["kept"]:
        yield f"kept        {contents['kept']:,} members' samples, run again"
    end = "complete" if contents["complete"] else f"not complete: lgvi-warp resume {chosen.dir}"
    yield f"blocks      {contents['finished']} of {contents['blocks']} finished; {end}"
    most = len(contents["damage"]) if chosen.verbose else MOST_SAID
    for text in contents["damage"][:most]:
        yield f"damage      {text}"
    if (more := len(contents["damage"]) - most) > 0:
        yield f"damage      and {more:,} more files"
