"""Methods as data: a program of sub-maps with coefficients, composed with itself by stage coefficients.

Sub-maps (mathematics in the README's table): T and K the flows of kinetic energy p.M^-1 p / 2 and of the potential, D the
discrete Moser-Veselov rotation of equation (24), Ab and Ap the two halves of T. The leftmost is applied first.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from lgvi_warp.errors import Faults
from lgvi_warp.tableaux import CG3, DOP853, DOPRI5, RK4, Tableau

Program = tuple[tuple[str, float], ...]

# Phi: (10)-(14), Phi*: (19)-(23), Psi_h = Phi*_{h/2} after Phi_{h/2}, all of Nordkvist & Sanyal 2010 (conservative scenes).
# Psi's two Ap(h/2) meet in the middle and act as one, since Ap changes neither p nor R.
# psi_s, psi_1: symmetric splittings into symplectic flows, with two and with one solve of equation (24).
PROGRAMS: dict[str, Program] = {
    "phi": (("Ab", 1.0), ("D", 1.0), ("K", 1.0), ("Ap", 1.0)),
    "phi_adjoint": (("Ap", 1.0), ("K", 1.0), ("D", 1.0), ("Ab", 1.0)),
    "psi": (("Ab", 0.5), ("D", 0.5), ("K", 0.5), ("Ap", 1.0), ("K", 0.5), ("D", 0.5), ("Ab", 0.5)),
    "psi_s": (("T", 0.5), ("D", 0.5), ("K", 1.0), ("D", 0.5), ("T", 0.5)),
    "psi_1": (("K", 0.5), ("T", 0.5), ("D", 1.0), ("T", 0.5), ("K", 0.5)),
    # Turns about the axes instead of D, which solves no equation; R2 twice as often for slender bodies (psi_x8).
    "psi_x": (("T", 0.5), ("R1", 0.5), ("R2", 0.5), ("R3", 0.5), ("K", 1.0), ("R3", 0.5), ("R2", 0.5), ("R1", 0.5),
              ("T", 0.5)),
    "psi_x8": (("T", 0.5), ("R1", 0.5), ("R2", 0.25), ("R3", 0.5), ("R2", 0.25), ("K", 1.0), ("R2", 0.25), ("R3", 0.5),
               ("R2", 0.25), ("R1", 0.5), ("T", 0.5)),
    # The coupled Moser-Veselov rotation W: as D, for M and J coupled.
    "psi_w": (("T", 0.5), ("W", 0.5), ("K", 1.0), ("W", 0.5), ("T", 0.5)),
}  # fmt: skip
# With nonconservative forces the paper's own maps, whole: equations (15), (16).
FORCED: dict[str, Program] = {
    "phi": (("Phi", 1.0),),
    "phi_adjoint": (("Phi*", 1.0),),
    "psi": (("Phi", 0.5), ("Phi*", 0.5)),
}
# Explicit methods, which know no sub-maps. KINDS: those that keep R on the group (see lgvi_kernels.explicit).
EXPLICIT: dict[str, Tableau] = {"rk4": RK4, "rk5": DOPRI5, "rk8": DOP853, "cg3": CG3, "rkmk4": RK4}
KINDS = {"cg3": "group", "rkmk4": "munthe_kaas"}
ORDERS = {"phi": 1, "phi_adjoint": 1, "psi": 2, "psi_s": 2, "psi_1": 2, "psi_x": 2, "psi_x8": 2, "psi_w": 2} | {
    name: tableau.order for name, tableau in EXPLICIT.items()
}

# One sub-map of the letter may be divided in two, or two joined: each is the flow of something.
FLOWS = ("T", "K", "Ab", "Ap")

SOLVERS = ("quartic", "cayley", "newton")


def _palindrome(*outer: float) -> tuple[float, ...]:
    return (*outer, 1.0 - 2.0 * sum(outer), *reversed(outer))


_G3 = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
_G5 = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))

# name -> (order, stage coefficients), for a symmetric base of order 2. Hairer, Lubich & Wanner, Geometric Numerical
# Integration, 2nd ed., II.4 (triple jump, Suzuki) and V.3.2 (Kahan & Li 1997).
COMPOSITIONS: dict[str, tuple[int, tuple[float, ...]]] = {
    "tj4": (4, _palindrome(_G3)),
    "su4": (4, _palindrome(_G5, _G5)),
    "kl6": (
        6,
        _palindrome(0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023),
    ),
    "kl8": (
        8,
        _palindrome(
            0.13020248308889008088,
            0.56116298177510838456,
            -0.38947496264484728641,
            0.15884190655515560090,
            -0.39590389413323757734,
            0.18453964097831570709,
            0.25837438768632204729,
            0.29501172360931029887,
        ),
    ),
}


@dataclass(frozen=True)
class Method:
    """A method by name, and how equation (24) is solved inside it.

    name: "phi", "phi_adjoint", "psi" (the paper's), "psi_s" (default), "psi_1", or a composition of a symmetric one:
    "tj4(psi_s)", "su4(psi_s)", "kl6(psi_1)", "kl8(psi_s)", ...
    solver: "quartic" (default), "cayley" or "newton" (the paper's, on the exponential map).
    iterations: Newton steps of every solve, a whole number >= 0; None iterates each vehicle to the tolerance.
    alpha, beta: weight of the old configuration in the averages of equations (15) and (16), 0 to 1, for nonconservative
    forces and torques in phi, phi_adjoint and psi (their conservative forces, and the other methods, have no such choice).
    The name may also be of an explicit method: "rk4", "rk5" (Dormand & Prince), "rk8" (DOP853's), with R as nine numbers, or
    on the rotation group "cg3" (Crouch & Grossman) and "rkmk4" (Munthe-Kaas).
    rtol, atol: with both, rk5 and rk8 choose their steps: the error estimated for each step stays below
    atol + rtol |y| (in the mean square over y = (b, R, p, pi), momenta divided by the largest J). The worst vehicle of a
    packet decides for it. h then is the longest step: where samples, events and statuses may be.
    tolerance: relative residual of equation (24) above which a solve is not converged (default 1e-14 in float64 and
    1e-6 in float32 when iterating to it; 1e-12 and 1e-5 for a fixed number of iterations).

    Raises SceneError (a ValueError) naming every fault.
    """

    name: str = "psi_s"
    solver: str = "quartic"
    iterations: int | None = None
    tolerance: float | None = None
    alpha: float = 0.5
    beta: float = 0.5
    rtol: float | None = None
    atol: float | None = None

    def __post_init__(self) -> None:
        faults = Faults()
        base, composition = self._split()
        faults.choice("method", base, PROGRAMS | EXPLICIT)
        if composition is not None:
            faults.choice("method composition", composition, COMPOSITIONS)
            if ORDERS.get(base) == 1 or base in EXPLICIT:
                faults.add("method", self.name, "is a composition of a method that is not symmetric", "compose psi_s")
        faults.choice("solver", self.solver, SOLVERS)
        n = self.iterations
        if n is not None and (isinstance(n, bool) or not isinstance(n, int) or not 0 <= n <= 100):
            faults.add("iterations", n, "is not a whole number from 0 to 100", "give one, or None for the tolerance")
        for name in ("alpha", "beta"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
                faults.add(name, value, "is not a number from 0 to 1", "give the weight of the old configuration")
        if self.tolerance is not None and not 0.0 < self.tolerance < 1.0:
            faults.add("tolerance", self.tolerance, "is not between 0 and 1", "give a relative residual such as 1e-12")
        self._check_steps(faults)
        faults.raise_if_any()

    def _check_steps(self, faults: Faults) -> None:
        """Both tolerances or none, and only for a method that estimates its error."""
        given = {name: value for name in ("rtol", "atol") if (value := getattr(self, name)) is not None}
        for name, value in given.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 < value < 1.0:
                faults.add(name, value, "is not between 0 and 1", "give a tolerance such as 1e-9")
        if len(given) == 1:
            faults.add(*given.popitem(), "has no counterpart", "give both rtol and atol, or none for a fixed step")
        elif given and self.name in ORDERS and not (self.tableau and self.tableau.errors):
            able = " or ".join(name for name, tableau in EXPLICIT.items() if tableau.errors)
            faults.add("rtol, atol", self.name, "estimates no error", f"use {able}, or leave them out")

    def _split(self) -> tuple[str, str | None]:
        match = re.fullmatch(r"(\w+)\((\w+)\)", str(self.name))
        return (match[2], match[1]) if match else (str(self.name), None)

    @property
    def base(self) -> str:
        """The method that is composed, or that this is."""
        return self._split()[0]

    @property
    def program(self) -> Program:
        """The sub-maps of one stage, the first applied first."""
        return PROGRAMS.get(self.base, ())

    @property
    def tableau(self) -> Tableau | None:
        """The numbers of an explicit method."""
        return EXPLICIT.get(self.name)

    @property
    def adaptive(self) -> bool:
        """Whether each packet chooses its steps."""
        return self.rtol is not None

    @property
    def turns(self) -> bool:
        """Whether it turns about the axes one after the other, instead of solving equation (24)."""
        return any(letter[0] == "R" for letter, _ in self.program)

    @property
    def stages(self) -> tuple[float, ...]:
        """The stage coefficients g_i: one step is the program with g_1 h, then with g_2 h, ..."""
        composition = self._split()[1]
        return (1.0,) if composition is None else COMPOSITIONS[composition][1]

    @property
    def order(self) -> int:
        """Order of convergence."""
        base, composition = self._split()
        return ORDERS[base] if composition is None else COMPOSITIONS[composition][0]

    def force_tolerance(self, dtype: str) -> float:
        """Relative change of the momenta below which the iteration for the forces of Phi* has settled."""
        return 1e-14 if dtype == "float64" else 1e-6

    def tolerances(self, dtype: str) -> tuple[float, float]:
        """The two tolerances that a kernel gets: of (24) and of the forces of Phi*, or rtol and atol of the steps."""
        if self.rtol is not None and self.atol is not None:
            return self.rtol, self.atol
        return self.residual_tolerance(dtype), self.force_tolerance(dtype)

    def residual_tolerance(self, dtype: str) -> float:
        """The tolerance in force for this dtype."""
        if self.tolerance is not None:
            return self.tolerance
        if self.iterations is None:
            return 1e-14 if dtype == "float64" else 1e-6
        return 1e-12 if dtype == "float64" else 1e-5


def merged(program: Program) -> tuple[tuple[str, float] | None, Program]:
    """(lead, maps): a flow that both opens and closes the program joins that of the next step; lead is its half."""
    first, last = program[0], program[-1]
    if len(program) > 1 and first == last and first[0] in FLOWS:
        return first, program[1:-1]
    return None, program


def with_hops(program: Program) -> Program:
    """With the hops between the origins of the axes, where inertia is coupled: each turn is about its own."""
    hopped: list[tuple[str, float]] = []
    here = 1
    for letter, coefficient in program:
        if letter[0] == "R":
            there = int(letter[1])
            while here != there:
                step = 1 if there > here else -1
                hopped.append((f"h{here}{here + step}", 1.0))
                here += step
        hopped.append((letter, coefficient))
    return tuple(hopped)


def middle_axis(program: Program) -> int:
    """The axis (1 to 3) at whose origin a program of turns kicks: that of the turn before K."""
    letters = [letter for letter, _ in program]
    return int(letters[letters.index("K") - 1][1])


def simplified(program: Program, isotropic: bool) -> Program:
    """Without the Munk moment when M = m I: it is zero, and computing it would be pure round-off torque."""
    if not isotropic:
        return program
    return tuple(("Ab" if letter == "T" else letter, c) for letter, c in program if letter != "Ap")
