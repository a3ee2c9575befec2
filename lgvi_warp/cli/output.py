# SPDX-License-Identifier: Apache-2.0
"""Output of verbs: text in colors, or one JSON document."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from lgvi_warp import __version__
from lgvi_warp.common.errors import printable
from lgvi_warp.criteria.files import finite_or_none

# A function of the package that a verb calls: an argument of the verb, by default the package's own.
Part = Callable[..., Any] | None

BOLD, RED, YELLOW = "1", "31", "33"
# Labels of lines that are not bold alone.
COLORS = {"note": YELLOW, "warnings": YELLOW, "kept": BOLD, "damage": RED}


def colored(stream: TextIO) -> bool:
    """Tell whether colors are wanted."""
    choice: str = getattr(stream, "color", "auto")
    if choice != "auto":
        return choice == "always"
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def painted(text: str, color: str) -> str:
    """Wrap a text in the codes of a color."""
    return f"\x1b[{color}m{text}\x1b[0m"


def say(chosen: argparse.Namespace, text: str) -> None:
    """Print a text on stdout with colored labels, unless --quiet or --json is given."""
    if chosen.quiet or chosen.json or not text:
        return
    # Names and texts of a file may hold what a terminal obeys.
    text = printable(text, "\n")
    if colored(sys.stdout):
        text = re.sub(r"^[a-z]\w*(?=  )", lambda label: painted(label[0], COLORS.get(label[0], BOLD)), text, flags=re.M)
    print(text, flush=True)


def tell(chosen: argparse.Namespace, document: Callable[[], dict[str, Any]], text: Callable[[], str]) -> None:
    """Print the results of a verb: a text, or one JSON document."""
    if chosen.json:
        head = {"verb": chosen.verb, "version": __version__}
        print(json.dumps(as_json(head | document()), indent=1, allow_nan=False), flush=True)
    elif not chosen.quiet:
        say(chosen, text())


def as_json(value: Any) -> Any:
    """Convert a value to JSON types; numbers that are not finite become None."""
    if isinstance(value, dict):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [as_json(item) for item in value]
    return finite_or_none(value)


def print_faults(faults: Iterable[str]) -> list[str]:
    """Print faults on stderr, one per line; return them as a list."""
    faults = list(faults)
    name = painted("lgvi-warp:", RED) if colored(sys.stderr) else "lgvi-warp:"
    for fault in faults:
        print(name, printable(fault, "\n"), file=sys.stderr)
    return faults
