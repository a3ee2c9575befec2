# SPDX-License-Identifier: Apache-2.0
"""Does the core stand alone? `python -m tests.support.core_alone [PYTEST...]`: run tests in a copy without extensions.

The modules of the core are imported first, and a scene is solved. Without arguments the tests of CHOSEN run that load no
kernel. A test that names words of an extension says so by the mark `needs`.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
WITHOUT = ("lgvi_warp/extensions", "tests/extensions")
ROOMS = ("common", "control", "engine", "physics", "scene", "statistics")
CHOSEN = ("-m", "not slow and not kernel", *(f"tests/unit/{room}" for room in ROOMS))
# Imports every module of the core, runs a scene, and asks for words that no extension is there to know.
SMOKE = """
import sys
from importlib import import_module
from pkgutil import walk_packages
import lgvi_warp as lw
for found in walk_packages(lw.__path__, "lgvi_warp."):
    if not found.name.endswith("__main__"):
        import_module(found.name)
from lgvi_warp.scene.schema import schema
schema()
result = lw.solve(lw.Scene.named("remus_100"), h=0.1, t1=0.5)
assert result.status.counts() == {"ok": 1}, result.status.counts()
assert "seawing" not in lw.vehicles.names()
try:
    lw.Scene.named("torpedo", terms=[{"type": "polar"}])
except lw.SceneError as error:
    assert "is not known" in str(error)
else:
    raise AssertionError("an extension is there")
assert not [name for name in sys.modules if name.startswith("lgvi_warp.extensions")]
print("the core stands alone")
"""


def copy_of_core(folder: Path) -> Path:
    """Copy what git tracks, without extensions, into a folder."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    for name in listed.splitlines():
        if name.startswith(WITHOUT) or not (ROOT / name).exists():
            continue
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python on the copy."""
    paths = os.pathsep.join([str(folder), str(folder / "kernels")])
    return subprocess.run([sys.executable, *words], cwd=folder, env=os.environ | {"PYTHONPATH": paths}, text=True)


def main(*words: str) -> int:
    """Copy, import all, and run pytest with these words."""
    with tempfile.TemporaryDirectory() as name:
        folder = copy_of_core(Path(name))
        return run(folder, "-c", SMOKE).returncode or run(
            folder, "-m", "pytest", "-q", "-p", "no:cacheprovider", *(words or CHOSEN)
        ).returncode  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
