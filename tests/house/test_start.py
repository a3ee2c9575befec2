# SPDX-License-Identifier: Apache-2.0
"""The package loads late: an import of it brings nothing else in, and a scene needs neither SciPy nor Warp."""

import json
import re
import subprocess
import sys

import pytest

import lgvi_warp as lw
from tests.conftest import ROOT

HEAVY = {
    "scipy", "warp", "matplotlib", "rerun", "xarray", "pandas", "zarr", "distributed", "dask", "h5py", "netCDF4", "pyarrow",
    "SALib", "gymnasium", "tqdm", "control", "stable_baselines3", "torch", "fmpy", "shtab",
}  # fmt: skip
PRINT = "; import sys, json; print(json.dumps(sorted(sys.modules)))"


def modules_after(code):
    """Names of the modules that a new Python holds after this code."""
    process = subprocess.run([sys.executable, "-c", code + PRINT], check=True, capture_output=True, text=True)
    return json.loads(process.stdout)


def packages(modules):
    """The first part of each name."""
    return {name.partition(".")[0] for name in modules}


def test_the_package_alone_loads_nothing_else():
    modules = modules_after("import lgvi_warp")
    ours = [name for name in modules if name.startswith("lgvi_")]
    assert ours == ["lgvi_warp", "lgvi_warp.common", "lgvi_warp.common.doors"]
    assert packages(modules) & (HEAVY | {"numpy", "lgvi_kernels"}) == set()


def test_a_scene_loads_the_rooms_below_it_only():
    modules = modules_after("import lgvi_warp as lw; lw.Scene")
    rooms = {name.split(".")[1] for name in modules if name.startswith("lgvi_warp.")}
    assert rooms == {"common", "physics", "methods", "sampling", "scene"}
    # Terms are one file each, and all are known by their types.
    others = [name for name in modules if name.startswith("lgvi_warp") and ".terms." not in name]
    # Two of them are `near` and `documented`: public classes refuse unknown keywords, and choose what dir() lists.
    assert len(others) <= 54, "a scene loads modules that it needs not: import them where they are used"
    assert packages(modules) & (HEAVY | {"lgvi_kernels"}) == set()


def test_every_public_name_is_found():
    assert set(lw.__all__) <= set(dir(lw))
    assert {"Scene", "solve", "uq", "vehicles", "__version__"} <= set(dir(lw))
    assert all(getattr(lw, name) is not None for name in dir(lw))
    assert lw.uq.__name__ == "lgvi_warp.uq"


def test_the_version_is_the_same_everywhere():
    for path in ("pyproject.toml", "CITATION.cff"):
        text = (ROOT / path).read_text()
        assert re.search(r'^version(?: =|:) "?([\d.]+)"?$', text, re.MULTILINE)[1] == lw.__version__, path


def test_an_unknown_name_is_refused():
    with pytest.raises(AttributeError, match="has no attribute 'Scenes'"):
        lw.Scenes


def test_a_kernel_without_a_controller_loads_no_code_of_ticks():
    code = (
        "import lgvi_warp as lw; from lgvi_warp.runs.settle import make_plan; "
        "make_plan(lw.Ensemble(lw.Scene.named('remus_100')), 'rk4', h=0.1, t1=1.0).kernel.advance"
    )
    modules = modules_after(code)
    assert "lgvi_kernels.advance.stepping" in modules
    assert not {"lgvi_kernels.advance.feeding"} & set(modules)
