# SPDX-License-Identifier: Apache-2.0
"""Temporary names of files and folders that are being written: each contains its process, and all are different."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import socket
import stat
from pathlib import Path

# Endings of an unfinished file, of a new folder, and of the folder that it replaced.
UNFINISHED, NEW, OLD = ".part", ".new", ".old"
# HOST-NAMESPACE-PID-TOKEN; versions before 0.2 wrote HOST-PID.
MARK = re.compile(r"(?P<host>[^/]+?)-(?:(?P<space>\d+)-)?(?P<pid>\d+)(?:-[0-9a-f]{8})?")


def host() -> str:
    """Identify the machine and the process namespace, within which a process number is unique."""
    try:
        space = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        space = 0
    return f"{socket.gethostname()[:40].replace('/', '_')}-{space}"


def beside(target: Path, ending: str = UNFINISHED) -> Path:
    """Make a temporary name, in the same folder, that no other writer has."""
    return target.with_name(f"{target.name}.{host()}-{os.getpid()}-{secrets.token_hex(4)}{ending}")


def is_alive(pid: int) -> bool:
    """Tell whether a process of this machine runs."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # another user's process
        return True
    return True


def of_target(name: str, target: str) -> re.Match[str] | None:
    """Match a temporary name, with "host", "space" and "pid" of the writer; None for any other name."""
    head, ending = f"{target}.", os.path.splitext(name)[1]
    if not name.startswith(head) or ending not in (UNFINISHED, NEW, OLD):
        return None
    return MARK.fullmatch(name[len(head) : -len(ending)])


def is_unfinished(name: str) -> bool:
    """Tell whether a name is the temporary name of an unfinished file."""
    head, ending = os.path.splitext(name)
    return ending == UNFINISHED and any(MARK.fullmatch(head[dot.end() :]) for dot in re.finditer(r"(?<!^)\.", head))


def left_behind(target: Path) -> list[Path]:
    """Find the unfinished files of a target that ended processes of this machine left."""
    try:
        names = os.listdir(target.parent)
    except OSError:
        return []
    paths = []
    for name in names:
        mark = of_target(name, target.name)
        if mark and f"{mark['host']}-{mark['space']}" == host() and not is_alive(int(mark["pid"])):
            paths.append(target.with_name(name))
    return paths


def sweep(target: Path) -> None:
    """Remove the unfinished files of a target that ended processes left; folders stay, since their use is unknown here.

    Args:
        target: Path of the final file.
    """
    for path in left_behind(target):
        with contextlib.suppress(OSError):
            if path.suffix == UNFINISHED and stat.S_ISREG(path.lstat().st_mode):
                path.unlink()


def remove_folder(path: Path) -> None:
    """Remove a folder with all its content. A missing folder is no error, and a link is not followed."""
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(path)
