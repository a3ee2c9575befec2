"""Thrusters with a thrust curve (quadratic, or a polynomial), dead band, saturation and first-order lag."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from lgvi_warp.common.errors import Faults, refusal
from lgvi_warp.physics.terms.base import Numbers, Packed, PackingContext, Term, knots, number, rows_of, side_by_side
from lgvi_warp.physics.terms.wrench import at_start, commands, first_row, refuse_idle


@dataclass(frozen=True, eq=False, kw_only=True)
class Thrusters(Term):
    """n thrusters, each with thrust = c+ f+(max(u - band, 0)) - c- f-(max(-u - band, 0)) along its direction (Fossen 2021, 9).

    f(w) = polynomial_1 w + polynomial_2 w^2 + ..., by default w^2. u is the command within its limit, after the lag. One
    number stands for n equal ones. The unit of the command is the user's: 1, V or rad/s.

    Args:
        position: Where each thrust acts, (n, 3) [m] from the body's origin.
        direction: Direction in which it pushes the vehicle, (n, 3), of any length but 0.
        coefficient: Coefficient c+ ahead, (n,) [N per unit of f]; 1 by default where a polynomial [N] is given.
        coefficient_astern: Coefficient c- astern, (n,) [N per unit of f]; by default that ahead.
        polynomial: Polynomial f+ of all thrusters, (p,), from the first power up; w^2 by default.
        polynomial_astern: Polynomial f- of all thrusters, (q,), from the first power up; by default that ahead.
        dead_band: Size of the command below which there is no thrust, (n,) [unit]; 0 by default.
        limit: Largest size of the command, (n,) [unit]; 1e6 by default.
        time_constant: Time constant of the first-order lag from the command to u, (n,) [s]; 0 by default, no lag.
        command: Command that is held, (n,) [unit]; 0 by default.
        times: Times of the schedule, (k,) [s], rising.
        command_schedule: Commands at these times, (k, n) [unit], linear between them; instead of `command`.

    Raises:
        SceneError: Where a direction has no length, times do not rise, the command is given twice, or neither a coefficient
            nor a polynomial is given. Also as `Term`.
    """

    type: ClassVar[str] = "thrusters"
    timed: ClassVar[bool] = True

    position: Any = number(("n", 3), "m")
    direction: Any = number(("n", 3), "1")
    coefficient: Any = number(("n",), "N per unit^2", None, least=0.0)
    coefficient_astern: Any = number(("n",), "N per unit^2", None, least=0.0)
    polynomial: Any = number(("p",), "1 per unit, 1 per unit^2 ...", None)
    polynomial_astern: Any = number(("q",), "1 per unit, 1 per unit^2 ...", None)
    dead_band: Any = number(("n",), "unit", None, least=0.0)
    limit: Any = number(("n",), "unit", None, least=0.0)
    time_constant: Any = number(("n",), "s", None, least=0.0)
    command: Any = number(("n",), "unit", None)
    times: Any = number(("k",), "s", None, rising=True)
    command_schedule: Any = number(("k", "n"), "unit", None)

    def __post_init__(self) -> None:
        if self.coefficient is None:
            if self.polynomial is None:
                fault, remedy = "is missing", "give (n,) [N per unit^2], or a polynomial [N]"
                raise refusal(f"{self.key}.coefficient", None, fault, remedy)
            object.__setattr__(self, "coefficient", np.ones(rows_of(self.position)))
        for name, value in (("polynomial", SQUARE), ("polynomial_astern", self.polynomial)):
            if getattr(self, name) is None:
                object.__setattr__(self, name, SQUARE if value is None else value)
        n = rows_of(self.coefficient)
        defaults = {"coefficient_astern": self.coefficient, "dead_band": np.zeros(n), "limit": np.full(n, 1e6),
                    "time_constant": np.zeros(n)}  # fmt: skip
        scheduled = self.command_schedule is not None
        first = first_row(self.command_schedule)
        both = scheduled and self.command is not None and not np.array_equal(self.command, first)
        if scheduled:
            defaults["command"] = first
        else:
            held = 0.0 if self.command is None else self.command
            held = np.full(n, held) if np.ndim(np.asarray(held, dtype=object)) == 0 else held
            defaults |= {"command": held, "times": [0.0], "command_schedule": [held]}
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        self.repeat(n, *(defaults.keys() - {"command_schedule"}))
        object.__setattr__(self, "_both", both)
        super().__post_init__()

    @property
    def is_square(self) -> bool:
        """Whether the curves ahead and astern are both w^2."""
        return all(np.array_equal(curve, SQUARE) for curve in (self.polynomial, self.polynomial_astern))

    def device_in(self, aligned: bool) -> str:
        """The code that evaluates polynomials only where one is given."""
        return self.device if self.is_square else "thrusters_polynomial"

    def to_dict(self) -> dict[str, Any]:
        """The term as a table of a scene file; polynomials only where they are not w^2."""
        content = super().to_dict()
        return {key: value for key, value in content.items() if not (self.is_square and key.startswith("polynomial"))}

    def thrust(self, command: Any) -> np.ndarray:
        """Steady thrust at given commands, within their limits, after the lag.

        Args:
            command: Commands (n,) or (k, n) [unit of the command].

        Returns:
            Thrust (n,) or (k, n) [N] along each direction.
        """
        u = np.clip(np.asarray(command, dtype=np.float64), -self.limit, self.limit)
        ahead = evaluate(self.polynomial, np.maximum(u - self.dead_band, 0.0))
        astern = evaluate(self.polynomial_astern, np.maximum(-u - self.dead_band, 0.0))
        return np.asarray(self.coefficient * ahead - self.coefficient_astern * astern)

    def drive(self) -> np.ndarray:
        """The largest thrusts of the schedule, as if all pushed the same way."""
        along = self.direction / np.linalg.norm(self.direction, axis=1, keepdims=True)
        wrenches = np.concatenate([along, np.cross(self.position, along)], axis=1)
        return np.asarray(np.abs(self.thrust(self.command_schedule)).max(axis=0) @ np.abs(wrenches))

    def command_for(self, thrust: Any) -> np.ndarray:
        """The smallest commands that give these thrusts.

        Args:
            thrust: Thrusts (n,), or one number for all [N].

        Returns:
            Commands (n,) [unit of the command]; where a curve does not reach the thrust, the command of its largest thrust.
        """
        least_commands = np.zeros(len(self.coefficient))
        for i, wanted in enumerate(np.broadcast_to(np.asarray(thrust, dtype=np.float64), least_commands.shape)):
            side = 1.0 if wanted > 0.0 else -1.0
            curve = self.polynomial if side > 0.0 else self.polynomial_astern
            gain = self.coefficient if side > 0.0 else self.coefficient_astern
            if wanted and gain[i] > 0.0:
                reach = max(self.limit[i] - self.dead_band[i], 0.0)
                least_commands[i] = side * (self.dead_band[i] + solve(curve, abs(wanted) / gain[i], reach))
        return np.clip(least_commands, -self.limit, self.limit)

    def check(self, faults: Faults) -> None:
        """Adds a fault where a direction has no length, or the command is given twice."""
        zero = np.flatnonzero(np.linalg.norm(self.direction, axis=1) == 0.0)
        if len(zero):
            remedy = "give the direction that the thrust pushes the vehicle, such as [1, 0, 0]"
            faults.add(f"direction[{zero[0]}]", self.direction[zero[0]], "has zero length", remedy)
        if self.__dict__["_both"]:
            faults.add("command", self.command, "differs from the first of command_schedule", "keep one of them")

    def unphysical(self, numbers: Numbers) -> dict[str, np.ndarray]:
        """In addition, refuses directions without length.

        Raises SceneError for members' numbers that would have no effect.
        """
        bad = super().unphysical(numbers)
        bad["direction"] = bad["direction"] | np.any(~np.any(numbers["direction"], axis=-1), axis=-1)
        remedy = f"give {self.key}.time_constant above 0 [s] in the scene as well"
        refuse_idle(self, numbers, "time_constant", numbers["time_constant"] > 0.0, remedy)
        self._refuse_idle_polynomial(numbers)
        return bad

    def _refuse_idle_polynomial(self, numbers: Numbers) -> None:
        """Refuse members' polynomials in a scene that has none, since its device code does not read them."""
        faults = Faults(f"{self.key}.")
        for name in ("polynomial", "polynomial_astern"):
            if self.is_square and not np.all(numbers[name] == SQUARE):
                fault = "does not act: the scene has none"
                faults.add(name, numbers[name][0], fault, f"give {self.key}.{name} in the scene as well")
        faults.raise_if_any()

    @property
    def memory(self) -> bool:
        """Whether some thruster has a lag."""
        return bool(np.any(self.time_constant > 0.0))

    def packed(self, numbers: Numbers, context: PackingContext) -> Packed:
        """The device rows: those of each thruster, then the command table of each thruster."""
        direction = numbers["direction"] / np.linalg.norm(numbers["direction"], axis=-1, keepdims=True)
        arms = np.cross(numbers["position"] + 0.0 * direction, direction + 0.0 * numbers["position"])
        force, torque = context.frame.vector(direction), context.frame.torque(arms, direction + 0.0 * arms)
        with np.errstate(divide="ignore"):
            rate = np.where(numbers["time_constant"] > 0.0, 1.0 / numbers["time_constant"], FAST)
        settings = [numbers[key] for key in ("coefficient", "coefficient_astern", "dead_band", "limit")]
        blocks = [force, torque, *(x[..., None] for x in (*settings, rate))]
        times, schedule = commands(numbers)
        thrusters, count = side_by_side(*blocks), schedule.shape[2]
        rows = [thrusters.reshape(len(thrusters), -1)]
        rows += [knots(times, schedule[:, :, i : i + 1]) for i in range(count)]
        values = {"count": count, "knots": times.shape[1] - 1, "lagged": int(self.memory)}
        if not self.is_square:
            ahead, astern = numbers["polynomial"], numbers["polynomial_astern"]
            values["powers"] = max(ahead.shape[1], astern.shape[1])
            rows += [np.pad(curve, ((0, 0), (0, values["powers"] - curve.shape[1]))) for curve in (ahead, astern)]
        if not self.memory:
            return Packed(values | {"memory": 0}, side_by_side(*rows))
        start = np.clip(at_start(times, schedule), -numbers["limit"], numbers["limit"])
        return Packed(values, side_by_side(*rows), start)


# 1 / time constant of a thruster without lag beside others with one: faster than any step, and within float32.
FAST = 1e20


# The curve w^2, coefficients from the first power up.
SQUARE = (0.0, 1.0)


def evaluate(polynomial: np.ndarray, w: np.ndarray) -> np.ndarray:
    """Value of a polynomial without a constant, p_1 w + p_2 w^2 + ...

    Args:
        polynomial: Coefficients from the first power up.
        w: Arguments, of any shape.

    Returns:
        Values in the shape of `w`.
    """
    value = np.zeros_like(w)
    for coefficient in polynomial[::-1]:
        value = (value + coefficient) * w
    return value


def solve(polynomial: np.ndarray, wanted: float, reach: float) -> float:
    """The smallest w in [0, reach] at which a polynomial without a constant has a given value.

    Args:
        polynomial: Coefficients from the first power up.
        wanted: The value, above 0.
        reach: Upper end of the interval.

    Returns:
        That w; where the polynomial does not reach the value, the w of its largest value.
    """
    powers = np.concatenate([[-wanted], polynomial])
    slope = np.polynomial.polynomial.polyder(powers)
    turns = _within(np.polynomial.polynomial.polyroots(slope), reach)
    places = np.array([0.0, *turns, reach])
    values = evaluate(polynomial, places)
    if values.max() <= wanted:
        return float(places[values.argmax()])
    # The polynomial is monotonic between its turns: the first interval at whose end it reaches the value has the root.
    i = int((values >= wanted).argmax())
    low, high = places[i - 1], places[i]
    for _ in range(200):
        middle = 0.5 * (low + high)
        if evaluate(polynomial, np.array(middle)) < wanted:
            low = middle
        else:
            high = middle
    return float(high)


def _within(roots: np.ndarray, reach: float) -> np.ndarray:
    """The real roots strictly between 0 and reach, sorted."""
    real = roots.real[np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots))]
    return np.sort(real[(real > 0.0) & (real < reach)])
