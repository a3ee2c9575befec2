# SPDX-License-Identifier: Apache-2.0
"""Start the command, as `lgvi-warp` or `python -m lgvi_warp`; signals are handled even while its libraries are imported."""

import os
import signal
from types import FrameType


def entry() -> None:
    """Entry point of the console script: install signal handlers, then import and run the command."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # An ignored signal, as under nohup, stays ignored.
        if number is not None and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _end)
    from lgvi_warp.cli import entry as command

    command()


def _end(number: int, frame: FrameType | None) -> None:
    """End the process at once; the command has not begun, so nothing is lost."""
    os.write(2, b"lgvi-warp: interrupted; nothing was written\n")
    os._exit(128 + number)


if __name__ == "__main__":
    entry()
