# SPDX-License-Identifier: Apache-2.0
"""The solvers of equation (24): psi_s with each of them, and the quality, range and time of single solves.

Iterating to the tolerance, and with fixed numbers of Newton steps (moser_veselov is explicit: 0 is all of it); the Riccati
equation, the paper's other reference, in NumPy only.
"""

import time
from functools import partial

import numpy as np

import lgvi_warp as lw
from benchmarks.timing import interleaved
from lgvi_warp.measuring import speed
from lgvi_warp.methods.method import SOLVERS, Method
from lgvi_warp.reference import riccati, rotation
from lgvi_warp.runs.settle import make_plan

FIXED = {"quartic": (0, 1, 2), "cayley": (0, 1, 2), "newton": (0, 1, 2), "moser_veselov": (0, 1)}
SHAPES = {"paper": (5.46, 5.29, 5.72), "general": (1.0, 2.0, 2.5), "near sphere": (1.0, 1.001, 1.002),
          "slender": (0.05, 1.0, 1.0), "plate": (1.0, 2.0, 3.0)}  # fmt: skip
# |J^-1 a| for residual and orthogonality, and for the range.
FRACTIONS = (0.003, 0.1, 0.9)
RANGE = np.arange(0.02, 1.6, 0.02)
# A residual above this is no solution.
SOLVED = 1e-4
NUMPY = {"riccati": riccati.sign, "riccati, eigenvectors": rotation.riccati, "moser_veselov": rotation.moser_veselov,
         "newton": rotation.newton, "quartic": rotation.quartic}  # fmt: skip


def methods(base, quick):
    """Every solver with every number of steps; quick: the first two, to the tolerance."""
    if quick:
        return [Method(base, name) for name in SOLVERS[:2]]
    return [Method(base, name, k, None if k is None else 0.5) for name in SOLVERS for k in (None, *FIXED[name])]


def free_body(J):
    """A free body, of which psi_1 makes one solve a step and a drift."""
    vehicle = lw.Vehicle(
        10.0, inertia=list(J), added_mass=[0.0, 0.0, 0.0], buoyancy=98.0, center_of_buoyancy=[0.0, 0.0, 0.0]
    )
    return lw.Scene(vehicle, lw.Environment(gravity=9.8))


def spinning(J, rates):
    """The free body at these rates (n, 3)."""
    n = len(rates)
    still = np.zeros((n, 3))
    return lw.Ensemble.from_states(free_body(J), still, np.tile(np.eye(3), (n, 1, 1)), still, rates)


def directions(count):
    u = np.random.default_rng(7).normal(size=(count, 3))
    return u / np.linalg.norm(u, axis=1, keepdims=True)


def by_kernel(method, dtype, J, rates):
    """F (n, 3, 3) for J^-1 a = rates (n, 3), whatever the status."""
    result = lw.solve(spinning(J, rates), method, h=1.0, t1=1.0, dtype=dtype, checks="none")
    return np.asarray(result.attitude[-1], dtype=np.float64)


def by_numpy(solve, J, rates):
    """The same; not a number where it finds none."""
    F = np.full((len(rates), 3, 3), np.nan)
    for i, rate in enumerate(rates):
        try:
            F[i] = solve(J * rate, np.diag(J))
        except ValueError:
            continue
    return F


def qualities(solve, shape, dtype, count):
    """Worst residual and orthogonality at some |J^-1 a|, and the range: up to where every direction has a solution."""
    J, u = np.array(SHAPES[shape]), directions(count)
    for fraction in FRACTIONS:
        a = (J * fraction * u).astype(dtype).astype(float)
        F = solve(J, a / J)
        worst = np.max([riccati.quality(one, b, np.diag(J)) for one, b in zip(F, a, strict=True)], axis=0)
        yield {f"at {fraction}": {"residual": float(f"{worst[0]:.1e}"), "orthogonality": float(f"{worst[1]:.1e}")}}
    rates = (RANGE[:, None, None] * u).reshape(-1, 3)
    solved = [
        riccati.quality(one, J * rate, np.diag(J))[0] < SOLVED for one, rate in zip(solve(J, rates), rates, strict=True)
    ]
    well = np.array(solved).reshape(len(RANGE), count).all(axis=1)
    first = int(np.argmin(well)) if not well.all() else len(RANGE)
    yield {"range": round(float(RANGE[first - 1]), 2) if first else 0.0}


def merged(records):
    whole = {}
    for record in records:
        whole |= record
    return whole


def steps(quick):
    """Whole steps of psi_s, as a run makes them."""
    members, count = (512, 100) if quick else (4096, 400)
    fleet = speed.fleet(members)
    for dtype in ("float64", "float32"):
        plans = [make_plan(fleet, method, h=0.01, t1=0.01 * count, dtype=dtype) for method in methods("psi_s", quick)]
        seconds = interleaved([speed.stepper(plan) for plan in plans])
        for method, one in zip(methods("psi_s", quick), seconds, strict=True):
            yield {
                "solver": method.solver,
                "iterations": method.iterations,
                "dtype": dtype,
                "ns_per_vehicle_step": round(1e9 * one / (members * count), 2),
                "over_default": round(one / seconds[0], 2),
            }


def single_solves(quick):
    """Steps of psi_1 of a free body: one solve, turning R, p and pi, and a drift. |J^-1 a| = 0.003 for the time."""
    members, count = (512, 100) if quick else (4096, 400)
    J = np.array(SHAPES["paper"])
    spin = spinning(J, 0.003 / 0.01 * directions(members))
    shapes = ("paper",) if quick else tuple(SHAPES)
    for dtype in ("float64", "float32"):
        plans = [make_plan(spin, method, h=0.01, t1=0.01 * count, dtype=dtype) for method in methods("psi_1", quick)]
        seconds = interleaved([speed.stepper(plan) for plan in plans])
        for method, one in zip(methods("psi_1", quick), seconds, strict=True):
            for shape in shapes:
                found = qualities(partial(by_kernel, method, dtype), shape, dtype, 16)
                yield {
                    "solver": method.solver,
                    "iterations": method.iterations,
                    "dtype": dtype,
                    "shape": shape,
                    "ns_per_solve_and_turn": round(1e9 * one / (members * count), 2),
                } | merged(found)
    for name, solve in NUMPY.items():
        rates = 0.003 * directions(20 if quick else 200)
        start = time.perf_counter()
        by_numpy(solve, J, rates)
        one = (time.perf_counter() - start) / len(rates)
        for shape in shapes:
            found = qualities(partial(by_numpy, solve), shape, "float64", 4)
            yield {"solver": f"{name} (NumPy)", "shape": shape, "ns_per_solve": round(1e9 * one)} | merged(found)


def run(quick):
    yield from steps(quick)
    yield from single_solves(quick)
