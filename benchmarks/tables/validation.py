# SPDX-License-Identifier: Apache-2.0
"""Published experiments and codes beside this package: run every comparison, keep its rows, write its page and picture.

The rows stay in benchmarks/rows; pages and pictures follow from them: `--kept` writes both again without running.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from benchmarks import pages
from benchmarks.validated import CASES, case, draw, keep, kept, overview, page_of, section


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "cases", nargs="*", choices=[*CASES, []], metavar="CASE", help=f"of {', '.join(CASES)}; default: all"
    )
    parser.add_argument("--kept", action="store_true", help="run nothing: write pages and pictures from the rows")


def main(cases: Sequence[str], kept: bool = False) -> str:
    for name in cases or CASES:
        write(name, kept)
    return text_of()


def write(name: str, from_rows: bool) -> None:
    """Write the rows, the picture and the page of one comparison. from_rows: the rows are left as they are."""
    if not from_rows:
        keep(name, case(name).measured())
    content = kept(name)
    draw(name, content)
    pages.write("validation", page_of(name), section(name, content))
    print(section(name, content), file=sys.stderr, flush=True)


def text_of() -> str:
    """The table of the overview, from the rows that are kept."""
    return overview({name: kept(name) for name in CASES})
