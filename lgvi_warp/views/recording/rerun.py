# SPDX-License-Identifier: Apache-2.0
"""Recordings of fleets for the rerun viewer: written to a file, sent to a stream or a viewer, or shown at once."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lgvi_warp.common import files as durable
from lgvi_warp.common.arguments import file_path, of_kind, result_of
from lgvi_warp.common.errors import NothingToDraw, SceneError
from lgvi_warp.views.drawn import Drawn, drawn_of
from lgvi_warp.views.fleet import identity, title
from lgvi_warp.views.recording import viewer
from lgvi_warp.views.recording.eye import ASPECT
from lgvi_warp.views.recording.graphs import COLORS, log_graphs
from lgvi_warp.views.recording.layout import layout
from lgvi_warp.views.recording.words import log_words
from lgvi_warp.views.recording.world import WorldBox, box_of, log_world, scale_of

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result


def record(
    result: Result | Mapping[str, Result],
    path: str | os.PathLike[str] | None = None,
    *,
    members: Any = None,
    to: Any = None,
) -> Path | None:
    """Record the fleet for the rerun viewer. The file appears only when it is complete.

    Hulls of the vehicle's shape are drawn for the members and times of `lgvi_warp.select_members`. When a member ends,
    its hull takes the colour of its outcome. Curves show medians and quantiles over the members that still run at each
    time. All recordings of one run have the same recording id and application id; the viewer uses these ids to
    tell recordings and layouts apart.

    Args:
        result: A result with position, attitude and velocity, in memory or in a store; or a mapping of names to
            results, which are shown side by side, each in its own colour.
        path: Path of the file; None (default) is allowed only with `to`.
        members: Indices of the members to draw, such as [3, 17]; by default the choice of `lgvi_warp.select_members`.
        to: Additional receiver: an rr.RecordingStream, or the address of a viewer, such as
            "rerun+http://127.0.0.1:9876/proxy"; by default none.

    Returns:
        The path of the file; None if `path` is None.

    Raises:
        ImportError: rerun-sdk is not installed (extra: viz).
        NothingToDraw: No samples were kept, or no member has a finite start.
        SceneError: The run does not have these members, or the vehicle's mesh cannot be read.
        OSError: The file cannot be written; or no viewer answers at the address, or the viewer ends too early (the
            file is complete then).
        ValueError: There is no result; or neither `path` nor `to` is given (a SceneError, which is a ValueError).

    Examples:
        >>> import lgvi_warp as lw
        >>> scene = lw.Scene.named("remus_100", start={"velocity": [1.5, 0.0, 0.0]})
        >>> fleet = lw.Ensemble(scene, members=8, vary={"vehicle.buoyancy": lw.distributions.Normal(std=1.0)})
        >>> result = lw.solve(fleet, h=0.1, t1=2.0, save=lw.SaveAt(every=1.0))
        >>> print(lw.record(result, "fleet.rrd"))
        fleet.rrd
    """
    viewer.rerun()
    if path is None and to is None:
        words = "neither path nor to is given: the recording would go nowhere"
        raise SceneError([f'{words}. Give path="fleet.rrd"'])
    if to is not None and not isinstance(to, str):
        of_kind("to", to, "flush", "a recording", "give the address of a viewer, or a rerun.RecordingStream")
    runs = _runs(result, members)
    address = to if isinstance(to, str) else None
    if address is not None:
        viewer.reach(address)
    if path is not None:
        target = file_path("path", path)
        with durable.placed(target) as beside, durable.named(target), durable.new_file(beside) as file:
            durable.write_all(file, memoryview(_content(runs)))
    if address is not None:
        try:
            viewer.watched(lambda: _to_viewer(runs, address), address)
        except OSError as error:
            if viewer.answers(address):
                raise
            written = "" if path is None else f", which is in {path}: open that"
            raise OSError(f"to = {address!r}: the viewer ended before it had the recording{written}") from error
    if to is not None and address is None:
        _send(to, runs)
        to.flush()
    return None if path is None else Path(path)


def show(result: Result | Mapping[str, Result], *, members: Any = None) -> None:
    """Show the fleet in the rerun viewer: in a new window, or in a viewer that is already open.

    Args:
        result: As for `lw.record`.
        members: Indices of the members to draw; by default the choice of `lgvi_warp.select_members`.

    Raises:
        ImportError: rerun-sdk is not installed (extra: viz).
        NothingToDraw: No samples were kept, or no member has a finite start.
        SceneError: The run does not have these members, or the vehicle's mesh cannot be read.
        OSError: The viewer cannot be started, for example without a display; the message gives the path of the recording.
    """
    viewer.rerun()
    # The viewer reads the file after this returns; the system clears its folder for temporary files.
    path = Path(tempfile.mkdtemp(prefix="lgvi_warp_")) / "fleet.rrd"
    record(result, path, members=members)
    viewer.start([path], f"the recording is {path}: open it where there is a display")


def _runs(result: Result | Mapping[str, Result], members: Any) -> list[Drawn]:
    """Drawing data of each run."""
    if not isinstance(result, Mapping):
        return [drawn_of(result_of(result), members)]
    if not result:
        raise NothingToDraw("there is no result to draw. Give {name: result}")
    colors = [COLORS[i % len(COLORS)] for i in range(len(result))]
    return [
        drawn_of(result_of(compared), members, str(name), rgb)
        for (name, compared), rgb in zip(result.items(), colors, strict=True)
    ]


def _recording(runs: list[Drawn]) -> Any:
    """A stream with the ids of these runs."""
    names = [identity(run.source) for run in runs]
    name = names[0] if len(runs) == 1 else hashlib.sha256(" ".join(names).encode()).hexdigest()[:16]
    return viewer.rerun().RecordingStream(f"lgvi_warp_{name}", recording_id=name)


def _content(runs: list[Drawn]) -> bytes:
    """The content of a file. rerun reports no disk error of a file that it writes itself."""
    recording = _recording(runs)
    stream = recording.binary_stream()
    recording.send_blueprint(_layout(runs), make_active=False)
    _send(recording, runs, laid_out=True)
    content = stream.read()
    recording.disconnect()
    return content or b""


def _to_viewer(runs: list[Drawn], address: str) -> None:
    """Send a separate recording to the viewer at an address. Raises OSError."""
    recording = _recording(runs)
    try:
        recording.set_sinks(viewer.rerun().GrpcSink(address), default_blueprint=_layout(runs))
        _send(recording, runs, laid_out=True)
        recording.flush()
        recording.disconnect()
    except RuntimeError as error:
        raise OSError(f"to = {address!r}: the recording could not be sent ({error}). Start the viewer again") from error


def _layout(runs: list[Drawn]) -> Any:
    box = box_of(runs)
    return layout(runs, box, _scales(runs, box))


def _scales(runs: list[Drawn], box: WorldBox) -> list[int]:
    """Scale of the hulls of each run, which has its own view."""
    return [scale_of(run, box, ASPECT / len(runs)) for run in runs]


def _send(recording: Any, runs: list[Drawn], laid_out: bool = False) -> None:
    """Log all of the runs, and their layout if the stream has none."""
    box = box_of(runs)
    scales = _scales(runs, box)
    if not laid_out:
        recording.send_blueprint(_layout(runs))
    recording.send_recording_name(title(runs[0].result) if len(runs) == 1 else " | ".join(run.label for run in runs))
    for run, scale in zip(runs, scales, strict=True):
        log_world(recording, run, box, scale)
        log_graphs(recording, run)
    log_words(recording, runs, box, scales)
