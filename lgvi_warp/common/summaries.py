# SPDX-License-Identifier: Apache-2.0
"""Short texts and tables that describe objects, for a prompt and for notebooks."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from lgvi_warp.common.arguments import explained

# Most lines of a text, most characters of a line, and most entries of an array that are written out.
LINES, WIDTH, ENTRIES = 20, 96, 6

Rows = Sequence[tuple[str, str]]


class Summarized:
    """An object that is displayed as a title and rows of (label, text)."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        explained(cls)

    def summary_rows(self) -> tuple[str, Rows]:
        """The title, and rows of (label, text), that describe the object."""
        raise NotImplementedError

    def summary_picture(self) -> str:
        """The object as SVG, for notebooks; "" for no picture, the default."""
        return ""

    def __repr__(self) -> str:
        return as_table(*self.summary_rows())

    def _repr_html_(self) -> str:
        title, rows = self.summary_rows()
        cells = "".join(
            f"<tr><th style='text-align:left'>{html.escape(label)}</th>"
            f"<td style='text-align:left'>{html.escape(_cut(text))}</td></tr>"
            for label, text in _fewer(rows)
        )
        return f"<div><b>{html.escape(_cut(title))}</b><table>{cells}</table>{self.summary_picture()}</div>"


def as_table(title: str, rows: Rows) -> str:
    """Write a title and rows of (label, text), one per line."""
    rows = _fewer(rows)
    width = max((len(label) for label, _ in rows), default=0)
    return "\n".join([_cut(title), *(_cut(f"  {label:<{width}}  {text}") for label, text in rows)])


def _fewer(rows: Rows) -> Rows:
    """The first rows, and the number of omitted ones."""
    if len(rows) < LINES:
        return rows
    return [*rows[: LINES - 2], ("...", f"and {len(rows) - LINES + 2:,} more")]


def _cut(line: str) -> str:
    """A line, cut after WIDTH characters."""
    line = " ".join(line.splitlines())
    return line if len(line) <= WIDTH else f"{line[: WIDTH - 3]}..."


def listed(names: Iterable[Any], most: int = 8) -> str:
    """List some names."""
    words = [str(name) for name in names]
    more = f" and {len(words) - most:,} more" if len(words) > most else ""
    return ", ".join(words[:most]) + more if words else "none"


def counted(counts: dict[str, int]) -> str:
    """Write numbers by name."""
    return ", ".join(f"{name} {number:,}" for name, number in counts.items())


def plural(count: int, noun: str) -> str:
    """Write a count with its noun."""
    return f"{count:,} {noun}{'s' * (count != 1)}"


def percent(value: float, digits: int = 4) -> str:
    """Write a fraction in percent; only exactly 0 is written as 0, and only exactly 1 as 100."""
    text = f"{100.0 * value:.{digits}g}"
    return (
        text if digits == 17 or float(text) not in (0.0, 100.0) or value in (0.0, 1.0) else percent(value, digits + 1)
    )


def few_digits(value: Any, unit: str = "", digits: int = 6) -> str:
    """Write a number or an array with a few digits per entry; a matrix by its diagonal or its shape."""
    array = np.asarray(value, dtype=np.float64)
    after = f" {unit}" if unit not in ("", "1") else ""
    if array.ndim == 2 and array.shape[0] == array.shape[1] and not np.any(array - np.diag(np.diag(array))):
        return f"diagonal {few_digits(np.diag(array), unit)}"
    if array.ndim == 0:
        return f"{array:.{digits}g}{after}"
    if array.ndim > 1 or array.size > ENTRIES:
        return f"{' x '.join(map(str, array.shape))} numbers{after}"
    return f"[{', '.join(f'{entry:.{digits}g}' for entry in array)}]{after}"


def curves(time: np.ndarray, values: np.ndarray, marked: np.ndarray, label: str) -> str:
    """Draw curves (k, n) over times (k,) as SVG, the marked ones (n,) in a second colour; the value axis points down."""
    width, height, margin = 260.0, 90.0, 6.0
    finite = np.isfinite(values)
    if len(time) < 2 or not finite.any():
        return ""
    low, high = values[finite].min(), values[finite].max()
    x = margin + (width - 2.0 * margin) * (time - time[0]) / (time[-1] - time[0])
    y = margin + (height - 2.0 * margin) * (values - low) / (high - low if high > low else 1.0)
    lines = []
    for i in range(values.shape[1]):
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x[finite[:, i]], y[finite[:, i], i], strict=True))
        style = "#D55E00' stroke-dasharray='4 2" if marked[i] else "#0072B2"
        lines.append(f"<polyline points='{points}' fill='none' stroke='{style}' stroke-width='1'/>")
    return (
        f"<svg width='{width:.0f}' height='{height:.0f}' style='border:1px solid #ccc'>{''.join(lines)}</svg>"
        f"<br><small>{html.escape(f'{label}: {low:.4g} to {high:.4g}')}</small>"
    )
