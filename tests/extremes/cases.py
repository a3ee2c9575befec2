"""The extremes: each case is one member, its setting in numbers, and what must come of it.

A group is one ensemble, which one kernel advances: every member at another extreme. `Status.OK` stands for: as the same map
in extended precision, to the bound that `measured` derives; any other status: flagged with it. All quantities are SI.
"""

from dataclasses import dataclass, field

import numpy as np

import lgvi_warp as lw
from lgvi_warp.status import Status
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

    status: by precision, or one for all. why: what the case is about, where its name does not say it.
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
    status: object = OK

    def expected(self, dtype):
        """The status in this precision."""
        return self.status[dtype] if isinstance(self.status, dict) else self.status


@dataclass(frozen=True)
class Group:
    """Cases that one kernel advances together, with this step [s] and so many steps."""

    name: str
    h: float
    steps: int
    cases: tuple
    dragged: bool = False
    methods: tuple = ("psi_s", "psi_x")
    dtypes: tuple = ("float64", "float32")
    about: str = ""
    extra: dict = field(default_factory=dict)


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
    terms = [lw.Drag(linear=(1.0,) * 6, quadratic=(1.0,) * 6)] if group.dragged else []
    scene = lw.Scene(lw.Vehicle(1.0, (1.0, 1.0, 1.0)), lw.Environment(gravity=9.8), terms=terms)
    parameters = {
        "vehicle.mass": mass,
        "vehicle.added_mass": M - mass[:, None],
        "vehicle.inertia": array(cases, "J"),
        "vehicle.buoyancy": buoyancy,
        "vehicle.center_of_buoyancy": arm,
        "environment.gravity": g,
    }
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
