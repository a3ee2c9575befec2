"""Names of files and folders on their way to their places: they tell which process writes them, and no two are the same."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import socket
import stat
from pathlib import Path

# A file that is being written, a folder that will take the place of another, and the one that it took the place of.
UNFINISHED, NEW, OLD = ".part", ".new", ".old"
# HOST-NAMESPACE-PID-TOKEN; versions before 0.2 wrote HOST-PID.
MARK = re.compile(r"(?P<host>[^/]+?)-(?:(?P<space>\d+)-)?(?P<pid>\d+)(?:-[0-9a-f]{8})?")


def host() -> str:
    """The machine's name and the number of the process namespace: within both a process is known by its number."""
    try:
        space = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        space = 0
    return f"{socket.gethostname()[:40].replace('/', '_')}-{space}"


def beside(target: Path, ending: str = UNFINISHED) -> Path:
    """A name for what will take the place of `target`, in the same folder, that no other writer has."""
    return target.with_name(f"{target.name}.{host()}-{os.getpid()}-{secrets.token_hex(4)}{ending}")


def is_alive(pid: int) -> bool:
    """Whether a process of this machine runs; yes where the system does not tell."""
    if os.name != "posix":
        return True
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):  # it is another user's
        return True
    return True


def of_target(name: str, target: str) -> re.Match[str] | None:
    """What a name says of its writer, if it is one that `beside` gives for a target."""
    head, ending = f"{target}.", os.path.splitext(name)[1]
    if not name.startswith(head) or ending not in (UNFINISHED, NEW, OLD):
        return None
    return MARK.fullmatch(name[len(head) : -len(ending)])


def is_unfinished(name: str) -> bool:
    """Whether a name is one that `beside` gives for an unfinished file."""
    head, ending = os.path.splitext(name)
    return ending == UNFINISHED and any(MARK.fullmatch(head[dot + 1 :]) for dot in _dots(head))


def _dots(text: str) -> list[int]:
    return [place for place, letter in enumerate(text) if letter == "." and place]


def left_behind(target: Path) -> list[Path]:
    """What writers of a target left that run no more: of this machine, by the numbers of their processes."""
    try:
        names = os.listdir(target.parent)
    except OSError:
        return []
    found = []
    for name in names:
        mark = of_target(name, target.name)
        if mark and f"{mark['host']}-{mark['space']}" == host() and not is_alive(int(mark["pid"])):
            found.append(target.with_name(name))
    return found


def sweep(target: Path) -> None:
    """Remove unfinished files of writers of this target that run no more; folders are left to who knows what is in them."""
    for path in left_behind(target):
        with contextlib.suppress(OSError):
            if path.suffix == UNFINISHED and stat.S_ISREG(path.lstat().st_mode):
                path.unlink()


def remove_folder(path: Path) -> None:
    """Remove a folder and all that is in it; one that is not there is no error. A link is not followed."""
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(path)
