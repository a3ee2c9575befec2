# SPDX-License-Identifier: Apache-2.0
"""Measure the methods for coupled inertia.

Bodies, starts and truth are those of benchmarks/coupled_problems.py. One step, its structure and the general
body are measured on the NumPy twin; long runs and fleets on the kernel.
"""

import numpy as np
from scipy.optimize import root

import lgvi_warp as lw
from benchmarks import coupled_problems as case
from benchmarks.pages import markdown, stamp
from benchmarks.problems import difference, random_states, slope
from lgvi_warp.physics import energy as invariants
from lgvi_warp.reference import coupled, rotation

TWIN = {"psi_x": "x6", "psi_x8": "x8", "psi_w": "psi_w"}
COUPLINGS = (0.1, 0.5, 0.9)
ZG = (0.0, 0.0005, 0.002, 0.005, 0.0196, 0.05)


def table(caption, head, rows):
    """Markdown: a caption, a blank line, a table."""
    return f"{caption}\n\n{markdown(head, rows)}"


def few(x, digits=1):
    """A number in the form 1.2e-3."""
    mantissa, exponent = f"{x:.{digits}e}".split("e")
    return f"{mantissa}e{int(exponent)}" if x else "0"


def several(values, digits=1):
    return " / ".join(few(x, digits) for x in values)


def geometric_mean(x):
    return float(np.exp(np.mean(np.log(x))))


# Bodies and fleets


def definite(rng, least, most):
    """A random symmetric (3, 3) of random axes, eigenvalues between least and most, both of them there."""
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return Q @ np.diag([least, rng.uniform(least, most), most]) @ Q.T


def joined(M, J, k, rng):
    """I6 (6, 6) of M [kg], J [kg m2] and a random C of the coupling norm k < 1."""
    U, _, V = np.linalg.svd(rng.normal(size=(3, 3)))
    C = np.linalg.cholesky(M) @ U @ np.diag([k, *rng.uniform(-k, k, 2)]) @ V @ np.linalg.cholesky(J).T
    return np.block([[M, C], [C.T, J]])


def fleet(I6, start, weight=0.0, buoyancy=0.0, center=(0.0, 0.0, 0.0), lift=(0.0, 0.0, 0.0), terms=()):
    """An ensemble of the inertias I6 (n, 6, 6) from b, R, nu, Om (n, ...); center and lift: of gravity and buoyancy [m]."""
    rigid = 1e-3 * np.linalg.eigvalsh(I6).min() * np.eye(6)
    vehicle = lw.Vehicle(
        rigid_body_mass_matrix=rigid, added_mass_matrix=I6[0] - rigid, weight=weight, buoyancy=buoyancy,
        center_of_gravity=np.zeros(3), center_of_buoyancy=lift,
    )  # fmt: skip
    scene = lw.Scene(vehicle, lw.Environment(gravity=9.8 if weight else 0.0), terms=list(terms))
    n = len(I6)
    parameters = {
        "vehicle.added_mass_matrix": I6 - rigid,
        "vehicle.center_of_gravity": np.broadcast_to(np.asarray(center, dtype=float), (n, 3)),
    }
    return lw.Ensemble.from_states(scene, *start, parameters=parameters)


def healthy(result):
    """The result, of which no member may have failed."""
    assert set(result.status.counts()) == {"ok"}, result.status.counts()
    return result


def repeated(start, n):
    return tuple(np.broadcast_to(x, (n, *np.shape(x))) for x in start)


def last(result):
    """b, R, nu, Om of all members at the end."""
    result = healthy(result)
    return result.position[-1], result.attitude[-1], result.velocity[-1], result.angular_velocity[-1]


def hydrostatics():
    """Weight and buoyancy of the general body."""
    return {
        "weight": case.MG,
        "buoyancy": case.BUOYANCY,
        "center": (0.03, -0.02, 0.06),
        "lift": (0.01, 0.0, -0.02),
    }


# Tables


def origins():
    """The coupling norm, as the user gives it and where E is symmetric; whether it can be removed."""
    bodies = {f"REMUS 100, zg = {zg:g} m": case.remus(zg) for zg in (0.0, 0.0196, 0.05, 0.1)}
    rows = []
    for name, I6 in (bodies | {"general body": case.GENERAL}).items():
        k = [coupled.coupling(I6), coupled.coupling(coupled.shift(I6, coupled.reduce_w(I6).o[0]))]
        d, Js = coupled.removable(I6), coupled.reduce_x(I6).Js
        removed = "no" if d is None else f"yes, d = ({', '.join(f'{x + 0.0:.4f}' for x in d)}) m"
        rows.append([name, *(f"{x:.3f}" for x in k), removed, "yes" if Js[0] + Js[1] >= Js[2] else "no"])
    head = [
        "body",
        "k at the user's origin",
        "k where E is symmetric",
        "C removable",
        "Js keeps the triangle inequality",
    ]
    return table("**Coupling norm k.**", head, rows)


def general_body():
    """Errors at t = 5 against the quad-precision state."""
    runs = [
        *((method, (0.02, 0.01), (1.0,)) for method in TWIN),
        ("kl6(psi_x)", (0.1, 0.05), case.KL6),
        ("kl8(psi_x)", (0.05, 0.025), case.KL8),
    ]
    rows = []
    for method, steps, half in runs:
        stages = half if len(half) == 1 else (*half, 1.0 - 2.0 * sum(half), *reversed(half))
        e = [general_error(TWIN.get(method, "x6"), h, stages) for h in steps]
        for i, h in enumerate(steps):
            order = f"{np.log2(e[0][1] / e[1][1]):.2f}" if i else ""
            rows.append([f"`{method}`", f"{h:g}", *(few(x, 2) for x in e[i]), order])
    caption = (
        "**Errors of the general body** at t = 5 s, Euclidean norms, against the state in quad precision that "
        "`benchmarks/coupled_problems.py` holds. Order: of R, from the two steps."
    )
    return table(caption, ["method", "h [s]", "b [m]", "R", "nu [m/s]", "Om [rad/s]", "order"], rows)


def general_error(name, h, stages):
    found = case.walk(name, case.GENERAL, case.START, h, round(5.0 / h), case.hydrostatic, stages=stages)
    return case.errors(found, case.AT_5)


def orders():
    """Fitted slopes at k = .5, t = 1: on a tether; with a held wrench and three directions of drag."""
    I6, steps = case.with_coupling(0.5), np.array([0.02, 0.01, 0.005])
    exact = case.truth(I6, case.tethered, case.NEAR, 1.0)
    damped = case.truth(I6, case.held, case.START, 1.0, case.DRAGS)
    rows = []
    for method, name in TWIN.items():
        e = [case.errors(case.walk(name, I6, case.NEAR, h, round(1 / h), case.tethered), exact) for h in steps]
        d = [case.errors(damped_walk(name, I6, h), damped) for h in steps]
        rows.append([f"`{method}`", *(f"{slope(steps, x):.3f}" for x in (*np.array(e).T, *np.array(d).T))])
    quantities = ["b", "R", "nu", "Om"]
    head = ["method", *(f"{x}, tether" for x in quantities), *(f"{x}, drag" for x in quantities)]
    caption = "**Order**, fitted over h = .02, .01, .005 at t = 1 s, k = .5: on a tether; with a held wrench and drag."
    return table(caption, head, rows)


def damped_walk(name, I6, h):
    body = coupled.reduce(I6, name)
    x = body.to_reduced(*case.START)
    for _ in range(round(1.0 / h)):
        x = case.damped_step(x, body, h, name, case.held, case.DRAGS)
    return body.from_reduced(x)


def reversibility():
    """One step of h and one of -h on the tether, 20 bodies for each k."""
    rows = [[f"`{method}`", *(few(returned(name, k)) for k in COUPLINGS)] for method, name in TWIN.items()]
    caption = (
        "**Reversibility.** A step of h, then one of -h, on the tether: largest difference of b, R, nu, Om, relative "
        "to the size of each, at least 1. Worst of 20 bodies and h = .02, .05."
    )
    return table(caption, ["method", *(f"k = {k}" for k in COUPLINGS)], rows)


def returned(name, k):
    worst = 0.0
    for seed in range(20):
        body = coupled.reduce(case.with_coupling(k, seed), name)
        for h in (0.02, 0.05):
            x = body.to_reduced(*case.NEAR)
            for step in (h, -h):
                x = coupled.step(x, body, step, coupled.PROGRAMS[name], case.tethered)
            worst = max(worst, difference(body.from_reduced(x), case.NEAR))
    return worst


def symplecticity():
    """The defect |DPsi^T O DPsi - O| of a step on the tether, by differences of order 6."""
    runs = [(f"`{method}`", name, None) for method, name in TWIN.items()]
    runs += [
        (f"`psi_w`, {what}", "psi_w", n) for n, what in enumerate(("guess only", "1 Newton step", "2 Newton steps"))
    ]
    rows = []
    for label, name, newtons in runs:
        bodies = [case.with_coupling(k) for k in COUPLINGS]
        defects = [[case.symplectic_defect(name, h, I6, newtons) for h in (0.2, 0.1, 0.05)] for I6 in bodies]
        rows.append([label, *map(several, defects)])
    caption = (
        "**Symplectic defect** max |DPsi^T O DPsi - O| of one step on the tether, h = .2 / .1 / .05, by central "
        "differences of order 6. Defects below 1e-11 are their round-off."
    )
    return table(caption, ["method", *(f"k = {k}" for k in COUPLINGS)], rows)


def momenta():
    """P and L about the inertial origin without forces, kernel."""
    I6 = np.array([case.with_coupling(k) for k in COUPLINGS])
    rows = []
    for method in TWIN:
        ensemble = fleet(I6, repeated(case.START, 3))
        result = healthy(lw.solve(ensemble, method, h=0.02, t1=2000.0, save=lw.SaveAt(every=2.0)))
        P, L = invariants.linear_momentum(result), invariants.angular_momentum(result)
        size = np.linalg.norm(P[0], axis=-1)
        reach = np.linalg.norm(result.position, axis=-1)
        R = result.attitude
        drifts = {
            "P": np.linalg.norm(P - P[0], axis=-1) / size,
            "L": np.linalg.norm(L - L[0], axis=-1) / (size * np.maximum.accumulate(reach)),
            "R": np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3)).max(axis=(-2, -1)),
        }
        rows.append(
            [f"`{method}`", *(several([x[:101].max(), x.max()]) for x in drifts.values()), f"{reach.max():.0f}"]
        )
    head = ["method", "dP / P", "dL / (P max b)", "R^T R - I", "max b [m]"]
    caption = "**Momenta and orthogonality without forces**, h = .02: worst of k = .1, .5, .9 within 1e4 / 1e5 steps."
    return table(caption, head, rows)


def energy():
    """On the tether, kernel, 1e5 steps."""
    chosen = ((0.3, 0.1), (0.6, 0.1), (0.9, 0.05), (0.9, 0.1))
    rows = [[f"`{method}`", *(tether_energy(method, k, h) for k, h in chosen)] for method in TWIN]
    caption = (
        "**Energy on a tether**, 1e5 steps: max |dE|/E0 within the first / last tenth; mean of the second half less that "
        "of the first."
    )
    return table(caption, ["method", *(f"k = {k}, h = {h}" for k, h in chosen)], rows)


def tether_energy(method, k, h):
    tether = lw.terms.Tether(anchor=np.zeros(3), stiffness=case.STIFFNESS, attachment=case.KNOT)
    ensemble = fleet(case.with_coupling(k)[None], repeated(case.NEAR, 1), **hydrostatics(), terms=[tether])
    result = lw.solve(ensemble, method, h=h, t1=1e5 * h, save=lw.SaveAt(every=h))
    if result.status[0] != lw.Status.OK:
        return f"`{lw.Status(result.status[0]).name}` at {result.failure_time[0]:g} s"
    e = result.energy[:, 0] / result.energy[0, 0] - 1.0
    first, end = np.abs(e[:10_001]).max(), np.abs(e[-10_000:]).max()
    if not max(first, end) < 1.0:
        return f"> E0 from {h * np.argmax(~(np.abs(e) < 1.0)):.0f} s on, `OK`"
    return f"{several([first, end])}; {few(e[50_000:].mean() - e[:50_000].mean())}"


def munk():
    """Limit of h w before a Munk oscillation tumbles, kernel; it depends on the start."""
    angles, roll = np.array([0.01, 0.1, 0.3, 0.6, 0.3]), np.array([0.0, 0.0, 0.0, 0.0, np.pi / 4])
    side = np.stack([0 * roll, np.cos(roll), np.sin(roll)], axis=1)
    p = np.sin(angles)[:, None] * np.eye(3)[0] + np.cos(angles)[:, None] * side
    I6 = np.repeat(np.diag([1.0, 100.0, 100.0, 0.5, 1.0, 1.0])[None], 5, axis=0)
    still = np.zeros((5, 3))
    start = (still, np.repeat(np.eye(3)[None], 5, axis=0), p / [1.0, 100.0, 100.0], still)
    rows = []
    for method in (*TWIN, "psi_s", "psi_1"):
        tumbled, bounded_to = np.full(5, np.inf), np.zeros(5)
        for hw in np.round(np.arange(1.0, 2.5, 0.01), 2):
            # w^2 = |p|^2 (1 - 1/100) / J; the time grid wants h in few digits.
            h = float(f"{hw / np.sqrt(0.99):.4f}")
            result = lw.solve(fleet(I6, start), method, h=h, t1=2000 * h, save=lw.SaveAt(every=h))
            across = np.sum(result.velocity * [1.0, 100.0, 100.0] * side, axis=-1)
            stays = (across > 0.0).all(axis=0) & (result.status == lw.Status.OK)
            bounded_to = np.where(stays, hw, bounded_to)
            tumbled = np.where(stays, tumbled, np.minimum(tumbled, hw))
        rows.append([f"`{method}`", *(f"{x:.2f} / {y:.2f}" for x, y in zip(tumbled, bounded_to, strict=True))])
    caption = (
        "**Munk oscillation**, M = (1, 100, 100), J = (.5, 1, 1), no coupling: released at rest, p at an angle off "
        "broadside. First h w (from 1, steps of .01) at which p leaves its side within 2000 steps / largest at which it "
        "stays. Last column: broadside midway between axes 2 and 3."
    )
    return table(caption, ["method", ".01 rad", ".1 rad", ".3 rad", ".6 rad", ".3 rad, midway"], rows)


def remus():
    """Attitude error of REMUS at t = 5, geometric mean over 8 starts."""
    n, h, weight = 8, 0.02, 299.0
    b, R, nu, Om = random_states(4, n, speed=0.2, spin=0.3)
    start = (b, R, np.add(nu, (1.5, 0.0, 0.0)), Om)
    errors = {}
    for zg in ZG:
        I6 = case.remus(zg)

        def wrench(b, R, zg=zg):
            return np.zeros(3), rotation.cross(weight * np.array([0.0, 0.0, zg]), R[2])

        exact = [case.truth(I6, wrench, [x[i] for x in start], 5.0) for i in range(n)]
        ensemble = fleet(np.repeat(I6[None], n, axis=0), start, weight, weight, (0.0, 0.0, zg))
        for method in (*TWIN, *(["psi_s"] if zg == 0.0 else [])):
            found = last(lw.solve(ensemble, method, h=h, t1=5.0))
            e = [[np.linalg.norm(found[q][i] - exact[i][q]) for i in range(n)] for q in (1, 0)]
            errors[zg, method] = f"{several(map(geometric_mean, e))}"
    rows = [[f"{zg:g}", *(errors.get((zg, method), "refused") for method in (*TWIN, "psi_s"))] for zg in ZG]
    caption = (
        "**REMUS 100** with the centre of gravity zg below the origin, weight = buoyancy = 299 N, no drag, h = .02: error "
        "of R / of b [m] at t = 5 s, geometric means of 8 starts (1.5 m/s ahead, rates near .3 rad/s). At zg = 0 it is "
        "free in roll."
    )
    return table(caption, ["zg [m]", *(f"`{method}`" for method in (*TWIN, "psi_s"))], rows)


CLASSES = {
    "k = .15": (0.15, 3.0, 3.0),
    "k = .5": (0.5, 3.0, 3.0),
    "k = .9": (0.9, 3.0, 3.0),
    "k = .5, masses 1 : 100": (0.5, 100.0, 3.0),
    "k = .3, inertias 1 : 30": (0.3, 3.0, 30.0),
}


def random_bodies():
    """Errors of 40 random bodies of each class against kl8(psi_x), relative to psi_w's."""
    n, rng = 40, np.random.default_rng(12)
    I6 = np.array([
        joined(definite(rng, 20.0, 20.0 * masses), definite(rng, 1.0, inertias), k, rng)
        for k, masses, inertias in CLASSES.values() for _ in range(n)
    ])  # fmt: skip
    b, R, nu, Om = random_states(5, len(I6))
    pace = 3.0 / np.array([frequency(*x) for x in zip(I6, nu, Om, strict=True)])[:, None]
    ensemble = fleet(I6, (b, R, pace * nu, pace * Om), **hydrostatics())
    exact = last(lw.solve(ensemble, "kl8(psi_x)", h=0.005, t1=4.0))
    errors = {}
    for method in TWIN:
        found = last(lw.solve(ensemble, method, h=0.02, t1=4.0))
        e = np.array(
            [np.sqrt(((x - y).reshape(len(I6), -1) ** 2).sum(axis=1)) for x, y in zip(found, exact, strict=True)]
        )
        errors[method] = np.exp(np.log(e.reshape(4, -1, n)).mean(axis=2))
    rows = []
    for i, name in enumerate(CLASSES):
        ratios = [" / ".join(f"{x:.2f}" for x in (errors[m] / errors["psi_w"])[:2, i]) for m in ("psi_x", "psi_x8")]
        rows.append([name, several(errors["psi_w"][:2, i]), *ratios])
    other = np.abs(last(lw.solve(ensemble, "kl8(psi_w)", h=0.005, t1=4.0))[1] - exact[1]).max()
    caption = (
        "**Random bodies**, 40 of each class, weight and buoyancy, largest frequency of (p, pi)' 3 rad/s at the start, "
        "h = .02, t = 4 s, geometric means. Truth: `kl8(psi_x)` "
        f"at h = .005, from which `kl8(psi_w)` differs by at most {few(other)} in R."
    )
    head = ["class", "`psi_w`: error of b [m] / R", "`psi_x` over `psi_w`, b / R", "`psi_x8` over `psi_w`, b / R"]
    return table(caption, head, rows)


RATIOS = (0.0, 1.0, 10.0, 100.0)
STEPS = np.round(np.arange(0.2, 4.0, 0.05), 2)


def stability():
    """Largest h times the largest frequency at the start with |dE/E| < 10% for 3000 steps, by added mass."""
    n, rng = 40, np.random.default_rng(13)
    I6 = np.array([added(ratio, k, rng) for k in (0.0, 0.5, 0.9) for ratio in RATIOS for _ in range(n)])
    b, R, nu, Om = random_states(6, len(I6))
    w = largest_frequency(I6, (b, R, nu, Om))[:, None]
    start = (b, R, nu / w, Om / w)
    rows = []
    for method, count in (*((method, len(I6)) for method in TWIN), ("psi_s", 4 * n)):
        limit = stable(method, I6[:count], [x[:count] for x in start]).reshape(-1, len(RATIOS), n)
        for k, cells in zip((0, 0.5, 0.9), limit, strict=False):
            found = [f"{beyond(np.median(x))} ({beyond(np.percentile(x, 10))})" for x in cells]
            rows.append([f"`{method}`", f"{k:g}", *found])
    caption = (
        "**Stability** of the free body for added mass from none to 100 times the body's: largest h w (steps of .05) up to "
        "which |dE|/E < 10 % for 3000 steps; w is the largest frequency of (p, pi)' along the motion. Median (10th "
        "percentile) of 40 bodies. A member that fails counts as unstable."
    )
    return table(caption, ["method", "k", *(f"M_A/M_RB = {ratio:g}" for ratio in RATIOS)], rows)


def added(ratio, k, rng):
    """A body of 1 kg with random principal inertias and added inertia of up to ratio times its own, random axes."""
    J = np.diag(rng.uniform(0.4, 0.6, 3))
    M_A, J_A = (ratio * definite(rng, 0.01, 1.0) for _ in range(2))
    return joined(np.eye(3) + M_A, J + 0.5 * J_A, k, rng)


def frequency(I6, nu, Om):
    """The largest |eigenvalue| [1/s] of the derivative of p' = p x Om, pi' = pi x Om + p x nu by (p, pi)."""
    hat, mu = rotation.hat, I6 @ np.concatenate([nu, Om])
    P = hat(mu[:3])
    own = np.block([[-hat(Om), np.zeros((3, 3))], [-hat(nu), -hat(Om)]])
    return np.abs(
        np.linalg.eigvals(own + np.block([[np.zeros((3, 3)), P], [P, hat(mu[3:])]]) @ np.linalg.inv(I6))
    ).max()


def largest_frequency(I6, start):
    """The same along the motion, (n,) [1/s]: over 100 times 1 / frequency at the start."""
    w = np.array([frequency(*x) for x in zip(I6, *start[2:], strict=True)])
    paced = (*start[:2], *(v / w[:, None] for v in start[2:]))
    result = lw.solve(fleet(I6, paced), "kl6(psi_w)", h=0.05, t1=100.0, save=lw.SaveAt(every=0.5))
    seen = [
        [frequency(*x) for x in zip(I6, nu, Om, strict=True)]
        for nu, Om in zip(result.velocity, result.angular_velocity, strict=True)
    ]
    return w * np.max(seen, axis=0)


def beyond(limit):
    """The limit, or that it lies beyond the steps tried."""
    return f"{limit:.2f}" if limit < STEPS[-1] else f"> {STEPS[-1]:.2f}"


def stable(method, I6, start):
    """The limit (n,) of each member."""
    alive, limit = np.ones(len(I6), dtype=bool), np.zeros(len(I6))
    for h in STEPS:
        fields = ("velocity", "angular_velocity")
        saved = lw.SaveAt(every=float(10 * h), fields=fields)
        result = lw.solve(fleet(I6, start), method, h=float(h), t1=float(3000 * h), save=saved)
        v = np.concatenate([result.velocity, result.angular_velocity], axis=-1)
        with np.errstate(over="ignore", invalid="ignore"):
            E = np.sum(v * (I6 @ v[..., None])[..., 0], axis=-1)
            kept = (np.abs(E / E[0] - 1.0) < 0.1).all(axis=0)
        alive &= kept & (result.status == lw.Status.OK)
        limit = np.where(alive, h, limit)
        if not alive.any():
            break
    return limit


def solvability():
    """Share of cases in which W has no solution below the bound h (|Om| + |Js^-1 S p| + |Js^-1 Sd p|)."""
    count, rows = 2000, []
    for bound in (0.7, 0.8, 0.9, 0.99):
        rng = np.random.default_rng(6)
        unsolved = [x for x in (bounded(rng, bound) for _ in range(count)) if not solved(*x)]
        ends = [branch_end(*x) * bound for x in unsolved]
        rows.append(
            [f"{bound:g}", f"{len(unsolved)} of {count}", f"{min(ends):.2f} to {max(ends):.2f}" if ends else ""]
        )
    caption = (
        "**Solutions of W** by s = h (|Om| + |Js^-1 S p| + |Js^-1 Sd p|), random bodies of k = .1 to .9. Folds: where the "
        "solution of such a case, followed from s = 0, comes to an end."
    )
    return table(caption, ["s", "no solution found", "folds at s"], rows)


def bounded(rng, bound):
    """A random reduced body, and h p, h pi for which the sum is the bound."""
    body, p, pi = case.w_case(rng, 1.0, 10.0 ** rng.uniform(-2, 1))
    parts = ((pi - body.S @ p), body.S @ p, rotation.modified_inertia(body.S) @ p)
    h = bound / sum(rotation.norm(part / body.Js) for part in parts)
    return body, h * p, h * pi


def solved(body, P, Pi):
    try:
        coupled.w_parameter(Pi - body.S @ P, P, body.Js, body.S, None)
    except ValueError:
        return False
    return True


def branch_end(body, P, Pi):
    """The fraction of P, Pi up to which the solution from c = 0 can be followed."""
    c, reached = np.zeros(3), 0.0
    for fraction in np.arange(0.005, 1.0001, 0.005):

        def value(c, p=fraction * P, pi=fraction * Pi):
            al = pi - body.S @ p + coupled.w_turning(c, body.S) * p
            return al - coupled.w_matrix(2.0 * body.Js, c, al, rotation.modified_inertia(body.S) @ p) @ c

        found = root(value, c, tol=1e-12)
        if not found.success or np.abs(found.x - c).max() > 0.5:
            break
        c, reached = found.x, fraction
    return reached


TABLES = (
    origins, general_body, orders, reversibility, symplecticity, momenta, energy, munk, stability, random_bodies, remus,
    solvability,
)  # fmt: skip


def main():
    return "\n\n".join([stamp("coupled"), *(make() for make in TABLES)])
