# SPDX-License-Identifier: Apache-2.0
"""A run in progress in the viewer: its members appear block by block, each with all of its times."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lgvi_warp.common.errors import NothingToDraw
from lgvi_warp.views import choice
from lgvi_warp.views.drawn import NEEDED, Drawn, drawn_of
from lgvi_warp.views.fleet import members_of_run
from lgvi_warp.views.recording import viewer
from lgvi_warp.views.recording.graphs import log_member
from lgvi_warp.views.recording.layout import live_layout
from lgvi_warp.views.recording.world import WorldBox, box_of, log_bodies, log_frame, log_paths, scale_of

if TYPE_CHECKING:
    from lgvi_warp.results.result import Result

# Most members whose curves are drawn.
CURVES = 40
# The view is laid out anew where what is drawn has outgrown it so often.
GROWTH = 1.5
# Longest time to wait for the viewer after each block [s].
PATIENCE = 30.0


class Live:
    """Shows the members of a run in a viewer as their blocks are finished.

    About 1,000 members are drawn, divided between the blocks in proportion to their size. The members are chosen by a hash of
    their index, as in `lgvi_warp.select_members`. Bodies and paths are coloured by outcome. Curves show single members,
    since quantiles need all members. If the viewer is closed or does not respond, the view ends and the run continues.
    """

    closed = False

    def __init__(self, recording: Any):
        self._recording = recording
        self._counts: Counter[str] = Counter()
        self._runs: list[Drawn] = []
        self._box: WorldBox | None = None
        self._scale, self._curves = 1, 0

    def add(self, block: Result) -> None:
        """Show the next members; `lgvi_warp.solve(..., on_block=live.add)` calls it."""
        if self.closed:
            return
        try:
            self._add(block)
            self._recording.flush(timeout_sec=PATIENCE)
        except RuntimeError:  # rerun raises it for a viewer that is gone
            self.closed = True

    def _add(self, block: Result) -> None:
        """Count the members, and log the drawn ones."""
        total, done = members_of_run(block), self._counts.total()
        self._counts.update(block.status.counts())
        if set(NEEDED) <= set(block.samples):
            rank = np.argsort(choice.mixed(np.arange(done, done + block.members)), kind="stable")
            share = -(-choice.MOST_BODIES * block.members // total)
            self._draw(block, np.sort(rank[:share]), done)
        self._say(total)

    def _draw(self, block: Result, places: np.ndarray, first: int) -> None:
        """Draw members at these positions of a block that begins with the member `first`."""
        few = choice.few(block, places, tuple(block.samples), choice.frames_of(block.time))
        try:
            run = drawn_of(few, label=f"from_{first}")
        except NothingToDraw:  # no member of the block has a finite start
            return
        self._fit(run)
        log_bodies(self._recording, run, self._scale)
        log_paths(self._recording, run)
        for i in range(min(len(run.choice.members), CURVES - self._curves)):
            log_member(self._recording, run, i, first + int(places[run.choice.members[i]]))
            self._curves += 1

    def _fit(self, run: Drawn) -> None:
        """Lay out the view at the first block, and again when the members leave it."""
        box = box_of([run])
        if self._box is None:
            self._scale = scale_of(run, box)
        else:
            box = self._box.joined(box)
        if self._box is None or box.size > GROWTH * self._box.size:
            unlabelled = replace(run, label="")
            log_frame(self._recording, unlabelled, box)
            self._recording.send_blueprint(live_layout(unlabelled, box, self._scale))
            self._box = box

    def _say(self, total: int) -> None:
        """Report how many members are done, and how they ended."""
        rr = viewer.rerun()
        counts = ", ".join(f"{name} {number:,}" for name, number in self._counts.items())
        text = f"{choice.of_members(self._counts.total(), total)} done: {counts}"
        self._recording.log("run/summary", rr.TextDocument(text, media_type="text/markdown"), static=True, strict=True)


def live(scene: Any, address: str) -> Live:
    """Open a recording of a run that is about to begin."""
    name = hashlib.sha256(json.dumps(scene.to_dict(), sort_keys=True).encode()).hexdigest()[:16]
    recording = viewer.rerun().RecordingStream(f"lgvi_warp_live_{name}", recording_id=f"live_{name}")
    recording.connect_grpc(address)
    recording.send_recording_name("the run, while it goes on")
    return Live(recording)
