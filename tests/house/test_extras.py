# SPDX-License-Identifier: Apache-2.0
"""Without the libraries of an extra, what needs them says which extra installs them, and in no other error."""

import re
import sys
from argparse import Namespace

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp import cli
from lgvi_warp.common import yaml_text
from lgvi_warp.common.errors import install
from lgvi_warp.engine.executors import executor_of
from lgvi_warp.sampling.designs.space import Space
from lgvi_warp.statistics.estimates.estimate import Estimate
from lgvi_warp.store.settings import needed
from lgvi_warp.uncertainty.footprint.density import Smoothed
from lgvi_warp.uncertainty.sensitivity import analyses
from lgvi_warp.views.pages import run_again
from lgvi_warp.views.plots import canvas
from lgvi_warp.views.recording import rerun

ESTIMATE = Estimate("mean x", {}, "m", 0.95, "", {"value": ("time",)}, {"value": np.zeros(2)}, {"time": np.arange(2.0)})
TWO = Space(0, ("a", "b"), (1, 1), (("a", (0,)), ("b", (1,))))
MODEL = lw.linear.LinearModel(*np.zeros((4, 12, 12)), 0.1, (), (), {})
DOORS = {
    "screening": (lambda: lw.designs.Morris(4).draw(TWO, np.arange(3)), "SALib.sample", "uq"),
    "sensitivity": (lambda: analyses.salib(), "SALib.analyze.morris", "uq"),
    "datasets of statistics": (lambda: ESTIMATE.dataset, "xarray", "store"),
    "stores: checksums": (needed, "google_crc32c", "store"),
    "stores: xarray": (needed, "xarray", "store"),
    "stores: zarr": (needed, "zarr", "store"),
    "clusters": (lambda: executor_of("dask", 1, "tcp://127.0.0.1:1"), "distributed", "cluster"),
    "environments": (lambda: lw.gym.VectorEnv(None, observe=[]), "gymnasium", "gym"),
    "learners": (lambda: lw.gym.sb3(None), "stable_baselines3.common.vec_env", "learn"),
    "state spaces": (lambda: MODEL.state_space(), "control", "control"),
    "YAML": (lambda: yaml_text.parsed("a: 1"), "yaml", "yaml"),
    "plots": (canvas.figure_class, "matplotlib.figure", "viz"),
    "footprints": (lambda: Smoothed(None, 0.0, np.eye(3), np.ones(1), np.ones(1)).parts(0.5), "contourpy", "viz"),
    "reports": (lambda: run_again.toml_of({}), "tomlkit", "viz"),
    "completion": (lambda: cli.arguments.VERBS["completion"](Namespace(shell="bash")), "shtab", "shell"),
    "recordings": (lambda: rerun.record(None, "x"), "rerun", "viz"),
}


@pytest.mark.parametrize("door", DOORS)
def test_a_missing_library_is_named_with_its_extra(door, monkeypatch):
    action, library, extra = DOORS[door]
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises((ImportError, lw.SceneError), match=re.escape(install(extra))):
        action()
