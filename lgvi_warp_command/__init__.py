"""The command lgvi-warp, from its first moment: signals end it in a line also while its libraries are imported."""

import os
import signal
from types import FrameType


def entry() -> None:
    """The console script."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        # What is ignored, as by nohup, stays ignored.
        if number is not None and signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, _end)
    from lgvi_warp.cli import entry as command

    command()


def _end(number: int, frame: FrameType | None) -> None:
    """Nothing was begun: there is nothing to lose."""
    os.write(2, b"lgvi-warp: interrupted; nothing was written\n")
    os._exit(128 + number)
