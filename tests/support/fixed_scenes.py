# SPDX-License-Identifier: Apache-2.0
"""Forty runs that keep their bits: results, statistics and stores, over the terms, methods, precisions and ways of running.

Bits depend on the processor's vector instructions and on the versions of Warp and NumPy, and may depend on its family and
model, for which the compiler chooses its instructions: the hashes are kept for each such machine, in tests/data/bits.json.
On a machine that is not among them nothing is known: `python -m tests.support.fixed_scenes --against REV` compares two trees
on any machine.
"""

import argparse
import fnmatch
import functools
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import warp as wp

import lgvi_warp as lw

ROOT = Path(__file__).parents[2]
FILE = ROOT / "tests" / "data" / "bits.json"
MEMBERS = 300

STATISTICS = [
    lw.statistics.Mean("position"), lw.statistics.Covariance(["position", "speed"]),
    lw.statistics.Quantiles("depth", (0.05, 0.5, 0.95), size=64),
    lw.statistics.Extremes("velocity"), lw.statistics.Histogram("depth", bins=10, limits=(0.0, 30.0)),
    lw.statistics.Exceedance("depth", above=10.1),
    lw.statistics.FirstPassage("depth", above=10.1), lw.statistics.CircularMean("euler[2]"),
    lw.statistics.MeanAttitude(), lw.statistics.Mean("energy"),
    lw.statistics.PathMaximum("speed", then=[lw.statistics.Mean(), lw.statistics.Quantiles(levels=(0.5, 0.99), size=64)]),
    lw.statistics.PathTime("depth", above=10.1),
    lw.statistics.PathMean("depth"), lw.statistics.PathRms("speed"), lw.statistics.PathRange("position"),
    lw.statistics.Outcome("stopped"), lw.statistics.EndTime("failed"),
]  # fmt: skip
VARY = {
    "start.angular_velocity": lw.distributions.Normal(std=0.05),
    "start.position": lw.distributions.Normal(std=0.2),
    "vehicle.buoyancy": lw.distributions.Normal(relative=0.001),
}


def named(name, **parts):
    """Members of a named vehicle under way at a depth of 10 m."""
    start = lw.Start([0.0, 0.0, 10.0], euler_deg=[1.0, 2.0, 3.0], velocity=[1.0, 0.1, -0.1])
    scene = lw.Scene.named(name)
    return lw.Ensemble(
        lw.Scene(scene.vehicle, scene.environment, parts.pop("terms", scene.terms), start, **parts), MEMBERS, 1, VARY
    )


def paper(**ensemble):
    """Members of the paper's vehicle."""
    return lw.Ensemble(named("nordkvist_sanyal").scene, MEMBERS, 1, VARY, **ensemble)


def solved(fleet, method="psi_s", **settings):
    """A second of a run, eleven samples."""
    return lw.solve(fleet, method, **{"h": 0.02, "t1": 1.0, "save": lw.SaveAt(every=0.1), "checks": "all"} | settings)


def hashed(result):
    """Samples, outcomes, parameters and statistics of a result."""
    total = hashlib.sha256()
    parts = dict(result.samples) | {f"p/{name}": value for name, value in result.parameters.items()}
    parts |= {name: getattr(result, name) for name in ("status", "failure_time", "warnings", "warning_value")}
    for name, one in result.statistics.items():
        parts |= {f"s/{name}/{key}": value for key, value in one.arrays.items()}
    for name in sorted(parts):
        total.update(name.encode())
        total.update(np.ascontiguousarray(parts[name]).tobytes())
    return total.hexdigest()


def stored(fleet, **settings):
    """The numbers in a store: what is in no text."""
    total = hashlib.sha256()
    with tempfile.TemporaryDirectory() as folder:
        solved(fleet, store=Path(folder) / "run.zarr", **settings)
        for path in sorted(Path(folder).rglob("*")):
            # Texts tell of versions and of the machine; chunks of arrays are c.0.3.0.
            if path.is_file() and path.name.removeprefix("c").replace(".", "").isdigit() and path.suffix != ".json":
                total.update(path.relative_to(folder).as_posix().encode())
                total.update(path.read_bytes())
    return total.hexdigest()


def _terms() -> dict[str, Callable[[], str]]:
    from tests.laws.cases import CASES

    names = ("drag", "quadratic drag", "drag matrix", "current", "current profile", "tether", "wrench schedule", "thrusters",
             "waves", "Gauss-Markov current", "fins", "control fins with rates", "cross-flow", "body lift", "stratification",
             "wrench noise", "all together", "moving mass", "ballast with pumps", "buoyancy engine", "polar",
             "surface buoyancy in waves", "stratification of a hull that yields")  # fmt: skip

    # Explicit and linearly implicit methods evaluate terms by other code than a kick does.
    by_stages = (("current profile", "rk4"), ("drag matrix", "rkw3"))

    def run(name, method="psi_x"):
        return hashed(solved(named("torpedo", terms=list(CASES[name].terms)), method))

    runs = {f"term {name}": functools.partial(run, name) for name in names}
    return runs | {f"term {name} {method}": functools.partial(run, name, method) for name, method in by_stages}


def _methods() -> dict[str, Callable[[], str]]:
    settings = {
        "psi": {}, "phi": {}, "psi_1": {}, "psi_w": {}, "kl6(psi_s)": {}, "su4(psi_x)": {}, "rk4": {}, "cg3": {},
        "rkn6_11": {}, "gauss4": {}, "psi_s": {"dtype": "float32"}, "psi_x": {"dtype": "float32_compensated"},
    }  # fmt: skip
    found = {
        f"method {method} {asked.get('dtype', '')}".strip(): functools.partial(
            lambda method, asked: hashed(solved(paper(), method, **asked)), method, asked
        )
        for method, asked in settings.items()
    }
    tight = lw.Method("rk8", rtol=1e-9, atol=1e-12)
    divided = {"h": 0.4, "t1": 2.0, "save": lw.SaveAt(every=0.4), "on_failure": "substep"}
    return found | {
        "method rk8 adaptive": lambda: hashed(solved(paper(), tight)),
        "divided steps": lambda: hashed(solved(paper(), "psi_s", **divided)),
    }


def _samplings() -> dict[str, Callable[[], str]]:
    kinds = {
        "random": "random", "sobol": lw.designs.Sobol(replicates=4), "halton": lw.designs.Halton(),
        "latin hypercube": lw.designs.LatinHypercube(group=100),
    }  # fmt: skip
    return {
        f"statistics, {name}": functools.partial(
            lambda kind: hashed(solved(paper(sampling=kind), statistics=STATISTICS, keep="none")), kind
        )
        for name, kind in kinds.items()
    }


def _navigating() -> lw.Ensemble:
    """A REMUS 100 whose controller knows its motion by an IMU, a log, a depth cell and fixes that come late."""
    sensors = [
        lw.control.IMU(place=(0.1, 0.0, 0.0), accelerometer_noise=1e-3, gyroscope_noise=1e-4, accelerometer_walk=1e-4),
        lw.control.DVL(place=(-0.1, 0.0, 0.05), noise=0.01, every=2, dropout=0.1),
        lw.control.Sensor(name="cell", of="depth", noise=0.02),
        lw.control.Sensor(name="usbl", of="position", noise=0.5, every=5, latency=2),
        lw.control.ErrorStateFilter(dvl="dvl", depth="cell", delayed_fix="usbl"),
    ]
    fins = lw.control.AllocationMatrix(to="control_fins", matrix=[[0, 0, 0, 0, 0, -1], [0, 0, 0, 0, -1, 0]])
    guidance, laws = [lw.control.SetPoint(heading=0.2)], [lw.control.HeadingPID(kp=1.0, kd=2.0)]
    return named(
        "remus_100",
        controller=lw.Controller(period=0.1, sensors=sensors, guidance=guidance, laws=laws, allocation=[fins]),
    )


def _others() -> dict[str, Callable[[], str]]:
    floor = [lw.events.Floor(depth=10.1), lw.events.StopTime(at=0.73)]
    beliefs = lw.SaveAt(
        every=0.1, fields=("position", "measured_position", "estimate_sigma", "nees", "nis", "innovation")
    )
    return {
        "navigation": lambda: hashed(solved(_navigating(), "psi_x", save=beliefs)),
        **{f"vehicle {name}": functools.partial(lambda name: hashed(solved(named(name), "psi_x")), name)
           for name in ("remus_100", "bluerov2_heavy", "sphere", "seawing", "slocum")},
        "events": lambda: hashed(solved(named("remus_100", events=floor), "psi_x", statistics=STATISTICS)),
        "store": lambda: stored(paper()),
        "store with statistics": lambda: stored(paper(), statistics=STATISTICS, keep=[3, 17]),
    }  # fmt: skip


RUNS: dict[str, Callable[[], str]] = _terms() | _methods() | _samplings() | _others()


def machine() -> str:
    """Possible dependencies of bits: the processor, versions of Warp and of NumPy."""
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    vectors = next((name for name in ("avx512f", "avx2") if name in flags), "unknown")
    vendor = next((name for name in ("AuthenticAMD", "GenuineIntel") if name in flags), "unknown")
    numbers = [re.search(rf"^{name}\s*: (\d+)$", flags, re.MULTILINE) for name in ("cpu family", "model")]
    kind = " ".join(found[1] if found else "unknown" for found in numbers)
    return f"{vendor} {kind} {vectors}, warp {wp.config.version}, numpy {np.__version__}"


def recorded() -> dict[str, str]:
    """Hashes of this machine; none where nothing is known of it."""
    return json.loads(FILE.read_text()).get(machine(), {}) if FILE.exists() else {}


def given_by(root: Path, pattern: str) -> dict[str, str]:
    """Hashes of a tree's runs whose names match, by a process of its own; the tree's own file says what the runs are."""
    code = (
        "import fnmatch, json, sys; from tests.support.fixed_scenes import RUNS; "
        "found = {name: run() for name, run in RUNS.items() if fnmatch.fnmatchcase(name, sys.argv[1])}; "
        "print(json.dumps(found))"
    )
    paths = os.pathsep.join([str(root), str(root / "kernels")])
    done = subprocess.run(
        [sys.executable, "-c", code, pattern], cwd=root, env=os.environ | {"PYTHONPATH": paths},
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return json.loads(done.stdout.splitlines()[-1])


def compared(revision: str, pattern: str = "*") -> tuple[list[str], dict[str, bool]]:
    """(Runs that one tree alone has, {run of both: same bits}) of this tree and a revision, both run on this machine."""
    with tempfile.TemporaryDirectory() as folder:
        other = Path(folder) / "tree"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", str(other), revision], check=True)
        try:
            old, new = given_by(other, pattern), given_by(ROOT, pattern)
        finally:
            subprocess.run([*git, "remove", "--force", str(other)], check=True)
    return sorted(old.keys() ^ new.keys()), {name: old[name] == new[name] for name in new if name in old}


def main() -> int:
    """Compare with what is recorded, or with another revision; record."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="record the bits of this machine")
    parser.add_argument("--against", metavar="REV", help="run the tree of a git revision as well, and compare the bits")
    parser.add_argument("--only", metavar="PATTERN", default="*", help='runs whose names match, such as "method *"')
    chosen = parser.parse_args()
    if chosen.against:
        alone, same = compared(chosen.against, chosen.only)
        changed = [name for name, equal in same.items() if not equal]
        print(f"{len(same)} runs compared with {chosen.against}, {len(changed)} changed", *changed, sep="\n  ")
        if alone:
            print("in one tree only:", *alone, sep="\n  ")
        return bool(changed) or not same
    known = recorded()
    now = {name: run() for name, run in RUNS.items() if fnmatch.fnmatchcase(name, chosen.only)}
    print(f"{len(now)} runs, {sum(known.get(name) != one for name, one in now.items())} other than recorded")
    if chosen.write:
        everything = json.loads(FILE.read_text()) if FILE.exists() else {}
        FILE.write_text(json.dumps(everything | {machine(): known | now}, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
