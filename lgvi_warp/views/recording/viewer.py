# SPDX-License-Identifier: Apache-2.0
"""The rerun viewer as a process: check whether one listens at an address, and start one."""

from __future__ import annotations

import os
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from lgvi_warp.common.errors import MissingExtra, one_line
from lgvi_warp.common.sentences import capital

# Where a viewer listens that was started without a port.
PORT = 9876
ADDRESS = f"rerun+http://127.0.0.1:{PORT}/proxy"
# Time to wait for a viewer at an address, for one to end that cannot start, and for one to take a recording [s].
PATIENCE, STARTED, LONGEST = 10.0, 3.0, 600.0


def rerun() -> Any:
    """Load rerun. Raises ImportError with the remedy if it is not installed."""
    try:
        import rerun as module
    except ModuleNotFoundError as error:
        raise MissingExtra("recordings", "rerun-sdk", "viz") from error
    return module


def program() -> Path:
    """Name the viewer that comes with rerun-sdk."""
    import rerun_cli

    return Path(rerun_cli.__file__).with_name("rerun.exe" if os.name == "nt" else "rerun")


def reach(address: str) -> None:
    """Require that a viewer listens at an address: rerun would wait forever for a missing viewer."""
    try:
        _connect(address)
    except (OSError, ValueError) as error:
        remedy = f'start a viewer with "rerun", or give to="{ADDRESS}"'
        raise OSError(f"to = {address!r}: no viewer answers ({error}). {capital(remedy)}") from None


def answers(address: str = ADDRESS) -> bool:
    """Tell whether a viewer listens at an address."""
    try:
        _connect(address)
    except (OSError, ValueError):
        return False
    return True


def _connect(address: str) -> None:
    parts = urlsplit(address)
    socket.create_connection((parts.hostname or "", parts.port or PORT), PATIENCE).close()


def watched(send: Callable[[], None], address: str, patience: float = PATIENCE, longest: float = LONGEST) -> None:
    """Send to a viewer for as long as it listens: rerun would wait forever for a stopped viewer."""
    raised: list[BaseException] = []

    def sending() -> None:
        try:
            send()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=sending, name="viewer", daemon=True)
    thread.start()
    end = time.monotonic() + longest
    while thread.is_alive():
        thread.join(patience)
        if thread.is_alive() and (time.monotonic() > end or not answers(address)):
            raise OSError(f"to = {address!r}: the viewer does not answer any more")
    if raised:
        raise raised[0]


def start(words: Sequence[str | Path], remedy: str, started: float = STARTED) -> None:
    """Start a viewer that continues after this process ends."""
    # The command silences the recorder, not the viewer, whose words say why it does not start.
    environment = {name: value for name, value in os.environ.items() if (name, value) != ("RUST_LOG", "off")}
    with tempfile.TemporaryFile("w+") as log:
        try:
            viewer = subprocess.Popen([program(), *words], stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                      start_new_session=True, env=environment)  # fmt: skip
            # One that finds no display ends at once; one that stays, or hands over to a viewer that is open, is well.
            code = viewer.wait(started)
        except subprocess.TimeoutExpired:
            return
        except OSError as error:
            raise OSError(f"the viewer cannot be started ({error}). {capital(remedy)}") from None
        if code:
            log.seek(0)
            raise OSError(f"the viewer did not start ({one_line(log.read().strip()[-200:])}). {capital(remedy)}")


def opened(address: str | None, home: str = ADDRESS, patience: float = PATIENCE) -> str:
    """Find the viewer at an address, or on this machine at `home`; start one there if none is open."""
    rerun()
    if address is not None:
        reach(address)
        return address
    if not answers(home):
        start(["--port", str(PORT)], 'run where there is a display, or name a viewer that is open: '
              f'--viewer "{ADDRESS.replace("127.0.0.1", "HOST")}"')  # fmt: skip
        end = time.monotonic() + patience
        while not answers(home) and time.monotonic() < end:
            time.sleep(0.1)
        reach(home)
    return home
