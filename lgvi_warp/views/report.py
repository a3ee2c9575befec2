# SPDX-License-Identifier: Apache-2.0
"""The report of a run or of a study: one HTML file with pictures, tables, the scene and how to run it again."""

from __future__ import annotations

import base64
import csv
import html
import io
import json
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common.arguments import file_path, path_of, result_of
from lgvi_warp.common.errors import MissingExtra, NothingToDraw, SceneError
from lgvi_warp.common.files import place_of, write_text
from lgvi_warp.common.reading import file_bytes, file_json, file_text, understood
from lgvi_warp.common.safe_files import inside
from lgvi_warp.common.status import Warnings
from lgvi_warp.runs.outcomes import outcome_text, outcomes
from lgvi_warp.statistics.table import table
from lgvi_warp.studies.files import of_study
from lgvi_warp.views.fleet import LOOKS, title
from lgvi_warp.views.plots import drawable, plot, plot_statistics

if TYPE_CHECKING:
    from lgvi_warp.runs.result import Result

# A picture of more bytes is drawn in pixels, so that the file stays small.
MOST_SVG = 1_000_000
# Rows of a table of a study that the report shows; its CSV file has all.
MOST_ROWS = 200
STUDIES = ("tradeoff", "stability", "sensitivity")
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; } th, td { text-align: left; padding: .2rem .8rem .2rem 0; vertical-align: top; }
th { font-weight: 600; } td.number { text-align: right; font-variant-numeric: tabular-nums; }
pre { background: #f5f5f5; padding: .8rem; overflow-x: auto; font-size: 13px; }
svg, img { max-width: 100%; height: auto; } .outcome { display: inline-block; width: .8rem; height: .8rem; }
"""


def report(result: Result | str | os.PathLike[str], path: str | os.PathLike[str]) -> Path:
    """Write one HTML file that says what a run or a study found; it opens without a network.

    Of a run it has the outcomes of the members with remedies, notes and warnings, the pictures, the statistics with their
    intervals, how it was run, the scene as a file, and how to run it again. Of a study it has the pictures and tables that
    lie in its folder.

    Args:
        result: A result, or the folder of a run, a trade-off, a stability map or a sensitivity study.
        path: The file.

    Returns:
        The path.

    Raises:
        ImportError: Matplotlib or tomlkit is not installed (extra: viz).
        SceneError: The folder holds no run and no study.
        OSError: The file cannot be written.
    """
    if isinstance(result, str | os.PathLike):
    if isinstance(result, str | os.PathLike):
        return _of_folder(path_of("result", result), path)
    return _write(path, _name(result_of(result).provenance), _of_run(result))


def _of_folder(folder: Path, path: str | os.PathLike[str]) -> Path:
    """Write the page of what a folder holds. Raises SceneError where that is damaged."""
    with understood(folder, "not what a verb wrote", "write it again"):
        study = next((name for name in STUDIES if os.path.lexists(folder / f"{name}.json")), None)
        if study is not None:
            return _write(path, f"{study.capitalize()} of {folder.resolve().name}", _of_study(folder, study))
        result = _run_in(folder)
        return _write(path, _name(result.provenance), _of_run(result))


def _run_in(folder: Path) -> Result:
    """The run that a folder holds."""
    from lgvi_warp.runs.result import Result
    from lgvi_warp.runs.store.open import open_run

    if os.path.lexists(folder / "result.npz"):
        return Result.load(inside(folder, "result.npz"))
    if (folder / "run.zarr").exists() or folder.suffix == ".zarr":
        return open_run(folder)
    fault = "holds no run and no study"
    remedy = "give a folder that lgvi-warp run, tradeoff, stability or sensitivity wrote"
    raise SceneError([f"{folder}: {fault}; {remedy}"])


def _name(provenance: Mapping[str, Any]) -> str:
    scene = provenance["scene"]
    return str(scene.get("name") or scene["vehicle"].get("name") or "Run")


def _write(path: str | os.PathLike[str], name: str, parts: Iterator[str]) -> Path:
    """Write a page; it is there whole or not at all."""
    heading = html.escape(name)
    head = f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{heading}</title><style>{STYLE}</style></head>'
    place_of(file_path("path", path))  # before anything is drawn
    return write_text(path, f"{head}<body><h1>{heading}</h1>{''.join(parts)}</body></html>\n")


def _of_run(result: Result) -> Iterator[str]:
    """The parts of a run's page."""
    yield _paragraph(title(result))
    yield _section("What became of the members", _outcome_table(result))
    remarks = [*result.messages, *_warnings(result)]
    if remarks:
        yield _section("Notes and warnings", _list(remarks))
    pictures = [_picture(draw, result) for draw in _pictures_of(result)]
    if any(pictures):
        yield _section("Pictures", "".join(pictures))
    if result.statistics:
        at = f"At {result.time[-1]:g} s, with intervals."
        yield _section("Statistics", _paragraph(at) + _preformatted("\n".join(table(result.statistics))))
    yield _section("How it was run", _table((), _settings(result)))
    yield _section("Run it again", _again(result))


def _outcome_table(result: Result) -> str:
    counts = result.status.counts()
    rows = []
    for code in outcomes(result):
        number = counts[code.name.lower()]
        mark = f'<span class="outcome" style="background:{LOOKS[code].color}"></span> {html.escape(code.name.lower())}'
        share = f"{100.0 * number / result.members:.3g} %"
        rows.append((_Html(mark), f"{number:,}", share, outcome_text(result, code)))
    return _table(("outcome", "members", "share", "meaning and remedy"), rows)


def _warnings(result: Result) -> list[str]:
    """A line for each warning that arose."""
    texts = {str(warning.name).lower(): warning.text for warning in Warnings}
    return [f"{name}, {number:,} members: {texts[name]}" for name, number in result.warnings.counts().items()]


def _pictures_of(result: Result) -> list[Callable[[Any, Path], Path]]:
    drawn: list[Callable[[Any, Path], Path]] = [plot] if result.samples else []
    return drawn + ([plot_statistics] if drawable(result) else [])


def _picture(draw: Callable[[Any, Path], Path], result: Result) -> str:
    """A picture as SVG, or in pixels where that is large; a sentence where there is nothing to draw."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            drawn = draw(result, Path(folder) / "picture.svg")
            if drawn.stat().st_size > MOST_SVG:
                return _pixels(draw(result, Path(folder) / "picture.png"))
        except NothingToDraw as reason:
            return _paragraph(str(reason))
        text = file_text(drawn, "picture")
    return text[text.index("<svg") :]


def _pixels(path: Path) -> str:
    code = base64.b64encode(file_bytes(path, "picture")).decode()
    return f'<img alt="{html.escape(path.stem)}" src="data:image/png;base64,{code}">'


def _settings(result: Result) -> Iterator[tuple[str, str]]:
    """Names and values of how the run was made."""
    provenance = result.provenance
    method = provenance["method"]
    yield "method", f"{method['name']}, {method['chosen']}" if method.get("chosen") else str(method["name"])
    yield "step", f"{provenance['step']:g} s, {provenance['steps']:,} steps"
    yield "numbers", str(provenance["dtype"])
    yield "members", f"{result.members:,}"
    if (seed := provenance["scene"].get("ensemble", {}).get("seed")) is not None:
        yield "seed", str(seed)
    yield "versions", ", ".join(f"{name} {version}" for name, version in provenance["versions"].items())
    yield "machine", ", ".join(str(value) for value in provenance["machine"].values())


def _again(result: Result) -> str:
    """The scene as a file, and the command that runs it; a law that is a Python function is not in it."""
    scene = result.provenance["scene"]
    if any(law.get("type") == "callback" for law in scene.get("controller", {}).get("laws", ())):
        how = _paragraph("A law is a Python function, which no file holds: run the script again. The scene but for it:")
    else:
        how = _paragraph("Save this scene as scene.toml, then:") + _preformatted("lgvi-warp run scene.toml")
    return how + _preformatted(toml_of(scene))


def toml_of(content: Mapping[str, Any]) -> str:
    """Content as the text of a TOML file.

    Args:
        content: Tables of plain types, such as the scene of a provenance.

    Returns:
        The text.

    Raises:
        ImportError: tomlkit is not installed (extra: viz).
    """
    try:
        import tomlkit
    except ModuleNotFoundError as error:
        raise MissingExtra("reports", "tomlkit", "viz") from error
    return str(tomlkit.dumps(content))


def _of_study(folder: Path, study: str) -> Iterator[str]:
    """The parts of a study's page: its pictures, its table, and its settings."""
    held = inside(folder, f"{study}.json")
    with of_study(held):
        content = file_json(held)
        short = {key: value for key, value in content.items() if not isinstance(value, list)}
    for path in sorted(folder.glob("*.png")):
        yield _section(path.stem.replace("_", " ").capitalize(), _pixels(inside(folder, path.name)))
    rows_of = folder / f"{study}.csv"
    if os.path.lexists(rows_of):
        text = file_text(inside(folder, rows_of.name), "CSV file")
        with of_study(rows_of):
            try:
                head, *rows = list(csv.reader(io.StringIO(text, newline=""))) or [[]]
            except csv.Error as error:
                raise ValueError(str(error)) from None
        more = (
            f"The first {MOST_ROWS:,} of {len(rows):,} rows; {rows_of.name} has all." if len(rows) > MOST_ROWS else ""
        )
        yield _section("Table", _paragraph(more) + _table(head, rows[:MOST_ROWS]))
    yield _section("How it was made", _preformatted(json.dumps(short, indent=1)))


class _Html(str):
    """Text that is HTML already."""

    __slots__ = ()


def _escaped(value: str) -> str:
    return value if isinstance(value, _Html) else html.escape(value)


def _section(heading: str, content: str) -> str:
    return f"<h2>{html.escape(heading)}</h2>{content}"


def _paragraph(text: str) -> str:
    return f"<p>{html.escape(text)}</p>" if text else ""


def _preformatted(text: str) -> str:
    return f"<pre>{html.escape(text)}</pre>"


def _list(items: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{html.escape(item)}</li>' for item in items)}</ul>"


def _table(head: Sequence[str], rows: Iterator[Sequence[str]] | Sequence[Sequence[str]]) -> str:
    """A table; head: titles of its columns, none for a table of names and values."""
    titles = "".join(f"<th>{html.escape(text)}</th>" for text in head)
    body = "".join(f"<tr>{''.join(f'<td>{_escaped(text)}</td>' for text in row)}</tr>" for row in rows)
    return f"<table>{f'<tr>{titles}</tr>' if titles else ''}{body}</table>"
