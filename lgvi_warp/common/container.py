# SPDX-License-Identifier: Apache-2.0
"""Limits that a container or a batch system sets for a process: Linux control groups, versions 2 and 1.

A process's groups are named in /proc/self/cgroup, and their limits are in files below /sys/fs/cgroup. The limits of
every parent group apply too. In a container the names may be those of the host, whose folders are missing; then only
the existing folders are read.
Source: Linux kernel, Documentation/admin-guide/cgroup-v2.rst and cgroup-v1/memory.rst, scheduler/sched-bwc.rst.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Iterator
from pathlib import Path

ROOT, OWN = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def cpu_quota(root: Path = ROOT, group_file: Path = OWN) -> float | None:
    """Smallest quota of CPU time [CPUs] of this process's groups, 1.5 for 150 ms in each 100 ms; None without a quota."""
    return _cpu_quota(root, group_file, int(time.monotonic()))


@functools.lru_cache(maxsize=1)
def _cpu_quota(root: Path, group_file: Path, second: int) -> float | None:
    """The quota, read from its files at most once a second, since short runs need it many times a second."""
    quotas = [_v2_quota(folder) for folder in _folders(root, group_file, "")]
    quotas += [_v1_quota(folder) for folder in _folders(root, group_file, "cpu")]
    return min((quota for quota in quotas if quota is not None), default=None)


def memory_limit(root: Path = ROOT, group_file: Path = OWN) -> int | None:
    """Smallest limit of memory [bytes] of this process's groups; None without a limit.

    Version 1 expresses "no limit" by an impossibly large number.
    """
    limits = [_number(folder / "memory.max") for folder in _folders(root, group_file, "")]
    for folder in _folders(root, group_file, "memory"):
        limits += [_number(folder / "memory.limit_in_bytes"), _hierarchical(folder / "memory.stat")]
    return min((int(limit) for limit in limits if limit is not None and limit > 0), default=None)


def _folders(root: Path, group_file: Path, controller: str) -> Iterator[Path]:
    """Existing folders of this process's group and of its parents; controller: of version 1, "" for version 2."""
    for line in _text(group_file).splitlines():
        _, _, rest = line.partition(":")
        names, _, path = rest.partition(":")
        if controller not in names.split(","):
            continue
        top = _top(root, names, controller)
        group = Path(path.strip().strip("/"))
        if ".." in group.parts:  # outside the container's own namespace
            group = Path()
        yield from (folder for parent in (group, *group.parents) if (folder := top / parent).is_dir())


def _top(root: Path, names: str, controller: str) -> Path:
    """Folder where a hierarchy is mounted, named by one or all controllers; "unified" for version 2 beside version 1."""
    if controller:
        return next((root / name for name in (controller, names) if (root / name).is_dir()), root / controller)
    return root / "unified" if (root / "unified").is_dir() else root


def _v2_quota(folder: Path) -> float | None:
    quota, _, period = _text(folder / "cpu.max").strip().partition(" ")
    return _ratio(quota, period or "100000")


def _v1_quota(folder: Path) -> float | None:
    return _ratio(_text(folder / "cpu.cfs_quota_us"), _text(folder / "cpu.cfs_period_us"))


def _ratio(quota: str, period: str) -> float | None:
    """Quotient of two positive whole numbers; None for "max", -1 and any other text."""
    try:
        time, interval = int(quota), int(period)
    except ValueError:
        return None
    return time / interval if time > 0 and interval > 0 else None


def _number(path: Path) -> int | None:
    try:
        return int(_text(path))
    except ValueError:
        return None


def _hierarchical(path: Path) -> int | None:
    """The limit that version 1 computes from all parent groups, including those of the host."""
    for line in _text(path).splitlines():
        name, _, value = line.partition(" ")
        if name == "hierarchical_memory_limit" and value.isdigit():
            return int(value)
    return None


def _text(path: Path) -> str:
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError):
        return ""
