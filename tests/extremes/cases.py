# SPDX-License-Identifier: Apache-2.0
"""The extremes: each case is one member, its setting in numbers, and what must come of it.

A group is one ensemble, which one kernel advances: every member at another extreme. `Status.OK` stands for: as the same map
in extended precision, to the bound that `measured` derives; any other status: flagged with it. All quantities are SI.
"""

import functools
from dataclasses import dataclass

import numpy as np

import lgvi_warp as lw
from lgvi_warp.common.status import Status
from tests.extremes import extended

OK, TOO_LARGE, NOT_CONVERGED, NON_FINITE = (
    Status.OK, Status.STEP_TOO_LARGE, Status.NOT_CONVERGED, Status.NON_FINITE)  # fmt: skip
UNIT = {"float64": 2.0**-53, "float32": 2.0**-24, "float32_compensated": 2.0**-24}
ZERO = (0.0, 0.0, 0.0)
J0, M0 = np.array([1.0, 2.0, 2.5]), np.array([10.0, 12.0, 15.0])
TILT = lw.notation.matrix_from_rotation_vector(np.array([0.4, -0.7, 0.2]))


@dataclass(frozen=True)
class Case:
    """One member. M, J: diagonals [kg, kg m2]; net weight [N]; Br: buoyancy times its arm [N m]; start; drag (6,) each.

    status: the statuses that are right, for all methods or by method. OK alone: accurate. Two: accurate or flagged, where
    round-off decides. aligned: a motion along one axis that stays there, zeros being exact.
    """

    name: str
    M: object = tuple(M0)
    J: object = tuple(J0)
    net: float = 0.0
    Br: object = ZERO
    b: object = ZERO
    R: object = None
    nu: object = ZERO
    Om: object = ZERO
    linear: object = (0.0,) * 6
    quadratic: object = (0.0,) * 6
    gravity: float = 9.8
    status: object = (OK,)
    aligned: bool = False

    def expected(self, method):
        """The statuses that are right."""
        return self.status[method] if isinstance(self.status, dict) else self.status


class Cases(list):
    """Cases, one after another."""

    def add(self, *numbers, **named):
        self.append(Case(*numbers, **named))


@dataclass(frozen=True)
class Group:
    """Cases that one kernel advances together, with this step [s] and so many steps."""

    title: str
    h: float
    steps: int
    cases: tuple
    dragged: bool = False


def array(cases, name):
    """(n, ...) of a field."""
    return np.array([np.asarray(getattr(one, name), dtype=float) for one in cases])


def ensemble(group):
    """The members of a group."""
    cases = group.cases
    M, net, g, Br = (array(cases, name) for name in ("M", "net", "gravity", "Br"))
    # Dry mass: a part of the least of M, so that added mass is positive; buoyancy then follows from the net weight.
    mass = np.minimum(M.min(axis=1), np.where(g > 0.0, np.inf, M.min(axis=1)))
    buoyancy = mass * g - net
    arm = np.divide(Br, buoyancy[:, None], out=np.zeros_like(Br), where=Br != 0.0)
    terms = [lw.terms.Drag(linear=(1.0,) * 6, quadratic=(1.0,) * 6)] if group.dragged else []
    scene = lw.Scene(lw.Vehicle(1.0, inertia=(1.0, 1.0, 1.0)), lw.Environment(gravity=9.8), terms=terms)
    parameters = {
        "vehicle.mass": mass, "vehicle.added_mass": M - mass[:, None], "vehicle.inertia": array(cases, "J"),
        "vehicle.buoyancy": buoyancy, "vehicle.center_of_buoyancy": arm, "environment.gravity": g,
    }  # fmt: skip
    if group.dragged:
        parameters |= {f"drag.{name}": array(cases, name) for name in ("linear", "quadratic")}
    return lw.Ensemble.from_states(scene, *states(cases), parameters)


def states(cases):
    """b, R, nu, Om (n, ...)."""
    R = np.array([np.eye(3) if one.R is None else one.R for one in cases])
    return array(cases, "b"), R, array(cases, "nu"), array(cases, "Om")


def twin(group):
    """Bodies and states in extended precision, from the numbers that the kernel is given."""
    fleet = ensemble(group)
    p = fleet.parameters(0, fleet.members)
    n = fleet.members
    real = extended.REAL

    def diagonal(name):
        return np.einsum("nii->ni", p[name]).astype(real)

    M = p["vehicle.mass"].astype(real)[:, None] + diagonal("vehicle.added_mass")
    # The difference of two large numbers is made in float64, whatever the kernel's precision: its round-off is the scene's.
    net = (p["vehicle.mass"] * p["environment.gravity"] - p["vehicle.buoyancy"]).astype(real)
    Br = p["vehicle.buoyancy"].astype(real)[:, None] * p["vehicle.center_of_buoyancy"]
    drag = [p.get(f"drag.{name}", np.zeros((n, 6))).astype(real) for name in ("linear", "quadratic")]
    J = diagonal("vehicle.inertia")
    b, R, nu, Om = (x.astype(real) for x in states(group.cases))
    x = extended.States(b, R, M * nu, J * Om, np.ones(n, bool))
    return extended.Bodies(M, J, net, Br, *drag), x


def oblique(length):
    """A vector of this length, along no axis."""
    return length * np.array([0.5, -0.6, 0.62]) / np.linalg.norm([0.5, -0.6, 0.62])


# Where (24) has no certain solution, and where half the angle of a turn of psi_x reaches 1 rad.
BEYOND = {"psi_s": (TOO_LARGE,), "psi_x": (OK,)}
SLENDER = {"psi_s": (OK, NOT_CONVERGED), "psi_x": (OK, TOO_LARGE, NON_FINITE)}
FLAGGED = {"psi_s": (NOT_CONVERGED, TOO_LARGE), "psi_x": (TOO_LARGE, NON_FINITE)}


def turning():
    """Free bodies: spins, tumbles, shapes, masses, the Munk oscillation, places far away."""
    h, axes = 0.1, np.eye(3)
    cases = Cases()
    for x in (1e-12, 1e-9, 1e-6, 1e-3, 0.1, 0.5, 1.0, 1.5, 1.9, 1.9999, 2.001, np.pi, 3.99, 4.01, 100.0, 1e6, 1e12):
        status = (OK,) if x < 2.0 else BEYOND if x < 4.0 else (TOO_LARGE,)
        for i in range(3):
            cases.add(f"spin about axis {i + 1}, h Om = {x:.5g}", Om=x / h * axes[i], status=status, aligned=True)
    for x in (1e-12, 1e-6, 1e-3, 0.1, 0.5, 1.0):
        cases.add(f"tumbling, h Om = {x:g}", Om=oblique(x / h), nu=oblique(0.1))
    for x in (5.0, 1e3, 1e9):
        cases.add(f"tumbling, h Om = {x:g}", Om=oblique(x / h), status=(TOO_LARGE, NON_FINITE))
    for e in (0.0, 1e-12, 1e-8, 1e-4):
        text = f"intermediate axis, h Om = 0.5, tilted by {e:g}"
        cases.add(text, Om=(5.0 * e, 5.0, 5.0 * e), aligned=e == 0.0)
    # The separatrix: 2 T J2 = |pi|^2.
    a, c = np.sqrt(J0[2] * (J0[2] - J0[1])), np.sqrt(J0[0] * (J0[1] - J0[0]))
    cases.add("on the separatrix, h Om = 0.3", Om=3.0 * np.array([a, 0.0, c]) / np.hypot(a, c))
    for r in (1e2, 1e4, 1e6):
        for x in (1e-3, 0.1, 0.5, 1.5):
            status = (OK,) if x * x * r <= 1.0 else SLENDER
            cases.add(f"rod, J = (1/{r:g}, 1, 1), h Om = {x:g}", J=(1 / r, 1.0, 1.0), Om=oblique(x / h), status=status)
        cases.add(f"rod, J = (1/{r:g}, 1, 1), spun about its length", J=(1.0 / r, 1.0, 1.0), Om=(10.0, 1e-3, 1e-3))
        status = FLAGGED | ({"psi_s": (OK, NOT_CONVERGED)} if r < 1e3 else {})
        text = f"J = (1/{r:g}, 1/{r:g}, 1): no body, h Om = 0.5"
        cases.add(text, J=(1.0 / r, 1.0 / r, 1.0), Om=oblique(5.0), status=status)
    for e in (0.0, 1e-12, 1e-9, 1e-6):
        cases.add(f"sphere, inertias {e:g} apart, h Om = 0.5", J=(1.0, 1.0 + e, 1.0 + 2.0 * e), Om=oblique(5.0))
    for e in (0.0, 1e-12, 1e-6):
        cases.add(f"plate, J1 + J2 = (1 + {e:g}) J3, h Om = 0.5", J=(1.0, 1.5, 2.5 / (1.0 + e)), Om=oblique(5.0))
    for m in (1e-6, 1e-3, 1.0, 1e3, 1e6, 1e9):
        size = (m / 1000.0) ** (1.0 / 3.0)
        J, M = m * size**2 * np.array([0.2, 0.3, 0.4]), m * np.array([1.0, 1.2, 1.5])
        cases.add(f"mass {m:g} kg", M, J, nu=oblique(0.5 * size), Om=oblique(1.0), b=(size, 0.0, -size))
    for a in (0.0, 1.0, 10.0, 100.0):
        M = (10.0, 10.0, 10.0 + 10.0 * a)
        cases.add(f"added mass {a:g} times the mass, along one axis", M, nu=oblique(0.1), Om=oblique(0.5))
    for a in (1.0, 100.0):
        M = (10.0 + 10.0 * a,) * 3
        cases.add(f"added mass {a:g} times the mass, all axes", M, nu=oblique(0.1), Om=oblique(0.5))
    for hw in (0.1, 0.5, 1.0, 1.5, 2.0, 2.2, 2.5, 3.0, 5.0):
        # Broadside motion is stable: w^2 = |p|^2 (1/M_min - 1/M_max) / J_min, here 0.3 rad from it.
        p = hw / h / np.sqrt(1.0 - 1.0 / 100.0)
        nu = p * np.array([np.sin(0.3), 0.01 * np.cos(0.3), 0.0])
        status = (OK,) if hw <= 2.0 else (TOO_LARGE,)
        text = f"Munk oscillation of 0.3 rad, M = (1, 100, 100), h w = {hw:g}"
        cases.add(text, (1.0, 100.0, 100.0), (1.0,) * 3, nu=nu, status=status)
    for r in (1e3, 1e7, 1e12):
        cases.add(f"{r:g} m from the origin", b=(r, -r, r), nu=oblique(0.5), Om=oblique(0.5))
    return Group("Free bodies", h, 60, tuple(cases))


def forced():
    """Weight, restoring moment and drag, from none to far beyond what the step resolves."""
    h = 0.1
    cases = Cases()
    J6 = np.concatenate([M0, J0])
    nu, Om = oblique(1.0), oblique(0.5)
    for k in (1e-6, 1e-3, 1.0, 1e3, 1e6):
        cases.add(f"linear drag, h l / I = {k:g}", nu=nu, Om=Om, linear=k / h * J6)
        speed = np.abs(np.concatenate([nu, Om]))
        cases.add(f"quadratic drag, h q |v| / I = {k:g}", nu=nu, Om=Om, quadratic=k / h * J6 / speed)
        one = np.where(np.arange(6) == 1, k / h * J6, 0.0)
        cases.add(f"linear drag on one axis, h l / I = {k:g}", nu=nu, Om=Om, linear=one)
        text = f"sinking, linear and quadratic drag, h l / I = {k:g}"
        cases.add(text, nu=nu, Om=Om, net=3.0, linear=k / h * J6, quadratic=k / h * J6)
    for net in (0.0, 1e-9, -1e-9, 5.0, -5.0):
        word = "neutral" if net == 0.0 else "sinking" if net > 0.0 else "rising"
        cases.add(f"{word}, net weight {net:g} N", net=net, nu=nu, Om=Om, Br=(0.0, 0.0, -1.0))
    for hw in (0.0, 1e-6, 0.1, 1.0, 1.9):
        # A pendulum about axis 1: w^2 = B r / J1, 0.3 rad from upright.
        R = lw.notation.matrix_from_rotation_vector(np.array([0.3, 0.0, 0.0]))
        arm = (0.0, 0.0, -((hw / h) ** 2) * J0[0])
        cases.add(f"upright pendulum, h w = {hw:g}", R=R, Br=arm)
    for hw in (3.0, 10.0, 1e3, 1e6):
        arm = (0.0, 0.0, -((hw / h) ** 2) * J0[0])
        cases.add(f"pendulum, h w = {hw:g}", R=TILT, Br=arm, status=(TOO_LARGE, NON_FINITE))
    for m in (1e-6, 1e9):
        size = (m / 1000.0) ** (1.0 / 3.0)
        J, M = m * size**2 * np.array([0.2, 0.3, 0.4]), m * np.array([1.0, 1.2, 1.5])
        scale = np.concatenate([M, J])
        drag = {"linear": 0.1 * scale, "quadratic": 0.1 * scale}
        arm, net = (0.0, 0.0, -0.1 * m * size**2), 0.1 * m * min(size, 1.0)
        text = f"mass {m:g} kg with weight, arm and drag"
        cases.add(text, M, J, net=net, Br=arm, nu=oblique(0.5 * size), Om=oblique(0.5), **drag)
    cases.add("no gravity", gravity=0.0, nu=nu, Om=Om, linear=0.1 * J6)
    cases.add("no gravity, buoyancy of 5 N", gravity=0.0, net=-5.0, Br=(0.0, 0.0, -0.5), nu=nu, Om=Om)
    return Group("Weight, restoring moment and drag", h, 60, tuple(cases), dragged=True)


def steps_of(h):
    """The same few bodies with a step from a nanosecond to ten seconds: h Om = 5e-11 to 0.5."""
    cases = [Case(f"h = {h:g} s", b=(1.0, -2.0, 3.0), nu=oblique(0.02), Om=oblique(0.05))]
    cases += [
        Case(f"h = {h:g} s, h Om = {x:g}", nu=oblique(0.1 / h), Om=oblique(x / h), J=100.0 * J0) for x in (0.1, 1.0)
    ]
    return Group("Short and long steps", h, 60, tuple(cases))


GROUPS = {make.__name__: make for make in (turning, forced)}
GROUPS |= {f"steps of {h:g} s": functools.partial(steps_of, h) for h in (1e-9, 1e-6, 1e-3, 1.0, 10.0)}
METHODS, DTYPES = ("psi_s", "psi_x"), ("float64", "float32")


@dataclass(frozen=True)
class Measured:
    """Outcome of a group, per member: status; error and bound of attitude and momenta (relative); of position, way [m]."""

    status: np.ndarray
    error: np.ndarray
    bound: np.ndarray
    position_error: np.ndarray
    position_bound: np.ndarray
    way: np.ndarray


# Roundings that a component goes through in a step: two drifts, two turns (or six of three shears, of which it sees four), a
# kick of three sums.
ROUNDINGS = 12
# Of the step, M, J and a force, each rounded once for all steps.
CONSTANTS = 4


def measured(group, method, dtype, truth=None, solver="quartic"):
    """Run a group and compare it with the same map in extended precision.

    Bound: a step adds ROUNDINGS units of relative error and what its solves of (24) leave, the tolerance each, with either
    sign (a random walk, three standard deviations); the kernel's rounded constants add up step by step; an error grows at
    most as perturbations of the extended run do. Positions also round where they are, in every drift.
    """
    body, _ = twin(group)
    x, growth, far, way = truth or extended_run(group, method)
    result = lw.solve(ensemble(group), lw.Method(method, solver), h=group.h, t1=group.h * group.steps, dtype=dtype)
    M, J = body.M.astype(float), body.J.astype(float)
    R, p, pi = result.attitude[-1], M * result.velocity[-1], J * result.angular_velocity[-1]
    real = extended.REAL
    y = extended.States(result.position[-1].astype(real), R.astype(real), p.astype(real), pi.astype(real), x.solvable)
    solves = 2.0 * lw.Method(method).residual_tolerance(dtype) if method == "psi_s" else 0.0
    walk = 3.0 * np.sqrt(group.steps) * (ROUNDINGS * UNIT[dtype] + solves)
    bound = growth * (walk + group.steps * CONSTANTS * UNIT[dtype])
    return Measured(
        status=np.asarray(result.status),
        error=extended.distance(x, y, body).astype(float),
        bound=bound,
        position_error=np.abs(y.b - x.b).max(axis=1).astype(float),
        position_bound=way * bound + 4.0 * UNIT[dtype] * group.steps * far,
        way=way,
    )


def extended_run(group, method):
    """The group in extended precision: final states, growth, reach and way."""
    body, x0 = twin(group)
    aligned = np.array([one.aligned for one in group.cases])
    with np.errstate(all="ignore"):
        return extended.with_growth(x0, body, group.h, group.steps, method, aligned)
