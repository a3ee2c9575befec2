# SPDX-License-Identifier: Apache-2.0
"""Common arguments of all pictures, and their help."""

from __future__ import annotations

import functools
import inspect
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar, cast

from lgvi_warp.common.errors import Faults, refusal

FilePath = str | os.PathLike[str]
Draws = TypeVar("Draws", bound=Callable[..., Any])
# What pictures have in common, as their help says it.
HELP = {
    "ax": "Matplotlib axes to draw on; default None: the axes of a new figure.",
    "figure": "Matplotlib figure to draw on; default None: a new figure.",
    "path": "File to write; its extension selects the format. Default None: no file is written.",
    "style": '"one_column" or "two_columns": as wide as one or two columns of a printed page (3.5 or 7.16 in), with '
    "8-point text, fonts embedded in PDF and 300 dots per inch. Default None: a picture for screens.",
}
# Columns of a printed page -> their width [in], as IEEE's journals have them.
WIDTHS = {"one_column": 3.5, "two_columns": 7.16}
STYLE: ContextVar[str | None] = ContextVar("style", default=None)
NOT_INSTALLED = "ImportError: Matplotlib is not installed (extra: viz)."
NOT_WRITTEN = "OSError: The file cannot be written."


@contextmanager
def printed(style: str | None, options: dict[str, Any]) -> Iterator[None]:
    """Draw in a style; None leaves that of the picture around this one."""
    if style is None:
        yield
        return
    faults = Faults()
    faults.choice("style", style, WIDTHS)
    faults.raise_if_any()
    for name in ("ax", "figure"):
        if options.get(name) is not None:
            raise refusal(
                "style", style, f"is given with {name}, whose size is its owner's", f"leave out style or {name}"
            )
    before = STYLE.set(style)
    try:
        yield
    finally:
        STYLE.reset(before)


def picture(draw: Draws) -> Draws:
    """Let a picture be drawn in a style, and say in its help what is the same of all: axes, files, what it may raise."""

    @functools.wraps(draw)
    def drawn(*arguments: Any, style: str | None = None, **options: Any) -> Any:
        with printed(style, options):
            return draw(*arguments, **options)

    signature = inspect.signature(draw)
    option = inspect.Parameter("style", inspect.Parameter.KEYWORD_ONLY, default=None, annotation="str | None")
    drawn.__signature__ = signature.replace(parameters=[*signature.parameters.values(), option])  # type: ignore[attr-defined]
    taken, text = {*signature.parameters, "style"}, inspect.getdoc(draw) or ""
    text, example, code = text.partition("\n\nExamples:")
    arguments, _, rest = text.partition("\n\nReturns:")
    returns, _, raises = rest.partition("\n\nRaises:")
    missing = [name for name in HELP if name in taken and f"\n    {name}: " not in arguments]
    common = "".join(f"\n    {name}: {HELP[name]}" for name in missing)
    written = "" if "OSError: " in raises else f"\n    {NOT_WRITTEN}"
    drawn.__doc__ = (
        f"{arguments}{common}\n\nReturns:{returns}\n\nRaises:\n    {NOT_INSTALLED}{raises}{written}{example}{code}"
    )
    return cast(Draws, drawn)
