# SPDX-License-Identifier: Apache-2.0
"""The rerun viewer without a window: it opens a recording, shows any time of it, and takes pictures."""

from __future__ import annotations

import contextlib
import io
import re
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO, Any

from lgvi_warp.common.errors import one_line
from lgvi_warp.views.recording.viewer import program, rerun

TIMELINE = "sim_time"
# What the viewer says on a machine without a graphics adapter.
NO_DRIVER = re.compile(
    r"No graphics adapter|Failed to get render context|Failed to create render state|no adapter", re.I
)
# Time that the viewer has to start or to load, to lay itself out, and to show another time [s].
PATIENCE, SETTLED, DRAWN = 60.0, 4.0, 0.3


class DriverMissingError(RuntimeError):
    """This machine has no graphics driver that the viewer could use."""


def free_port() -> int:
    """Find a free port of this machine."""
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return int(trial.getsockname()[1])


@contextlib.contextmanager
def started(size: tuple[int, int]) -> Iterator[tuple[Any, str]]:
    """Start a viewer of this size [pixels]; yields its client and address. Raises DriverMissingError."""
    rerun()
    from rerun.experimental import ViewerClient

    port = free_port()
    words = ["--headless", "--bind", "127.0.0.1", "--port", str(port), "--window-size", "{}x{}".format(*size),
             "--hide-welcome-screen", "--memory-limit", "2GB"]  # fmt: skip
    with tempfile.TemporaryFile("w+") as log:
        process = subprocess.Popen([str(program()), *words], stdout=log, stderr=log)
        try:
            client = _client(ViewerClient, process, port)
            if client is None:
                raise _why(log)
            try:
                yield client, f"rerun+http://127.0.0.1:{port}/proxy"
            except ConnectionError:  # its graphics start after it answers
                raise _why(log) from None
        finally:
            process.terminate()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _why(log: IO[str]) -> Exception:
    """Find the reason why a viewer ended, from its log."""
    log.seek(0)
    text = log.read()
    if NO_DRIVER.search(text):
        return DriverMissingError("no Vulkan driver. Install one, such as mesa-vulkan-drivers")
    return OSError(f"the viewer ended: {one_line(text[-800:])}")


def load(client: Any, *paths: Path) -> None:
    """Open recordings, one at a time."""
    for path in paths:
        client.open(str(Path(path).absolute()))
    end = time.monotonic() + PATIENCE
    while client.get_state().loading and time.monotonic() < end:
        time.sleep(0.05)


def show_time(client: Any, when: float, wait: float = DRAWN) -> None:
    """Let the viewer show a time [s], and wait until it has."""
    client.set_time(TIMELINE, duration=float(when), play_state="paused")
    time.sleep(wait)


def shots(recording: Path, times: Iterable[float], size: tuple[int, int]) -> Iterator[Any]:
    """Take pictures of a recording's window at some times [s]."""
    from PIL import Image

    with started(size) as (client, _):
        load(client, recording)
        time.sleep(SETTLED)
        for when in times:
            show_time(client, when)
            yield Image.open(io.BytesIO(client.take_screenshot())).convert("RGB")


def _client(kind: Any, process: subprocess.Popen[bytes], port: int) -> Any:
    """Client of the viewer; None if the viewer ended. Its port opens before its graphics start."""
    end = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < end:
        with contextlib.suppress(OSError):
            socket.create_connection(("127.0.0.1", port), 0.2).close()
            client = kind.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            try:
                client.get_state()
            except ConnectionError:
                break
            return client
        time.sleep(0.05)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(10)
    return None
