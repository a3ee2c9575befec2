# SPDX-License-Identifier: Apache-2.0
"""Methods as data: a program of sub-maps with coefficients, composed with itself by stage coefficients.

Sub-maps (mathematics in the README's table): T and K are the flows of the kinetic energy p.M^-1 p / 2 and of the potential,
D is the discrete Moser-Veselov rotation of equation (24), Ab and Ap are the two halves of T. The leftmost is applied first.
"""

from __future__ import annotations

import functools
import re
from dataclasses import dataclass, field, fields
from typing import Any

from lgvi_warp.common import summaries
from lgvi_warp.common.declared import checked, read, word
from lgvi_warp.common.documented import Documented
from lgvi_warp.common.errors import Faults, among
from lgvi_warp.common.summaries import Summarized
from lgvi_warp.methods.tableaux import CASH_KARP, CG3, DOP853, DOPRI5, RK4, RKW3, Tableau

Program = tuple[tuple[str, float], ...]

# Phi: (10)-(14), Phi*: (19)-(23), Psi_h = Phi*_{h/2} after Phi_{h/2}, all of Nordkvist & Sanyal 2010 (conservative scenes).
# Psi's two Ap(h/2) meet in the middle and act as one, since Ap changes neither p nor R.
# psi_s, psi_1: symmetric splittings into symplectic flows, with two and with one solve of equation (24).
# docs/theory/coupled.md, (X12), (X17); docs/theory/integrator.md, (I9); docs/theory/splitting.md, (S6), (S7), (S8).
PROGRAMS: dict[str, Program] = {
    "phi": (("Ab", 1.0), ("D", 1.0), ("K", 1.0), ("Ap", 1.0)),
    "phi_adjoint": (("Ap", 1.0), ("K", 1.0), ("D", 1.0), ("Ab", 1.0)),
    "psi": (("Ab", 0.5), ("D", 0.5), ("K", 0.5), ("Ap", 1.0), ("K", 0.5), ("D", 0.5), ("Ab", 0.5)),
    "psi_s": (("T", 0.5), ("D", 0.5), ("K", 1.0), ("D", 0.5), ("T", 0.5)),
    "psi_1": (("K", 0.5), ("T", 0.5), ("D", 1.0), ("T", 0.5), ("K", 0.5)),
    # Turns about the axes instead of D: no equation to solve. psi_x8 turns about axis 2 twice as often, for slender bodies.
    "psi_x": (("T", 0.5), ("R1", 0.5), ("R2", 0.5), ("R3", 0.5), ("K", 1.0), ("R3", 0.5), ("R2", 0.5), ("R1", 0.5),
              ("T", 0.5)),
    "psi_x8": (("T", 0.5), ("R1", 0.5), ("R2", 0.25), ("R3", 0.5), ("R2", 0.25), ("K", 1.0), ("R2", 0.25), ("R3", 0.5),
               ("R2", 0.25), ("R1", 0.5), ("T", 0.5)),
    # The coupled Moser-Veselov rotation W replaces D where M and J are coupled.
    "psi_w": (("T", 0.5), ("W", 0.5), ("K", 1.0), ("W", 0.5), ("T", 0.5)),
}  # fmt: skip
# With nonconservative forces the paper's maps act undivided: equations (15), (16).
FORCED: dict[str, Program] = {
    "phi": (("Phi", 1.0),),
    "phi_adjoint": (("Phi*", 1.0),),
    "psi": (("Phi", 0.5), ("Phi*", 0.5)),
}
# Runge-Kutta methods have no sub-maps. KINDS: those that keep R on the group (see lgvi_kernels.maps.explicit).
EXPLICIT: dict[str, Tableau] = {
    "rk4": RK4, "rk5": DOPRI5, "rk5_ck": CASH_KARP, "rk8": DOP853, "cg3": CG3, "rkmk4": RK4,
}  # fmt: skip
LINEARLY_IMPLICIT: dict[str, Tableau] = {"rkw3": RKW3}
RUNGE_KUTTA = EXPLICIT | LINEARLY_IMPLICIT
KINDS = {"cg3": "group", "rkmk4": "munthe_kaas"}
ORDERS = dict.fromkeys(PROGRAMS, 2) | {"phi": 1, "phi_adjoint": 1}
ORDERS |= {name: tableau.order for name, tableau in RUNGE_KUTTA.items()}

# Two-part splittings: A = free rotation (modified Moser-Veselov, order 8) and the kick of U_b(b), B = T and the kick of
# U_R(R). Blanes & Moan (2002), J. Comput. Appl. Math. 142, 313, table 3: SRKN_6^b, SRKN_11^b, SRKN_14^a, whose printed
# coefficients are given here: name -> (order, first part, half of the palindrome without its last number of each part).
TWO_PART: dict[str, tuple[int, str, tuple[float, ...]]] = {
    "rkn4_6": (4, "B", (0.0829844064174052, 0.245298957184271, 0.396309801498368, 0.604872665711080, -0.0390563049223486)),
    "rkn6_11": (6, "B", (0.0414649985182624, 0.123229775946271, 0.198128671918067, 0.290553797799558, -0.0400061921041533,
         -0.127049212625417, 0.0752539843015807, -0.246331761062075, -0.0115113874206879, 0.357208872795928)),
    "rkn6_14": (6, "A", (0.03785931984061157, 0.09171915262446165, 0.102635633102435, 0.183983170005006, -0.02586788826655869,
         -0.05653436583288827, 0.314241403071447, 0.004914688774712854, -0.130144459517415, 0.143761127168358,
         0.106417700369543, 0.328567693746804, -0.008794243128510581)),
}  # fmt: skip
PARTS: dict[str, Program] = {"A": (("A", 1.0), ("B", 1.0)), "B": (("B", 1.0), ("A", 1.0))}

# Gauss collocation, which solves for the whole state at once: name -> number of stages, half the order.
GAUSS = {"gauss4": 2, "gauss6": 3, "gauss8": 4, "gauss10": 5, "gauss12": 6}

# Sub-maps that are exact flows: one may be divided in two, or two joined.
FLOWS = ("T", "K", "Ab", "Ap")

SOLVERS = ("quartic", "cayley", "newton", "moser_veselov")


def _palindrome(*outer: float) -> tuple[float, ...]:
    return (*outer, 1.0 - 2.0 * sum(outer), *reversed(outer))


_G3 = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
_G5 = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))

# name -> (order, stage coefficients), for a symmetric base of order 2. Hairer, Lubich & Wanner, Geometric Numerical
# Integration, 2nd ed., II.4 (triple jump, Suzuki) and V.3.2 (Kahan & Li 1997). yo6: Yoshida (1990), Phys. Lett. A 150,
# 262, solution A. su8_15: Suzuki & Umeno (1993), the coefficients of McLachlan (1995), SIAM J. Sci. Comput. 16, 151.
# ss*: Sofroniou & Spaletta (2005), Optim. Methods Softw. 20, 597.
# docs/theory/splitting.md, (S9).
COMPOSITIONS: dict[str, tuple[int, tuple[float, ...]]] = {
    "tj4": (4, _palindrome(_G3)),
    "su4": (4, _palindrome(_G5, _G5)),
    "kl6": (6, _palindrome(0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.08221359629355080023)),
    "kl8": (8, _palindrome(
        0.13020248308889008088, 0.56116298177510838456, -0.38947496264484728641, 0.15884190655515560090,
        -0.39590389413323757734, 0.18453964097831570709, 0.25837438768632204729, 0.29501172360931029887)),
    "yo6": (6, _palindrome(0.78451361047755726381949763, 0.23557321335935813368479318, -1.17767998417887100694641568)),
    "ss6_11": (6, _palindrome(
        0.21375583945878254555518066964857, 0.18329381407425713911385974425217, 0.17692819473098943794898811709929,
        -0.44329082681170215849622829626258, 0.11728560432865935385403585669136)),
    "ss6_13": (6, _palindrome(
        0.13861930854051695245808013042625, 0.13346562851074760407046858832209, 0.13070531011449225190542755785015,
        0.12961893756907034772505366537091, -0.35000324893920896516170830911323, 0.11805530653002387170273438954049)),
    "su8_15": (8, _palindrome(
        0.74167036435061295344822780, -0.40910082580003159399730010, 0.19075471029623837995387626,
        -0.57386247111608226665638773, 0.29906418130365592384446354, 0.33462491824529818378495798,
        0.31529309239676659663205666)),
    "ss8_21": (8, _palindrome(
        0.10647728984550031823931967854896, 0.10837408645835726397433410591546, 0.35337821052654342419534541324080,
        -0.23341414023165082198780281128319, -0.24445266791528841269462171413216, 0.11317848435755633314700952515599,
        0.11892905625000350062692972283951, 0.12603912321825988140305670268365, 0.12581718736176041804392391641587,
        0.11699135019217642180722881433533)),
}  # fmt: skip

# name -> (order, first half of a palindrome a_1, a_2, ...). A base Psi_h = chi*_{h/2} after chi_{h/2} gives way to its
# halves: chi over a_1 h, its adjoint chi* over a_2 h, chi over a_3 h, ... Blanes & Moan (2002), table 2: S_6 and S_10.
HALVES: dict[str, tuple[int, tuple[float, ...]]] = {
    "bm4": (4, (0.0792036964311957, 0.1303114101821663, 0.2228614958676077, -0.3667132690474257, 0.3246481886897062,
         0.1096884778767498)),
    "bm6": (6, (0.0502627644003922, 0.0985536835006498, 0.3149606169276942, -0.4473464826954782, 0.4924263724898759,
         -0.4251187677976909, 0.2370639139781219, 0.1956024886000531, 0.3463581898507269, -0.3627627792543449)),
}  # fmt: skip


def _is_count(value: Any) -> bool:
    """Whether a value is a whole number from 0 to 100, or "auto"."""
    return among(value, ("auto",)) or (isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 100)


def _is_weight(value: Any) -> bool:
    """Whether a value is a number from 0 to 1."""
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 <= value <= 1.0


def _is_tolerance(value: Any) -> bool:
    """Whether a value is a number above 0 and below 1."""
    return _is_weight(value) and 0.0 < value < 1.0


_COUNT = (
    "is not a whole number from 0 to 100",
    'give a number of Newton steps, "auto", or None to iterate to the tolerance',
)
_WEIGHT = "is not a number from 0 to 1", "give the weight of the old configuration"
_BETWEEN = "is not between 0 and 1"


@dataclass(frozen=True)
class Method(Summarized, Documented):
    """An integration method by name, and the solver of its implicit equations.

    Args:
        name: One of

            * "phi", "phi_adjoint", "psi": the maps of Nordkvist & Sanyal 2010;
            * "psi_s" (default), "psi_1", "psi_x", "psi_x8", "psi_w": symmetric splittings of order 2;
            * a composition of a symmetric method, such as "tj4(psi_s)", "su4(psi_s)", "kl6(psi_1)" or "kl8(psi_s)";
              or a composition of the two halves of its step, such as "bm4(psi_x)" or "bm6(psi_x)";
            * "rkn4_6", "rkn6_11", "rkn6_14": two-part splittings, for scenes with no forces but weight and buoyancy;
            * "gauss4" to "gauss12": Gauss collocation with fixed-point iteration, for forces that depend only on
              position and time;
            * explicit Runge-Kutta methods that store two rows of the attitude matrix: "rk4", "rk5" (Dormand & Prince),
              "rk5_ck" (Cash & Karp), "rk8" (of DOP853); explicit methods on the rotation group: "cg3" (Crouch &
              Grossman), "rkmk4" (Munthe-Kaas);
            * "rkw3": linearly implicit in the damping, for strong damping and steady motion; without damping it is "rk4".
        solver: Solver of equation (24) of Nordkvist & Sanyal: "quartic" (default), "cayley", "newton" (on the
            exponential map, as in their paper) or "moser_veselov" (explicit).
        iterations: Number of Newton steps or fixed-point iterations of a solve, 0 to 100. With None (default), a solve
            iterates to the tolerance. "auto" finds before the run the smallest number with which a trial step of twice
            the run's step converges for every member. A member whose solve later needs more gets status NOT_CONVERGED.
        tolerance: Relative residual of equation (24) above which a solve has not converged, between 0 and 1. By default
            it is 1e-14 in float64 and 1e-6 in float32, or 1e-12 and 1e-5 for a fixed number of iterations.
        alpha: Weight of the old configuration in the average of nonconservative forces, equation (15), 0 to 1; 0.5 by
            default. It is used in phi, phi_adjoint and psi only.
        beta: Weight of the old configuration in the average of nonconservative torques, equation (16); as `alpha`.
        rtol: Relative tolerance of the step control of rk5, rk5_ck and rk8. By default (None) the step is fixed. The
            root mean square of (estimated error of y_i) / (atol + rtol |y_i|) stays below 1. The y_i are position,
            attitude, and momenta divided by the largest inertia. The largest error in a packet (vehicles that are
            advanced together) sets its step. `h` is the longest step; samples, events and statuses are at multiples of `h`.
        atol: Absolute tolerance of the step control; give both tolerances or none.
        reason: Reason for an automatic choice of the method, for the summary and the provenance; "" by default.

    Attributes:
        order: Order of convergence in the step.
        stages: Stage coefficients of a composition.
        adaptive: Whether each packet chooses its own steps.
        tableau: Coefficients of a Runge-Kutta method; None for other methods.
        program: Sub-maps of one stage and their coefficients.

    Raises:
        SceneError: A setting is wrong; the message names every fault.

    Examples:
        >>> import lgvi_warp as lw
        >>> method = lw.Method("psi_s", tolerance=1e-12)
        >>> result = lw.solve(lw.Scene.named("sphere"), method, h=0.1, t1=1.0)
        >>> result.provenance["method"]["name"]
        'psi_s'
    """

    name: str = "psi_s"
    solver: str = word("quartic", known=SOLVERS)
    iterations: int | str | None = checked(_is_count, *_COUNT, None)
    tolerance: float | None = checked(_is_tolerance, _BETWEEN, "give a relative residual such as 1e-12", None)
    alpha: float = checked(_is_weight, *_WEIGHT, 0.5)
    beta: float = checked(_is_weight, *_WEIGHT, 0.5)
    rtol: float | None = checked(_is_tolerance, _BETWEEN, "give a tolerance such as 1e-9", None)
    atol: float | None = checked(_is_tolerance, _BETWEEN, "give a tolerance such as 1e-9", None)
    reason: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        faults = Faults()
        base, composition = parted(str(self.name))
        faults.choice("method", base, PROGRAMS | RUNGE_KUTTA | TWO_PART | GAUSS)
        if composition is not None:
            faults.choice("method composition", composition, COMPOSITIONS | HALVES)
            if ORDERS.get(base) == 1 or base in RUNGE_KUTTA:
                faults.add("method", self.name, "is a composition of a method that is not symmetric", "compose psi_s")
            elif base in TWO_PART or base in GAUSS:
                fault = "is a composition of a method that is not of order 2"
                faults.add("method", self.name, fault, f"use {base}, or compose psi_s")
            elif composition in HALVES and base in PROGRAMS and not divisible(PROGRAMS[base]):
                middle = PROGRAMS[base][len(PROGRAMS[base]) // 2][0]
                faults.add("method", self.name, f"would divide {middle}, and only exact flows can be divided",
                           f"use {composition}(psi_s)")  # fmt: skip
        read(self, faults)
        self._check_steps(faults)
        faults.raise_if_any()

    def summary_rows(self) -> tuple[str, summaries.Rows]:
        """Order, symmetry and the settings that differ from their defaults."""
        rows = [("order", str(self.order))]
        rows += [(item.name, str(getattr(self, item.name))) for item in fields(self)[1:]
                 if getattr(self, item.name) != item.default]  # fmt: skip
        return f"Method {self.name}", rows

    def _check_steps(self, faults: Faults) -> None:
        """Add a fault if only one of the two tolerances is set, or if the method has no error estimate."""
        tolerances = {name: value for name in ("rtol", "atol") if (value := getattr(self, name)) is not None}
        if len(tolerances) == 1:
            faults.add(*tolerances.popitem(), "is given alone", "give both rtol and atol, or none for a fixed step")
        elif tolerances and self.name in ORDERS and not (self.tableau and self.tableau.errors):
            able = ", ".join(name for name, tableau in EXPLICIT.items() if tableau.errors)
            faults.add("rtol, atol", self.name, "estimates no error", f"use one of {able}, or leave them out")

    @property
    def base(self) -> str:
        """Name of the base method of a composition; otherwise the name of this method."""
        return parted(str(self.name))[0]

    @property
    def program(self) -> Program:
        """The sub-maps of one stage as (letter, coefficient), in the order in which they are applied."""
        if self.gauss:
            return (("G", 1.0),)
        return PARTS[TWO_PART[self.base][1]] if self.two_part else PROGRAMS.get(self.base, ())

    @property
    def two_part(self) -> bool:
        """Whether the method splits the motion into the two parts A and B of "rkn4_6", "rkn6_11" and "rkn6_14"."""
        return self.base in TWO_PART

    @property
    def gauss(self) -> int:
        """Number of stages of Gauss collocation; 0 for other methods."""
        return GAUSS.get(self.base, 0)

    @property
    def halved(self) -> bool:
        """Whether each stage consists of two halves of different length."""
        return parted(str(self.name))[1] in HALVES

    @property
    def tableau(self) -> Tableau | None:
        """Coefficients of a Runge-Kutta method; None for other methods."""
        return RUNGE_KUTTA.get(self.name)

    @property
    def linearly_implicit(self) -> bool:
        """Whether the method treats damping implicitly, by a matrix in its stages."""
        return self.name in LINEARLY_IMPLICIT

    @property
    def adaptive(self) -> bool:
        """Whether each packet chooses its own steps."""
        return self.rtol is not None

    @property
    def turns(self) -> bool:
        """Whether the method rotates about the body axes one after another, instead of solving equation (24)."""
        return any(letter[0] == "R" for letter, _ in self.program)

    @property
    def stages(self) -> tuple[float, ...]:
        """The stage coefficients g_i: one step is the program over g_1 h, then over g_2 h, and so on.

        For a method of two halves or two parts, the coefficients of the first and the second alternate.
        """
        composition = parted(str(self.name))[1]
        if self.two_part:
            return palindrome_of_parts(TWO_PART[self.base][2])
        if composition is None:
            return (1.0,)
        if composition in HALVES:
            half = HALVES[composition][1]
            return (*half, *reversed(half))
        return COMPOSITIONS[composition][1]

    def lengths(self, lead: float | None) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Lengths of the stages and of the lead, in steps.

        The lead is a flow that opens and closes the program (see `merged`). A method of halves or parts has two lengths
        per stage. If the lead is one of two parts, the stages have the lengths of the other part. Since each half of a
        step h has the length h/2, a half of the length a is listed as 2 a.

        Args:
            lead: Coefficient of the lead; None without a lead.

        Returns:
            (lengths of the stages; lengths of the lead after each stage and, as the last number, before the first stage).
        """
        c, g = lead or 0.0, self.stages
        if self.two_part:
            # The parts alternate, beginning and ending with `first`: no number of the other follows its last one.
            first, second = g[0::2], g[1::2]
            if lead is None:
                return (*g, 0.0), (0.0,) * (len(first) + 1)
            return second, (*first[1:-1], first[-1] + first[0], first[0])
        if self.halved:
            doubled = tuple(2.0 * a for a in g)
            first, second = doubled[0::2], doubled[1::2]
        else:
            doubled, first, second = g, g, g
        following = (*first[1:], first[0])
        return doubled, (*(c * (b + a) for b, a in zip(second, following, strict=True)), c * first[0])

    @property
    def order(self) -> int:
        """Order of convergence in the step."""
        base, composition = parted(str(self.name))
        if self.two_part:
            return TWO_PART[base][0]
        if self.gauss:
            return 2 * self.gauss
        return ORDERS[base] if composition is None else (COMPOSITIONS | HALVES)[composition][0]

    def force_tolerance(self, dtype: str) -> float:
        """Tolerance of the iteration for the forces of the map "phi_adjoint".

        Args:
            dtype: "float64", or one of the float32 types.

        Returns:
            Relative change of the momenta below which the iteration has settled.
        """
        return 1e-14 if dtype == "float64" else 1e-6

    def tolerances(self, dtype: str) -> tuple[float, float]:
        """The two tolerances that the kernel receives.

        Args:
            dtype: "float64", or one of the float32 types.

        Returns:
            (rtol, atol) with step control; otherwise (tolerance of equation (24), `force_tolerance`).
        """
        if self.rtol is not None and self.atol is not None:
            return self.rtol, self.atol
        return self.residual_tolerance(dtype), self.force_tolerance(dtype)

    def residual_tolerance(self, dtype: str) -> float:
        """Relative residual above which a solve of equation (24) has not converged.

        Args:
            dtype: "float64", or one of the float32 types.

        Returns:
            `tolerance` if set, otherwise the default for this dtype and for the kind of iteration.
        """
        if self.tolerance is not None:
            return self.tolerance
        if self.iterations is None:
            return 1e-14 if dtype == "float64" else 1e-6
        return 1e-12 if dtype == "float64" else 1e-5


@functools.cache
def parted(name: str) -> tuple[str, str | None]:
    """Split the name of a method into its base method and its composition; the composition is None if there is none."""
    match = re.fullmatch(r"(\w+)\((\w+)\)", name)
    return (match[2], match[1]) if match else (name, None)


def merged(program: Program) -> tuple[tuple[str, float] | None, Program]:
    """Return (lead, maps): the flow that opens and closes the program, and the rest. Leads of two steps are joined."""
    first, last = program[0], program[-1]
    if len(program) > 1 and first == last and first[0] in FLOWS:
        return first, program[1:-1]
    return None, program


def palindrome_of_parts(printed: tuple[float, ...]) -> tuple[float, ...]:
    """Complete the printed coefficients of a splitting into two parts; the coefficients of each part sum to one."""
    c, n = list(printed), len(printed)
    c.append(0.5 - sum(c[n % 2 :: 2]))
    c.append(1.0 - 2.0 * sum(c[(n + 1) % 2 :: 2]))
    return (*c, *reversed(c[:-1]))


def divisible(program: Program) -> bool:
    """Tell whether a symmetric program is the product of a map and its adjoint."""
    return len(program) % 2 == 0 or program[len(program) // 2][0] in FLOWS


def divided(program: Program) -> Program:
    """Replace the middle sub-map by two halves of it."""
    n = len(program) // 2
    if len(program) % 2 == 0:
        return program
    letter, c = program[n]
    return (*program[:n], (letter, 0.5 * c), (letter, 0.5 * c), *program[n + 1 :])


def with_hops(program: Program) -> Program:
    """Insert the translations between the origins of the three axes: with coupled inertia each axis has its own origin."""
    hopped: list[tuple[str, float]] = []
    current_axis = 1
    for letter, coefficient in program:
        if letter[0] == "R":
            axis = int(letter[1])
            while current_axis != axis:
                step = 1 if axis > current_axis else -1
                hopped.append((f"h{current_axis}{current_axis + step}", 1.0))
                current_axis += step
        hopped.append((letter, coefficient))
    return tuple(hopped)


def middle_axis(program: Program) -> int:
    """Axis at whose origin a program of turns applies its kick."""
    letters = [letter for letter, _ in program]
    return int(letters[letters.index("K") - 1][1])


def simplified(program: Program, isotropic: bool) -> Program:
    """Remove the Munk moment if M = m I: it is zero then, and computing it would only add round-off."""
    if not isotropic:
        return program
    return tuple(("Ab" if letter == "T" else letter, c) for letter, c in program if letter != "Ap")
