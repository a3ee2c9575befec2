# SPDX-License-Identifier: Apache-2.0
"""The rerun viewer as a process: whether one answers at an address, and how one is started."""

from __future__ import annotations

import os
import socket
import subprocess
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from lgvi_warp.common.errors import MissingExtra, one_line

# Where a viewer listens that was started without a port.
PORT = 9876
ADDRESS = f"rerun+http://127.0.0.1:{PORT}/proxy"
# Time to wait for a viewer at an address, and for one to end that cannot start [s].
PATIENCE, STARTED = 10.0, 3.0
# What a client of HTTP/2 sends first, and the empty table of settings that follows (RFC 9113, sections 3.4 and 6.5).
GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
# Length of a frame's head, and the place and number of the type of one with settings.
HEAD, TYPE, SETTINGS = 9, 3, 4


def rerun() -> Any:
    """Load rerun.

    Returns:
        The module.

    Raises:
        ImportError: rerun-sdk is not installed (extra: viz).
    """
    try:
        import rerun as module
    except ModuleNotFoundError as error:
        raise MissingExtra("recordings", "rerun-sdk", "viz") from error
    return module


def program() -> Path:
    """Name the viewer that comes with rerun-sdk.

    Returns:
        Path of its program.
    """
    import rerun_cli

    return Path(rerun_cli.__file__).with_name("rerun.exe" if os.name == "nt" else "rerun")


def reach(address: str) -> None:
    """Require that a viewer answers at an address: rerun would wait without end for anything else that listens there.

    Args:
        address: As "rerun+http://127.0.0.1:9876/proxy".

    Raises:
        OSError: Nothing answers there, or what does is no viewer.
    """
    remedy = f'start a viewer with "rerun", or give to="{ADDRESS}"'
    try:
        answer = _greeted(address)
    except (OSError, ValueError) as error:
        raise OSError(f"to = {address!r}: no viewer answers ({error}); {remedy}") from None
    if not answer:
        raise OSError(f"to = {address!r}: what answers is no viewer; {remedy}")


def answers(address: str) -> bool:
    """Tell whether a viewer answers at an address.

    Args:
        address: As "rerun+http://127.0.0.1:9876/proxy".

    Returns:
        False where nothing listens, or what does is no viewer.
    """
    try:
        return _greeted(address)
    except (OSError, ValueError):
        return False


def is_open() -> bool:
    """Tell whether a viewer is open at the port that viewers have.

    Returns:
        False where nothing listens there.

    Raises:
        OSError: Something else has the port.
    """
    try:
        answer = _greeted(ADDRESS)
    except OSError:
        return False
    if not answer:
        raise OSError(f'port {PORT}: is taken by what is no viewer; end that, or start "rerun --port 9877" and name it: '
                      f'to="{ADDRESS.replace(str(PORT), "9877")}"')  # fmt: skip
    return True


def _greeted(address: str) -> bool:
    """Whether what listens at an address speaks HTTP/2, as viewers do. Raises OSError where nothing listens."""
    parts = urlsplit(address)
    with socket.create_connection((parts.hostname or "", parts.port or PORT), PATIENCE) as connection:
        connection.settimeout(STARTED)
        try:
            connection.sendall(GREETING)
            head = connection.recv(HEAD)
        except OSError:
            return False
    return len(head) == HEAD and head[TYPE] == SETTINGS


def start(words: Sequence[str | Path], remedy: str) -> None:
    """Start a viewer that goes on after this process.

    Args:
        words: Its arguments.
        remedy: What to do where it does not start.

    Raises:
        OSError: It cannot be started, as where there is no display.
    """
    # The command silences the recorder, not the viewer, whose words say why it does not start.
    environment = {name: value for name, value in os.environ.items() if (name, value) != ("RUST_LOG", "off")}
    with tempfile.TemporaryFile("w+") as log:
        try:
            viewer = subprocess.Popen([program(), *words], stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                      start_new_session=True, env=environment)  # fmt: skip
            # One that finds no display ends at once; one that stays, or hands over to a viewer that is open, is well.
            code = viewer.wait(STARTED)
        except subprocess.TimeoutExpired:
            return
        except OSError as error:
            raise OSError(f"the viewer cannot be started ({error}); {remedy}") from None
        if code:
            log.seek(0)
            raise OSError(f"the viewer did not start ({one_line(log.read().strip()[-200:])}); {remedy}")


def opened(address: str | None) -> str:
    """Find a viewer for what is sent while it is made, or start one.

    Args:
        address: Where it listens; None for one on this machine, which is started where none is open.

    Returns:
        Its address.

    Raises:
        ImportError: rerun-sdk is not installed (extra: viz).
        OSError: None answers at the address, something else has its port, or none can be started.
    """
    rerun()
    if address is not None:
        reach(address)
        return address
    if not is_open():
        start(["--port", str(PORT)], 'run where there is a display, or name a viewer that is open: '
              f'--viewer "{ADDRESS.replace("127.0.0.1", "HOST")}"')  # fmt: skip
        end = time.monotonic() + PATIENCE
        while not is_open() and time.monotonic() < end:
            time.sleep(0.1)
        reach(ADDRESS)
    return ADDRESS
