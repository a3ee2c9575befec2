# SPDX-License-Identifier: Apache-2.0
"""Measure how large an installation is: plain, with the extra viz, and with all; each in an empty environment of its own."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.pages import ROOT, markdown, stamp

# What is installed -> its extras.
KINDS = {"plain": "", "with `viz`": "[viz]", "with `all`": "[all]"}


def main() -> str:
    rows = []
    for kind, extras in KINDS.items():
        size, packages = installed(extras)
        rows.append([kind, f"{size / 1e6:,.0f} MB", str(packages)])
        print(rows[-1], file=sys.stderr, flush=True)
    return f"{markdown(['installation', 'size', 'packages'], rows, 'lrr')}\n\n{stamp('sizes')}"


def installed(extras: str) -> tuple[int, int]:
    """Bytes of the packages' files, and how many packages, after an install of the wheel into an empty environment."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        python = folder / "environment" / "bin" / "python"
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "environment"], check=True)
        subprocess.run([sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", name], check=True, cwd=ROOT,
                       stdout=subprocess.DEVNULL)  # fmt: skip
        (wheel,) = folder.glob("*.whl")
        install = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", f"{wheel}{extras}"]
        subprocess.run(install, check=True)
        (packages,) = (folder / "environment" / "lib").glob("python*/site-packages")
        files = [path for path in packages.rglob("*") if path.is_file()]
        return sum(path.stat().st_size for path in files), len(list(packages.glob("*.dist-info")))
