# SPDX-License-Identifier: Apache-2.0
"""The rerun viewer as a process: whether one answers at an address, and how one is started."""

from __future__ import annotations

import os
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from lgvi_warp.common.errors import MissingExtra, one_line

# Where a viewer listens that was started without a port.
PORT = 9876
ADDRESS = f"rerun+http://127.0.0.1:{PORT}/proxy"
# Time to wait for a viewer at an address, and for one to end that cannot start [s].
PATIENCE, STARTED = 10.0, 3.0
# What a client of HTTP/2 sends first (RFC 9113, section 3.4).
GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
# Length of a frame's head (section 4.1), and numbers of types of frames (section 6).
HEAD, DATA, HEADERS, RESET, SETTINGS, GOODBYE = 9, 0, 1, 3, 4, 7
END_STREAM, END_HEADERS = 1, 4
# The call by which recordings come to a viewer. One of no message changes nothing, and is answered by an empty one.
CALL = "/rerun.sdk_comms.v1alpha1.MessageProxyService/WriteMessages"
EMPTY_ANSWER = bytes(5)


def rerun() -> Any:
    """Load rerun. Raises ImportError with the remedy where it is not installed."""
    try:
        import rerun as module
    except ModuleNotFoundError as error:
        raise MissingExtra("recordings", "rerun-sdk", "viz") from error
    return module


def program() -> Path:
    """Name the viewer that comes with rerun-sdk."""
    import rerun_cli

    return Path(rerun_cli.__file__).with_name("rerun.exe" if os.name == "nt" else "rerun")


def reach(address: str, started: float = STARTED) -> None:
    """Require that a viewer answers at an address: rerun would wait without end for anything else that listens there."""
    remedy = f'start a viewer with "rerun", or give to="{ADDRESS}"'
    try:
        answer = _greeted(address, started)
    except (OSError, ValueError) as error:
        raise OSError(f"to = {address!r}: no viewer answers ({error}); {remedy}") from None
    if not answer:
        raise OSError(f"to = {address!r}: what answers is no viewer; {remedy}")


def answers(address: str, started: float = STARTED) -> bool:
    """Tell whether a viewer answers at an address."""
    try:
        return _greeted(address, started)
    except (OSError, ValueError):
        return False


def is_open(home: str = ADDRESS, started: float = STARTED) -> bool:
    """Tell whether a viewer is open at the address that viewers have."""
    try:
        answer = _greeted(home, started)
    except OSError:
        return False
    if not answer:
        raise OSError(f'port {PORT}: is taken by what is no viewer; end that, or start "rerun --port 9877" and name it: '
                      f'to="{ADDRESS.replace(str(PORT), "9877")}"')  # fmt: skip
    return True


def _greeted(address: str, started: float) -> bool:
    """Whether what listens at an address takes recordings, as viewers do. Raises OSError where nothing listens."""
    parts = urlsplit(address)
    place = parts.hostname or "", parts.port or PORT
    names = {":method": "POST", ":scheme": "http", ":path": CALL, ":authority": f"{place[0]}:{place[1]}",
             "content-type": "application/grpc", "te": "trailers"}  # fmt: skip
    # Each as it is, without a table of known ones (RFC 7541, section 6.2.2).
    head = b"".join(b"\0" + _text(name) + _text(value) for name, value in names.items())
    frames = _frame(SETTINGS, 0, 0), _frame(HEADERS, END_HEADERS, 1, head), _frame(DATA, END_STREAM, 1)
    with socket.create_connection(place, PATIENCE) as connection:
        try:
            connection.sendall(GREETING + b"".join(frames))
            return any(content == EMPTY_ANSWER for kind, content in _frames(connection, started) if kind == DATA)
        except OSError:
            return False


def _text(text: str) -> bytes:
    if len(text) > 126:  # its length would take more than a byte (RFC 7541, section 5.1)
        raise ValueError("the name is too long")
    return bytes((len(text),)) + text.encode()


def _frame(kind: int, flags: int, stream: int, content: bytes = b"") -> bytes:
    return len(content).to_bytes(3, "big") + bytes((kind, flags)) + stream.to_bytes(4, "big") + content


def _frames(connection: socket.socket, started: float) -> Iterator[tuple[int, bytes]]:
    """Types and contents of the frames of an answer, up to its end and for as long as a viewer takes to start [s]."""
    end, read = time.monotonic() + started, b""
    while (seconds := end - time.monotonic()) > 0.0:
        connection.settimeout(seconds)
        more = connection.recv(2**14)
        read += more
        while len(read) >= HEAD and len(read) >= (size := HEAD + int.from_bytes(read[:3], "big")):
            kind, ended = read[3], read[4] & END_STREAM and read[3] in (DATA, HEADERS)
            yield kind, read[HEAD:size]
            read = read[size:]
            if ended or kind in (RESET, GOODBYE):
                return
        if not more or len(read) > 2**15:
            return


def watched(send: Callable[[], None], address: str, patience: float = PATIENCE, started: float = STARTED) -> None:
    """Send to a viewer for as long as it answers: rerun would wait without end for one that does not."""
    raised: list[BaseException] = []

    def sending() -> None:
        try:
            send()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=sending, name="viewer", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(patience)
        if thread.is_alive() and not answers(address, started):
            raise OSError(f"to = {address!r}: the viewer does not answer any more")
    if raised:
        raise raised[0]


def start(words: Sequence[str | Path], remedy: str, started: float = STARTED) -> None:
    """Start a viewer that goes on after this process."""
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
            raise OSError(f"the viewer cannot be started ({error}); {remedy}") from None
        if code:
            log.seek(0)
            raise OSError(f"the viewer did not start ({one_line(log.read().strip()[-200:])}); {remedy}")


def opened(address: str | None, home: str = ADDRESS, patience: float = PATIENCE) -> str:
    """Find the viewer at an address, or one on this machine, at `home`, which is started where none is open."""
    rerun()
    if address is not None:
        reach(address)
        return address
    if not is_open(home):
        start(["--port", str(PORT)], 'run where there is a display, or name a viewer that is open: '
              f'--viewer "{ADDRESS.replace("127.0.0.1", "HOST")}"')  # fmt: skip
        end = time.monotonic() + patience
        while not is_open(home) and time.monotonic() < end:
            time.sleep(0.1)
        reach(home)
    return home
