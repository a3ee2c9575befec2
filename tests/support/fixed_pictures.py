# SPDX-License-Identifier: Apache-2.0
"""Content of pictures, recordings and reports as last inspected: every line, colour, text and setting.

`python -m tests.support.fixed_pictures --write` records them anew, after a change that was looked at (`make gallery`, and
tests/unit/views/test_seen.py). An array is kept as its size, its sum, and a sum in which each place weighs differently.
"""

import argparse
import dataclasses
import functools
import json
import re
import tempfile
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import rerun as rr
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rerun.chunk import RrdReader

import lgvi_warp as lw
from lgvi_warp.cli import documents, report
from lgvi_warp.cli.writing import Written
from lgvi_warp.common.status import WarningArray
from lgvi_warp.statistics.estimates.estimate import Estimates
from lgvi_warp.views.plots import sweep_pictures
from tests.conftest import ROOT
from tests.support.swept import swept
from tests.unit.cli.test_terminal import morris, region, sobol
from tests.unit.statistics.test_statistics import gathered
from tests.unit.views.test_recording import fleet
from tests.views.test_plots import of_cells, of_methods, of_studies

FILE = Path(__file__).parents[1] / "data" / "pictures.json"
ROUND_OFF = 1e-6
OF_A_RUN = ("summary", "fan", "paths", "plan_view", "phase", "attitude", "outcomes", "histogram", "pairs")
# Names that are other ones in every recording.
RANDOM = re.compile(r"[0-9a-f]{8}-[0-9a-f-]{27}|lgvi_warp_[0-9a-f]+|rec_[0-9a-f]+|\b[0-9a-f]{32}\b")
# Components that hold such names, or times of recording.
OF_THE_HOUR = ("RowId", "root_container", "start_time", "log_time", "log_tick", "blueprint")
VERSIONS = re.compile(r"^\| *(versions?|machine).*$", re.MULTILINE)
STATISTICS = (lw.statistics.Quantiles("depth"), lw.statistics.Extremes("depth"), lw.statistics.Mean("velocity"),
              lw.statistics.Covariance("velocity"),
              lw.statistics.Histogram("depth", bins=5, limits=(0.0, 20.0)))  # fmt: skip


def sums(values):
    """An array as four numbers: how many are finite, their sum, that of their sizes, and one by place."""
    flat = np.ma.filled(np.ma.asarray(values, dtype=float), np.nan).ravel()
    numbers = np.where(np.isfinite(flat), flat, 0.0)
    weights = np.cos(np.arange(1.0, len(numbers) + 1.0))
    found = numbers.sum(), np.abs(numbers).sum(), numbers @ weights
    return [int(np.isfinite(flat).sum()), *(float(f"{number:.9g}") for number in found)]


def style(artist):
    """Colours, line and layer of something drawn."""
    if isinstance(artist, Line2D):
        return [to_hex(artist.get_color(), keep_alpha=True), artist.get_linestyle(), str(artist.get_marker()),
                artist.get_linewidth(), artist.get_markersize(), artist.get_fillstyle()]  # fmt: skip
    if isinstance(artist, Collection):
        return [[to_hex(color, keep_alpha=True) for color in colors[:8]] for colors in
                (artist.get_facecolor(), artist.get_edgecolor())] + [sums(artist.get_linewidths())]  # fmt: skip
    return [to_hex(artist.get_facecolor(), keep_alpha=True), to_hex(artist.get_edgecolor(), keep_alpha=True),
            artist.get_hatch(), artist.get_linewidth()]  # fmt: skip


def drawn(artist):
    """One thing drawn: kind, label, style and places."""
    common = [type(artist).__name__, artist.get_label(), artist.get_zorder(), artist.get_alpha(), artist.get_clip_on()]
    if isinstance(artist, Line2D):
        return [*common, style(artist), sums(artist.get_xdata()), sums(artist.get_ydata())]
    if isinstance(artist, AxesImage):
        return [*common, artist.get_cmap().name, sums(artist.get_array()), sums(artist.get_extent())]
    if isinstance(artist, Collection):
        paths = [path.vertices for path in artist.get_paths()[:50]]
        places = np.concatenate([path.ravel() for path in paths]) if paths else []
        return [*common, style(artist), sums(places), sums(artist.get_offsets())]
    return [*common, style(artist), sums(artist.get_path().vertices), sums(artist.get_transform().get_matrix()[:2, :2])]


def written(text):
    """One text: what it says, how large, and on which side of its place."""
    return [text.get_text(), text.get_fontsize(), text.get_rotation(), text.get_ha(), text.get_va(), text.get_color()]


def of_legend(legend):
    """Title and texts of a legend, and its place in percent of the picture."""
    place, whole = legend.get_window_extent(), legend.get_figure().bbox
    percent = 100.0 * place.extents / np.tile(whole.size, 2)
    return [legend.get_title().get_text(), [text.get_text() for text in legend.get_texts()], np.round(percent).tolist()]


def of_axes(axes):
    """Everything on one panel."""
    legend = axes.get_legend()
    content = [artist for artist in axes.get_children() if isinstance(artist, Line2D | Collection | AxesImage)]
    content += [patch for patch in axes.patches if isinstance(patch, Patch)]
    return {
        "texts": [written(text) for text in (axes.title, axes.xaxis.label, axes.yaxis.label, *axes.texts)],
        "scales": [axes.get_xscale(), axes.get_yscale(), axes.axison, axes.get_visible(), str(axes.get_aspect())],
        "limits": [sums(axes.get_xlim()), sums(axes.get_ylim())],
        "ticks": [sums(axes.get_xticks()), sums(axes.get_yticks())],
        "tick labels": [[label.get_text() for label in axis.get_ticklabels() if label.get_visible()]
                        for axis in (axes.xaxis, axes.yaxis)],
        "legend": legend and of_legend(legend),
        "drawn": [drawn(artist) for artist in content],
    }  # fmt: skip


def of_figure(figure):
    """Everything in one picture."""
    figure.draw_without_rendering()
    return {
        "size": figure.get_size_inches().tolist(),
        "texts": [written(text) for text in figure.texts],
        "legends": [of_legend(legend) for legend in figure.legends],
        "axes": [of_axes(axes) for axes in figure.axes],
    }


def numbers_in(value):
    """All numbers in nested lists, and all texts."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list | tuple):
        for entry in value:
            yield from numbers_in(entry)
    elif isinstance(value, bool | int | float):
        yield float(value)
    elif isinstance(value, bytes):
        yield from map(float, value)
    elif value is not None:
        yield VERSIONS.sub("", RANDOM.sub("*", str(value)))


def of_recording(path):
    """Every component of a recording and of its views: {entity: {component: [texts, sums of the numbers]}}."""
    reader, found = RrdReader(path), defaultdict(lambda: defaultdict(list))
    stores = {"": reader.recordings(), "views": reader.blueprints()}
    for kind, entries in stores.items():
        for entry in entries:
            for chunk in reader.stream(store=entry):
                if chunk.entity_path.startswith("/run/provenance"):
                    continue
                entity = kind + RANDOM.sub("*", chunk.entity_path)
                batch = chunk.to_record_batch()
                for name, column in zip(batch.schema.names, batch.columns, strict=True):
                    if any(word in name for word in OF_THE_HOUR):
                        continue
                    values = column.cast("int64") if name == "sim_time" else column
                    found[entity][name] += [list(numbers_in(value)) for value in values.to_pylist()]
    return {
        entity: {name: content(rows, in_order=bool(entity) and "*" not in entity) for name, rows in columns.items()}
        for entity, columns in sorted(found.items())
    }


def content(rows, in_order):
    """Texts and sums of the numbers of one component; those of nameless entities in whatever order."""
    texts = [value for row in rows for value in row if isinstance(value, str)]
    numbers = [value for row in rows for value in row if not isinstance(value, str)]
    return [texts if in_order else sorted(texts), sums(numbers if in_order else sorted(numbers))]


@functools.cache
def pictures():
    """Every picture by name: the function that draws it, and its arguments."""
    result = fleet()
    found = {name: (getattr(lw.plots, name), (result,)) for name in OF_A_RUN}
    found["fan of the energy"] = lw.plots.fan, (result, "energy")
    found["drift"] = lw.plots.drift, (fleet(9, scene=lw.Scene(lw.Scene.named("sphere").vehicle)),)
    found["summary of members kept"] = lw.plots.summary, (followed(),)
    found["statistics"] = lw.plots.statistics, (followed(),)
    found["one vehicle"] = lw.plots.summary, (fleet(1, 60),)
    found["compare"] = lw.plots.compare, ({"a": result, "b": fleet(9, 31, 2)}, "speed")
    for statistic in STATISTICS[:3]:
        estimates = Estimates([estimated(statistic, result)])
        of = "velocity[0]" if statistic.type == "mean" else "depth"
        bare = dataclasses.replace(result, samples={}, statistics=estimates)
        found[f"fan of {statistic.type}"] = lw.plots.fan, (bare, of)
    return found | of_studies() | sweeps()


def sweeps():
    """Pictures of sweeps, as of `pictures`."""
    axes = {"x": [1, 2, 3], "y": [5, 6], "z": [0.5, 0.6], "w": ["u", "v"], "one": [1]}
    delays = {"delay": [0.5, 2.0, 4], "gain": [1.0]}
    return {
        "success of cases": (sweep_pictures.plot_success, (swept(lambda i: i / 8, cases="abcdefg"),)),
        "success over delays": (sweep_pictures.plot_success, (swept(lambda i: 0.5, delays, refused=(0, 3)),)),
        "success as maps": (sweep_pictures.plot_success, (swept(lambda i: (i % 24) / 24, axes, refused=(4,)),)),
        "metrics": (sweep_pictures.plot_metrics,
                    (swept(lambda i: 0.5, {"delay": [1, 2]}, metrics=("m", "n"), failed=3, refused=(3,)),)),
        "differences": (sweep_pictures.plot_differences, (swept((0.2, 0.95, 0.225).__getitem__, cases="abc"),)),
        "causes": (sweep_pictures.plot_causes, (swept((0.9, 0.4, 0.65).__getitem__, cases="abc"),)),
        "responses": (sweep_pictures.plot_responses, (swept(lambda i: 0.5, {"k": [1, 2]}, cases="abcd"), None, "", 7)),
    }  # fmt: skip


def picture(name):
    """Content of one picture."""
    draw, arguments = pictures()[name]
    return of_figure(np.ravel(draw(*arguments))[0].figure)


def recording(name, folder):
    """Content of one recording."""
    return of_recording(lw.record(RECORDINGS[name](), Path(folder) / "fleet.rrd"))


def estimated(statistic, result):
    """The estimate that a statistic gathers from the samples of a result."""
    whole = SimpleNamespace(parameters=result.parameters, count=result.members)
    samples = type("Samples", (dict,), {"time": result.time, "terms": ()})(result.samples)
    return gathered(statistic, np.moveaxis(statistic.quantity(samples, whole), 1, 2), time=result.time)[0]


def followed():
    """The fleet with statistics of its own, of which samples of three members were kept alone."""
    result, kept = fleet(), np.array([3, 5, 9])
    statistics = Estimates([estimated(statistic, result) for statistic in STATISTICS])
    few = {"samples": {}, "kept": result.part(kept), "kept_members": kept}
    return dataclasses.replace(result, statistics=statistics, **few)


def steered():
    """A fleet that a controller steers, with commands and actuators."""
    scene = lw.Scene.load(ROOT / "examples" / "scenes" / "remus_100_autopilot.toml")
    result = fleet(9, 7, scene=scene)
    waves = 0.2 * np.sin(np.arange(7 * 9 * 2.0)).reshape(7, 9, 2)
    signals = {"actuator": waves, "command": 1.2 * waves}
    return dataclasses.replace(result, samples=dict(result.samples) | signals)


RECORDINGS = {
    "followed": followed,
    "steered": steered,
    "a fleet": fleet,
    "one vehicle": lambda: fleet(1, 12),
    "two runs": lambda: {"a": fleet(9, 7), "b": fleet(12, 7, seed=2)},
}
PICTURES = (*OF_A_RUN, "drift", "summary of members kept", "statistics", "fan of the energy", "one vehicle", "compare",
            "fan of quantiles", "fan of extremes", "fan of mean", *of_studies(), *sweeps())  # fmt: skip


PROVENANCE = {
    "checks": "safe", "machine": {"threads": 2, "cpu": "a processor", "simd": "avx2"}, "versions": {"numpy": "2"},
}  # fmt: skip


def ran(result, provenance=None, **values):
    """The same result, with other numbers, as if a run had ended in it."""
    return dataclasses.replace(result, provenance=result.provenance | PROVENANCE | (provenance or {}), **values)


def summaries():
    """Results of whose summary each has a line that others have not."""
    plain, ones = fleet(9), np.arange(9)
    turning = fleet(9, scene=lw.Scene(lw.Scene.named("sphere").vehicle))
    rates = 0.1 * np.sin(np.arange(turning.velocity.size)).reshape(turning.velocity.shape)
    turning = dataclasses.replace(turning, samples=dict(turning.samples) | {"angular_velocity": rates})
    unmet = dict(steered().samples) | {"unmet": np.where(ones % 3 == 0, 1.0, 0.0)[None, :, None] * np.ones((7, 1, 2))}
    warned = {"warnings": (2 * (ones % 2)).astype(np.uint16).view(WarningArray), "warning_time": 1.0 * ones}
    return {
        "a fleet": ran(plain), "followed": ran(followed()), "steered": ran(steered(), samples=unmet),
        "divided steps": ran(plain, substeps=ones // 4), "warnings": ran(plain, warning_value=0.5 * ones, **warned),
        "no velocity": ran(plain, samples={"position": plain.position}, messages=("a remark",)),
        "none failed": ran(plain, {"observed": {"keep": "failed"}}, samples={}),
        "conserved": ran(turning),
    }  # fmt: skip


def rounded(text):
    """The same text, its decimals to six digits."""
    return re.sub(r"\d+\.\d+(e[+-]\d+)?", lambda number: f"{float(number[0]):.6g}", text)


def summed_up(result, folder):
    """Summary of a run by the command, in words and as a document."""
    files = [Path(folder) / name for name in ("result.npz", "fleet.png", "fleet.rrd")]
    for i, path in enumerate(files):
        path.write_bytes(b"x" * 10_000 * (i + 1))
    few = report.shown_members(result)
    document = documents.of_run(result, few, Written(files), ["a fault"], 2.5)
    said = [report.summary(result, few, files, 2.5, verbose=True), json.dumps(document, indent=0, default=str)]
    return [rounded(text.replace(str(folder), "folder")).splitlines() for text in said]


def page(result, folder):
    """The page of a run, without what is in its pictures and the day."""
    text = lw.report(result, Path(folder) / "report.html").read_text()
    text = re.sub(r"Written on [\d-]+", "Written on *", text)
    return rounded(re.sub(r"<svg.*?</svg>|base64,[^\"']*", "*", text, flags=re.DOTALL)).split("\n")


def reports(folder):
    """Texts on runs and studies, by name."""
    refused = dataclasses.replace(of_methods(), refused={"cg3": "remembers nothing", "psi": "draws no noise"})
    studies = {"tradeoff": of_methods(), "a refused method": refused, "stability": of_cells(), "a map": region(),
               "sobol": sobol(), "morris": morris()}  # fmt: skip
    said = {f"summary: {name}": summed_up(result, folder) for name, result in summaries().items()}
    said |= {f"study: {name}": str(found).splitlines() for name, found in studies.items()}
    return said | {f"page: {name}": page(summaries()[name], folder) for name in ("followed", "warnings")}


def libraries():
    """Dependencies of drawings: the libraries that draw."""
    return {"matplotlib": ".".join(mpl.__version__.split(".")[:2]), "rerun": rr.__version__}


def differing(a, b, where=""):
    """Places at which two records differ by more than round-off."""
    if isinstance(a, dict) and isinstance(b, dict):
        missing = [f"{where}/{key}: only in one" for key in sorted(a.keys() ^ b.keys())]
        return missing + [found for key in a.keys() & b.keys() for found in differing(a[key], b[key], f"{where}/{key}")]
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        if len(a) == 4 and all(isinstance(x, int | float) for x in (*a, *b)):
            bound = ROUND_OFF * max(abs(a[2]), abs(b[2])) + 1e-9
            return [] if a[0] == b[0] and np.allclose(a, b, rtol=0.0, atol=bound) else [f"{where}: {a} is now {b}"]
        return [found for i, (x, y) in enumerate(zip(a, b, strict=True)) for found in differing(x, y, f"{where}[{i}]")]
    if isinstance(a, float) and isinstance(b, float | int):
        return [] if np.isclose(a, b, rtol=ROUND_OFF) else [f"{where}: {a} is now {b}"]
    return [] if a == b else [f"{where}: {str(a)[:300]!r} is now {str(b)[:300]!r}"]


def everything():
    """All that is recorded."""
    with tempfile.TemporaryDirectory() as folder:
        shown, said = {name: recording(name, folder) for name in RECORDINGS}, reports(folder)
    drawings = {name: picture(name) for name in PICTURES}
    return {"libraries": libraries(), "pictures": drawings, "recordings": shown, "reports": said}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="record what is drawn now")
    now = json.loads(json.dumps(everything()))
    known = json.loads(FILE.read_text()) if FILE.exists() else {}
    print(*differing(known, now), sep="\n")
    if parser.parse_args().write:
        FILE.write_text(json.dumps(now, separators=(",", ":")) + "\n")
