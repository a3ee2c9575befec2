# SPDX-License-Identifier: Apache-2.0
"""The pictures of the tutorial, one a step, drawn by its own lines: `make pictures ONLY="tutorial_first tutorial_many ..."`.

Its scene file grows from step to step, its commands are run as they are typed, its Python as one script.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from shutil import copyfile

PAGE = Path(__file__).parents[1] / "start" / "tutorial.md"
# A step: lines for the scene file, Python with what it prints, or a command with what it prints.
STEP = re.compile(
    r"^```toml\n([\s\S]*?)^```|^```python\n([\s\S]*?)^```\n\n((?:    .*\n)*)|^    \$ (.*)\n((?:    .*\n)*)",
    re.MULTILINE,
)
# File that the lines write -> name of the picture.
WRITTEN = {
    "first/fleet.png": "tutorial_first.png",
    "many/fleet.png": "tutorial_many.png",
    "many/statistics.png": "tutorial_statistics.png",
    "landed.png": "tutorial_landed.png",
    "dive.png": "tutorial_speed.png",
}


def main(folder: str) -> None:
    """Do all steps in a folder, and put each picture into it by its name.

    Args:
        folder: Where the files of the tutorial are written.
    """
    scene = code = ""
    for lines, snippet, _, command, _ in STEP.findall(PAGE.read_text()):
        scene, code = scene + lines + "\n", code + snippet
        Path(folder, "dive.toml").write_text(scene)
        if command:
            words = command.removeprefix("lgvi-warp ").split()
            subprocess.run([sys.executable, "-m", "lgvi_warp", *words], cwd=folder, check=True)
    subprocess.run([sys.executable, "-c", code], cwd=folder, check=True)
    for written, name in WRITTEN.items():
        copyfile(Path(folder, written), Path(folder, name))


if __name__ == "__main__":
    main(sys.argv[1])
