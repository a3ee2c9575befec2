# SPDX-License-Identifier: Apache-2.0
"""Energy and momentum over a million steps of every method, beside its cost: a vehicle on a tether."""

import sys

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import line, markdown, stamp
from benchmarks.timing import interleaved
from lgvi_warp.measuring import speed
from lgvi_warp.physics import notation, terms
from lgvi_warp.runs.settle import make_plan

STEP, STEPS, MEMBERS, SAMPLES = 0.05, 1_000_000, 64, 1000
M, J = np.array([188.8, 193.8, 198.8]), np.array([5.46, 5.29, 5.72])
METHODS = ("psi_s", "psi_1", "psi_x", "psi_x8", "psi", "phi", "su4(psi_s)", "su4(psi_x)", "kl6(psi_x)", "kl8(psi_x)",
           "ss6_13(psi_x)", "su8_15(psi_x)", "bm4(psi_x)", "bm6(psi_x)", "cg3", "rkmk4", "rk4", "rk5", "rk8")  # fmt: skip


def scene():
    """The vehicle, weightless, on its tether."""
    vehicle = lw.Vehicle(123.8, inertia=J, added_mass=M - 123.8, buoyancy=0.0)
    return lw.Scene(vehicle, lw.Environment(gravity=0.0), [terms.Tether(anchor=[0.0, 0.0, 0.0], stiffness=20.0)])


def fleet():
    """Members 3 m from the anchor, about 0.5 m/s and 0.3 rad/s, each in its own direction."""
    rng = np.random.default_rng(1)
    b, nu, Om = (size * rng.normal(size=(MEMBERS, 3)) for size in (2.0, 0.3, 0.2))
    R = notation.matrix_from_rotation_vector(rng.normal(size=(MEMBERS, 3)))
    return lw.Ensemble.from_states(scene(), b, R, nu, Om)


def momentum(result):
    """Angular momentum about the anchor (k, n, 3) [N m s]."""
    R = result.attitude
    P = np.einsum("knij,knj->kni", R, M * result.velocity)
    return np.einsum("knij,knj->kni", R, J * result.angular_velocity) + np.cross(result.position, P)


def row(method, dtype, members):
    """The cells of one method: everything but its cost."""
    save = lw.SaveAt(every=STEP * STEPS / SAMPLES)
    result = lw.solve(members, method, h=STEP, t1=STEP * STEPS, save=save, dtype=dtype)
    well = np.asarray(result.status) == 0
    if not well.any():
        return [", ".join(result.status.counts()), "", "", ""]
    E, L = result.energy[:, well].astype(float), momentum(result)[:, well].astype(float)
    error = E / E[0] - 1.0
    half = SAMPLES // 2
    t = result.time[half:] / result.time[-1] - 0.75
    slopes = t @ error[half:] / (t @ t)
    mean, spread = slopes.mean(), slopes.std(ddof=1) / np.sqrt(len(slopes))
    turned = np.linalg.norm(L[-1] - L[0], axis=-1) / np.linalg.norm(L[0], axis=-1)
    lost = "" if well.all() else f" ({(~well).sum()} failed)"
    return [f"{np.abs(error).max():.1e}{lost}", f"{mean:+.1e}", f"{abs(mean) / spread:.1f}", f"{turned.max():.1e}"]


def table(dtype, members):
    """The table of one precision."""
    known = []
    for method in METHODS:
        try:
            known.append((method, make_plan(members, method, h=STEP, t1=100 * STEP, dtype=dtype)))
        except lw.SceneError as error:
            print(error, file=sys.stderr)
    seconds = interleaved([speed.stepper(plan) for _, plan in known], 7)
    rows = []
    for (method, _), one in zip(known, seconds, strict=True):
        rows.append([f"`{method}`", *row(method, dtype, members), f"{1e9 * one / (100 * MEMBERS):.1f}"])
        print(line(rows[-1]), file=sys.stderr, flush=True)
    head = ["method", "energy error", "slope x time", "standard errors", "momentum error", "cost [ns]"]
    return f"## {dtype}\n\n{markdown(head, rows, 'lrrrrr')}"


def main():
    members = fleet()
    return "\n\n".join([stamp("drift"), *(table(dtype, members) for dtype in ("float64", "float32"))])
