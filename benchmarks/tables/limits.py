# SPDX-License-Identifier: Apache-2.0
"""Measure the largest stable step of every method, on motions of one rate: JSON lines, then the table.

A run has one step, so the rate varies: by the speed (Munk oscillation), the arm of buoyancy (restoring oscillation), the drag
coefficient and the spin, over the members of one run. Where a limit lies between two members, a second run looks there.
"""

import functools
import math

import numpy as np

import lgvi_warp as lw
from benchmarks.pages import markdown, show
from lgvi_warp.accuracy.stability.limits import LIMITS
from lgvi_warp.physics import notation

METHODS = (
    "phi", "psi", "psi_s", "psi_1", "psi_x", "psi_x8", "psi_w", "tj4(psi_s)", "su4(psi_s)", "kl6(psi_s)", "kl8(psi_s)",
    "su4(psi_x)", "kl6(psi_x)", "kl8(psi_x)", "ss6_13(psi_x)", "bm4(psi_x)", "bm6(psi_x)", "rkn4_6", "rkn6_11", "rkn6_14",
    "gauss4", "gauss6", "gauss8", "cg3", "rkmk4", "rk4", "rk5", "rk5_ck", "rk8",
)  # fmt: skip
EXPLICIT_DRAG = ("phi", "psi", "cg3", "rkmk4", "rk4", "rk5", "rk5_ck", "rk8")
SMALL, LARGE = 1e-3, 0.3
# An oscillation is lost beyond so many times the angle that it was released at.
WITHIN = {SMALL: 10.0, LARGE: 2.0}
STEPS, SAMPLES = 4000, 400
MASS = (1.0, 100.0, 100.0)


def still(n):
    """Numbers of n members that are zero."""
    return np.zeros((n, 3))


def tilted(n, axis, angle):
    """R (n, 3, 3), turned about an axis."""
    return notation.matrix_from_rotation_vector(np.tile(angle * np.eye(3)[axis], (n, 1)))


def run(fleet, method, steps=STEPS, samples=SAMPLES):
    """The result after so many steps of 1 s."""
    return lw.solve(fleet, method, h=1.0, t1=float(steps), save=lw.SaveAt(every=float(steps // samples)), threads=1)


def stays(result, axis, angle):
    """Whether a body axis keeps within WITHIN times the angle of where it rests, and no status was given: (n,)."""
    cosine = result.attitude[..., axis, axis]
    with np.errstate(invalid="ignore"):
        near = np.all(2.0 * np.arcsin(np.sqrt(np.clip(0.5 * (1.0 - cosine), 0.0, 1.0))) < WITHIN[angle] * angle, axis=0)
    return near & (result.status == lw.Status.OK)


def munk(method, hw, angle):
    """Whether a Munk oscillation that was released at an angle stays."""
    return stays(munk_run(method, hw, angle), 1, angle)


def munk_run(method, hw, angle, steps=STEPS, samples=SAMPLES):
    """Released at rest with the momentum `angle` off broadside, w = |p| sqrt((1 - 1/100) / J), J = 1."""
    n = len(hw)
    R = tilted(n, 2, angle)
    p = R[:, 1, :] * (hw / np.sqrt(1.0 - 0.01))[:, None]
    scene = lw.Scene(
        lw.Vehicle(0.5, inertia=(1.0, 1.0, 1.0), added_mass=np.array(MASS) - 0.5), lw.Environment(gravity=0.0)
    )
    fleet = lw.Ensemble.from_states(scene, still(n), R, p / MASS, still(n))
    return run(fleet, method, steps, samples)


def restoring(method, hw, angle):
    """Released at rest, tilted, no speed and no added mass: w = sqrt(B |r| / J), B = 9.8 N, J = 1."""
    n = len(hw)
    scene = lw.Scene(
        lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0), added_mass=None, buoyancy=9.8), lw.Environment(gravity=9.8)
    )
    arm = np.outer(hw**2 / 9.8, [0.0, 0.0, -1.0])
    states = (still(n), tilted(n, 0, angle), still(n), still(n))
    fleet = lw.Ensemble.from_states(scene, *states, {"vehicle.center_of_buoyancy": arm})
    return stays(run(fleet, method), 2, angle)


def drag(method, numbers, _):
    """Linear drag of a body of mass 1 that moves straight: whether its speed stays below the start's."""
    n = len(numbers)
    vehicle = lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0), added_mass=None, buoyancy=0.0)
    scene = lw.Scene(vehicle, lw.Environment(gravity=0.0), terms=[lw.terms.Drag(linear=[1.0, 0, 0, 0, 0, 0])])
    linear = np.outer(numbers, np.eye(6)[0])
    velocity = np.tile([1.0, 0.0, 0.0], (n, 1))
    fleet = lw.Ensemble.from_states(scene, still(n), tilted(n, 0, 0.0), velocity, still(n), {"drag.linear": linear})
    result = run(fleet, method)
    with np.errstate(invalid="ignore"):
        return np.all(np.abs(result.velocity[..., 0]) <= 1.0, axis=0) & (result.status == lw.Status.OK)


def rotation(method, numbers, _):
    """Steady spin about the axis of the largest inertia: whether no status was given and R has not grown tenfold."""
    n = len(numbers)
    scene = lw.Scene(lw.Vehicle(1.0, inertia=(0.6, 0.8, 1.0)), lw.Environment(gravity=0.0))
    fleet = lw.Ensemble.from_states(scene, still(n), tilted(n, 0, 0.0), still(n), np.outer(numbers, np.eye(3)[2]))
    result = run(fleet, method)
    with np.errstate(invalid="ignore"):
        kept = np.all(np.abs(result.attitude).max(axis=(-2, -1)) < 10.0, axis=0)
    return kept & (result.status == lw.Status.OK)


MOTIONS = {"munk": munk, "restoring": restoring, "drag": drag, "rotation": rotation}


def measured(motion, method, angle=SMALL, low=0.0, high=8.0, members=256):
    """(first, last): the first limit from `low` on, to 1 part in 1000, and the largest number that is stable at all.

    Infinite where every member is stable up to `high`; first is 0 where none is.
    """
    stable = MOTIONS[motion]
    numbers = low + (high - low) * np.arange(1, members + 1) / members
    if low < LIMITS[motion](method) < high:
        # Some methods lose a small motion in a window narrower than the distance of two members: members stand there too.
        numbers = np.union1d(numbers, LIMITS[motion](method) + 0.001 * np.arange(-20, 21))
    good = stable(method, numbers, angle)
    if good.all():
        return math.inf, math.inf
    i = int(np.argmin(good))
    last = float(numbers[good].max(initial=0.0))
    below = numbers[i - 1] if i else low
    fine = below + (numbers[i] - below) * np.arange(1, 65) / 64
    bad = ~stable(method, fine, angle)
    j = int(np.argmax(bad))
    first = float(fine[j - 1] if j else below)
    return first, max(first, last)


@functools.cache
def record(method):
    """Everything that is measured of a method, beside linear theory."""
    found = {"method": method}
    for motion in MOTIONS:
        if motion == "drag" and method not in EXPLICIT_DRAG:
            continue
        for angle in (SMALL, LARGE) if motion in ("munk", "restoring") else (0.0,):
            high = 8.0 if motion != "rotation" else 12.0
            first, last = measured(motion, method, angle, high=high)
            key = f"{motion}_{angle:g}" if angle else motion
            found |= {f"{key}_first": first, f"{key}_last": last}
        found[f"{motion}_theory"] = LIMITS[motion](method)
    return found


def shown(x):
    """A limit in three digits."""
    return "none" if math.isinf(x) else "-" if math.isnan(x) else f"{x:.2f}"


def pair(first, last):
    """The first limit, and how far stable windows reach above it."""
    return shown(first) if last < 1.02 * first or math.isinf(first) else f"{shown(first)} (to {shown(last)})"


def table(records):
    """Markdown."""
    head = ("method", "Munk, small", ".3 rad", "restoring, small", ".3 rad", "linear theory", "drag, explicit", "theory",
            "h \\|Omega\\|", "theory")  # fmt: skip
    rows = []
    for r in records:
        cells = [
            pair(r[f"{m}_{a:g}_first"], r[f"{m}_{a:g}_last"]) for m in ("munk", "restoring") for a in (SMALL, LARGE)
        ]
        explicit = "drag_first" in r
        rows.append([f"`{r['method']}`", *cells, shown(r["munk_theory"]),
                     shown(r["drag_first"]) if explicit else "", shown(r["drag_theory"]) if explicit else "",
                     shown(r["rotation_first"]), shown(r["rotation_theory"])])  # fmt: skip
    return markdown(head, rows)


def add_options(parser):
    parser.add_argument("methods", nargs="*", metavar="METHOD", help="only these, printed and not written")


def main(methods):
    records = []
    for method in methods or METHODS:
        records.append(record(method))
        show({k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in records[-1].items()})
    if not methods:
        return table(records)
    print(table(records))
