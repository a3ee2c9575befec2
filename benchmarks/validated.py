# SPDX-License-Identifier: Apache-2.0
"""Stored content of a comparison with a published experiment or code.

Its rows, the curves of its picture, and where both stand.
"""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from benchmarks.pages import ROOT, markdown

sys.path.append(str(ROOT / "docs"))

from site_parts import pictures

CASES = sorted(path.stem for path in (ROOT / "benchmarks" / "validation").glob("[a-z]*.py"))
# Size in inches, drawn at this many pixels to the inch.
SIZE, FINE = (10.0, 4.2), 110
# What a comparison may be with, in the order of the overview.
KINDS = ("experiment at sea", "published computation", "published code", "theory")
PUBLISHED, COMPUTED = "#d55e00", "#0072b2"


class Row(NamedTuple):
    """One compared number.

    Attributes:
        what: What it is, in words.
        unit: Its unit.
        published: What others measured, printed or computed.
        within: How well that is known: half of a reading's step, or a standard deviation; None where nothing says so.
        computed: What this package computes.
    """

    what: str
    unit: str
    published: float
    within: float | None
    computed: float

    @property
    def error(self) -> float:
        """Computed less published."""
        return self.computed - self.published


class Content(NamedTuple):
    """Stored content of a comparison.

    Attributes:
        rows: The compared numbers.
        curves: Name -> (x, y) of what the picture draws.
    """

    rows: list[Row]
    curves: dict[str, tuple[list[float], list[float]]]


def curve(x: Any, y: Any, most: int = 400) -> tuple[list[float], list[float]]:
    """Places and values of a curve, thinned to at most so many points."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    chosen = np.unique(np.linspace(0, len(x) - 1, min(most, len(x))).round().astype(int))
    return x[chosen].tolist(), y[chosen].tolist()


def case(name: str) -> ModuleType:
    """The module of a comparison."""
    return importlib.import_module(f"benchmarks.validation.{name}")


def rows_of(name: str) -> Path:
    """Path of a comparison's rows."""
    return ROOT / "benchmarks" / "rows" / f"validation_{name}.json"


def page_of(name: str) -> Path:
    """The page of a comparison."""
    return ROOT / "docs" / "validation" / f"{name}.md"


def keep(name: str, content: Content) -> None:
    """Write what is kept of a comparison, a row to a line."""
    rows = ",\n  ".join(json.dumps([*row[:2], *(_short(value, 8) for value in row[2:])]) for row in content.rows)
    curves = ",\n  ".join(
        f"{json.dumps(key)}: {json.dumps([[_short(value, 5) for value in values] for values in pair])}"
        for key, pair in content.curves.items()
    )
    rows_of(name).write_text(f'{{\n "rows": [\n  {rows}\n ],\n "curves": {{\n  {curves}\n }}\n}}\n')


def kept(name: str) -> Content:
    """Stored content of a comparison."""
    content = json.loads(rows_of(name).read_text())
    return Content(
        [Row(*row) for row in content["rows"]], {key: tuple(pair) for key, pair in content["curves"].items()}
    )


def _short(value: float | None, digits: int) -> float | None:
    """A number of so many digits."""
    return None if value is None else float(f"{value:.{digits}g}")


def draw(name: str, content: Content) -> None:
    """Draw the picture of a comparison, with the hash of what made it."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    module = case(name)
    with plt.rc_context({"font.size": 12, "axes.titlesize": 12, "legend.fontsize": 10.5}):
        figure = plt.figure(figsize=getattr(module, "SIZE", SIZE), layout="constrained")
        plot(name, content, figure)
        target = page_of(name).with_suffix(".png")
        figure.savefig(target, dpi=FINE)
        plt.close(figure)
    pictures.keep(target, target, script=pictures.made_of(f"validation/{target.name}"))


def plot(name: str, content: Content, figure: Any) -> None:
    """Put the picture of a comparison into a figure, with its title."""
    module = case(name)
    figure.suptitle(module.TITLE, fontsize=14)
    module.draw(content, figure)


def number(value: float | None) -> str:
    """A number of a table."""
    return "" if value is None else f"{value:.4g}"


def percent(row: Row) -> str:
    """The error in percent of what is published, or nothing where that is 0."""
    return f"{100.0 * row.error / abs(row.published):.2g} %" if row.published else ""


def table(rows: Sequence[Row]) -> str:
    """The Markdown table of compared numbers."""
    head = ["", "unit", "published", "known to", "computed", "error", "of it"]
    cells = [
        [row.what, row.unit, number(row.published), "" if row.within is None else f"+-{number(row.within)}",
         number(row.computed), f"{row.error:+.2g}", percent(row)]
        for row in rows
    ]  # fmt: skip
    return markdown(head, cells, "llrrrrr")


def section(name: str, content: Content) -> str:
    """Section between the marks of a comparison's page: its picture and its table."""
    module = case(name)
    return "\n\n".join([f"![{module.PICTURE}]({name}.png)", table(content.rows)])


def within(rows: Sequence[Row]) -> str:
    """Number of rows that agree to the accuracy of the published number, of those with a stated accuracy."""
    told = [row for row in rows if row.within is not None]
    return f"{sum(abs(row.error) <= row.within for row in told)} of {len(told)}" if told else ""  # type: ignore[operator]


def largest(content: Content) -> float | None:
    """Largest error of a page's rows in percent of the published number; None where all of these are 0."""
    return max((100.0 * abs(row.error / row.published) for row in content.rows if row.published), default=None)


def agreement(name: str, content: Content) -> float:
    """Error of the headline in percent of what is published, or of the row that the module names in OF."""
    module, rows = case(name), {row.what: row for row in content.rows}
    of = rows[getattr(module, "OF", module.HEADLINE)].published
    return 100.0 * abs(rows[module.HEADLINE].error / of)


def overview(contents: Mapping[str, Content]) -> str:
    """The table of all comparisons, the best agreement first."""
    head = ["comparison", "with", "origin and accuracy of the numbers", "quantity", "published", "computed", "error",
            "largest error", "rows within uncertainty"]  # fmt: skip
    lines = []
    for name in sorted(contents, key=lambda name: agreement(name, contents[name])):
        module, content = case(name), contents[name]
        (row,) = (row for row in content.rows if row.what == module.HEADLINE)
        of = f" of {module.OF_WORDS}" if hasattr(module, "OF") else ""
        lines.append([f"[{module.TITLE}]({name}.md)", module.AGAINST, module.KNOWN, f"{row.what} [{row.unit}]",
                      number(row.published), number(row.computed), f"{agreement(name, content):.2g} %{of}",
                      f"{largest(content):.2g} %", within(content.rows)])  # fmt: skip
    return markdown(head, lines, "llllrrrrr")
