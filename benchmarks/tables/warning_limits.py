# SPDX-License-Identifier: Apache-2.0
"""The fastest oscillation that each method bears, by h w: of the Munk moment and of a restoring moment.

They are printed as JSON lines and written into lgvi_warp/methods/stable_steps.csv, which warnings read.

Members of one run differ in w, at h = 1 s; the run is repeated between the last w that was stable and the first that was
not. Stable: the member ran to the end and its angle, 0.3 rad at the start, stayed below 1 rad. Resonances below the limit
that are narrower than a twentieth of w are passed over: at h w = 1.41 (four steps a period) many methods have one.
"""

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import show
from lgvi_warp.methods import limits
from lgvi_warp.methods.method import COMPOSITIONS, GAUSS, HALVES, PROGRAMS, RUNGE_KUTTA, TWO_PART
from lgvi_warp.physics import notation

ANGLE = 0.3
LARGEST = 1.0
MASSES = np.array([1.0, 100.0, 100.0])
GRAVITY = 9.8


def munk(w):
    """Members whose momentum, across the light axis, is 0.3 rad off its stable direction; J = I."""
    vehicle = lw.Vehicle(0.5, inertia=(1.0, 1.0, 1.0), added_mass=MASSES - 0.5, buoyancy=0.5 * GRAVITY)
    R = np.broadcast_to(notation.matrix_from_rotation_vector(np.array([0.0, 0.0, ANGLE])), (len(w), 3, 3))
    P = np.zeros((len(w), 3))
    P[:, 1] = w / np.sqrt(1.0 / MASSES[0] - 1.0 / MASSES[1])
    nu = np.einsum("nji,nj->ni", R, P) / MASSES
    zero = np.zeros((len(w), 3))
    scene = lw.Scene(vehicle, lw.Environment(gravity=GRAVITY))
    return lw.Ensemble.from_states(scene, zero, R, nu, zero), 1


def restoring(w):
    """Spheres at rest whose buoyancy acts above the centre of gravity, 0.3 rad off; J = I."""
    vehicle = lw.Vehicle(
        1.0, inertia=(1.0, 1.0, 1.0), added_mass=(1.0, 1.0, 1.0), buoyancy=GRAVITY, center_of_buoyancy=(0.0, 0.0, -0.1)
    )
    R = np.broadcast_to(notation.matrix_from_rotation_vector(np.array([ANGLE, 0.0, 0.0])), (len(w), 3, 3))
    zero = np.zeros((len(w), 3))
    arm = zero.copy()
    arm[:, 2] = -(w**2) / GRAVITY
    scene = lw.Scene(vehicle, lw.Environment(gravity=GRAVITY))
    return lw.Ensemble.from_states(scene, zero, R, zero, zero, {"vehicle.center_of_buoyancy": arm}), 2


def stable(make, method, w, steps):
    """(n,): which members stay bounded."""
    fleet, axis = make(w)
    run = lw.solve(fleet, method, h=1.0, t1=float(steps), save=lw.SaveAt(every=1.0))
    with np.errstate(invalid="ignore"):
        angle = np.arccos(np.clip(run.attitude[..., axis, axis], -1.0, 1.0))
        return (run.status == lw.Status.OK) & (np.nanmax(angle, axis=0) < LARGEST)


def limit(make, method, steps=1000, most=12.0, members=600):
    """Largest stable w of a method, to half a per cent; infinity where all are stable."""
    w = np.linspace(most / members, most, members)
    good = stable(make, method, w, steps)
    last = 0
    while last < members:
        beyond = good[last : last + max(2, last // 20)]
        if not beyond.any():
            break
        last += int(np.flatnonzero(beyond)[-1]) + 1
    if last == members:
        return np.inf
    fine = np.linspace(w[max(last - 1, 0)], w[min(last, members - 1)], 32)
    inner = stable(make, method, fine, steps)
    return float(fine[np.flatnonzero(inner)[-1]]) if inner.any() else float(fine[0])


def names():
    """Every method that there is."""
    composed = [f"{name}({base})" for name in COMPOSITIONS | HALVES for base in ("psi_s", "psi_x")]
    return [*PROGRAMS, *RUNGE_KUTTA, *TWO_PART, *composed, *GAUSS]


def add_options(parser):
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="default: all; other rows stay as they are")


def main(methods):
    rows = {name: (limits.MUNK[name], limits.RESTORING[name]) for name in limits.MUNK}
    for name in methods or names():
        # A method that has no row yet runs without these warnings.
        limits.MUNK.setdefault(name, np.inf)
        limits.RESTORING.setdefault(name, np.inf)
        measured = limit(munk, name), limit(restoring, name)
        show({"method": name, "munk": round(measured[0], 3), "restoring": round(measured[1], 3)})
        if name not in GAUSS:
            rows[name] = measured
    lines = [f"{name},{one:.2f},{other:.2f}" for name, (one, other) in rows.items()]
    limits.STABLE_STEPS.write_text("\n".join(["method,munk,restoring", *lines]) + "\n")
