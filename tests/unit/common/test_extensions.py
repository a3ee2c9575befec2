# SPDX-License-Identifier: Apache-2.0
"""Extensions are found by their words, those of the package and those of others, and cost nothing before."""

import json
import os
import subprocess
import sys

import pytest

from lgvi_warp.common import extensions
from lgvi_warp.physics.terms import TYPES, events
from tests.conftest import ROOT
from tests.house.test_start import modules_after

# A package of somebody else, without its metadata: an event, a part, and a class behind a door.
FOREIGN = {
    "far_away/__init__.py": """
HOLDS = {"events": {"far_away": ".parts"}, "sensors": {"own_gyro": ".parts"}, "lw.events": {"FarAway": ".parts:FarAway"},
         "vehicles": {"own_boat": "boats/own_boat.toml"}, "signals": {"own_signal": ".parts"}, "terms": {"drag": ".parts"}}
""",
    "far_away/parts.py": """
import lgvi_warp as lw
from dataclasses import dataclass
from typing import Any, ClassVar
from lgvi_warp.control.signals import Signal, add_signals
from lgvi_warp.physics.fields import Field
@dataclass(frozen=True, eq=False, kw_only=True)
class FarAway(lw.laws.Event):
    type: ClassVar[str] = "far_away"
    device: ClassVar[str] = "far_away.device"
    radius: Any = lw.laws.number((), "m")
@dataclass(frozen=True, eq=False, kw_only=True)
class OwnGyro(lw.laws.MeasuringPart):
    type: ClassVar[str] = "own_gyro"
    device: ClassVar[str] = "far_away.device"
add_signals(Signal(Field("own_signal", (2,), "m", "a signal"), "own"))
""",
    "far_away-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: far-away\nVersion: 1.0\n",
    "far_away-1.0.dist-info/entry_points.txt": "[lgvi_warp.extensions]\nfar = far_away\n",
}  # fmt: skip


def told_by(code, folder):
    """Output of a new Python that sees this folder, read as JSON."""
    paths = os.pathsep.join([str(folder), str(ROOT), str(ROOT / "kernels")])
    done = subprocess.run(
        [sys.executable, "-W", "always", "-c", code], cwd=folder, env=os.environ | {"PYTHONPATH": paths},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return json.loads(done.stdout), done.stderr


@pytest.fixture
def foreign(tmp_path):
    """A folder with the package of somebody else."""
    for name, text in FOREIGN.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


@pytest.mark.ci
@pytest.mark.parametrize("code", [
    "import lgvi_warp",
    "import lgvi_warp as lw; lw.Scene.named('remus_100'); lw.terms.Drag; lw.control.Sensor",
    "import lgvi_warp as lw; lw.solve(lw.Scene.named('remus_100'), 'psi_x', h=0.1, t1=0.2)",
    "import lgvi_warp as lw; lw.SaveAt(every=1.0, fields=('position', 'measured_depth'))",
])  # fmt: skip
def test_what_the_core_knows_looks_for_no_extension(code):
    assert [name for name in modules_after(code) if name.startswith("lgvi_warp.extensions")] == []


def test_what_no_extension_has_is_nothing():
    assert extensions.load("terms", "no_such") is None
    assert extensions.file("vehicles", "no_such") is None
    assert extensions.words("no_such") == []
    assert "no_such" not in TYPES
    assert "no_such" not in events.TYPES


def test_a_package_of_somebody_else_is_found(foreign):
    code = """
import json, sys
import lgvi_warp as lw
from lgvi_warp.control.base import SECTIONS
from lgvi_warp.control.signals import SIGNALS
scene = lw.Scene.named("remus_100")
before = "far_away" in sys.modules
scene = lw.Scene.named("remus_100", events=[{"type": "far_away", "radius": 3.0}])
print(json.dumps({
    "before": before, "event": type(scene.events[0]).__name__, "dir": "FarAway" in dir(lw.events),
    "door": lw.events.FarAway is type(scene.events[0]), "part": "own_gyro" in list(SECTIONS["sensors"].kinds),
    "signal": SIGNALS["own_signal"].field.shape, "vehicle": "own_boat" in lw.vehicles.names(),
    "core": lw.terms.Drag.__module__, "drag": type(lw.Scene.named("torpedo", terms=[{"type": "drag", "linear": [0.0] * 6,
                                                                 "quadratic": [1.0] * 6}]).terms[0]).__module__}))
"""
    told, _ = told_by(code, foreign)
    core = "lgvi_warp.physics.terms.drag"
    assert told == {"before": False, "event": "FarAway", "dir": True, "door": True, "part": True, "signal": [2],
                    "vehicle": True, "core": core, "drag": core}  # fmt: skip


def test_a_package_that_cannot_be_imported_is_left_out_with_a_warning(foreign):
    (foreign / "far_away" / "__init__.py").write_text("import no_such_module_at_all")
    told, warned = told_by("import json; import lgvi_warp as lw; print(json.dumps(lw.vehicles.names()))", foreign)
    assert "remus_100" in told
    assert "extension far: cannot be imported (ModuleNotFoundError" in warned
