"""Fixtures: the paper's example, as numbers, as a scene and as the reference's body."""

import json
from pathlib import Path

import numpy as np
import pytest

import lgvi_warp as lw
from lgvi_warp.reference.submaps import Body, State
from lgvi_warp.reference.terms.restoring import Restoring
from lgvi_warp.reference.terms.weight import Weight

ROOT = Path(__file__).parent.parent
SLOW = [line for line in (ROOT / "tests" / "slow.txt").read_text().splitlines() if line and not line.startswith("#")]


COLLECTED = pytest.StashKey[list[str]]()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark as slow what slow.txt names."""
    config.stash[COLLECTED] = [item.nodeid for item in items]
    left = tuple(line for line in SLOW if not line.startswith("!"))
    here = tuple(line[1:] for line in SLOW if line.startswith("!"))
    for item in items:
        if item.nodeid.startswith(left) and not item.nodeid.startswith(here):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def example():
    """The states of the paper's example: `truth` in quadruple precision, and each method's at h = 0.01."""
    return json.loads((Path(__file__).parent / "data" / "paper_example.json").read_text())


@pytest.fixture(scope="session")
def scene():
    """The paper's vehicle and start."""
    return lw.Scene.load(ROOT / "examples" / "paper.toml")


@pytest.fixture(scope="session")
def body(example):
    """The paper's vehicle for the reference."""
    p = example["params"]
    terms = (Weight(p["m"] * p["g"] - p["rhoVg"]), Restoring(p["rhoVg"] * np.array(p["r"])))
    return Body(np.diag(p["M"]), np.diag(p["J"]), terms)


@pytest.fixture(scope="session")
def start(example, body):
    """The paper's initial state for the reference."""
    x = {key: np.array(value) for key, value in example["params"]["x0"].items()}
    return State(x["b"], x["R"], body.M @ x["nu"], body.J @ x["Omega"])
