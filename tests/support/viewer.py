# SPDX-License-Identifier: Apache-2.0
"""The rerun viewer without a window: opens recordings, shows any time, and takes pictures of its views."""

import contextlib
import io
import re
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lgvi_warp.views.recording import headless
from lgvi_warp.views.recording.headless import free_port
from lgvi_warp.views.recording.world import WATER

# What the viewer warns of on a machine with a software renderer.
EXPECTED = re.compile(r"[Ss]oftware rasterizer|not found for screenshot")
PATIENCE = 60.0


class Viewer:
    """A viewer that has recordings open."""

    def __init__(self, client, address):
        self.client, self.address = client, address

    def open(self, *paths):
        """Open recordings, one at a time."""
        headless.load(self.client, *paths)

    def pictures(self, when):
        """A picture (height, width, 3) of each view that is in sight, by class and origin, at a time [s]."""
        headless.show_time(self.client, when, 0.4)
        shots = {}
        for view in self.client.get_state().views:
            try:
                png = self.client.take_screenshot(view_id=view.view_id)
            except Exception as error:
                if "not found" not in str(error).lower():  # a view in a hidden tab
                    raise
                continue
            shots[view.view_class, view.origin] = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
        return shots

    def complaints(self):
        """Complaints of views and warnings of the log."""
        views = [f"{view.origin}: {note.summary}" for view in self.client.get_state().views for note in view.reports]
        logs = [entry.message for entry in self.client.get_logs() if entry.level in ("WARN", "ERROR")]
        return views + [message for message in logs if not EXPECTED.search(message)]


def started_by(monkeypatch, folder, text):
    """Let a script of this text stand for the viewer's program; a program that is not there for None."""
    program = folder / "viewer"
    if text is not None:
        program.write_text(f"#!/bin/sh\n{text}\n")
        program.chmod(0o755)
    monkeypatch.setattr("lgvi_warp.views.recording.viewer.program", lambda: program)


@contextlib.contextmanager
def serving(command, port):
    """A process that listens at a port of this machine."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    end = time.monotonic() + PATIENCE
    try:
        while time.monotonic() < end:
            with contextlib.suppress(OSError):
                socket.create_connection(("127.0.0.1", port), 0.2).close()
                break
            time.sleep(0.05)
        yield process
    finally:
        process.terminate()
        process.wait()


@contextlib.contextmanager
def receiver(path):
    """The address of rerun's server without a window, which writes what it gets into a file."""
    rerun_cli = pytest.importorskip("rerun_cli")
    port = free_port()
    program = Path(rerun_cli.__file__).with_name("rerun")
    words = ["--bind", "127.0.0.1", "--port", str(port), "--save", str(path)]
    with serving([str(program), *words], port) as process:
        yield f"rerun+http://127.0.0.1:{port}/proxy"
        end = time.monotonic() + PATIENCE
        size = -1
        while size != (size := path.stat().st_size if path.exists() else 0) or not size:
            assert time.monotonic() < end
            assert process.poll() is None
            time.sleep(0.2)
    # A server's file has no table of contents.
    raw = path.rename(path.with_suffix(".raw.rrd"))
    subprocess.run([str(program), "rrd", "merge", str(raw), "-o", str(path)], check=True, capture_output=True)


@contextlib.contextmanager
def viewer(size=(1000, 700)):
    """A viewer; skips the test where the machine has no Vulkan driver."""
    pytest.importorskip("rerun_cli")
    try:
        with headless.started(size) as (client, address):
            yield Viewer(client, address)
    except headless.DriverMissingError as error:
        pytest.skip(f"recordings are not looked at: {error}")


def painted(picture):
    """Share of pixels that differ from the one on their left or above: text, lines and bodies do, an empty view does not."""
    left, above = (np.abs(np.diff(picture, axis=axis)).max(axis=-1) > 12 for axis in (1, 0))
    return float((left[1:] | above[:, 1:]).mean())


def moved(first, second):
    """Share of pixels that differ between two pictures of one view."""
    return float((np.abs(first - second).max(axis=-1) > 8).mean())


# Exponent from a number of a pixel, 0 to 1, to its light. A pixel seen through the surface has the light of the sheet on top,
# which is drawn from both sides, one over the other. Less light than ROUNDED may be that of a number's last digit.
GAMMA, ROUNDED = 2.2, 0.002
SHEET = (1.0 - (1.0 - WATER[3] / 255.0) ** 2) * (np.array(WATER[:3]) / 255.0) ** GAMMA


def colored(picture, rgb, tolerance=0.06):
    """Number of pixels that have the hue and saturation of a colour, lit or shaded, in the open or through the surface."""
    light = (picture / 255.0) ** GAMMA
    below = light - SHEET
    behind = (below > -0.01).all(axis=-1) & _hued(np.where(below > ROUNDED, below, 0.0), rgb, tolerance)
    return int((_hued(light, rgb, tolerance) | behind).sum())


def _hued(light, rgb, tolerance):
    """Pixels (height, width) whose light (height, width, 3) is bright and has the hue of a colour."""
    shown = light ** (1.0 / GAMMA)
    bright = np.maximum(shown.max(axis=-1), 1.0 / 255.0)
    near = np.abs(shown / bright[..., None] - np.array(rgb) / max(rgb)).max(axis=-1) < tolerance
    return near & (bright > 60.0 / 255.0)
