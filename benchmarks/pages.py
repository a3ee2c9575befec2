# SPDX-License-Identifier: Apache-2.0
"""Output of the benchmarks: JSON lines, Markdown tables, and the part of a docs' page between its marks."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
# Table -> the page that it writes into, between the marks of its name.
PAGES = {
    "bars": "docs/guide/beside_others.md",
    "charts": "docs/explain/how_it_is_fast.md",
    "coupled": "docs/explain/coupled_inertia.md",
    "drift": "docs/explain/long_runs.md",
    "fronts": "docs/guide/accuracy_and_speed.md",
    "large": "docs/guide/large_ensembles.md",
    "limits": "docs/guide/when_it_breaks.md",
    "method": "docs/reference/method_costs.md",
    "peers": "docs/reference/peers.md",
    "rare": "docs/reference/rare_event_costs.md",
    "roofline": "docs/reference/roofline.md",
    "sampling": "docs/reference/sampling_costs.md",
    "sizes": "docs/start/install.md",
    "solver": "docs/explain/solvers.md",
    "term": "docs/reference/term_costs.md",
    "validation": "docs/validation/README.md",
    "vehicles": "docs/guide/named_vehicles.md",
}


def parts(table: str, page: Path) -> tuple[str, str]:
    """Read what a page holds before and after the table, marks included.

    Args:
        table: Name of the table and of its marks.
        page: The file.

    Returns:
        The text up to the first mark's end, and that from the second mark's start.

    Raises:
        SystemExit: The page, or one of its two marks, is missing.
    """
    begin, end = f"<!-- {table}: begin -->", f"<!-- {table}: end -->"
    if not page.is_file():
        raise SystemExit(f"table {table}: its page {page} is missing; add it, or change PAGES in benchmarks/pages.py")
    text = page.read_text()
    if text.count(begin) != 1 or text.count(end) != 1 or text.index(begin) > text.index(end):
        raise SystemExit(f"table {table}: its page {page} needs the lines {begin} and {end}, once and in this order")
    return text[: text.index(begin) + len(begin)], text[text.index(end) :]


def write(table: str, page: Path, text: str) -> None:
    """Put a table's text between its marks in a page; raises SystemExit as `parts` does."""
    before, after = parts(table, page)
    page.write_text(f"{before}\n\n{text.strip()}\n\n{after}")


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]], align: str = "") -> str:
    """A Markdown table.

    Args:
        head: Titles of the columns.
        rows: Cells, as many in each row as titles.
        align: A letter for each column, "r" for numbers that stand at the right; default none.
    """
    rules = ["---:" if letter == "r" else "---" for letter in align.ljust(len(head))]
    return "\n".join(line(cells) for cells in (head, rules, *rows))


def line(cells: Sequence[str]) -> str:
    """One line of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def stamp(table: str, options: str = "") -> str:
    """The machine, the versions and the command that wrote a table. options: those of the command, if any."""
    from lgvi_warp.common import machine

    about, versions = machine.describe(), machine.versions()
    where = f"{about['cpu']}, {about['simd']}; Warp {versions['warp-lang']}, NumPy {versions['numpy']}"
    command = f"python -m benchmarks table {table} {options}".strip()
    return f"Machine: {where}. Written by `{command}`; do not edit between the marks."


def show(record: dict[str, Any]) -> str:
    """Print a record as a JSON line, at once. Returns the line."""
    text = json.dumps(record)
    print(text, flush=True)
    return text


def read(path: Path) -> list[dict[str, Any]]:
    """The records of a file of JSON lines."""
    return [json.loads(text) for text in path.read_text().splitlines()]
