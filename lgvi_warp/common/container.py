"""What a container or a batch system leaves of the machine: limits of Linux control groups, of version 2 and 1.

A process's groups are named in /proc/self/cgroup, and their limits lie in files below /sys/fs/cgroup. Every group above
limits as well. In a container the names may be those of the host, whose folders are not there: then what is there counts.
Source: Linux kernel, Documentation/admin-guide/cgroup-v2.rst and cgroup-v1/memory.rst, scheduler/sched-bwc.rst.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

ROOT, OWN = Path("/sys/fs/cgroup"), Path("/proc/self/cgroup")


def cpu_quota(root: Path = ROOT, own: Path = OWN) -> float | None:
    """CPUs' worth of time that this process may use.

    Args:
        root: where control groups are mounted.
        own: the file that names this process's groups.

    Returns:
        The least quota of its groups [CPUs], 1.5 for 150 ms in each 100 ms; None without one.
    """
    quotas = [_v2_quota(folder) for folder in _folders(root, own, "")]
    quotas += [_v1_quota(folder) for folder in _folders(root, own, "cpu")]
    return min((quota for quota in quotas if quota is not None), default=None)


def memory_limit(root: Path = ROOT, own: Path = OWN) -> int | None:
    """Memory that this process and its groups' others may use together.

    Args:
        root: where control groups are mounted.
        own: the file that names this process's groups.

    Returns:
        The least limit of its groups [bytes]; None without one. Version 1 says none by a number that no machine has.
    """
    limits = [_number(folder / "memory.max") for folder in _folders(root, own, "")]
    for folder in _folders(root, own, "memory"):
        limits += [_number(folder / "memory.limit_in_bytes"), _hierarchical(folder / "memory.stat")]
    return min((int(limit) for limit in limits if limit is not None and limit > 0), default=None)


def _folders(root: Path, own: Path, controller: str) -> Iterator[Path]:
    """Those of this process's group and of all above it that are there; controller: of version 1, "" for version 2."""
    for line in _text(own).splitlines():
        _, _, rest = line.partition(":")
        names, _, path = rest.partition(":")
        if controller not in names.split(","):
            continue
        top = _top(root, names, controller)
        group = Path(path.strip().strip("/"))
        if ".." in group.parts:  # a group outside of the container's own namespace
            group = Path()
        yield from (folder for one in (group, *group.parents) if (folder := top / one).is_dir())


def _top(root: Path, names: str, controller: str) -> Path:
    """Where a hierarchy is mounted: by its controller or by all of them, cpu,cpuacct; version 2 beside 1 in unified."""
    if controller:
        return next((root / name for name in (controller, names) if (root / name).is_dir()), root / controller)
    return root / "unified" if (root / "unified").is_dir() else root


def _v2_quota(folder: Path) -> float | None:
    quota, _, period = _text(folder / "cpu.max").strip().partition(" ")
    return _ratio(quota, period or "100000")


def _v1_quota(folder: Path) -> float | None:
    return _ratio(_text(folder / "cpu.cfs_quota_us"), _text(folder / "cpu.cfs_period_us"))


def _ratio(quota: str, period: str) -> float | None:
    """Of two numbers above 0; None for "max", -1 and what is no number."""
    try:
        given, each = int(quota), int(period)
    except ValueError:
        return None
    return given / each if given > 0 and each > 0 else None


def _number(path: Path) -> int | None:
    try:
        return int(_text(path))
    except ValueError:
        return None


def _hierarchical(path: Path) -> int | None:
    """The limit that version 1 finds among all groups above, those of the host too."""
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
