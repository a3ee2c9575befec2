# SPDX-License-Identifier: Apache-2.0
"""Animations of a fleet, for a talk or a page: recorded from the viewer without a window, or drawn by Matplotlib."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common import files as durable
from lgvi_warp.common.arguments import file_path, result_of
from lgvi_warp.common.errors import Faults, MissingExtra
from lgvi_warp.views.choice import finite_rows
from lgvi_warp.views.drawn import drawn_of
from lgvi_warp.views.fleet import title
from lgvi_warp.views.recording import headless
from lgvi_warp.views.recording.rerun import record

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

# Window of the viewer, its bars at the edges [pixels: left, top, right, bottom], and how small the picture is.
WINDOW, INSIDE, SIZE = (1100, 700), (0, 28, 1100, 672), (880, 515)
ENDINGS = (".webp", ".gif", ".png")
WAYS = ("viewer", "plot")


def movie(
    result: Result,
    path: str | os.PathLike[str],
    *,
    members: Any = None,
    frames: int = 60,
    seconds: float = 6.0,
    by: str | None = None,
) -> Path:
    """Write an animation of a run, for a talk or a web page: the picture of the rerun viewer, drawn without a window.

    If the viewer cannot draw, because a graphics driver or rerun-sdk is missing, Matplotlib draws the fleet: a view
    from above, and the depth over time.

    Args:
        result: A result with position, attitude and velocity, in memory or in a store.
        path: The file: .webp, .gif or .png (an animated PNG).
        members: Indices of the members to draw, such as [3, 17]; by default the choice of `lgvi_warp.select_members`.
        frames: Number of pictures, evenly spaced over the run's time, at least 2; default 60.
        seconds: Duration of the animation [s], above 0; it then repeats. Default 6.
        by: "viewer" draws with the viewer, "plot" with Matplotlib. By default Matplotlib draws only if the viewer cannot.

    Returns:
        The path of the file.

    Raises:
        ImportError: rerun-sdk or Matplotlib is not installed (extra: viz).
        NothingToDraw: No samples were kept, or no member has a finite start.
        SceneError: The file name's extension, frames, seconds or by is invalid; or the run does not have these members.
        OSError: The file cannot be written, or by="viewer" and the viewer cannot draw on this machine.

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> print(lw.plots.movie(result, "fleet.gif", frames=3, by="plot"))
        fleet.gif
    """
    write(result, path, members=members, frames=frames, seconds=seconds, by=by)
    return Path(path)


def write(result: Result, path: str | os.PathLike[str], *, members: Any = None, frames: int = 60, seconds: float = 6.0,
          by: str | None = None) -> str:  # fmt: skip
    """Write an animation; returns the program that drew it, one of WAYS."""
    result_of(result)
    target = file_path("path", path)
    faults = Faults()
    if target.suffix.lower() not in ENDINGS:
        faults.add("path", str(target), "has an ending that no moving picture has", f"end it with {', '.join(ENDINGS)}")
    if by is not None:
        faults.choice("by", by, WAYS)
    count, length = faults.number("frames", frames, "", 2), faults.number("seconds", seconds, "s")
    if count is not None and count != int(count):
        faults.add("frames", frames, "is not a whole number", "give how many pictures, as 60")
    if length is not None and length <= 0.0:
        faults.add("seconds", seconds, "is not above 0", "give how long it plays [s]")
    faults.raise_if_any()
    assert count is not None
    assert length is not None
    durable.place_of(target)  # before anything is drawn
    if by != "plot":
        try:
            save(_shot(result, members, int(count)), target, length)
            return "viewer"
        except headless.DriverMissingError as error:
            if by == "viewer":
                raise OSError(
                    f'by = "viewer": the viewer cannot draw on this machine: {error}. Give by="plot"'
                ) from None
        except MissingExtra:
            if by == "viewer":
                raise
    save(plainly(result, members, int(count)), target, length)
    return "plot"


def save(pictures: Iterator[Any], target: Path, seconds: float) -> None:
    """Write pictures one after the other; the file is complete or does not appear."""
    every = list(pictures)
    look = {"duration": max(1, round(1000.0 * seconds / len(every))), "loop": 0, "save_all": True,
            "append_images": every[1:], "format": target.suffix.lower().removeprefix(".")}  # fmt: skip
    more = {"quality": 70, "method": 6} if look["format"] == "webp" else {}
    with durable.placed(target) as beside:
        every[0].save(beside, **look, **more)


def of_recording(path: Path, times: Iterable[float]) -> Iterator[Any]:
    """Pictures of a recording in the viewer at some times [s]."""
    from PIL import Image

    for shot in headless.shots(path, times, WINDOW):
        yield shot.crop(INSIDE).resize(SIZE, Image.Resampling.LANCZOS)


def _shot(result: Result, members: Any, count: int) -> Iterator[Any]:
    """Pictures of a run in the viewer."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        record(result, folder / "fleet.rrd", members=members)
        times = np.linspace(float(result.time[0]), float(result.time[-1]), count)
        yield from of_recording(folder / "fleet.rrd", times)


def plainly(result: Result, members: Any, count: int) -> Iterator[Any]:
    """Pictures by Matplotlib: members from above, and their depths over time, up to each time."""
    from PIL import Image

    from lgvi_warp.views.plots.canvas import COLORS, LOCK, figure_class, point_down

    figure = figure_class()(figsize=(SIZE[0] / 100.0, SIZE[1] / 100.0), dpi=100, layout="constrained")
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    drawn = drawn_of(result, members)
    few, many = drawn.few, len(drawn.few.status)
    time, paths, end = np.asarray(few.time), np.asarray(few.position), np.asarray(few.end_time)
    look = {"color": COLORS[0], "alpha": 0.35, "linewidth": 0.8}
    with LOCK:
        above, deep = figure.subplots(1, 2)
        for axes in (above, deep):
            axes.grid(True, alpha=0.3)
        above.set(xlabel="east [m]", ylabel="north [m]", title=f"{drawn.text} from above")
        deep.set(xlabel="time [s]", ylabel="depth [m], down", xlim=(time[0], time[-1]))
        lines = [above.plot([], [], **look)[0] for _ in range(many)]
        depths = [deep.plot([], [], **look)[0] for _ in range(many)]
        (dots,) = above.plot([], [], "o", color=COLORS[1], markersize=3)
        reach = paths[finite_rows(paths)]
        for axes, (x, y) in ((above, reach[:, 1::-1].T), (deep, (time, reach[:, 2]))):
            axes.update_datalim(np.column_stack([[x.min(), x.max()], [y.min(), y.max()]]))
            axes.autoscale_view()
        above.set_aspect("equal", adjustable="datalim")
        point_down(deep)
        figure.suptitle(title(result))
        for when in np.linspace(time[0], time[-1], count):
            now = int(np.searchsorted(time, when, side="right"))
            for i, (line, depth) in enumerate(zip(lines, depths, strict=True)):
                upto = min(now, int(np.searchsorted(time, end[i], side="right")))
                line.set_data(paths[:upto, i, 1], paths[:upto, i, 0])
                depth.set_data(time[:upto], paths[:upto, i, 2])
            dots.set_data(paths[now - 1, :, 1], paths[now - 1, :, 0])
            canvas.draw()
            yield Image.frombuffer("RGBA", canvas.get_width_height(), bytes(canvas.buffer_rgba())).convert("RGB")
