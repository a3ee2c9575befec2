# SPDX-License-Identifier: Apache-2.0
"""A closed loop that is killed (SIGKILL) goes on and leaves the bytes of one that was not."""

import random

import pytest

import lgvi_warp as lw
from tests.conftest import ROOT
from tests.support.stores import differing, finished, killed_after

MEMBERS, BLOCKS = 2048, 8
SCENE = ROOT / "examples" / "scenes" / "remus_100_autopilot.toml"
FIELDS = ("position", "attitude", "command", "measured_heading")


def run(path):
    """Sensors with noise and drift, a reference model, integrals, delayed commands and a fault: all that is remembered."""
    fleet = lw.Ensemble.from_scene(lw.Scene.load(SCENE)).subset(range(MEMBERS))
    save = lw.SaveAt(every=1.0, fields=FIELDS)
    store = lw.Store(path, existing="resume", chunk_bytes=500_000)
    lw.solve(fleet, "psi_x", h=0.01, t1=60.0, save=save, threads=1, store=store)


@pytest.mark.slow
def test_a_closed_loop_is_killed_and_goes_on(tmp_path):
    whole, path, dice = tmp_path / "whole.zarr", tmp_path / "run.zarr", random.Random(5)
    run(whole)
    assert finished(whole) == BLOCKS
    # Once by resuming with the same call again and again, which is killed as well; the last time by lw.resume.
    hits = [killed_after(path, blocks, dice.uniform(0.0, 0.05), run) for blocks in (1, 3, 5)]
    assert any(hits)
    assert 0 < finished(path) < BLOCKS
    lw.resume(path)
    assert differing(whole, path) == []
