# SPDX-License-Identifier: Apache-2.0
"""The report of a run or of studies: one HTML file with pictures, tables, the scene and the command."""

from __future__ import annotations

import base64
import csv
import html
import io
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp import plots
from lgvi_warp.common.arguments import file_path, path_of, result_of
from lgvi_warp.common.errors import NothingToDraw, SceneError, printable
from lgvi_warp.common.files import place_of, write_text
from lgvi_warp.common.reading import corrupt_file_as_scene_error, file_bytes, file_json, file_text
from lgvi_warp.common.safe_files import inside
from lgvi_warp.common.sentences import sentences
from lgvi_warp.common.status import Warnings
from lgvi_warp.criteria.files import of_study, study_files
from lgvi_warp.results.outcomes import outcome_text, outcomes
from lgvi_warp.results.varied import varied
from lgvi_warp.statistics.estimates.table import table
from lgvi_warp.uncertainty.footprint.footprint import run_answer
from lgvi_warp.views.commands import faults
from lgvi_warp.views.fleet import OUTCOME_STYLES, title
from lgvi_warp.views.pages.run_again import how_to_run_again
from lgvi_warp.views.plots.estimates import drawable
from lgvi_warp.views.plots.inputs import inputs_by_outcome
from lgvi_warp.views.plots.sweep_pictures import PICTURES

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

# A picture of more bytes is drawn in pixels, so that the file stays small.
MOST_SVG = 1_000_000
# Most bytes of the pictures of studies that it holds; one has some tens of kilobytes.
MOST_PICTURES = 100_000_000
# Rows of a table of a study that the report shows; its CSV file has all.
MOST_ROWS = 200
# Longest list, or text, that it shows of a study's settings.
MOST_LISTED = 400
# Pictures that lgvi-warp run writes.
OF_A_RUN = ("fleet.png", "statistics.png")
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; } th, td { text-align: left; padding: .2rem .8rem .2rem 0; vertical-align: top; }
th { font-weight: 600; } td.number { text-align: right; font-variant-numeric: tabular-nums; }
pre { background: #f5f5f5; padding: .8rem; overflow-x: auto; font-size: 13px; }
@media print { pre { white-space: pre-wrap; } }
svg, img { max-width: 100%; height: auto; } .outcome { display: inline-block; width: .8rem; height: .8rem; }
"""


def report(result: Result | str | os.PathLike[str], path: str | os.PathLike[str]) -> Path:
    """Write one HTML file with the results of a run or of studies. The file needs no network to be read.

    The report of a run has the outcomes of the members with remedies, notes and warnings, pictures, and statistics with
    intervals. It also has the settings, the original text of the scene, and the command that repeats the run. The
    report of a study has the pictures and tables in the folder of the study.

    Args:
        result: A result, or a folder with a run, a trade-off, a stability map, a sensitivity study, a sweep or several
            of these.
        path: Path of the HTML file.

    Returns:
        The path.

    Raises:
        ImportError: Matplotlib or tomlkit is not installed (extra: viz).
        SceneError: The folder holds no run and no study.
        OSError: The file cannot be written.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> print(lw.report(result, "report.html"))
        report.html
    """
    place_of(file_path("path", path))  # before anything is drawn
    if isinstance(result, str | os.PathLike):
        name, parts = _of_folder(path_of("result", result))
    else:
        run = result_of(result)
        name, parts = name_of(run.provenance), [_paragraph(f"Written on {_day(time.time())}."), *_of_run(run)]
    heading = _plain(name)
    head = f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{heading}</title><style>{STYLE}</style></head>'
    return write_text(path, f"{head}<body><h1>{heading}</h1>{''.join(parts)}</body></html>\n")


def _of_folder(folder: Path) -> tuple[str, list[str]]:
    """Title and HTML parts of the page for a folder. Raises SceneError if its content is damaged."""
    with corrupt_file_as_scene_error(folder, "not what a verb wrote", "write it again"):
        run, studies = run_in(folder), studies_in(folder)
        if run is None and not studies:
            fault = "holds no run and no study"
            remedy = f"give a folder that lgvi-warp run wrote, or a study: {', '.join(study_files())}".replace("_", "-")
            raise SceneError([sentences(folder, fault, remedy)])
        place, parts = folder.resolve().name, list[str]()
        if run is not None:
            held, file = run
            parts += [_paragraph(f"Run of {_day(file.stat().st_mtime)}, in {place}."), *_of_run(held)]
        for study in studies:
            parts.append(_paragraph(f"{_words(study)} of {_day(study.stat().st_mtime)}, in {place}."))
            with of_study(study):
                parts.append(_paragraph(str(file_json(study).pop("answer", ""))))
        if studies:
            parts += [_section(_words(picture), _pixels(picture)) for picture in _pictures_in(folder, run is not None)]
        for study in studies:
            parts += _of_study(study)
        return name_of(held.provenance) if run is not None else f"{_words(studies[0])} of {place}", parts


def run_in(folder: Path) -> tuple[Result, Path] | None:
    """Read the run in a folder: the result, and its file or store; None if the folder holds no run."""
    from lgvi_warp.results.result import Result
    from lgvi_warp.store.open import open_run

    if os.path.lexists(folder / "result.npz"):
        held = inside(folder, "result.npz")
        return Result.load(held), held
    if (folder / "run.zarr").exists() or folder.suffix == ".zarr":
        return open_run(folder), folder
    return None


def studies_in(folder: Path) -> list[Path]:
    """Find the studies in a folder."""
    return [inside(folder, path.name) for pattern in study_files().values() for path in sorted(folder.glob(pattern))]


def name_of(provenance: Mapping[str, Any]) -> str:
    """Name a run by its scene file and its vehicle."""
    source, vehicle = provenance.get("source", {}), provenance["scene"].get("vehicle", {})
    names = (Path(str(source.get("file", ""))).stem, str(vehicle.get("title") or ""))
    return ": ".join(name for name in names if name) or "Run"


def _day(seconds: float) -> str:
    """Date of a time since the epoch [s], in local time."""
    return time.strftime("%Y-%m-%d", time.localtime(seconds))


def _words(path: Path) -> str:
    """Title made from the name of a file."""
    return path.stem.replace("_", " ").capitalize()


def _of_run(result: Result) -> Iterator[str]:
    """HTML parts of a run's page."""
    yield _paragraph(title(result))
    yield _paragraph(run_answer(result))
    yield _section("Outcomes of the members", _outcome_table(result))
    remarks = [*result.messages, *_warnings(result), *(fault.text for fault in faults(result))]
    if remarks:
        yield _section("Notes and warnings", _list(remarks))
    pictures = [inline(draw, result) for draw in _pictures_of(result)]
    if any(pictures):
        yield _section("Pictures", "".join(pictures))
    if result.statistics:
        at = f"Estimates at {result.time[-1]:g} s, with confidence intervals."
        yield _section("Statistics", _paragraph(at) + _preformatted("\n".join(table(result.statistics))))
    yield _section("Settings of the run", _table((), _settings(result)))
    yield _section("Repeat the run", _again(result))


def _outcome_table(result: Result) -> str:
    counts = result.status.counts()
    rows = []
    for code in outcomes(result):
        number = counts[code.name.lower()]
        color = OUTCOME_STYLES[code].color
        mark = f'<span class="outcome" style="background:{color}"></span> {_plain(code.name.lower())}'
        share = f"{100.0 * number / result.members:.3g} %"
        rows.append((_Html(mark), f"{number:,}", share, outcome_text(result, code)))
    return _table(("outcome", "members", "share", "meaning and remedy"), rows)


def _warnings(result: Result) -> list[str]:
    """Write one line for each warning that arose."""
    texts = {str(warning.name).lower(): warning.text for warning in Warnings}
    return [f"{name}, {number:,} members: {texts[name]}" for name, number in result.warnings.counts().items()]


def _pictures_of(result: Result) -> list[Callable[..., Any]]:
    """Functions that draw the pictures of a run: a summary, inputs of members that ended differently, statistics."""
    differ = len(outcomes(result)) > 1
    sampled = result.samples or result.kept is not None
    drawn: list[Callable[..., Any]] = [plots.summary] if sampled else [plots.outcomes] * differ
    drawn += [inputs_by_outcome] if differ and varied(result) else []
    return drawn + ([plots.statistics] if drawable(result) else [])


def inline(draw: Callable[..., Any], result: Result) -> str:
    """A picture as SVG, or as pixels if it is large; a sentence if there is nothing to draw."""
    with tempfile.TemporaryDirectory() as folder:
        drawn, pixels = (Path(folder) / f"picture.{ending}" for ending in ("svg", "png"))
        try:
            draw(result, path=drawn)
            if drawn.stat().st_size > MOST_SVG:
                draw(result, path=pixels)
                return _pixels(pixels)
        except NothingToDraw as reason:
            return _paragraph(str(reason))
        text = file_text(drawn, "picture")
    return text[text.index("<svg") :]


def _pixels(path: Path) -> str:
    code = base64.b64encode(file_bytes(path, "picture")).decode()
    return f'<img alt="{_plain(path.stem)}" src="data:image/png;base64,{code}">'


def _settings(result: Result) -> Iterator[tuple[str, str]]:
    """Names and values of a run's settings."""
    provenance = result.provenance
    method = provenance["method"]
    yield "method", f"{method['name']}, {method['chosen']}" if method.get("chosen") else str(method["name"])
    yield "step", f"{provenance['step']:g} s, {provenance['steps']:,} steps"
    yield "number type", str(provenance["dtype"])
    yield "members", f"{result.members:,}"
    if (seed := provenance.get("ensemble", {}).get("seed")) is not None:
        yield "seed", str(seed)
    yield "versions", ", ".join(f"{name} {version}" for name, version in provenance["versions"].items())
    yield "machine", ", ".join(str(value) for value in provenance["machine"].values())


def _again(result: Result) -> str:
    """The command that repeats the run, and the scene."""
    command, remark, text = how_to_run_again(result.provenance)
    return _paragraph(remark) + (_preformatted(command) if command else "") + _preformatted(text)


def _of_study(path: Path) -> Iterator[str]:
    """HTML parts of a study's page without its pictures: words, table and settings."""
    with of_study(path):
        short = {
            key: _shortened(value)
            for key, value in file_json(path).items()
            if key != "answer" and not isinstance(value, list)
        }
    table_file = "table.csv" if path.stem == "sweep" else f"{path.stem}.csv"
    if path.stem == "sweep" and os.path.lexists(path.with_name("summary.md")):
        yield _section("Summary", _preformatted(file_text(inside(path.parent, "summary.md"), "text file")))
    if os.path.lexists(path.with_name(table_file)):
        head, *rows = _rows_in(inside(path.parent, table_file)) or [[]]
        more = f"The first {MOST_ROWS:,} of {len(rows):,} rows; {table_file} has all." if len(rows) > MOST_ROWS else ""
        yield _section("Table", _paragraph(more) + _table(head, rows[:MOST_ROWS]))
    yield _section("Settings of the study", _preformatted(json.dumps(short, indent=1)))


def _shortened(value: Any) -> Any:
    """Shorten long lists and texts, such as times and members; the file itself has them."""
    if isinstance(value, dict):
        return {key: _shortened(each) for key, each in value.items()}
    if isinstance(value, list | str) and len(value) > MOST_LISTED:
        return f"{len(value):,} entries"
    return [_shortened(each) for each in value] if isinstance(value, list) else value


def _pictures_in(folder: Path, has_run: bool) -> list[Path]:
    """Pictures of studies in a folder, those of a sweep in their order; pictures of a run are drawn anew elsewhere."""
    drawn = {path.name for path in folder.glob("*.png")} - set(OF_A_RUN if has_run else ())
    of_sweeps = [name for name in PICTURES if name in drawn]
    pictures = [inside(folder, name) for name in (*of_sweeps, *sorted(drawn.difference(of_sweeps)))]
    # One large file may have many names.
    if (size := sum(path.stat().st_size for path in pictures)) > MOST_PICTURES:
        fault = f"its pictures have {size / 1e6:,.0f} MB, more than the {MOST_PICTURES / 1e6:,.0f} MB of a report"
        raise SceneError([sentences(folder, fault, "take some away")])
    return pictures


def _rows_in(path: Path) -> list[list[str]]:
    """Rows of a CSV file of a study. Raises SceneError if it is damaged."""
    text = file_text(path, "CSV file")
    with of_study(path):
        try:
            return list(csv.reader(io.StringIO(text, newline="")))
        except csv.Error as error:
            raise ValueError(str(error)) from None


class _Html(str):
    """Text that is already HTML."""

    __slots__ = ()


def _plain(text: str) -> str:
    """Convert a text to HTML, without control characters except line ends."""
    return html.escape(printable(text, "\n"))


def _escaped(value: str) -> str:
    return value if isinstance(value, _Html) else _plain(value)


def _section(heading: str, content: str) -> str:
    return f"<h2>{_plain(heading)}</h2>{content}"


def _paragraph(text: str) -> str:
    return f"<p>{_plain(text)}</p>" if text else ""


def _preformatted(text: str) -> str:
    return f"<pre>{_plain(text)}</pre>"


def _list(items: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{_plain(item)}</li>' for item in items)}</ul>"


def _table(head: Sequence[str], rows: Iterator[Sequence[str]] | Sequence[Sequence[str]]) -> str:
    """Table in HTML; head: titles of its columns, empty for a table of names and values."""
    titles = "".join(f"<th>{_plain(text)}</th>" for text in head)
    body = "".join(f"<tr>{''.join(f'<td>{_escaped(text)}</td>' for text in row)}</tr>" for row in rows)
    return f"<table>{f'<tr>{titles}</tr>' if titles else ''}{body}</table>"
