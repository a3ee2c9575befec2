# SPDX-License-Identifier: Apache-2.0
"""What all pictures take, and what their help says of it."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from typing import Any, TypeVar

FilePath = str | os.PathLike[str]
Draws = TypeVar("Draws", bound=Callable[..., Any])
# What pictures have in common, as their help says it.
HELP = {
    "ax": "Matplotlib axes to draw on; default None, those of a figure of its own.",
    "figure": "Matplotlib figure to draw on; default None, one of its own.",
    "path": "File to write; its ending chooses the format. Default None: none is written.",
}
NOT_INSTALLED = "ImportError: Matplotlib is not installed (extra: viz)."
NOT_WRITTEN = "OSError: The file cannot be written."


def picture(draw: Draws) -> Draws:
    """Say in the help of a picture what is the same of all: where it is drawn, the file, and what it may raise."""
    taken, text = inspect.signature(draw).parameters, inspect.getdoc(draw) or ""
    text, example, code = text.partition("\n\nExamples:")
    arguments, _, rest = text.partition("\n\nReturns:")
    returns, _, raises = rest.partition("\n\nRaises:")
    missing = [name for name in HELP if name in taken and f"\n    {name}: " not in arguments]
    common = "".join(f"\n    {name}: {HELP[name]}" for name in missing)
    written = "" if "OSError: " in raises else f"\n    {NOT_WRITTEN}"
    draw.__doc__ = (
        f"{arguments}{common}\n\nReturns:{returns}\n\nRaises:\n    {NOT_INSTALLED}{raises}{written}{example}{code}"
    )
    return draw
