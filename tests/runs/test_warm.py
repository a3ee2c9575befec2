# SPDX-License-Identifier: Apache-2.0
"""Kernels compiled ahead of a run: those that the run takes, and no others."""

import dataclasses
import os
import subprocess
import sys
from unittest import mock

import pytest

import lgvi_warp as lw
from lgvi_warp.calls import warm
from lgvi_warp.runs import request
from tests.conftest import ROOT

PAPER = ROOT / "examples" / "paper.toml"


def kernels_of(scene, methods=(), dtypes=()):
    return [(plan.method.name, plan.dtype, plan.spec) for plan in warm.plans_of(scene, methods, dtypes)]


def kernel_of_solve(scene, *arguments, **named):
    """The kernel of a run, which does not begin."""
    with mock.patch.object(request, "run_plan", side_effect=InterruptedError) as begun, pytest.raises(InterruptedError):
        lw.solve(scene, *arguments, **named)
    return begun.call_args.args[0].spec


@pytest.mark.ci
def test_every_method_and_precision_has_a_kernel():
    scene = lw.Scene.load(PAPER)
    kernels = kernels_of(scene, ["psi_s", "rk4", "psi_s"], ["float64", "float32"])
    assert [kernel[:2] for kernel in kernels] == [(m, d) for m in ("psi_s", "rk4") for d in ("float64", "float32")]
    assert all(spec == kernel_of_solve(scene, method, dtype=dtype) for method, dtype, spec in kernels)
    assert [kernel[2] for kernel in kernels_of(scene)] == [kernel_of_solve(scene)]
    with pytest.raises(lw.SceneError, match="psi_q"):
        kernels_of(scene, ["psi_q"])


def test_statistics_and_kept_members_take_the_kernel_of_the_scene():
    scene = lw.Scene.load(PAPER)
    run = dataclasses.replace(scene.run, keep="failed", statistics=(lw.statistics.Mean("position"),))
    watched = dataclasses.replace(scene, run=run)
    assert kernels_of(watched) == kernels_of(scene) == [("psi_s", "float64", kernel_of_solve(watched))]


@pytest.mark.slow
def test_a_run_after_it_compiles_nothing(tmp_path):
    command = [sys.executable, "-c", "from lgvi_warp.cli import entry; entry()"]
    env = os.environ | {"WARP_CACHE_PATH": str(tmp_path), "PYTHONPATH": os.pathsep.join(sys.path)}

    def said(*words):
        done = subprocess.run([*command, *words], env=env, capture_output=True, text=True, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout

    names = ["warm", str(PAPER), "--methods", "psi_s,psi_x", "--threads", "2"]
    assert said(*names).count("Clang") == 2
    assert said(*names).count("was in the cache") == 2
    short = ["run", str(PAPER), "--members", "2", "--out", "out"]
    assert "compiled" not in said(*short, "--method", "psi_x")
    assert "kernel      compiled: source " in said(*short, "--method", "rk4")
