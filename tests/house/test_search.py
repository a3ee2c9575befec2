# SPDX-License-Identifier: Apache-2.0
"""The search of the site lists first what a newcomer looks for: its own scripts are run, by node."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

pytestmark = pytest.mark.slow
FIRST = 3
# Query -> pages of which one is among the first.
WANTED = {
    "added mass": ("theory/coupled", "theory/water"),
    "own controller": ("develop/add_a_controller",),
    "lawn mower": ("controllers/guidance",),
    "conda": ("start/install",),
    "cite": ("index",),
    "citation": ("index",),
    "install": ("start/install",),
    "docker": ("start/install",),
    "windows": ("start/install",),
    "current": ("guide/current",),
    "ocean model": ("guide/ocean_data",),
    "netcdf": ("guide/ocean_data", "guide/exports"),
    "floor": ("guide/sea_floor",),
    "bathymetry": ("guide/sea_floor",),
    "waves": ("guide/terms/waves",),
    "thruster": ("guide/terms/thrusters",),
    "battery": ("guide/energy_used",),
    "own force": ("develop/add_a_force",),
    "latitude longitude": ("guide/geodetic_places",),
    "urdf": ("guide/vehicles",),
    "bluerov2": ("guide/vehicles", "validation/bluerov2_steps"),
    "validation": ("validation/README",),
    "margins": ("controllers/margins",),
    "waypoints": ("controllers/guidance",),
    "docking": ("controllers/guidance",),
    "pid": ("controllers/laws",),
    "kalman filter": ("controllers/navigation", "controllers/sensors"),
    "sensor noise": ("controllers/sensors",),
    "autopilot": ("controllers/README",),
    "reinforcement learning": ("controllers/gym", "controllers/learn_depth_keeping"),
    "step response": ("controllers/metrics",),
    "tune gains": ("guide/worst_case",),
    "optimise gains": ("guide/worst_case",),
    "sensitivity": ("guide/sensitivity",),
    "monte carlo": ("guide/sampling", "guide/statistics"),
    "seed": ("guide/sampling",),
    "rare event": ("guide/rare_events",),
    "confidence interval": ("guide/statistics",),
    "navigation error": ("guide/how_far_off",),
    "search area": ("guide/footprint",),
    "gradient": ("guide/derivatives",),
    "rk4": ("guide/methods", "reference/methods"),
    "time step": ("guide/choose_method_and_step", "guide/methods"),
    "numba": ("guide/beside_others",),
    "compare simulator": ("guide/compare_with_your_simulator",),
    "cluster": ("guide/large_ensembles",),
    "out of memory": ("guide/large_ensembles",),
    "resume": ("guide/resume",),
    "scene file": ("start/scene_file",),
    "nan": ("guide/failed_members",),
}


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The site, without running its notebooks."""
    pytest.importorskip("sphinx")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-D", "nb_execution_mode=off", "-d", str(folder / "trees")]
    subprocess.run([*command, "docs", str(folder / "html")], check=True, cwd=ROOT)
    return folder / "html"


@pytest.fixture(scope="module")
def listed(site):
    """Query -> what is listed, first the best: page, title, anchor."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    command = [node, str(Path(__file__).with_name("search.js")), str(site), *WANTED, "quetzalcoatl dodecahedron"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(zip([*WANTED, "nothing"], json.loads(done.stdout), strict=True))


@pytest.mark.parametrize("query", WANTED)
def test_what_is_looked_for_is_among_the_first(listed, query):
    first = [page for page, _, _ in listed[query][:FIRST]]
    assert set(first) & set(WANTED[query]), f"{query!r} lists {first}"


def test_added_mass_leads_to_its_section(listed):
    assert listed["added mass"][0] == [
        "theory/coupled",
        "A full 6x6 inertia: psi_x and psi_w > Added mass",
        "#added-mass",
    ]


def test_the_changelog_is_never_among_the_first_but_where_little_else_is(listed):
    for query, found in listed.items():
        pages = [page for page, _, _ in found]
        assert "reference/built/changelog" not in pages[: min(FIRST, len(set(pages)) - 1)], query


def test_what_is_nowhere_lists_nothing(listed):
    assert listed["nothing"] == []
